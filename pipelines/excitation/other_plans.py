"""Plan the other experiments of the workflow.

    friction    one joint at speeds over two decades, both ways, each held as its range allows
    frf         one joint turning slowly there and back, with an odd random-phase multisine, twice

The multisine has odd lines alone, the same ones for every joint: what even powers distort falls
between them (Pintelon, Schoukens 2012, System Identification, §4.3.1), and the experiments of all
joints can be superposed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from pipelines.dynamics.body import Array
from pipelines.errors import UsageError
from pipelines.excitation.config import CONFIG
from pipelines.excitation.fourier import quintics
from pipelines.excitation.task import Task
from pipelines.excitation.verify import Peak, torque_of, worst

__all__ = ["Plan", "frf_plans", "friction_plans", "realisation"]

QUINTIC_SPEED, QUINTIC_ACCELERATION = 1.875, 5.774  # numerics: peaks of 10 s³ - 15 s⁴ + 6 s⁵
RAMP = 1.5  # numerics: largest slope of 3 s² - 2 s³
Knots = list[tuple[float, Array]]  # times [s], and position, speed and acceleration (3, 1) there


@dataclass(frozen=True, eq=False)
class Plan:
    """One experiment to record."""

    name: str
    experiment: str
    joint: int | None  # counted from 1
    posture: Array | None  # (joints,) [rad]
    t: Array  # [s]
    motion: Array  # (3, joints, samples)
    v: Array | None = None  # (samples, joints) [rad/s^2] injected excitation
    period: float | None = None  # [s]
    words: str = ""
    nearest: Peak | None = None  # the limit that it comes nearest to


def friction_plans(task: Task) -> tuple[Plan, ...]:
    """Plan one experiment a joint; the others stay at home.

    Raises:
        UsageError: C08, a limit that even a slow one breaks: says which.
    """
    home, found = _home(task), list[Plan]()
    for j in range(task.robot.n_joints):
        found += _within(task, partial(_friction, task, j, home))
    return tuple(found)


def frf_plans(task: Task, seed: int) -> tuple[Plan, ...]:
    """Plan two experiments a joint: there and back at low speed, with multisines of equal lines.

    The slow turn keeps friction from sticking.

    Raises:
        UsageError: C08, a limit that even a slow and weak one breaks: says which.
    """
    home, found = _home(task), list[Plan]()
    for j in range(task.robot.n_joints):
        found += _within(task, partial(_frf, task, j, home, seed))
    return tuple(found)


def _within(task: Task, make: Callable[[float], tuple[Plan, ...]]) -> tuple[Plan, ...]:
    """Return the fastest of the sets of plans make(share) that keep every limit."""
    share = 1.0
    while True:
        plans = tuple(replace(plan, nearest=_nearest(task, plan)) for plan in make(share))
        broken = next((plan for plan in plans if plan.nearest and plan.nearest.share > 1.0), None)
        if broken is None or broken.nearest is None:
            return plans
        if share * CONFIG.slower < CONFIG.slowest:
            found = broken.nearest
            of = "" if found.joint is None else f" of joint {found.joint}"
            raise UsageError(
                "C08", f"{broken.name} cannot keep the {found.quantity} limit{of}, "
                f"{found.limit:.4g} {found.unit}", where="limits",
                remedy="start elsewhere (--home), or correct that limit")
        share *= CONFIG.slower


def _nearest(task: Task, plan: Plan) -> Peak | None:
    """Return the worst peak; the torque is that of the excitation as well."""
    found = list(task.peaks(plan.motion, periodic=False))
    if plan.v is not None and task.arm is not None:
        excited = plan.motion.copy()
        excited[2] += plan.v.T
        tau = np.abs(torque_of(task.arm, excited)).max(axis=1)
        found += [Peak(one.joint, "torque", float(tau[one.joint - 1]), one.high, one.unit,
                       float(tau[one.joint - 1]) / one.high)
                  for one in task.problem.limits if one.quantity == "torque" and one.joint]
    return worst(found)


def _home(task: Task) -> Array:
    if task.home is None:
        raise UsageError("C02", "these experiments need a posture where the other joints stay",
                         where="--no-rest", remedy="leave --no-rest out, or give --home")
    return task.home


def _room(task: Task, j: int, home: Array, free: float) -> tuple[float, float]:
    """Return centre and width [rad] of the range that joint j uses; `free` without limits."""
    low, high = task.robot.joints[j].position
    if not np.isfinite(high - low):
        return float(home[j]), free
    return 0.5 * (low + high), CONFIG.used_range * (high - low)


def _friction(task: Task, j: int, home: Array, share: float) -> tuple[Plan, ...]:
    centre, room = _room(task, j, home, 4.0 * np.pi)
    rate = share * _acceleration(task, j, home)
    top, (shortest, longest) = share * CONFIG.speed_share * float(task.speed[j]), CONFIG.held
    knots: Knots = [(0.0, _state(float(home[j])))]
    held: list[float] = []
    for speed in (np.geomspace(0.01, 1.0, CONFIG.levels) * top).tolist():
        ramp = max(RAMP * speed / rate, 0.05)
        hold = min(room / speed - ramp, longest)
        if hold >= shortest:
            start = centre - 0.5 * speed * (hold + ramp)
            _move(knots, start, rate, top)
            _stroke(knots, speed, ramp, hold)
            held.append(speed)
    if not held:
        raise UsageError("C08", f"joint {j + 1} has too small a range to hold any speed",
                         where="position limits", remedy="widen them, or record friction by hand")
    _move(knots, float(home[j]), rate, top)
    t, motion = _sampled(task, j, home, knots)
    words = f"{len(held)} speeds from {held[0]:.3g} to {held[-1]:.3g} rad/s, each both ways"
    return (Plan(f"friction-{j + 1}", "friction", j + 1, None, t, motion, words=words),)


def _acceleration(task: Task, j: int, home: Array) -> float:
    """Return what joint j may use [rad/s^2]: of its limit, and of its torque beyond gravity."""
    joint = task.robot.joints[j]
    bound = joint.acceleration
    if not np.isfinite(bound):
        bound = float(task.speed[j]) / 0.3
    if task.arm is not None and np.isfinite(joint.torque):
        bound = min(bound, 0.5 * joint.torque / _inertia(task, j, home))
    return CONFIG.acceleration * bound


def _inertia(task: Task, j: int, home: Array) -> float:
    assert task.arm is not None
    return max(float(task.arm.body.mass_matrix(home[None], task.arm.p)[0, j, j]), 1e-9)


def _state(position: float, speed: float = 0.0) -> Array:
    return np.array([[position], [speed], [0.0]])


def _move(knots: Knots, end: float, rate: float, speed: float) -> None:
    """Add a move from rest to rest, within `speed` and acceleration `rate`."""
    at, state = knots[-1]
    far = abs(end - float(state[0, 0]))
    fastest = max(math.sqrt(QUINTIC_ACCELERATION * far / rate), QUINTIC_SPEED * far / speed)
    knots.append((at + max(fastest, 0.2), _state(end)))


def _stroke(knots: Knots, speed: float, ramp: float, hold: float) -> None:
    """Add the way there and back at constant speed."""
    for v in (speed, -speed):
        at, place = knots[-1][0], float(knots[-1][1][0, 0])
        for seconds, way, now in ((ramp, 0.5 * ramp, v), (hold, hold, v), (ramp, 0.5 * ramp, 0.0)):
            at, place = at + seconds, place + v * way
            knots.append((at, _state(place, now)))


def _sampled(task: Task, j: int, home: Array, knots: Knots) -> tuple[Array, Array]:
    """Return times and the motion (3, joints, samples) of joint j along `knots`."""
    samples = math.ceil(knots[-1][0] / task.sample_time - 1e-9) + 1
    t = np.arange(samples, dtype=np.float64) * task.sample_time
    motion = np.zeros((3, task.robot.n_joints, len(t)))
    motion[0] = home[:, None]
    motion[:, j] = quintics(knots, t)[:, 0]
    return t, motion


def _frf(task: Task, j: int, home: Array, seed: int, share: float) -> tuple[Plan, ...]:
    """Plan joint j's experiments, `share` as fast and strong as they might be."""
    centre, room = _room(task, j, home, 2.0 * np.pi)
    least = CONFIG.frf_periods * CONFIG.frf_period + CONFIG.frf_settle
    fastest = min(CONFIG.slow * float(task.speed[j]), room / least)
    ramp = max(RAMP * fastest / _acceleration(task, j, home), 0.1)
    full = min(fastest, room / (least + ramp))  # the periods fit into the room each way
    speed, hold = share * full, room / full - ramp
    knots: Knots = [(0.0, _state(centre - 0.5 * speed * (hold + ramp)))]
    _stroke(knots, speed, ramp, hold)
    t, motion = _sampled(task, j, home, knots)
    joint = task.robot.joints[j]
    if task.arm is not None and np.isfinite(joint.torque):
        strength = CONFIG.frf_torque * joint.torque / _inertia(task, j, home)
    else:
        strength = CONFIG.frf_torque * _acceleration(task, j, home) / CONFIG.acceleration
    seconds, (low, high) = CONFIG.frf_period, CONFIG.frf_band
    period, found = round(seconds / task.sample_time), []
    lines = np.arange(int(low * seconds) | 1, int(high * period) + 1, 2)
    words = (f"{len(lines)} odd lines from {lines[0] / seconds:.3g} to "
             f"{lines[-1] / seconds:.4g} Hz, repeated every {seconds:g} s")
    for k in range(CONFIG.realisations):
        own = realisation(np.random.default_rng([seed, j, k]), lines, period, len(t))
        v = np.zeros((len(t), task.robot.n_joints))
        v[:, j] = share * strength * own
        found.append(Plan(
            f"frf-{j + 1}-{k + 1}", "frf", j + 1, home, t, motion, v, period * task.sample_time,
            f"{speed:.3g} rad/s there and back, {hold:.3g} s each way, {words}; {k + 1} of "
            f"{CONFIG.realisations}"))
    return tuple(found)


def realisation(rng: np.random.Generator, lines: npt.NDArray[np.int64],
                period: int, samples: int) -> Array:
    """Return lines of equal amplitude and random phase, rms 1, repeated after `period` samples."""
    spectrum = np.zeros(period // 2 + 1, dtype=np.complex128)
    spectrum[lines] = np.exp(2j * np.pi * rng.uniform(size=len(lines)))
    one = np.fft.irfft(spectrum, period)
    return np.asarray(np.resize(one / np.sqrt(np.mean(one**2)), samples))
