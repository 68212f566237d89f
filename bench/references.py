"""Motions worth recording, within a machine's limits of position, speed, acceleration and torque.

    fourier          periodic, broad band, from rest                         excitation
    sweeps           random speeds over two decades, many reversals          free
    reversals        one joint to and fro over small angles                  free, for backlash and presliding
    turning          one joint slowly round and back                         frf
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from bench.machine import SAMPLE_TIME, Machine
from bench.reference import Reference, at_rest, times
from bench.rigid import RigidDynamics
from pipelines.io.experiment import Array

__all__ = ["fourier", "home", "reversals", "sweeps", "turning", "within_torque"]

_CORNER_HZ = 0.6  # amplitudes of speed fall beyond it, or the acceleration limit would leave no speed


def home(machine: Machine) -> Array:
    """A posture (n,) in the middle of the ranges where gravity takes little torque."""
    low, high = np.array([joint.position for joint in machine.robot.joints]).T
    limited = np.isfinite(low) & np.isfinite(high)
    middle = np.where(limited, 0.5 * (np.where(limited, low, 0.0) + np.where(limited, high, 0.0)), 0.0)
    rigid, still = RigidDynamics(machine.robot), [0.0] * machine.n
    best, least = middle, math.inf
    for turn in np.random.default_rng(3).uniform(-1.5, 1.5, (200, machine.n)):
        q = np.where(limited, middle + 0.2 * (np.where(limited, high - low, 1.0)) * turn / 1.5, middle + turn)
        load = float(np.max(np.abs(rigid.parts(q.tolist(), still, still)[2]) / machine.torque_limit))
        if load < least:
            best, least = q, load
    return np.asarray(best)


def within_torque(machine: Machine, reference: Reference, centre: Array, part: float = 0.7) -> Reference:
    """The motion shrunk towards the posture `centre` (n,) until it needs at most `part` of every torque limit.

    Joints that need too much shrink by a tenth at a time, the others, which load them, by a hundredth.
    """
    rigid, limit = RigidDynamics(machine.robot), part * np.array(machine.torque_limit)
    laws = [law.law() for law in machine.friction]
    sparse = slice(None, None, max(1, reference.samples // 1500))
    while True:
        dq = reference.dq[sparse]
        friction = np.array([[law(v) for law, v in zip(laws, row, strict=True)] for row in dq.tolist()])
        needed = np.abs(rigid.torque(reference.q[sparse], dq, reference.ddq[sparse]) + friction).max(axis=0)
        if (needed <= limit).all() or np.abs(reference.dq).max() < 1e-3:
            return reference
        shrunk = np.where(needed > limit, 0.9, 0.99)
        reference = replace(reference, q=centre + shrunk * (reference.q - centre), dq=shrunk * reference.dq,
                            ddq=shrunk * reference.ddq)


def fourier(machine: Machine, rng: np.random.Generator, period: float = 10.0, periods: int = 2, centre: Array | None = None,
            part: float = 0.85, harmonics: int = 100) -> Reference:
    """Kostić et al. 2004, eq. (22): q = q0 + Σ_j (a_j sin w_j t - b_j cos w_j t)/w_j with w_j = 2πj/period.

    Random a and b under Σ a_j = 0 and Σ j b_j = 0: it starts with neither speed nor acceleration. Harmonics end at 10 Hz.
    """
    j = np.arange(1, min(harmonics, int(10.0 * period)) + 1)
    spectrum = 1.0 / (1.0 + (j / period / _CORNER_HZ) ** 2)
    a, b = rng.normal(size=(2, machine.n, len(j))) * spectrum
    # The least change, measured in units of the spectrum, that meets each condition.
    a -= np.outer(a.sum(axis=1) / np.sum(spectrum**2), spectrum**2)
    b -= np.outer(b @ j / np.sum((j * spectrum) ** 2), j * spectrum**2)
    w, t = 2.0 * math.pi * j / period, times(period)
    s, c = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    q, dq, ddq = s @ (a / w).T - c @ (b / w).T, c @ a.T + s @ b.T, -s @ (a * w).T + c @ (b * w).T
    scale = part * _room(machine, q, dq, ddq)
    centre = home(machine) if centre is None else centre
    middle = centre - 0.5 * scale * (q.max(axis=0) + q.min(axis=0))
    one = within_torque(machine, Reference(t, middle + scale * q, scale * dq, scale * ddq), centre)
    return Reference(times(period * periods), *(np.tile(x, (periods, 1)) for x in (one.q, one.dq, one.ddq)))


def _room(machine: Machine, q: Array, dq: Array, ddq: Array) -> Array:
    """By how much (n,) a motion may grow until it meets a limit of position, speed or acceleration."""
    joints = machine.robot.joints
    reach = np.array([min(joint.position[1] - joint.position[0], 2.0 * math.pi if joint.revolute else 0.4) for joint in joints])
    speed = np.array([min(joint.velocity, 3.0 * math.pi) for joint in joints])
    acceleration = np.array([min(joint.acceleration, 60.0) for joint in joints])
    room = reach / np.ptp(q, axis=0), speed / np.abs(dq).max(axis=0), acceleration / np.abs(ddq).max(axis=0)
    return np.asarray(np.min(room, axis=0))


def _through(t: Array, knots: list[tuple[float, float]]) -> tuple[Array, Array, Array]:
    """Position, speed and acceleration (samples,) through (time, position) knots, at rest at each.

        x = x0 + Δ (10 s³ - 15 s⁴ + 6 s⁵), s = (t - t0)/(t1 - t0)
    """
    at, x = np.array(knots).T
    k = np.clip(np.searchsorted(at, t, side="right") - 1, 0, len(at) - 2)
    span, step = np.diff(at)[k], np.diff(x)[k]
    s = np.clip((t - at[k]) / span, 0.0, 1.0)
    return (x[k] + step * s**3 * (10.0 - 15.0 * s + 6.0 * s**2), step * 30.0 * s**2 * (1.0 - s) ** 2 / span,
            step * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / span**2)


def _joined(t: Array, joints: list[tuple[Array, Array, Array]]) -> Reference:
    q, dq, ddq = (np.column_stack(part) for part in zip(*joints, strict=True))
    return Reference(t, q, dq, ddq)


def sweeps(machine: Machine, rng: np.random.Generator, duration: float = 20.0, centre: Array | None = None,
           fastest: float = 0.3) -> Reference:
    """Every joint to and fro between random positions, each move at a peak speed drawn from two decades.

    Args:
        fastest: largest speed, as a part of the limit.
    """
    t, start, joints = times(duration), home(machine) if centre is None else centre, []
    for q0, joint in zip(start, machine.robot.joints, strict=True):
        top = fastest * min(joint.velocity, 3.0 * math.pi)
        low, high = np.clip([q0 - 1.2, q0 + 1.2], *joint.position)
        knots, side = [(0.0, float(q0))], float(rng.choice([-1.0, 1.0]))
        while knots[-1][0] < duration:
            at, x = knots[-1]
            speed = top * 10.0 ** rng.uniform(-2.0, 0.0)
            span = float(rng.uniform(0.4, 2.0))
            goal = float(np.clip(x + side * speed * span / 1.875, low, high))  # a quintic's peak is 1.875 of its mean
            knots.append((at + span, goal))
            side = -side
        joints.append(_through(t, knots))
    return within_torque(machine, _joined(t, joints), start)


def reversals(machine: Machine, joint: int, posture: Array, duration: float = 10.0, amplitude: float = 0.05,
              stroke: float = 0.5) -> Reference:
    """Joint `joint` (1-based) to and fro by ± `amplitude` [rad], growing fourfold over the log; a stroke lasts `stroke` [s]."""
    reference = at_rest(posture, duration)
    count = math.ceil(duration / stroke)
    grown = amplitude * 4.0 ** (np.arange(count + 1) / max(count, 1))
    x = posture[joint - 1] + np.where(np.arange(count + 1) % 2, grown, -grown)
    x[0] = posture[joint - 1]
    moved = _through(reference.t, [(stroke * i, float(value)) for i, value in enumerate(x)])
    columns = (reference.q.copy(), reference.dq.copy(), reference.ddq.copy())
    for column, values in zip(columns, moved, strict=True):
        column[:, joint - 1] = values
    return Reference(reference.t, *columns)


def turning(machine: Machine, joint: int, posture: Array, duration: float = 20.0) -> Reference:
    """Joint `joint` (1-based) by 2π, or over its range, at constant speed and back, the others held: Section IV.D.

    Where the time is too short for that at a quarter of the largest speed, it turns less.
    """
    low, high = machine.robot.joints[joint - 1].position
    angle = min(2.0 * math.pi if machine.robot.joints[joint - 1].revolute else 0.4,
                0.1 * min(machine.robot.joints[joint - 1].velocity, 3.0 * math.pi) * duration)
    start = float(posture[joint - 1])
    if math.isfinite(low) and math.isfinite(high):
        start, angle = low + 0.05 * (high - low), min(angle, 0.9 * (high - low))
    reference = at_rest(np.where(np.arange(machine.n) == joint - 1, start, posture), duration)
    columns = (reference.q.copy(), reference.dq.copy(), reference.ddq.copy())
    for column, values in zip(columns, _there_and_back(len(reference.t), start, angle), strict=True):
        column[:, joint - 1] = values
    return Reference(reference.t, *columns)


def _there_and_back(samples: int, start: float, angle: float) -> tuple[Array, Array, Array]:
    """Speed up over a tenth of the way's time by a smooth step, constant, and down again; then the same backwards."""
    half = samples // 2
    s = np.arange(half) / half
    ramp = 0.1
    up, down = np.clip(s / ramp, 0.0, 1.0), np.clip((1.0 - s) / ramp, 0.0, 1.0)
    # Speed in units of the plateau: 3 u² - 2 u³ at each end; its integral over u is u³ - u⁴/2.
    speed = (3.0 * up**2 - 2.0 * up**3) * (3.0 * down**2 - 2.0 * down**3)
    slope = (6.0 * up * (1.0 - up) - 6.0 * down * (1.0 - down)) / ramp
    way = ramp * (up**3 - 0.5 * up**4) + np.clip(s - ramp, 0.0, 1.0 - 2.0 * ramp) + ramp * (0.5 - down**3 + 0.5 * down**4)
    span, total = half * SAMPLE_TIME, 1.0 - ramp
    q, dq, ddq = start + angle * way / total, angle * speed / (total * span), angle * slope / (total * span**2)
    rest = samples - 2 * half
    return (np.concatenate([q, 2.0 * start + angle - q, np.full(rest, start)]),
            np.concatenate([dq, -dq, np.zeros(rest)]), np.concatenate([ddq, -ddq, np.zeros(rest)]))
