"""Infer units, rate, sign and side of the chosen columns, each with what it rests on.

Names, lines of the file, limits of the robot, its links and the numbers themselves are clues for
and against each unit (`evidence.weigh`). Where they contradict each other, or say nothing, the
unit is "" and the draft has a blank.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipelines.errors import clean
from pipelines.importers.clock import SECONDS, guess_unit, round_rate
from pipelines.importers.columns import Group, own_units
from pipelines.importers.config import EVIDENCE, SCORES
from pipelines.importers.evidence import (
    OTHER,
    Clue,
    Guess,
    Slope,
    is_share,
    quarter_turns,
    rollover,
    sign_of,
    units_of_ratio,
    unsure,
    weigh,
    whole,
)
from pipelines.importers.links import LinkFit, TorqueModel, best_unit, fits_by_unit, unlike_links
from pipelines.importers.names import quantity_of
from pipelines.importers.notes import (
    Statement,
    stated_counts,
    stated_gear,
    stated_rate,
    stated_scale,
    stated_unit,
)
from pipelines.importers.raw import RawTable
from pipelines.importers.recipe import BLANK
from pipelines.importers.signals import BY_FILE, WITHOUT_NAME, Reading, matrix
from pipelines.io.log import Array
from pipelines.io.robot import Joint, RobotDescription
from pipelines.io.units import UNITS, of_rated

# Mechanics, ROS: velocities in the positions' unit of angle.
_ONE_UNIT = frozenset({"q", "qpos", "jpos", "effort", "efforts"})
_TURNING = {
    unit: UNITS[unit].factor
    for unit in ("rad", "mrad", "deg", "mdeg", "arcmin", "arcsec", "rev", "turn")
}
_LENGTHS = ("m", "cm", "mm", "um")
NAMED = "as named"  # of the units that the torque is compared in
_MOTOR_SIDE = re.compile(
    r"(motor|rotor|drive)[ _-]*(side|shaft|seit)|before the gear", re.IGNORECASE
)

# The torque of a robot's links; None where a link is unknown.
Model = Callable[[RobotDescription], TorqueModel | None]


@dataclass
class Findings:
    """Findings about one recording. Not frozen: later ones rest on earlier ones."""

    reading: Reading
    q: Array | None  # (samples, joints) in recorded units
    tau: Array | None
    joints: tuple[Joint, ...] = ()  # of the robot
    counts: Statement | None = None  # of a turn, as the file states
    rate: float = math.nan  # [Hz] without a clock, or of a counter
    rate_guess: Guess = field(default_factory=lambda: unsure(""))
    clock: Guess = field(default_factory=lambda: unsure(""))
    t: Array | None = None  # [s]
    slope: Slope | None = None  # of q against dq, per second or sample
    fits: dict[str, LinkFit] = field(default_factory=dict)  # by the unit of the positions
    links: LinkFit | None = None  # in the unit of the positions, where that is open the best
    followed: bool = False  # the links confirm torque and motion, in size too
    noted_motor: bool = False  # a line of the file names the motors or a gear
    q_units: list[str] = field(default_factory=list)
    q_keys: str = ""  # further keys of the recipe
    q_guesses: list[Guess] = field(default_factory=list)
    tau_units: list[str] = field(default_factory=list)
    tau_guess: Guess = field(default_factory=lambda: unsure(""))
    tau_scale: Statement | None = None
    current: bool = False
    sign: Guess = field(default_factory=lambda: Guess("as recorded", "unsure", ""))

    @property
    def of_motors(self) -> bool:
        """Return whether positions are the motors', by name, note or the start at quarter turns."""
        group = self.reading.q.group
        if group is None or self.q is None:
            return False
        if (not self.q_guesses[0].value and quarter_turns(self.q)) or self.noted_motor:
            return True
        return group.motor and "theta" not in group.words and not self.followed


def infer(reading: Reading, model: Model | None) -> Findings:
    """Return what names, notes, numbers and links say of a recording's signals."""
    q, tau, arm, notes = reading.q.group, reading.tau.group, reading.arm.robot, reading.table.notes
    found = Findings(
        reading,
        matrix(reading.table, q.columns) if q else None,
        matrix(reading.torque_table, tau.columns) if tau else None,
        arm.joints if arm is not None else (),
        stated_counts(notes),
        current=tau is not None and tau.quantity == "current",
    )
    _time(found)
    if q is not None and found.q is not None:
        _units_of_positions(found, q)  # by name, for the comparison with the links
        found.fits = _fits(found, q, model)
        _units_of_positions(found, q)
        fits = [fit for key, fit in found.fits.items() if key in (NAMED, found.q_units[0])]
        fits = fits or list(found.fits.values())
        fits = [fit for fit in fits if fit.followed] or fits
        varied = (fit for fit in fits if fit.varies)
        found.links = min(varied, key=lambda fit: fit.unexplained, default=None)
    if found.links is not None and found.links.followed and tau is not None:
        known = UNITS.get(named_units(found, tau, reading.torque_table)[0] or "N m")
        found.followed = known is not None and not unlike_links(found.links, known.factor, False)
    said = any(_MOTOR_SIDE.search(note) for note in notes) or stated_gear(notes) is not None
    found.noted_motor = said and not found.followed
    if tau is not None and found.tau is not None:
        _units_of_torques(found, tau, found.tau)
    if found.q is not None and found.tau is not None and found.q.shape == found.tau.shape:
        links = found.links if found.links is not None and found.links.followed else None
        found.sign = sign_of(found.q, found.tau, links.signs if links else None)
    return found


def _time(found: Findings) -> None:
    """Infer the rate, the unit of the clock, the time stamps [s] and the slope per second.

    The rate is that which the file states or, without a clock, a velocity shows; nan where none
    does, or a velocity contradicts it.
    """
    reading, notes = found.reading, found.reading.table.notes
    clock, slope, stated = reading.clock, reading.slope, stated_rate(notes)
    found.slope = slope if clock is None else None
    if stated is not None:
        agrees = clock or slope is None or units_of_ratio(slope.factor * stated.number) is not None
        found.rate = stated.number if math.isfinite(stated.number) and agrees else math.nan
        why = f"the file states {stated.words}"
        found.rate_guess = Guess(f"{found.rate:g} Hz", "likely", why)
    elif clock is None and slope is not None and slope.factor > 0:
        rate = 1.0 / slope.factor
        near = round_rate((1.0 + EVIDENCE.near_rate) * rate)
        if _one_unit_of_angle(found) and abs(rate / near - 1.0) < EVIDENCE.near_rate:
            why = "the recorded velocity is that often the step of the position from sample to "
            why += "sample, if both are in one unit of angle"
            found.rate, found.rate_guess = near, Guess(f"{near:g} Hz", "likely", why)
    if clock is not None:
        found.clock = guess_unit(clock, found.q, slope, notes, stated)
        factor = 1.0 if clock.paired else SECONDS.get(found.clock.value)
        if found.clock.value == "sample" and found.rate > 0.0:
            factor = 1.0 / found.rate
        if factor is not None:
            found.t = clock.values * factor
            found.slope = slope and Slope(slope.factor / factor, slope.correlation)


def _one_unit_of_angle(found: Findings) -> bool:
    """Return whether a velocity without a clock is in the positions' unit, as q and dq are."""
    q, dq, tau = (c.group for c in (found.reading.q, found.reading.dq, found.reading.tau))
    if q is None or dq is None:
        return False
    position, speed = (named_units(found, group, found.reading.table)[0] for group in (q, dq))
    if position or speed:
        return speed == f"{position}/s"
    words = f"{q.words} {tau.words if tau else ''}".split()
    bare = {word.rstrip("0123456789") for word in words}
    return bool(_ONE_UNIT & bare) or bool(found.reading.message)


def statement(found: Findings, group: Group, linear: bool, table: RawTable) -> Statement | None:
    """Return what the file states of a unit; counts are one where it states their size."""
    if group.quantity == "position" and found.counts is not None and not linear:
        return Statement("counts", found.counts.words)
    return stated_unit(table.notes, group.quantity, linear, group.motor)


def named_units(found: Findings, group: Group, table: RawTable) -> list[str | None]:
    """Return the unit of each column by header and name, else by a line of the file."""
    units = []
    for j, own in enumerate(own_units(group.columns, table)):
        linear = j < len(found.joints) and not found.joints[j].revolute
        said = None if own else statement(found, group, linear, table)
        units.append(own or (said.value or None if said else None))
    return units


def unit_of_joint(named: str | None, guessed: str, first: str | None) -> str:
    """Return the unit of one of several columns, "" where only others state one."""
    unit = guessed if named is None else named
    missing = not guessed or (named is None and first is not None)
    return unit if not missing and (unit in UNITS or unit == "counts") else ""


def _fits(found: Findings, group: Group, model: Model | None) -> dict[str, LinkFit]:
    """Return how the torque follows from the links, for each unit the positions may be in."""
    q, tau, robot, table = found.q, found.tau, found.reading.arm.robot, found.reading.table
    if model is None or robot is None or q is None or tau is None or tau.shape != q.shape:
        return {}
    t = table.rows / found.rate if found.t is None else found.t
    torque = model(robot) if all(robot.revolute) else None
    if torque is None or not np.median(np.diff(t)) > 0.0:
        return {}
    sizes = {unit: known.factor for unit, known in UNITS.items()}
    if found.counts and found.counts.number > 0.0:
        sizes["counts"] = 2.0 * math.pi / found.counts.number
    factors = {unit: np.full(found.reading.joints, sizes[unit]) for unit in ("rad", "deg", "rev")}
    if any(named_units(found, group, table)):
        if not set(found.q_units) <= sizes.keys():
            return {}
        factors[NAMED] = np.array([sizes[unit] for unit in found.q_units])
    return fits_by_unit(torque, q, tau, t, factors)


def _as_said(guess: Guess, own: str | None) -> Guess:
    """Return a guess that rests on a line of the file alone as no more than likely."""
    if guess.confidence != "sure" or own is not None:
        return guess
    why = guess.why.replace("named so", "a line of the file says so")
    return replace(guess, confidence="likely", why=why)


def _unknown_unit(named: str, quantity: str = "") -> Guess:
    """Return an open unit: no unit of the signal is named, or a share of a rated value."""
    share = of_rated(named, quantity)
    what = f"a share: {share}" if share else "which is no unit that import knows here"
    return unsure(f"its name or header says '{named}', {what}")


def _units_of_positions(found: Findings, group: Group) -> None:
    """Infer the unit of each joint's position, and further keys of the recipe."""
    assert found.q is not None
    q, table, joints = found.q, found.reading.table, found.joints
    named, own = named_units(found, group, table), own_units(group.columns, table)
    turning = [j for j in range(found.reading.joints) if not joints or joints[j].revolute]
    units, guesses = [""] * found.reading.joints, []
    if turning:
        first = next((j for j in turning if named[j] is not None), turning[0])
        guess, found.q_keys = _turning_unit(found, group, turning, named[first])
        for j in turning:
            units[j] = unit_of_joint(named[j], guess.value, named[first])
        guesses.append(_as_said(guess, own[first]))
    for j in (j for j in range(found.reading.joints) if j not in turning):
        guess, name = unsure(f"'{joints[j].name}' slides: m, cm or mm?"), named[j]
        if name is not None:
            guess = Guess(name, "sure", "named so") if name in _LENGTHS else _unknown_unit(name)
        elif all(map(math.isfinite, joints[j].position)) and _inside(q[:, j], joints[j]):
            why = f"inside the limits of sliding joint '{joints[j].name}' in m"
            guess = Guess("m", "likely", why)
        units[j] = guess.value
        guesses.append(_as_said(guess, own[j]))
    if shares := _shares(found, own):
        units = ["" if j in shares else unit for j, unit in enumerate(units)]
        which = ", ".join(clean(group.columns[j], 40) for j in shares)
        near = f"{which}: up to {np.abs(q[:, shares]).max():.3g}, near 1 or 100"
        asked = "a gripper's opening or a share of a range, rather than a joint's angle?"
        guesses.append(unsure(f"{near}: {asked}"))
    found.q_units, found.q_guesses = units, guesses


def _shares(found: Findings, own: Sequence[str | None]) -> list[int]:
    """Return the joints that move like a share of a range, of no robot and without a unit."""
    if found.q is None or found.joints:
        return []
    like = [j for j in range(found.reading.joints) if own[j] is None and is_share(found.q[:, j])]
    return like if len(like) < found.reading.joints else []


def _inside(q: Array, joint: Joint) -> bool:
    """Return whether positions keep a joint's limits, but for a twentieth of its range."""
    low, high = joint.position
    slack = EVIDENCE.limit_slack * (high - low)
    return bool(q.min() >= low - slack and q.max() <= high + slack)


def _beyond(q: Array, factor: float, group: Group, joints: Sequence[Joint]) -> str:
    """Return words where a joint would move over more than twice its range, as none does."""
    for values, joint in zip(q.T, () if group.motor else joints, strict=False):
        span, room = float(np.ptp(values)) * factor, joint.position[1] - joint.position[0]
        if math.isfinite(room) and span > EVIDENCE.twice_room * room:
            limits = f"{span:.4g} rad where its limits leave {room:.4g}"
            return f"but joint '{joint.name}' would move over {limits}"
    return ""


def _by_velocity(found: Findings, first: int) -> Guess:
    """Return the unit of positions that the recorded velocity decides, by its unit or a ratio."""
    group, slope = found.reading.dq.group, found.slope
    if group is None or slope is None or found.t is None:
        return unsure("")
    speeds = named_units(found, group, found.reading.table)
    speed = speeds[min(first, len(speeds) - 1)]
    unit, words = "", speed
    if speed in UNITS:
        ratio = UNITS[speed].factor / slope.factor
        sizes = {unit: abs(ratio / size - 1.0) for unit, size in _TURNING.items()}
        unit = min(sizes, key=lambda unit: sizes[unit])
        unit = unit if sizes[unit] < EVIDENCE.same_ratio else ""
    else:
        unit, words = units_of_ratio(slope.factor) or ("", "")
    why = f"its slope is {slope.factor:.4g} times the recorded velocity, as with {unit} and {words}"
    return Guess(unit, "likely", why)


def _turning_unit(
    found: Findings, group: Group, turning: Sequence[int], named: str | None
) -> tuple[Guess, str]:
    """Return the unit of turning joints, "" where it stays open, and further keys of the recipe.

    The keys are counts_per_rev and wrap; `named` is the unit by name, header or line.
    """
    assert found.q is not None
    q, joints = found.q[:, turning], [found.joints[j] for j in turning] if found.joints else []
    span, wrap = float(np.ptp(q, axis=0).max()), rollover(q)
    further = f", wrap = {wrap:g}" if wrap is not None else ""
    if named == "counts" or (named is None and span > EVIDENCE.counts_span and whole(q)):
        return _counts(found, q, wrap, group, joints, named)
    by_velocity, proved = _by_velocity(found, turning[0]), best_unit(found.fits)
    by_links = "the torque follows from the motion by the robot's links if it is in"
    if named is not None and named not in _TURNING:
        return _unknown_unit(named), further
    if named is not None:
        problem = _beyond(q, _TURNING[named], group, joints)
        if not problem and by_velocity.value and UNITS[by_velocity.value] != UNITS[named]:
            problem = f"but {by_velocity.why}"
        if not problem and proved in _TURNING and UNITS[proved] != UNITS[named]:
            problem = f"but {by_links} {proved}"
        if problem:
            said = f"its name or header says '{named}', {problem}"
            return unsure(f"{said}: another unit, or the motor's side?"), further
        return Guess(named, "sure", f"named so; the largest range is {span:.4g} {named}"), further
    clues = _clues_of_size(found, q, group, joints, bool(proved))
    if wrap in (360.0, 2.0 * math.pi):
        unit = "rad" if wrap == 2.0 * math.pi else "deg"
        clues.append(Clue(unit, SCORES.stated, f"it starts again after {wrap:.4g}, one turn"))
    if by_velocity.value and not _beyond(q, _TURNING[by_velocity.value], group, joints):
        clues.append(Clue(by_velocity.value, SCORES.stated, by_velocity.why))
    if proved:
        clues.append(Clue(proved, SCORES.fits, f"{by_links} {proved}"))
    return weigh(clues), further


def _clues_of_size(
    found: Findings, q: Array, group: Group, joints: Sequence[Joint], proved: bool
) -> list[Clue]:
    """Return the clues of size, limits, side and message to a unit of positions without one."""
    clues, message = [], found.reading.message
    far, span = float(np.abs(q).max()), float(np.ptp(q, axis=0).max())
    # neither -1..1 nor, of which it would be 6 %, -100..100
    if group.scaled and not 1.0 < far <= 2.0 * math.pi:
        why = "data sets of robot learning also scale positions to -1..1 or -100..100"
        clues.append(Clue(OTHER, SCORES.doubt, why))
    elif group.motor:
        why = "named a motor's or an encoder's, whose turns no limit of a joint bounds: rad, deg "
        clues.append(Clue(OTHER, SCORES.doubt, why + "or rev?"))
    elif (turns := quarter_turns(q)) and not proved:
        why = f"it starts at {', '.join(map(str, turns.values()))} times pi/2: by chance, or "
        why += "radians of the motor side, and these are the gear ratios?"
        clues.append(Clue(OTHER, SCORES.doubt, why))
    if whole(q) and span > EVIDENCE.whole_span:
        why = f"whole numbers over a range of {span:.5g}: counts, or whole degrees?"
        clues.append(Clue(OTHER, SCORES.doubt, why))
    limited = [(j, x) for j, x in enumerate(joints) if all(map(math.isfinite, x.position))]
    if limited:
        units = ("rad", "deg", "rev")
        fits = [u for u in units if all(_inside(_TURNING[u] * q[:, j], x) for j, x in limited)]
        small = "rad" in fits
        why = f"it is inside the robot's limits in {' and '.join(fits)}" if fits else ""
        if fits == ["rad"]:
            why = "inside the robot's limits in rad alone, neither in deg nor in rev"
            clues.append(Clue("rad", SCORES.fits, why))
            why = ""
        elif not small:
            why = "beyond the robot's limits in rad" + ", inside them in deg" * bool(fits)
            why += ": deg, motor side, counts, or another robot?"
    else:
        small, why = far <= EVIDENCE.one_turn_rad, f"up to {far:.4g}"
        if not small:
            why += " is more than a turn in rad: deg, turns, counts, or the motor's side?"
    if small and why:
        why = f"no unit is stated, and {why}: rad, or the degrees of a small motion, or turns as "
        why += "servo drives count?"
    clues.append(Clue("rad", 0.0 if small else -SCORES.fits, why))
    if message and best_unit(found.fits, proved=False) in ("", "rad"):
        clues.append(Clue("rad", SCORES.fits, f"as {message} defines it, and within {far:.3g}"))
    return clues


def _counts(
    found: Findings,
    q: Array,
    wrap: float | None,
    group: Group,
    joints: Sequence[Joint],
    named: str | None,
) -> tuple[Guess, str]:
    """Return the unit of counts and how many make a turn: as stated, by the jumps or the range."""
    span, stated = float(np.ptp(q, axis=0).max()), found.counts.number if found.counts else None
    near = min(EVIDENCE.resolutions, key=lambda r: abs(span - r))
    why = "named so" if named else f"whole numbers over a range of {span:.5g}"
    turn, again = math.nan, None
    if stated is not None:
        turn = stated
        again = stated if wrap and abs(wrap / stated - 1.0) < EVIDENCE.same_ratio else None
        several = "the file states several numbers for a turn"
        why += "; " + (several if math.isnan(stated) else "so many make a turn as the file states")
    elif wrap is not None:
        turn = again = wrap
        why += f"; it starts again after {wrap:g}, taken for a revolution"
    elif abs(span / near - 1.0) < EVIDENCE.one_turn:
        turn = near
        why += f"; the range of {span:.5g} is likely one revolution of {near}"
        why += "; add wrap where the counter starts again"
    elif named is None:
        asked = "counts (then add counts_per_rev), or thousandths of a degree?"
        return unsure(f"{why}: {asked}"), ""
    else:
        why += "; the counts of a revolution are in the encoder's data sheet"
    a_turn = f"{turn:.10g}" if math.isfinite(turn) else f'"{BLANK}"'
    further = f", counts_per_rev = {a_turn}" + (f", wrap = {again:.10g}" if again else "")
    unwrapped = q if again is None else np.unwrap(q, period=again, axis=0)
    if math.isfinite(turn) and (problem := _beyond(unwrapped, 2.0 * math.pi / turn, group, joints)):
        return unsure(f"{why}; {problem}: turns of the motor, then [drive]?"), further
    sure = named and turn == wrap and stated is None
    return Guess("counts", "sure" if sure else "likely", why), further


def _units_of_torques(found: Findings, group: Group, tau: Array) -> None:
    """Infer the unit of each joint's torque or current, and the scale of raw numbers."""
    table = found.reading.torque_table
    named = named_units(found, group, table)
    scales = stated_scale(table.notes, group.quantity) if None in named and whole(tau) else []
    if len(scales) == 1:
        found.tau_scale, named = scales[0], [unit or scales[0].value for unit in named]
    found.tau_guess = guess = _torque_unit(found, group, tau, named[0])
    found.current = guess.value in ("A", "mA", "Arms") or (found.current and not guess.value)
    first = next(filter(None, named), None)
    units = [unit_of_joint(unit, guess.value, first) for unit in named]
    if found.q is not None and found.q.shape == tau.shape:
        shares = _shares(found, own_units(group.columns, table))
        units = ["" if j in shares else unit for j, unit in enumerate(units)]
    if guess.value == "N m" and found.joints:
        pairs = zip(units, found.joints, strict=True)
        units = ["N" if unit == "N m" and not joint.revolute else unit for unit, joint in pairs]
    found.tau_units = units


def _torque_unit(found: Findings, group: Group, tau: Array, named: str | None) -> Guess:
    """Return the unit of torques: by name, or by the robot's links; "" where it stays open.

    Where links or motion are unknown, the definition of a message is enough.
    """
    fit, message, unit = found.links, found.reading.message, named or "N m"
    peak = f"up to {float(np.abs(tau).max()):.4g}"
    if quantity_of(unit) not in ("torque", "current"):
        return _unknown_unit(unit, "current" if found.current else "torque")
    if named is None and group.words == WITHOUT_NAME:
        asked = "neither position nor velocity: a torque in N m, or a current in A?"
        return unsure(f"{peak}, {asked}")
    if named is None and group.words == BY_FILE:
        file = clean(found.reading.torque_table.source, 60)
        asked = f"of a file named '{file}': a torque in N m, or a current in A?"
        return unsure(f"{peak}, {asked}")
    if named is None and found.current:
        return unsure(f"named a current; {peak}: A, mA, or a share of the drive's rated current?")
    off = unlike_links(fit, UNITS[unit].factor, named is not None) if fit else ""
    if off and not found.current:
        return unsure(f"{'named so, but ' if named else ''}{peak} {unit}: {off}")
    if named is not None:
        guess = Guess(named, "sure", f"named so; {peak} {named}")
        if found.noted_motor or (group.motor and not found.current and not found.followed):
            why = f"{guess.why}: at the joint, or on the motor's shaft?"
            return replace(guess, confidence="unsure", why=why)
        return _as_said(guess, own_units(group.columns, found.reading.torque_table)[0])
    if found.joints and found.q is not None and "" in found.q_units:  # outside of the limits
        asked = "N m of the joint, or of the motor's shaft, as the positions may be?"
        return unsure(f"{peak}: {asked}")
    if fit is None and message:
        return Guess("N m", "likely", f"{peak}, as {message} defines it")
    if fit is None:
        asked = "N m of the joint or of the motor, a share of a rated torque, or a current in A?"
        return unsure(f"{peak}, and no links of a robot to compare with: {asked}")
    why = f"{peak}, and it follows from the motion by weight and inertia of the robot's links"
    if fit.known_gains.size:  # a factor that may be theirs, or of another unit
        low, high = fit.known_gains.min(), fit.known_gains.max()
        why += f", {low:.2f} to {high:.2f} times what they ask for"
    return Guess("N m", "likely", why)
