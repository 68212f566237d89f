"""Faults of what is read and written down: encoders and the record of the torque."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import atan2, cos, sin
from typing import Self

from bench.config import SAMPLE_TIME
from bench.filters import first_order_lag
from bench.machine import Case, Fault, Floats, Hooks, Run


@dataclass(frozen=True)
class EncoderCrosstalk(Fault):
    """A reading that moves with another joint, in loop and log: q_j as read = q_j + c q_i.

    q_i is the true one. The arm has settled where it reads its first reference.
    """

    coefficient: float  # [1] c
    from_joint: int  # i, 1-based

    name = "encoder_crosstalk"
    scales = ("coefficient",)
    reported = ("coefficient", "from_joint")

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 0.015 * case.sign(), case.neighbour)

    def start(self, run: Run) -> Hooks:
        j, c, other, position = (
            self.index,
            self.coefficient,
            run.dofs[self.from_joint - 1],
            run.data.qpos,
        )
        position[run.dofs[j]] -= c * position[other]

        def sense(t: float, measured: Floats) -> None:
            measured[j] += c * float(position[other])

        return Hooks(sense=sense)


@dataclass(frozen=True)
class EncoderEccentricity(Fault):
    """A disc that sits off its axis by e, in units of its radius, in the loop as in the log:

        q_measured = q + atan2(e sin(q + φ), 1 + e cos(q + φ)) ≈ q + e sin(q + φ)

    The arm has settled where it reads its first reference. Of a slide, a wheel that rolls along it
    turns the disc.
    """

    amplitude: float  # [rad] e
    phase: float  # [rad] φ
    unit: float = 1.0  # [rad], or the [m] by which the wheel rolls for each

    name = "encoder_eccentricity"
    scales = ("amplitude",)
    reported = ("amplitude", "phase")

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 4e-3 * case.angle, case.phase(), case.angle)

    def start(self, run: Run) -> Hooks:
        j, e, phase, unit = self.index, self.amplitude / self.unit, self.phase, self.unit

        def error(q: float) -> float:
            turn = q / unit + phase
            return unit * atan2(e * sin(turn), 1.0 + e * cos(turn))

        def sense(t: float, measured: Floats) -> None:
            measured[j] += error(measured[j])

        position, dof = run.data.qpos, run.dofs[j]
        wanted = settled = float(position[dof])
        for _ in range(8):  # each iteration leaves e times the error before
            settled = wanted - error(settled)
        position[dof] = settled

        return Hooks(sense=sense)


@dataclass(frozen=True)
class TimeDelay(Fault):
    """A position older than its time stamp, in loop and log: q as read(t) = q(t - delay).

    True states are kept at every inner step; between two a cubic joins speeds too.
    """

    delay: float  # [s]

    name = "time_delay"
    scales = reported = ("delay",)

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 5e-3)

    def start(self, run: Run) -> Hooks:
        j, dof, h = self.index, run.dofs[self.index], run.inner_step
        whole, part = divmod(self.delay / h, 1.0)
        newer = -1 - int(whole)
        x = 1.0 - part  # of the inner step, from its older end
        kept = deque([(float(run.data.qpos[dof]), 0.0)] * (2 - newer), maxlen=2 - newer)

        def step(t: float, q: Floats, v: Floats) -> None:
            kept.append((q[dof], v[dof]))

        def sense(t: float, measured: Floats) -> None:
            (q0, v0), (q1, v1) = kept[newer - 1], kept[newer]
            old = (
                (1.0 + 2.0 * x) * (1.0 - x) ** 2 * q0
                + x * (1.0 - x) ** 2 * h * v0
                + x**2 * (3.0 - 2.0 * x) * q1
                - x**2 * (1.0 - x) * h * v1
            )
            measured[j] += old - kept[-1][0]

        return Hooks(step=step, sense=sense)


@dataclass(frozen=True)
class TorqueLag(Fault):
    """A prompt drive whose logged torque went through a low-pass: T dy/dt = τ - y.

    Logged is the mean of y over the sample in which τ is held, so that T -> 0 is the command
    itself.
    """

    time_constant: float  # [s] T

    name = "torque_lag"
    scales = reported = ("time_constant",)

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 5e-3)

    def start(self, run: Run) -> Hooks:
        j, lag = self.index, first_order_lag(self.time_constant, SAMPLE_TIME)

        def write(t: float, tau: Floats) -> None:
            tau[j] = lag(tau[j])

        return Hooks(write=write)
