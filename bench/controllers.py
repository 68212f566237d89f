"""The control laws, Kostić et al. 2004, eq. (23)-(27): from what was read to the torque that is commanded.

e and ė of every law are the observer's ē, dē (velocity "observer"), or q - q_ref as read and its backward difference
("backward-difference", the first one zero).

    OpenLoop          τ_j given on the open joints; τ = -K_p e - K_d ė on the held ones
    Decentralised     τ = -K_p e - K_d ė                                                                      (23)
    FeedForward       τ = parts of D(q_r) q̈_r + c(q_r, q̇_r) + h(q_r) + τ_f(q̇_r) - K_p e - K_d ė              (24)
    ComputedTorque    τ = D(q̄) r + c(q̄, dq̄) + h(q̄) + τ_f(q̇_r),  r = -k_p e - k_d ė + v                  (25), (27)

q̄, dq̄ are the observer's, whatever the derivative term uses. Friction is compensated at the speed of the reference:
at the measured one it would chatter on the joints that are held.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin
from typing import Protocol

import numpy as np

from bench.machine import Machine
from bench.observer import Observer
from bench.reference import Reference
from pipelines.io.experiment import Array, Controller

__all__ = ["FEEDFORWARD", "ComputedTorque", "ControllerModel", "Decentralised", "FeedForward", "Law", "OpenLoop", "Step"]

Floats = list[float]
FEEDFORWARD = ("friction", "inertia", "coriolis", "gravity")


class ControllerModel(Protocol):
    """The model that a controller runs on: fitted, or a disturbed truth."""

    @property
    def text(self) -> str | None:
        """What the log carries: the text of its model.json; None: the log does not say."""
        ...

    def parts(self, q: Floats, dq: Floats, ddq: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Friction, inertia D ddq, Coriolis and gravity of one sample [N m], each a list of n."""
        ...


class Step(Protocol):
    """A law at work on one run."""

    extras: dict[str, Array]  # further signals (samples, n) that it computed online

    def __call__(self, k: int, q: Floats, observer: Observer) -> Floats:
        """Torque (n,) [N m] at sample k, before quantisation, from measured positions [rad] and the observer's state."""
        ...


class Law(Protocol):
    """A control law with its settings."""

    def describe(self, machine: Machine) -> Controller:
        """What the log says of it."""
        ...

    def start(self, machine: Machine, reference: Reference, sample_time: float) -> Step:
        """Begin a run."""
        ...


class Feedback:
    """-K_p e - K_d ė, e and ė as `velocity` says."""

    def __init__(self, kp: Floats, kd: Floats, velocity: str, reference: Reference, sample_time: float) -> None:
        self._gains = list(zip(kp, kd, strict=True))
        self._observed = velocity == "observer"
        self._q_ref = reference.q.tolist()
        self._t = sample_time
        self._last: Floats | None = None

    def __call__(self, k: int, q: Floats, observer: Observer) -> Floats:
        if self._observed:
            return [-kp * e - kd * de for (kp, kd), e, de in zip(self._gains, observer.e, observer.de, strict=True)]
        error = [a - b for a, b in zip(q, self._q_ref[k], strict=True)]
        last = self._last or error
        self._last = error
        return [-kp * e - kd * (e - before) / self._t for (kp, kd), e, before in zip(self._gains, error, last, strict=True)]


def _describe(machine: Machine, law: str, kp: tuple[float, ...], kd: tuple[float, ...], velocity: str,
              model: ControllerModel | None = None, feedforward: tuple[str, ...] | None = None) -> Controller:
    return Controller(
        law, np.array(kp), np.array(kd), feedforward=feedforward, velocity=velocity,
        observer_gain=np.array(machine.observer_gain) if velocity == "observer" or model is not None else None,
        output_limit=np.array(machine.torque_limit),
        torque_resolution=np.array(machine.torque_resolution) if machine.quantised_torque else None, delay=machine.delay,
        model=model.text if model is not None else None)


class _Following:
    """Feedback plus a torque known beforehand."""

    def __init__(self, feedback: Feedback, ahead: Array | None, extras: dict[str, Array]) -> None:
        self._feedback, self._ahead, self.extras = feedback, None if ahead is None else ahead.tolist(), extras

    def __call__(self, k: int, q: Floats, observer: Observer) -> Floats:
        back = self._feedback(k, q, observer)
        return back if self._ahead is None else [a + b for a, b in zip(self._ahead[k], back, strict=True)]


@dataclass(frozen=True)
class Decentralised:
    """A PD controller at each joint, eq. (23), with the machine's gains times `stiffness`."""

    velocity: str = "observer"
    stiffness: float = 1.0

    def describe(self, machine: Machine) -> Controller:
        return _describe(machine, "pd", *self._gains(machine), self.velocity)

    def start(self, machine: Machine, reference: Reference, sample_time: float) -> Step:
        kp, kd = self._gains(machine)
        return _Following(Feedback(list(kp), list(kd), self.velocity, reference, sample_time), None, {})

    def _gains(self, machine: Machine) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Softer by s in stiffness, by √s in damping: the damping ratio stays."""
        return (tuple(self.stiffness * k for k in machine.kp), tuple(self.stiffness**0.5 * k for k in machine.kd))


@dataclass(frozen=True, eq=False)
class OpenLoop:
    """Given torque on the open joints, the others held by PD. In the log the gains of an open joint are zero.

    `gravity` (n, 2) adds c sin q + c' cos q on the open joints, from the position as read: Section IV.B closes that
    loop around a joint that gravity pulls at. A log has no words for it, so that its law is then "unknown": replayed as
    if nothing had fed it back, such a torque lets the arm fall.
    """

    torque: Array  # (samples, n) [N m]
    open: tuple[bool, ...]
    gravity: Array | None = None  # (n, 2) [N m]
    velocity: str = "observer"

    def describe(self, machine: Machine) -> Controller:
        law = "open-loop" if self.gravity is None or not np.any(self.gravity) else "unknown"
        return _describe(machine, law, *self._gains(machine), self.velocity)

    def start(self, machine: Machine, reference: Reference, sample_time: float) -> Step:
        kp, kd = self._gains(machine)
        feedback = Feedback(list(kp), list(kd), self.velocity, reference, sample_time)
        given = np.where(self.open, self.torque, 0.0)
        return _OpenStep(feedback, given.tolist(), None if self.gravity is None else self._moving_gravity())

    def _gains(self, machine: Machine) -> tuple[tuple[float, ...], tuple[float, ...]]:
        return (tuple(0.0 if free else k for k, free in zip(machine.kp, self.open, strict=True)),
                tuple(0.0 if free else k for k, free in zip(machine.kd, self.open, strict=True)))

    def _moving_gravity(self) -> list[tuple[int, float, float]]:
        assert self.gravity is not None
        return [(j, *row) for j, (row, free) in enumerate(zip(self.gravity.tolist(), self.open, strict=True)) if free]


class _OpenStep:
    def __init__(self, feedback: Feedback, given: list[Floats], gravity: list[tuple[int, float, float]] | None) -> None:
        self._feedback, self._given, self._gravity = feedback, given, gravity or []
        self.extras: dict[str, Array] = {}

    def __call__(self, k: int, q: Floats, observer: Observer) -> Floats:
        tau = [a + b for a, b in zip(self._given[k], self._feedback(k, q, observer), strict=True)]
        for j, s, c in self._gravity:
            tau[j] += s * sin(q[j]) + c * cos(q[j])
        return tau


@dataclass(frozen=True, eq=False)
class FeedForward:
    """PD with any parts of a model ahead of it, eq. (24)."""

    model: ControllerModel
    parts: tuple[str, ...] = FEEDFORWARD
    velocity: str = "observer"
    stiffness: float = 1.0

    def describe(self, machine: Machine) -> Controller:
        kp, kd = Decentralised(self.velocity, self.stiffness)._gains(machine)
        return _describe(machine, "pd+feedforward", kp, kd, self.velocity, self.model, self.parts)

    def start(self, machine: Machine, reference: Reference, sample_time: float) -> Step:
        kp, kd = Decentralised(self.velocity, self.stiffness)._gains(machine)
        rows = zip(reference.q.tolist(), reference.dq.tolist(), reference.ddq.tolist(), strict=True)
        by_part = dict(zip(FEEDFORWARD, np.array([self.model.parts(*row) for row in rows]).transpose(1, 0, 2), strict=True))
        ahead = np.sum([by_part[part] for part in self.parts], axis=0) if self.parts else np.zeros_like(reference.q)
        extras = {"tau_feedforward": ahead}
        if "friction" in self.parts:
            extras["tau_friction"] = by_part["friction"]
        return _Following(Feedback(list(kp), list(kd), self.velocity, reference, sample_time), ahead, extras)


@dataclass(frozen=True, eq=False)
class ComputedTorque:
    """Feedback linearisation with an injected excitation, eq. (25)-(27)."""

    model: ControllerModel
    v: Array  # (samples, n) [rad/s^2]
    kp: tuple[float, ...]  # [1/s^2]
    kd: tuple[float, ...]  # [1/s]
    velocity: str = "backward-difference"

    def describe(self, machine: Machine) -> Controller:
        return _describe(machine, "computed-torque", self.kp, self.kd, self.velocity, self.model)

    def start(self, machine: Machine, reference: Reference, sample_time: float) -> Step:
        return _Linearising(self, reference, sample_time)


class _Linearising:
    def __init__(self, law: ComputedTorque, reference: Reference, sample_time: float) -> None:
        self._model, self._v = law.model, law.v.tolist()
        self._q_ref, self._dq_ref = reference.q.tolist(), reference.dq.tolist()
        self._feedback = Feedback(list(law.kp), list(law.kd), law.velocity, reference, sample_time)
        still = [0.0] * reference.n
        friction = np.array([law.model.parts(q, dq, still)[0] for q, dq in zip(self._q_ref, self._dq_ref, strict=True)])
        self._friction = friction.tolist()
        self._r = np.zeros_like(reference.q)
        self.extras = {"r": self._r, "v": law.v, "tau_friction": friction}

    def __call__(self, k: int, q: Floats, observer: Observer) -> Floats:
        r = [back + v for back, v in zip(self._feedback(k, q, observer), self._v[k], strict=True)]
        self._r[k] = r
        seen = [a + b for a, b in zip(self._q_ref[k], observer.e, strict=True)]
        speed = [a + b for a, b in zip(self._dq_ref[k], observer.de, strict=True)]
        _, inertia, coriolis, gravity = self._model.parts(seen, speed, r)
        return [a + b + c + d for a, b, c, d in zip(inertia, coriolis, gravity, self._friction[k], strict=True)]
