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

from pipelines.dynamics.arm import Arm
from pipelines.errors import InputRejected, UsageError
from pipelines.estimation.motion import Reconstruction, reconstruct
from pipelines.io import schema
from pipelines.io.log import Array, Derived, ExperimentLog, Signal, created, digest_of, recording
from pipelines.io.results import NOT_STORED
from pipelines.simulation.closed_loop import Noise, Simulated, run
from pipelines.simulation.config import SIMULATION
from pipelines.simulation.course import Course, course
from pipelines.simulation.experiment import Experiment
from pipelines.simulation.plant import Plant
from pipelines.simulation.replay import held_torque, simulate_windows
from pipelines.simulation.step import choose_step

__all__ = ["How", "Imitation", "imitate"]

_FOLLOWED = ("q_ref", "dq_ref", "ddq_ref", "v")  # what a simulated log takes over


@dataclass(frozen=True)
class How:
    """How to imitate a log."""

    replicas: int = 1
    seed: int = 1  # of the first replica; the others follow
    noise: tuple[float, ...] = ()  # [N m] std of the drives' torque noise: one, or one a joint
    windowed: bool = False  # although the controller is known
    window: float = 0.1  # [s]
    steps: int | None = None  # a sample, the body held in none; None: as few as the error allows

    def check(self, n_joints: int) -> None:
        """Refuse a setting that does not fit.

        Raises:
            UsageError: C02.
        """
        def need(fits: bool, option: str, words: str, remedy: str) -> None:
            if not fits:
                raise UsageError("C02", words, where=option, remedy=remedy)

        longest, most = SIMULATION.window_longest, SIMULATION.most
        need(len(self.noise) in (0, 1, n_joints), "--noise",
             f"{len(self.noise)} noise levels for {n_joints} joints", "give one, or one a joint")
        need(all(0.0 <= level < np.inf for level in self.noise), "--noise",
             "a noise level below zero", "give standard deviations in N m")
        need(1 <= self.replicas <= most, "--replicas", f"{self.replicas} replicas",
             f"give 1 to {most}")
        need(self.seed >= 0, "--seed", f"seed {self.seed}", "give 0 or more")
        need(self.steps is None or 1 <= self.steps <= most, "--steps",
             f"{self.steps} steps a sample", f"give 1 to {most}")
        need(0.0 < self.window <= longest, "--window", f"windows of {self.window:g} s",
             f"give up to {longest:g} s")
        need(self.replicas == 1 or any(self.noise), "--replicas",
             f"{self.replicas} replicas without noise are all the same",
             "say how large the drives' noise is, with --noise")


@dataclass(frozen=True)
class Imitation:
    """The simulation of one log and its differences from the recording.

    Every array is per joint; none where nothing can be compared.
    """

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

    @classmethod
    def of(cls, log: ExperimentLog, simulation: str, reason: str, steps: int) -> Imitation:
        """Return that of a log with which nothing is compared yet."""
        kinds = log.robot.revolute
        law = "unknown" if log.controller is None else log.controller.law
        q, tau = (tuple(schema.joint_unit(name, kind) for kind in kinds) for name in ("q", "tau"))
        return cls(log.name, log.source, (), simulation, reason, law, log.n_samples, 1, q, tau,
                   None, None, None, None, None, steps, None, None, None, ())

    def compared(self, q: Array, dq: Array, tau: Array | None, drawn: Course | None) -> Imitation:
        """Return it with what is off in position, speed and torque, (replicas, samples, joints)."""
        return replace(self, position_rms=_rms(q), position_max=np.nanmax(np.abs(q), axis=(0, 1)),
                       speed_rms=_rms(dq), torque_rms=None if tau is None else _rms(tau),
                       course=drawn)


def imitate(log: ExperimentLog, arm: Arm, how: How, file: str, settings: object = None,
            draw: bool = True) -> Imitation:
    """Simulate `arm` in the experiment of `log`.

    Args:
        file: where the simulated log will lie, without ending.
        settings: stored in the simulated logs, as JSON can hold them.
        draw: keep series for figures.

    Raises:
        UsageError: C02, settings that do not fit, or a model of another robot.
        InputRejected: D17, the arm runs away; what the log lacks.
    """
    bare = recording(log)
    how.check(bare.n_joints)
    if arm.n_joints != bare.n_joints:
        words = f"the model has {arm.n_joints} joints, {log.name} has {bare.n_joints}"
        remedy = "give a model of this robot"
        raise UsageError("C02", words, where="simulate", remedy=remedy)
    plant = Plant.of(arm)
    if how.windowed:
        return _in_windows(log, bare, plant, how, "asked for", draw)
    try:
        experiment = Experiment.of_log(bare)
    except InputRejected as lacking:
        if lacking.code != "RRID-S22" or log.origin == "planned":
            raise
        return _in_windows(log, bare, plant, how, lacking.message, draw)
    levels = np.broadcast_to(np.array(how.noise or (0.0,), dtype=np.float64), (log.n_joints,))
    noise, seeds = Noise(levels, np.zeros(log.n_joints)), range(how.seed, how.seed + how.replicas)
    found = Imitation.of(log, "closed-loop", "", how.steps or 0)
    if how.steps is not None:  # who asks for steps asks for their accuracy: nothing is held
        done = run(plant, experiment, how.steps, noise, seeds)
    else:
        step = choose_step(plant, experiment, noise)
        done = run(plant, experiment, step.per_sample, noise, seeds, step.exact)
        found = replace(found, steps=step.per_sample, step_error=step.error)
    files = tuple(file if k == 0 else f"{file}-{k + 1}" for k in range(how.replicas))
    logs = tuple(_simulated_log(bare, done, k, settings) for k in range(how.replicas))
    between = _rms(np.diff(done.true_q, axis=0)) if how.replicas > 1 else None
    found = replace(found, files=files, logs=logs, replicas=how.replicas, noise_rms=between)
    if log.origin == "planned" or "q" not in log:
        return found
    speed, drawn = reconstruct(log, Reconstruction()).motion.dq, None
    if draw:
        pairs = (log.q, done.q[0]), (speed, done.true_dq[0]), (log.tau, done.tau[0])
        drawn = course(log, *pairs)
    torque = done.tau - log.tau if "tau" in log else None
    return found.compared(done.q - log.q, done.true_dq - speed, torque, drawn)


def _in_windows(log: ExperimentLog, bare: ExperimentLog, plant: Plant, how: How, reason: str,
                draw: bool) -> Imitation:
    length = max(SIMULATION.window_samples, round(how.window / log.sample_time))
    found = reconstruct(log, Reconstruction())
    usable: npt.NDArray[np.bool_] = np.zeros(log.n_samples, dtype=bool)
    usable[found.good.kept] = found.good.fit
    q, dq = found.motion.q, found.motion.dq
    windows = simulate_windows(plant, found.motion, held_torque(bare), log.sample_time, length,
                               usable)
    drawn = course(log, (q, windows.q), (dq, windows.dq), None, windows) if draw else None
    known = Imitation.of(log, "windowed", reason, windows.steps)
    known = known.compared((windows.q - q)[None], (windows.dq - dq)[None], None, drawn)
    return replace(known, window=length * log.sample_time)


def _rms(x: Array) -> Array:
    """Return the root of the mean square (joints,) of what is there."""
    return np.asarray(np.sqrt(np.nanmean(x**2, axis=(0, 1))))


def _simulated_log(log: ExperimentLog, done: Simulated, replica: int,
                   settings: object) -> ExperimentLog:
    """Return what a replica would have logged: a log derived from the one it imitates."""
    values = {"t": done.t, "q": done.q[replica], "tau": done.tau[replica]}
    signals = {name: Signal(x, schema.unit_of(name), schema.SIGNALS[name][1])
               for name, x in values.items()}
    followed = {name: log.signals[name] for name in _FOLLOWED if name in log}
    text = json.dumps({"settings": settings, "replica": replica + 1}, sort_keys=True)
    about = Derived("simulate", text, digest_of(log), created(log.recorded))
    name = f"{log.name} simulated" + (f" {replica + 1}" if len(done.q) > 1 else "")
    return replace(log, name=name, origin="simulated", torque=None, signals=followed | signals,
                   derived=about)
