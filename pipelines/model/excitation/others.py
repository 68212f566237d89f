"""Plans of the other experiments of the workflow: friction, frequency responses, static postures.

    friction    one joint at speeds over two decades, both directions, each held as long as its range allows
    frf         one joint turning slowly there and back, with an odd random-phase multisine to excite what bends, twice
    hold        static postures that together tell most about gravity
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pipelines.errors import UsageError
from pipelines.model.excitation.multisine import odd_lines, realisation
from pipelines.model.excitation.task import Task
from pipelines.model.excitation.tip import tip_motion
from pipelines.model.excitation.trajectory import quintic
from pipelines.model.excitation.verify import Peak, peaks, worst
from pipelines.model.rigid.body import Array

__all__ = ["Plan", "frf_plans", "friction_plans", "hold_plans"]

_LEVELS = 9  # speeds over two decades
_SHARE = 0.8  # of the speed limit
_ACCELERATION = 0.4  # of the acceleration that limits allow
_HELD = (0.15, 3.0)  # [s] a speed is held: shorter says nothing, longer nothing new
_USED_RANGE = 0.8  # of the position range
_FREE = 4.0 * np.pi  # [rad] range of a joint that turns freely
_PEAK = 1.5  # of 3 s² - 2 s³, times its mean slope
_SLOW = 0.05  # of the speed limit: the turn of an frf experiment
_FRF_TORQUE = 0.1  # of the torque limit, rms of the excitation
_FRF_PERIOD = 8.0  # [s] odd lines then lie a quarter of a hertz apart
_FRF_PERIODS = 2  # each way at least, to tell noise
_FRF_SETTLE = 1.0  # [s] before them, in which the loop settles
_REALISATIONS = 2  # of other phases, to tell nonlinear distortion from noise
_FRF_BAND = (1.0, 0.4)  # [Hz] lowest line; highest, of the sample rate
_POSTURES, _CANDIDATES, _DWELL = 8, 400, 2.0
_SMALLER, _SMALLEST = 0.8, 0.05  # a plan that breaks a limit is made slower in such steps, down to such a share


@dataclass(frozen=True, eq=False)
class Plan:
    """One experiment to record."""

    name: str
    experiment: str
    joint: int | None  # 1-based
    posture: Array | None  # (joints,) [rad]
    t: Array  # [s]
    motion: Array  # (3, joints, samples)
    v: Array | None = None  # (samples, joints) [rad/s^2] injected excitation
    period: float | None = None  # [s]
    words: str = ""
    nearest: Peak | None = None  # the limit that it comes nearest to


def friction_plans(task: Task) -> tuple[Plan, ...]:
    """One experiment a joint; the others stay at home.

    Raises:
        UsageError: C08, a limit that even a slow one breaks: says which.
    """
    home = _home(task)

    def slower(j: int) -> Callable[[float], tuple[Plan, ...]]:
        return lambda share: (_friction(task, j, home, share),)

    return tuple(plan for j in range(task.robot.n_joints) for plan in _within(task, slower(j)))


def _within(task: Task, make: Callable[[float], tuple[Plan, ...]]) -> tuple[Plan, ...]:
    """The fastest of the sets of plans make(share) that keep every limit."""
    share, found, name = 1.0, Peak("", None, 0.0, 0.0, "", 0.0), ""
    while share >= _SMALLEST:
        plans = [replace(plan, nearest=_nearest(task, plan)) for plan in make(share)]
        broken = next((plan for plan in plans if plan.nearest is not None and plan.nearest.share > 1.0), None)
        if broken is None:
            return tuple(plans)
        assert broken.nearest is not None
        share, found, name = share * _SMALLER, broken.nearest, broken.name
    of = "" if found.joint is None else f" of joint {found.joint}"
    raise UsageError("C08", f"{name} cannot keep the {found.quantity} limit{of}, {found.limit:.4g} {found.unit}",
                     where="limits", remedy="start elsewhere (--home), or correct that limit")


def _nearest(task: Task, plan: Plan) -> Peak | None:
    """Of all limits; the torque is that of the excitation as well, which is held from sample to sample."""
    limits, chain = task.problem.limits, task.problem.chain
    found = list(peaks(limits, chain, plan.motion, task.torque, periodic=False))
    if plan.v is not None and task.torque is not None:
        excited = plan.motion.copy()
        excited[2] += plan.v.T
        low, high = task.torque(excited)
        for j, limit in enumerate(limits.torque):
            most = float(max(high[j].max(), -low[j].min()))
            if np.isfinite(limit):
                found.append(Peak("torque", j + 1, most, float(limit), "N m" if task.robot.revolute[j] else "N", most / limit))
    return worst(tuple(found))


def _home(task: Task) -> Array:
    if task.home is None:
        raise UsageError("C02", "these experiments need a posture where the other joints stay", where="--no-rest",
                         remedy="leave --no-rest out, or give --home")
    return task.home


def _friction(task: Task, j: int, home: Array, share: float) -> Plan:
    low, high = task.robot.joints[j].position
    room = _USED_RANGE * (high - low) if np.isfinite(high - low) else _FREE
    centre = 0.5 * (low + high) if np.isfinite(high - low) else home[j]
    rate, top, place = share * _acceleration(task, j, home), share * _SHARE * float(task.speed[j]), float(home[j])
    parts: list[tuple[Array, float]] = []
    held: list[float] = []
    for speed in np.geomspace(0.01, 1.0, _LEVELS) * top:
        ramp = max(_PEAK * speed / rate, 0.05)
        hold = min(room / speed - ramp, _HELD[1])
        if hold < _HELD[0]:
            continue
        start = float(centre - 0.5 * speed * (hold + ramp))
        parts += [_move(place, start, rate, top), *_stroke(start, float(speed), ramp, float(hold))]
        place = start
        held.append(float(speed))
    if not held:
        raise UsageError("C08", f"joint {j + 1} has too small a range to hold any speed", where="position limits",
                         remedy="widen them, or record friction by hand")
    parts.append(_move(place, float(home[j]), rate, top))
    motion = _joined(task, parts)
    whole = np.zeros((3, task.robot.n_joints, motion.shape[1]))
    whole[0] = home[:, None]
    whole[:, j] = motion
    t = np.arange(motion.shape[1], dtype=np.float64) * task.sample_time
    return Plan(f"friction-{j + 1}", "friction", j + 1, None, t, whole,
                words=f"{len(held)} speeds from {held[0]:.3g} to {held[-1]:.3g} rad/s, each both ways")


def _acceleration(task: Task, j: int, home: Array) -> float:
    """What joint j may use [rad/s^2]: a part of its limit, and of what its torque leaves beyond gravity."""
    joint = task.robot.joints[j]
    bounds = [joint.acceleration if np.isfinite(joint.acceleration) else float(task.speed[j]) / 0.3]
    if task.arm is not None and np.isfinite(joint.torque):
        inertia = float(task.arm.body.mass_matrix(home[None], task.arm.p)[0, j, j])
        bounds.append(0.5 * joint.torque / max(inertia, 1e-9))
    return _ACCELERATION * min(bounds)


def _move(start: float, end: float, rate: float, speed: float) -> tuple[Array, float]:
    """From rest to rest: (polynomial (6,), duration [s]), no faster than `speed` and acceleration `rate` allow."""
    far = abs(end - start)
    duration = max(float(np.sqrt(5.774 * far / rate)), 1.875 * far / speed, 0.2)  # a quintic's peaks
    return quintic(np.array([[start], [0.0], [0.0]]), np.array([[end], [0.0], [0.0]]), duration)[:, 0], duration


def _stroke(start: float, speed: float, ramp: float, hold: float) -> list[tuple[Array, float]]:
    """There and back at constant speed, as polynomials in s with their durations."""
    there = start + speed * (hold + ramp)
    parts = []
    for place, v in ((start, speed), (there, -speed)):
        up = quintic(np.array([[place], [0.0], [0.0]]), np.array([[place + 0.5 * v * ramp], [v], [0.0]]), ramp)[:, 0]
        line = np.array([place + 0.5 * v * ramp, v * hold, 0.0, 0.0, 0.0, 0.0])
        down = quintic(np.array([[place + v * (0.5 * ramp + hold)], [v], [0.0]]),
                       np.array([[place + v * (ramp + hold)], [0.0], [0.0]]), ramp)[:, 0]
        parts += [(up, ramp), (line, hold), (down, ramp)]
    return parts


def _joined(task: Task, parts: list[tuple[Array, float]]) -> Array:
    """Position, speed, acceleration (3, samples) of polynomials one after another."""
    ends = np.cumsum([duration for _, duration in parts])
    t = np.arange(int(np.ceil(ends[-1] / task.sample_time - 1e-9)) + 1) * task.sample_time
    which = np.minimum(np.searchsorted(ends, t, side="right"), len(parts) - 1)
    length = np.array([duration for _, duration in parts])[which]
    s = np.minimum((t - (ends - np.array([duration for _, duration in parts]))[which]) / length, 1.0)  # at rest, then, to the last
    c = np.stack([polynomial for polynomial, _ in parts])[which].T
    k = np.arange(6)[:, None]
    powers = s[None] ** k
    first = (c[1:] * k[1:] * powers[:5]).sum(axis=0) / length
    second = (c[2:] * (k[2:] * (k[2:] - 1)) * powers[:4]).sum(axis=0) / length**2
    return np.stack([(c * powers).sum(axis=0), first, second])


def frf_plans(task: Task, seed: int, random: bool = False) -> tuple[Plan, ...]:
    """Two experiments a joint: there and back through its range at low speed, with odd multisines of the same lines.

    The slow turn keeps friction from sticking; equal lines give every frequency as much, those left out show distortion, and so
    does what differs between the two (multisine.py). `random`: noise in their place, as in Kostić et al. 2004, Section IV.D.

    Raises:
        UsageError: C08, a limit that even a slow and weak one breaks: says which.
    """
    home = _home(task)

    def weaker(j: int) -> Callable[[float], tuple[Plan, ...]]:
        return lambda share: tuple(_frf(task, j, home, seed, share, k, random) for k in range(_REALISATIONS))

    return tuple(plan for j in range(task.robot.n_joints) for plan in _within(task, weaker(j)))


def _frf(task: Task, j: int, home: Array, seed: int, share: float, k: int, random: bool) -> Plan:
    """Joint j's experiment with the k-th phases or noise, its turn and its excitation `share` as strong as they might be."""
    low, high = task.robot.joints[j].position
    room = _USED_RANGE * (high - low) if np.isfinite(high - low) else 2.0 * np.pi
    centre = 0.5 * (low + high) if np.isfinite(high - low) else float(home[j])
    full, ramp = _turn(task, j, home, room)
    speed, hold = share * full, room / full - ramp
    motion = _joined(task, _stroke(centre - 0.5 * speed * (hold + ramp), speed, ramp, hold))
    whole = np.zeros((3, task.robot.n_joints, motion.shape[1]))
    whole[0] = home[:, None]
    whole[:, j] = motion
    t = np.arange(motion.shape[1], dtype=np.float64) * task.sample_time
    own, period, words = _excitation(task, np.random.default_rng([seed, j]), np.random.default_rng([seed, j, k]), len(t), random)
    v = np.zeros((len(t), task.robot.n_joints))
    v[:, j] = share * _strength(task, j, home) * own
    return Plan(f"frf-{j + 1}-{k + 1}", "frf", j + 1, home, t, whole, v, period,
                f"{speed:.3g} rad/s there and back, {hold:.3g} s each way, {words}; {k + 1} of {_REALISATIONS}")


def _excitation(task: Task, grid: np.random.Generator, rng: np.random.Generator, samples: int,
                random: bool) -> tuple[Array, float | None, str]:
    """Of rms 1 (samples,), its period [s], and what it is."""
    if random:
        return rng.standard_normal(samples), None, "a random number each sample"
    period = round(_FRF_PERIOD / task.sample_time)
    lines = odd_lines(grid, int(_FRF_BAND[0] * _FRF_PERIOD), int(_FRF_BAND[1] * period))
    words = (f"{len(lines)} odd lines from {lines[0] / _FRF_PERIOD:.3g} to {lines[-1] / _FRF_PERIOD:.4g} Hz, one of four left out "
             f"to detect distortion, repeated every {_FRF_PERIOD:g} s")
    return realisation(rng, lines, period, samples), period * task.sample_time, words


def _turn(task: Task, j: int, home: Array, room: float) -> tuple[float, float]:
    """Speed [rad/s] and its ramp [s]: slow, and slow enough for the periods to fit into `room` [rad] each way."""
    least = _FRF_PERIODS * _FRF_PERIOD + _FRF_SETTLE
    fastest = min(_SLOW * float(task.speed[j]), room / least)
    ramp = max(_PEAK * fastest / _acceleration(task, j, home), 0.1)
    return min(fastest, room / (least + ramp)), ramp


def _strength(task: Task, j: int, home: Array) -> float:
    """rms of the excitation [rad/s^2]."""
    joint = task.robot.joints[j]
    if task.arm is not None and np.isfinite(joint.torque):
        return _FRF_TORQUE * joint.torque / max(float(task.arm.body.mass_matrix(home[None], task.arm.p)[0, j, j]), 1e-9)
    return _FRF_TORQUE * _acceleration(task, j, home) / _ACCELERATION


def hold_plans(task: Task, seed: int) -> tuple[Plan, ...]:
    """Postures chosen one by one, each the one that adds most to log det of what postures tell about gravity."""
    rng, n = np.random.default_rng(seed), task.robot.n_joints
    low, high = task.around
    candidates = rng.uniform(low - 0.5 * (high - low), high + 0.5 * (high - low), (_CANDIDATES, n))
    bounds = np.array([joint.position for joint in task.robot.joints])
    candidates = np.clip(candidates, bounds[:, 0] + 0.02, bounds[:, 1] - 0.02)
    rows, kept = _static_rows(task, candidates)
    if not kept.any():
        raise UsageError("C08", "no posture can be held within the limits of torque and tip", where=task.robot.name,
                         remedy="correct these limits or the model")
    rows, candidates = rows[kept], candidates[kept]
    matrix = 1e-6 * np.eye(rows.shape[2])
    plans = []
    for k in range(min(_POSTURES, len(candidates))):
        gain = [np.linalg.slogdet(np.eye(n) + row @ np.linalg.solve(matrix, row.T))[1] for row in rows]
        best = int(np.argmax(gain))
        matrix += rows[best].T @ rows[best]
        t = np.arange(round(_DWELL / task.sample_time) + 1, dtype=np.float64) * task.sample_time
        motion = np.zeros((3, n, len(t)))
        motion[0] = candidates[best][:, None]
        plans.append(Plan(f"hold-{k + 1}", "hold", None, candidates[best], t, motion,
                          words=", ".join(f"{value:.3f}" for value in candidates[best]) + " rad"))
    return tuple(replace(plan, nearest=_nearest(task, plan)) for plan in plans)


def _static_rows(task: Task, q: Array) -> tuple[Array, np.ndarray]:
    """Rows (postures, joints, parameters) of what stands still, noise-weighed, and which postures the drives can hold."""
    body = task.problem.columns
    still = np.zeros((3, q.shape[1], len(q)))
    still[0] = q.T
    rows = np.zeros((len(q), q.shape[1], len(body.names)))
    found = tuple(row.copy() for row in body.rows(still))
    for j, (own, row) in enumerate(zip(body.columns, found, strict=True)):
        rows[:, j, own] = row.T / task.problem.goal.noise[j]
    limits = task.problem.limits
    low, high = task.problem.torque_range(still)
    kept = (np.maximum(high, -low) < limits.torque[:, None]).all(axis=0)
    if limits.tip_box is not None:
        tip = tip_motion(task.problem.chain, still[0], still[1]).position
        kept &= ((tip > limits.tip_box[:, :1]) & (tip < limits.tip_box[:, 1:])).all(axis=0)
    return rows, np.asarray(kept)
