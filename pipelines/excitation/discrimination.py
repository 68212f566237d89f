"""Change a design until it separates two causes: least similarity of what the model cannot imitate.

    design, apart = best(task, pair, Effort(seconds=30), seed)
    apart.before.similarity, apart.after.similarity

With c⊥ = c - Q Qᵀ c the part of a cause's columns that rigid body and friction cannot imitate,
weighted by the noise, cause A is as similar to B as the length of A⊥ within the span of B⊥ over its
whole length. Of the two directions the smaller one counts: where B can be all that A can, the one
with fewer numbers wins. Causes with non-linear numbers are taken in a few shapes, of which the most
alike pair counts; a shape that the nominal model takes up whole is left out.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.dynamics.body import Array, Motion
from pipelines.effects.base import Effect
from pipelines.errors import Interrupted, UsageError
from pipelines.excitation.config import CONFIG
from pipelines.excitation.optimise import Design, Effort, design, finished, landscape
from pipelines.excitation.regressor import grams_of_rows
from pipelines.excitation.task import Task

__all__ = ["Alike", "Apart", "Pair", "alike", "best", "refuse_hidden", "refuse_one", "told_apart"]

ROOM = 0.999  # numerics: of the ceiling; the rest is for the way back to the limits
FIRST, LEAST = 0.3, 1e-3  # numerics: size of a step
GROWS, SHRINKS = 1.5, 0.93  # numerics: success rule of Rechenberg 1973, about one in five
TELL_EVERY = 20  # numerics: evaluations from one line of progress to the next


@dataclass(frozen=True)
class Pair:
    """Two causes, and where the non-linear numbers of either are known."""

    first: Effect
    second: Effect
    starts: tuple[dict[str, float], dict[str, float]] = field(default_factory=lambda: ({}, {}))

    @property
    def names(self) -> tuple[str, str]:
        one, other = (each.name if each.joint is None else f"{each.name}:{each.joint}"
                      for each in (self.first, self.second))
        return one, other


@dataclass(frozen=True)
class Alike:
    """How alike two causes look in a motion."""

    similarity: float  # 0: nothing of one can be taken for the other; 1: everything
    identifiability: tuple[float, float]  # of either: the share that the nominal model leaves
    condition_number: float

    @property
    def score(self) -> float:
        hidden = (max(0.0, 1.0 - share / CONFIG.hidden) for share in self.identifiability)
        return self.similarity + sum(hidden)


@dataclass(frozen=True)
class Apart:
    """The gain of a design in separating two causes."""

    causes: tuple[str, str]
    before: Alike  # the plain design
    after: Alike
    evaluations: int
    changed: bool = True  # False: nothing better was found, so the plain design it is

    def gained(self, task: Task) -> bool:
        """Return whether the causes are less alike and the condition number as good as asked."""
        after, before = self.after, self.before
        fine = task.problem.goal.meets(after.condition_number)
        return after.score < before.score and (
            fine or after.condition_number <= before.condition_number)


def refuse_one(pair: Pair, written: Sequence[str]) -> None:
    """Refuse two causes that are one, as they were `written`.

    Raises:
        UsageError: C02, no motion tells a cause from itself.
    """
    first, second = (start.items() for start in pair.starts)
    if pair.names[0] == pair.names[1] and (first <= second or second <= first):
        why = "are not two causes: one is the other with a number given"
        if first == second:
            why = "are one cause"
        raise UsageError("C02", f"{' and '.join(written)} {why}; no motion tells a cause from "
                         "itself", where="--discriminate",
                         remedy="name another cause or joint, or give both another number")


def refuse_hidden(task: Task, pair: Pair, seed: int) -> None:
    """Refuse causes that no motion shows, before anything is designed.

    Raises:
        UsageError: C02, no model of the arm predicts its torque, or a cause shows in no motion.
    """
    if task.arm is None:
        raise UsageError("C02", "what a cause looks like depends on the torque, and neither a "
                         "model nor the links are known", where="--discriminate",
                         remedy="name a model: --model model.json")
    problem = landscape(task)
    x = problem.start(np.random.default_rng([seed, 9]))
    seen = alike(task, task.arm, problem.space.motion(x, problem.samples), pair)
    hidden = [name for name, share in zip(pair.names, seen.identifiability, strict=True)
              if share < CONFIG.rank]
    if hidden:
        show, them = ("show", "them") if len(hidden) > 1 else ("shows", "it")
        raise UsageError("C02", f"{' and '.join(hidden)} {show} in no motion: the base parameters "
                         f"take {them} up", where="--discriminate",
                         remedy="the report of diagnose says what would tell it, under 'What these "
                         "logs cannot tell'")


def best(task: Task, pair: Pair | None, effort: Effort, seed: int) -> tuple[Design, Apart | None]:
    """Search the best motion, and change it until it separates a pair of causes.

    Half the time is given to either search.

    Raises:
        UsageError: C08, no motion keeps the limits: says which one is in the way.
    """
    if pair is None:
        return design(task, effort, seed), None
    half = replace(effort, seconds=0.5 * effort.seconds)
    found = design(task, half, seed)
    return (found, None) if found.stopped else told_apart(task, found, pair, half, seed)


def told_apart(task: Task, designed: Design, pair: Pair, effort: Effort,
               seed: int) -> tuple[Design, Apart]:
    """Change `designed` step by step for the better, its ceiling on the condition number kept.

    The finished motion is judged as it is; where it gained nothing, the plain design is returned.
    """
    assert task.arm is not None  # `refuse_hidden`
    problem = landscape(task)
    x = problem.space.point(designed.trajectory.series)
    now = before = alike(task, task.arm, problem.space.motion(x, problem.samples), pair)
    # where the plain design did not reach the ceiling, this one is no worse
    ceiling = max(ROOM * (task.problem.goal.ceiling or np.inf), before.condition_number)
    rng, size, done = np.random.default_rng([seed, 9]), FIRST, 0
    until = time.process_time() + effort.seconds
    stopped = designed.stopped
    try:
        while (time.process_time() < until if effort.evaluations is None
               else done < effort.evaluations):
            done += 1
            other = problem.disturbed(x, size, rng)
            seen = alike(task, task.arm, problem.space.motion(other, problem.samples), pair)
            better = seen.score < now.score and seen.condition_number <= ceiling
            size = min(size * GROWS, 1.0) if better else max(size * SHRINKS, LEAST)
            if better:
                x, now = other, seen
            if done % TELL_EVERY == 0:
                effort.tell(f"evaluation {done}: similarity {now.similarity:.3f}")
    except Interrupted as signal:  # the best so far is kept
        stopped = signal.exit_code
    count = designed.evaluations + done
    after = finished(task, x, count, count, stopped)
    motion = after.trajectory.series.samples(problem.samples)
    apart = Apart(pair.names, before, alike(task, task.arm, motion, pair), done)
    if apart.gained(task):
        return after, apart
    plain = replace(designed, evaluations=count, stopped=stopped)
    return plain, replace(apart, after=before, changed=False)


def alike(task: Task, arm: Arm, motion: Array, pair: Pair) -> Alike:
    """Return how alike the causes look in `motion` (3, joints, samples) over one period."""
    columns, goal = task.problem.columns, task.problem.goal
    rows = columns.rows(motion)
    condition = goal.figures(grams_of_rows(columns, rows)).condition_number
    weight = 1.0 / np.asarray(goal.noise)[:, None]
    basis = _orthonormal(_nominal(task, motion, rows) * weight)
    step = task.harmonics.period / motion.shape[2]
    seen = Motion(step * np.arange(motion.shape[2]),
                  *(np.ascontiguousarray(part.T) for part in motion))
    tables = []
    for effect, start in zip((pair.first, pair.second), pair.starts, strict=True):
        parts = [_beyond(one.columns(seen, arm).transpose(2, 1, 0) * weight, basis)
                 for one in _shapes(effect, start, seen, arm)]
        tables.append([part for part in parts if part[1] >= CONFIG.rank] or parts)
    most = max(min(_imitated(a, b), _imitated(b, a)) for a, _ in tables[0] for b, _ in tables[1])
    first, second = (min(share for _, share in table) for table in tables)
    return Alike(most, (first, second), condition)


def _nominal(task: Task, motion: Array, rows: Sequence[Array]) -> Array:
    """Return the columns (columns, joints, samples) of rigid body and friction."""
    joints, samples = motion.shape[1:]
    columns = task.problem.columns
    table = np.zeros((len(columns.names) + 2 * joints, joints, samples))
    for j, (own, row) in enumerate(zip(columns.columns, rows, strict=True)):
        table[own, j] = row
        table[-1 - 2 * j, j] = np.tanh(CONFIG.steep_friction * motion[1, j])
        table[-2 - 2 * j, j] = motion[1, j]
    return table


def _shapes(effect: Effect, start: dict[str, float], motion: Motion, arm: Arm) -> Sequence[Effect]:
    """Return a few shapes, evenly out of the grid; the one that is known where it is."""
    known = [q.name for q in effect.parameters if q.shape and not q.derived]
    if start and set(known) <= set(start):
        own: dict[str, Any] = {name: start[name] for name in known}
        return (replace(effect, **own),)
    given: dict[str, Any] = dict(start)
    every = tuple(dict.fromkeys(replace(one, **given) for one in effect.shapes(motion, arm)))
    places = np.linspace(0, len(every) - 1, min(CONFIG.shapes, len(every))).round().astype(int)
    return [every[place] for place in np.unique(places).tolist()]


def _beyond(table: Array, basis: Array) -> tuple[Array, float]:
    """Return unit columns (k, rows) less what the basis takes up, and how much that leaves."""
    flat = table.reshape(len(table), -1)
    size = np.linalg.norm(flat, axis=1)
    unit = flat / np.where(size > 0.0, size, 1.0)[:, None]
    rest = unit - (unit @ basis.T) @ basis
    return rest, float(np.sqrt(np.mean(np.sum(rest * rest, axis=1))))


def _imitated(a: Array, b: Array) -> float:
    """Return what of the columns `a` lies in the span of `b`, as a share of their length."""
    within = a @ _orthonormal(b).T
    return float(np.sqrt(np.sum(within * within) / max(float(np.sum(a * a)), 1e-300)))


def _orthonormal(table: Array) -> Array:
    """Return a basis (rank, rows) of the rows of `table`."""
    flat = table.reshape(len(table), -1)
    size = np.linalg.norm(flat, axis=1)
    unit = flat[size > 0.0] / size[size > 0.0, None]
    if not len(unit):
        return np.asarray(unit)
    values, vectors = np.linalg.eigh(unit @ unit.T)
    keep = values > CONFIG.rank * values[-1]
    return np.asarray((vectors[:, keep] / np.sqrt(values[keep])).T @ unit)
