"""Draw the card that says what the logged torque is, at the top of a report."""

from __future__ import annotations

import math

from pipelines.estimation.checks.boundary import Boundary, Share
from pipelines.report.report import Cell, Section, Table, Tone

__all__ = ["CARD", "boundary_card"]

CARD = "What the logged torque is"

_UNKNOWN = "not identifiable"
_SIDES = {
    "joint": "joint side: beyond the friction of the drive, or compensated for it",
    "motor": "with friction: motor side, or a joint sensor with friction behind it",
}


def boundary_card(boundary: Boundary | None) -> tuple[Section, ...]:
    """Return the card of `boundary`; nothing where no log tells."""
    if boundary is None:
        return ()
    rows = [
        _sign(boundary),
        _gravity(boundary),
        _direction(boundary),
        _friction(boundary),
        _order(boundary),
        _unit(boundary),
    ]
    table = Table(
        ("quantity", "found", "remark"),
        tuple(row for row, _ in rows),
        tones=tuple(tone for _, tone in rows),
    )
    hidden = "; ".join(f"{one.what}: {one.reason}" for one in boundary.not_identifiable)
    return (
        Section(
            CARD,
            (
                f"Rests on: {'; '.join(boundary.evidence)}." if boundary.evidence else "",
                f"Not identifiable from such logs: {hidden}.",
            ),
            (table,),
        ),
    )


Row = tuple[tuple[Cell, ...], Tone]


def _sign(boundary: Boundary) -> Row:
    tone: Tone = "bad" if boundary.sign == "magnitude" else "neutral"
    return (
        "sign",
        {"signed": "signed", "magnitude": "none: magnitudes"}.get(boundary.sign or "", _UNKNOWN),
        "",
    ), tone


def _share(share: Share) -> str:
    if share.share is None or share.std is None:
        return _UNKNOWN
    return f"{share.share:.2f} ± {share.std:.2g}"


def _gravity(boundary: Boundary) -> Row:
    joints = ", ".join(
        f"joint {j} {value:.2f}"
        for j, value in enumerate(boundary.gravity.joint_share, 1)
        if value is not None
    )
    remark = joints or boundary.gravity.reason
    return (
        "share of gravity",
        _share(boundary.gravity),
        remark,
    ), "bad" if boundary.without_gravity else "neutral"


def _direction(boundary: Boundary) -> Row:
    direction = boundary.direction
    if direction.vector is None or direction.std is None or direction.angle is None:
        return (
            "gravity [m/s²]",
            _UNKNOWN,
            direction.reason,
        ), "bad" if boundary.turned else "neutral"
    vector = ", ".join(f"{x + 0.0:.2f}" for x in direction.vector)
    angle, std = math.degrees(direction.angle), math.degrees(direction.std)
    remark = f"{angle:.1f} ± {std:.1f} degrees from the description"
    return ("gravity [m/s²]", f"[{vector}]", remark), "bad" if boundary.turned else "neutral"


def _friction(boundary: Boundary) -> Row:
    side = _SIDES.get(boundary.side or "", boundary.friction.reason)
    share = boundary.friction
    bound = (
        f", at most {share.upper:.2g}" if share.upper is not None and share.present is False else ""
    )
    return ("share of friction", f"{_share(share)}{bound}", side), "neutral"


def _order(boundary: Boundary) -> Row:
    order = boundary.order
    if order.columns is None:
        return ("order of joints", _UNKNOWN, order.reason), "bad" if order.signal else "neutral"
    said = (
        f"{order.signal} in the order {', '.join(map(str, order.columns))}"
        if order.signal
        else "as described"
    )
    return ("order of joints", said, ""), "bad" if order.signal else "neutral"


def _unit(boundary: Boundary) -> Row:
    unit = boundary.unit
    remark = (
        unit.reason
        if unit.scale is None
        else f"{unit.scale:.2f} times what the described links need"
    )
    return ("unit", ", ".join(dict.fromkeys(unit.units)), remark), "neutral"
