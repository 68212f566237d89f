"""Compare simulated arms with the measured one over the same stretches of logs.

    simulation_errors(arms, motions)     position error of each arm, closed loop or short windows

In a closed loop the controller of the log moves the arm. Where none is known, the logged torque
drives the arm over windows of a tenth of a second.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.dynamics.body import Motion
from pipelines.errors import InputRejected
from pipelines.estimation.motion import Motions, Reconstructed
from pipelines.io.log import Array, ExperimentLog
from pipelines.simulation.closed_loop import run_together
from pipelines.simulation.config import SIMULATION
from pipelines.simulation.experiment import Experiment
from pipelines.simulation.plant import Plant
from pipelines.simulation.replay import Windows, held_torque, simulate_windows
from pipelines.simulation.step import choose_step

__all__ = [
    "Positions",
    "SimulatedSpan",
    "Simulation",
    "Strayed",
    "in_loop",
    "in_loops",
    "nearer",
    "simulation_errors",
]

# simulated and measured (samples, joints) [rad], and the time between samples [s]
Positions = tuple[Array, Array, float]


@dataclass(frozen=True)
class SimulatedSpan:
    """The part of a log that was simulated: in closed loop from its start, or in windows."""

    log: str  # its name
    seconds: float  # [s] over which the simulated arm was compared with the measured one


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
    """Return whether the second simulated arm is nearer to the measured one, chance or not."""
    if "none" in (before.how, after.how):
        return False
    return float(after.power.sum()) < float(before.power.sum())


def simulation_errors(arms: Sequence[Arm], motions: Motions) -> list[Simulation]:
    """Return the position error of each arm over the same stretches of logs.

    In closed loop where the first arm allows it, over short windows else; nothing without logs. In
    a loop stretches are short, and longer where they leave it open whether the last arm comes
    nearer.
    """
    none = [Simulation.none(arm.n_joints) for arm in arms]
    logs = motions[: SIMULATION.logs]
    if not logs:
        return none
    hooks = [hook for arm in arms for hook in Plant.of(arm).hooks]
    soft = any(hook.rate or hook.remembering for hook in hooks)
    slow = soft or any(hook.actuator and hook.states for hook in hooks)
    if all(in_loop(arms[0], log) for log, _ in logs):
        longest = SIMULATION.longest_soft if slow else SIMULATION.longest
        found = _errors(arms, logs, in_loops(arms, logs, longest), closed=True)
        unsure = len(arms) > 1 and "none" not in (found[0].how, found[-1].how)
        more = any(log.n_samples * log.sample_time > longest for log, _ in logs)
        if more and unsure and not nearer(found[0], found[-1]):
            positions = in_loops(arms, logs, SIMULATION.longer * longest)
            longer = _errors(arms, logs, positions, closed=True)
            found = found if longer[0].how == "none" else longer
        if found[0].how != "none":
            return found
    exact = SIMULATION.exact_soft if soft else SIMULATION.exact
    found = _errors(arms, logs, [_in_windows(arm, logs, exact) for arm in arms], closed=False)
    return none if found[0].how == "none" else found


def in_loop(arm: Arm, log: ExperimentLog) -> bool:
    """Return whether the log's controller is known, and the arm has an inertia to be moved."""
    try:
        Plant.of(arm).refuse_unphysical(Experiment.of_log(log).q_ref[:1])
    except InputRejected:
        return False
    return True


def in_loops(arms: Sequence[Arm], motions: Motions, seconds: float) -> list[list[Positions] | None]:
    """Return the positions of each arm in each log over its first `seconds`; None of one that
    fails.

    The step that suffices for one log is used for all: they have one controller and arm.

    Raises:
        InputRejected: a log does not describe its controller.
    """
    logs = [log for log, _ in motions]
    parts = [Experiment.of_log(log).part(0, round(seconds / log.sample_time)) for log in logs]
    found: list[list[Positions] | None] = []
    for plant in map(Plant.of, arms):
        try:
            step = choose_step(plant, parts[0])
            moved = run_together(plant, parts, step.per_sample, exact=step.exact)
        except InputRejected:  # D15, D17
            found.append(None)
            continue
        found.append(
            [
                (one.q[0], log.q[: len(one.t)], log.sample_time)
                for one, log in zip(moved, logs, strict=True)
            ]
        )
    return found


def _errors(
    arms: Sequence[Arm], motions: Motions, every: Sequence[list[Positions] | None], closed: bool
) -> list[Simulation]:
    """Return how far each arm is off, of its positions in each log."""
    return [
        Simulation.none(arm.n_joints)
        if positions is None
        else _error(arm, motions, positions, closed)
        for arm, positions in zip(arms, every, strict=True)
    ]


def _error(arm: Arm, motions: Motions, positions: Sequence[Positions], closed: bool) -> Simulation:
    square, away, span, measured = [], [], [], []
    for (q, seen, between), (log, _) in zip(positions, motions, strict=True):
        known = np.isfinite(q + seen).all(axis=1)
        square.append(np.square(q[known] - seen[known]))
        away.append(np.sum(np.square(arm.body.tip(q[known]) - arm.body.tip(seen[known])), axis=1))
        span.append(SimulatedSpan(log.name, between * int(known.sum())))
        measured.append(seen[np.isfinite(seen).all(axis=1)])
    each, turning = np.concatenate(square), arm.robot.revolute
    # added up in radians or metres; where some joints turn and others slide, in units of what each
    # was measured to do, and what is held there has no say, for a hair is all it moves
    unit = np.ones(len(turning))
    if any(turning) and not all(turning):
        spread = np.std(np.concatenate(measured), axis=0)
        unit = np.where(spread > SIMULATION.still, spread, np.inf)
    block = np.arange(len(each)) * SIMULATION.blocks // max(len(each), 1)
    power = np.bincount(block, each @ unit**-2, minlength=SIMULATION.blocks).astype(np.float64)
    (log, _), (q, seen, _) = motions[0], positions[0]
    first = Strayed(log.name, log.t[: len(q)] - log.t[0], q - seen) if closed else None
    how: Literal["closed-loop", "windowed"] = "closed-loop" if closed else "windowed"
    tip = float(np.sqrt(np.mean(np.concatenate(away))))
    return Simulation(how, np.sqrt(each.mean(axis=0)), tip, power, first, tuple(span))


def _in_windows(arm: Arm, motions: Motions, exact: float) -> list[Positions] | None:
    """Return the positions of an arm that is driven by the logged torque; None if it runs away.

    The steps that suffice for a log suffice for the next, unless that one is livelier.
    """
    pairs: list[Positions] = []
    steps: dict[float, int] = {}
    try:
        for log, found in motions:
            motion, between, windows = _windowed(arm, log, found, exact, steps.get(log.sample_time))
            steps[log.sample_time] = windows.steps
            pairs.append((windows.q, motion.q, between))
    except InputRejected:  # D15, D17, T08
        return None
    return pairs


def _windowed(
    arm: Arm, log: ExperimentLog, found: Reconstructed, exact: float, steps: int | None
) -> tuple[Motion, float, Windows]:
    """Return the measured motion, the time between its samples [s], and the windows.

    Of a fast log every Nth sample, and the mean torque until the next.
    """
    motion, tau, time = found.motion, held_torque(log), log.sample_time
    usable = np.zeros(log.n_samples, dtype=bool)
    usable[found.good.kept] = found.good.fit
    every = max(1, int(SIMULATION.fine / time * (1.0 + 1e-9)))  # numerics: rounding
    if every > 1:
        steps_of_time = np.diff(motion.t, append=motion.t[-1] + time)
        usable &= np.abs(steps_of_time - time) <= 0.5 * time
        whole = len(tau) // every * every
        usable = np.asarray(usable[:whole].reshape(-1, every).all(axis=1))
        tau = tau[:whole].reshape(len(usable), every, -1).mean(axis=1)
        some = slice(0, whole, every)
        motion = Motion(motion.t[some], motion.q[some], motion.dq[some], motion.ddq[some])
    between = every * time
    length = max(SIMULATION.window_samples, round(SIMULATION.window / between))
    for count in dict.fromkeys((steps, None)):
        windows = simulate_windows(
            Plant.of(arm), motion, tau, between, length, usable, exact, count
        )
        if np.isfinite(windows.q[windows.first[:, None] + np.arange(length)]).all():
            return motion, between, windows
    # left out, it would count as no error at all
    words = "the arm runs away in a window"
    raise InputRejected("D17", words, where=log.name, remedy="look at its inertia")
