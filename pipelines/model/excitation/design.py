"""Search the best experiment, finish it, and make sure that it keeps every limit.

    found = design(task, Effort(seconds=30), seed=1)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from pipelines.errors import Interrupted, UsageError
from pipelines.fit.design.budget import Budget
from pipelines.fit.design.goal import FAR
from pipelines.fit.design.search import Best, Round, polish, search
from pipelines.model.excitation.problem import DesignProblem, grams_of
from pipelines.model.excitation.run_in import with_run_in
from pipelines.model.excitation.space import MotionSpace
from pipelines.model.excitation.task import Task
from pipelines.model.excitation.trajectory import Trajectory
from pipelines.model.excitation.verify import GRID, Peak, peaks, worst
from pipelines.model.rigid.body import Array
from pipelines.signal.fourier import good_size

__all__ = ["FINISH", "Design", "Effort", "design", "finished", "landscape"]

_COARSE, _FINE, FINISH = 8, 10, 20  # samples of a period for each harmonic
_FEWEST = 200  # samples of a period: fewer do not show what friction does
_FIFTH = 5  # of the harmonics in the coarse problem
_FINISHING = (Round(600, 1e-4, 60), Round(2000, 2e-5, 120), Round(6000, 4e-6, 150), Round(20000, 1e-6, 200))
_FINISH_EVALUATIONS = (200, 600)  # at least, at most; between them a tenth of the search's
_SHRINKINGS = 60
_MUCH = 0.01  # of its size: what would become so much smaller than it goes beyond its limit is moved instead
_DENSE, _MOVES = 80, 4  # samples of a period for each harmonic; how often a motion is moved
_ROOM, _LEAST_ROOM = 0.9995, 0.5  # of a limit


@dataclass(frozen=True)
class Effort:
    """How long to search: evaluations where given, else seconds of computing."""

    seconds: float = 30.0
    evaluations: int | None = None
    tell: Callable[[str], None] = field(default=lambda words: None, compare=False)


@dataclass(frozen=True, eq=False)
class Design:
    """A motion that keeps its limits, and how it was found."""

    trajectory: Trajectory
    evaluations: int  # of the search: as many give the same design again
    found_at: int  # evaluation of the best one
    stopped: int  # exit code of the signal that ended the search early; 0 where none did
    peaks: tuple[Peak, ...]
    shrunk: float  # what the motion was multiplied by so that its limits hold between samples, and in its rehearsal
    cost: tuple[float, ...]  # of each limit, a share of what all cost
    reached: bool  # what was asked for: a ceiling on the condition number, kept by this motion as it is
    shrunk_for: tuple[str, ...] = ()  # the limits, in words, that asked for it


def landscape(task: Task, share: int = 1, density: int = _FINE) -> DesignProblem:
    """The design problem on a `share`-th of the harmonics, with `density` samples a period for each."""
    top = task.harmonics.used.shape[1]
    count = top if share == 1 else max(min(top, 5), top // share)
    used = task.harmonics.used[:, :count]
    harmonics = task.harmonics.up_to(count) if used.any(axis=1).all() and used.sum(axis=1).min() > 1 else task.harmonics
    space = MotionSpace(harmonics, task.speed, rest=task.rest, home=task.home)
    samples = good_size(max(density * harmonics.used.shape[1], _FEWEST * density // _FINE if top < 40 else 1))
    return DesignProblem(task.problem, space, samples, task.around)


def design(task: Task, effort: Effort, seed: int = 0) -> Design:
    """Search, finish, verify.

    Raises:
        UsageError: C08, no motion keeps the limits: says which one is in the way.
    """
    fine, coarse, finish = landscape(task), landscape(task, _FIFTH, _COARSE), landscape(task, 1, FINISH)
    _refuse_impossible(fine, np.random.default_rng(seed), task.home)
    best = Best()
    budget = Budget(effort.seconds, effort.evaluations, lambda done: effort.tell(_progress(task, done, best)),
                    reserve=2.0 * _FINISH_EVALUATIONS[1])
    stopped = 0
    try:
        search(coarse, fine, lambda x: fine.space.point(coarse.space.series(x)), budget, np.random.default_rng(seed), best)
    except Interrupted as signal:  # whoever stops the search wants what it has found by then
        if best.x is None:
            raise
        stopped = signal.exit_code
    x = best.x if best.x is not None else fine.start(np.random.default_rng(seed))
    ended = Best()
    polish(finish, x, _FINISHING, Budget(None, int(np.clip(budget.done // 10, *_FINISH_EVALUATIONS))), ended)
    x = x if ended.x is None else ended.x
    return finished(task, finish, x, budget.done, best.evaluation, stopped)


def finished(task: Task, finish: DesignProblem, x: Array, evaluations: int, found_at: int, stopped: int) -> Design:
    """The design at `x`, changed until its limits hold between samples too, with run-in where it wants one."""
    x, factor, why = _within(task, finish, x)
    trajectory = Trajectory(finish.space.series(x), task.periods)
    if not task.rest:
        trajectory = with_run_in(task, trajectory)
    found = _peaks(task, trajectory)
    cost = tuple(float(c) for c in finish.cost(finish.sized(x, 0.9999, 1.0)))
    columns, goal = task.problem.columns, task.problem.goal
    grams = grams_of(columns.columns, columns.rows(finish.space.motion(x, finish.samples)), len(columns.names))
    return Design(trajectory, evaluations, found_at, stopped,
                  tuple(replace(peak, cost=share) for peak, share in zip(found, cost, strict=True)), factor, cost,
                  goal.meets(goal.figures(grams).condition_number), (why,) if why else ())


def _progress(task: Task, done: int, best: Best) -> str:
    if not np.isfinite(best.score):
        return f"evaluation {done}: first starts"
    if task.problem.goal.ceiling is not None and best.score > FAR:
        return f"evaluation {done}: condition number {np.exp(best.score - FAR):.3f} so far"
    figure = {"condition": f"condition number {best.score:.4f}"}.get(
        task.problem.goal.criterion, f"{task.problem.goal.criterion} criterion {best.score:.4f}")
    return f"evaluation {done}: best {figure}, found at {best.evaluation}"


def _refuse_impossible(fine: DesignProblem, rng: np.random.Generator, home: Array | None) -> None:
    """C08 where a limit is broken at a standstill already: in `home`, or wherever the arm may stand."""
    least, where = np.inf, 0
    for _ in range(50):
        near = fine.nearness(fine.space.shrunk(fine.space.random(rng, *fine.around), 0.0))
        if not near.size or near.max() < 1.0:
            return
        if near.max() < least:
            least, where = float(near.max()), int(near.argmax())
    limit = fine.arm.listed[where]
    place = f"the {limit.quantity} limit of joint {limit.joint}" if limit.joint else f"the limit of {limit.quantity}"
    stands = "" if home is None else f" at home ({', '.join(f'{q:.4g}' for q in home)})"
    raise UsageError("C08", f"no motion keeps {place}, {limit.low:.4g} to {limit.high:.4g} {limit.unit}: at a standstill{stands} "
                     f"it is exceeded already", where="limits", remedy="start elsewhere (--home), or correct that limit")


def _within(task: Task, finish: DesignProblem, x: Array) -> tuple[Array, float, str]:
    """x changed until its limits hold between samples too, on the grid of `GRID`: made smaller, by which factor, and for which.

    A speed shrinks with the motion; a torque need not: where gravity holds against what accelerates, less motion asks for more
    of it, and what is a thousandth beyond its limit may keep it only when a fifth smaller. Such a motion is moved the little
    way back to its limits instead, and what that leaves is made smaller.
    """
    smaller, factor, why = _smaller(task, finish, x)
    nearest = worst(_peaks(task, Trajectory(finish.space.series(x), 1)))
    if nearest is None or factor >= 1.0 / max(nearest.share, 1.0) - _MUCH:
        return smaller, factor, why
    dense = landscape(task, 1, _DENSE)
    for _ in range(_MOVES):
        moved = dense.moved_within(x, _room(task, dense, x))
        if moved is None:
            break
        x = moved
        found, size, for_what = _smaller(task, finish, x)
        if size >= 1.0 - _MUCH:
            return found, size, for_what
    return smaller, factor, why


def _room(task: Task, dense: DesignProblem, x: Array) -> Array:
    """Share of each limit (limits,) that x may be moved to, so that little is left to be made smaller."""
    found = _peaks(task, Trajectory(dense.space.series(x), 1))
    share, (_, half) = np.array([peak.share for peak in found]), task.problem.bounds
    torque, position = (np.array([peak.quantity == name for peak in found], dtype=bool) for name in ("torque", "position"))
    # what the model's own friction adds to the torque that the problem sees is left free
    seen = np.minimum(dense.nearness(x) / np.maximum(share, 1e-300), 1.0)
    room = np.where(torque, np.maximum(_ROOM * seen, _LEAST_ROOM), _ROOM)
    return np.where(position, 1.0 - (1.0 - _ROOM) / np.maximum(half, 1.0), room)  # the other end of a range may be far away


def _smaller(task: Task, finish: DesignProblem, x: Array) -> tuple[Array, float, str]:
    """x made smaller until its limits hold, by which factor, and the limit that was farthest beyond at first."""
    whole, why = 1.0, ""
    for _ in range(_SHRINKINGS):
        nearest = worst(_peaks(task, Trajectory(finish.space.series(x), 1)))
        if nearest is None or nearest.share <= 1.0:
            return x, whole, why
        why = why or (nearest.quantity if nearest.joint is None else f"{nearest.quantity} of joint {nearest.joint}")
        factor = min(1.0 / nearest.share, 0.9999)
        x, whole = finish.space.shrunk(x, factor), whole * factor
    return finish.space.shrunk(x, 0.0), 0.0, why


def _peaks(task: Task, trajectory: Trajectory) -> tuple[Peak, ...]:
    """Of one period, and of the run-in and run-out where there are any."""
    series = trajectory.series
    grid = series.samples(good_size(round(series.period / GRID)))
    found = peaks(task.problem.limits, task.problem.chain, grid, task.torque, periodic=True)
    if trajectory.run_in == 0.0:
        return found
    t = np.arange(round(trajectory.run_in / GRID) + 1, dtype=np.float64) * GRID
    ends = [peaks(task.problem.limits, task.problem.chain, trajectory.at(at), task.torque, periodic=False)
            for at in (t, trajectory.duration - t[::-1])]
    return tuple(max(group, key=lambda peak: peak.share) for group in zip(found, *ends, strict=True))
