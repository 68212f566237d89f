"""Select causes: forward by the predictive score, a confidence set at each round, then backward.

selection = select(later, baseline, responses)
selection.causes              each with its alternatives
selection.rounds              the last of them says why the search ended
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pipelines.diagnosis.baseline import Baseline
from pipelines.diagnosis.candidate_fits import (
    Candidate,
    best_law,
    candidate,
    laws,
    possible,
    reformed,
    scores_of,
)
from pipelines.diagnosis.events import Window, no_push, push_of
from pipelines.diagnosis.refit import Later
from pipelines.diagnosis.score import confidence_set, probabilities
from pipelines.diagnosis.screening import Screened, best_of
from pipelines.diagnosis.state import Fit, State
from pipelines.diagnosis.unnamed import Key, in_words
from pipelines.dynamics.arm import Acting
from pipelines.effects.base import Effect
from pipelines.estimation.exact_model import Exact
from pipelines.estimation.joint_table import Array

__all__ = ["Cause", "Round", "SearchStart", "Selection", "select"]

_TURNS = 2  # numerics: groups of promising causes that are refitted until one is a cause


@dataclass(frozen=True)
class Cause:
    """A selected cause, with those that the data do not tell from it."""

    key: Key
    alternatives: tuple[Key, ...]
    probability: Mapping[Key, float]  # of it, of each alternative and of shapes without a name


@dataclass(frozen=True, eq=False)
class Round:
    """The outcome of one round of the forward selection."""

    before: Fit
    significant: tuple[Screened, ...]
    tried: Mapping[Key, Fit]  # causes that were refitted exactly
    cause: Cause | None = None
    after: Fit | None = None
    stopped: str = ""  # why a significant cause was not selected
    follows: str = ""  # what the rest follows
    moment: str = ""  # an anomaly at one moment that no event explains
    doubt: str = ""  # a cause that the answer of the loop to noise looks like


@dataclass(frozen=True, eq=False)
class SearchStart:
    """The causes and the model from which a further search starts."""

    causes: tuple[Cause, ...]
    model: Exact
    rounds: tuple[Round, ...]  # in which a cause was selected
    settled: bool = False  # an earlier search from these causes has chosen their laws


@dataclass(frozen=True, eq=False)
class Selection:
    """The causes of a session."""

    causes: tuple[Cause, ...]
    start: State
    end: State
    rounds: tuple[Round, ...]
    cut: tuple[Key, ...] = ()  # causes still significant when the largest number was reached

    @property
    def without_selected_alternatives(self) -> Selection:
        """The same without alternatives that are causes: backward elimination kept both."""
        keys = {one.key for one in self.causes}

        def alone(one: Cause) -> Cause:
            return replace(one, alternatives=tuple(k for k in one.alternatives if k not in keys))

        new = {id(one): alone(one) for one in self.causes}
        rounds = tuple(replace(one, cause=new.get(id(one.cause), one.cause)) for one in self.rounds)
        return replace(self, causes=tuple(new.values()), rounds=rounds)

    def without(self, later: Later, place: int) -> Selection:
        """Return the selection without a cause whose size may be none, the others fitted anew."""
        gone, model = self.causes[place], self.end.model.without(place)
        why = f"the size of {in_words(gone.key)} may be none by its standard deviation"
        was = self.rounds
        rounds = (replace(r, cause=None, stopped=why) if r.cause is gone else r for r in was)
        end = later.fit(model, self.end.theta, later.belief_of(model))
        causes = tuple(one for one in self.causes if one is not gone)
        return replace(self, causes=causes, end=end, rounds=tuple(rounds))

    @property
    def found(self) -> SearchStart:
        """The selected causes, for a further search."""
        rounds = tuple(one for one in self.rounds if one.cause is not None)
        return SearchStart(self.causes, self.end.model, rounds)


def select(
    later: Later, baseline: Baseline, responses: Sequence[Acting], before: SearchStart | None = None
) -> Selection:
    """Return the causes that explain the later rows.

    Args:
        responses: causes that frequency responses name, with their numbers; candidates like others.
        before: the selection of an earlier search, with less knowledge of the noise.
    """
    start = state = later.start()
    causes, rounds, most = list[Cause](), list[Round](), later.config.causes
    if before is not None:
        kept: Sequence[int] = range(len(before.causes))
        state = later.start(before.model)
        if not before.settled:
            kept, state = reformed(later, state)
        causes = [before.causes[k] for k in kept]
        rounds = [one for one in before.rounds if one.cause in causes]
    cut = tuple[Key, ...]()
    while True:
        step = _Step(later.composed(state.model), start, state, baseline, causes)
        pushes = sum(one.log is not None for one in state.model.effects)  # together they are one
        full = len(causes) - pushes + min(pushes, 1) >= most
        if full and not 0 < pushes < len(later.rows.data.logs):
            cut = step.relevant_keys
            break
        found, after = step.round(() if causes else responses)
        if full and after is not None and after.model.effects[-1].log is None:
            cut = step.relevant_keys
            break
        rounds.append(found)
        if found.cause is None or after is None:
            break
        causes, state = [*causes, found.cause], after
    causes, state = _backward(later, causes, state)
    return Selection(tuple(causes), start, state, tuple(rounds), cut)


@dataclass(frozen=True, eq=False)
class _Step:
    """One round of the forward selection: candidates for what a state leaves."""

    later: Later  # with the columns of drives and records beside the effects of the state
    start: State  # without causes
    state: State
    baseline: Baseline
    causes: Sequence[Cause]  # selected before, which the state has

    def round(self, responses: Sequence[Acting]) -> tuple[Round, State | None]:
        """Return the cause that explains most of the residual, and the state fitted with it.

        Where none is selected, the round says why, and there is no state.
        """
        later = self.later
        touch, moment = self._push()
        every = self._refitted(responses, touch)
        if touch is not None and not any(one.event for one in every):
            moment = no_push(later.rows, touch)
        noisy = [one for one in every if one.noisy]
        most = max((one.gain for one in noisy), default=0.0)
        tried = [one for one in every if not (one.noisy or (one.event and one.gain < most))]
        said = [f"{in_words(one.key)} may be the answer of the loop to noise" for one in noisy]
        others = self._unnamed(not responses)
        fits = {one.key: one.state.fit for one in tried}
        significant, doubt = tuple(self.significant.values()), "; ".join(said)
        seen = Round(self.state.fit, significant, fits, moment=moment, doubt=doubt)
        if not tried:
            return replace(seen, follows=in_words(next(iter(others))) if others else ""), None
        pick, cause, stopped = self._winner(tried, others)
        if pick is None:
            return replace(seen, stopped=stopped), None
        chosen = best_law(later, self.state, pick).state
        return replace(seen, cause=cause, after=chosen.fit), chosen

    def _winner(
        self, tried: Sequence[Candidate], others: Mapping[Key, State]
    ) -> tuple[Candidate | None, Cause | None, str]:
        """Return the cause that wins by its first law, by another one, or beside one more cause."""
        later = self.later
        apart = {shape: self._apart(other) for shape, other in others.items()}
        pick, cause, stopped = self._contest(tried, others, apart)
        if pick is None:
            tried = [best_law(later, self.state, one) for one in tried]
            pick, cause, stopped = self._contest(tried, others, apart)
        if pick is None and (two := self._completed_by_another(tried)) is not None:
            scores = {one.key: one.scores(later) for one in tried}
            pick, cause = two, Cause(two.key, (), probabilities(scores, later.config))
        return pick, cause, stopped

    def _push(self) -> tuple[Window | None, str]:
        """Return the push that exceeds all else, and is relevant beside the causes found."""
        later, left = self.later, self.state.residual
        touch, moment = push_of(later.rows, later.dictionary, later.dataset.arm, left, later.config)
        least = later.config.relevance * (self.start.cost - self.state.cost)
        return (touch if touch is not None and touch.gain >= least else None), moment

    def _completed_by_another(self, tried: Sequence[Candidate]) -> Candidate | None:
        """Return the best cause if one more leaves nothing that a shape without a name explains.

        A free curve predicts better than one of two causes that act alike.
        """
        first = min(tried, key=lambda one: float(one.scores(self.later).sum()))
        step = self._after(first)
        complete = any(not step._after(one)._unnamed(False) for one in step._refitted((), None))
        return first if complete else None

    def _after(self, one: Candidate) -> _Step:
        """Return the round that follows the selection of a cause."""
        later, causes = self.later.composed(one.state.model), [*self.causes, Cause(one.key, (), {})]
        return replace(self, later=later, state=one.state, causes=causes)

    @cached_property
    def significant(self) -> dict[Key, Screened]:
        """The candidates above the family-wise threshold, the best shape of each.

        They matter beside the causes found. Of waves that is judged when they are fitted: on long
        travel orders are resolved more finely than the shapes, and columns of a neighbouring order
        show a part of the gain.
        """
        later, taken = self.later, {cause.key for cause in self.causes}
        return {
            key: one
            for key, one in best_of(later.screened(self.state)).items()
            if (key not in taken or later.again(key))
            and one.gain > self._threshold(one)
            and (later.waves(key) or self._matters(one))
        }

    @property
    def relevant_keys(self) -> tuple[Key, ...]:
        """The significant causes, the strongest first."""
        ranked = sorted(self.significant.values(), key=lambda one: -one.gain)
        ranked = [one for one in ranked if one.group.kind != "unnamed" and self._matters(one)]
        ranked = [one for one in ranked if not self.later.slight(self._torque(one))]
        return tuple(one.group.key for one in ranked)

    def _matters(self, one: Screened) -> bool:
        """Return whether a candidate gains more than laws are inexact, and healthy machines have.

        At the joints of the causes found so far, and of standing causes, the errors of their laws
        are larger than the noise.
        """
        place = self.later.dictionary.groups.index(one.group)
        inexact = float(self.later.shares[place] @ self._inexact)
        named = one.group.kind == "named"  # its torque is known when it is fitted
        return one.gain > inexact and (named or not self.later.slight(self._torque(one)))

    def _threshold(self, one: Screened) -> float:
        return self.baseline.threshold(one.group, one.freedom, self.later.rows.count)

    @cached_property
    def _inexact(self) -> Array:
        """Gain (joints,) that the causes found account for, because no law is exact.

        It is a share of what they save at each joint; what they save of the prior's cost belongs to
        the joints where they act.
        """
        start, state = self.start, self.state
        prior = max(start.cost - start.rss - state.cost + state.rss, 0.0)
        saved = np.maximum(start.squares - state.squares, 0.0)
        saved = (saved + prior * self.later.acting(state)) * self.later.inexact(state)
        return np.asarray(self.later.config.relevance * (saved + self.later.standing))

    def _torque(self, one: Screened) -> tuple[Array, ...]:
        """Return the torque of a screened candidate, joint by joint, in units of the noise."""
        return self.later.candidates.take(one.group.columns).times(one.amplitudes)

    def _relevant(self, one: Candidate) -> bool:
        """Return whether a cause, refitted, saves more than the laws found before it are inexact.

        What it saves beyond that has to be above the threshold of chance. A cause within what
        healthy machines have is rejected. A joint where it saves less counts for nothing, and one
        that it makes worse counts against it. What the standing numbers have taken of it is a part
        of what it saves.
        """
        later, state, new = self.later, self.state, one.state
        if one.event or one.key not in self.significant:  # frequency responses name it
            return True
        models = (new.model, new.model.without(len(new.model.effects) - 1))
        both = [later.rows.torque(model) for model in models]
        if later.slight([a - b for a, b in zip(*both, strict=True)]):
            return False
        group = self.significant[one.key].group
        shares = later.shares[later.dictionary.groups.index(group)]
        saved = state.squares - new.squares
        more = later.taken(state, [group])[0]
        if one.key[1] is not None:  # of the whole arm base parameters are freed: that saves nothing
            more += state.cost - state.rss - new.cost + new.rss
        saved = saved + more * shares
        counted = np.where(saved > 0.0, np.maximum(saved - self._inexact, 0.0), saved)
        return float(counted.sum()) > self._threshold(self.significant[one.key])

    def _promising(self, without: Collection[Key]) -> list[Screened]:
        """Return the significant causes that are the most promising ones, the best first.

        A cause is promising by its gain, or by its gain and what the standing numbers have taken of
        it, for healthy machines have it in small. That of the largest gain is always among them,
        and the best of the waves that matter only when they are fitted comes last.
        """
        config = self.later.config
        every = {k: one for k, one in self.significant.items() if k not in without}
        named = {key: one for key, one in every.items() if one.group.kind == "named"}
        gain = {key: one.gain for key, one in named.items() if self._matters(one)}
        fine = sorted((k for k in named if k not in gain), key=lambda key: -named[key].gain)[:1]
        order: list[Key] = []
        if gain:
            taken = self.later.taken(self.state, [named[key].group for key in gain])
            worth = {key: gain[key] + more for key, more in zip(gain, taken, strict=True)}
            most, top = max(gain.values()), max(worth.values())
            near = {key: max(gain[key] / most, worth[key] / top) for key in gain}
            best = [key for key in gain if near[key] > config.promising]
            order = sorted(best, key=lambda key: (gain[key] < most, -worth[key]))
        return [named[key] for key in (*order[: config.refits], *fine)]

    def _refitted(self, responses: Sequence[Acting], touch: Window | None) -> list[Candidate]:
        """Return relevant causes with all their numbers fitted exactly, and the best event.

        Where none of the most promising causes is possible and relevant, the next ones are tried.
        """
        later, named = self.later, self._promising(())
        top, seen = max([1.0, *(one.gain for one in named)]), set[Key]()
        asked: list[tuple[Effect, Array, float, int | None]] = []
        if touch is not None:
            asked.append((touch.effect, touch.amplitudes, touch.gain, touch.log))
        for acting in responses:
            effect = acting.effect.at(acting.values)
            asked.append((effect, effect.amplitudes(acting.values), top, None))
        found = list[Candidate]()
        for _ in range(_TURNS):
            asked += [(later.form(one.group), one.amplitudes, one.gain, None) for one in named]
            tried = [one for x in asked if (one := candidate(later, self.state, *x)) is not None]
            found += [one for one in tried if one.possible and self._relevant(one)]
            most = max((self._saved(one) for one in found), default=0.0)
            larger = [one for one in tried if not one.possible and self._saved(one) > most]
            others = (by for one in larger if (by := self._by_another_law(one)) is not None)
            found += [one for one in others if self._relevant(one)]
            seen |= {one.group.key for one in named}
            if found:
                break
            asked, named = [], self._promising(seen)
        return found

    def _saved(self, one: Candidate) -> float:
        return self.state.cost - one.state.cost

    def _by_another_law(self, one: Candidate) -> Candidate | None:
        """Return a cause by the first of its other laws by which its numbers are possible."""
        last = one.state.model.effects[-1]
        for form in laws(last.effect)[1:] if last.log is None else ():
            start = np.array(last.amplitudes)
            other = candidate(self.later, self.state, form, start, one.gain)
            if other is not None and other.possible:
                return other
        return None

    def _unnamed(self, compliant: bool) -> dict[Key, State]:
        """Return the best shape without a name, and, where asked, the best compliance."""
        out, number = {}, np.log(self.later.rows.count)
        for kind in ("unnamed", "compliance") if compliant else ("unnamed",):
            own = [one for one in self.significant.values() if one.group.kind == kind]
            if own:
                one = max(own, key=lambda s: s.gain - s.freedom * number)
                columns = self.later.candidates.take(one.group.columns)
                out[one.group.key] = self.later.with_columns(self.state, columns)
        return out

    def _apart(self, other: State) -> list[Key]:
        """Return the causes that explain something else than a shape without a name does.

        Fitted together with it they are significant, gain more than a share of what they gain
        alone, and more than the shape leaves at their joints because no law is exact.
        """
        later, config = self.later, self.later.config
        gains = {s.group: s.gain for s in later.screened(other)}
        saved = config.relevance * np.maximum(self.state.squares - other.squares, 0.0)

        def least(one: Screened) -> float:
            inexact = float(later.shares[later.dictionary.groups.index(one.group)] @ saved)
            return max(config.share * one.gain, inexact, self._threshold(one))

        return [key for key, s in self.significant.items() if gains[s.group] > least(s)]

    def _contest(
        self,
        tried: Sequence[Candidate],
        others: Mapping[Key, State],
        apart: Mapping[Key, Sequence[Key]],
    ) -> tuple[Candidate | None, Cause | None, str]:
        """Return the winner of the predictive scores with its alternatives, or why nothing wins."""
        later, width = self.later, self.state.effects.width
        scores = {one.key: one.scores(later) for one in tried}
        free = {k: scores_of(later, own, own.effects.width - width) for k, own in others.items()}
        without = scores_of(later, self.state).sum()
        best = in_words(min(scores, key=lambda key: scores[key].sum()))
        fails = f"{best} does not pay on blocks that it was not fitted to"
        better = {k: v for k, v in (scores | free).items() if v.sum() < without}
        paying = [one for one in tried if one.key in better]
        if not paying:
            return None, None, fails
        named = self._named(paying, others, better, apart)
        if not named:
            first = min(better, key=lambda key: better[key].sum())
            return None, None, f"{in_words(first)} predicts better than {best}"
        pick = min(named, key=lambda one: scores[one.key].sum())
        unchanged = scores_of(later, later.unchanged(self.state, pick.key))
        pays = confidence_set({"with": scores[pick.key], "without": unchanged}, later.config)
        if "without" in pays and not pick.event:
            return None, None, fails
        alike = tuple(one.key for one in named if one is not pick)
        # a shape that predicts better does so within what the law of the cause is inexact
        rivals = {
            shape: v
            for shape, v in free.items()
            if pick.key not in apart[shape] and v.sum() > scores[pick.key].sum()
        }
        probable = probabilities(scores | rivals, later.config)
        return pick, Cause(pick.key, alike, probable), ""

    def _named(
        self,
        paying: Sequence[Candidate],
        others: Mapping[Key, State],
        better: Mapping[Key, Array],
        apart: Mapping[Key, Sequence[Key]],
    ) -> list[Candidate]:
        """Return the causes that the data do not tell from the best, as far as that has a name."""
        kept = confidence_set(better, self.later.config)
        named = [one for one in paying if one.key in kept]
        if named and min(better, key=lambda key: better[key].sum()) not in others:
            return named
        return self._nearly(paying, others) or self._beside(paying, better, apart)

    def _beside(
        self,
        paying: Sequence[Candidate],
        better: Mapping[Key, Array],
        apart: Mapping[Key, Sequence[Key]],
    ) -> list[Candidate]:
        """Return the causes that predict better than every shape that may explain the same.

        What a shape without a name explains elsewhere takes no cause its name.
        """
        best = {}
        for one in paying:
            rivals = [k for k, separate in apart.items() if k in better and one.key not in separate]
            if all(better[one.key].sum() < better[k].sum() for k in rivals):
                best[one.key] = better[one.key]
        kept = confidence_set(best, self.later.config) if best else []
        return [one for one in paying if one.key in kept]

    def _nearly(self, paying: Sequence[Candidate], others: Mapping[Key, State]) -> list[Candidate]:
        """Return the cause that explains as much as any unnamed shape, as far as laws are exact.

        What a model explains is the cost that it saves, less ln(rows) a number (Schwarz 1978).
        """
        width, cost = self.state.effects.width, np.log(self.later.rows.count)

        def saved(state: State, numbers: int) -> float:
            return float(self.state.cost - state.cost - numbers * cost)

        best = max(paying, key=lambda one: saved(one.state, one.numbers))
        free = max(saved(one, one.effects.width - width) for one in others.values())
        exact = 1.0 - self.later.config.relevance
        return [best] if 0.0 < saved(best.state, best.numbers) > exact * free else []


def _backward(later: Later, causes: list[Cause], end: State) -> tuple[list[Cause], State]:
    """Take out every cause without which the rest predicts as well, with numbers that it can have.

    An event is kept: predictions of other times do not depend on it.
    """
    place = 0
    while len(causes) > 1 and place < len(causes):
        if end.model.effects[place].log is not None:
            place += 1
            continue
        model = end.model.without(place)
        without = later.fit(model, end.theta, later.belief_of(model))
        scores = {"with": scores_of(later, end), "without": scores_of(later, without)}
        lasting = [k for k, one in enumerate(model.effects) if one.log is None]
        if "without" in confidence_set(scores, later.config) and all(
            possible(later, without, place=k) for k in lasting
        ):
            causes, end, place = [c for k, c in enumerate(causes) if k != place], without, 0
        else:
            place += 1
    return causes, end
