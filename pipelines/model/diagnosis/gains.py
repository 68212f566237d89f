"""What a finding is worth on what was held out: torque residual, simulated position, tip.

    torque_gain(before, after, case)        with its bootstrap interval
    simulated(arms, logs, ...)              position error of each arm, in closed loop or over short windows
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipelines.errors import InputRejected
from pipelines.fit.bootstrap import apart
from pipelines.log.experiment import Array, ExperimentLog
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.data import Data
from pipelines.model.diagnosis.exact import Refined
from pipelines.model.diagnosis.result import TorqueGain
from pipelines.model.diagnosis.search import held_out_left
from pipelines.model.estimation.logs import Motions
from pipelines.model.motion import Reconstructed
from pipelines.model.simulation import Experiment, Plant, choose_step, simulate, simulate_windows

__all__ = ["Simulation", "simulation_errors", "torque_gain"]

_BLOCKS = 20  # of the held-out time
_SEED = 20040509
_LONGEST = 5.0  # [s] of a log that is simulated
_WINDOW = 0.1  # [s]
_LOGS = 2  # that are simulated


@dataclass(frozen=True)
class Simulation:
    """How far the simulated arm is from the measured one, over the held-out logs."""

    how: Literal["closed-loop", "windowed", "none"]
    position_rms: Array  # [rad] (joints,)
    tip_rms: float  # [m]


def torque_gain(before: Refined, after: Refined, judge: Data | None, blocks: int) -> TorqueGain:
    """Root mean square of the held-out torque residual, joint by joint, and how sure its change is."""
    data = after.data if judge is None else judge
    one, other = (held_out_left(x, judge, blocks) for x in (before, after))
    place = data.blocks(_BLOCKS)
    count = int(place.max()) + 1
    ci = []
    for joint in range(data.n_joints):
        own = (data.joint == joint) & data.counts
        sums = [np.asarray(np.bincount(place[own], values, minlength=count), dtype=np.float64)
                for values in (one[own] ** 2, other[own] ** 2, np.ones(int(own.sum())))]
        ci.append(apart(sums[0], sums[1], sums[2], np.random.default_rng(_SEED)))
    return TorqueGain(data.rms(one), data.rms(other), np.array(ci))


def simulation_errors(arms: Sequence[Arm], motions: Motions) -> list[Simulation]:
    """Position error of each arm over the same logs: closed loop where all of them allow it, short windows else."""
    logs = motions[:_LOGS]
    try:
        return [_all(arm, logs, closed=True) for arm in arms]
    except InputRejected:
        pass
    try:
        return [_all(arm, logs, closed=False) for arm in arms]
    except InputRejected:
        return [Simulation("none", np.full(arm.n_joints, np.nan), np.nan) for arm in arms]


def _all(arm: Arm, motions: Motions, closed: bool) -> Simulation:
    power, tip, samples, steps = np.zeros(arm.n_joints), 0.0, 0, 1
    for place, (log, found) in enumerate(motions):
        if closed and place == 0:  # one controller and one arm: what suffices for a log suffices for the next
            steps = choose_step(Plant.of(arm), _first(log)).per_sample
        q, seen = _closed(arm, log, steps) if closed else _windowed(arm, log, found)
        known = np.isfinite(q + seen).all(axis=1)
        power += np.sum(np.square(q[known] - seen[known]), axis=0)
        tip += float(np.sum(np.square(arm.body.tip(q[known]) - arm.body.tip(seen[known]))))
        samples += int(known.sum())
    count = max(samples, 1)
    return Simulation("closed-loop" if closed else "windowed", np.sqrt(power / count), float(np.sqrt(tip / count)))


def _closed(arm: Arm, log: ExperimentLog, steps: int) -> tuple[Array, Array]:
    q = simulate(arm, _first(log), steps=steps).q[0]
    return q, log.q[:len(q)]


def _first(log: ExperimentLog) -> Experiment:
    experiment = Experiment.of_log(log)
    return experiment.part(0, min(experiment.n_samples, round(_LONGEST / log.sample_time)))


def _windowed(arm: Arm, log: ExperimentLog, found: Reconstructed) -> tuple[Array, Array]:
    usable = np.zeros(log.n_samples, dtype=bool)
    usable[found.good.kept] = found.good.fit
    tau = log.tau if log.torque != "measured" else np.concatenate([0.5 * (log.tau[1:] + log.tau[:-1]), log.tau[-1:]])
    length = max(3, round(_WINDOW / log.sample_time))
    return simulate_windows(Plant.of(arm), found.motion, tau, log.sample_time, length, usable).q, found.motion.q

