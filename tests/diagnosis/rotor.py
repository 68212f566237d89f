"""Logs of a rotor that turns about a level axis: its ripple, its friction, and torque logging delay."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.signal import lsim

from pipelines.io.log import ExperimentLog, Signal

__all__ = ["INERTIA", "LAG", "ORDER", "ROTOR", "turned"]

ROTOR = """
name = "motor"
gravity = [0.0, 0.0, -9.81]
[kinematics]
convention = "dh"
[[joint]]
name = "rotor"
type = "revolute"
a = 0.0
alpha = 0.0
d = 0.0
offset = 0.0
"""
INERTIA, LAG, ORDER = 2.5e-4, 0.1, 7.0
_FINE, _RATE, _SECONDS = 8000, 400, 10.0


def turned(seed: int, waves: Mapping[float, float] = {ORDER: 0.04}, lag: float = LAG, mean: float = 0.65,
           sharpness: float = 30.0) -> ExperimentLog:
    """A rotor that turns once in ten seconds, unevenly: its torque, and what a low-pass leaves of it in the log.

    Args:
        waves: amplitude [N m] of each order.
        mean: speed [rad/s].
        sharpness: [s/rad] of its Coulomb friction.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(int(_FINE * _SECONDS)) / _FINE
    rates, phases = 2.0 * np.pi * np.array([0.7, 1.6, 3.1, 5.3]), rng.uniform(0.0, 2.0 * np.pi, 4)
    size = np.array([0.4, 0.4, 0.5, 0.5]) * 0.4  # [rad/s]
    q = mean * t + sum(a / w * np.sin(w * t + p) for a, w, p in zip(size, rates, phases, strict=True))
    dq = mean + sum(a * np.cos(w * t + p) for a, w, p in zip(size, rates, phases, strict=True))
    ddq = sum(-a * w * np.sin(w * t + p) for a, w, p in zip(size, rates, phases, strict=True))
    tau = INERTIA * ddq + 0.01 * np.tanh(sharpness * dq) + 0.004 * dq
    tau += sum(amplitude * np.sin(order * q + 0.4) for order, amplitude in waves.items())
    late = lsim(([1.0], [lag, 1.0]), tau, t, X0=[tau[0] * lag])[1] if lag else tau
    every = _FINE // _RATE
    seen = (t[::every], (q[::every] + rng.normal(0.0, 1e-6, len(t[::every])))[:, None],
            (late[::every] + rng.normal(0.0, 2e-5, len(t[::every])))[:, None])
    signals = {name: Signal(x, unit, name) for name, x, unit in zip(("t", "q", "tau"), seen, ("s", "rad", "N m"), strict=True)}
    return ExperimentLog(f"turn-{seed}", "free", "identify", "measured", "motor", 1.0 / _RATE, ROTOR, signals, torque="measured")
