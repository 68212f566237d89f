"""A joint on its own, simulated here: friction written out, Runge-Kutta at 0.25 ms, encoder of 1e-5 rad, noise of the torque.

Nothing of it is the project's: laws are plain functions of speed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pipelines.io import schema
from pipelines.io.log import Array, ExperimentLog, Signal
from pipelines.io.robot import format_robot
from pipelines.io.robot_files import load_robot

Friction = Callable[[float], float]

STEP = 1e-3  # [s]
ENCODER = 1e-5  # [rad]
NOISE = 0.02  # [N m] rms a sample
INERTIA, SINE, COSINE = 0.0985, 1.70, 0.35  # [kg m^2], [N m]
JOINT = 3


@dataclass(frozen=True)
class Truth:
    """A friction law as a function of speed, and roughly how large it is."""

    name: str
    torque: Friction
    coulomb: float = 1.2  # [N m]
    viscous: float = 0.12  # [N m s/rad]

    def curve(self, speed: Array) -> Array:
        return np.array([self.torque(v) for v in speed.tolist()])


def sigmoids(v: float) -> float:
    """The elbow of the paper's machine, verified.md section 8."""
    return 0.4 * math.tanh(120.0 * v) + 1.2 * math.tanh(60.0 * v) - 0.4 * math.tanh(12.0 * v) + 0.12 * v


def _coulomb(v: float) -> float:
    return 1.2 * math.tanh(100.0 * v) + 0.12 * v


TRUTHS = {truth.name: truth for truth in (
    Truth("three_sigmoid", sigmoids),
    Truth("coulomb+viscous", _coulomb),
    Truth("stribeck", lambda v: _coulomb(v) + 0.48 * math.exp(-((v / 0.15) ** 2)) * math.tanh(100.0 * v)),
    Truth("concave_friction", lambda v: 0.8 * math.tanh(100.0 * v) + 0.06 * v + 0.48 * math.tanh(v / 1.5)),
    Truth("asymmetric_friction", lambda v: _coulomb(v) + 0.12 * abs(math.tanh(100.0 * v)) + 0.015 * abs(v)),
    Truth("quadratic_drag", lambda v: _coulomb(v) + 0.03 * v * abs(v)),
)}


def torque_plan(rng: np.random.Generator, duration: float, truth: Truth) -> Array:
    """Five slow sines of random phase whose size swells: speeds over two decades, many reversals. (samples,) [N m]"""
    t = np.arange(round(duration / STEP)) * STEP
    waves = sum(np.sin(2.0 * np.pi * hz * t + phase) for hz, phase in zip((0.13, 0.31, 0.57, 0.83, 1.27),
                                                                          rng.uniform(0.0, 2.0 * np.pi, 5), strict=True))
    size = 1.1 * truth.coulomb + 0.4 * 6.0 * truth.viscous + 0.5 * SINE
    return np.asarray(size * (0.55 + 0.45 * np.sin(2.0 * np.pi * t / duration)) * waves / 1.6)


def driven(torque: Array, friction: Friction, inertia: float = INERTIA, gravity: tuple[float, float] = (SINE, COSINE),
           start: tuple[float, float] = (0.0, 0.0), parts: int = 4, more: Callable[[float, float], float] | None = None) -> Array:
    """Position and speed (samples, 2) under held torque (samples,).

    Args:
        more: what else holds the joint back [N m], by position and speed.
    """
    h, (q, v), (c, d), out = STEP / parts, start, gravity, np.empty((len(torque), 2))

    def rate(q: float, v: float, u: float) -> float:
        rest = 0.0 if more is None else more(q, v)
        return (u - c * math.sin(q) - d * math.cos(q) - friction(v) - rest) / inertia

    for k, u in enumerate(torque.tolist()):
        out[k] = q, v
        for _ in range(parts):
            a1 = rate(q, v, u)
            a2 = rate(q + 0.5 * h * v, v2 := v + 0.5 * h * a1, u)
            a3 = rate(q + 0.5 * h * v2, v3 := v + 0.5 * h * a2, u)
            a4 = rate(q + h * v3, v4 := v + h * a3, u)
            q += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
            v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    return out


def as_log(q: Array, tau: Array, name: str, role: str = "identify", experiment: str = "friction") -> ExperimentLog:
    """The log of joint 3 of the RRR arm, the others exactly at rest."""
    robot = load_robot("rrr")
    still = np.zeros((len(q), 3))
    values = {"t": np.arange(len(q)) * STEP, "q": still.copy(), "tau": still.copy()}
    values["q"][:, JOINT - 1], values["tau"][:, JOINT - 1] = q, tau
    signals = {key: Signal(array, schema.unit_of(key), schema.SIGNALS[key][1]) for key, array in values.items()}
    return ExperimentLog(name, experiment, role, "simulated", robot.name, STEP, format_robot(robot), signals,
                         joint=JOINT if experiment == "friction" else None)


@lru_cache(maxsize=64)
def recorded(law: str, seed: int, role: str = "identify", duration: float = 20.0, noise: float = NOISE) -> ExperimentLog:
    """20 s of a machine with this law: torque noise acts on the joint, and the log holds what was commanded."""
    rng = np.random.default_rng([5, seed])
    truth = TRUTHS[law]
    torque = torque_plan(rng, duration, truth)
    states = driven(torque + noise * rng.standard_normal(len(torque)), truth.torque)
    return as_log(np.round(states[:, 0] / ENCODER) * ENCODER, torque, f"{law.replace('+', '-')}-{seed}", role)


def driven_speeds(log: ExperimentLog) -> Array:
    """Speeds (points,) [rad/s] between a thousandth of the fastest and the fastest, both ways, as the log drove them."""
    v = np.abs(np.gradient(log.q[:, JOINT - 1], STEP))
    fastest = float(np.quantile(v, 0.995))
    side = np.geomspace(1e-3 * fastest, fastest, 200)
    return np.concatenate([-side[::-1], side])


def relative(curve: Array, truth: Array) -> float:
    return float(np.linalg.norm(curve - truth) / np.linalg.norm(truth))
