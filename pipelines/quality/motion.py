"""Check the motion of a log: its limits, held joints, its reference, a stop, its directions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.errors import Check, Level
from pipelines.io.limits import FEWEST, percent
from pipelines.io.log import Array
from pipelines.quality.config import CONFIG
from pipelines.quality.segments import lagged_speed
from pipelines.quality.subject import NotTested, Subject, spread


def peak_speed(s: Subject) -> Array:
    """Return the largest speed (joints,) [rad/s] over ±10 ms in the usable stretches, or NaN."""
    parts = [lagged_speed(s.position[run], s.log.sample_time) for run in _stretches(s)]
    return _largest(s, [np.abs(part) for part in parts])


def _peak_acceleration(s: Subject) -> Array:
    """Return the largest acceleration (joints,) over ±20 ms, less that of encoder noise, or NaN."""
    parts = []
    for run in _stretches(s):
        q = np.where(np.isfinite(s.position[run]).any(axis=0), s.position[run], 0.0)
        m = max(2, min(round(2.0 * CONFIG.speed_lag / s.log.sample_time), len(q) // 20))
        second = np.abs(q[2 * m :] - 2.0 * q[m:-m] + q[: -2 * m])
        # white noise of variance σ² gives 20 σ² in the third difference, and √6 σ here
        noise = np.sqrt(6.0 / 20.0 * np.nanmean(np.diff(q, 3, axis=0) ** 2, axis=0))
        parts.append(np.maximum(second - CONFIG.noise * noise, 0.0) / (m * s.log.sample_time) ** 2)
    return _largest(s, parts)


def _stretches(s: Subject) -> tuple[slice, ...]:
    """Return the usable runs; of a log too short for one, all of it where no sample is missing."""
    if s.good.runs or s.good.end < FEWEST or not s.good.time.known:
        return s.good.runs * s.good.time.known
    ticks = np.diff(s.good.log.t[: s.good.end]) / s.log.sample_time
    even = bool((np.abs(ticks - 1.0) < CONFIG.even).all())
    return (slice(0, s.good.end),) * even


def _largest(s: Subject, parts: Sequence[Array]) -> Array:
    """Return the largest finite value of each column (joints,), else NaN."""
    x = np.concatenate([np.full((1, s.log.n_joints), np.nan), *parts])
    return np.where(np.isfinite(x).any(axis=0), np.max(np.nan_to_num(x), axis=0), np.nan)


def limits(s: Subject) -> Sequence[Check | NotTested]:
    """D12: position, speed and acceleration are within what the description allows."""
    found, joints = [], s.log.robot.joints
    allowed = np.array([(*joint.position, joint.velocity, joint.acceleration) for joint in joints])
    if not np.isfinite(allowed).any():
        return s.cannot_tell("D12", "the robot's description has no limits", signal="q")
    speed, acceleration = peak_speed(s), _peak_acceleration(s)
    for j, (low, high, velocity, greatest) in enumerate(allowed.tolist()):
        q = s.position[np.isfinite(s.position[:, j]), j]
        over = max(float(q.max(initial=low)) - high, low - float(q.min(initial=high)))
        if q.size and over > 0.01 * (high - low if np.isfinite(high - low) else 1.0):
            words = f"the position goes {over:.3g} {s.unit('q', j)} beyond its limits {[low, high]}"
            remedy = "correct the limits, or the joint's zero"
            found.append(s.say("D12", "warn", words, remedy, signal="q", joint=j))
        for name, signal, value, limit in (
            ("speed", "dq", speed[j], velocity),
            ("acceleration", "ddq_ref", acceleration[j], greatest),
        ):
            if value > CONFIG.limit_slack * limit:
                words = f"the {name} reaches {value:.4g} {s.unit(signal, j)}, "
                words += f"{value / limit:.3g} times its limit"
                remedy, gate = (
                    "move slower, or correct the limit",
                    value > CONFIG.limit_gate * limit,
                )
                found.append(s.say("D12", "warn", words, remedy, gate, signal="q", joint=j))
    if found:
        return found
    if (unknown := np.flatnonzero(np.isnan(speed)) + 1).size:
        numbers = ", ".join(map(str, unknown))
        words = f"no stretch of even samples to take the speed of joint {numbers} from"
        return s.cannot_tell("D12", words, signal="q")
    words = f"within the limits; speed at most {s.with_units('dq', speed.tolist())}, "
    words += f"acceleration {s.with_units('ddq_ref', acceleration.tolist())}"
    return s.ok("D12", words, signal="q")


def held_joints(s: Subject) -> list[Check]:
    """D16: joints that this experiment holds do not move."""
    log, found = s.log, []
    if log.experiment not in ("friction", "frf", "hold"):
        return []
    driven = 0.0 if log.joint is None else 0.1 * float(s.travel[log.joint - 1])
    held = [j for j in range(log.n_joints) if j + 1 != log.joint]
    for j in held:
        if s.travel[j] > max(CONFIG.held, driven):
            words = f"joint {j + 1} moves by {s.travel[j]:.3g} {s.unit('q', j)} in a "
            words += f"{log.experiment} log that holds it"
            remedy = "hold it stiffer, or call the experiment 'free'"
            found.append(s.say("D16", "warn", words, remedy, True, signal="q", joint=j))
    most = max((float(s.travel[j]) for j in held), default=0.0)
    return found or s.ok("D16", f"held joints move by at most {most:.3g} rad", signal="q")


def stopped(s: Subject) -> list[Check]:
    """D11: the arm follows to the end."""
    if s.good.stop is None:
        return s.ok("D11", "no emergency stop, no lost reference")
    at, how = s.good.stop
    words = f"emergency stop or tracking failure: {how}; samples from there on are left out"
    remedy, gate = "find out what stopped the arm, and record again", at < s.log.n_samples / 2
    return [s.say("D11", "warn", words, remedy, gate, sample=int(s.good.kept[at]))]


def both_ways(s: Subject) -> dict[int, tuple[float, float]]:
    """Return the shares of the moving time up and down, of each joint (from 0) that has to move."""
    shares, lag = {}, 2.0 * CONFIG.speed_lag
    for j in s.moving if s.good.time.known and s.good.runs else ():
        parts = [s.position[run, j : j + 1] for run in s.good.runs]
        speed = np.concatenate([lagged_speed(q, s.log.sample_time, lag) for q in parts])
        speed = speed[np.isfinite(speed)]
        fast = speed[np.abs(speed) > 0.05 * np.abs(speed).max(initial=0.0)]
        if fast.size:
            shares[j] = (float(np.mean(fast > 0)), float(np.mean(fast < 0)))
    return shares


def direction(s: Subject) -> list[Check]:
    """D10: an excitation moves every joint both ways; friction logs are judged together."""
    if s.log.experiment != "excitation":
        return []
    found, remedy = [], "move the joint in both directions"
    for j, shares in both_ways(s).items():
        if min(shares) < CONFIG.one_way:
            words = f"the speed of joint {j + 1} never changes sign: its Coulomb friction is "
            words += "confounded with a torque offset"
            found.append(s.say("D10", "warn", words, remedy, True, signal="q", joint=j))
    return found or s.ok("D10", "every joint moves in both directions", signal="q")


def follows_reference(s: Subject) -> list[Check]:
    """S16: position and reference are of one run. A controller lags and sags by less than half.

    S13: a joint does not follow the reference of another. S15: nor does it move twice as far; a
    position with another factor has another scale, and with a factor of 57 it is in degrees.
    """
    if "q_ref" not in s.log or s.log.experiment in ("hold", "frf"):
        return []
    asked = np.flatnonzero(spread(s.good.log["q_ref"]) > CONFIG.travel).tolist()
    fits = {(j, k): _fit(s, j, k) for j in asked for k in asked}
    shares = {j: fits[j, j][0] for j in asked if np.isfinite(fits[j, j][0])}
    found = [_elsewhere(s, j, fits) for j, share in shares.items() if share > CONFIG.follows]
    words = ", ".join(percent(share, 2) for share in shares.values())
    within = f" within {words} of the motion" if words else ""
    return found or s.ok("S16", f"the position follows its reference{within}", signal="q_ref")


def _fit(s: Subject, j: int, k: int) -> tuple[float, float, float]:
    """Compare the position of joint `j` with the reference of joint `k`.

    Returns:
        how far it is away, as a share of the reference (infinite if unknown); how many times the
        reference it is, in least squares; the share of the position that this leaves.
    """
    q, reference = s.position[: s.good.end, j], s.good.log["q_ref"][: s.good.end, k]
    known = np.isfinite(q) & np.isfinite(reference)
    if known.sum() < FEWEST:
        return np.inf, 0.0, np.inf
    x, y = reference[known] - reference[known].mean(), q[known] - q[known].mean()
    scale = float(x @ y) / max(float(x @ x), 1e-300)
    away = float(np.std(y - x)) / max(float(np.std(x)), 1e-12)
    return away, scale, float(np.std(y - scale * x)) / max(float(np.std(y)), 1e-12)


def _elsewhere(
    s: Subject, j: int, fits: dict[tuple[int, int], tuple[float, float, float]]
) -> Check:
    """Return why joint `j` is not at its reference."""
    away, scale, rest = fits[j, j]
    if float(np.mean(s.good.saturated[: s.good.end, j])) > CONFIG.at_top:
        words = f"position and reference differ by {percent(away, 2)} of the motion: "
        words += "the torque is at its limit, and the joint cannot follow"
        remedy = "look for what limits the drive, or drive it more gently"
        return s.say("S16", "warn", words, remedy, True, signal="q_ref", joint=j)
    level: Level = "reject" if away > CONFIG.away else "warn"
    in_scale = rest < CONFIG.proportional and abs(scale) > CONFIG.moves
    near, k = min(((fits[j, k][0], k) for i, k in fits if i == j != k), default=(np.inf, j))
    # where joint k follows its own reference, that of joint j is only like it
    if near <= CONFIG.others and not (in_scale and fits[k, k][0] <= CONFIG.others):
        words = f"position of joint {j + 1} follows the reference of joint {k + 1}, within "
        words += f"{percent(near, 2)} of it, and not its own: their columns are mixed up"
        remedy = "correct the map of the import, of positions, references or torques"
        return s.say("S13", level, words, remedy, True, signal="q", joint=j)
    if in_scale:
        words = f"position of joint {j + 1} is {scale:.3g} times its reference, within "
        words += f"{percent(rest, 2)} of it"
        remedy = "correct the gear ratio, the direction or the counts per turn of this encoder; if "
        remedy += "the position is right, the scale of the reference"
        for large, times in (("q", scale), ("q_ref", 1.0 / scale)):
            if abs(np.deg2rad(times) - 1.0) < CONFIG.proportional:
                words += f": {large} looks like degrees, declared in rad"
        return s.say("S15", level, words, remedy, True, signal="q", joint=j)
    words = f"position and reference differ by {percent(away, 2)} of the motion: "
    words += "they are not of the same run, or not of the same joint"
    remedy = "log both in one recorder, or leave the reference out"
    return s.say("S16", level, words, remedy, True, signal="q_ref", joint=j)


MOTION_CHECKS = (limits, held_joints, follows_reference, stopped, direction)
