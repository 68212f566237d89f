"""Draw the card that says what the logged torque is, at the top of a report."""

from __future__ import annotations

import math

from pipelines.estimation.checks.boundary import Boundary, Share
from pipelines.report.report import Cell, Section, Table, Tone

__all__ = ["CARD", "boundary_card"]

CARD = "What the logged torque is"

Row = tuple[str, str, str, Tone]  # quantity, estimate, meaning, tone

_UNKNOWN = "not identifiable"
_SIDES = {
    "joint": "The torque holds no friction: it is measured beyond the gear, or compensated.",
    "motor": "The torque holds the friction of the drive: it is measured at the motor, or by a "
    "joint sensor with friction behind it.",
}


def boundary_card(boundary: Boundary | None) -> tuple[Section, ...]:
    """Return the card of `boundary`: its verdict, a row a quantity, and what no log tells; nothing
    where no log moves the arm enough.
    """
    if boundary is None:
        return ()
    rows = (
        _sign(boundary),
        _gravity(boundary),
        _direction(boundary),
        _friction(boundary),
        _order(boundary),
        _unit(boundary),
    )
    table = Table(
        ("quantity", "estimate ± standard deviation", "meaning"),
        tuple(_cells(row) for row in rows),
        tones=tuple(row[-1] for row in rows),
    )
    hidden = "; ".join(f"{item.what}: {item.reason}" for item in boundary.not_identifiable)
    text = [_verdict(boundary)]
    if boundary.evidence:
        text.append(f"Evidence: {'; '.join(boundary.evidence)}.")
    text.append(f"Not identifiable from any such log: {hidden}.")
    return (Section(CARD, tuple(text), (table,), leads=True),)


def _cells(row: Row) -> tuple[Cell, ...]:
    return row[:3]


def _verdict(boundary: Boundary) -> str:
    """Return one sentence that can be read alone."""
    if boundary.sign == "magnitude":
        return "The logged torque has no sign: no model can be fitted to it."
    if boundary.order.signal:
        return f"The columns of {boundary.order.signal} are not in the order of the joints."
    if boundary.without_gravity:
        return "The logged torque holds no gravity, although the description has gravity."
    if boundary.turned:
        return "Gravity acts in another direction than the robot's description has it."
    parts = {
        "its sign": boundary.sign,
        "gravity": boundary.gravity.present,
        "gravity's direction": ()
        if boundary.gravity.present is False
        else boundary.direction.vector,
        "friction": boundary.friction.present,
        "the order of the joints": None if boundary.order.reason else boundary.order.columns,
    }
    unknown = [name for name, value in parts.items() if value is None]
    if not unknown:
        return "The logged torque agrees with the robot's description."
    rest = " Nothing contradicts the robot's description." if len(unknown) < len(parts) else ""
    return f"These logs do not determine {_joined(unknown)} of the logged torque.{rest}"


def _joined(names: list[str]) -> str:
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last


def _sign(boundary: Boundary) -> Row:
    if boundary.sign == "magnitude":
        return "sign", "none", "Only the magnitude of the torque is logged.", "bad"
    if boundary.sign is None:
        return "sign", _UNKNOWN, "No torque changes its sign in these logs.", "neutral"
    return "sign", "signed", "The torque has a direction.", "neutral"


def _number(value: float | None, std: float | None) -> str:
    if value is None or std is None or not math.isfinite(std):
        return _UNKNOWN
    digits = max(2, min(4, 1 - math.floor(math.log10(std)))) if std > 0.0 else 4
    return f"{value + 0.0:.{digits}f} ± {std:.{digits}f}"


def _gravity(boundary: Boundary) -> Row:
    share = boundary.gravity
    tone: Tone = "bad" if boundary.without_gravity else "neutral"
    joints = ", ".join(
        f"joint {j}: {_number(value, std)}"
        for j, (value, std) in enumerate(zip(share.joint_share, share.joint_std, strict=True), 1)
        if value is not None
    )
    known = {
        True: "The torque holds gravity; 1 is all of it.",
        False: "The torque holds no gravity.",
        None: "",
    }[share.present]
    meaning = " ".join(filter(None, (known, _sentence(share.reason), _sentence(joints))))
    return "share of gravity", _number(share.share, share.std), meaning, tone


def _sentence(words: str) -> str:
    return f"{words[:1].upper()}{words[1:]}." if words else ""


def _direction(boundary: Boundary) -> Row:
    direction = boundary.direction
    tone: Tone = "bad" if boundary.turned else "neutral"
    if direction.vector is None or direction.std is None or direction.angle is None:
        return "gravity vector [m/s²]", _UNKNOWN, _sentence(direction.reason), tone
    vector = ", ".join(f"{round(x, 2) + 0.0:.2f}" for x in direction.vector)
    angle, std = math.degrees(direction.angle), math.degrees(direction.std)
    meaning = f"{angle:.1f}° from the description."
    return "gravity vector [m/s²]", f"[{vector}] ± {std:.1f}°", meaning, tone


def _friction(boundary: Boundary) -> Row:
    share: Share = boundary.friction
    meaning = [_SIDES.get(boundary.side or "", ""), _sentence(share.reason)]
    if share.upper is not None and share.present is False:
        meaning.append(f"It is {share.upper:.2g} at most.")
    return (
        "share of friction",
        _number(share.share, share.std),
        " ".join(filter(None, meaning)),
        "neutral",
    )


def _order(boundary: Boundary) -> Row:
    order = boundary.order
    tone: Tone = "bad" if order.signal else "neutral"
    if order.columns is None:
        return "order of the joints", _UNKNOWN, _sentence(order.reason), tone
    columns = ", ".join(map(str, order.columns))
    if not order.signal:
        meaning = _sentence(order.reason) or "The columns are in the order of the joints."
        if order.before is not None and order.after is not None:
            meaning += (
                f" The model leaves {_percent(order.before)} of the torque as logged, and "
                f"{_percent(order.after)} in the best other order."
            )
        return "order of the joints", f"{columns}, as logged", meaning, tone
    meaning = (
        f"These columns of {order.signal} belong to joint 1, 2, …: the model leaves "
        f"{_percent(order.after)} of the torque so, and {_percent(order.before)} as logged."
    )
    return "order of the joints", columns, meaning, tone


def _percent(share: float | None) -> str:
    return "an unknown share" if share is None else f"{100.0 * share:.2g} %"


def _unit(boundary: Boundary) -> Row:
    unit = boundary.unit
    names = ", ".join(dict.fromkeys(unit.units))
    if unit.scale is None:
        return "unit", names, f"Taken from the log: not identifiable, {unit.reason}.", "neutral"
    scale = _number(unit.scale, unit.std)
    return "unit", f"{names}, times {scale}", "1 where the described links are right.", "neutral"
