"""Judge what unit the numbers of a column are in, by what a robot can do."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from pipelines.log.experiment import Array
from pipelines.log.recording.link_evidence import LinkFit, best_unit, unlike_links
from pipelines.log.recording.recipe_reader import BLANK
from pipelines.log.robot import Joint
from pipelines.log.units import UNITS, of_rated

__all__ = [
    "Guess",
    "Slope",
    "crossed",
    "held",
    "position_unit",
    "quarter_turns",
    "rollover",
    "sign_of",
    "slide_unit",
    "slope_of",
    "torque_unit",
    "units_of_ratio",
    "unknown_unit",
    "velocity_unit",
]

Confidence = Literal["sure", "likely", "unsure"]
Side = Literal["joint", "motor", "scaled", ""]  # of the gear, as far as names say it
_OPEN_SIDES = {
    "motor": "named a motor's or an encoder's, whose turns no limit of a joint bounds: rad, deg or rev?",
    "scaled": "data sets of robot learning also scale positions to -1..1 or -100..100",
}
_RESOLUTIONS = (4096, 8192, 16384, 2048, 1024, 65536, 131072, 262144, 1048576, 4000, 10000, 20000)


@dataclass(frozen=True)
class Guess:
    """A value with how sure it is and why."""

    value: str
    confidence: Confidence
    why: str


_NO_UNIT = "no unit is stated, and"
_LESS_THAN_A_TURN = "rad, or the degrees of a small motion, or turns as servo drives count?"


def rollover(values: Array) -> float | None:
    """The size of the jumps where a counter starts again: several times larger than any step, and all alike."""
    steps = np.diff(values, axis=0)
    size = float(np.ptp(values))
    jumps = np.abs(steps[np.abs(steps) > 0.8 * size]) if size > 0 else np.empty(0)
    others = np.abs(steps[np.abs(steps) <= 0.8 * size])
    if (
        not jumps.size
        or (others.size and others.max() > 0.2 * size)
        or np.ptp(jumps) > 0.1 * jumps.mean()
    ):
        return None
    if (np.abs(steps[1:] + steps[:-1])[np.abs(steps[1:]) > 0.8 * size] < 0.2 * size).any():
        return None  # there and back again: numbers that mark a lost sample
    candidates = (360.0, 2 * math.pi, 1.0, *map(float, _RESOLUTIONS))
    near = min(candidates, key=lambda c: abs(jumps.max() - c) / c)
    return near if abs(jumps.max() - near) / near < 0.1 else float(jumps.max())


# Slope of the position over recorded velocity, by their units: q in the first, dq in the second.
_ANGULAR_RATIOS = {
    1.0: ("", ""),
    180.0 / math.pi: ("deg", "rad/s"),
    math.pi / 180.0: ("rad", "deg/s"),
    1.0 / 60.0: ("rev", "rpm"),
    6.0: ("deg", "rpm"),
    math.pi / 30.0: ("rad", "rpm"),
}
_ONE_TURN = (
    5e-3  # by so much the range of one recorded revolution differs from the encoder's resolution
)
_TURNING = {
    unit: UNITS[unit].factor
    for unit in ("rad", "mrad", "deg", "mdeg", "arcmin", "arcsec", "rev", "turn")
}
_WIDEST = 400.0  # [rad] range of a motor in a recording, of one in rad; others are named on purpose
_SPEEDS = ("rad/s", "deg/s", "rev/s", "rpm", "mrad/s", "mdeg/s")
_STRETCHES = (200, 60, 20)  # parts of a recording over which a velocity is summed
_LIKE = 0.95  # correlation over which one block is the slope of another
_SAME_RATIO = 0.1  # scatter of the ratio over the joints
_FALSE_SIGN = 1e-3  # chance that a recording without friction is given a sign


@dataclass(frozen=True)
class Slope:
    """How far a velocity is the slope of a position: q[k] - q[l] = factor times the integral of dq."""

    factor: float  # [unit of q / (unit of dq times unit of t)]
    correlation: float  # the lowest of the joints that move


def slope_of(q: Array, dq: Array, t: Array | None, every: bool = False) -> Slope | None:
    """Return the relation of `dq` to `q` (samples, joints); None where it is not its slope.

    Both are compared over stretches of the recording, short ones first: the integral form does not
    amplify the steps of an encoder as a difference of neighbours does. With `every`, columns that
    hardly move beside the others must agree as well: they may be something else.
    """
    clock = np.arange(len(q), dtype=np.float64) if t is None else t
    if q.shape != dq.shape or len(q) < 50:
        return None
    summed = np.concatenate(
        [
            np.zeros((1, q.shape[1])),
            np.cumsum(0.5 * (dq[1:] + dq[:-1]) * np.diff(clock)[:, None], axis=0),
        ]
    )
    least = 0.0 if every else 1e-3
    moving = (np.ptp(q, axis=0) > least * np.ptp(q)) & (np.ptp(dq, axis=0) > least * np.ptp(dq))
    if not moving.any():
        return None
    widths = sorted({max(2, len(q) // share) for share in _STRETCHES})
    found = (_slope_over(q[:, moving], summed[:, moving], width) for width in widths)
    return next((slope for slope in found if slope is not None), None)


def _slope_over(q: Array, summed: Array, width: int) -> Slope | None:
    """The relation over stretches of `width` samples; `summed` is the integral of the velocity."""
    moved, expected = q[width:] - q[:-width], summed[width:] - summed[:-width]
    power = (expected**2).sum(axis=0)
    inner = (moved * expected).sum(axis=0)
    size = np.sqrt(power * (moved**2).sum(axis=0))
    if not (size > 0).all():
        return None
    correlation, factors = inner / size, inner / power
    factor = float(inner.sum() / power.sum())
    if correlation.min() < _LIKE or np.abs(factors / factor - 1.0).max() > _SAME_RATIO:
        return None
    return Slope(factor, float(correlation.min()))


def position_unit(
    q: Array,
    slope: Slope | None,
    named: str | None,
    joints: Sequence[Joint] = (),
    side: Side = "joint",
    fits: Mapping[str, LinkFit] | None = None,
    message: str = "",
    speed: str | None = None,
    counts: float = math.nan,
) -> tuple[Guess, str]:
    """The unit of the positions of turning joints, "" where it stays open, and further keys of the recipe (counts_per_rev, wrap).

    `slope` is the relation of a recorded velocity where the unit of time is known; `joints` are those of the robot;
    `side` is what the names say: only of a joint does its range of motion say anything. `fits` compare the torque with
    the robot's links for units that positions can have; `message` names the definition of the messages, in SI units, that
    the columns come from; `speed` is the unit of the recorded velocity, `counts` of a turn, where the file states them (0:
    it states several).
    """
    span = float(np.ptp(q, axis=0).max())
    wrap = rollover(q)
    further = f", wrap = {wrap:g}" if wrap is not None else ""
    if named == "counts" or (named is None and span > 2000.0 and _whole(q)):
        return _counts(q, wrap, named, counts, () if side == "motor" else joints)
    if named in _TURNING:
        problem = "" if side == "motor" else _beyond(q, joints, _TURNING[named])
        problem = problem or _denied(named, slope, speed, fits or {})
        if problem:
            return Guess(
                "",
                "unsure",
                f"its name or header says '{named}', {problem}: another unit, or the motor's side?",
            ), further
        return Guess(
            named,
            "sure" if named != "rad" or span <= _WIDEST else "unsure",
            f"named so; the largest range is {span:.4g} {named}",
        ), further
    if named is not None:
        return unknown_unit(named), further
    if wrap in (360.0, 2.0 * math.pi):
        return Guess(
            "deg" if wrap == 360.0 else "rad",
            "likely",
            f"it starts again after {wrap:.4g}, one turn",
        ), further
    if (
        slope is not None
        and (found := _by_velocity(slope, speed)) is not None
        and not (side != "motor" and _beyond(q, joints, _TURNING[found.value]))
    ):
        return found, further
    if _whole(q) and span > 10.0:
        return Guess(
            "", "unsure", f"whole numbers over a range of {span:.5g}: counts, or whole degrees?"
        ), further
    far = float(np.abs(q).max())  # neither -1..1 nor, of which it would be 6 %, -100..100
    if side == "motor" or (side == "scaled" and not 1.0 < far <= 2.0 * math.pi):
        return Guess("", "unsure", _OPEN_SIDES[side]), further
    unit, proved = best_unit(fits or {})
    if proved:
        return Guess(
            unit,
            "likely",
            f"the torque follows from the motion by the robot's links if it is in {unit}",
        ), further
    if turns := quarter_turns(q):
        return Guess(
            "",
            "unsure",
            f"it starts at {', '.join(map(str, turns.values()))} times pi/2: by chance, or radians of the "
            "motor side, and these are the gear ratios?",
        ), further
    return _by_limits(q, joints, message if unit in ("", "rad") else "") or _by_size(
        far, message
    ), further


def _denied(named: str, slope: Slope | None, speed: str | None, fits: Mapping[str, LinkFit]) -> str:
    """Say what speaks against a unit that is named: a recorded velocity, or the torque; "" where nothing does."""
    if (
        slope is not None
        and (found := _by_velocity(slope, speed)) is not None
        and UNITS[found.value] != UNITS[named]
    ):
        return f"but {found.why}"
    unit, proved = best_unit(fits)
    if proved and unit in _TURNING and UNITS[unit] != UNITS[named]:
        return f"but the torque follows from the motion by the robot's links if it is in {unit}"
    return ""


def unknown_unit(named: str, quantity: str = "") -> Guess:
    """An open unit: what the file says is no unit of the signal, or a share of a rated value."""
    share = of_rated(named, quantity)
    message = f"its name or header says '{named}', " + (
        f"a share: {share}" if share else "which is no unit that import knows here"
    )
    return Guess("", "unsure", message)


def _inside(q: Array, joint: Joint) -> bool:
    """Tell whether positions keep the limits of a joint, but for a twentieth of its range."""
    low, high = joint.position
    slack = 0.05 * (high - low)
    return bool(q.min() >= low - slack and q.max() <= high + slack)


def _beyond(q: Array, joints: Sequence[Joint], factor: float) -> str:
    """Say that a joint would move over more than twice its range, as no joint does; "" where none would."""
    for values, joint in zip(q.T, joints, strict=False):
        span, room = float(np.ptp(values)) * factor, joint.position[1] - joint.position[0]
        if math.isfinite(room) and span > 2.0 * room:
            return f"but joint '{joint.name}' would move over {span:.4g} rad where its limits leave {room:.4g}"
    return ""


def _by_limits(q: Array, joints: Sequence[Joint], message: str) -> Guess | None:
    """The unit under which the motion keeps the robot's limits; a small motion keeps them in any."""
    limited = [
        (j, joint) for j, joint in enumerate(joints) if all(map(math.isfinite, joint.position))
    ]
    if not limited or len(joints) != q.shape[1]:
        return None
    fits = [
        unit
        for unit in ("rad", "deg", "rev")
        if all(_inside(_TURNING[unit] * q[:, j], joint) for j, joint in limited)
    ]
    if "rad" in fits and message:
        return Guess("rad", "likely", f"as {message} defines it, and inside the robot's limits")
    if fits == ["rad"]:
        problem_text = "inside the robot's limits in rad alone, neither in deg nor in rev"
        return Guess("rad", "likely", problem_text)
    if "rad" in fits:
        problem_text = f"{_NO_UNIT} it is inside the robot's limits in {' and '.join(fits)}: {_LESS_THAN_A_TURN}"
        return Guess("", "unsure", problem_text)
    if "deg" in fits:
        problem_text = (
            "beyond the robot's limits in rad, inside them in deg: deg, or the motor's side in rad?"
        )
        return Guess("", "unsure", problem_text)
    problem_text = (
        "outside the robot's limits in rad and in deg: motor side, counts, or another robot?"
    )
    return Guess("", "unsure", problem_text)


def _by_size(far: float, message: str) -> Guess:
    """The unit by what a joint can do, where no limits are known."""
    if far <= 2.05 * math.pi and message:
        return Guess("rad", "likely", f"as {message} defines it, and within {far:.3g}")
    if far <= 2.05 * math.pi:
        return Guess("", "unsure", f"{_NO_UNIT} up to {far:.3g} it may be {_LESS_THAN_A_TURN}")
    if far <= 720.0:
        problem_text = (
            f"{_NO_UNIT} up to {far:.4g} is more than a turn in rad: deg, turns, or the motor's side "
            "in rad, then [drive]?"
        )
        return Guess("", "unsure", problem_text)
    problem_text = f"up to {far:.5g}: neither an arm's in rad nor in deg; motor side, or counts?"
    return Guess("", "unsure", problem_text)


def slide_unit(q: Array, named: str | None, joint: Joint) -> Guess:
    """The unit of the position of one sliding joint, "" where it stays open."""
    if named in ("m", "cm", "mm", "um"):
        return Guess(named, "sure", "named so")
    if named is not None:
        return unknown_unit(named)
    if all(map(math.isfinite, joint.position)) and _inside(q, joint):
        return Guess("m", "likely", f"inside the limits of sliding joint '{joint.name}' in m")
    return Guess("", "unsure", f"'{joint.name}' slides: m, cm or mm?")


def quarter_turns(q: Array) -> dict[int, int]:
    """Robots rest at right angles: a motor then stands at its gear ratio times quarter turns, in rad.

    Returns:
        joint (from 0) -> quarter turns at the start, of those that stand far from zero; empty where one is at none, or
        only one does, as by chance.
    """
    far = np.flatnonzero(np.abs(q[0]) > 4.0 * math.pi)
    start = q[0][far] / (0.5 * math.pi)
    if start.size < 2 or np.abs(start - np.round(start)).max() > 2e-3:
        return {}
    return {int(j): int(x) for j, x in zip(far, np.round(start), strict=True)}


def held(tau: Array, q: Array) -> Guess:
    """Return whether a torque is a command that is held: then it stands still over samples in which the position moves."""
    moving = np.abs(np.diff(q, axis=0)) > 0
    both = (
        np.diff(tau, axis=0)[moving[:, : tau.shape[1]]]
        if tau.shape == q.shape
        else np.diff(tau, axis=0).ravel()
    )
    share = float(np.mean(both == 0)) if both.size else 0.0
    if share > 0.4 and np.unique(tau).size > 50:
        message = (
            f"{100 * share:.0f} % of the steps between samples are zero while the position "
            "moves: a command, held over several samples, or a measurement from a slower bus?"
        )
        return Guess("held-command", "unsure", message)
    message = (
        'nothing in the numbers tells; ask who recorded them: "held-command" where this is what '
        "the drive was commanded, to be held until the next sample"
    )
    return Guess("measured", "unsure", message)


def _counts(
    q: Array, wrap: float | None, named: str | None, stated: float, joints: Sequence[Joint]
) -> tuple[Guess, str]:
    """Return the unit of counts and how many make a turn: as stated, as they start again, or over which they range."""
    span = float(np.ptp(q, axis=0).max())
    near = min(_RESOLUTIONS, key=lambda r: abs(span - r))
    why, turn, again = (
        "named so" if named else f"whole numbers over a range of {span:.5g}",
        math.nan,
        None,
    )
    if stated == 0.0:
        why += "; the file states several numbers for a turn"
    elif math.isfinite(stated):
        turn, again = (
            stated,
            stated if wrap is not None and abs(wrap / stated - 1.0) < 0.1 else None,
        )
        why += "; so many make a turn as the file states"
    elif wrap is not None:
        turn = again = wrap
        why += f"; it starts again after {wrap:g}, taken for a revolution"
    elif abs(span / near - 1.0) < _ONE_TURN:
        turn = near
        why += f"; the range of {span:.5g} is likely one revolution of {near}; add wrap where the counter starts again"
    elif named is None:
        return Guess(
            "", "unsure", f"{why}: counts (then add counts_per_rev), or thousandths of a degree?"
        ), ""
    else:
        why += "; the counts of a revolution are in the encoder's data sheet"
    further = (
        f", counts_per_rev = {turn:.10g}"
        if math.isfinite(turn)
        else f', counts_per_rev = "{BLANK}"'
    )
    further += f", wrap = {again:.10g}" if again is not None else ""
    whole = q if again is None else np.unwrap(q, period=again, axis=0)
    if math.isfinite(turn) and (problem := _beyond(whole, joints, 2.0 * math.pi / turn)):
        return Guess("", "unsure", f"{why}; {problem}: turns of the motor, then [drive]?"), further
    return Guess(
        "counts", "sure" if named and turn == wrap and not math.isfinite(stated) else "likely", why
    ), further


def units_of_ratio(factor: float, tolerance: float = 0.1) -> tuple[str, str] | None:
    """The units of position and velocity that are a factor apart, ("", "") where both have one unit of angle, else None.

    A power of ten is none of angles, but of a wrong unit of time: 0.1 is not the 0.105 of rad and rpm.
    """
    nearest = min(_ANGULAR_RATIOS, key=lambda ratio: abs(factor / ratio - 1.0))
    if factor > 0 and abs(factor / nearest - 1.0) > abs(
        factor / 10.0 ** round(math.log10(factor)) - 1.0
    ):
        return None
    return _ANGULAR_RATIOS[nearest] if abs(factor / nearest - 1.0) <= tolerance else None


def _by_velocity(slope: Slope, speed: str | None) -> Guess | None:
    """The unit that the recorded velocity decides: its own, where the file states one, or one of a telling ratio."""
    if speed in UNITS:
        sizes = {
            unit: abs(UNITS[speed].factor / slope.factor / size - 1.0)
            for unit, size in _TURNING.items()
        }
        unit = min(sizes, key=lambda unit: sizes[unit])
        found = unit if sizes[unit] < _SAME_RATIO else ""
    else:
        found, speed = units_of_ratio(slope.factor) or ("", "")
    if not found:
        return None
    message = (
        f"its slope is {slope.factor:.4g} times the recorded velocity, as with {found} and {speed}"
    )
    return Guess(found, "likely", message)


def crossed(q: Array, dq: Array, t: Array | None) -> tuple[int, int] | None:
    """Return two joints (from 0) of which the position of one has the velocity of the other for its slope."""
    for j, k in itertools.permutations(range(q.shape[1]), 2):
        if (
            slope_of(q[:, [j]], dq[:, [k]], t) is not None
            and slope_of(q[:, [j]], dq[:, [j]], t) is None
        ):
            return j, k
    return None


def velocity_unit(slope: Slope, position: str) -> str:
    """The unit of a velocity by that of the position whose slope it is, "" where their ratio fits none."""
    size = UNITS[position].factor * slope.factor if position in UNITS else math.nan
    near = [unit for unit in _SPEEDS if abs(size / UNITS[unit].factor - 1.0) <= _SAME_RATIO]
    return near[0] if near else ""


def torque_unit(
    tau: Array, named: str | None, current: bool, fit: LinkFit | None, message: str
) -> Guess:
    """The unit of torques, "" where it stays open: by name, by what the robot's own links ask for.

    `fit` is None where links or motion are unknown; the definition of a `message` is then taken at its word.
    """
    peak = float(np.abs(tau).max())
    unit = named or "N m"
    if named is not None and (
        named not in UNITS or UNITS[named].quantity not in ("torque", "current")
    ):
        return unknown_unit(named, "current" if current else "torque")
    if named is None and current:
        problem_text = (
            f"named a current; up to {peak:.4g}: A, mA, or a share of the drive's rated current?"
        )
        return Guess("", "unsure", problem_text)
    off = (
        ""
        if fit is None or unit not in UNITS or current
        else unlike_links(fit, UNITS[unit].factor, named is not None)
    )
    if off:
        problem_text = f"{'named so, but ' if named else ''}up to {peak:.4g} {unit}: {off}"
        return Guess("", "unsure", problem_text)
    if named is not None:
        return Guess(named, "sure", f"named so; up to {peak:.4g} {named}")
    if fit is None and message:
        return Guess("N m", "likely", f"up to {peak:.4g}, as {message} defines it")
    if fit is None:
        problem_text = (
            f"up to {peak:.4g}, and no links of a robot to compare with: N m of the joint or of the "
            "motor, a share of a rated torque, or a current in A?"
        )
        return Guess("", "unsure", problem_text)
    problem_text = f"up to {peak:.4g}, and it follows from the motion by weight and inertia of the robot's links"
    return Guess("N m", "likely", problem_text)


def sign_of(q: Array, tau: Array, links: Array | None = None) -> Guess:
    """The sign of each joint's torque, by the links of the robot where they tell it (`links`: -1, 0, 1), else by friction.

    Dry friction turns with the speed: where a joint reverses, its torque jumps the same way, and all else is smooth.

    About each reversal, tau = a + b k + c k² + d k³ + F sign(dq); F is positive (Coulomb's law; Armstrong-Hélouvry 1991).
    Student's test of the mean F of a joint's reversals, at `_FALSE_SIGN` over all joints. A jump that fits better
    elsewhere than at the reversal is no friction at it: the position leads or lags the torque.
    """
    from scipy.special import stdtr

    half = max(6, len(q) // 200)
    step = max(1, half // 10)
    shifts = step * np.arange(-(half // 2 // step), half // 2 // step + 1)
    smooth = np.ones(max(3, half // 2)) / max(3, half // 2)
    claims = np.zeros(q.shape[1])  # sign of F where it is significant
    for j in range(q.shape[1]):
        speed = np.gradient(np.convolve(q[:, j], smooth, mode="same"))
        jumps, residuals = _jumps(speed, tau[:, j], half, shifts)
        if len(jumps) < 3 or shifts[np.argmin(residuals)] != 0:
            continue
        mean, error = float(np.mean(jumps)), float(np.std(jumps, ddof=1)) / math.sqrt(len(jumps))
        chance = 2.0 * stdtr(len(jumps) - 1, -abs(mean) / max(error, 1e-300))
        claims[j] = np.sign(mean) if chance < _FALSE_SIGN / q.shape[1] else 0.0
    weight = np.zeros(q.shape[1]) if links is None else links
    signs = np.where(weight != 0.0, weight, claims)
    wrong = ", ".join(str(j + 1) for j in np.flatnonzero(signs < 0))
    if (weight * claims < 0).any():
        message = "sign: friction and the robot's links tell opposite signs of a joint"
        return Guess("sign = -1?", "unsure", message)
    if wrong and (weight[signs < 0] < 0).all():
        message = f"sign: torque of joint {wrong} follows the robot's own links with the other sign"
        return Guess(
            f"[{', '.join('-1' if sign < 0 else '1' for sign in signs)}]", "likely", message
        )
    if wrong:
        message = (
            f"torque of joint {wrong} jumps against the speed where it reverses, unlike friction: "
            "sign = -1 there, unless its transmission is negative"
        )
        return Guess("sign = -1?", "likely", message)
    if (weight > 0).all():
        return Guess("as recorded", "likely", "sign: torque follows the robot's own links")
    if (claims > 0).all():
        message = "sign: torque jumps with the speed where a joint reverses, as friction does"
        return Guess("as recorded", "likely", message)
    return Guess("as recorded", "unsure", "sign: torque and motion do not tell")


def _jumps(
    speed: Array, tau: Array, half: int, shifts: npt.NDArray[np.int64]
) -> tuple[Array, Array]:
    """Return F of each clean reversal, and the squared residual of all with the jump moved by each shift."""
    k = np.linspace(-1.0, 1.0, 2 * half + 1)
    jumps, residuals = [], np.zeros(shifts.size)
    for at in np.flatnonzero(speed[half + 1 : -half - 1] * speed[half : -half - 2] < 0) + half + 1:
        turn = np.sign(speed[at - half : at + half + 1])
        if not (
            (turn[: half - 1] == turn[0]).all()
            and (turn[half + 2 :] == -turn[0]).all()
            and turn[0] != 0
        ):
            continue
        window = tau[at - half : at + half + 1]
        for s, shift in enumerate(shifts):
            columns = np.column_stack(
                [turn[np.clip(np.arange(k.size) - shift, 0, k.size - 1)], k**0, k, k**2, k**3]
            )
            numbers = np.linalg.lstsq(columns, window, rcond=None)[0]
            residuals[s] += np.sum((window - columns @ numbers) ** 2)
            if shift == 0:
                jumps.append(numbers[0])
    return np.array(jumps), residuals


def _whole(q: Array) -> bool:
    return bool((q == np.round(q)).mean() > 0.99)
