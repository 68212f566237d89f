"""Healthy logs of the RRR arm, made by the closed form: no fault is in them, so no check may complain.

Torque is averaged over each sample as the format asks, encoder and torque are quantised, friction is Coulomb + viscous
and a little noise lies on everything. `noise` scales all of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np

from pipelines.dynamics.rrr import rigid_body
from pipelines.io.log import Array, Controller, ExperimentLog, Signal
from pipelines.io.robot import RobotDescription, format_robot
from pipelines.io.robot_files import load_robot

TS = 1e-3  # [s]
ENCODER = 1e-5  # [rad]
COULOMB = np.array([3.0, 1.5, 0.4])  # [N m]
VISCOUS = np.array([1.5, 0.9, 0.15])  # [N m s/rad]
POSTURE = np.array([0.2, -0.5, 0.7])  # [rad]
AMPLIFIER = np.array([0.02, 0.01, 0.005])  # [N m]
LIMIT = np.array([60.0, 30.0, 15.0])  # [N m]

Path = Callable[[Array], tuple[Array, Array, Array]]  # t -> q, dq, ddq (samples, joints)


def fourier(rng: np.random.Generator, base_hz: float = 0.2, harmonics: int = 8, level: float = 1.0) -> Path:
    """A periodic motion of all joints, at most 60 % of the arm's speed and acceleration limits."""
    k = 2 * np.pi * base_hz * np.arange(1, harmonics + 1)[:, None]
    a, b = rng.standard_normal((2, harmonics, 3)) / k

    def raw(t: Array) -> tuple[Array, Array, Array]:
        s, c = np.sin(t[:, None] * k.T), np.cos(t[:, None] * k.T)
        return s @ a + c @ b, c @ (k * a) - s @ (k * b), -s @ (k**2 * a) - c @ (k**2 * b)

    _, dq, ddq = raw(np.arange(0, 1 / base_hz, 0.01))
    scale = level * 0.6 * np.minimum(np.array([2, 3, 3]) * np.pi / np.abs(dq).max(axis=0), 60.0 / np.abs(ddq).max(axis=0))

    def scaled(scale: Array) -> Path:
        def path(t: Array) -> tuple[Array, Array, Array]:
            q, dq, ddq = raw(t)
            return POSTURE + scale * q, scale * dq, scale * ddq

        return path

    while (np.abs(arm_torque(scaled(scale), np.arange(0, 1 / base_hz, 0.01))) > 0.9 * LIMIT).any():
        scale = 0.8 * scale
    return scaled(scale)


def one_joint(path: Path, joint: int) -> Path:
    """The same motion of one joint, the others locked."""
    only = np.arange(1, 4) == joint

    def alone(t: Array) -> tuple[Array, Array, Array]:
        q, dq, ddq = path(t)
        return np.where(only, q, POSTURE), dq * only, ddq * only

    return alone


def rest(t: Array) -> tuple[Array, Array, Array]:
    still = np.zeros((len(t), 3))
    return still + POSTURE, still, still


def stops(rng: np.random.Generator, moves: int = 5) -> Path:
    """Point to point with rests: quintic moves of 0.8 s, rests of 0.4 s, now and then a joint that stays."""
    goals = np.cumsum(np.vstack([POSTURE, rng.uniform(-0.5, 0.5, (moves, 3)) * (rng.random((moves, 3)) > 0.2)]), axis=0)

    def path(t: Array) -> tuple[Array, Array, Array]:
        number = np.clip((t / 1.2).astype(int), 0, moves - 1)
        s = np.clip((t - 1.2 * number) / 0.8, 0, 1)[:, None]
        step = goals[number + 1] - goals[number]
        return (goals[number] + step * (10 * s**3 - 15 * s**4 + 6 * s**5),
                step * (30 * s**2 - 60 * s**3 + 30 * s**4) / 0.8, step * (60 * s - 180 * s**2 + 120 * s**3) / 0.64)

    return path


@lru_cache
def arm() -> RobotDescription:
    return load_robot("rrr")


def arm_torque(path: Path, t: Array) -> Array:
    """Torque (samples, 3) [N m] of rigid body and friction at `t`."""
    body = rigid_body(arm())
    p = body.known_parameters()
    assert p is not None
    q, dq, ddq = path(t)
    return body.torque(q, dq, ddq, p) + COULOMB * np.tanh(200.0 * dq) + VISCOUS * dq


def make_log(path: Path, experiment: str = "excitation", *, duration: float = 6.0, sample_time: float = TS, seed: int = 0,
             noise: float = 1.0, joint: int | None = None, start: float = 0.0, period: float | None = None,
             torque: Callable[[Path, Array], Array] = arm_torque, role: str = "identify",
             controller: Controller | None = None, reference: bool = True) -> ExperimentLog:
    """The log of an arm that moves along `path`."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(duration / sample_time)) * sample_time
    q, dq, ddq = path(t)
    measured = ENCODER * np.rint((q + 3e-6 * noise * rng.standard_normal(q.shape)) / ENCODER)
    average = np.mean([torque(path, t + sample_time * (k + 0.5) / 4) for k in range(4)], axis=0)
    counts = LIMIT / 4096
    tau = counts * np.rint((average + noise * AMPLIFIER * rng.standard_normal(q.shape)) / counts)
    signals = {"t": Signal(start + t, "s", "time stamp"), "q": Signal(measured, "rad", "measured joint position"),
               "tau": Signal(tau, "N m", "commanded joint torque")}
    if reference:
        lag = 1e-3 * dq  # what a controller leaves
        signals |= {"q_ref": Signal(q + lag, "rad", "reference position"), "dq_ref": Signal(dq, "rad/s", "reference velocity"),
                    "ddq_ref": Signal(ddq, "rad/s^2", "reference acceleration")}
    return ExperimentLog(name=f"{experiment}-{seed}", experiment=experiment, role=role, origin="measured", robot_name="rrr-tue",
                         sample_time=sample_time, robot_text=format_robot(arm()), signals=signals, joint=joint, period=period,
                         posture=POSTURE if experiment in ("hold", "frf") else None, controller=controller)


@lru_cache(maxsize=16)
def good_log(seed: int = 0, **options: object) -> ExperimentLog:
    """6 s of excitation at 1 kHz. Whoever spoils it takes a copy of what he changes."""
    return make_log(fourier(np.random.default_rng(1000 + seed)), seed=seed, **options)  # type: ignore[arg-type]


def with_signal(log: ExperimentLog, **changes: Array) -> ExperimentLog:
    """`log` with other samples in some of its signals."""
    return replace(log, signals={**log.signals, **{k: replace(log.signals[k], values=v) for k, v in changes.items()}})


def changed(log: ExperimentLog, name: str, where: object, value: object) -> ExperimentLog:
    """`log` with `log[name][where] = value`."""
    values = log[name].copy()
    values[where] = value  # type: ignore[index]
    return with_signal(log, **{name: values})


def rows(log: ExperimentLog, keep: object) -> ExperimentLog:
    """`log` with the samples `keep` only."""
    return replace(log, signals={k: replace(s, values=s.values[keep]) for k, s in log.signals.items()})  # type: ignore[index]


def begun(log: ExperimentLog, samples: int) -> ExperimentLog:
    """`log` up to that sample: what is no whole period declares none."""
    return replace(rows(log, slice(0, samples)), period=None)


def healthy_logs(seeds: range) -> list[ExperimentLog]:
    """Every kind of experiment, slow and fast, clean and noisy, with and without a reference or rests."""
    logs = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        path = fourier(rng, base_hz=float(rng.choice([0.1, 0.2, 0.4])), harmonics=int(rng.integers(3, 9)),
                       level=float(rng.uniform(0.3, 1.0)))
        common = {"seed": seed, "noise": float(rng.choice([0.0, 1.0, 10.0])), "reference": bool(rng.random() < 0.5),
                  "sample_time": float(rng.choice([5e-4, 1e-3, 2e-3, 4e-3])), "start": float(rng.choice([0.0, 17.3, 1.7e9]))}
        joint = int(rng.integers(1, 4))
        logs += [make_log(path, "excitation", duration=10.0, **common),  # type: ignore[arg-type]
                 make_log(one_joint(path, joint), "friction", joint=joint, **common),  # type: ignore[arg-type]
                 make_log(rest, "hold", duration=2.0, **common),  # type: ignore[arg-type]
                 make_log(stops(rng), "free", **common),  # type: ignore[arg-type]
                 make_log(stops(rng), "writing", role="validate", **common)]  # type: ignore[arg-type]
    return logs
