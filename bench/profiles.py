"""What is injected rather than followed: torque profiles for friction, and persistent excitation for FRFs."""

from __future__ import annotations

import math

import numpy as np

from bench.machine import SAMPLE_TIME, Machine
from bench.reference import times
from bench.rigid import RigidDynamics
from pipelines.io.experiment import Array

__all__ = ["friction_torque", "gravity_of", "multisine", "random_steps"]


def gravity_of(machine: Machine, joint: int, posture: Array) -> Array:
    """c and c' (2,) of h = c sin q + c' cos q at joint `joint` (1-based), the others in `posture`; prismatic: (0, h)."""
    rigid, still = RigidDynamics(machine.robot), [0.0] * machine.n

    def h(q: float) -> float:
        return rigid.parts(np.where(np.arange(machine.n) == joint - 1, q, posture).tolist(), still, still)[2][joint - 1]

    if not machine.robot.joints[joint - 1].revolute:
        return np.array([0.0, h(float(posture[joint - 1]))])
    return np.array([0.5 * (h(0.5 * math.pi) - h(-0.5 * math.pi)), 0.5 * (h(0.0) - h(math.pi))])


def friction_torque(machine: Machine, joint: int, posture: Array, rng: np.random.Generator, duration: float = 20.0,
                    levels: int = 8) -> Array:
    """Open-loop torque (samples,) [N m] for one joint (1-based): slow ramps that break it away to both sides, then plateaus
    of speed over two decades, each both ways, gravity apart.

    A plan of speeds v(t) is turned into J dv/dt + τ_f(v) with what an experimenter would know of inertia and friction,
    within ±10 %; the joint then runs as fast as its true friction lets it.
    """
    guess = machine.friction[joint - 1].drawn(rng, 0.10)
    inertia = RigidDynamics(machine.robot).mass_matrix(posture)[joint - 1, joint - 1] * rng.uniform(0.9, 1.1)
    top = 0.5 * min(machine.robot.joints[joint - 1].velocity, 3.0 * math.pi)
    t = times(duration)
    ramp_time = 0.15 * duration
    speeds = top * 10.0 ** np.repeat(np.linspace(-2.0, 0.0, levels), 2) * np.tile([1.0, -1.0], levels)
    at = np.linspace(ramp_time, duration, len(speeds) + 1)
    edge = 0.2 * (at[1] - at[0])
    # Each plateau is left for the next along a straight line of `edge` seconds.
    knots_t = np.concatenate([[0.0, ramp_time], np.ravel(np.column_stack([at[:-1] + edge, at[1:]]))])
    v = np.interp(t, knots_t, np.concatenate([[0.0, 0.0], np.repeat(speeds, 2)]))
    law = guess.law()
    torque = inertia * np.gradient(v, SAMPLE_TIME) + np.array([law(x) for x in v.tolist()])
    breakaway = 1.15 * guess.coulomb * np.interp(t, ramp_time * np.array([0.0, 0.3, 0.5, 0.8, 1.0]), [0.0, 1.0, 0.0, -1.0, 0.0])
    limit = 0.9 * machine.torque_limit[joint - 1] - np.hypot(*gravity_of(machine, joint, posture))
    return np.asarray(np.clip(np.where(t < ramp_time, breakaway, torque), -limit, limit))


def multisine(rng: np.random.Generator, samples: int, rms: float, band_hz: tuple[float, float] = (0.5, 250.0),
              period: float = 4.0) -> Array:
    """Periodic sum (samples,) of equal sines of random phase at every multiple of 1/period in the band."""
    lines = np.arange(math.ceil(band_hz[0] * period), math.floor(band_hz[1] * period) + 1)
    length = round(period / SAMPLE_TIME)
    spectrum = np.zeros(length // 2 + 1, dtype=np.complex128)
    spectrum[lines] = np.exp(2j * math.pi * rng.random(len(lines)))
    one = np.fft.irfft(spectrum, length)
    return np.asarray(np.resize(rms * one / one.std(), samples))


def random_steps(rng: np.random.Generator, samples: int, rms: float) -> Array:
    """A random number each sample (samples,), as Section IV.D proposes."""
    return rms * rng.standard_normal(samples)
