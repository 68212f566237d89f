"""Imitate one log: simulate what it recorded, in closed loop or in short windows, and compare.

found = imitate(log, arm, How(replicas=5))
found.position_rms                       [rad] simulated minus measured, joint by joint
found.logs                               what the replicas would have logged
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.errors import InputRejected, UsageError
from pipelines.estimation.motion import Reconstruction, reconstruct
from pipelines.io import schema
from pipelines.io.log import Array, Derived, ExperimentLog, Signal, created, digest_of, recording
from pipelines.io.option import option
from pipelines.io.results import NOT_STORED
from pipelines.simulation.closed_loop import Noise, Simulated, run
from pipelines.simulation.config import SIMULATION
from pipelines.simulation.experiment import Experiment
from pipelines.simulation.plant import Plant
from pipelines.simulation.replay import held_torque, simulate_windows
from pipelines.simulation.step import choose_step

__all__ = ["Course", "How", "Imitation", "imitate"]


Pair = tuple[Array, Array]


@dataclass(frozen=True)
class Course:
    """Measured and simulated signals (points, joints).

    t has two points a stretch, its lowest and its highest sample.
    """

    t: Array  # [s] (points,)
    position: Array  # [rad] measured
    position_simulated: Array
    position_difference: Array  # simulated minus measured
    speed: Array  # [rad/s] reconstructed
    speed_simulated: Array
    torque: Array | None = None  # [N m] commanded
    torque_simulated: Array | None = None
    torque_difference: Array | None = None


@dataclass(frozen=True)
class How:
    """How to imitate a log."""

    replicas: int = option(1, "Simulations that differ in their noise; windows have one.")
    seed: int = option(1, "Seed of the first one's noise.")
    noise: tuple[float, ...] = option(
        (),
        "Torque noise of the drives, std [N m], one or one a joint: 0.02,0.01,0.005. Windows have "
        "none. [0]",
    )
    windowed: bool = option(False, "In short windows, though the controller is known.")
    window: float = option(0.1, "Length of such a window [s].")
    steps: int | None = option(
        None, "Runge-Kutta steps a sample; 1 to 1000. [as few as the error allows]"
    )

    def check(self, n_joints: int) -> None:
        """Refuse a setting that does not fit.

        Raises:
            UsageError: C02.
        """
        longest, most = SIMULATION.window_longest, SIMULATION.most
        levels = all(0.0 <= level < np.inf for level in self.noise)
        alone = self.replicas == 1 or any(self.noise)
        rules = (
            ("noise", len(self.noise) in (0, 1, n_joints) and levels, f"one level, or {n_joints}"),
            ("replicas", 1 <= self.replicas <= most, f"1 to {most}"),
            ("seed", self.seed >= 0, "0 or more"),
            ("steps", self.steps is None or 1 <= self.steps <= most, f"1 to {most}"),
            ("window", 0.0 < self.window <= longest, f"up to {longest:g} s"),
            ("replicas", alone, "the drives' --noise too: without it all are the same"),
        )
        for name, fits, wanted in rules:
            if not fits:
                words = f"--{name} {getattr(self, name)} does not fit"
                raise UsageError("C02", words, where=f"--{name}", remedy=f"give {wanted}")


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
    position_rms: Array | None = None  # [rad] simulated minus measured, all replicas
    position_max: Array | None = None
    speed_rms: Array | None = None  # [rad/s] minus the reconstructed one
    torque_rms: Array | None = None  # [N m] commanded; null where the torque was given
    noise_rms: Array | None = None  # [rad] difference of two replicas with different noise
    steps: int = 0  # of the integrator, a sample
    step_error: Array | None = None  # [rad] what halving them changes; null where they were given
    window: float | None = None  # [s]
    course: Course | None = None
    logs: tuple[ExperimentLog, ...] = field(default=(), metadata=NOT_STORED, repr=False)


def imitate(
    log: ExperimentLog, arm: Arm, how: How, file: str, settings: object = None, draw: bool = True
) -> Imitation:
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
    experiment, reason = None, "asked for"
    if not how.windowed:
        try:
            experiment = Experiment.of_log(bare)
        except InputRejected as lacking:
            if lacking.code != "RRID-S22" or log.origin == "planned":
                raise
            reason = lacking.message
    kinds = log.robot.revolute
    units = tuple(schema.joint_unit("q", kind) for kind in kinds)
    torque = tuple(schema.joint_unit("tau", kind) for kind in kinds)
    law = "unknown" if log.controller is None else log.controller.law
    simulation, reason = ("windowed", reason) if experiment is None else ("closed-loop", "")
    size = log.n_samples
    known = Imitation(log.name, log.source, (), simulation, reason, law, size, 1, units, torque)
    if experiment is None:
        return _in_windows(log, bare, Plant.of(arm), how, known, draw)
    return _in_loop(log, bare, Plant.of(arm), experiment, how, known, (file, settings, draw))


def _in_loop(
    log: ExperimentLog,
    bare: ExperimentLog,
    plant: Plant,
    experiment: Experiment,
    how: How,
    known: Imitation,
    kept: tuple[str, object, bool],
) -> Imitation:
    (file, settings, draw), count = kept, how.replicas
    levels = np.broadcast_to(np.array(how.noise or (0.0,), dtype=np.float64), (log.n_joints,))
    noise, seeds = Noise(levels, np.zeros(log.n_joints)), range(how.seed, how.seed + count)
    if how.steps is not None:  # who asks for steps asks for their accuracy: nothing is held
        done, error = run(plant, experiment, how.steps, noise, seeds), None
    else:
        step = choose_step(plant, experiment, noise)
        done = run(plant, experiment, step.per_sample, noise, seeds, step.exact)
        error = step.error
    files = tuple(file if k == 0 else f"{file}-{k + 1}" for k in range(count))
    logs = tuple(_simulated_log(bare, done, k, settings) for k in range(count))
    between = _rms(np.diff(done.true_q, axis=0)) if count > 1 else None
    known = replace(known, files=files, logs=logs, replicas=count, noise_rms=between)
    known = replace(known, steps=done.steps, step_error=error)
    if log.origin == "planned" or "q" not in log:
        return known
    speed = reconstruct(log, Reconstruction()).motion.dq
    q, dq = (log.q, done.q[0]), (speed, done.true_dq[0])
    return replace(
        known,
        position_rms=_rms(done.q - log.q),
        position_max=np.nanmax(np.abs(done.q - log.q), axis=(0, 1)),
        speed_rms=_rms(done.true_dq - speed),
        torque_rms=_rms(done.tau - log.tau) if "tau" in log else None,
        course=_course(log, q, dq, (log.tau, done.tau[0])) if draw else None,
    )


def _in_windows(
    log: ExperimentLog, bare: ExperimentLog, plant: Plant, how: How, known: Imitation, draw: bool
) -> Imitation:
    length = max(SIMULATION.window_samples, round(how.window / log.sample_time))
    found = reconstruct(log, Reconstruction())
    usable = np.zeros(log.n_samples, dtype=bool)
    usable[found.good.kept] = found.good.fit
    motion, tau = found.motion, held_torque(bare)
    windows = simulate_windows(plant, motion, tau, log.sample_time, length, usable)
    q, dq = (motion.q, windows.q), (motion.dq, windows.dq)
    off = (windows.q - motion.q)[None]
    return replace(
        known,
        position_rms=_rms(off),
        position_max=np.nanmax(np.abs(off), axis=(0, 1)),
        speed_rms=_rms((windows.dq - motion.dq)[None]),
        steps=windows.steps,
        window=length * log.sample_time,
        course=_course(log, q, dq, None) if draw else None,
    )


def _rms(x: Array) -> Array:
    """Return the root of the mean square (joints,) of what is there."""
    return np.asarray(np.sqrt(np.nanmean(x**2, axis=(0, 1))))


def _simulated_log(
    log: ExperimentLog, done: Simulated, replica: int, settings: object
) -> ExperimentLog:
    """Return what a replica would have logged: a log derived from the one it imitates."""
    values = {"t": done.t, "q": done.q[replica], "tau": done.tau[replica]}
    signals = {
        name: Signal(x, schema.unit_of(name), schema.SIGNALS[name][1]) for name, x in values.items()
    }
    followed = ("q_ref", "dq_ref", "ddq_ref", "v")  # what a simulated log takes over
    taken = {name: log.signals[name] for name in followed if name in log}
    text = json.dumps({"settings": settings, "replica": replica + 1}, sort_keys=True)
    about = Derived("simulate", text, digest_of(log), created(log.recorded))
    name = f"{log.name} simulated" + (f" {replica + 1}" if len(done.q) > 1 else "")
    return replace(
        log, name=name, origin="simulated", torque=None, signals=taken | signals, derived=about
    )


def _course(log: ExperimentLog, q: Pair, dq: Pair, tau: Pair | None) -> Course:
    """Return the series of one log; each pair is measured and simulated (samples, joints)."""
    size = max(1, -(-log.n_samples // SIMULATION.stretches))
    first = np.arange(0, log.n_samples, size)
    middle = np.minimum(first + size // 2, log.n_samples - 1)
    t = np.stack([log.t[first], log.t[middle]], axis=1).ravel()
    torque = () if tau is None else (*tau, tau[1] - tau[0])
    series = (*q, q[1] - q[0], *dq, *torque)
    return Course(t, *(_envelope(x, size) for x in series))


def _envelope(x: Array, size: int) -> Array:
    """(2 stretches, joints): lowest and highest of each `size` samples, NaN without any."""
    first = np.arange(0, len(x), size)
    low = np.minimum.reduceat(np.where(np.isnan(x), np.inf, x), first, axis=0)
    high = np.maximum.reduceat(np.where(np.isnan(x), -np.inf, x), first, axis=0)
    both = np.stack([low, high], axis=1).reshape(-1, x.shape[1])
    return np.where(np.isfinite(both), both, np.nan)
