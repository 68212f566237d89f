"""Faults of the drive: what becomes of a commanded torque on its way to the joint."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, pi, sin, sqrt
from typing import ClassVar, Self

from bench.config import SAMPLE_TIME
from bench.filters import first_order_lag
from bench.machine import Case, Fault, Floats, Hooks, JointLoad, Parameters, Run, listed


@dataclass(frozen=True)
class Cogging(JointLoad):
    """Magnets that pull the rotor into slots: τ = A (sin(k q + φ) + 0.35 sin(2 k q + φ2))."""

    order: float  # [1/rev] k of the joint
    amplitude: float  # [N m] A
    phase: float  # [rad] φ
    second_phase: float  # [rad] φ2
    second: float = 0.35  # share of the second harmonic

    name = "cogging"
    scales = ("amplitude",)

    @classmethod
    def full(cls, case: Case) -> Self:
        order = case.order(8, 37)
        return cls(case.joint, order, 0.4 * case.torque, case.phase(), case.phase())

    def parameters(self) -> Parameters:
        """Return both harmonics."""
        return {
            "order": self.order,
            "amplitude": self.amplitude,
            "phase": self.phase,
            "order_2": 2.0 * self.order,
            "amplitude_2": self.second * self.amplitude,
            "phase_2": self.second_phase,
        }

    def torque(self, t: float, q: float, v: float) -> float:
        turn, second = self.order * q, self.second * self.amplitude
        return self.amplitude * sin(turn + self.phase) + second * sin(
            2.0 * turn + self.second_phase
        )


@dataclass(frozen=True)
class DriveLag(Fault):
    """A motor whose torque follows its command like a first-order filter: T dτ/dt = u - τ.

    Each inner step gets the mean of τ over it, which is exact for the command held over a sample.
    """

    time_constant: float  # [s] T

    name = "drive_lag"
    scales = reported = ("time_constant",)

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 5e-3)

    def start(self, run: Run) -> Hooks:
        j, lag = self.index, first_order_lag(self.time_constant, run.inner_step)

        def drive(t: float, torque: Floats, q: Floats) -> None:
            torque[j] = lag(torque[j])

        return Hooks(drive=drive)


@dataclass(frozen=True)
class HuntingDrive(Fault):
    """A current loop that oscillates by itself, faster under load: the motor gets u + A sin θ.

    dθ/dt = 2π f (1 + 0.3 u/u_max)
    """

    amplitude: float  # [N m] A
    frequency: float  # [Hz] f, without torque

    name = "hunting_drive"
    known = False
    scales = ("amplitude",)
    reported = ("amplitude", "frequency")
    pull: ClassVar[float] = 0.3  # of the rate, at the torque limit

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 0.4 * case.torque, float(case.rng.uniform(4.0, 7.0)))

    def start(self, run: Run) -> Hooks:
        j, a, turn = self.index, self.amplitude, 2.0 * pi * self.frequency * run.inner_step
        pull, angle = self.pull / run.machine.torque_limit[self.index], 0.0

        def drive(t: float, torque: Floats, q: Floats) -> None:
            nonlocal angle
            angle += turn * (1.0 + pull * torque[j])
            torque[j] += a * sin(angle)

        return Hooks(drive=drive)


@dataclass(frozen=True)
class TorqueCrosstalk(Fault):
    """A current that takes from another axis: the motor of joint j gets u_j - c u_i."""

    coefficient: float  # [1] c
    from_joint: int  # i, 1-based

    name = "torque_crosstalk"
    scales = ("coefficient",)
    reported = ("coefficient", "from_joint")

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 0.1 * case.sign(), case.neighbour)

    def start(self, run: Run) -> Hooks:
        j, i, c = self.index, self.from_joint - 1, self.coefficient

        def drive(t: float, torque: Floats, q: Floats) -> None:
            torque[j] -= c * torque[i]

        return Hooks(drive=drive)


@dataclass(frozen=True)
class TorqueGain(Fault):
    """A motor that gets (1 + ε) u, the amplifier's noise with it."""

    gain_error: float  # [1] ε

    name = "torque_gain"
    scales = reported = ("gain_error",)

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 0.1 * case.sign())

    def start(self, run: Run) -> Hooks:
        j, gain = self.index, 1.0 + self.gain_error

        def drive(t: float, torque: Floats, q: Floats) -> None:
            torque[j] *= gain

        return Hooks(drive=drive)


@dataclass(frozen=True)
class TorqueOffset(Fault):
    """An amplifier whose zero is off: the motor gets u - τ0, the controller gives τ0 more."""

    offset: float  # [N m] τ0

    name = "torque_offset"
    scales = reported = ("offset",)

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, case.sign() * 0.4 * case.torque)

    def start(self, run: Run) -> Hooks:
        j, offset = self.index, self.offset

        def drive(t: float, torque: Floats, q: Floats) -> None:
            torque[j] -= offset

        return Hooks(drive=drive)


@dataclass(frozen=True)
class TorqueSaturation(Fault):
    """A drive that gives min(max(u, -L), L), of which the log does not know."""

    strength: float  # [1]
    peak: float  # [N m] the most that the healthy machine asks for

    name = "torque_saturation"
    scales = ("strength",)
    reported = ("limit",)

    @property
    def limit(self) -> float:
        """[N m] L: a share of the peak, the peak itself at no strength."""
        return self.peak * listed(self.strength, 1.0, 0.82, 0.70, 0.55)

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 1.0, case.peak_torque[case.index])

    def start(self, run: Run) -> Hooks:
        j, limit = self.index, self.limit

        def drive(t: float, torque: Floats, q: Floats) -> None:
            torque[j] = min(max(torque[j], -limit), limit)

        return Hooks(drive=drive)


@dataclass(frozen=True)
class GainRipple(Fault):
    """A torque constant that varies with the angle, as healthy ones do: (1 + r sin(k q + φ)) u."""

    ripple: float  # [1] r
    order: float  # [1/rev] k
    phase: float  # [rad] φ

    name = "gain_ripple"
    known = False
    scales = ("ripple",)
    reported = ("ripple", "order", "phase")

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 1e-3, case.order(8, 37), case.phase())

    def start(self, run: Run) -> Hooks:
        j, dof, r, k, phase = self.index, run.dofs[self.index], self.ripple, self.order, self.phase

        def drive(t: float, torque: Floats, q: Floats) -> None:
            torque[j] *= 1.0 + r * sin(k * q[dof] + phase)

        return Hooks(drive=drive)


@dataclass(frozen=True)
class ColouredNoise(Fault):
    """A slow wander of a healthy amplifier's zero: white noise through a first-order low-pass.

    It is stationary from the start.
    """

    rms: float  # [N m]
    corner_hz: float

    name = "coloured_noise"
    known = False
    scales = ("rms",)
    reported = ("rms", "corner_hz")

    @classmethod
    def full(cls, case: Case) -> Self:
        return cls(case.joint, 0.5 * case.machine.amplifier_noise[case.index], 3.0)

    def start(self, run: Run) -> Hooks:
        j, substeps = self.index, run.substeps
        kept = exp(-2.0 * pi * self.corner_hz * SAMPLE_TIME)
        new = sqrt(1.0 - kept**2)
        steps = (new * self.rms * run.rng.standard_normal(run.samples + 1)).tolist()
        value, count = steps[0] / new, 0

        def drive(t: float, torque: Floats, q: Floats) -> None:
            nonlocal value, count
            if count % substeps == 0 and count:
                value = kept * value + steps[count // substeps]
            count += 1
            torque[j] += value

        return Hooks(drive=drive)
