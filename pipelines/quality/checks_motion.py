"""Check the motion of a log: units of angle, limits, and what moves that should not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.errors import Check
from pipelines.io.experiment import Array
from pipelines.quality.checks_reference import follows_reference
from pipelines.quality.checks_subject import NotTested, Subject
from pipelines.quality.checks_unit import angles_in_file
from pipelines.quality.faults import lagged_speed
from pipelines.quality.stop import emergency_stop

__all__ = ["MOTION_CHECKS", "both_ways", "degrees_or_motor"]

_DEGREE = np.pi / 180.0
_NOISE_SPEED = 6.0  # standard deviations that a limit must be exceeded by


def degrees(s: Subject) -> Sequence[Check | NotTested]:
    """S07: angles declared in rad are not degrees. Only limits of position and speed can tell."""
    if not any(np.isfinite([*joint.position, joint.velocity]).any() for joint in s.log.robot.joints):
        return s.cannot_tell("S07", "the robot's description has no limits of position or speed", signal="q")
    found = []
    speed = peak_speed(s)
    for j, joint in enumerate(s.log.robot.joints):
        if not joint.revolute or s.travel[j] <= 0:
            continue
        low, high = joint.position
        q = s.position[np.isfinite(s.position[:, j]), j]
        reach = max(abs(float(q.min())), abs(float(q.max())), s.travel[j])
        bounds = max(abs(low), abs(high)) if np.isfinite(joint.position).all() else np.inf
        beyond = reach > 2.0 * bounds or speed[j] > 3.0 * joint.velocity
        fits = reach * _DEGREE <= 1.1 * bounds and speed[j] * _DEGREE <= 1.1 * joint.velocity
        if reach > 4.0 * np.pi and beyond and fits:
            found.append(s.say("S07", "reject",
                               f"q of joint {j + 1} is declared in rad, but looks like degrees or the motor side: it reaches "
                               f"{reach:.4g} at up to {speed[j]:.4g} a second, beyond the limits in rad",
                               signal="q", joint=j,
                               remedy=angles_in_file(s)))
    return found or s.ok("S07", f"angles: {s.with_units('q', s.travel.tolist())} of travel, speeds as the limits allow", signal="q")


def peak_speed(s: Subject) -> Array:
    """(joints,) [rad/s] largest speed over ±10 ms within the usable stretches; NaN where none could be taken."""
    peaks = [_largest(np.abs(lagged_speed(s.position[run], s.log.sample_time)))
             for run in _stretches(s) if run.stop - run.start > 2]
    return _largest(np.array(peaks)) if peaks else np.full(s.log.n_joints, np.nan)


def _stretches(s: Subject) -> tuple[slice, ...]:
    """The usable runs; in a log too short for one, everything, where no sample is left out of it."""
    if not s.good.time.known:
        return ()
    even = bool((np.abs(np.diff(s.good.log.t[:s.good.end]) / s.log.sample_time - 1.0) < 0.5).all())
    return s.good.runs or ((slice(0, s.good.end),) if even else ())


def _largest(x: Array) -> Array:
    """(joints,) largest finite value of each column, NaN where there is none."""
    finite = np.isfinite(x)
    return np.where(finite.any(axis=0), np.max(np.where(finite, x, -np.inf), axis=0, initial=-np.inf), np.nan)


def limits(s: Subject) -> Sequence[Check | NotTested]:
    """D12: position, speed and acceleration stay within what the description allows."""
    found: list[Check] = []
    robot = s.log.robot
    if not any(np.isfinite([*joint.position, joint.velocity, joint.acceleration]).any() for joint in robot.joints):
        return s.cannot_tell("D12", "the robot's description has no limits", signal="q")
    speed, acceleration = peak_speed(s), _peak_acceleration(s)
    for j, joint in enumerate(robot.joints):
        q = s.position[np.isfinite(s.position[:, j]), j]
        if not q.size:
            continue
        margin = 0.01 * (joint.position[1] - joint.position[0]) if np.isfinite(joint.position).all() else 0.01
        over = max(float(q.max()) - joint.position[1], joint.position[0] - float(q.min()))
        if over > margin:
            found.append(s.say("D12", "warn",
                               f"the position goes {over:.3g} {s.unit('q', j)} beyond its limits {list(joint.position)}",
                               signal="q", joint=j,
                               remedy="correct the limits, or the joint's zero"))
        for value, limit, what, unit in ((speed[j], joint.velocity, "speed", s.unit("dq", j)),
                                         (acceleration[j], joint.acceleration, "acceleration", s.unit("ddq_ref", j))):
            if value > 1.1 * limit:
                found.append(s.say("D12", "warn",
                                   f"the {what} reaches {value:.4g} {unit}, {value / limit:.3g} times its limit",
                                   signal="q", joint=j, gate=value > 1.5 * limit,
                                   remedy="move slower, or correct the limit"))
    if found:
        return found
    if np.isnan(speed).any():
        joints = ", ".join(str(j + 1) for j in np.flatnonzero(np.isnan(speed)))
        return s.cannot_tell("D12", f"no stretch of even samples to take the speed of joint {joints} from", signal="q")
    fastest, hardest = s.with_units("dq", speed.tolist()), s.with_units("ddq_ref", acceleration.tolist())
    return s.ok("D12", f"within the limits; speed at most {fastest}, acceleration {hardest}", signal="q")


def _peak_acceleration(s: Subject) -> Array:
    """(joints,) acceleration over ±20 ms, less what the position's own noise gives."""
    peaks = []
    for run in _stretches(s):
        q = np.where(np.isfinite(s.position[run]).any(axis=0), s.position[run], 0.0)
        m = max(2, min(round(0.02 / s.log.sample_time), len(q) // 20))
        if len(q) <= 4 * m:
            continue
        second = np.abs(q[2 * m:] - 2.0 * q[m:-m] + q[:-2 * m]) / (m * s.log.sample_time) ** 2
        # white noise of variance σ² leaves 20 σ² in the third difference; √6 σ / (m Ts)² in this acceleration
        sigma = np.sqrt(np.nanmean(np.diff(q, 3, axis=0) ** 2, axis=0) / 20.0)
        noise = np.sqrt(6.0) * sigma / (m * s.log.sample_time) ** 2
        peaks.append(np.maximum(np.nanmax(second, axis=0, initial=0.0) - _NOISE_SPEED * noise, 0.0))
    return _largest(np.array(peaks)) if peaks else np.full(s.log.n_joints, np.nan)


def degrees_or_motor(reach: float, bounds: tuple[float, float]) -> str:
    """S07's remedy in a recipe: numbers too large for a joint in rad are degrees, or of the motor, and each asks for something
    else."""
    wide = max(abs(bounds[0]), abs(bounds[1]), bounds[1] - bounds[0])
    least = f" of at least {reach / wide:.3g}" if np.isfinite(wide) and wide > 0 else ""
    return (f'if degrees, declare unit = "deg" (divides by 57.3); if motor side, add [drive] transmission = the gear ratios'
            f"{least}, which multiplies torque by them as well; if neither, pass --trust-units")


def held_joints(s: Subject) -> list[Check]:
    """D16: joints that this experiment holds stay where they are."""
    log = s.log
    if log.experiment not in ("friction", "frf", "hold"):
        return []
    mover = None if log.joint is None else log.joint - 1
    allowed = 0.05 if mover is None else max(0.05, 0.1 * float(s.travel[mover]))
    found = [s.say("D16", "warn",
                   f"joint {j + 1} moves by {s.travel[j]:.3g} {s.unit('q', j)} in a {log.experiment} log that holds it",
                   signal="q", joint=j, gate=True,
                   remedy="hold it stiffer, or call the experiment 'free'")
             for j in range(log.n_joints) if j != mover and s.travel[j] > allowed]
    most = max((float(s.travel[j]) for j in range(log.n_joints) if j != mover), default=0.0)
    return found or s.ok("D16", f"held joints move by at most {most:.3g} rad", signal="q")


def stopped(s: Subject) -> list[Check]:
    """D11: the arm does what is asked of it to the end."""
    event = emergency_stop(s.good.log)
    if event is None:
        return s.ok("D11", "no emergency stop, no lost reference")
    sample, how = event
    return [s.say("D11", "warn",
                  f"emergency stop or tracking failure: {how}; samples from there on are left out",
                  gate=sample < s.log.n_samples / 2, sample=int(s.good.kept[sample]),
                  remedy="look what stopped the arm, and record again")]


def both_ways(s: Subject) -> dict[int, tuple[float, float]]:
    """For each joint (from 0) that this experiment moves: share of its moving time in positive and in negative direction."""
    shares = {}
    for j in s.moving:
        if s.travel[j] <= 0 or not s.good.runs or not s.good.time.known:
            continue
        speed = np.concatenate([lagged_speed(s.position[run, j:j + 1], s.log.sample_time, 0.02)[:, 0] for run in s.good.runs])
        speed = speed[np.isfinite(speed)]
        fast = np.abs(speed) > 0.05 * np.abs(speed).max(initial=0.0)
        if fast.any():
            shares[j] = (float(np.mean(speed[fast] > 0)), float(np.mean(speed[fast] < 0)))
    return shares


def direction(s: Subject) -> list[Check]:
    """D10: an excitation moves every joint both ways; friction logs are judged together, one may go each way."""
    if s.log.experiment != "excitation":
        return []
    one_way = [j for j, (up, down) in both_ways(s).items() if min(up, down) < 0.02]
    found = [s.say("D10", "warn",
                   f"the speed of joint {j + 1} never changes sign: its Coulomb friction is confounded with a torque offset",
                   signal="q", joint=j, gate=True,
                   remedy="move the joint in both directions") for j in one_way]
    return found or s.ok("D10", "every joint moves in both directions", signal="q")


MOTION_CHECKS = (degrees, limits, held_joints, follows_reference, stopped, direction)
