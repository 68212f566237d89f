"""Check the position of each joint against its reference: of one run, of one joint, in one unit and scale."""

from __future__ import annotations

import numpy as np

from pipelines.errors import Check
from pipelines.io.experiment import Array
from pipelines.io.limits import percent
from pipelines.quality.checks_subject import Subject, spread

__all__ = ["follows_reference"]

_DEGREE = np.pi / 180.0
_FOLLOWS, _AWAY = 0.5, 0.8  # of a motion: a controller lags and sags by no more; a log that is farther off is refused
_OTHERS = 0.2  # of a motion: a joint that keeps so near to the reference of another follows that
_PROPORTIONAL = 0.05  # of a motion: what is left of it beside a multiple of its reference, where it is that
_UNIT = 0.05  # of a scale, that one of units is kept to: a controller that lags keeps a little less of the motion
_MOVES = 0.005  # times its reference: what moves less stands still; a joint's gear is seldom of more than two hundred
_AT, _NEAR, _STANDS = 0.999, 0.9, 0.02  # of the largest torque: at its limit, and near it; of the time that it stands there
_TRAVEL, _SAMPLES = 0.01, 20  # [rad] of a reference that tells something; of a motion


def follows_reference(s: Subject) -> list[Check]:
    """S16: reference and measurement are of the same run. A controller lags and sags, but does not do something else.

    S13: nor what was asked of another joint. S15: nor does it move twice as far as asked; who counts so has another scale, and who
    counts 57 times as far counts degrees.
    """
    log = s.good.log
    if "q_ref" not in log or log.experiment in ("hold", "frf"):
        return []
    found, seen = [], []
    for j in np.flatnonzero(spread(log["q_ref"]) > _TRAVEL).tolist():
        pair = _both(s, j, j)
        if pair is None:
            continue
        share, _ = _off(*pair)
        seen.append(percent(share, 2))
        if share > _FOLLOWS:
            found.append(_elsewhere(s, j, *pair))
    within = f" within {', '.join(seen)} of the motion" if seen else ""
    return found or s.ok("S16", f"the position follows its reference{within}", signal="q_ref")


def _elsewhere(s: Subject, j: int, q: Array, reference: Array) -> Check:
    """Why joint `j` (from 0) is not where it was asked to be."""
    share, apart = _off(q, reference)
    limit, (scale, rest), other = _stands_at(s.good.log.tau[:s.good.end, j]), _in_scale(q, reference), _follows(s, j)
    in_scale = rest < _PROPORTIONAL and abs(scale) > _MOVES
    if limit is None and other is not None and not (in_scale and _alone(s, other[0])):
        k, near = other
        return s.say("S13", "reject" if share > _AWAY else "warn",
                     f"position of joint {j + 1} follows the reference of joint {k + 1}, within {percent(near, 2)} of it, and not "
                     f"its own: their columns are mixed up", signal="q", joint=j, gate=True,
                     remedy=f"in the map of the import, take the position of joint {k + 1} from where that of joint {j + 1} comes "
                     "from, or give the references the order of the joints; look at torques as well")
    if limit is None and in_scale:
        return _of_scale(s, j, scale, rest, share)
    why = ("they are not of the same run, or not of the same joint" if limit is None else
           f"its torque stands at ±{limit:.3g} {s.unit('tau', j)}, and the joint cannot follow")
    return s.say("S16", "reject" if share > _AWAY and limit is None else "warn",
                 f"position and reference differ by {100 * share:.0f} % of the motion ({apart:.3g} {s.unit('q', j)}): {why}",
                 signal="q_ref", joint=j, gate=True,
                 remedy="log both in one recorder, or leave the reference out" if limit is None else
                 "look for what limits the drive, or drive it more gently")


def _of_scale(s: Subject, j: int, scale: float, rest: float, share: float) -> Check:
    """Of joint `j` (from 0), whose position is `scale` times its reference but for `rest` of it."""
    said = f"position of joint {j + 1} is {scale:.3g} times its reference, within {percent(rest, 2)} of it"
    remedy = ("correct the gear ratio, the direction or the counts per turn of this encoder; if the position is right, the scale "
              "of the reference")
    for large, small, times in (("q", "q_ref", scale * _DEGREE), ("q_ref", "q", _DEGREE / scale)):
        if s.log.robot.joints[j].revolute and abs(times - 1.0) < _UNIT:
            said += f": {large} looks like degrees, declared in rad"
            remedy = f'declare the unit "deg" of {large}; or, if {small} was converted to rad twice, undo that'
    return s.say("S15", "reject" if share > _AWAY else "warn", said, signal="q", joint=j, gate=True, remedy=remedy)


def _both(s: Subject, j: int, k: int) -> tuple[Array, Array] | None:
    """Position of joint `j` and reference of joint `k` where both are known; None of too few samples."""
    q, reference = s.position[:s.good.end, j], s.good.log["q_ref"][:s.good.end, k]
    ok = np.isfinite(q) & np.isfinite(reference)
    return (q[ok], reference[ok]) if ok.sum() >= _SAMPLES else None


def _off(q: Array, reference: Array) -> tuple[float, float]:
    """How far a position is from a reference, as a share of the motion asked for, and standard deviation."""
    apart = float(np.std(q - reference))
    return apart / max(float(np.std(reference)), 1e-12), apart


def _follows(s: Subject, j: int) -> tuple[int, float] | None:
    """Which other joint's reference joint `j` follows best, and within what share of that; None where it follows none."""
    travel = spread(s.good.log["q_ref"])
    pairs = {k: pair for k in np.flatnonzero(travel > _TRAVEL).tolist() if k != j and (pair := _both(s, j, k)) is not None}
    near = {k: _off(*pair)[0] for k, pair in pairs.items()}
    best = min(near, key=near.__getitem__, default=None)
    return None if best is None or near[best] > _OTHERS else (best, near[best])


def _alone(s: Subject, k: int) -> bool:
    """Whether joint `k` does what was asked of it, so that it is not mixed up with another whose reference is like its own."""
    pair = _both(s, k, k)
    return pair is not None and _off(*pair)[0] <= _OTHERS


def _in_scale(q: Array, reference: Array) -> tuple[float, float]:
    """How many times the `reference` a position (samples,) is, in least squares, and what share of it that leaves."""
    x, y = reference - reference.mean(), q - q.mean()
    scale = float(x @ y) / max(float(x @ x), 1e-300)
    return scale, float(np.std(y - scale * x)) / max(float(np.std(y)), 1e-12)


def _stands_at(tau: Array) -> float | None:
    """The limit at which a torque (samples,) stands for a good part of the time; None where it has none."""
    size = np.abs(tau[np.isfinite(tau)])
    most = float(size.max(initial=0.0))
    if most == 0.0:  # no sample, or no torque
        return None
    there = float(np.mean(size >= _AT * most))
    near = float(np.mean((size >= _NEAR * most) & (size < _AT * most)))  # a wave is longer near its crest than on it
    return most if there > max(_STANDS, near) else None
