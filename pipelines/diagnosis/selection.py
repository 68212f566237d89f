"""Select causes: forward by the predictive score, a confidence set at each round, then backward.

selection = select(later, baseline, responses, config)
selection.causes              each with its alternatives
selection.stopped             why the search ended, where it did not for lack of anything left
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.diagnosis.baseline import Baseline
from pipelines.diagnosis.candidates import Key
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.events import Window, push_of
from pipelines.diagnosis.refit import Fit, Later, State
from pipelines.diagnosis.score import confidence_set, log_scores, probabilities
from pipelines.diagnosis.screening import Screened, best_of
from pipelines.diagnosis.table import Array
from pipelines.model.arm import Acting
from pipelines.model.effects.base import Effect
from pipelines.model.effects.coulomb import Coulomb
from pipelines.model.rows.exact import Exact

__all__ = [
    "Candidate",
    "CandidateFit",
    "Cause",
    "Round",
    "SearchStart",
    "Selection",
    "refit",
    "select",
]


@dataclass(frozen=True)
class Candidate:
    """A cause that was refitted exactly."""

    key: Key
    gain: float  # of screening
    state: State
    possible: bool  # its numbers are such as it can have

    @property
    def numbers(self) -> int:
        """Numbers that it adds to the model."""
        return self.state.model.effects[-1].count

    @property
    def event(self) -> bool:
        """True for a cause of one moment in one log."""
        return self.state.model.effects[-1].log is not None


@dataclass(frozen=True)
class CandidateFit:
    """A candidate and its fit."""

    key: Key
    fit: Fit


@dataclass(frozen=True)
class Cause:
    """A selected cause, with those that the data do not tell from it."""

    key: Key
    alternatives: tuple[Key, ...]
    probability: Mapping[Key, float]  # of it, of each alternative and of shapes without a name


@dataclass(frozen=True, eq=False)
class Selection:
    """The causes of a session."""

    causes: tuple[Cause, ...]
    start: State
    end: State
    explained: float  # cost that the causes save
    stopped: str  # why a significant cause was not selected; "" where there was none
    follows: str  # what the rest follows; "" where nothing is significant
    rounds: tuple[Round, ...] = ()
    cut: tuple[Key, ...] = ()  # causes still significant when the largest number was reached
    moment: str = ""  # what stands out at one moment, and no event explains

    @property
    def without_selected_alternatives(self) -> Selection:
        """The same without alternatives that are causes: backward elimination kept both."""
        keys = {one.key for one in self.causes}
        new = {
            id(one): replace(one, alternatives=tuple(k for k in one.alternatives if k not in keys))
            for one in self.causes
        }
        rounds = (replace(one, cause=new.get(id(one.cause), one.cause)) for one in self.rounds)
        causes = tuple(new[id(one)] for one in self.causes)
        return replace(self, causes=causes, rounds=tuple(rounds))

    @property
    def found(self) -> SearchStart:
        """The selected causes, for a further search."""
        rounds = tuple(one for one in self.rounds if one.cause is not None)
        return SearchStart(self.causes, self.end.model, rounds)


@dataclass(frozen=True, eq=False)
class Round:
    """The outcome of one round of the forward selection."""

    before: Fit
    cause: Cause | None
    after: Fit | None
    stopped: str = ""
    follows: str = ""
    significant: tuple[Screened, ...] = ()
    tried: tuple[CandidateFit, ...] = ()
    moment: str = ""  # what stands out at one moment, and no event explains


@dataclass(frozen=True, eq=False)
class SearchStart:
    """The causes and the model from which a further search starts."""

    causes: tuple[Cause, ...]
    model: Exact
    rounds: tuple[Round, ...]  # in which a cause was selected


def select(
    later: Later,
    baseline: Baseline,
    responses: Sequence[Acting],
    config: DiagnosisConfig,
    before: SearchStart | None = None,
) -> Selection:
    """Return the causes that explain the later rows.

    Args:
        responses: causes that frequency responses name, with their numbers; candidates like others.
        before: what was selected before the noise was known beside it.
    """
    start = state = later.start()
    causes: list[Cause] = []
    if before is not None:
        causes, state = list(before.causes), later.start(before.model)
    stopped = follows = ""
    explained = max(start.cost - state.cost, 0.0)
    rounds = [] if before is None else list(before.rounds)
    while len(causes) < config.causes:
        found, after = _round(
            later, state, causes, explained, baseline, responses if not causes else (), config
        )
        rounds.append(found)
        stopped, follows = found.stopped, found.follows
        if found.cause is None or after is None:
            break
        causes.append(found.cause)
        explained += max(state.cost - after.cost, 0.0)
        state = after
    cut: tuple[Key, ...] = ()
    if len(causes) >= config.causes:
        taken = [cause.key for cause in causes]
        composed = later.composed(state.model)
        more = _significant(composed, state, taken, explained, baseline, config).values()
        ranked = sorted(more, key=lambda one: -one.gain)
        ranked = [one for one in ranked if not _slight(composed, _torque(composed, one), config)]
        cut = tuple(one.group.key for one in ranked if one.group.kind != "unnamed")
    causes, state = _backward(later, causes, state, config)
    moment = rounds[-1].moment if rounds else ""
    return Selection(
        tuple(causes), start, state, explained, stopped, follows, tuple(rounds), cut, moment
    )


def _round(
    later: Later,
    state: State,
    causes: Sequence[Cause],
    explained: float,
    baseline: Baseline,
    responses: Sequence[Acting],
    config: DiagnosisConfig,
) -> tuple[Round, State | None]:
    """Return the cause that explains most of the residual of `state`, and the state fitted with it.

    Where none is selected, the round says why, and there is no state.
    """
    later = later.composed(state.model)
    significant = _significant(
        later, state, [cause.key for cause in causes], explained, baseline, config
    )
    touch, moment = push_of(later.rows, later.dictionary, later.dataset.arm, state.residual, config)
    promising = _promising(later, state, significant, config)
    refitted = _refitted(later, state, promising, responses, touch, config)
    tried = [
        one for one in refitted if _relevant(later, state, one, significant, explained, config)
    ]
    others = _unnamed(later, state, significant, bool(responses))
    seen = Round(
        state.fit,
        None,
        None,
        significant=tuple(significant.values()),
        tried=tuple(CandidateFit(one.key, one.state.fit) for one in tried),
        moment=moment,
    )
    if not tried:
        return replace(seen, follows=_place(next(iter(others))) if others else ""), None
    apart = _apart(later, state, significant, others, baseline, config)
    pick, cause, stopped = _contest(later, state, tried, others, apart, config)
    if pick is None:  # perhaps by another law of the same cause
        tried = [_other_form(later, state, one, config) for one in tried]
        pick, cause, stopped = _contest(later, state, tried, others, apart, config)
    if pick is None:
        return replace(seen, stopped=stopped), None
    chosen = _other_form(later, state, pick, config).state
    return replace(seen, cause=cause, after=chosen.fit), chosen


def _significant(
    later: Later,
    state: State,
    taken: Sequence[Key],
    explained: float,
    baseline: Baseline,
    config: DiagnosisConfig,
) -> dict[Key, Screened]:
    """Return the candidates above the family-wise threshold, the best shape of each.

    No law is exact: at the joints of the causes found so far, and of what stands since the
    reference, what remains of these is larger than the noise, and a further cause has to gain more
    than a share of what they explain there.
    """
    rows = later.rows.count
    known = later.shares @ _inexact(later, state, explained, config)
    inexact = dict(zip(later.dictionary.groups, known, strict=True))
    return {
        key: one
        for key, one in best_of(later.screened(state)).items()
        if (key not in taken or later.again(key))
        and one.gain > inexact[one.group]
        and one.gain > baseline.threshold(one.group, one.freedom, rows)
        and (one.group.kind == "named" or not _slight(later, _torque(later, one), config))
    }


def _inexact(later: Later, state: State, explained: float, config: DiagnosisConfig) -> Array:
    """Return the gain (joints,) that the causes found account for, because no law is exact."""
    return config.relevance * (explained * later.acting(state) + later.standing)


def _relevant(
    later: Later,
    state: State,
    one: Candidate,
    significant: Mapping[Key, Screened],
    explained: float,
    config: DiagnosisConfig,
) -> bool:
    """Return whether a cause, refitted, saves more than the laws found before it are inexact.

    A cause whose torque is within that of healthy machines is rejected. A joint where it saves less
    counts for nothing, and one that it makes worse counts against it. What the standing numbers
    have taken of it is a part of what it saves.
    """
    if one.event:
        return one.gain >= config.relevance * explained
    if one.key not in significant:  # frequency responses name it
        return True
    model = one.state.model
    both = (later.rows.torque(x) for x in (model, model.without(len(model.effects) - 1)))
    if _slight(later, [a - b for a, b in zip(*both, strict=True)], config):
        return False
    group = significant[one.key].group
    shares = later.shares[later.dictionary.groups.index(group)]
    saved = np.array(
        [a @ a - b @ b for a, b in zip(state.residual, one.state.residual, strict=True)]
    )
    more = later.taken(state, [group])[0]
    if one.key[1] is not None:  # of the whole arm base parameters are freed, which saves nothing
        more += state.cost - state.rss - one.state.cost + one.state.rss
    saved = saved + more * shares
    beyond = saved - _inexact(later, state, explained, config)
    return float(np.where(saved > 0.0, np.maximum(beyond, 0.0), saved).sum()) > 0.0


def _slight(later: Later, torque: Sequence[Array], config: DiagnosisConfig) -> bool:
    """Return whether torque is as small as healthy machines have some, at every joint."""
    least = later.usual(config)
    return all(float(np.linalg.norm(x)) <= own for x, own in zip(torque, least, strict=True))


def _torque(later: Later, one: Screened) -> tuple[Array, ...]:
    """Return the torque of a screened candidate, joint by joint, in units of the noise."""
    return later.candidates.take(one.group.columns).times(one.amplitudes)


def _contest(
    later: Later,
    state: State,
    tried: Sequence[Candidate],
    others: Mapping[Key, State],
    apart: Mapping[Key, Sequence[Key]],
    config: DiagnosisConfig,
) -> tuple[Candidate | None, Cause | None, str]:
    """Return the winner of the predictive scores with its alternatives, or why nothing wins."""
    scores = {one.key: _scores(later, one.state, one.numbers) for one in tried}
    free = {
        key: _scores(later, other, other.effects.width - state.effects.width)
        for key, other in others.items()
    }
    without = _scores(later, state)
    best = _place(min(scores, key=lambda key: scores[key].sum()))
    fails = f"{best} does not pay on blocks that it was not fitted to"
    better = {k: v for k, v in (scores | free).items() if v.sum() < without.sum()}
    if not any(one.key in better for one in tried):
        return None, None, fails
    kept, first = confidence_set(better, config), min(better, key=lambda key: better[key].sum())
    named = [one for one in tried if one.key in kept]
    if first in free or not named:
        promising = [one for one in tried if one.key in better]
        named = _nearly(later, state, promising, others, config)
        named = named or _beside(promising, better, apart, config)
    if not named:
        return None, None, f"{_place(first)} predicts better than {best}"
    pick = min(named, key=lambda one: scores[one.key].sum())
    unchanged = _scores(later, later.unchanged(state, pick.key))
    pays = confidence_set({"with": scores[pick.key], "without": unchanged}, config)
    if "without" in pays and not pick.event:
        return None, None, fails
    alike = tuple(one.key for one in named if one is not pick)
    rivals = {shape: v for shape, v in free.items() if pick.key not in apart[shape]}
    return pick, Cause(pick.key, alike, probabilities(scores | rivals, config)), ""


def _beside(
    tried: Sequence[Candidate],
    better: Mapping[Key, Array],
    apart: Mapping[Key, Sequence[Key]],
    config: DiagnosisConfig,
) -> list[Candidate]:
    """Return the causes that predict better than every shape that may explain the same.

    What a shape without a name explains elsewhere takes no cause its name.
    """
    best = {}
    for one in tried:
        rivals = [k for k, separate in apart.items() if k in better and one.key not in separate]
        if all(better[one.key].sum() < better[k].sum() for k in rivals):
            best[one.key] = better[one.key]
    kept = confidence_set(best, config) if best else []
    return [one for one in tried if one.key in kept]


def _apart(
    later: Later,
    state: State,
    significant: Mapping[Key, Screened],
    others: Mapping[Key, State],
    baseline: Baseline,
    config: DiagnosisConfig,
) -> dict[Key, list[Key]]:
    """Return, for each shape without a name, the causes that explain something else than it does.

    Beside it they are significant, gain more than a share of what they gain alone, and more than
    the shape leaves because no law is exact.
    """
    out = {}
    for shape, other in others.items():
        gains = {one.group: one.gain for one in later.screened(other)}
        inexact = config.relevance * (state.cost - other.cost)
        out[shape] = [
            key
            for key, one in significant.items()
            if gains[one.group]
            > max(
                config.share * one.gain,
                inexact,
                baseline.threshold(one.group, one.freedom, later.rows.count),
            )
        ]
    return out


def _nearly(
    later: Later,
    state: State,
    tried: Sequence[Candidate],
    others: Mapping[Key, State],
    config: DiagnosisConfig,
) -> list[Candidate]:
    """Return the cause that explains as much as any unnamed shape, as far as laws are exact.

    What a model explains is the cost that it saves, less ln(rows) for each number (Schwarz 1978).
    """
    number = np.log(later.rows.count)
    saved = [state.cost - one.state.cost - one.numbers * number for one in tried]
    best = int(np.argmax(saved))
    free = max(
        state.cost - one.cost - (one.effects.width - state.effects.width) * number
        for one in others.values()
    )
    return [tried[best]] if 0.0 < saved[best] > (1.0 - config.relevance) * free else []


def _promising(
    later: Later, state: State, significant: Mapping[Key, Screened], config: DiagnosisConfig
) -> list[Screened]:
    """Return the significant causes that are the most promising ones, the best first.

    A cause is promising by its gain, or by its gain and what the standing numbers have taken of it,
    for healthy machines have it in small. The one of the largest gain is always among them.
    """
    named = {key: one for key, one in significant.items() if one.group.kind == "named"}
    taken = later.taken(state, [one.group for one in named.values()])
    worth = {key: named[key].gain + more for key, more in zip(named, taken, strict=True)}
    gain = {key: one.gain for key, one in named.items()}
    best = [
        {k for k, x in by.items() if x > config.promising * max(by.values())}
        for by in (gain, worth)
    ]
    most = max(gain.values(), default=0.0)
    order = sorted(best[0] | best[1], key=lambda key: (gain[key] < most, -worth[key]))
    return [named[key] for key in order[: config.refits]]


def _refitted(
    later: Later,
    state: State,
    named: Sequence[Screened],
    responses: Sequence[Acting],
    touch: Window | None,
    config: DiagnosisConfig,
) -> list[Candidate]:
    """Return causes with all their numbers fitted exactly, beside the best window of an event."""
    out = []
    if touch is not None:
        out.append(
            _candidate(
                later,
                state,
                (touch.effect.name, None),
                touch.gain,
                touch.effect,
                touch.amplitudes,
                config,
                log=touch.log,
            )
        )
    top = max([one.gain for one in named], default=0.0)
    for one in named:
        effect = later.dictionary.families[one.group.key].shapes[one.group.shape].forms()[0]
        out.append(
            _candidate(later, state, one.group.key, one.gain, effect, one.amplitudes, config)
        )
    for acting in responses:
        effect = acting.effect.at(acting.values)
        out.append(
            _candidate(
                later,
                state,
                (effect.name, effect.joint),
                max(top, 1.0),
                effect,
                effect.amplitudes(acting.values),
                config,
            )
        )
    return [one for one in out if one is not None and one.possible]


def _candidate(
    later: Later,
    state: State,
    key: Key,
    gain: float,
    effect: Effect,
    amplitudes: Array,
    config: DiagnosisConfig,
    log: int | None = None,
) -> Candidate | None:
    """Return the cause refitted; None where its fit fails, which costs that candidate alone."""
    start = np.zeros(max(len(amplitudes), later.amplitudes_of(effect)))
    start[: len(amplitudes)] = amplitudes
    belief = later.beside(state.belief, effect)
    model = state.model.with_effect(effect, start, log=log)
    try:
        fits = [later.fit(one, state.theta, belief) for one in (model, *_plainer(model))]
    except np.linalg.LinAlgError:
        return None
    fitted = min(fits, key=lambda one: one.cost)
    possible = later.possible(fitted, state.cost - fitted.cost, config) and bool(
        np.isfinite(fitted.losses).all()
    )
    return Candidate(key, gain, fitted, possible)


def _plainer(model: Exact) -> tuple[Exact, ...]:
    """Return the model with the plain sign change at its last effect's joint, if it has another.

    Fitted without the effect, the curve of the sign change has taken some of it.
    """
    columns, joint = model.columns, model.effects[-1].effect.joint
    plain = tuple(
        law.plain() if law.joint == joint and isinstance(law, Coulomb) else law
        for law in columns.laws
    )
    if plain == tuple(columns.laws):
        return ()
    return (replace(model, columns=replace(columns, laws=plain)),)


def _unnamed(
    later: Later, state: State, significant: dict[Key, Screened], responses: bool
) -> dict[Key, State]:
    """Return the best shape without a name, and, without responses, the best compliance."""
    out = {}
    kinds = ("unnamed",) if responses else ("unnamed", "compliance")
    for kind in kinds:
        own = [one for one in significant.values() if one.group.kind == kind]
        if own:
            one = max(own, key=lambda s: s.gain - s.freedom * np.log(later.rows.count))
            out[one.group.key] = later.with_columns(state, later.candidates.take(one.group.columns))
    return out


def _other_form(
    later: Later, state: State, chosen: Candidate, config: DiagnosisConfig
) -> Candidate:
    """Return the chosen cause by the law of it that predicts best."""
    best, one = chosen, chosen.state.model.effects[-1]
    if one.log is not None:
        return best
    for form in one.effect.forms()[1:]:
        other = _candidate(
            later, state, chosen.key, chosen.gain, form, np.array(one.amplitudes), config
        )
        if other is None or not other.possible:
            continue
        if _total(later, other) < _total(later, best):
            best = other
    return best


def _total(later: Later, one: Candidate) -> float:
    """Return the predictive score of all blocks."""
    return float(_scores(later, one.state, one.numbers).sum())


def _backward(
    later: Later, causes: list[Cause], end: State, config: DiagnosisConfig
) -> tuple[list[Cause], State]:
    """Take out every cause without which the rest predicts as well.

    What happened at one moment is not told by predictions of other times: it stood out of these.
    """
    place = 0
    while len(causes) > 1 and place < len(causes):
        if end.model.effects[place].log is not None:
            place += 1
            continue
        model = end.model.without(place)
        without = later.fit(model, end.theta, later.belief_of(model))
        scores = {"with": _scores(later, end), "without": _scores(later, without)}
        if "without" in confidence_set(scores, config):
            causes, end, place = [c for k, c in enumerate(causes) if k != place], without, 0
        else:
            place += 1
    return causes, end


def _scores(later: Later, state: State, numbers: int = 0) -> Array:
    """Return the predictive score of each block, with its share of what the model costs.

    A standing number that is far from the prior predicts other blocks as well as a cause does: what
    the prior says against it is charged, and further numbers as BIC does (Schwarz 1978).
    """
    price = state.cost - state.rss + numbers * np.log(later.rows.count)
    return np.asarray(log_scores(state.losses, later.block_rows) + price / len(later.block_rows))


def _place(key: Key) -> str:
    return key[0] if key[1] is None else f"{key[0]}:{key[1]}"


def refit(
    later: Later,
    state: State,
    key: Key,
    effect: Effect,
    amplitudes: Array,
    config: DiagnosisConfig,
) -> Candidate | None:
    """Return a cause that somebody names, refitted, by the law of it that predicts best."""
    one = _candidate(later, state, key, 0.0, effect, amplitudes, config)
    return None if one is None else _other_form(later, state, one, config)
