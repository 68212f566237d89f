"""What a fit leaves that no law of friction holds, as findings: a ripple along the turn, or most of the torque."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from pipelines.errors import Check
from pipelines.model.friction.result import JointResult, Rippled, Value

__all__ = ["POOR", "inertia_in_words", "misfits", "waves_in_words"]

POOR = 0.5  # of torque that was held out (rms): more than that left is no model
_SEEN = 2.0  # standard deviations: an inertia that is less is not seen
_MOVED = 0.1  # of the inertia: less is within what a fit is good for


def misfits(joints: Sequence[JointResult], where: str) -> tuple[Check, ...]:
    """D19, joint by joint: a gate where the law leaves most of the torque of joints that were never driven alone.

    A joint that was driven alone is judged by its simulated speed instead.
    """
    found = [check for joint in joints for check in (_unexplained(joint, where), _rippling(joint, where)) if check is not None]
    return tuple(found)


def _unexplained(joint: JointResult, where: str) -> Check | None:
    error = joint.validation.torque_error
    if joint.validation.by or error is None or error < POOR:
        return None
    return Check.of("D19", "warn", f"rigid body and friction leave {100.0 * error:.0f} % of the held-out torque of joint "
                    f"{joint.joint} (rms): neither this inertia nor this friction describes it", where=where, gate=True,
                    remedy="let 'rrrid diagnose' say what the torque is made of beside them")


def _rippling(joint: JointResult, where: str) -> Check | None:
    ripple = joint.ripple
    if ripple is None:
        return None
    along, waves = "turn" if _turns(joint) else "travel", waves_in_words(ripple, _turns(joint))
    return Check.of("D19", "warn", f"{ripple.rms.value:.2g} {ripple.rms.unit} rms of the torque of joint {joint.joint} repeats "
                    f"along its {along}, {waves}, at all speeds and both ways: {100.0 * ripple.share:.0f} % of what friction and "
                    f"inertia leave (mean square), most likely cogging. {inertia_in_words(joint, ripple, _written)}", where=where,
                    remedy=f"'rrrid diagnose' names it; 'rrrid extend --with cogging:{joint.joint}' takes it into the model")


def _turns(joint: JointResult) -> bool:
    return joint.inertia.unit == "kg m^2"


def waves_in_words(ripple: Rippled, turning: bool) -> str:
    """Of the largest wave: orders of a slide count waves in 2π metres."""
    order = ripple.orders[0]
    size = f"about {order:.2g} waves a turn" if turning else f"a wave every {2000.0 * math.pi / order:.2g} mm"
    return f"mostly {size}" if len(ripple.orders) > 1 else size


def inertia_in_words(joint: JointResult, ripple: Rippled, shown: Callable[[Value], str]) -> str:
    """What the ripple does to the inertia, and whether that is to be used.

    Args:
        shown: a value with its uncertainty and unit, in writing.
    """
    without, with_ = joint.inertia, ripple.inertia
    words = f"The inertia {shown(without)} is fitted without it; with it the same logs give {shown(with_)}"
    if with_.value <= _SEEN * (with_.std or 0.0):
        return f"{words}: these logs do not show it, and neither is to be relied on"
    moved = abs(with_.value - without.value) > _MOVED * with_.value
    return f"{words}: do not rely on the first" if moved else words


def _written(value: Value) -> str:
    std = "" if value.std is None else f" ± {value.std:.1g}"
    return f"{value.value:.3g}{std} {value.unit}"
