"""Judge which unit the numbers of a column are in, by what a robot can do."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.importers.config import EVIDENCE
from pipelines.importers.evidence import (
    Guess,
    LinkFit,
    Slope,
    best_unit,
    quarter_turns,
    rollover,
    units_of_ratio,
    unlike_links,
)
from pipelines.importers.groups import Side
from pipelines.importers.names import quantity_of
from pipelines.importers.recipe import BLANK
from pipelines.io.log import Array
from pipelines.io.robot import Joint
from pipelines.io.units import UNITS, of_rated

_OPEN_SIDES = {
    "motor": "named a motor's or an encoder's, whose turns no limit of a joint bounds: "
    "rad, deg or rev?",
    "scaled": "data sets of robot learning also scale positions to -1..1 or -100..100",
}
_NO_UNIT = "no unit is stated, and"
_LESS_THAN_A_TURN = "rad, or the degrees of a small motion, or turns as servo drives count?"
_TURNING = {
    unit: UNITS[unit].factor
    for unit in ("rad", "mrad", "deg", "mdeg", "arcmin", "arcsec", "rev", "turn")
}
_LENGTHS = ("m", "cm", "mm", "um")
_SPEEDS = ("rad/s", "deg/s", "rev/s", "rpm", "mrad/s", "mdeg/s")


@dataclass(frozen=True)
class PositionEvidence:
    """The evidence for the unit of positions, apart from their numbers."""

    slope: Slope | None  # of a recorded velocity, where the unit of time is known
    joints: Sequence[Joint]  # of the robot
    side: Side  # as names say; only of a joint does its range of motion say anything
    fits: Mapping[str, LinkFit]  # of the torque, by their unit
    message: str  # whose definition has SI units, that the columns come from
    speed: str | None  # unit of the velocity, by name or header
    counts: float | None  # of a turn as the file states; nan: it states several numbers

    def beyond(self, q: Array, factor: float) -> str:
        """Return words where a joint would move over more than twice its range, as none does."""
        for values, joint in zip(q.T, () if self.side == "motor" else self.joints, strict=False):
            span, room = float(np.ptp(values)) * factor, joint.position[1] - joint.position[0]
            if math.isfinite(room) and span > EVIDENCE.twice_room * room:
                limits = f"{span:.4g} rad where its limits leave {room:.4g}"
                return f"but joint '{joint.name}' would move over {limits}"
        return ""

    @property
    def by_velocity(self) -> Guess | None:
        """Return the unit that the recorded velocity decides: by its own, or a telling ratio."""
        slope, speed, found = self.slope, self.speed, ""
        if slope is None:
            return None
        if speed in UNITS:
            ratio = UNITS[speed].factor / slope.factor
            sizes = {unit: abs(ratio / size - 1.0) for unit, size in _TURNING.items()}
            unit = min(sizes, key=lambda unit: sizes[unit])
            found = unit if sizes[unit] < EVIDENCE.same_ratio else ""
        else:
            found, speed = units_of_ratio(slope.factor) or ("", "")
        why = f"its slope is {slope.factor:.4g} times the recorded velocity, as with {found}"
        return Guess(found, "likely", f"{why} and {speed}") if found else None


def _unsure(why: str) -> Guess:
    return Guess("", "unsure", why)


def position_unit(q: Array, named: str | None, known: PositionEvidence) -> tuple[Guess, str]:
    """Return the unit of turning joints, "" where it stays open, and further keys of the recipe.

    The keys are counts_per_rev and wrap; `named` is the unit by name or header.
    """
    span = float(np.ptp(q, axis=0).max())
    wrap, by_velocity = rollover(q), known.by_velocity
    further = f", wrap = {wrap:g}" if wrap is not None else ""
    if named == "counts" or (named is None and span > EVIDENCE.counts_span and whole(q)):
        return _counts(q, wrap, named, known)
    if named in _TURNING:
        proved = best_unit(known.fits)
        problem = known.beyond(q, _TURNING[named])
        if not problem and by_velocity and UNITS[by_velocity.value] != UNITS[named]:
            problem = f"but {by_velocity.why}"
        elif not problem and proved in _TURNING and UNITS[proved] != UNITS[named]:
            problem = "but the torque follows from the motion by the robot's links if it is in "
            problem += proved
        if problem:
            said = f"its name or header says '{named}', {problem}"
            return _unsure(f"{said}: another unit, or the motor's side?"), further
        why = f"named so; the largest range is {span:.4g} {named}"
        wide = named == "rad" and span > EVIDENCE.widest_rad
        return Guess(named, "unsure" if wide else "sure", why), further
    if named is not None:
        return _unknown_unit(named), further
    if wrap in (360.0, 2.0 * math.pi):
        why = f"it starts again after {wrap:.4g}, one turn"
        return Guess("rad" if wrap == 2.0 * math.pi else "deg", "likely", why), further
    if by_velocity is not None and not known.beyond(q, _TURNING[by_velocity.value]):
        return by_velocity, further
    if whole(q) and span > EVIDENCE.whole_span:
        why = f"whole numbers over a range of {span:.5g}: counts, or whole degrees?"
        return _unsure(why), further
    return _without_name(q, known), further


def _without_name(q: Array, known: PositionEvidence) -> Guess:
    """Return the unit of positions that no name, header or velocity tells."""
    far = float(np.abs(q).max())  # neither -1..1 nor, of which it would be 6 %, -100..100
    side, message = known.side, known.message
    if side == "motor" or (side == "scaled" and not 1.0 < far <= 2.0 * math.pi):
        return _unsure(_OPEN_SIDES[side])
    if proved := best_unit(known.fits):
        why = f"the torque follows from the motion by the robot's links if it is in {proved}"
        return Guess(proved, "likely", why)
    if turns := quarter_turns(q):
        starts = f"it starts at {', '.join(map(str, turns.values()))} times pi/2"
        asked = "by chance, or radians of the motor side, and these are the gear ratios?"
        return _unsure(f"{starts}: {asked}")
    limited = [(j, x) for j, x in enumerate(known.joints) if all(map(math.isfinite, x.position))]
    if limited and len(known.joints) == q.shape[1]:
        fits = [
            unit
            for unit in ("rad", "deg", "rev")
            if all(_inside(_TURNING[unit] * q[:, j], joint) for j, joint in limited)
        ]
        if "rad" in fits and message and best_unit(known.fits, proved=False) in ("", "rad"):
            why = f"as {message} defines it, and inside the robot's limits"
            return Guess("rad", "likely", why)
        if fits == ["rad"]:
            why = "inside the robot's limits in rad alone, neither in deg nor in rev"
            return Guess("rad", "likely", why)
        if "rad" in fits:
            inside = f"it is inside the robot's limits in {' and '.join(fits)}"
            return _unsure(f"{_NO_UNIT} {inside}: {_LESS_THAN_A_TURN}")
        if "deg" in fits:
            beyond = "beyond the robot's limits in rad, inside them in deg"
            return _unsure(f"{beyond}: deg, or the motor's side in rad?")
        outside = "outside the robot's limits in rad and in deg"
        return _unsure(f"{outside}: motor side, counts, or another robot?")
    if far <= EVIDENCE.one_turn_rad and message:
        return Guess("rad", "likely", f"as {message} defines it, and within {far:.3g}")
    if far <= EVIDENCE.one_turn_rad:
        return _unsure(f"{_NO_UNIT} up to {far:.3g} it may be {_LESS_THAN_A_TURN}")
    if far <= EVIDENCE.most_degrees:
        asked = "deg, turns, or the motor's side in rad, then [drive]?"
        return _unsure(f"{_NO_UNIT} up to {far:.4g} is more than a turn in rad: {asked}")
    return _unsure(f"up to {far:.5g}: neither an arm's in rad nor in deg; motor side, or counts?")


def _unknown_unit(named: str, quantity: str = "") -> Guess:
    """Return an open unit: no unit of the signal is named, or a share of a rated value."""
    share = of_rated(named, quantity)
    what = f"a share: {share}" if share else "which is no unit that import knows here"
    return _unsure(f"its name or header says '{named}', {what}")


def _inside(q: Array, joint: Joint) -> bool:
    """Return whether positions keep a joint's limits, but for a twentieth of its range."""
    low, high = joint.position
    slack = EVIDENCE.limit_slack * (high - low)
    return bool(q.min() >= low - slack and q.max() <= high + slack)


def slide_unit(q: Array, named: str | None, joint: Joint) -> Guess:
    """Return the unit of the position of one sliding joint, "" where it stays open."""
    if named in _LENGTHS:
        return Guess(named, "sure", "named so")
    if named is not None:
        return _unknown_unit(named)
    if all(map(math.isfinite, joint.position)) and _inside(q, joint):
        return Guess("m", "likely", f"inside the limits of sliding joint '{joint.name}' in m")
    return _unsure(f"'{joint.name}' slides: m, cm or mm?")


def _counts(
    q: Array, wrap: float | None, named: str | None, known: PositionEvidence
) -> tuple[Guess, str]:
    """Return the unit of counts and how many make a turn: as stated, by the jumps or the range."""
    span, stated = float(np.ptp(q, axis=0).max()), known.counts
    near = min(EVIDENCE.resolutions, key=lambda r: abs(span - r))
    why = "named so" if named else f"whole numbers over a range of {span:.5g}"
    turn, again = math.nan, None
    if stated is not None and math.isnan(stated):
        why += "; the file states several numbers for a turn"
    elif stated is not None:
        turn = stated
        again = stated if wrap and abs(wrap / stated - 1.0) < EVIDENCE.same_ratio else None
        why += "; so many make a turn as the file states"
    elif wrap is not None:
        turn = again = wrap
        why += f"; it starts again after {wrap:g}, taken for a revolution"
    elif abs(span / near - 1.0) < EVIDENCE.one_turn:
        turn = near
        why += f"; the range of {span:.5g} is likely one revolution of {near}"
        why += "; add wrap where the counter starts again"
    elif named is None:
        asked = "counts (then add counts_per_rev), or thousandths of a degree?"
        return _unsure(f"{why}: {asked}"), ""
    else:
        why += "; the counts of a revolution are in the encoder's data sheet"
    a_turn = f"{turn:.10g}" if math.isfinite(turn) else f'"{BLANK}"'
    further = f", counts_per_rev = {a_turn}"
    further += f", wrap = {again:.10g}" if again is not None else ""
    unwrapped = q if again is None else np.unwrap(q, period=again, axis=0)
    if math.isfinite(turn) and (problem := known.beyond(unwrapped, 2.0 * math.pi / turn)):
        return _unsure(f"{why}; {problem}: turns of the motor, then [drive]?"), further
    sure = named and turn == wrap and stated is None
    return Guess("counts", "sure" if sure else "likely", why), further


def velocity_unit(slope: Slope, position: str) -> str:
    """Return the unit of a velocity by that of its position, "" where their ratio fits none."""
    size = UNITS[position].factor * slope.factor if position in UNITS else math.nan
    off = {unit: abs(size / UNITS[unit].factor - 1.0) for unit in _SPEEDS}
    return next((unit for unit in _SPEEDS if off[unit] <= EVIDENCE.same_ratio), "")


def torque_unit(
    tau: Array, named: str | None, current: bool, fit: LinkFit | None, message: str
) -> Guess:
    """Return the unit of torques, "" where it stays open: by name, or by the robot's links.

    Without a `fit` (links or motion are unknown) the definition of a `message` is enough.
    """
    peak = f"up to {float(np.abs(tau).max()):.4g}"
    unit = named or "N m"
    if quantity_of(unit) not in ("torque", "current"):
        return _unknown_unit(unit, "current" if current else "torque")
    if named is None and current:
        asked = "A, mA, or a share of the drive's rated current?"
        return _unsure(f"named a current; {peak}: {asked}")
    if fit is not None and not current:
        off = unlike_links(fit, UNITS[unit].factor, named is not None)
        if off:
            return _unsure(f"{'named so, but ' if named else ''}{peak} {unit}: {off}")
    if named is not None:
        return Guess(named, "sure", f"named so; {peak} {named}")
    if fit is None and message:
        return Guess("N m", "likely", f"{peak}, as {message} defines it")
    if fit is None:
        asked = "N m of the joint or of the motor, a share of a rated torque, or a current in A?"
        return _unsure(f"{peak}, and no links of a robot to compare with: {asked}")
    why = f"{peak}, and it follows from the motion by weight and inertia of the robot's links"
    known = fit.gains[np.isfinite(fit.gains)]  # a factor that may be theirs, or of another unit
    if known.size:
        why += f", {known.min():.2f} to {known.max():.2f} times what they ask for"
    return Guess("N m", "likely", why)


def whole(values: Array) -> bool:
    """Return whether nearly all numbers are whole."""
    return bool((values == np.round(values)).mean() > EVIDENCE.all_whole)


def is_share(values: Array) -> bool:
    """Return whether numbers keep 0..1, 0..100, or ±, and reach the upper end, unlike joints."""
    low, high, slack = float(values.min()), float(values.max()), EVIDENCE.share
    full = 1.0 if max(high, -low) <= 1.0 + slack else 100.0
    near = (1.0 - slack) * full <= high <= (1.0 + slack) * full
    signed = -(1.0 + slack) * full <= low < -0.7 * full
    return near and (-slack * full <= low < 0.3 * full or signed)
