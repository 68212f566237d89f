"""Report nuisances of friction logs: friction that drifts, rows that stick, a coarse encoder, negative viscous friction."""

from __future__ import annotations

import math

from pipelines.errors import Check
from pipelines.model.friction.findings import FindingsConfig
from pipelines.model.friction.joint import JointFit
from pipelines.model.friction.result import Drift, Sticking, drift_of_joint
from pipelines.model.words import plain_number

__all__ = ["drift_in_words", "nuisance_findings", "sticking_in_words"]

_FALLING = {"stribeck", "concave_friction", "three_sigmoid"}  # laws that may fall with speed and be right
_CONFIG = FindingsConfig()


def drift_in_words(drift: Drift | None, name: str, revolute: bool) -> str:
    """Say how friction drifts, by how much, and at what time the law holds; empty without a drift."""
    if drift is None or drift.change.std is None:
        return ""
    percent, std = 100.0 * drift.change.value, 100.0 * drift.change.std
    size = f"{'rises' if percent > 0.0 else 'falls'} by {plain_number(abs(percent))} ± {plain_number(std)} %"
    part = {"viscous": "Viscous friction", "coulomb": "Coulomb friction"}.get(drift.form, "Friction")
    size += "" if drift.form == "whole" else f" of all friction at {plain_number(drift.speed)} {'rad/s' if revolute else 'm/s'}"
    if drift.kind == "step":
        return (f"{part} of {name} {size} at once, {plain_number(drift.when)} s into {drift.log}; the law "
                "is that before.")
    middle = plain_number(drift.holds_at)
    return (f"{part} of {name} {size} of its value at {middle} s in the course of each log, with a time constant of "
            f"{plain_number(drift.when)}{f' ± {plain_number(drift.when_std)}' if drift.when_std is not None else ''} s; "
            f"the law holds at {middle} s.")


def sticking_in_words(sticking: Sticking | None, name: str, revolute: bool) -> str:
    """Say how many rows are left out, and why."""
    if sticking is None:
        return ""
    share = plain_number(100.0 * sticking.share)
    words = (f"{share} % of the rows of {name} are left out: the joint rests or bends its contacts there, "
             f"up to a travel of {plain_number(sticking.distance)} {'rad' if revolute else 'm'}, and friction is no "
             "function of its speed.")
    if sticking.slips:
        words += (f" It sticks and slips on {sticking.slips} times amid motion one way: only the slips are fitted, and the law "
                  "holds from the slowest speed that was driven on. Drive faster or with a stiffer loop to see slower sliding.")
    return words


def nuisance_findings(joint: JointFit, name: str) -> tuple[Check, ...]:
    """D26 friction that drifts, D08 an encoder too coarse, D09 nothing to judge by, S14 viscous friction below zero."""
    where = joint.logs.identify[0][0].source or joint.logs.identify[0][0].name
    found = []
    if words := drift_in_words(drift_of_joint(joint), name, joint.fit.joint.revolute):
        found.append(Check.of("D26", "warn", words[:-1], where=where,
                              remedy="warm the joint up before it is measured, or record one speed for minutes to see it settle"))
    attenuation = joint.sliding.attenuation
    if attenuation > _CONFIG.coarse or not math.isfinite(attenuation):
        noise = 100.0 * min(attenuation, 1.0)
        found.append(Check.of(
            "D08", "warn", f"the encoder is too coarse for these motions: {noise:.0f} % of the acceleration of joint "
            f"{joint.logs.joint} is noise (variance), and its inertia comes out as much too small", where=where, gate=True,
            remedy="record quicker changes of speed, at higher speeds, or a finer encoder"))
    if joint.logs.validate and not joint.driven.judging:
        found.append(Check.of(
            "D09", "warn", f"joint {joint.logs.joint} slides in none of its validation logs: blocks of the identification logs "
            "judge its law", where=where, remedy="record validation logs at the speeds of the identification logs"))
    if check := _negative_viscous(joint, where):
        found.append(check)
    return tuple(found)


def _negative_viscous(joint: JointFit, where: str) -> Check | None:
    if set(joint.fit.law.members) & _FALLING:
        return None
    for one in joint.ladder.tried:
        if one.law.name not in ("coulomb+viscous", joint.fit.law.name):
            continue
        for number in one.fit.numbers:
            if number.name == "viscous.coefficient" and number.value < -_CONFIG.sure * number.std:
                return Check.of(
                    "S14", "warn", f"viscous friction of joint {joint.logs.joint} comes out negative, {number.value:.3g} ± "
                    f"{number.std:.2g} {number.unit}: torque falls as speed rises", where=where,
                    remedy="look at the sign of this torque, at torque that a regenerating drive does not log, at friction "
                           "that warms up while speeds rise, or add slower speeds for a Stribeck law")
    return None
