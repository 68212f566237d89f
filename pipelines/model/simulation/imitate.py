"""Imitate one log: simulate what it recorded, in closed loop or in short windows, and compare.

    found = imitate(log, arm, How(replicas=5))
    found.position_rms                       [rad] simulated minus measured, joint by joint
    found.logs                               what the replicas would have logged
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected, UsageError
from pipelines.io import schema
from pipelines.io.log import Array, Derived, ExperimentLog, Signal, created, digest_of, recording
from pipelines.io.results import NOT_STORED
from pipelines.model.arm import Arm
from pipelines.model.motion import Reconstruction, reconstruct
from pipelines.model.simulation.accuracy import Step, choose_step
from pipelines.model.simulation.course import Course, course
from pipelines.model.simulation.experiment import Experiment
from pipelines.model.simulation.plant import Plant
from pipelines.model.simulation.replicas import Noise, Simulated, run
from pipelines.model.simulation.windows import Windows, simulate_windows

__all__ = ["How", "Imitation", "imitate"]

_LONGEST, _SHORTEST = 5.0, 3  # [s], samples of a window
_FOLLOWED = ("q_ref", "dq_ref", "ddq_ref", "v")  # what a simulated log takes over from the log it imitates


@dataclass(frozen=True)
class How:
    """How to imitate a log."""

    replicas: int = 1
    seed: int = 1  # of the first replica; the others follow
    noise: tuple[float, ...] = ()  # [N m] std of the drives' torque noise: one, or one a joint; none
    windowed: bool = False  # although the controller is known
    window: float = 0.1  # [s]
    steps: int | None = None  # of the integrator, a sample, the body held in none; None: as few as the error allows

    def check(self, n_joints: int) -> None:
        """Raises: UsageError, C02: a setting that does not fit."""
        if self.noise and len(self.noise) not in (1, n_joints):
            raise UsageError("C02", f"{len(self.noise)} noise levels for {n_joints} joints", where="--noise",
                             remedy="give one, or one a joint")
        if any(not 0.0 <= level < np.inf for level in self.noise):
            raise UsageError("C02", "a noise level below zero", where="--noise", remedy="give standard deviations in N m")
        if not 1 <= self.replicas <= 1000:
            raise UsageError("C02", f"{self.replicas} replicas", where="--replicas", remedy="give 1 to 1000")
        if self.seed < 0:
            raise UsageError("C02", f"seed {self.seed}", where="--seed", remedy="give 0 or more")
        if self.steps is not None and not 1 <= self.steps <= 1000:
            raise UsageError("C02", f"{self.steps} steps a sample", where="--steps", remedy="give 1 to 1000")
        if not 0.0 < self.window <= _LONGEST:
            raise UsageError("C02", f"windows of {self.window:g} s", where="--window", remedy=f"give up to {_LONGEST:g} s")
        if self.replicas > 1 and not any(self.noise):
            raise UsageError("C02", f"{self.replicas} replicas without noise are all the same", where="--replicas",
                             remedy="say how large the drives' noise is, with --noise")


@dataclass(frozen=True)
class Imitation:
    """What was simulated of one log, beside what it recorded. Every array is per joint; none where nothing can be compared."""

    name: str
    source: str
    files: tuple[str, ...]  # the simulated logs, relative to the output folder; none of windows
    simulation: str  # "closed-loop" | "windowed"
    reason: str  # why only windowed; empty otherwise
    law: str  # of the log's controller
    samples: int
    replicas: int
    units: tuple[str, ...]  # of position
    torque_units: tuple[str, ...]
    position_rms: Array | None  # [rad] simulated minus measured, all replicas
    position_max: Array | None
    speed_rms: Array | None  # [rad/s] minus the reconstructed one
    torque_rms: Array | None  # [N m] commanded; null where the torque was given
    noise_rms: Array | None  # [rad] difference of two replicas with different noise
    steps: int  # of the integrator, a sample
    step_error: Array | None  # [rad] what halving them changes; null where their number was given
    window: float | None  # [s]
    course: Course | None
    logs: tuple[ExperimentLog, ...] = field(metadata=NOT_STORED, repr=False)


def imitate(log: ExperimentLog, arm: Arm, how: How, file: str, settings: object = None, draw: bool = True) -> Imitation:
    """Simulate `arm` in the experiment of `log`.

    Args:
        file: where the simulated log will lie, without ending.
        settings: what the simulated logs shall say of how they were made, as JSON can hold it.
        draw: keep series for figures.

    Raises:
        UsageError: C02, settings that do not fit, or a model of another robot.
        InputRejected: D17, the arm runs away; what the log lacks.
    """
    bare = recording(log)
    how.check(bare.n_joints)
    if arm.n_joints != bare.n_joints:
        raise UsageError("C02", f"the model has {arm.n_joints} joints, {log.name} has {bare.n_joints}", where="simulate",
                         remedy="give a model of this robot")
    plant, reason = Plant.of(arm), "asked for" if how.windowed else ""
    if not how.windowed:
        try:
            experiment = Experiment.of_log(bare)
        except InputRejected as lacking:
            if lacking.code != "RRID-S22" or log.origin == "planned":
                raise
            reason = lacking.message
    if reason:
        return _in_windows(log, bare, plant, how, reason, draw)
    return _closed_loop(log, bare, plant, experiment, how, file, settings, draw)


def _noise(how: How, n_joints: int) -> Noise:
    levels = np.broadcast_to(np.array(how.noise or (0.0,)), (n_joints,)).astype(np.float64)
    return Noise(levels, np.zeros(n_joints))


def _closed_loop(log: ExperimentLog, bare: ExperimentLog, plant: Plant, experiment: Experiment, how: How, file: str,
                 settings: object, draw: bool) -> Imitation:
    noise = _noise(how, log.n_joints)
    step = choose_step(plant, experiment, noise) if how.steps is None else None
    done = run(plant, experiment, step.per_sample if step else how.steps or 1, noise, range(how.seed, how.seed + how.replicas),
               step is None or step.exact)  # who asks for steps asks for their accuracy: a held body would stop short of it
    files = tuple(file if k == 0 else f"{file}-{k + 1}" for k in range(how.replicas))
    logs = tuple(_simulated_log(bare, done, k, settings) for k in range(how.replicas))
    about = _About(log, files, "closed-loop", "", how.replicas, done.steps, step, None, logs)
    between = None if how.replicas < 2 else _rms((np.diff(done.true_q, axis=0)).reshape(-1, log.n_joints))
    if log.origin == "planned" or "q" not in log:
        return _imitation(about, None, None, between, None)
    speed = reconstruct(log, Reconstruction()).motion.dq
    differences = (done.q - log.q, done.true_dq - speed, done.tau - log.tau if "tau" in log else None)
    drawn = course(log, (log.q, done.q[0]), (speed, done.true_dq[0]), (log.tau, done.tau[0])) if draw else None
    return _imitation(about, differences, drawn, between, None)


def _in_windows(log: ExperimentLog, bare: ExperimentLog, plant: Plant, how: How, reason: str, draw: bool) -> Imitation:
    length = max(_SHORTEST, round(how.window / log.sample_time))
    found = reconstruct(log, Reconstruction())
    usable: npt.NDArray[np.bool_] = np.zeros(log.n_samples, dtype=bool)
    usable[found.good.kept] = found.good.fit
    windows = simulate_windows(plant, found.motion, _held(bare), log.sample_time, length, usable)
    about = _About(log, (), "windowed", reason, 1, windows.steps, None, length * log.sample_time, ())
    q, dq = found.motion.q, found.motion.dq
    drawn = course(log, (q, windows.q), (dq, windows.dq), None, windows) if draw else None
    return _imitation(about, ((windows.q - q)[None], (windows.dq - dq)[None], None), drawn, None, windows)


def _held(log: ExperimentLog) -> Array:
    """Torque that acts from each sample to the next: a command is held, of a measurement the mean of its ends is taken."""
    if log.torque != "measured":
        return log.tau
    return np.concatenate([0.5 * (log.tau[1:] + log.tau[:-1]), log.tau[-1:]])


@dataclass(frozen=True)
class _About:
    log: ExperimentLog
    files: tuple[str, ...]
    simulation: str
    reason: str
    replicas: int
    steps: int
    step: Step | None
    window: float | None
    logs: tuple[ExperimentLog, ...]


def _imitation(about: _About, differences: tuple[Array, Array, Array | None] | None, drawn: Course | None,
               between: Array | None, windows: Windows | None) -> Imitation:
    """`differences` of position, speed and torque, each (replicas, samples, joints)."""
    log, joints = about.log, about.log.robot.joints
    q, dq, tau = differences if differences is not None else (None, None, None)
    rms = [None if x is None else _rms(x.reshape(-1, log.n_joints)) for x in (q, dq, tau)]
    return Imitation(
        log.name, log.source, about.files, about.simulation, about.reason,
        "unknown" if log.controller is None else log.controller.law, log.n_samples, about.replicas,
        tuple(schema.joint_unit("q", joint.revolute) for joint in joints),
        tuple(schema.joint_unit("tau", joint.revolute) for joint in joints),
        rms[0], None if q is None else np.nanmax(np.abs(q), axis=(0, 1)), rms[1], rms[2], between, about.steps,
        None if about.step is None else about.step.error, about.window, drawn, about.logs)


def _rms(x: Array) -> Array:
    """Root of the mean square (joints,) of what is there."""
    return np.asarray(np.sqrt(np.nanmean(x**2, axis=0)))


def _simulated_log(log: ExperimentLog, done: Simulated, replica: int, settings: object) -> ExperimentLog:
    """What replica number `replica` would have logged: a log derived from the one it imitates."""
    values = {"t": done.t, "q": done.q[replica], "tau": done.tau[replica]}
    signals = {name: Signal(x, schema.unit_of(name), schema.SIGNALS[name][1]) for name, x in values.items()}
    followed = {name: log.signals[name] for name in _FOLLOWED if name in log}
    text = json.dumps({"settings": settings, "replica": replica + 1}, sort_keys=True)
    about = Derived("simulate", text, digest_of(log), created(log.recorded))
    name = f"{log.name} simulated" + (f" {replica + 1}" if len(done.q) > 1 else "")
    return replace(log, name=name, origin="simulated", torque=None, signals=followed | signals, derived=about)
