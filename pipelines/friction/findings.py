"""Report what a friction fit shows that is wrong with its logs, or that no law of friction holds.

    S14 S10 D18 D10     torque with the wrong sign, in amperes, incomplete; motion one way only
    D26 D08 D09 S14     a drift, a coarse encoder, nothing to judge by, negative viscous friction
    D19 S14             most of the torque left, negative inertia
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.errors import Check, RrridError
from pipelines.estimation.nominal import plain_number
from pipelines.friction.config import FindingsConfig
from pipelines.friction.fit import Number
from pipelines.friction.joint import JointFit
from pipelines.friction.laws import gravity_acts
from pipelines.friction.result import JointResult
from pipelines.io.log import ExperimentLog

__all__ = ["drift_in_words", "findings_of", "misfits"]

_FALLING = {"stribeck", "concave_friction", "three_sigmoid"}  # laws that may fall with speed
_CONFIG = FindingsConfig()


def findings_of(joint: JointFit, result: JointResult) -> list[Check]:
    """Return what the fit of a joint that was driven alone shows of its logs."""
    log, number = joint.logs.identify[0][0], joint.logs.joint
    where, found = log.source or log.name, list[Check]()

    def warn(code: str, message: str, remedy: str, gate: bool = True) -> None:
        found.append(Check.of(code, "warn", message, where=where, remedy=remedy, gate=gate))

    if joint.fit.inertia <= -_CONFIG.sure * float(joint.fit.std[0]):
        warn("S14", f"the inertia of joint {number} comes out negative, {joint.fit.inertia:.3g}: "
             "torque and position have opposite signs, or are of different joints",
             "let 'rrrid inspect' look at logs that move every joint: if it finds no columns mixed "
             "up, turn the sign of this joint's torque or position in the import")
    if _is_current(log, number - 1):
        warn("S10", f"torque of joint {number} is its motor current, sample for sample",
             "give the torque constant at the import: torque_constant in [drive]")
    elif (known := _other_inertia(joint, log)) is not None:
        warn("S10", f"the inertia of joint {number} is {joint.fit.inertia:.3g}, that of the "
             f"described links {known:.3g}: torque in A, at the motor's side of a gear, or links "
             "that are not these",
             "give torque constant and gear ratio at the import, or correct the links")
    if _lacks_gravity(joint, log):
        warn("D18", f"gravity of joint {number} was compensated, but the torque shows none: it is "
             "not the whole", "log the total torque, compensation included")
    if not (joint.covered.forth and joint.covered.back):
        warn("D10", f"joint {number} moves one way only: Coulomb friction is confounded with an "
             "offset", "record the joint in both directions")
    if words := drift_in_words(result):
        warn("D26", words[:-1], "warm the joint up before it is measured, or record one speed for "
             "minutes to see it settle", gate=False)
    attenuation = joint.sliding.attenuation
    if attenuation > _CONFIG.coarse or not math.isfinite(attenuation):
        warn("D08", "the encoder is too coarse for these motions: "
             f"{100.0 * min(attenuation, 1.0):.0f} % of the acceleration of joint {number} is "
             "noise (variance), and its inertia comes out as much too small",
             "record quicker changes of speed, at higher speeds, or a finer encoder")
    if joint.logs.validate and not joint.driven.judging:
        warn("D09", f"joint {number} slides in none of its validation logs: blocks of the "
             "identification logs judge its law",
             "record validation logs at the speeds of the identification logs", gate=False)
    if (negative := _negative_viscous(joint)) is not None:
        warn("S14", f"viscous friction of joint {number} comes out negative, "
             f"{negative.value:.3g} ± {negative.std:.2g} {negative.unit}: torque falls as speed "
             "rises", "look at the sign of this torque, at torque that a regenerating drive does "
             "not log, at friction that warms up while speeds rise, or add slower speeds for a "
             "Stribeck law", gate=False)
    return found


def _is_current(log: ExperimentLog, j: int) -> bool:
    return "current" in log and np.allclose(log["current"][:, j], log.tau[:, j], rtol=1e-6,
                                            atol=1e-12, equal_nan=True)


def _other_inertia(joint: JointFit, log: ExperimentLog) -> float | None:
    """Return the inertia of the described links, where that of the fit is far from it."""
    try:
        arm = Arm.from_links(log.robot)
    except RrridError:
        return None
    j, q = joint.logs.joint - 1, np.nanmedian(log.q, axis=0)[None]
    known = float(arm.body.mass_matrix(q, arm.p)[0, j, j])
    share = joint.fit.inertia / known
    return None if share <= 0.0 or 1.0 / _CONFIG.far < share < _CONFIG.far else known


def _lacks_gravity(joint: JointFit, log: ExperimentLog) -> bool:
    """Return whether gravity was compensated and the logged torque shows none."""
    control, j = log.controller, joint.logs.joint - 1
    if control is None or "gravity" not in (control.feedforward or ()):
        return False
    least = _CONFIG.nothing * float(np.nanstd(log.tau[:, j]))
    others = np.delete(np.nanmedian(log.q, axis=0), j).tolist()
    acts = gravity_acts(log.robot, joint.logs.joint, others)
    return acts and float(np.hypot.reduce(joint.fit.gravity)) <= least


def _negative_viscous(joint: JointFit) -> Number | None:
    """Return viscous friction that is surely below zero, in a law that may not fall with speed."""
    if set(joint.fit.law.members) & _FALLING:
        return None
    return next((number for tried in joint.ladder.tried
                 if tried.law.name in ("coulomb+viscous", joint.fit.law.name)
                 for number in tried.fit.numbers if number.name == "viscous.coefficient"
                 and number.value < -_CONFIG.sure * number.std), None)


def drift_in_words(joint: JointResult) -> str:
    """Return how friction drifts, by how much, and when the law holds; empty without a drift."""
    drift = joint.drift
    if drift is None or drift.change.std is None:
        return ""
    change, std = 100.0 * drift.change.value, plain_number(100.0 * drift.change.std)
    size = f"{'rises' if change > 0.0 else 'falls'} by {plain_number(abs(change))} ± {std} %"
    part = {"viscous": "Viscous friction", "coulomb": "Coulomb friction"}.get(drift.form)
    if part is not None:
        unit = "rad/s" if joint.revolute else "m/s"
        size += f" of all friction at {plain_number(drift.speed)} {unit}"
    start = f"{part or 'Friction'} of {joint.name} {size}"
    time, middle = plain_number(drift.when), plain_number(drift.holds_at)
    if drift.kind == "step":
        return f"{start} at once, {time} s into {drift.log}; the law is that before."
    doubt = "" if drift.when_std is None else f" ± {plain_number(drift.when_std)}"
    return (f"{start} of its value at {middle} s in the course of each log, with a time constant "
            f"of {time}{doubt} s; the law holds at {middle} s.")


def misfits(joints: Sequence[JointResult], where: str) -> list[Check]:
    """Return D19 where the law leaves most of a torque, S14 where an inertia is negative.

    D19 is a gate, of joints that were never driven alone: the others are judged by simulated speed.
    A surely negative inertia of a joint driven alone is a finding of its log.
    """
    found = []
    for joint in joints:
        error, alone = joint.validation.torque_error, bool(joint.validation.by)
        value, std = joint.inertia.value, joint.inertia.std
        surely = std is not None and value < -_CONFIG.sure * std
        if joint.moved and not alone and error is not None and error >= _CONFIG.poor:
            found.append(Check.of(
                "D19", "warn", f"rigid body and friction leave {100.0 * error:.0f} % of the "
                f"held-out torque of joint {joint.joint} (rms): neither this inertia nor this "
                "friction describes it", where=where, gate=True,
                remedy="let 'rrrid diagnose' look for further causes"))
        if joint.moved and value < 0.0 and not (surely and alone):
            meaning = "these logs do not show it, and it is not to be relied on"
            if surely:
                meaning = "torque and position have opposite signs, or the torque lacks a part"
            doubt = "" if std is None else f" ± {plain_number(std)}"
            found.append(Check.of(
                "S14", "warn", f"the inertia of joint {joint.joint} comes out negative, "
                f"{plain_number(value)}{doubt} {joint.inertia.unit}, and no inertia is: {meaning}",
                where=where,
                remedy="drive the joint alone, with accelerations that take most of its torque"))
    return found
