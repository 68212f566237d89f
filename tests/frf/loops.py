"""Logs of a joint in a sampled loop, simulated by scipy.signal alone: any linear plant, any disturbance, computed torque or PD."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import cont2discrete, freqz, lfilter

from pipelines.io import schema
from pipelines.io.log import Array, Controller, ExperimentLog, Signal
from pipelines.io.robot import format_robot
from tests.bench.machines import turntable

__all__ = ["Loop", "T", "elastic", "rigid"]

T = 1e-3  # [s]


def rigid(inertia: float) -> tuple[Array, Array]:
    """1/(J s²) as numerator and denominator."""
    return np.array([1.0]), np.array([inertia, 0.0, 0.0])


def elastic(motor: float, link: float, stiffness: float, damping: float) -> tuple[Array, Array]:
    """Motor angle per motor torque of two masses and a spring."""
    denominator = np.polysub(np.polymul([motor, damping, stiffness], [link, damping, stiffness]),
                             np.polymul([damping, stiffness], [damping, stiffness]))
    denominator[-2:] = 0.0  # what is left there is rounding
    return np.array([link, damping, stiffness]), denominator


@dataclass(frozen=True, eq=False)
class Loop:
    """q = P (τ + d), τ = J r under computed torque; everything sampled with T and held."""

    plant: tuple[Array, Array]  # q per τ, continuous
    inertia: float = 1.0  # D̂ [kg m^2]
    kp: float = 400.0
    kd: float = 28.0
    law: str = "computed-torque"
    disturbance: float = 0.0  # [N m] rms, white
    strength: float = 5.0  # rms of v, [rad/s^2] or N m
    seconds: float = 40.0
    period: int | None = 2000  # [samples] of v; None: random
    encoder: float = 1e-6  # [rad]
    odd: bool = False  # v has odd lines alone, and not every one
    late: int = 0  # samples by which the measured position is late
    seed: int = 1

    def response(self, frequency: Array) -> Array:
        """The truth: q per input, complex."""
        numerator, denominator = self._sampled()
        return np.asarray(freqz(numerator, denominator, worN=2.0 * np.pi * frequency * T)[1])

    def _sampled(self) -> tuple[Array, Array]:
        """q per input in powers of z^-1."""
        scale = self.inertia if self.law == "computed-torque" else 1.0
        numerator, denominator, _ = cont2discrete((scale * self.plant[0], self.plant[1]), T, method="zoh")
        zeros = np.zeros(self.late)
        return np.concatenate([zeros, np.atleast_1d(np.squeeze(numerator))]), np.concatenate([np.asarray(denominator), zeros])

    def log(self, **changed: object) -> ExperimentLog:
        """What a recorder would have written."""
        rng = np.random.default_rng(self.seed)
        samples = round(self.seconds / T)
        v = self._excitation(rng, samples)
        scale = self.inertia if self.law == "computed-torque" else 1.0
        noise = self.disturbance * rng.standard_normal(samples) / scale
        b, a = self._sampled()
        c = np.array([self.kp + self.kd / T, -self.kd / T])
        closed = np.polyadd(np.concatenate([a, [0.0]]), np.polymul(b, c))
        e = lfilter(np.concatenate([b, [0.0]]), closed, v + noise)
        read = np.rint(e / self.encoder) * self.encoder
        u = v - lfilter(c, [1.0], e)
        q_ref, dq_ref, ddq_ref = _turn(samples)
        values = {"t": np.arange(samples) * T, "q": q_ref + read, "tau": scale * u, "v": v, "q_ref": q_ref, "dq_ref": dq_ref,
                  "ddq_ref": ddq_ref} | ({"r": u} if self.law == "computed-torque" else {})
        signals = {name: Signal(x if name == "t" else x[:, None], schema.unit_of(name, self.law), schema.SIGNALS[name][1])
                   for name, x in values.items()}
        robot = turntable().described
        about: dict[str, object] = {
            "name": "turned", "experiment": "frf", "role": "identify", "origin": "simulated", "robot_name": robot.name,
            "sample_time": T, "robot_text": format_robot(robot), "signals": signals, "joint": 1, "posture": np.zeros(1),
            "controller": Controller(self.law, np.array([self.kp]), np.array([self.kd]), velocity="backward-difference", delay=0)}
        return ExperimentLog(**(about | changed))  # type: ignore[arg-type]

    def _excitation(self, rng: np.random.Generator, samples: int) -> Array:
        if self.period is None:
            return np.asarray(self.strength * rng.standard_normal(samples))
        spectrum = np.zeros(self.period // 2 + 1, dtype=np.complex128)
        lines = np.arange(2, int(0.25 * self.period))
        if self.odd:
            lines = lines[(lines % 2 == 1) & (lines % 5 != 0)]
        spectrum[lines] = np.exp(2j * np.pi * rng.random(len(lines)))
        one = np.fft.irfft(spectrum, self.period)
        return np.resize(self.strength * one / one.std(), samples)


def _turn(samples: int) -> tuple[Array, Array, Array]:
    """There and back at 0.3 rad/s, with half a second to change."""
    t = np.arange(samples) * T
    half = 0.5 * samples * T
    speed = 0.3 * np.clip(t / 0.5, 0.0, 1.0) * np.clip((half - t) / 0.5, -1.0, 1.0) * np.clip((samples * T - t) / 0.5, 0.0, 1.0)
    return np.cumsum(speed) * T, speed, np.gradient(speed, T)
