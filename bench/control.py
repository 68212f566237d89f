"""The observer in the loop and the control laws, Kostić et al. 2004, eq. (16)-(27).

e and ė of every law are the observer's ē, dē (velocity "observer"), or q - q_ref as read and its
backward difference ("backward-difference", the first one zero).

    OpenLoop          τ_j given on the open joints; τ = -K_p e - K_d ė on the held ones
    Decentralised     τ = -K_p e - K_d ė, (23)
    FeedForward       the same + parts of D(q_r) q̈_r + c(q_r, q̇_r) + h(q_r) + τ_f(q̇_r), (24)
    ComputedTorque    τ = D(q̄) r + c(q̄, dq̄) + h(q̄) + τ_f(q̇_r), r = -k_p e - k_d ė + v, (25), (27)

q̄, dq̄ are the observer's in any case. Friction is compensated at the speed
of the reference: at the measured one it would chatter on the joints that are held.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, sin
from typing import Protocol

import numpy as np

from bench.config import SAMPLE_TIME
from bench.machine import Floats, Machine
from bench.motions import Reference
from pipelines.io.log import Array, Controller

FEEDFORWARD = ("friction", "inertia", "coriolis", "gravity")
Gains = tuple[float, ...]


def observer_gain(sample_time: float, noise: float, jerk: float) -> tuple[float, float, float]:
    """Return k of eq. (20), stationary: the Riccati equation iterated until it no longer changes.

        E, γ of (19b);  P⁻ = E P⁺ Eᵀ + σ_ξ² γ γᵀ;  k = P⁻ c/(cᵀ P⁻ c + R);  P⁺ = (1 - k cᵀ) P⁻

    In units of T and of the noise only Λ = σ_ξ T³/σ_η remains, which keeps the numbers near one.

    Args:
        sample_time: T [s].
        noise: σ_η [rad].
        jerk: σ_ξ [rad/s^3].
    """
    e = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    gamma = np.array([1.0 / 6.0, 0.5, 1.0])
    q = (jerk * sample_time**3 / noise) ** 2 * np.outer(gamma, gamma)
    after, k = np.zeros((3, 3)), np.zeros(3)
    for _ in range(1_000_000):
        before = e @ after @ e.T + q
        k, last = before[:, 0] / (before[0, 0] + 1.0), k
        keep = np.eye(3)
        keep[:, 0] -= k
        after = keep @ before @ keep.T + np.outer(k, k)  # Joseph's form stays symmetric
        if np.abs(k - last).max() < 1e-15 * k.max():
            break
    k1, k2, k3 = (k / sample_time ** np.arange(3)).tolist()
    return k1, k2, k3


class Observer:
    """The recursion (20) for all joints, in plain Python; it starts with zero error."""

    def __init__(self, gains: tuple[tuple[float, float, float], ...], sample_time: float) -> None:
        self._gains, self._t, self._half = gains, sample_time, 0.5 * sample_time**2
        self.e = [0.0] * len(gains)  # [rad] ē
        self.de = [0.0] * len(gains)  # [rad/s]
        self.nu = [0.0] * len(gains)  # [rad/s^2]
        self._first = True

    def update(self, y: Floats) -> None:
        """Update x̂ = E x̄, x̄ = x̂ + k (y - ê) with `y` (n,) [rad], measured minus reference."""
        t, half = (0.0, 0.0) if self._first else (self._t, self._half)
        self._first = False
        for j, (k1, k2, k3) in enumerate(self._gains):
            nu = self.nu[j]
            e = self.e[j] + t * self.de[j] + half * nu
            de = self.de[j] + t * nu
            innovation = y[j] - e
            self.e[j] = e + k1 * innovation
            self.de[j] = de + k2 * innovation
            self.nu[j] = nu + k3 * innovation


class ControllerModel(Protocol):
    """The model that a controller runs on: fitted, or a disturbed truth."""

    @property
    def text(self) -> str | None:
        """The text of its model.json, for the log; None: the log does not say."""

    def parts(self, q: Floats, dq: Floats, ddq: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Return friction, inertia D ddq, Coriolis and gravity of one sample [N m], lists of n."""

    def along(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return the same of a whole motion (4, samples, n)."""


Step = Callable[[int, Floats, Observer], Floats]
"""Torque (n,) [N m] at sample k, before quantisation, from positions as read [rad] and the
observer's state.
"""


class Law(Protocol):
    """A control law with its settings."""

    def describe(self, machine: Machine) -> Controller:
        """Return the controller's entry in the log."""

    def start(self, machine: Machine, reference: Reference) -> tuple[Step, dict[str, Array]]:
        """Begin a run: return the law at work, and further signals (samples, n) that it fills."""


def _feedback(kp: Gains, kd: Gains, velocity: str, reference: Reference) -> Step:
    """Return -K_p e - K_d ė, e and ė as `velocity` says."""
    gains, q_ref = list(zip(kp, kd, strict=True)), reference.q.tolist()
    last: Floats = []

    def observed(k: int, q: Floats, observer: Observer) -> Floats:
        rows = zip(gains, observer.e, observer.de, strict=True)
        return [-p * e - d * de for (p, d), e, de in rows]

    def differenced(k: int, q: Floats, observer: Observer) -> Floats:
        nonlocal last
        error = [a - b for a, b in zip(q, q_ref[k], strict=True)]
        rows = zip(gains, error, last or error, strict=True)
        last = error
        return [-p * e - d * (e - before) / SAMPLE_TIME for (p, d), e, before in rows]

    return observed if velocity == "observer" else differenced


def _describe(
    machine: Machine,
    law: str,
    gains: tuple[Gains, Gains],
    velocity: str,
    model: ControllerModel | None = None,
    feedforward: tuple[str, ...] | None = None,
) -> Controller:
    observed = velocity == "observer" or model is not None
    return Controller(
        law,
        np.array(gains[0]),
        np.array(gains[1]),
        feedforward=feedforward,
        velocity=velocity,
        observer_gain=np.array(machine.observer_gain) if observed else None,
        output_limit=np.array(machine.torque_limit),
        torque_resolution=np.array(machine.torque_resolution) if machine.quantised_torque else None,
        delay=machine.delay,
        model=model.text if model is not None else None,
    )


def _softer(machine: Machine, stiffness: float) -> tuple[Gains, Gains]:
    """Return gains softer by s in stiffness and by √s in damping: the damping ratio stays."""
    kp, kd = machine.kp, machine.kd
    return tuple(stiffness * k for k in kp), tuple(stiffness**0.5 * k for k in kd)


@dataclass(frozen=True)
class Decentralised:
    """A PD controller at each joint, eq. (23), with the machine's gains times `stiffness`."""

    velocity: str = "observer"
    stiffness: float = 1.0

    def describe(self, machine: Machine) -> Controller:
        return _describe(machine, "pd", _softer(machine, self.stiffness), self.velocity)

    def start(self, machine: Machine, reference: Reference) -> tuple[Step, dict[str, Array]]:
        return _feedback(*_softer(machine, self.stiffness), self.velocity, reference), {}


@dataclass(frozen=True, eq=False)
class OpenLoop:
    """Given torque on the open joints, whose logged gains are zero; the others held by PD.

    `gravity` (n, 2) adds c sin q + c' cos q on the open joints, from the position as read: Section
    IV.B closes that loop around a joint that gravity pulls at. A log has no words for it, so that
    its law is then "unknown": replayed as if nothing had fed it back, such a torque lets the arm
    fall.
    """

    torque: Array  # (samples, n) [N m]
    open: tuple[bool, ...]
    gravity: Array | None = None  # (n, 2) [N m]
    velocity: str = "observer"

    def describe(self, machine: Machine) -> Controller:
        balanced = self.gravity is not None and bool(np.any(self.gravity))
        law = "unknown" if balanced else "open-loop"
        return _describe(machine, law, self._gains(machine), self.velocity)

    def start(self, machine: Machine, reference: Reference) -> tuple[Step, dict[str, Array]]:
        back = _feedback(*self._gains(machine), self.velocity, reference)
        given = np.where(self.open, self.torque, 0.0).tolist()
        weights = [] if self.gravity is None else self.gravity.tolist()
        balanced = [(j, s, c) for j, (s, c) in enumerate(weights) if self.open[j]]

        def step(k: int, q: Floats, observer: Observer) -> Floats:
            tau = [a + b for a, b in zip(given[k], back(k, q, observer), strict=True)]
            for j, s, c in balanced:
                tau[j] += s * sin(q[j]) + c * cos(q[j])
            return tau

        return step, {}

    def _gains(self, machine: Machine) -> tuple[Gains, Gains]:
        held = [0.0 if free else 1.0 for free in self.open]
        kp = tuple(k * on for k, on in zip(machine.kp, held, strict=True))
        return kp, tuple(k * on for k, on in zip(machine.kd, held, strict=True))


@dataclass(frozen=True, eq=False)
class FeedForward:
    """PD with any parts of a model ahead of it, eq. (24)."""

    model: ControllerModel
    parts: tuple[str, ...] = FEEDFORWARD
    velocity: str = "observer"
    stiffness: float = 1.0

    def describe(self, machine: Machine) -> Controller:
        gains = _softer(machine, self.stiffness)
        return _describe(machine, "pd+feedforward", gains, self.velocity, self.model, self.parts)

    def start(self, machine: Machine, reference: Reference) -> tuple[Step, dict[str, Array]]:
        back = _feedback(*_softer(machine, self.stiffness), self.velocity, reference)
        every = self.model.along(reference.q, reference.dq, reference.ddq)
        by_part = dict(zip(FEEDFORWARD, every, strict=True))
        total = np.sum([by_part[part] for part in self.parts], axis=0)
        extras = {"tau_feedforward": total}
        if "friction" in self.parts:
            extras["tau_friction"] = by_part["friction"]
        ahead = total.tolist()

        def step(k: int, q: Floats, observer: Observer) -> Floats:
            return [a + b for a, b in zip(ahead[k], back(k, q, observer), strict=True)]

        return step, extras


@dataclass(frozen=True, eq=False)
class ComputedTorque:
    """Feedback linearisation with an injected excitation, eq. (25)-(27)."""

    model: ControllerModel
    v: Array  # (samples, n) [rad/s^2]
    kp: Gains  # [1/s^2]
    kd: Gains  # [1/s]
    velocity: str = "backward-difference"

    def describe(self, machine: Machine) -> Controller:
        return _describe(machine, "computed-torque", (self.kp, self.kd), self.velocity, self.model)

    def start(self, machine: Machine, reference: Reference) -> tuple[Step, dict[str, Array]]:
        back = _feedback(self.kp, self.kd, self.velocity, reference)
        q_ref, dq_ref, v = reference.q.tolist(), reference.dq.tolist(), self.v.tolist()
        friction = self.model.along(reference.q, reference.dq, np.zeros_like(reference.q))[0]
        compensated, r_kept = friction.tolist(), np.zeros_like(reference.q)

        def step(k: int, q: Floats, observer: Observer) -> Floats:
            r = [a + b for a, b in zip(back(k, q, observer), v[k], strict=True)]
            r_kept[k] = r
            seen = [a + b for a, b in zip(q_ref[k], observer.e, strict=True)]
            speed = [a + b for a, b in zip(dq_ref[k], observer.de, strict=True)]
            _, inertia, coriolis, gravity = self.model.parts(seen, speed, r)
            rows = zip(inertia, coriolis, gravity, compensated[k], strict=True)
            return [a + b + c + d for a, b, c, d in rows]

        return step, {"r": r_kept, "v": self.v, "tau_friction": friction}
