"""Judge what unit the numbers of a column are in, by what a robot can do."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipelines.log.experiment import Array

__all__ = ["Guess", "held", "motion_of", "position_unit", "quarter_turns", "rollover", "sign_of", "torque_unit"]

Confidence = Literal["sure", "likely", "unsure"]
_RESOLUTIONS = (4096, 8192, 16384, 2048, 1024, 65536, 131072, 262144, 1048576, 4000, 10000, 20000)


@dataclass(frozen=True)
class Guess:
    """A value with how sure it is and why."""

    value: str
    confidence: Confidence
    why: str


def rollover(values: Array) -> float | None:
    """The size of the jumps where a counter starts again: several times larger than any step, and all alike."""
    steps = np.diff(values, axis=0)
    size = float(np.ptp(values))
    jumps = np.abs(steps[np.abs(steps) > 0.8 * size]) if size > 0 else np.empty(0)
    others = np.abs(steps[np.abs(steps) <= 0.8 * size])
    if not jumps.size or (others.size and others.max() > 0.2 * size) or np.ptp(jumps) > 0.1 * jumps.mean():
        return None
    candidates = (360.0, 2 * math.pi, 1.0, *map(float, _RESOLUTIONS))
    near = min(candidates, key=lambda c: abs(jumps.max() - c) / c)
    return near if abs(jumps.max() - near) / near < 0.1 else float(jumps.max())


def position_unit(q: Array, t: Array | None, dq: Array | None, named: str | None) -> tuple[Guess, str]:
    """The unit of positions, and further keys of the recipe (counts_per_rev, wrap)."""
    span = float(np.ptp(q, axis=0).max())
    wrap = rollover(q)
    further = f", wrap = {wrap:g}" if wrap is not None else ""
    if named == "counts" or (named is None and span > 2000.0 and _whole(q)):
        return _counts(q, span, wrap, named)
    if named in ("rad", "deg", "rev", "turn", "mm", "m"):
        return Guess(named, "sure" if _possible(span, named) else "unsure",
                     f"named so; the largest range is {span:.4g} {named}"), further
    if (found := _by_velocity(q, t, dq)) is not None:
        return found, further
    if span > 720.0:
        return Guess("deg", "unsure",
                     f"a range of {span:.5g} is neither an arm's in rad nor in deg: motor side, or counts?"), further
    if turns := quarter_turns(q):
        return Guess("rad", "likely", f"starts at {', '.join(f'{x}' for x in turns.values())} times pi/2: "
                     "motor side, and these are likely its gear ratios for [drive]"), further
    if span > 4.0 * math.pi:
        return Guess("deg", "unsure",
                     f"a range of {span:.4g} is too much for a joint in rad; or motor side in rad, then [drive]"), further
    speed = float(np.abs(np.diff(q, axis=0) / np.diff(t)[:, None]).max()) if t is not None and (np.diff(t) > 0).all() else math.nan
    why = f"ranges up to {span:.3g}" + (f", speeds up to {speed:.3g} a second" if math.isfinite(speed) else "")
    return Guess("rad", "likely", f"{why}: a joint's in rad, hardly a movement in deg"), further


def quarter_turns(q: Array) -> dict[int, int]:
    """Robots rest at right angles: a motor then stands at its gear ratio times quarter turns, in rad.

    Returns:
        joint (from 0) -> quarter turns at the start, of those that stand far from zero; empty where one is at none.
    """
    far = np.flatnonzero(np.abs(q[0]) > 4.0 * math.pi)
    start = q[0][far] / (0.5 * math.pi)
    if start.size == 0 or np.abs(start - np.round(start)).max() > 2e-3:
        return {}
    return {int(j): int(x) for j, x in zip(far, np.round(start), strict=True)}


def held(tau: Array, q: Array) -> Guess:
    """Whether a torque is a command that is held: then it stands still over samples in which the position moves."""
    moving = np.abs(np.diff(q, axis=0)) > 0
    both = np.diff(tau, axis=0)[moving[:, :tau.shape[1]]] if tau.shape == q.shape else np.diff(tau, axis=0).ravel()
    share = float(np.mean(both == 0)) if both.size else 0.0
    if share > 0.4 and np.unique(tau).size > 50:
        return Guess("held-command", "likely", f"{100 * share:.0f} % of the steps between samples are none while the position "
                     "moves: a command, held over several samples")
    return Guess("measured", "unsure", 'nothing in the numbers tells; ask who recorded them: "held-command" where this is what '
                 "the drive was commanded, to be held until the next sample")


def _counts(q: Array, span: float, wrap: float | None, named: str | None) -> tuple[Guess, str]:
    resolution = wrap if wrap is not None else min(_RESOLUTIONS, key=lambda r: abs(span - r))
    why = "named so" if named else f"whole numbers over a range of {span:.5g}"
    if wrap is not None:
        return (Guess("counts", "sure" if named else "likely", f"{why}; it starts again after {wrap:g}, taken as one revolution"),
                f", counts_per_rev = {resolution:g}, wrap = {wrap:g}")
    return (Guess("counts", "likely" if named else "unsure",
                  f"{why}; counts_per_rev {resolution:g} is the usual number nearest to the range of {span:.5g}; "
                  "add wrap where the counter starts again"),
            f", counts_per_rev = {resolution:g}")


def _by_velocity(q: Array, t: Array | None, dq: Array | None) -> Guess | None:
    """Where a velocity was recorded, the slope of the position says how their units go together."""
    if t is None or dq is None or not (np.diff(t) > 0).all():
        return None
    slope = np.gradient(q, t, axis=0)
    factor = float((slope * dq).sum() / max(float((dq * dq).sum()), 1e-300))
    names = {1.0: "rad", 180.0 / math.pi: "deg", 1.0 / 60.0: "rev"}
    near = min(names, key=lambda f: abs(math.log(abs(factor) / f)) if factor > 0 else math.inf)
    if factor <= 0 or abs(factor / near - 1.0) > 0.1:
        return None
    peak = float(np.abs(dq).max())
    if near == 1.0 and peak > 50.0:
        return Guess("deg", "likely", f"its slope is the recorded velocity, which reaches {peak:.4g}: deg/s, not rad/s")
    other = {"rad": "rad/s", "deg": "rad/s", "rev": "rpm"}[names[near]]
    return Guess(names[near], "likely",
                 f"its slope is {factor:.4g} times the recorded velocity (up to {peak:.3g}), as with {names[near]} and {other}")


def torque_unit(tau: Array, named: str | None, current: bool) -> Guess:
    """The unit of torques: by name, else by size alone, which cannot be sure."""
    peak = float(np.abs(tau).max())
    if named in ("A", "mA", "N m", "mN m"):
        return Guess(named, "sure", f"named so; up to {peak:.4g} {named}")
    if current:
        return Guess("mA" if peak > 200.0 else "A", "likely", f"named a current; up to {peak:.4g}")
    if peak > 1000.0:
        return Guess("mN m", "unsure", f"up to {peak:.5g}: too much for N m of an arm")
    return Guess("N m", "unsure", f"up to {peak:.4g}; or a current in A, or motor side")


def sign_of(q: Array, tau: Array) -> Guess:
    """Friction takes power out: beside inertia, springs and a constant, torque must grow with speed on every joint."""
    width = max(5, len(q) // 300)
    smooth = np.ones(width) / width
    share = np.zeros(q.shape[1])
    for j in range(q.shape[1]):
        position, torque = (np.convolve(x[:, j], smooth, mode="valid") for x in (q, tau))
        speed = np.gradient(position)
        columns = np.column_stack([speed, np.gradient(speed), position, np.ones(position.size)])
        columns /= np.maximum(np.abs(columns).max(axis=0), 1e-300)
        share[j] = np.linalg.lstsq(columns, torque, rcond=1e-9)[0][0] * np.std(columns[:, 0]) / max(float(np.std(torque)), 1e-300)
    wrong = [str(j + 1) for j in np.flatnonzero(share < -0.02)]
    if wrong:
        return Guess("sign = -1?", "likely",
                     f"torque of joint {', '.join(wrong)} takes energy out of the motion where friction should: "
                     "add sign = -1 there, unless its transmission is negative")
    if (share > 0.02).all():
        return Guess("as recorded", "likely", "sign: torque grows with speed on every joint, as friction asks for")
    return Guess("as recorded", "unsure", "sign: torque and motion do not tell")


def motion_of(q: Array, unit: str) -> list[str]:
    """Comments on what the motion itself shows."""
    still = [str(j + 1) for j in np.flatnonzero(np.ptp(q, axis=0) == 0.0)]
    return [f"# joint {', '.join(still)} never moves in this file"] if still else []


def _whole(q: Array) -> bool:
    return bool((q == np.round(q)).mean() > 0.99)


def _possible(span: float, unit: str) -> bool:
    return span <= {"rad": 400.0, "deg": 36000.0, "rev": 1e4, "turn": 1e4, "mm": 1e5, "m": 100.0}[unit]
