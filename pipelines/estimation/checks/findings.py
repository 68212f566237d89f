"""Report which findings of a torque boundary keep a model from being fitted, with the remedy."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from pipelines.errors import Check
from pipelines.estimation.checks.boundary import STANDARD_GRAVITY, Boundary, JointOrder

__all__ = ["EXPLAINED_BY", "boundary_findings", "without_followers"]

# Other codes that a boundary finding brings about, on the same logs: they are left out.
EXPLAINED_BY = ("RRID-S13", "RRID-S14", "RRID-S15", "RRID-D09", "RRID-D05")
_CODES = ("RRID-S13", "RRID-S23", "RRID-S24", "RRID-S25")


def boundary_findings(boundary: Boundary | None, where: str) -> tuple[Check, ...]:
    """Return the gates that `boundary` closes: S13, S23, S24 or S25.

    Args:
        where: the log or the folder that it is of.
    """
    if boundary is None:
        return ()
    if boundary.sign == "magnitude":
        return (
            Check.of(
                "S25",
                "warn",
                f"tau has no sign: {boundary.evidence[0]}",
                where=where,
                gate=True,
                remedy="log the signed torque or current; magnitudes fit no model of the arm",
            ),
        )
    if boundary.order.signal:
        return (_order(boundary.order, where),)
    if boundary.without_gravity:
        return (
            Check.of(
                "S23",
                "warn",
                f"torque holds no gravity: compensated? Its share is {boundary.gravity.share:.2f} "
                f"± {boundary.gravity.std:.2f}",
                where=where,
                gate=True,
                remedy="log the torque with the gravity compensation in it, or write "
                "gravity = [0, 0, 0] in the robot's "
                "description",
            ),
        )
    if boundary.turned:
        return (_turned(boundary, where),)
    return ()


def _order(order: JointOrder, where: str) -> Check:
    where = f"{where}, signal {order.signal}"
    residual = f"residual {order.before:.2f} -> {order.after:.2f}"
    if order.columns is None:
        return Check.of(
            "S13",
            "warn",
            f"{order.signal}: {order.reason}, {residual}",
            where=where,
            gate=True,
            remedy="put the columns in the order of the robot's joints on import",
        )
    moved = [k for k, column in enumerate(order.columns, 1) if column != k]
    columns = ",".join(map(str, moved))
    how = (
        "swapped"
        if len(moved) == 2
        else f"in the order {','.join(str(order.columns[k - 1]) for k in moved)}"
    )
    return Check.of(
        "S13",
        "warn",
        f"{order.signal}: columns {columns} fit {how}, {residual}",
        where=where,
        gate=True,
        remedy="put the columns in the order of the robot's joints: correct the column map "
        "of the import",
    )


def _turned(boundary: Boundary, where: str) -> Check:
    direction = boundary.direction
    vector = np.array(direction.best) * STANDARD_GRAVITY / np.linalg.norm(direction.best)
    told = f"[{', '.join(f'{x:.2f}' for x in np.round(vector, 2) + 0.0)}]"
    described = f"[{', '.join(f'{x:.2f}' for x in direction.described)}]"
    known = "" if direction.vector is not None else ", one of several directions that fit alike"
    return Check.of(
        "S24",
        "warn",
        f"gravity points elsewhere: the torque has gravity = {told}{known}, "
        f"the description {described}",
        where=where,
        gate=True,
        remedy=f"write gravity = {told} in the robot's description (for a URDF under [robot] in "
        "the recipe of the import), or correct its base frame",
    )


def without_followers(checks: Iterable[Check], findings: Sequence[Check]) -> tuple[Check, ...]:
    """Return `checks` without those that a boundary finding brings about."""
    if not any(finding.code in _CODES for finding in findings):
        return tuple(checks)
    return tuple(check for check in checks if check.code not in EXPLAINED_BY or not check.gate)
