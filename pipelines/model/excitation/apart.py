"""Change a design until it tells two causes apart: the largest angle between what the nominal model cannot take up of either.

    pair = Pair(a, b)
    refuse_hidden(task, pair, seed)
    design, found = told_apart(task, designed, pair, seconds, evaluations, seed, tell)
    found.before.similarity, found.after.similarity

With c⊥ = c - Q Qᵀ c the part of a cause's columns that rigid body and friction cannot imitate, weighted by the noise, cause A is as
similar to B as the length of A⊥ within the span of B⊥ beside its whole length, root mean square over A's columns. Of the two
directions the smaller one counts: where B can be all that A can, a bit of it besides shows B, and else the one with fewer numbers
wins. Causes with non-linear numbers are taken in a few of their shapes, and the pair that is most alike counts. A shape that the
nominal model takes up whole, a wave that gravity has for instance, shows in no motion: it is none that anybody has found.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipelines.errors import Interrupted, UsageError
from pipelines.model.arm import Arm
from pipelines.model.effects.base import Effect
from pipelines.model.excitation.design import FINISH, Design, finished, landscape
from pipelines.model.excitation.problem import DesignProblem, grams_of
from pipelines.model.excitation.task import Task
from pipelines.model.rigid.body import Array, Motion

__all__ = ["Alike", "Apart", "Pair", "alike", "judged_again", "refuse_hidden", "refuse_one", "told_apart"]

_SHARPNESS = 200.0  # [s/rad] of Coulomb friction
_SHAPES = 4  # of a cause
_HIDDEN = 0.1  # a cause of which less shows has to show more first
_RANK = 1e-8
_ROOM = 0.999  # of the ceiling: what is left for the way back to limits that the search does not see
_PASSED = 0.97  # of the score of the motion noted last: such a one is noted on the way
_FIRST, _LEAST, _GROWS, _SHRINKS = 0.3, 1e-3, 1.5, 0.93  # size of a step: the success rule of Rechenberg 1973, about one in five


@dataclass(frozen=True)
class Pair:
    """Two causes, and where the non-linear numbers of either are known."""

    first: Effect
    second: Effect
    starts: tuple[dict[str, float], dict[str, float]] = field(default_factory=lambda: ({}, {}))


@dataclass(frozen=True)
class Alike:
    """How alike two causes look in a motion."""

    similarity: float  # 0: nothing of one can be taken for the other; 1: everything
    identifiability: tuple[float, float]  # of either: what the nominal model cannot take up
    condition_number: float

    @property
    def score(self) -> float:
        return self.similarity + sum(max(0.0, 1.0 - eta / _HIDDEN) for eta in self.identifiability)


@dataclass(frozen=True)
class Apart:
    """What a design gained in telling two causes apart."""

    causes: tuple[str, str]
    before: Alike  # the plain design
    after: Alike
    evaluations: int
    changed: bool = True  # False: nothing better was found that keeps limits and ceiling, so the plain design it is

    def gained(self, task: Task) -> bool:
        """Whether the causes are less alike than in the plain design, and the condition number as good as was asked for, or no
        worse."""
        after, before = self.after, self.before
        return after.score < before.score and (task.problem.goal.meets(after.condition_number)
                                               or after.condition_number <= before.condition_number)


def refuse_one(pair: Pair, written: Sequence[str]) -> None:
    """Two causes that are one, or of which one is the other with a number given; as they were `written`.

    Raises:
        UsageError: C02, no motion tells a cause from itself.
    """
    first, second = (start.items() for start in pair.starts)
    if (pair.first.name, pair.first.joint) == (pair.second.name, pair.second.joint) and (first <= second or second <= first):
        why = "are one cause" if first == second else "are not two causes: one is the other with a number given"
        raise UsageError("C02", f"{' and '.join(written)} {why}; no motion tells a cause from itself", where="--discriminate",
                         remedy="name another cause or joint, or give both another number")


def refuse_hidden(task: Task, pair: Pair, seed: int) -> None:
    """Before anything is designed.

    Raises:
        UsageError: C02, no model of the arm predicts its torque, or a cause shows in no motion.
    """
    if task.arm is None:
        raise UsageError("C02", "what a cause looks like depends on the torque, and neither a model nor the links are known",
                         where="--discriminate", remedy="name a model: --model model.json")
    problem, rng = landscape(task), np.random.default_rng([seed, 9])
    seen = _judged(task, task.arm, problem, problem.start(rng), pair)
    hidden = [name for name, eta in zip(_names(pair), seen.identifiability, strict=True) if eta < _RANK]
    if hidden:
        show, them = ("show", "them") if len(hidden) > 1 else ("shows", "it")
        raise UsageError("C02", f"{' and '.join(hidden)} {show} in no motion: the base parameters take {them} up",
                         where="--discriminate",
                         remedy="the report of diagnose says what would tell it, under 'What these logs cannot tell'")


def _names(pair: Pair) -> tuple[str, str]:
    one, other = (each.name if each.joint is None else f"{each.name}:{each.joint}" for each in (pair.first, pair.second))
    return one, other


def told_apart(task: Task, designed: Design, pair: Pair, seconds: float, evaluations: int | None, seed: int,
               tell: Callable[[str], None]) -> tuple[Design, Apart]:
    """`designed`, changed step by step for the better, its ceiling on the condition number kept; itself where nothing is better.

    The search looks between a few samples; what keeps its limits between all of them is another motion, if by a little, and is
    judged as such. Where that took away what was gained, motions are tried that the search had passed on its way.
    """
    arm = task.arm
    assert arm is not None  # `refuse_hidden`
    problem = landscape(task)
    x = problem.space.point(designed.trajectory.series)
    now = before = _judged(task, arm, problem, x, pair)
    # where the plain design did not reach it, this one is no worse
    ceiling = max(_ROOM * (task.problem.goal.ceiling or np.inf), before.condition_number)
    rng, size, done, until = np.random.default_rng([seed, 9]), _FIRST, 0, time.process_time() + seconds
    stopped, passed = designed.stopped, [(x, now)]
    try:
        while (done < evaluations) if evaluations is not None else (time.process_time() < until):
            done += 1
            other = problem.disturbed(x, size, rng)
            seen = _judged(task, arm, problem, other, pair)
            better = seen.score < now.score and seen.condition_number <= ceiling
            size = min(size * _GROWS, 1.0) if better else max(size * _SHRINKS, _LEAST)
            if better:
                x, now = other, seen
                passed += [(x, now)] if now.score < _PASSED * passed[-1][1].score else []
            if done % 20 == 0:
                tell(f"evaluation {done}: similarity {now.similarity:.3f}")
    except Interrupted as signal:  # whoever stops the search wants what it has found by then
        stopped = signal.exit_code
    count, finish = designed.evaluations + done, landscape(task, 1, FINISH)
    for each in (x, *(point for point, _ in reversed(passed[1:]))):
        after = finished(task, finish, each, count, count, stopped)
        apart = Apart(_names(pair), before, _seen(task, arm, after, pair), done)
        if apart.gained(task):
            return after, apart
    return replace(designed, evaluations=count, stopped=stopped), Apart(_names(pair), before, before, done, changed=False)


def judged_again(task: Task, found: Design, pair: Pair, apart: Apart) -> Apart:
    """`apart` of a motion that was changed after it was told apart."""
    return apart if task.arm is None else replace(apart, after=_seen(task, task.arm, found, pair))


def _seen(task: Task, arm: Arm, found: Design, pair: Pair) -> Alike:
    return alike(task, arm, found.trajectory.series.samples(landscape(task).samples), pair)


def _judged(task: Task, arm: Arm, problem: DesignProblem, x: Array, pair: Pair) -> Alike:
    return alike(task, arm, problem.space.motion(x, problem.samples), pair)


def alike(task: Task, arm: Arm, motion: Array, pair: Pair) -> Alike:
    """How alike the causes look in `motion` (3, joints, samples) over one period."""
    columns, goal = task.problem.columns, task.problem.goal
    rows = columns.rows(motion)
    condition = goal.figures(grams_of(columns.columns, rows, len(columns.names))).condition_number
    weight = 1.0 / np.asarray(goal.noise)
    basis = _orthonormal(_nominal(task, motion, rows) * weight[:, None])
    series = task.harmonics.period / motion.shape[2]
    seen = Motion(np.arange(motion.shape[2]) * series, *(np.ascontiguousarray(part.T) for part in motion))
    tables = [[_apart(one.columns(seen, arm).transpose(2, 1, 0) * weight[:, None], basis)
               for one in _shapes(effect, start, seen, arm)]
              for effect, start in zip((pair.first, pair.second), pair.starts, strict=True)]
    tables = [[one for one in table if one[1] >= _RANK] or table for table in tables]
    most = max(min(_imitated(a, b), _imitated(b, a)) for a, _ in tables[0] for b, _ in tables[1])
    eta = tuple(min(share for _, share in table) for table in tables)
    return Alike(most, (eta[0], eta[1]), condition)


def _nominal(task: Task, motion: Array, rows: tuple[Array, ...]) -> Array:
    """(columns, joints, samples) of rigid body and friction."""
    joints, samples = motion.shape[1:]
    owns = task.problem.columns.columns
    table = np.zeros((len(task.problem.columns.names) + 2 * joints, joints, samples))
    for j, (own, row) in enumerate(zip(owns, rows, strict=True)):
        table[own, j] = row
        table[-2 * joints + 2 * j, j] = np.tanh(_SHARPNESS * motion[1, j])
        table[-2 * joints + 2 * j + 1, j] = motion[1, j]
    return table


def _shapes(effect: Effect, start: dict[str, float], motion: Motion, arm: Arm) -> Sequence[Effect]:
    """A few shapes, evenly out of the grid; the one that is known where it is."""
    known = [q.name for q in effect.parameters if q.shape and not q.derived]
    if start and set(known) <= set(start):
        return (replace(effect, **{name: start[name] for name in known}),)  # type: ignore[arg-type]
    every = tuple(dict.fromkeys(replace(one, **start) for one in effect.shapes(motion, arm)))  # type: ignore[arg-type]
    places = np.unique(np.linspace(0, len(every) - 1, min(_SHAPES, len(every))).round().astype(int))
    return [every[int(place)] for place in places]


def _apart(table: Array, basis: Array) -> tuple[Array, float]:
    """Columns (k, joints, samples) of unit length less what the basis takes up of them, (k, rows), and how much that leaves."""
    flat = table.reshape(len(table), -1)
    size = np.linalg.norm(flat, axis=1)
    unit = flat / np.where(size > 0.0, size, 1.0)[:, None]
    left = unit - (unit @ basis.T) @ basis
    return left, float(np.sqrt(np.mean(np.sum(left * left, axis=1))))


def _imitated(a: Array, b: Array) -> float:
    """What of the columns `a` lies in the span of `b`, as a share of their length."""
    within = a @ _orthonormal(b).T
    return float(np.sqrt(np.sum(within * within) / max(float(np.sum(a * a)), 1e-300)))


def _orthonormal(table: Array) -> Array:
    """Basis (rank, rows) of the rows of `table`."""
    flat = table.reshape(len(table), -1)
    size = np.linalg.norm(flat, axis=1)
    unit = flat[size > 0.0] / size[size > 0.0, None]
    values, vectors = np.linalg.eigh(unit @ unit.T)
    keep = values > _RANK * max(float(values[-1]), 1e-300) if len(values) else np.zeros(0, dtype=bool)
    return np.asarray((vectors[:, keep] / np.sqrt(values[keep])).T @ unit)
