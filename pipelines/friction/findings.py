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
from pipelines.dynamics.rrr import rigid_body
from pipelines.errors import Check, RrridError
from pipelines.friction.config import FindingsConfig
from pipelines.friction.fit import Value
from pipelines.friction.joint import JointFit
from pipelines.friction.result import JointResult
from pipelines.io.log import ExperimentLog
from pipelines.model.words import plain_number

__all__ = ["drift_in_words", "log_findings", "misfits", "nuisance_findings"]

ROUNDING = 1e-9  # numerics: of a regressor
SEED = 20040509  # numerics: of postures at which gravity is computed
_FALLING = {"stribeck", "concave_friction", "three_sigmoid"}  # laws that may fall with speed


_CONFIG = FindingsConfig()


def _known(*checks: Check | None) -> tuple[Check, ...]:
    return tuple(check for check in checks if check is not None)


def _where(joint: JointFit) -> str:
    log = joint.logs.identify[0][0]
    return log.source or log.name


def log_findings(joint: JointFit) -> tuple[Check, ...]:
    """Return what the numbers of a joint show of its logs; each is a gate."""
    log, number = joint.logs.identify[0][0], joint.logs.joint
    sign = one_way = None
    if joint.fit.inertia <= -_CONFIG.sure * float(joint.fit.std[0]):
        sign = Check.of(
            "S14", "warn", f"the inertia of joint {number} comes out negative, "
            f"{joint.fit.inertia:.3g}: torque and position have opposite signs, or are of "
            "different joints", where=_where(joint), gate=True,
            remedy="let 'rrrid inspect' look at logs that move every joint: if it finds no columns "
            "mixed up, turn the sign of this joint's torque or position in the import")
    if not (joint.covered.forth and joint.covered.back):
        one_way = Check.of(
            "D10", "warn", f"joint {number} moves one way only: Coulomb friction is confounded "
            "with an offset", where=_where(joint), gate=True,
            remedy="record the joint in both directions")
    return _known(sign, _amperes(joint, log), _compensated(joint, log), one_way)


def _amperes(joint: JointFit, log: ExperimentLog) -> Check | None:
    """S10: torque equal to the current, or an inertia far from that of the described links."""
    j, inertia = joint.logs.joint - 1, joint.fit.inertia
    if "current" in log and np.allclose(log["current"][:, j], log.tau[:, j], rtol=1e-6,
                                        atol=1e-12, equal_nan=True):
        return Check.of(
            "S10", "warn", f"torque of joint {j + 1} is its motor current, sample for sample",
            gate=True, where=_where(joint),
            remedy="give the torque constant at the import: torque_constant in [drive]")
    try:
        arm = Arm.from_links(log.robot)
    except RrridError:
        return None
    q, push = np.nanmedian(log.q, axis=0)[None], np.zeros((1, log.n_joints))
    push[0, j] = 1.0
    still = np.zeros_like(q)
    known = float((arm.body.torque(q, still, push, arm.p)
                   - arm.body.torque(q, still, still, arm.p))[0, j])
    if inertia <= 0.0 or 1.0 / _CONFIG.far < inertia / known < _CONFIG.far:
        return None
    return Check.of(
        "S10", "warn", f"the inertia of joint {j + 1} is {inertia:.3g}, that of the described "
        f"links {known:.3g}: torque in A, at the motor's side of a gear, or links that are not "
        "these", gate=True, where=_where(joint),
        remedy="give torque constant and gear ratio at the import, or correct the links")


def _compensated(joint: JointFit, log: ExperimentLog) -> Check | None:
    """D18: the controller compensated gravity, and the logged torque lacks it."""
    control, j = log.controller, joint.logs.joint - 1
    if control is None or "gravity" not in (control.feedforward or ()):
        return None
    q = np.random.default_rng(SEED).uniform(-3.0, 3.0, (16, log.n_joints))
    acts = np.abs(rigid_body(log.robot).regressor(q, 0.0 * q, 0.0 * q)[:, j]).max() > ROUNDING
    least = _CONFIG.nothing * float(np.nanstd(log.tau[:, j]))
    if not acts or float(np.hypot.reduce(joint.fit.gravity)) > least:
        return None
    return Check.of(
        "D18", "warn", f"gravity of joint {j + 1} was compensated, but the torque shows none: it "
        "is not the whole", where=_where(joint), gate=True,
        remedy="log the total torque, compensation included")


def nuisance_findings(joint: JointFit, result: JointResult) -> tuple[Check, ...]:
    """D26 drift, D08 a coarse encoder, D09 nothing to judge by, S14 viscous friction below zero."""
    drift = coarse = unjudged = None
    if words := drift_in_words(result):
        drift = Check.of(
            "D26", "warn", words[:-1], where=_where(joint),
            remedy="warm the joint up before it is measured, or record one speed for minutes to "
            "see it settle")
    attenuation = joint.sliding.attenuation
    if attenuation > _CONFIG.coarse or not math.isfinite(attenuation):
        coarse = Check.of(
            "D08", "warn", "the encoder is too coarse for these motions: "
            f"{100.0 * min(attenuation, 1.0):.0f} % of the acceleration of joint "
            f"{joint.logs.joint} is noise (variance), and its inertia comes out as much too small",
            where=_where(joint), gate=True,
            remedy="record quicker changes of speed, at higher speeds, or a finer encoder")
    if joint.logs.validate and not joint.driven.judging:
        unjudged = Check.of(
            "D09", "warn", f"joint {joint.logs.joint} slides in none of its validation logs: "
            "blocks of the identification logs judge its law", where=_where(joint),
            remedy="record validation logs at the speeds of the identification logs")
    return _known(drift, coarse, unjudged, _negative_viscous(joint))


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
    if drift.when_std is not None:
        time += f" ± {plain_number(drift.when_std)}"
    return (f"{start} of its value at {middle} s in the course of each log, with a time constant "
            f"of {time} s; the law holds at {middle} s.")


def _negative_viscous(joint: JointFit) -> Check | None:
    if set(joint.fit.law.members) & _FALLING:
        return None
    numbers = [number for tried in joint.ladder.tried
               if tried.law.name in ("coulomb+viscous", joint.fit.law.name)
               for number in tried.fit.numbers if number.name == "viscous.coefficient"]
    for number in numbers:
        if number.value < -_CONFIG.sure * number.std:
            return Check.of(
                "S14", "warn", f"viscous friction of joint {joint.logs.joint} comes out negative, "
                f"{number.value:.3g} ± {number.std:.2g} {number.unit}: torque falls as speed rises",
                where=_where(joint),
                remedy="look at the sign of this torque, at torque that a regenerating drive does "
                "not log, at friction that warms up while speeds rise, or add slower speeds for a "
                "Stribeck law")
    return None


def misfits(joints: Sequence[JointResult], where: str) -> tuple[Check, ...]:
    """D19 where the law leaves most of a torque, S14 a negative inertia.

    D19 is a gate, of joints that were never driven alone: the others are judged by simulated speed.
    """
    return _known(*(check for joint in joints for check in (
        _unexplained(joint, where), _negative(joint, where))))


def _unexplained(joint: JointResult, where: str) -> Check | None:
    error = joint.validation.torque_error
    if joint.validation.by or not joint.moved or error is None or error < _CONFIG.poor:
        return None
    return Check.of(
        "D19", "warn", f"rigid body and friction leave {100.0 * error:.0f} % of the held-out "
        f"torque of joint {joint.joint} (rms): neither this inertia nor this friction describes "
        "it", where=where, gate=True, remedy="let 'rrrid diagnose' look for further causes")


def _negative(joint: JointResult, where: str) -> Check | None:
    """S14; that of a joint driven alone, where it is surely negative, is a finding of its log."""
    value, std = joint.inertia.value, joint.inertia.std
    surely = std is not None and value < -_CONFIG.sure * std
    if not joint.moved or value >= 0.0 or (surely and joint.validation.by):
        return None
    meaning = "these logs do not show it, and it is not to be relied on"
    if surely:
        meaning = "torque and position have opposite signs, or the torque lacks a part"
    return Check.of(
        "S14", "warn", f"the inertia of joint {joint.joint} comes out negative, "
        f"{_written(joint.inertia)}, and no inertia is: {meaning}", where=where,
        remedy="drive the joint alone, with accelerations that take most of its torque")


def _written(value: Value) -> str:
    """Return both to the place of the deviation's first digit, "0.5305 ± 0.0004 kg m^2".

    To its second where the value has no digit before that: "0.0000302 ± 0.0000096 kg m^2".
    """
    if value.std is None or not 0.0 < value.std < math.inf:
        return f"{plain_number(value.value, 3)} {value.unit}"
    digits = 1 if abs(value.value) >= _CONFIG.many * value.std else 2
    place = max(0, digits - 1 - int(f"{value.std:.{digits - 1}e}".split("e")[1]))
    rounded = round(value.value, place) + 0.0  # no minus before a zero
    return f"{rounded:.{place}f} ± {value.std:.{place}f} {value.unit}"
