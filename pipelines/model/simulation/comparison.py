"""Compare simulated arms with the measured one over the same stretches of logs.

    simulation_errors(arms, motions)          position error of each arm: in closed loop, or over short windows

In a closed loop the controller of the log moves the arm. Where none is known, the logged torque
drives the arm over windows of a tenth of a second.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal, TypeVar

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected
from pipelines.io.log import Array, ExperimentLog
from pipelines.model.arm import Arm
from pipelines.model.estimation.logs import Motions
from pipelines.model.motion import Reconstructed
from pipelines.model.rigid.body import Motion
from pipelines.model.simulation import (
    Experiment,
    Plant,
    Step,
    Windows,
    choose_step,
    runs_alone,
    simulate_together,
    simulate_windows,
)

__all__ = ["Positions", "SimulatedSpan", "Simulation", "Strayed", "in_loop", "in_loops", "nearer", "simulation_errors"]

@dataclass(frozen=True)
class SimulatedSpan:
    """How much of a log was simulated: in closed loop from where it begins on, else in windows all over it."""

    log: str  # its name
    seconds: float  # [s] over which the simulated arm was compared with the measured one


Positions = tuple[Array, Array, float]  # simulated and measured (samples, joints) [rad], and the time between samples [s]

T = TypeVar("T")


def in_loop(arm: Arm, log: ExperimentLog) -> bool:
    """Return whether the log's controller is known, and the arm, where the log begins, has an inertia that can be moved."""
    try:
        Plant.of(arm).refuse_unphysical(Experiment.of_log(log).q_ref[:1])
    except InputRejected:
        return False
    return True


def in_loops(arms: Sequence[Arm], motions: Motions, seconds: float) -> list[list[Positions] | None]:
    """Of each arm those in each log, over its first `seconds`; None of one that runs away, or is none that can be simulated.

    Raises:
        InputRejected: a log does not describe its controller.
    """
    first = [_first(log, seconds) for log, _ in motions]
    # One controller and arm: what suffices for a log suffices for the next.

    def step_of(arm: Arm) -> Step | None:
        return _if_possible(lambda: choose_step(Plant.of(arm), first[0]))

    steps = [step_of(arm) for arm in arms]
    pieces = [(k, step, places) for k, step in enumerate(steps) if step is not None for places in _apart(arms[k], first)]
    pieces.sort(key=lambda piece: -len(piece[2]))  # what takes arrays takes longest

    def moved(piece: tuple[int, Step, tuple[int, ...]]) -> list[Array] | None:
        k, step, places = piece
        return _if_possible(lambda: _moved(arms[k], [first[place] for place in places], step))

    found: list[dict[int, Array] | None] = [{} if step is not None else None for step in steps]
    for (k, _, places), done in zip(pieces, map(moved, pieces), strict=True):
        before = found[k]
        found[k] = None if before is None or done is None else before | dict(zip(places, done, strict=True))
    return [None if one is None else [(one[place], log.q[:len(one[place])], log.sample_time)
                                      for place, (log, _) in enumerate(motions)] for one in found]


def _apart(arm: Arm, experiments: Sequence[Experiment]) -> list[tuple[int, ...]]:
    """Places of the experiments that are simulated together: each by itself where nothing is saved by others beside it."""
    every = tuple(range(len(experiments)))
    return [(place,) for place in every] if all(runs_alone(arm, one) for one in experiments) else [every]


def _moved(arm: Arm, experiments: Sequence[Experiment], step: Step) -> list[Array]:
    return [done.q[0] for done in simulate_together(arm, experiments, steps={one.sample_time: step for one in experiments})]


def _first(log: ExperimentLog, seconds: float) -> Experiment:
    experiment = Experiment.of_log(log)
    return experiment.part(0, min(experiment.n_samples, round(seconds / log.sample_time)))


def _if_possible(work: Callable[[], T]) -> T | None:
    """What `work` makes; None where no arm can be simulated so (D15, D17)."""
    try:
        return work()
    except InputRejected:
        return None


_BLOCKS = 20  # of the held-out time
_LONGEST = 5.0  # [s] of a log that is simulated
_SOFT = 1.0  # [s] the same, where something moves beside the joints of an arm, or a drive remembers, which takes many steps
_LONGER = 6.0  # times as long, where the last arm comes no nearer than the first: what noise does to an error averages out
_WINDOW = 0.1  # [s]
_HELD = 1e-4  # [rad or m] standard deviation of a joint that does not move
_FINE = 1e-3  # [s] between torques that drive a window: a faster log's are averaged, which moves an arm as far
_EXACT = 1e-3  # of the position error, to which it is worked out
_ROUGH = 1e-2  # the same, where something moves beside the joints: a hundredth is far less than what chance does to the error
_LOGS = 2  # that are simulated


@dataclass(frozen=True, eq=False)
class Strayed:
    """How a simulated arm strays from the measured one in a log whose controller moves both."""

    log: str  # its name
    t: Array  # [s] (samples,) since it began
    error: Array  # [rad] (samples, joints) simulated minus measured


@dataclass(frozen=True, eq=False)
class Simulation:
    """How far the simulated arm is from the measured one, over the held-out logs."""

    how: Literal["closed-loop", "windowed", "none"]
    position_rms: Array  # [rad] (joints,)
    tip_rms: float  # [m]
    power: Array  # (blocks,) of time: squared error summed over the joints, in units of each
    first: Strayed | None = None  # in the first of the logs; None where no controller is known
    span: tuple[SimulatedSpan, ...] = ()  # of each log that was simulated

    @classmethod
    def none(cls, joints: int) -> Simulation:
        return cls("none", np.full(joints, np.nan), np.nan, np.zeros(0))


def nearer(before: Simulation, after: Simulation) -> bool:
    """Whether the second simulated arm is nearer to the measured one than the first, chance or not."""
    return "none" not in (before.how, after.how) and float(after.power.sum()) < float(before.power.sum())


def simulation_errors(arms: Sequence[Arm], motions: Motions) -> list[Simulation]:
    """Position error of each arm over the same stretches of logs: closed loop where the first allows it, short windows else.

    Without logs nothing is simulated. In a loop the stretches are short, and longer ones where they leave it open whether the last
    arm comes nearer than the first: what the amplifiers' noise moves, no simulated arm follows.
    """
    none = [Simulation.none(arm.n_joints) for arm in arms]
    if not motions:
        return none
    logs = motions[:_LOGS]
    hooks = [hook for arm in arms for hook in Plant.of(arm).hooks]
    soft = any(hook.rate for hook in hooks)
    slow = soft or any(hook.actuator and hook.states for hook in hooks)
    if all(in_loop(arms[0], log) for log, _ in logs):
        longest = _SOFT if slow else _LONGEST
        found = _each(arms, logs, soft, longest)
        if _open(found[0], found[-1]) and any(log.n_samples * log.sample_time > longest for log, _ in logs):
            longer = _each(arms, logs, soft, _LONGER * longest)
            found = found if longer[0].how == "none" else longer
        if found[0].how != "none":
            return found
    found = _each(arms, logs, soft, np.inf, closed=False)
    return none if found[0].how == "none" else found


def _open(first: Simulation, last: Simulation) -> bool:
    """Return whether both could be simulated, and the last is not nearer."""
    return "none" not in (first.how, last.how) and first is not last and not nearer(first, last)


def _each(arms: Sequence[Arm], motions: Motions, soft: bool, longest: float, *, closed: bool = True) -> list[Simulation]:
    """`soft`: something moves beside the joints of one of them; `longest` [s] of a log in a loop."""
    every = (in_loops(arms, motions, longest) if closed else
             map(partial(_in_windows, motions=motions, exact=_ROUGH if soft else _EXACT), arms))
    return [Simulation.none(arm.n_joints) if pairs is None else _all(arm, motions, pairs, closed)
            for arm, pairs in zip(arms, every, strict=True)]


def _all(arm: Arm, motions: Motions, pairs: Sequence[Positions], closed: bool) -> Simulation:
    square, away, span = [], [], []
    for (q, seen, between), (log, _) in zip(pairs, motions, strict=True):
        known = np.isfinite(q + seen).all(axis=1)
        square.append(np.square(q[known] - seen[known]))
        away.append(np.sum(np.square(arm.body.tip(q[known]) - arm.body.tip(seen[known])), axis=1))
        span.append(SimulatedSpan(log.name, between * int(known.sum())))
    each = np.concatenate(square)
    block = np.arange(len(each)) * _BLOCKS // max(len(each), 1)
    units = _units(arm, np.concatenate([seen[np.isfinite(seen).all(axis=1)] for _, seen, _ in pairs]))
    power = np.asarray(np.bincount(block, each @ units**-2, minlength=_BLOCKS), dtype=np.float64)
    (log, _), (q, seen, _) = motions[0], pairs[0]
    first = Strayed(log.name, log.t[:len(q)] - log.t[0], q - seen) if closed else None
    return Simulation("closed-loop" if closed else "windowed", np.sqrt(each.mean(axis=0)),
                      float(np.sqrt(np.mean(np.concatenate(away)))), power, first, tuple(span))


def _units(arm: Arm, q: Array) -> Array:
    """(joints,) in which errors of several joints are added up: radians, or metres; where some turn and others slide, the standard
    deviation of what each was measured to do, `q` (samples, joints). What is held there has no say, for a hair is all it moves."""
    turning = arm.robot.revolute
    if all(turning) or not any(turning):
        return np.ones(len(turning))
    spread = np.std(q, axis=0)
    return np.asarray(np.where(spread > _HELD, spread, np.inf))


def _in_windows(arm: Arm, motions: Motions, exact: float) -> list[Positions] | None:
    """Positions of an arm that is driven by the logged torque, None where it runs away; the steps that suffice for a log suffice
    for the next."""
    pairs, steps = [], dict[float, int]()
    try:
        for log, found in motions:
            q, seen, between, steps[log.sample_time] = _windowed(arm, log, found, exact, steps.get(log.sample_time))
            pairs.append((q, seen, between))
    except InputRejected:  # D15, D17, T08
        return None
    return pairs


def _windowed(arm: Arm, log: ExperimentLog, found: Reconstructed, exact: float, steps: int | None,
              ) -> tuple[Array, Array, float, int]:
    usable = np.zeros(log.n_samples, dtype=bool)
    usable[found.good.kept] = found.good.fit
    tau = log.tau if log.torque != "measured" else np.concatenate([0.5 * (log.tau[1:] + log.tau[:-1]), log.tau[-1:]])
    motion, tau, usable, every = _coarser(found.motion, tau, usable, log.sample_time)
    between = every * log.sample_time
    length = max(3, round(_WINDOW / between))
    driven = partial(simulate_windows, Plant.of(arm), motion, tau, between, length, usable, exact)
    windows = driven(steps)
    if steps is not None and not _whole(windows, length):  # livelier than the log they were chosen for
        windows = driven(None)
    if not _whole(windows, length):  # left out, it would count as no error at all
        raise InputRejected("D17", "the arm runs away in a window", where=log.name, remedy="look at its inertia")
    return windows.q, motion.q, between, windows.steps


def _whole(windows: Windows, length: int) -> bool:
    return bool(np.isfinite(windows.q[windows.first[:, None] + np.arange(length)]).all())


def _coarser(motion: Motion, tau: Array, usable: npt.NDArray[np.bool_], sample_time: float,
             ) -> tuple[Motion, Array, npt.NDArray[np.bool_], int]:
    """Every Nth sample of a motion, the mean torque (samples, joints) until the next, and where all of that is usable."""
    every = max(1, int(_FINE / sample_time * (1.0 + 1e-9)))
    if every == 1:
        return motion, tau, usable, 1
    count = len(tau) // every
    uneven = np.abs(np.diff(motion.t, append=motion.t[-1] + sample_time) - sample_time) > 0.5 * sample_time
    good: npt.NDArray[np.bool_] = np.asarray(usable & ~uneven)
    some = slice(0, count * every, every)
    thin = Motion(motion.t[some], motion.q[some], motion.dq[some], motion.ddq[some])
    mean = np.asarray(tau[:count * every].reshape(count, every, -1).mean(axis=1))
    return thin, mean, np.asarray(good[:count * every].reshape(count, every).all(axis=1)), every
