"""Test whether the torque of a log fits its motion at all, before a model is fitted to it.

    for check in plausibility(Subject(log)): ...

No parameter of the arm has to be known. Each joint's torque is explained by its own row of the
rigid body with friction (`joint_rows`); then other explanations are tried on the same rows: the
torque of another joint, the other sign, another time. An alternative is reported only where the log
as it is is explained badly **and** the alternative explains it well: an arm with friction the model
lacks, with a worn gear or with a late drive is badly explained too, but nothing explains it better,
and what is wrong with it is for `diagnose` to say. Where the log describes its controller, that is
compared as well: no model of an arm is needed then.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.dynamics.rrr import rigid_body
from pipelines.errors import Check
from pipelines.estimation.checks.channel_permutation import (
    ANGLE_UNITS,
    UNIT_REMEDY,
    encoder_scale,
    position_columns,
    torque_columns,
)
from pipelines.estimation.checks.clock_offset import away_from_reversals, clock_offset
from pipelines.estimation.checks.joint_rows import Evidence, sample_motion
from pipelines.estimation.checks.torque_scale import torque_scale
from pipelines.estimation.config import PlausibilityConfig
from pipelines.estimation.judgements import excited
from pipelines.io.log import Array
from pipelines.quality.subject import NotTested, Subject, spread
from pipelines.simulation.commanded import against_command

_CONFIG = PlausibilityConfig()
Findings = Sequence[Check | NotTested]


def plausibility(subject: Subject) -> tuple[Check, ...]:
    """Return S10, S13, S14, S15, T06 and D09 of one log; nothing where it tells nothing."""
    return tuple(found for found in plausibility_findings(subject) if isinstance(found, Check))


def plausibility_findings(subject: Subject) -> tuple[Check | NotTested, ...]:
    """Return the same, and which of these questions the log leaves open, and why."""
    evidence = _evidence(subject)
    if not isinstance(evidence, Evidence):
        return _by_either(subject, evidence)
    if misplaced := _misplaced(evidence):
        return misplaced
    found = _by_either(subject, _fitting(evidence))
    if _closes(found):
        return found  # what such a torque leaves is no noise to hold the columns against
    return (*found, *excited(subject))


def mismatches(subject: Subject) -> tuple[Check, ...]:
    """Return the checks S10, S13, S14, S15 and T06 of a log that is fitted, other than "ok"."""
    evidence = _evidence(subject)
    if not isinstance(evidence, Evidence):
        return against_command(subject)
    found = _misplaced(evidence) or _by_either(subject, _fitting(evidence))
    return tuple(check for check in found if isinstance(check, Check) and check.level != "ok")


def _closes(found: Findings) -> bool:
    """Return whether a finding closes a gate."""
    return any(isinstance(one, Check) and one.gate and one.level != "ok" for one in found)


def _evidence(subject: Subject) -> Evidence | tuple[NotTested, ...]:
    """Return the torque rows of a log; or why there are none."""
    if not subject.sampled or not subject.good.time.known:  # a plan has no positions
        return ()
    log, good = subject.log, subject.good
    reason, body = "", rigid_body(log.robot)
    numbers = len(body.parameters) + 4
    if log.experiment not in ("excitation", "free", "writing"):
        reason = f"a '{log.experiment}' log does not move the whole arm"
    elif not good.runs:
        reason = "no stretch of even samples is long enough"
    elif (spread(good.log.tau) == 0).any() or (subject.travel == 0).any():
        reason = "a joint's position or torque never changes"
    else:
        motion = sample_motion(good)
        if motion is not None and len(motion.t) >= 4 * numbers:
            return Evidence(subject, body, motion)
        reason = f"too short for the {numbers} numbers that explain a joint's torque"
    codes = ("S13", "S14", "S15", "T06")
    return tuple(found for code in codes for found in subject.cannot_tell(code, reason))


def _misplaced(e: Evidence) -> tuple[Check, ...]:
    """Return columns in the wrong place, or an angle in the wrong scale: nothing else is said."""
    return tuple(torque_columns(e) or position_columns(e) or encoder_scale(e))


def _fitting(e: Evidence) -> tuple[Check | NotTested, ...]:
    """Return S13, S14, S15 and T06 of a log whose columns are in their places."""
    return (*_explained(e), *_signs(e), *_ratios(e), *_clock(e))


def _by_either(subject: Subject, found: Findings) -> tuple[Check | NotTested, ...]:
    """Return what motion shows of a torque; where that closes no gate, what the controller does."""
    if _closes(found):
        return tuple(found)
    clear = {one.code for one in found if isinstance(one, Check) and one.level == "ok"}
    if "RRID-S15" in clear:  # gains may be described wrong, and the torque be right
        clear.add("RRID-S10")
    told = [check for check in against_command(subject) if check.code not in clear - {"RRID-T06"}]
    codes = {check.code for check in told}
    return (*told, *(one for one in found if one.code not in codes))


def _explained(e: Evidence) -> list[Check]:
    """S13: a joint whose torque nothing explains, where others are, has another channel's."""
    told = e.telling
    lost = told[e.residual[told] > _CONFIG.unexplained]
    rest = np.delete(e.residual[told], np.searchsorted(told, lost))
    clear = lost.size and rest.size and rest.max() < _CONFIG.explained
    if not clear or e.residual[lost].min() <= _CONFIG.apart * rest.max():
        words = ", ".join(f"{v:.2g}" for v in e.residual[told])
        held = "" if len(told) == e.n_joints else "; joints that are only held cannot tell"
        fine = f"each joint's torque fits its own motion best, relative residual {words}{held}"
        return e.subject.ok("S13", fine)
    others, found = ", ".join(f"{v:.2g}" for v in rest), []
    remedy = "unless a diagnosis names a cause there, look whether this column is that joint's "
    remedy += "torque, or repeats another's"
    for j in lost.tolist():
        residual = f"relative residual {e.residual[j]:.2g}, others {others}"
        words = f"joint {j + 1}'s torque is not explained by its motion: {residual}"
        found.append(e.subject.say("S13", "warn", words, signal="tau", joint=j, remedy=remedy))
    return found


def _signs(e: Evidence) -> list[Check]:
    """S14: inertia is positive and friction takes power; a flipped torque says neither."""
    flipped = [j for j in e.telling.tolist() if _negative(e, j)]
    if not flipped:
        return e.subject.ok("S14", "inertia of every joint is positive", signal="tau")
    where = ", ".join(f"joint {j + 1}" for j in flipped)
    if len(flipped) == e.n_joints > 1:
        where = "all joints"
    words = f"the torque of {where} looks flipped: inertia and friction come out negative"
    remedy = "change the sign of this torque on import, or of its position"
    found = []
    for j in flipped:
        check = e.subject.say("S14", "warn", words, signal="tau", joint=j, gate=True, remedy=remedy)
        found.append(check)
    return found


def _negative(e: Evidence, joint: int) -> bool:
    """Return whether this row alone needs inertia or friction to be negative.

    And the other does not speak against it. Needs: without it the residual would be twice as large.
    Forcing d·x = 0 on least squares adds (d·x)² / var(d·x) · s² to the squared residual.
    Significance alone would not do: with torques this precise, a slip of the smoothing is
    significant. A late torque can make friction negative, but never inertia.
    """
    motion, row = e.motion, e.rows[joint]
    if e.residual[joint] > 0.7:
        return False
    unit, still = np.zeros_like(motion.q), np.zeros_like(motion.q)
    unit[:, joint] = 1.0
    pushed = e.body.regressor(motion.q, still, unit) - e.body.regressor(motion.q, still, still)
    mass = pushed[:, joint].mean(axis=0)
    inertia = np.concatenate([mass, [1.0, 0.0, 0.0, 0.0]])
    speed = motion.dq[:, joint]
    powers = [np.mean(speed**2), np.mean(motion.coulomb[:, joint] * speed)]
    friction = np.concatenate([np.zeros(len(mass) + 1), powers, [0.0]])
    value, covariance = row.estimate(motion.tau[:, joint])
    sigmas = []
    for d in (inertia, friction):
        deviation = max(float(np.sqrt(d @ covariance @ d)), 1e-300)
        sigmas.append(float(d @ value) / deviation)
    free = max(1, len(motion.t) - row.basis.shape[1])
    decisive, sure = -np.sqrt(_CONFIG.doubled * free), _CONFIG.sure
    light = sigmas[0] < decisive and sigmas[1] < sure
    return light or (sigmas[1] < decisive and sigmas[0] < -sure)


def _ratios(e: Evidence) -> Findings:
    """S15: the torque is as large as the described links need, or the other joints' torques.

    Within what load and friction can make of it.
    """
    known = e.body.known_parameters()
    if known is None:
        words = "the robot's description has no masses and inertias to compare with"
        return _against_the_others(e) or e.subject.cannot_tell("S15", words, signal="tau")
    slopes = _slopes(e, known)
    if (far := _far(slopes)) and (unit := _angle_unit(e, known, slopes)):
        return [unit]
    found = []
    for j, slope in far.items():
        words = f"tau of joint {j + 1} is {slope:.3g} times what the described links need"
        remedy = _divided(j + 1, slope)
        check = e.subject.say("S15", "warn", words, signal="tau", joint=j, gate=True, remedy=remedy)
        found.append(check)
    if not slopes:
        words = "the described masses and inertias do not explain the torque of any joint, so that "
        words += "a wrong gear ratio or unit would not show"
        return _against_the_others(e) or e.subject.cannot_tell("S15", words, signal="tau")
    seen = ", ".join(f"joint {j + 1}: {slope:.3g}" for j, slope in slopes.items())
    fine = f"torque over that of the described links: {seen}"
    return found or _against_the_others(e) or e.subject.ok("S15", fine, signal="tau")


def _slopes(e: Evidence, known: Array, angles: float = 1.0) -> dict[int, float]:
    """Return torque over that of the described links, of each joint that they explain.

    Args:
        angles: times which every angle is taken.
    """
    motion, slopes = e.motion, {}
    scale = np.where([one.revolute for one in e.subject.log.robot.joints], angles, 1.0)
    expected = e.body.torque(motion.q * scale, motion.dq * scale, motion.ddq * scale, known)
    for j in e.telling.tolist():
        tau, parts = motion.tau[:, j], (motion.dq[:, j], motion.coulomb[:, j])
        friction = np.stack([*parts, np.ones(len(tau))], axis=-1)
        columns = np.concatenate([expected[:, j : j + 1], friction], axis=1)
        without, left = _unexplained(friction, tau), _unexplained(columns, tau)
        # else the described links are not this arm's; they say nothing
        if left <= _CONFIG.ratio_residual and left <= 0.4 * without:
            slopes[j] = float(np.linalg.lstsq(columns, tau, rcond=None)[0][0])
    return slopes


def _far(slopes: dict[int, float]) -> dict[int, float]:
    far = _CONFIG.ratio
    return {j: slope for j, slope in slopes.items() if slope > far or 0 < slope < 1 / far}


def _angle_unit(e: Evidence, known: Array, as_declared: dict[int, float]) -> Check | None:
    """S15: in another unit of angles the described links explain the torques of more joints.

    Each as large as they need. Where no more are explained, as of one joint that only turns
    inertia, a gear ratio would do the same.
    """
    joint, far = max(_far(as_declared).items(), key=lambda one: abs(np.log(one[1])))
    for name, factor in ANGLE_UNITS.items():
        slopes = _slopes(e, known, factor)
        more = as_declared.keys() < slopes.keys() and not _far(slopes)
        if more and min(slopes.values()) > 0.0:
            times = f"{min(slopes.values()):.3g} to {max(slopes.values()):.3g} times"
            words = f"the unit of q looks wrong: as declared, tau of joint {joint + 1} is "
            words += f"{far:.3g} times what the described links need; with every angle "
            words += f"multiplied by {name}, {times}"
            return e.subject.say("S15", "warn", words, signal="q", gate=True, remedy=UNIT_REMEDY)
    return None


def _against_the_others(e: Evidence) -> list[Check]:
    """S15 without a description: all torques come from one set of rigid parameters."""
    if (found := torque_scale(e)) is None:
        return []
    places = [f"joint {found.joint + 1} is {found.factor:.3g} times"]
    places += [f"joint {joint + 1} {factor:.3g} times" for joint, factor in found.others]
    ratio = ": only their ratio shows" if found.others else ""
    words = f"tau of {', or tau of '.join(places)} what the other joints' torques need{ratio}, "
    words += f"residual {found.before:.2g} -> {found.after:.2g}"
    remedy, joint = _divided(found.joint + 1, found.factor), found.joint
    return [
        e.subject.say("S15", "warn", words, signal="tau", joint=joint, gate=True, remedy=remedy)
    ]


def _divided(joint: int, factor: float) -> str:
    """Return S15's remedy for a torque."""
    constants = f"about {factor:.3g} or {1 / factor:.3g}"
    applied = "that was applied twice or not at all"
    fit = f"tau of joint {joint} divided by {factor:.3g} would fit"
    return f"look for a gear ratio or torque constant of {constants} {applied}; {fit}"


def _unexplained(columns: Array, tau: Array) -> float:
    """Return the share of the variation of `tau` that `columns` leave."""
    rest = tau - columns @ np.linalg.lstsq(columns, tau, rcond=None)[0]
    return float(np.linalg.norm(rest) / np.linalg.norm(tau - tau.mean()))


def _clock(e: Evidence) -> Findings:
    """T06: position and torque were stamped by the same clock."""
    subject, found = e.subject, clock_offset(e.rows, e.motion, e.telling.tolist())
    if found is None:
        words = "no torque follows its motion closely enough to time it"
        return subject.cannot_tell("T06", words, signal="tau")
    if found.joints < 2:
        words = "one joint's torque alone is understood, and what its friction does at a reversal "
        words += "looks like an offset of the clocks"
        return subject.cannot_tell("T06", words, signal="tau")
    late, bound = abs(found.samples), found.bound
    size = f"{late:.2f} ± {bound:.2f} samples ({late * 1e3 * e.motion.sample_time:.3g} ms)"
    side = "behind" if found.samples > 0 else "ahead of"
    words = f"torque lies {size} {side} the motion"
    drift = f"{found.drift:+.2f} ± {found.drift_bound:.2f} samples over the log"
    if abs(found.drift) > 1.0 + found.drift_bound:
        gate = abs(found.drift) > 1.0 + _CONFIG.drifts * found.drift_bound
        remedy = "stamp position and torque by one clock"
        drifts = f"the clocks of q and tau drift by {drift}"
        return [subject.say("T06", "warn", drifts, signal="tau", gate=gate, remedy=remedy)]
    if late > 1.0 + bound:
        rest = away_from_reversals(e.body, e.motion, found.samples, e.telling.tolist())
        if rest is None or abs(rest.samples - found.samples) > 1.0 + bound + rest.bound:
            words += ", but not away from reversals: friction that lags there looks like it"
            return subject.cannot_tell("T06", words, signal="tau")
        words += f", alike in {found.joints} joints; it drifts by {drift}"
        remedy = "look for a delay between the recorders of q and tau; 'diagnose' tells a late "
        remedy += "encoder from a late drive"
        return [subject.say("T06", "warn", words, signal="tau", remedy=remedy)]
    if bound > _CONFIG.timed_bound:
        words += ": an offset of one sample would not show"
        return subject.cannot_tell("T06", words, signal="tau")
    return subject.ok("T06", f"{words}, drift {drift}", signal="tau")
