"""Report what a friction fit shows that is wrong with its logs, or that no law of friction holds.

S14 S10 D10         torque with the wrong sign, in amperes; motion one way only
D26 D08 D09         a drift, a coarse encoder, nothing to judge by
D19 S14             most of the torque left, negative inertia
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from pipelines.errors import Check
from pipelines.estimation.nominal import plain_number
from pipelines.friction.config import FRICTION
from pipelines.friction.joint import JointFit
from pipelines.friction.result import JointResult

__all__ = ["drift_in_words", "findings_of", "misfits"]

_FALLING = {"stribeck", "concave_friction", "three_sigmoid"}  # laws that may fall with speed


def findings_of(joint: JointFit, result: JointResult) -> list[Check]:
    """Return what the fit of a joint that was driven alone shows of its logs."""
    log, number = joint.logs.identify[0][0], joint.logs.joint
    where, found = log.source or log.name, list[Check]()

    def warn(code: str, message: str, remedy: str, gate: bool = True) -> None:
        found.append(Check.of(code, "warn", message, where=where, remedy=remedy, gate=gate))

    if joint.fit.inertia <= -FRICTION.negative * float(joint.fit.std[0]):
        warn(
            "S14",
            f"the inertia of joint {number} comes out negative, {joint.fit.inertia:.3g}: torque "
            "and position have opposite signs, or are of different joints",
            "let 'rrrid inspect' look at logs that move every joint: if it finds no columns mixed "
            "up, turn the sign of this joint's torque or position in the import",
        )
    tau, close = log.tau[:, number - 1], partial(np.allclose, rtol=1e-6, atol=1e-12)
    if "current" in log and close(log["current"][:, number - 1], tau, equal_nan=True):
        warn(
            "S10",
            f"torque of joint {number} is its motor current, sample for sample",
            "give the torque constant at the import: torque_constant in [drive]",
        )
    if not (joint.covered.forth and joint.covered.back):
        warn(
            "D10",
            f"joint {number} moves one way only: Coulomb friction is confounded with an offset",
            "record the joint in both directions",
        )
    if words := drift_in_words(result):
        warn(
            "D26",
            words[:-1],
            "warm the joint up before it is measured, or record one speed for minutes to see it "
            "settle",
            gate=False,
        )
    attenuation = joint.sliding.attenuation
    if attenuation > FRICTION.coarse or not math.isfinite(attenuation):
        warn(
            "D08",
            "the encoder is too coarse for these motions: "
            f"{100.0 * min(attenuation, 1.0):.0f} % of the acceleration of joint {number} is noise "
            "(variance), and its inertia comes out as much too small",
            "record quicker changes of speed, at higher speeds, or a finer encoder",
        )
    if joint.logs.validate and not joint.driven.judging:
        warn(
            "D09",
            f"joint {number} slides in none of its validation logs: blocks of the identification "
            "logs judge its law",
            "record validation logs at the speeds of the identification logs",
            gate=False,
        )
    if not set(joint.fit.law.members) & _FALLING:
        for one in joint.fit.numbers:
            if one.name == "viscous.coefficient" and one.value < -FRICTION.negative * one.std:
                warn(
                    "S14",
                    f"viscous friction of joint {number} comes out negative, {one.value:.3g} ± "
                    f"{one.std:.2g} {one.unit}: torque falls as speed rises",
                    "look at the sign of this torque, at torque that a regenerating drive does not "
                    "log, at friction that warms up while speeds rise, or add slower speeds for a "
                    "Stribeck law",
                    gate=False,
                )
    return found


def drift_in_words(joint: JointResult) -> str:
    """Return how friction drifts, by how much, and when the law holds; empty without a drift."""
    drift = joint.drift
    if drift is None or drift.change.std is None:
        return ""
    change, std = 100.0 * drift.change.value, plain_number(100.0 * drift.change.std)
    time, middle = plain_number(drift.when), plain_number(drift.holds_at)
    doubt = "" if drift.when_std is None else f" ± {plain_number(drift.when_std)}"
    return (
        f"Friction of {joint.name} {'rises' if change > 0.0 else 'falls'} by "
        f"{plain_number(abs(change))} ± {std} % of its value at {middle} s in the course of each "
        f"log, with a time constant of {time}{doubt} s; the law holds at {middle} s."
    )


def misfits(joints: Sequence[JointResult], where: str) -> list[Check]:
    """Return D19 where the law leaves most of a torque, S14 where an inertia is negative.

    D19 is a gate, of joints that were never driven alone: the others are judged by simulated speed.
    A surely negative inertia of a joint driven alone is a finding of its log.
    """
    found = []
    for joint in joints:
        error, alone = joint.validation.torque_error, bool(joint.validation.by)
        value, std = joint.inertia.value, joint.inertia.std
        surely = std is not None and value < -FRICTION.negative * std
        if joint.moved and not alone and error is not None and error >= FRICTION.poor:
            words = (
                f"rigid body and friction leave {100.0 * error:.0f} % of the held-out torque of "
                f"joint {joint.joint} (rms): neither this inertia nor this friction describes it"
            )
            remedy = "let 'rrrid diagnose' look for further causes"
            found.append(Check.of("D19", "warn", words, where=where, gate=True, remedy=remedy))
        if joint.moved and value < 0.0 and not (surely and alone):
            meaning = "these logs do not show it, and it is not to be relied on"
            if surely:
                meaning = "torque and position have opposite signs, or the torque lacks a part"
            doubt = "" if std is None else f" ± {plain_number(std)}"
            words = (
                f"the inertia of joint {joint.joint} comes out negative, {plain_number(value)}"
                f"{doubt} {joint.inertia.unit}, and no inertia is: {meaning}"
            )
            remedy = "drive the joint alone, with accelerations that take most of its torque"
            found.append(Check.of("S14", "warn", words, where=where, remedy=remedy))
    return found
