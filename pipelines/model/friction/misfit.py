"""What a fit leaves that no law of friction holds, as findings: a torque of the joint's angle, or most of the torque."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.errors import Check
from pipelines.model.friction.result import JointResult, Rippled, Value
from pipelines.model.words import plain_number

__all__ = ["NAMED", "MisfitConfig", "depends_in_words", "inertia_in_words", "misfits"]

_MANY = 10.0  # deviations in a value: it then has digits before the first of the deviation
NAMED = "let 'rrrid diagnose' say what makes it: a motor that cogs, a spring, a cable, a stop"


@dataclass(frozen=True)
class MisfitConfig:
    """What a fit may leave before it is said."""

    poor: float = 0.5  # of the held-out torque (rms): a quarter of its power is not described
    sure: float = 3.0  # std below zero (two-sided .003)
    seen: float = 2.0  # std: an inertia that is less may be zero (two-sided .05)
    resolved: float = 0.9  # of a wave along the travel, by which two of them differ (Rayleigh: 1)
    several: float = 4.0  # waves along the travel: fewer, beside others like it, a bend has as well
    most: float = 0.5  # of all waves (mean square): the largest is more than all others together
    moved: float = 0.1  # of the inertia: more is not to be relied on; a choice


_CONFIG = MisfitConfig()


def misfits(joints: Sequence[JointResult], where: str) -> tuple[Check, ...]:
    """D19, a gate, where the law leaves most of the torque of a joint that was never driven alone; S14, D21 where a joint ripples.

    A joint that was driven alone is judged by its simulated speed instead.
    """
    found = [check for joint in joints for check in (_unexplained(joint, where), _negative(joint, where), _rippling(joint, where))
             if check is not None]
    return tuple(found)


def _negative(joint: JointResult, where: str) -> Check | None:
    """S14: an inertia below zero. That of a joint driven alone, where it is surely negative, is a finding of its log."""
    value, std = joint.inertia.value, joint.inertia.std
    surely = std is not None and value < -_CONFIG.sure * std
    if not joint.moved or value >= 0.0 or (surely and joint.validation.by):
        return None
    meaning = ("torque and position have opposite signs, or the torque lacks a part" if surely else
               "these logs do not show it, and it is not to be relied on")
    return Check.of("S14", "warn", f"the inertia of joint {joint.joint} comes out negative, {_written(joint.inertia)}, and no "
                    f"inertia is: {meaning}", where=where,
                    remedy="drive the joint alone, with accelerations that take most of its torque")


def _unexplained(joint: JointResult, where: str) -> Check | None:
    error = joint.validation.torque_error
    if joint.validation.by or not joint.moved or error is None or error < _CONFIG.poor:
        return None
    return Check.of("D19", "warn", f"rigid body and friction leave {100.0 * error:.0f} % of the held-out torque of joint "
                    f"{joint.joint} (rms): neither this inertia nor this friction describes it", where=where, gate=True,
                    remedy="let 'rrrid diagnose' look for further causes")


def _rippling(joint: JointResult, where: str) -> Check | None:
    ripple = joint.ripple
    if ripple is None:
        return None
    inertia, torque = inertia_in_words(joint, ripple, _written), "torque" if joint.revolute else "force"
    return Check.of("D21", "warn", f"{plain_number(ripple.rms.value)} {ripple.rms.unit} rms of the {torque} of joint {joint.joint} "
                    f"{depends_in_words(joint, ripple)}: {100.0 * ripple.share:.0f} % of what friction and inertia leave (mean "
                    f"square){inertia and f'. {inertia}'}", where=where, remedy=NAMED)


def depends_in_words(joint: JointResult, ripple: Rippled) -> str:
    """Of what, and how it is known to be no friction; of waves only where they are told apart from a bend."""
    return (f"depends on its {'angle' if joint.revolute else 'position'} alone{_waves_in_words(joint, ripple)}, "
            "the same at all speeds and both ways")


def _waves_in_words(joint: JointResult, ripple: Rippled) -> str:
    """The largest wave; empty for a bend: where others are too near for the travel to tell them apart, and it is few or not most.

    Orders of a slide count waves in 2π metres.
    """
    order, *others = ripple.orders
    apart = 2.0 * math.pi / max(float(np.ptp(ripple.along.angle)), 1e-12)
    near = min((abs(other - order) for other in others), default=math.inf) < _CONFIG.resolved * apart
    if near and (order < _CONFIG.several * apart or not ripple.largest_share >= _CONFIG.most):
        return ""
    length = f"a wave every {plain_number(2000.0 * math.pi / order)} mm"
    size = f"about {plain_number(order)} cycles per revolution" if joint.revolute else length
    return f", mostly {size}" if others else f", {size}"


def inertia_in_words(joint: JointResult, ripple: Rippled, shown: Callable[[Value], str]) -> str:
    """What the ripple does to the inertia, and whether that is to be used; empty where only one of the two is known.

    Args:
        shown: a value with its uncertainty and unit, in writing.
    """
    without, with_ = joint.inertia, ripple.inertia
    if with_ is None:
        return ""
    words = f"The inertia {shown(without)} is fitted without it; with it the same logs give {shown(with_)}"
    if with_.std is not None and with_.value < -_CONFIG.seen * with_.std:
        return f"{words}: no inertia is negative; look at the sign of this torque"
    if with_.std is None or with_.value <= _CONFIG.seen * with_.std:
        return f"{words}: these logs do not show it, and neither is to be relied on"
    moved = abs(with_.value - without.value) > _CONFIG.moved * with_.value
    return f"{words}: do not rely on the first" if moved else words


def _written(value: Value) -> str:
    """Both to the place of the deviation's first digit, "0.5305 ± 0.0004 kg m^2"; to its second where the value has no digit before
    that one: "0.0000302 ± 0.0000096 kg m^2".
    """
    if value.std is None or not 0.0 < value.std < math.inf:
        return f"{plain_number(value.value, 3)} {value.unit}"
    digits = 1 if abs(value.value) >= _MANY * value.std else 2
    place = max(0, digits - 1 - int(f"{value.std:.{digits - 1}e}".split("e")[1]))
    return f"{round(value.value, place) + 0.0:.{place}f} ± {value.std:.{place}f} {value.unit}"  # no minus before a zero
