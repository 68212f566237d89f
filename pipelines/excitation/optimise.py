"""Search the best excitation, finish it, and make sure that it keeps every limit.

    found = design(task, Effort(seconds=30), seed=1)

Random starts are refined on a coarse copy of the problem, a fifth of the harmonics. The best are
lifted to the fine problem and refined by L-BFGS while the smooth criterion is sharpened and the
barrier lowered. They join a pool, whose best members are disturbed a little and refined again; then
come the next starts. With a number of evaluations equal numbers give equal designs.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from pipelines.dynamics.body import Array
from pipelines.errors import Interrupted, UsageError
from pipelines.excitation.config import CONFIG, Round
from pipelines.excitation.criteria import FAR
from pipelines.excitation.fourier import MotionSpace, Trajectory
from pipelines.excitation.problem import DesignProblem
from pipelines.excitation.regressor import grams_of
from pipelines.excitation.task import Task
from pipelines.excitation.verify import Peak, worst

__all__ = ["Design", "Effort", "design", "final_problem", "finished", "landscape"]

PAIRS = 24  # numerics: differences that the Hessian is made of
ROUGH, FINE = 1e-5, 1e-6  # numerics: relative decrease at which a minimisation ends
SHRINKINGS = 60  # numerics: at most, of a motion beyond its limits


class SpentError(Exception):
    """The search is over; what it has found by then is its answer."""


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
    shrunk: float  # factor on the motion so that its limits hold between samples
    reached: bool  # the ceiling on the condition number, kept by this motion as it is


def landscape(task: Task, share: int = 1, density: int = CONFIG.density) -> DesignProblem:
    """Return the problem on a `share`-th of the harmonics, `density` samples for each."""
    from scipy.fft import next_fast_len

    top = task.harmonics.used.shape[1]
    few = task.harmonics if share == 1 else task.harmonics.up_to(max(min(top, 5), top // share))
    space = MotionSpace(few, task.speed, rest=task.rest, home=task.home)
    least = CONFIG.fewest_samples * density // CONFIG.density
    samples = next_fast_len(max(density * few.used.shape[1], least), real=True)
    return DesignProblem(task.problem, space, samples, task.around, CONFIG.room)


def final_problem(task: Task) -> DesignProblem:
    """Return the problem on which a search ends."""
    return landscape(task, 1, CONFIG.final_density)


class _Search:
    """Count evaluations and keep the best point of the fine problem."""

    def __init__(self, task: Task, effort: Effort, limit: int | None) -> None:
        self.task, self.effort, self.limit = task, effort, limit
        self.done, self.found_at, self.score = 0, 0, np.inf
        self.x: Array | None = None
        self._begun, self._last = time.process_time(), 0.0

    def descend(self, land: DesignProblem, x: Array, rounds: Sequence[Round],
                best: bool) -> tuple[float, Array]:
        """Refine x; return the best exact figure on the way and its point; `best`: it may be the
        answer."""
        from scipy.optimize import minimize

        own: tuple[float, Array] = (np.inf, x)

        def function(at: Array, one: Round) -> tuple[float, Array]:
            nonlocal own
            self._spend()
            try:
                value, gradient, score = land.value(at, one.sharpness, one.weight)
            except Interrupted:  # as many evaluations as are counted give the same answer again
                self.done -= 1
                raise
            if score < own[0]:
                own = score, at.copy()
            if best and score < self.score:
                self.score, self.x, self.found_at = score, at.copy(), self.done
            return value, gradient

        for one in rounds:
            x = minimize(function, x, args=(one,), jac=True, method="L-BFGS-B", options={
                "maxiter": one.iterations, "maxcor": PAIRS, "gtol": 0.0,
                "ftol": FINE if best else ROUGH}).x
        return own

    @property
    def final(self) -> int:
        """Evaluations at the end of the search, on twice the samples."""
        return int(np.clip(self.done // 10, *CONFIG.final_evaluations))

    def _spend(self) -> None:
        """Count an evaluation; end the search where nothing is left for another one."""
        elapsed = time.process_time() - self._begun
        if self.limit is not None:
            spent = self.done >= self.limit
        else:  # the end of the search takes time as well
            kept = min(3.0 * self.final / max(self.done, 1) * elapsed, 0.5 * self.effort.seconds)
            spent = self.done > 0 and elapsed + kept >= self.effort.seconds
        if spent:
            raise SpentError
        self.done += 1
        if elapsed - self._last >= 1.0:
            self._last = elapsed
            self.effort.tell(self._progress())

    def _progress(self) -> str:
        goal = self.task.problem.goal
        if not np.isfinite(self.score):
            return f"evaluation {self.done}: first starts"
        if goal.ceiling is not None and self.score > FAR:
            number = np.exp(self.score - FAR)
            return f"evaluation {self.done}: condition number {number:.3f} so far"
        name = "number" if goal.criterion == "condition" else "criterion"
        return (f"evaluation {self.done}: best {goal.criterion} {name} {self.score:.4f}, found at "
                f"{self.found_at}")

    def run(self, coarse: DesignProblem, fine: DesignProblem, rng: np.random.Generator) -> None:
        """Search until the budget is spent."""
        glance = (Round(4, 1e-3, 0),)
        pool: list[tuple[float, Array]] = []
        while True:
            starts = []
            for _ in range(CONFIG.starts):
                score, x = self.descend(coarse, coarse.start(rng), CONFIG.coarse, best=False)
                lifted = fine.inside(fine.space.point(coarse.space.series(x)))
                self.descend(fine, lifted, glance, best=True)  # an early end has something to keep
                starts.append((score, lifted))
            starts.sort(key=lambda start: start[0])
            pool += [self.descend(fine, x, CONFIG.lifted, best=True)
                     for _, x in starts[:CONFIG.lifted_starts]]
            for place, size in CONFIG.turns:
                pool = sorted(pool, key=lambda member: member[0])[:CONFIG.pool]
                place = min(place, len(pool) - 1)
                x = fine.disturbed(pool[place][1], size, rng)
                found = self.descend(fine, x, CONFIG.again, best=True)
                if found[0] < pool[place][0]:
                    pool[place] = found


def design(task: Task, effort: Effort, seed: int = 0) -> Design:
    """Search, finish, verify.

    Raises:
        UsageError: C08, no motion keeps the limits: says which one is in the way.
    """
    coarse = landscape(task, CONFIG.share, CONFIG.coarse_density)
    fine, final = landscape(task), final_problem(task)
    _refuse_impossible(task, fine, np.random.default_rng(seed))
    search, stopped = _Search(task, effort, effort.evaluations), 0
    try:
        search.run(coarse, fine, np.random.default_rng(seed))
    except SpentError:
        pass
    except Interrupted as signal:  # the best so far is kept
        if search.x is None:
            raise
        stopped = signal.exit_code
    x = search.x if search.x is not None else fine.start(np.random.default_rng(seed))
    polish = _Search(task, Effort(), search.final)
    with suppress(SpentError):
        polish.descend(final, final.inside(x), CONFIG.final, best=True)
    x = x if polish.x is None else polish.x
    return finished(task, x, search.done, search.found_at, stopped)


def finished(task: Task, x: Array, evaluations: int, found_at: int, stopped: int) -> Design:
    """Return the design at `x`, changed until its limits hold between samples too."""
    final = final_problem(task)
    x, factor = _smaller(task, final, x)
    trajectory = Trajectory(final.space.series(x), task.periods)
    if not task.rest:
        trajectory = _with_run_in(task, trajectory)
    found = _peaks(task, trajectory)
    goal = task.problem.goal
    grams = grams_of(task.problem.columns, final.space.motion(x, final.samples))
    reached = goal.meets(goal.figures(grams).condition_number)
    return Design(trajectory, evaluations, found_at, stopped, found, factor, reached)


def _refuse_impossible(task: Task, fine: DesignProblem, rng: np.random.Generator) -> None:
    """Raise C08 where a limit is broken at a standstill already, in any posture."""
    least, where = np.inf, 0
    for _ in range(50):
        near = fine.nearness(fine.space.shrunk(fine.space.random(rng, *fine.around), 0.0))
        if not near.size or near.max() < 1.0:
            return
        if near.max() < least:
            least, where = float(near.max()), int(near.argmax())
    limit = fine.arm.limits[where]
    place = f"the limit of {limit.quantity}"
    if limit.joint:
        place = f"the {limit.quantity} limit of joint {limit.joint}"
    home = "" if task.home is None else f" at home ({', '.join(f'{q:.4g}' for q in task.home)})"
    raise UsageError(
        "C08", f"no motion keeps {place}, {limit.low:.4g} to {limit.high:.4g} {limit.unit}: at a "
        f"standstill{home} it is exceeded already", where="limits",
        remedy="start elsewhere (--home), or correct that limit")


def _smaller(task: Task, final: DesignProblem, x: Array) -> tuple[Array, float]:
    """Return x made smaller until its limits hold, and the factor."""
    whole = 1.0
    for _ in range(SHRINKINGS):
        nearest = worst(_peaks(task, Trajectory(final.space.series(x), 1)))
        if nearest is None or nearest.share <= 1.0:
            return x, whole
        factor = min(1.0 / nearest.share, CONFIG.corner)
        x, whole = final.space.shrunk(x, factor), whole * factor
    return final.space.shrunk(x, 0.0), 0.0


def _peaks(task: Task, trajectory: Trajectory) -> tuple[Peak, ...]:
    """Return the peaks of one period, and of the run-in and run-out where there are any."""
    from scipy.fft import next_fast_len

    series = trajectory.series
    count = next_fast_len(round(series.period / CONFIG.grid), real=True)
    found = [task.peaks(series.samples(count), periodic=True)]
    if trajectory.run_in > 0.0:
        t = CONFIG.grid * np.arange(round(trajectory.run_in / CONFIG.grid) + 1, dtype=np.float64)
        found += [task.peaks(trajectory.at(at), periodic=False)
                  for at in (t, trajectory.duration - t[::-1])]
    return tuple(max(group, key=lambda peak: peak.share) for group in zip(*found, strict=True))


def _with_run_in(task: Task, trajectory: Trajectory) -> Trajectory:
    """Return the trajectory with the shortest run-in and run-out that keep the limits.

    Raises:
        UsageError: C08, none does: says which limit is in the way.
    """
    q, dq, _ = trajectory.series.at(np.zeros(1))[:, :, 0]
    duration, longest, longer = CONFIG.run_in
    while duration <= longest:
        # half the way at mean speed: the polynomial then accelerates one way only
        rest = task.home if task.home is not None else q - 0.5 * duration * dq
        end = task.home if task.home is not None else q + 0.5 * duration * dq
        run_in = round(duration / task.sample_time) * task.sample_time
        one = replace(trajectory, run_in=run_in, rest=rest, end=end)
        nearest = worst(_peaks(task, one))
        if nearest is None or nearest.share <= 1.0:
            return one
        duration *= longer
    of = f" of joint {nearest.joint}" if nearest is not None and nearest.joint else ""
    quantity = "" if nearest is None else nearest.quantity
    raise UsageError("C08", f"no run-in of up to {longest:g} s keeps the {quantity} limit{of}",
                     where="--no-rest", remedy="start at rest, or from another home")
