"""Fit candidates exactly, each by the laws that it may follow, and judge the numbers they get.

one = candidate(later, state, effect, amplitudes)
one.possible, one.noisy        whether its numbers are such as it can have, and more than noise
best_law(later, state, one)    the same cause by the law that predicts best
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from math import ceil

import numpy as np

from pipelines.diagnosis.refit import Later
from pipelines.diagnosis.score import log_scores, probabilities
from pipelines.diagnosis.state import State
from pipelines.diagnosis.unnamed import Key
from pipelines.effects.base import Effect
from pipelines.estimation.bootstrap import chi2_bound
from pipelines.estimation.candidate_columns import first_samples
from pipelines.estimation.exact_model import Named
from pipelines.estimation.joint_table import Array, Table, by_joint, gains, in_rows
from pipelines.estimation.rows import END

__all__ = [
    "Candidate",
    "best_law",
    "candidate",
    "follows_noise",
    "laws",
    "laws_of",
    "possible",
    "refit",
    "reformed",
    "scores_of",
]

_TRIED = np.geomspace(1e-4, 1.0, 40)  # numerics: of its reach, to where an amplitude is moved
_HALF = 0.5  # numerics: of the rows


@dataclass(frozen=True)
class Candidate:
    """A cause that was refitted exactly."""

    key: Key
    gain: float  # of screening
    state: State
    possible: bool  # its numbers are such as it can have
    noisy: bool = False  # the answer of the loop to noise looks like it

    @property
    def numbers(self) -> int:
        """Numbers that it adds to the model."""
        return self.state.model.effects[-1].count

    @property
    def event(self) -> bool:
        """True for a cause of one moment in one log."""
        return self.state.model.effects[-1].log is not None

    def scores(self, later: Later) -> Array:
        """Return the predictive score of each block."""
        return scores_of(later, self.state, self.numbers)


def candidate(
    later: Later,
    state: State,
    effect: Effect,
    amplitudes: Array,
    gain: float = 0.0,
    log: int | None = None,
) -> Candidate | None:
    """Return the cause refitted; None where its fit fails, which costs that candidate alone."""
    start = np.zeros(effect.columns(first_samples(later.rows.data), later.dataset.arm).shape[2])
    start[: len(amplitudes)] = amplitudes[: len(start)]
    belief = later.beside(state.belief, effect)
    model = state.model.with_effect(effect, start, log=log)
    try:
        fitted = later.fit(model, state.theta, belief)
        explained = state.cost - fitted.cost
        can = possible(later, fitted, explained) and bool(np.isfinite(fitted.losses).all())
        noisy = can and follows_noise(later, fitted, explained)
    except np.linalg.LinAlgError:
        return None
    light = replace(fitted)  # without the columns that were computed for it: they take most memory
    return Candidate((effect.name, effect.joint), gain, light, can, noisy)


def best_law(later: Later, state: State, chosen: Candidate) -> Candidate:
    """Return the chosen cause by the law of it that predicts best."""
    one, every = chosen.state.model.effects[-1], [chosen]
    if one.log is None:
        for form in laws(one.effect)[1:]:
            other = candidate(later, state, form, np.array(one.amplitudes), chosen.gain)
            if other is not None and other.possible and not other.noisy:
                every.append(other)
    return min(every, key=lambda one: float(one.scores(later).sum())) if every[1:] else chosen


def laws(effect: Effect, further: Sequence[Effect] = ()) -> list[Effect]:
    """Return an effect and the laws it may follow instead, which differ in what is not fitted."""
    laws = dict[object, Effect]()
    for x in (effect, *effect.forms(), *further):
        held = tuple((f.name, getattr(x, f.name)) for f in fields(x) if f.name not in x.free)
        laws.setdefault(held, x)
    return list(laws.values())


def laws_of(later: Later, end: State, place: int) -> list[tuple[Named, float]]:
    """Return a cause by each law and link that it may have, and how probable; its own first."""
    one, rest = end.model.effects[place], end.model.without(place)
    elsewhere = any(q.link or q.joint for q in one.effect.parameters)
    key = one.effect.name, one.effect.joint
    every = laws(one.effect, later.dictionary.families[key].shapes if elsewhere else ())
    if len(every) > 1 and one.log is None:
        before = later.fit(rest, end.theta, later.belief_of(rest))
        tried = [candidate(later, before, x, np.array(one.amplitudes)) for x in every]
        good = [c for c in tried if c is not None and c.possible and not c.noisy]
        if tried[0] in good:
            weight = probabilities({k: c.scores(later) for k, c in enumerate(good)}, later.config)
            return [(c.state.model.effects[-1], weight[k]) for k, c in enumerate(good)]
    return [(one, 1.0)]


def reformed(later: Later, state: State) -> tuple[Sequence[int], State]:
    """Return each cause by the law of it that predicts best now, and which causes are kept.

    A cause whose numbers are impossible beside causes found after it is dropped.
    """
    kept = list[int]()
    for place in range(len(state.model.effects)):
        one, rest = state.model.effects[0], state.model.without(0)
        before = later.fit(rest, state.theta, later.belief_of(rest))
        same = candidate(later, before, one.effect, np.array(one.amplitudes), log=one.log)
        if same is None or not same.possible:
            state = before
        else:
            kept.append(place)
            state = best_law(later, before, same).state  # the effect is the last one now
    return kept, state


def refit(
    later: Later, state: State, effect: Effect, amplitudes: Array, laws: bool = True
) -> Candidate | None:
    """Return a cause that somebody names, refitted, by the law of it that predicts best."""
    one = candidate(later, state, effect, amplitudes)
    return best_law(later, state, one) if one is not None and laws else one


def scores_of(later: Later, state: State, numbers: int = 0) -> Array:
    """Return the predictive score of each block, with its share of what the model costs.

    A standing number that is far from the prior predicts other blocks as well as a cause does: what
    the prior says against it is charged, and further numbers as BIC does (Schwarz 1978).
    """
    price = state.cost - state.rss + numbers * np.log(later.rows.count)
    return np.asarray(log_scores(state.losses, later.block_rows) + price / len(later.block_rows))


def possible(later: Later, state: State, explained: float | None = None, place: int = -1) -> bool:
    """Return whether an effect can be a cause with its numbers and their deviations.

    An amplitude outside its range may be within it by its standard deviation, but not by the
    other sign, and one that surely is as slight as in any arm is no cause; a number of a shape
    that is held at the end of its range has its best value outside. What it costs to be in its
    range, (distance / std)², may be a share of what the effect explains, for no law is exact.

    Args:
        explained: cost that the effect saves; None: (amplitude / std)², which it nearly is.
        place: of the effect in the model; -1: the last.
    """
    slopes, names = later.slopes(state.model)
    factor, first = state.factor, later.base.width
    std = np.sqrt(factor.inverse_diagonal[first:]) / slopes.lengths
    step = factor.solve(state.slope)[first:] / slopes.lengths
    one, place = state.model.effects[place], place % len(state.model.effects)
    if explained is None:
        at = [k for k, n in enumerate(names) if n[:2] == (1, place) and n[2].isdigit()]
        sizes = np.array(one.amplitudes)[: len(at)]
        explained = float(np.max((sizes / std[at]) ** 2, initial=0.0))
    deviations = np.sqrt(max(later.config.deviations**2, later.config.relevance * explained))
    if one.effect.parameters.reads_torque and _mostly_acting(later, one.effect):
        return False
    each = zip(names, step.tolist(), (deviations * std).tolist(), strict=True)
    own = [(name, by, reach) for (*which, name), by, reach in each if which == [1, place]]
    if any(abs(by) > reach and one.effect.at_end(name, by) for name, by, reach in own):
        return False
    amplitudes = [(int(name), reach) for name, _, reach in own if name.isdigit()]
    slight = one.effect.parameters.slight(later.rows.data.logs[0].motion.sample_time)
    if any(abs(one.amplitudes[k]) + reach < slight for k, reach in amplitudes):
        return False
    return one.possible or any(_reaches_range(one, k, reach) for k, reach in amplitudes)


def _reaches_range(one: Named, number: int, reach: float) -> bool:
    """Return whether an amplitude moved by at most `reach`, of the same sign, is in its range."""
    for way in np.outer((-reach, reach), _TRIED).ravel():
        amplitudes = np.array(one.amplitudes)
        amplitudes[number] += way
        same = amplitudes[number] * one.amplitudes[number] > 0.0
        if same and one.effect.possible(one.effect.values(amplitudes)):
            return True
    return False


def _mostly_acting(later: Later, effect: Effect) -> bool:
    """Return whether an effect acts in most rows; a joint clipped so follows nothing."""
    logs, arm = later.rows.data.logs, later.dataset.arm
    table = [np.any(effect.columns(one.motion, arm), axis=2) for one in logs]
    acting = [one.at_rows(x).T.ravel() for one, x in zip(logs, table, strict=True)]
    own = later.rows.data.counts & (later.rows.joint == (effect.joint or 1) - 1)
    return float(np.concatenate(acting)[own].mean()) > _HALF


def follows_noise(later: Later, state: State, explained: float) -> bool:
    """Return whether the last effect is one of drive or encoder whose slopes follow the noise.

    In closed loop motion and torque answer the noise a moment later, and a lag is not
    distinguished from that (Ljung 1999, 16.6). What slopes gain on the noise of another moment,
    as far away as the low-pass carries it, has a χ² distribution where they are independent, as
    far as laws are exact.
    """
    last, rows = state.model.effects[-1], later.rows
    if last.effect.acts_on == "load":
        return False
    own = np.arange(state.effects.width) >= state.effects.width - last.count
    columns, rest = (state.effects.take(np.flatnonzero(x)) for x in (own, ~own))
    left, near = in_rows(state.residual, rows.joint), ceil(END * later.config.keep)
    each = (rows.data.moved(left, by) for by in range(-near, near + 1) if by)
    moments = [by_joint(x, rows.joint, rows.n_joints) for x in each]
    others = Table.stacked([state.known.base, rest])
    most = gains(columns, others, state.known.beside(rest), moments).max()
    chance = chi2_bound(later.config.alpha / len(moments), last.count)
    return bool(most > max(chance, later.config.relevance * explained))
