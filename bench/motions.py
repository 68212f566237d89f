"""Motions worth recording within a machine's limits, and what is injected rather than followed.

fourier              periodic, broad band, from rest                         excitation sweeps
random speeds over two decades, many reversals          free reversals            one joint to and
fro over small angles                  free, for backlash and presliding turning              one
joint slowly round and back                         frf friction_torque      open-loop torque that
passes speeds of two decades      friction multisine            persistent excitation
frf
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bench.config import CONFIG, SAMPLE_TIME
from bench.dynamics import RigidDynamics
from bench.machine import Machine
from pipelines.io.log import Array, ExperimentLog


@dataclass(frozen=True, eq=False)
class Reference:
    """A motion with its exact derivatives. The machine starts at rest at its first sample."""

    t: Array  # (samples,) [s]
    q: Array  # (samples, n) [rad]
    dq: Array  # (samples, n) [rad/s]
    ddq: Array  # (samples, n) [rad/s^2]

    @classmethod
    def of_log(cls, log: ExperimentLog) -> Reference:
        """Return the reference of a log, also of a planned one; KeyError where it has none."""
        return cls(log.t - log.t[0], log["q_ref"], log["dq_ref"], log["ddq_ref"])

    @property
    def samples(self) -> int:
        """Number of samples."""
        return len(self.t)


def times(duration: float) -> Array:
    """Return 0, T, 2 T, … (samples,) below `duration` [s]."""
    return np.arange(round(duration / SAMPLE_TIME), dtype=np.float64) * SAMPLE_TIME


def at_rest(posture: Array, duration: float) -> Reference:
    """Return no motion at `posture` (n,) for `duration` [s]."""
    t = times(duration)
    still = np.zeros((len(t), len(posture)))
    return Reference(t, still + posture, still, still)


def home(machine: Machine) -> Array:
    """Return a posture (n,) in the middle of the ranges where gravity takes little torque."""
    low, high = np.array([joint.position for joint in machine.robot.joints]).T
    limited = np.isfinite(low) & np.isfinite(high)
    middle = np.where(
        limited, 0.5 * (np.where(limited, low, 0.0) + np.where(limited, high, 0.0)), 0.0
    )
    rigid = RigidDynamics(machine.robot)
    best, least = middle, math.inf
    for turn in np.random.default_rng(3).uniform(-1.5, 1.5, (200, machine.n)):
        inside = middle + 0.2 * (np.where(limited, high - low, 1.0)) * turn / 1.5
        q = np.where(limited, inside, middle + turn)
        load = float(np.max(np.abs(rigid.gravity(q)) / machine.torque_limit))
        if load < least:
            best, least = q, load
    return np.asarray(best)


def within_torque(
    machine: Machine, reference: Reference, centre: Array, part: float = 0.7
) -> Reference:
    """Shrink a motion towards the posture `centre` (n,) until it needs `part` of each torque limit.

    Joints that need too much shrink by a tenth at a time, the others, which load them, by a
    hundredth.
    """
    rigid, limit = RigidDynamics(machine.robot), part * np.array(machine.torque_limit)
    laws = [law.law() for law in machine.friction]
    sparse = slice(None, None, max(1, reference.samples // 1500))
    while True:
        dq = reference.dq[sparse]
        rows = dq.tolist()
        friction = np.array([[law(v) for law, v in zip(laws, row, strict=True)] for row in rows])
        torque = rigid.torque(reference.q[sparse], dq, reference.ddq[sparse])
        needed = np.abs(torque + friction).max(axis=0)
        if (needed <= limit).all() or np.abs(reference.dq).max() < CONFIG.slowest_motion:
            return reference
        shrunk = np.where(needed > limit, 0.9, 0.99)
        q = centre + shrunk * (reference.q - centre)
        reference = Reference(reference.t, q, shrunk * reference.dq, shrunk * reference.ddq)


def fourier(
    machine: Machine, rng: np.random.Generator, period: float = 10.0, periods: int = 2
) -> Reference:
    """Draw a periodic motion from rest, Kostić et al. 2004, eq. (22), of `period` [s].

        q = q0 + Σ_j (a_j sin w_j t - b_j cos w_j t)/w_j, w_j = 2πj/period

    Random a and b under Σ a_j = 0 and Σ j b_j = 0: it starts with neither speed nor acceleration.
    The harmonics end at 10 Hz, at most 100 of them.
    """
    j = np.arange(1, min(100, int(10.0 * period)) + 1)
    spectrum = 1.0 / (1.0 + (j / period / CONFIG.corner_hz) ** 2)
    a, b = rng.normal(size=(2, machine.n, len(j))) * spectrum
    # The least change, measured in units of the spectrum, that meets each condition.
    a -= np.outer(a.sum(axis=1) / np.sum(spectrum**2), spectrum**2)
    b -= np.outer(b @ j / np.sum((j * spectrum) ** 2), j * spectrum**2)
    w, t = 2.0 * math.pi * j / period, times(period)
    s, c = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    q, dq, ddq = s @ (a / w).T - c @ (b / w).T, c @ a.T + s @ b.T, -s @ (a * w).T + c @ (b * w).T
    scale = 0.85 * _room(machine, q, dq, ddq)
    centre = home(machine)
    middle = centre - 0.5 * scale * (q.max(axis=0) + q.min(axis=0))
    whole = Reference(t, middle + scale * q, scale * dq, scale * ddq)
    one = within_torque(machine, whole, centre)
    repeated = (np.tile(x, (periods, 1)) for x in (one.q, one.dq, one.ddq))
    return Reference(times(period * periods), *repeated)


def _room(machine: Machine, q: Array, dq: Array, ddq: Array) -> Array:
    """Return by how much (n,) a motion may grow within position, speed and acceleration."""
    joints = machine.robot.joints
    widest = [2.0 * math.pi if joint.revolute else 0.4 for joint in joints]
    reach = np.array([np.ptp(joint.position) for joint in joints])
    speed = np.array([min(joint.velocity, CONFIG.fastest_turn) for joint in joints])
    acceleration = np.array([min(joint.acceleration, 60.0) for joint in joints])
    room = (
        np.minimum(reach, widest) / np.ptp(q, axis=0),
        speed / np.abs(dq).max(axis=0),
        acceleration / np.abs(ddq).max(axis=0),
    )
    return np.asarray(np.min(room, axis=0))


def _through(t: Array, knots: list[tuple[float, float]]) -> tuple[Array, Array, Array]:
    """Return q, dq and ddq (samples,) through (time, position) knots, at rest at each:

    x = x0 + Δ (10 s³ - 15 s⁴ + 6 s⁵), s = (t - t0)/(t1 - t0)
    """
    at, x = np.array(knots).T
    k = np.clip(np.searchsorted(at, t, side="right") - 1, 0, len(at) - 2)
    span, step = np.diff(at)[k], np.diff(x)[k]
    s = np.clip((t - at[k]) / span, 0.0, 1.0)
    return (
        x[k] + step * s**3 * (10.0 - 15.0 * s + 6.0 * s**2),
        step * 30.0 * s**2 * (1.0 - s) ** 2 / span,
        step * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / span**2,
    )


def _one_moving(
    joint: int, posture: Array, duration: float, moved: tuple[Array, Array, Array]
) -> Reference:
    """Return a motion of joint `joint` (1-based) alone, the others held at `posture` (n,)."""
    still = at_rest(posture, duration)
    q, dq, ddq = still.q.copy(), still.dq.copy(), still.ddq.copy()
    q[:, joint - 1], dq[:, joint - 1], ddq[:, joint - 1] = moved
    return Reference(still.t, q, dq, ddq)


def sweeps(machine: Machine, rng: np.random.Generator, duration: float = 20.0) -> Reference:
    """Draw moves of every joint to and fro, at peak speeds up to 30 % of its limit."""
    t, start, joints = times(duration), home(machine), []
    for q0, joint in zip(start, machine.robot.joints, strict=True):
        top = 0.3 * min(joint.velocity, CONFIG.fastest_turn)
        low, high = np.clip([q0 - 1.2, q0 + 1.2], *joint.position)
        knots, side = [(0.0, float(q0))], float(rng.choice([-1.0, 1.0]))
        while knots[-1][0] < duration:
            at, x = knots[-1]
            speed = top * 10.0 ** rng.uniform(-2.0, 0.0)
            span = float(rng.uniform(0.4, 2.0))
            # A quintic's peak is 1.875 of its mean.
            knots.append((at + span, float(np.clip(x + side * speed * span / 1.875, low, high))))
            side = -side
        joints.append(_through(t, knots))
    q, dq, ddq = (np.column_stack(part) for part in zip(*joints, strict=True))
    return within_torque(machine, Reference(t, q, dq, ddq), start)


def reversals(joint: int, posture: Array, duration: float = 10.0) -> Reference:
    """Return joint `joint` (1-based) to and fro every 0.5 s by ± 0.05 rad, growing fourfold."""
    count = math.ceil(duration / 0.5)
    grown = 0.05 * 4.0 ** (np.arange(count + 1) / max(count, 1))
    x = posture[joint - 1] + np.where(np.arange(count + 1) % 2, grown, -grown)
    x[0] = posture[joint - 1]
    knots = [(0.5 * i, float(value)) for i, value in enumerate(x)]
    return _one_moving(joint, posture, duration, _through(times(duration), knots))


def turning(machine: Machine, joint: int, posture: Array, duration: float = 20.0) -> Reference:
    """Return joint `joint` (1-based) at constant speed by 2π, or over its range, and back.

    The others are held: Section IV.D.

    Where the time is too short for that at a quarter of the largest speed, it turns less.
    """
    moving = machine.robot.joints[joint - 1]
    low, high = moving.position
    angle = 0.1 * min(moving.velocity, CONFIG.fastest_turn) * duration
    angle = min(2.0 * math.pi if moving.revolute else 0.4, angle)
    start = float(posture[joint - 1])
    if math.isfinite(low) and math.isfinite(high):
        start, angle = low + 0.05 * (high - low), min(angle, 0.9 * (high - low))
    moved = _there_and_back(len(times(duration)), start, angle)
    return _one_moving(joint, posture, duration, moved)


def _there_and_back(samples: int, start: float, angle: float) -> tuple[Array, Array, Array]:
    """Return q, dq and ddq (samples,) there and back, a tenth of the time to speed up and down."""
    half = samples // 2
    s = np.arange(half) / half
    ramp = 0.1
    up, down = np.clip(s / ramp, 0.0, 1.0), np.clip((1.0 - s) / ramp, 0.0, 1.0)
    # Speed in units of the plateau: 3 u² - 2 u³ at each end; its integral over u is u³ - u⁴/2.
    speed = (3.0 * up**2 - 2.0 * up**3) * (3.0 * down**2 - 2.0 * down**3)
    slope = (6.0 * up * (1.0 - up) - 6.0 * down * (1.0 - down)) / ramp
    plateau = np.clip(s - ramp, 0.0, 1.0 - 2.0 * ramp)
    way = ramp * (up**3 - 0.5 * up**4) + plateau + ramp * (0.5 - down**3 + 0.5 * down**4)
    span, total = half * SAMPLE_TIME, 1.0 - ramp
    q = start + angle * way / total
    dq = angle * speed / (total * span)
    ddq = angle * slope / (total * span**2)
    rest = np.zeros(samples - 2 * half)
    return (
        np.concatenate([q, 2.0 * start + angle - q, rest + start]),
        np.concatenate([dq, -dq, rest]),
        np.concatenate([ddq, -ddq, rest]),
    )


def gravity_of(machine: Machine, joint: int, posture: Array) -> Array:
    """Return c and c' (2,) of h = c sin q + c' cos q at a joint (1-based); a slide: (0, h)."""
    rigid = RigidDynamics(machine.robot)

    def h(q: float) -> float:
        return rigid.gravity(np.where(np.arange(machine.n) == joint - 1, q, posture))[joint - 1]

    if not machine.robot.joints[joint - 1].revolute:
        return np.array([0.0, h(float(posture[joint - 1]))])
    return np.array([0.5 * (h(0.5 * math.pi) - h(-0.5 * math.pi)), 0.5 * (h(0.0) - h(math.pi))])


def friction_torque(
    machine: Machine, joint: int, posture: Array, rng: np.random.Generator, duration: float = 20.0
) -> Array:
    """Draw open-loop torque (samples,) [N m] for one joint (1-based), gravity not included.

    Slow ramps break it away to both sides, then come eight plateaus of speed over two decades, each
    both ways. A plan of speeds v(t) is turned into J dv/dt + τ_f(v) with what an experimenter would
    know of inertia and friction, within ±10 %; the joint then runs as fast as its true friction
    lets it.
    """
    guess = machine.friction[joint - 1].drawn(rng, 0.10)
    mass = RigidDynamics(machine.robot).mass_matrix(posture)
    inertia = mass[joint - 1, joint - 1] * rng.uniform(0.9, 1.1)
    top = 0.5 * min(machine.robot.joints[joint - 1].velocity, CONFIG.fastest_turn)
    t = times(duration)
    ramp_time = 0.15 * duration
    speeds = top * 10.0 ** np.repeat(np.linspace(-2.0, 0.0, 8), 2) * np.tile([1.0, -1.0], 8)
    at = np.linspace(ramp_time, duration, len(speeds) + 1)
    edge = 0.2 * (at[1] - at[0])
    # Each plateau is left for the next along a straight line of `edge` seconds.
    ends = np.ravel(np.column_stack([at[:-1] + edge, at[1:]]))
    knots = np.concatenate([[0.0, ramp_time], ends])
    v = np.interp(t, knots, np.concatenate([[0.0, 0.0], np.repeat(speeds, 2)]))
    law = guess.law()
    torque = inertia * np.gradient(v, SAMPLE_TIME) + np.array([law(x) for x in v.tolist()])
    ramps = np.interp(
        t, ramp_time * np.array([0.0, 0.3, 0.5, 0.8, 1.0]), [0.0, 1.0, 0.0, -1.0, 0.0]
    )
    breakaway = 1.15 * guess.coulomb * ramps
    limit = 0.9 * machine.torque_limit[joint - 1] - np.hypot(*gravity_of(machine, joint, posture))
    return np.asarray(np.clip(np.where(t < ramp_time, breakaway, torque), -limit, limit))


def multisine(rng: np.random.Generator, samples: int, rms: float) -> Array:
    """Draw equal sines (samples,) of random phase at every quarter of a hertz of 0.5 to 250 Hz."""
    lines = np.arange(2, 1001)
    length = round(4.0 / SAMPLE_TIME)
    spectrum = np.zeros(length // 2 + 1, dtype=np.complex128)
    spectrum[lines] = np.exp(2j * math.pi * rng.random(len(lines)))
    one = np.fft.irfft(spectrum, length)
    return np.asarray(np.resize(rms * one / one.std(), samples))
