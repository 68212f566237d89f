"""Ask whether the torque of a log fits its motion at all, before anyone fits a model to it.

    for check in plausibility(Subject(log)): ...

No parameter of the arm has to be known. Each joint's torque is explained by its own row of the rigid body with friction
(`row_fit`); then other explanations are tried on the same rows: the torque of another joint, the other sign, another
time. An alternative is reported only where the log as it stands is explained badly **and** the alternative explains it
well: an arm with friction the model lacks, with a worn gear or with a late drive is badly explained too, but nothing
explains it better, and what is wrong with it is for `diagnose` to say. Where the log describes its controller, that is asked
as well: no model of an arm is needed then.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.dynamics.body import Array
from pipelines.dynamics.rrr import rigid_body
from pipelines.errors import Check
from pipelines.estimation.judgements import excited
from pipelines.model.clock_offset import away_from_reversals, clock_offset
from pipelines.model.evidence import Evidence
from pipelines.model.mix_ups import (
    ANGLE_UNITS,
    UNIT_REMEDY,
    encoder_scale,
    position_columns,
    torque_columns,
)
from pipelines.model.row_fit import sample_motion
from pipelines.model.torque_scale import torque_scale
from pipelines.quality.subject import NotTested, Subject, spread
from pipelines.simulation.commanded import against_command

__all__ = ["mismatches", "plausibility", "plausibility_findings"]

_DOUBLED = 3.0  # 2² - 1: growth of the squared residual when the residual doubles
_SURE = 5.0  # standard deviations
_RATIO = 2.5  # a load of a quarter of the arm's mass doubles a joint's inertia at most
_RATIO_RESIDUAL = 0.25
_EXPLAINED, _UNEXPLAINED, _APART = 0.1, 0.3, 5.0  # relative residuals; a saturated or touched arm is not so clear a case
_TIMED = 1.0  # samples; a wider bound cannot tell an offset of one sample
# Times the bound of a drift, beyond which a log is refused and not only warned of: what friction remembers of a reversal, which no
# row of the model has, drifted by 1.3 bounds in an arm in order, and a log that is refused is lost.
_DRIFTS = 2.0


def plausibility(subject: Subject) -> tuple[Check, ...]:
    """S10, S13, S14, S15, T06 and D09 of one log; nothing where it moves too little or too short to tell."""
    return tuple(found for found in plausibility_findings(subject) if isinstance(found, Check))


def plausibility_findings(subject: Subject) -> tuple[Check | NotTested, ...]:
    """The same, and which of these questions the log leaves open, and why."""
    evidence = _evidence(subject)
    if not isinstance(evidence, Evidence):
        return _by_either(subject, evidence)
    if misplaced := _misplaced(evidence):
        return misplaced
    found = _by_either(subject, _fitting(evidence))
    if any(isinstance(check, Check) and check.gate and check.level != "ok" for check in found):
        return found  # what such a torque leaves is no noise to hold the columns against
    return (*found, *excited(subject))


def mismatches(subject: Subject) -> tuple[Check, ...]:
    """What S10, S13, S14, S15 and T06 have against one log, for a stage that fits it: checks other than "ok"."""
    evidence = _evidence(subject)
    if not isinstance(evidence, Evidence):
        return against_command(subject)
    found = _misplaced(evidence) or _by_either(subject, _fitting(evidence))
    return tuple(check for check in found if isinstance(check, Check) and check.level != "ok")


def _evidence(subject: Subject) -> Evidence | tuple[NotTested, ...]:
    """The torque rows of a log; or why there are none."""
    log = subject.log
    if not subject.sampled or not subject.good.time.known:
        return ()
    if log.experiment not in ("excitation", "free", "writing"):
        return _open(subject, f"a '{log.experiment}' log does not move the whole arm")
    if not subject.good.runs:
        return _open(subject, "no stretch of even samples is long enough")
    if (spread(subject.good.log.tau) == 0).any() or (subject.travel == 0).any():
        return _open(subject, "a joint's position or torque never changes")
    motion = sample_motion(subject.good)
    body = rigid_body(log.robot)
    if motion is None or len(motion.t) < 4 * (len(body.parameters) + 4):
        return _open(subject, f"too short for the {len(body.parameters) + 4} numbers that explain a joint's torque")
    return Evidence(subject, body, motion)


def _misplaced(e: Evidence) -> tuple[Check, ...]:
    """Columns in the wrong place, or an angle in the wrong scale: nothing else can be said of such a log."""
    return tuple(torque_columns(e) or position_columns(e) or encoder_scale(e))


def _fitting(e: Evidence) -> tuple[Check | NotTested, ...]:
    """S13, S14, S15 and T06 of a log whose columns are in their places."""
    return (*_explained(e), *_signs(e), *_ratios(e), *_clock(e))


def _by_either(subject: Subject, found: Sequence[Check | NotTested]) -> tuple[Check | NotTested, ...]:
    """What motion says against a torque; where that closes no gate, what the controller does, in place of the same code."""
    if any(isinstance(check, Check) and check.gate and check.level != "ok" for check in found):
        return tuple(found)
    fine = {check.code for check in found if isinstance(check, Check) and check.level == "ok"}
    clear = fine | ({"RRID-S10"} if "RRID-S15" in fine else set())  # gains may be described wrong, and the torque be right
    told = tuple(check for check in against_command(subject) if check.code not in clear - {"RRID-T06"})
    return (*told, *(one for one in found if one.code not in {check.code for check in told}))


def _open(subject: Subject, reason: str) -> tuple[NotTested, ...]:
    return tuple(found for code in ("S13", "S14", "S15", "T06") for found in subject.cannot_tell(code, reason))


def _explained(e: Evidence) -> list[Check]:
    """S13: a joint whose torque nothing explains, beside others whose torque is, has another channel's torque or none."""
    told = e.telling
    words = ", ".join(f"{v:.2g}" for v in e.residual[told])
    lost = told[e.residual[told] > _UNEXPLAINED]
    rest = np.delete(e.residual[told], np.searchsorted(told, lost))
    clear = lost.size and rest.size and rest.max() < _EXPLAINED and e.residual[lost].min() > _APART * rest.max()
    if not clear:
        held = "" if len(told) == e.n_joints else "; joints that are only held cannot tell"
        return e.subject.ok("S13", f"each joint's torque fits its own motion best, relative residual {words}{held}")
    others = ", ".join(f"{v:.2g}" for v in rest)
    return [e.subject.say("S13", "warn",
                          f"joint {j + 1}'s torque is not explained by its motion: relative residual {e.residual[j]:.2g}, "
                          f"others {others}",
                          signal="tau", joint=j,
                          remedy="unless a diagnosis names a cause there, look whether this column is that joint's torque, or "
                                 "repeats another's")
            for j in lost.tolist()]


def _signs(e: Evidence) -> list[Check]:
    """S14: inertia is positive and friction takes power; a torque with its sign flipped says the opposite of both."""
    flipped = [j for j in e.telling.tolist() if _negative(e, j)]
    if not flipped:
        return e.subject.ok("S14", "inertia of every joint is positive", signal="tau")
    where = "all joints" if len(flipped) == e.n_joints > 1 else ", ".join(f"joint {j + 1}" for j in flipped)
    return [e.subject.say("S14", "warn",
                          f"the torque of {where} looks flipped: inertia and friction come out negative",
                          signal="tau", joint=j, gate=True,
                          remedy="change the sign of this torque on import, or of its position") for j in flipped]


def _negative(e: Evidence, joint: int) -> bool:
    """Return whether this row alone needs inertia or friction to be negative, and the other does not speak against it.

    Needs: without it the residual would be twice as large. Forcing d·x = 0 on least squares adds (d·x)² / var(d·x) · s² to
    the squared residual. Significance alone would not do: with torques this precise, a slip of the smoothing is
    significant. A late torque can make friction negative, but never inertia.
    """
    motion, row = e.motion, e.rows[joint]
    if e.residual[joint] > 0.7:
        return False
    unit = np.zeros_like(motion.q)
    unit[:, joint] = 1.0
    still = np.zeros_like(motion.q)
    mass = (e.body.regressor(motion.q, still, unit) - e.body.regressor(motion.q, still, still))[:, joint]
    inertia = np.concatenate([mass.mean(axis=0), [1.0, 0.0, 0.0, 0.0]])
    speed = motion.dq[:, joint]
    friction = np.concatenate([np.zeros(mass.shape[1] + 1), [np.mean(speed**2), np.mean(motion.coulomb[:, joint] * speed)], [0.0]])
    value, covariance = row.estimate(motion.tau[:, joint])
    sigmas = [float(d @ value) / max(float(np.sqrt(d @ covariance @ d)), 1e-300) for d in (inertia, friction)]
    decisive = -np.sqrt(_DOUBLED * max(1, len(motion.t) - row.basis.shape[1]))
    return (sigmas[0] < decisive and sigmas[1] < _SURE) or (sigmas[1] < decisive and sigmas[0] < -_SURE)


def _ratios(e: Evidence) -> Sequence[Check | NotTested]:
    """S15: the torque is as large as the described links need, within what load and friction can make of it; as the other
    joints' torques need, where the description says nothing."""
    known = e.body.known_parameters()
    if known is None:
        return _against_the_others(e) or e.subject.cannot_tell(
            "S15", "the robot's description has no masses and inertias to compare with", signal="tau")
    slopes = _slopes(e, known)
    seen = [f"joint {j + 1}: {slope:.3g}" for j, slope in slopes.items()]
    if (far := _far(slopes)) and (unit := _angle_unit(e, known, slopes)):
        return [unit]
    found = [e.subject.say("S15", "warn",
                           f"tau of joint {j + 1} is {slope:.3g} times what the described links need",
                           signal="tau", joint=j, gate=True,
                           remedy=_divided(j + 1, slope)) for j, slope in far.items()]
    if not seen:
        return _against_the_others(e) or e.subject.cannot_tell(
            "S15", "the described masses and inertias do not explain the torque of any joint, so that a wrong gear ratio or unit "
            "would not show", signal="tau")
    return found or _against_the_others(e) or e.subject.ok(
        "S15", f"torque over that of the described links: {', '.join(seen)}", signal="tau")


def _slopes(e: Evidence, known: Array, angles: float = 1.0) -> dict[int, float]:
    """Torque over that of the described links, of each joint that they explain, with every angle times `angles`."""
    motion = e.motion
    scale = np.where([one.revolute for one in e.subject.log.robot.joints], angles, 1.0)
    expected = e.body.torque(motion.q * scale, motion.dq * scale, motion.ddq * scale, known)
    slopes = {}
    for j in e.telling.tolist():
        friction = np.stack([motion.dq[:, j], motion.coulomb[:, j], np.ones(len(motion.t))], axis=-1)
        columns = np.concatenate([expected[:, j:j + 1], friction], axis=1)
        without, left = _unexplained(friction, motion.tau[:, j]), _unexplained(columns, motion.tau[:, j])
        if left <= _RATIO_RESIDUAL and left <= 0.4 * without:  # else the described links are not this arm's; they say nothing
            slopes[j] = float(np.linalg.lstsq(columns, motion.tau[:, j], rcond=None)[0][0])
    return slopes


def _far(slopes: dict[int, float]) -> dict[int, float]:
    return {j: slope for j, slope in slopes.items() if slope > _RATIO or 0 < slope < 1 / _RATIO}


def _angle_unit(e: Evidence, known: Array, as_declared: dict[int, float]) -> Check | None:
    """S15: with every angle in another unit the described links explain the torques of more joints, each as large as they need.

    Where no more are explained, as of one joint that only turns inertia, a gear ratio would do the same.
    """
    joint, far = max(_far(as_declared).items(), key=lambda one: abs(np.log(one[1])))
    for name, factor in ANGLE_UNITS.items():
        slopes = _slopes(e, known, factor)
        if as_declared.keys() < slopes.keys() and not _far(slopes) and min(slopes.values()) > 0.0:
            return e.subject.say("S15", "warn",
                                 f"the unit of q looks wrong: as declared, tau of joint {joint + 1} is {far:.3g} times what the "
                                 f"described links need; with every angle multiplied by {name}, "
                                 f"{min(slopes.values()):.3g} to {max(slopes.values()):.3g} times",
                                 signal="q", gate=True, remedy=UNIT_REMEDY)
    return None


def _against_the_others(e: Evidence) -> list[Check]:
    """S15 without a description: all torques come from one set of rigid parameters."""
    if (found := torque_scale(e)) is None:
        return []
    places = ", or tau of ".join(f"joint {joint + 1} {'is ' * (not k)}{factor:.3g} times" for k, (joint, factor) in
                                 enumerate(((found.joint, found.factor), *found.others)))
    ratio = ": only their ratio shows" if found.others else ""
    return [e.subject.say("S15", "warn",
                          f"tau of {places} what the other joints' torques need{ratio}, "
                          f"residual {found.before:.2g} -> {found.after:.2g}",
                          signal="tau", joint=found.joint, gate=True,
                          remedy=_divided(found.joint + 1, found.factor))]


def _divided(joint: int, factor: float) -> str:
    """S15's remedy for a torque."""
    return (f"look for a gear ratio or torque constant of about {factor:.3g} or {1 / factor:.3g} that was applied twice or not at "
            f"all; tau of joint {joint} divided by {factor:.3g} would fit")


def _unexplained(columns: Array, tau: Array) -> float:
    """Share of the variation of `tau` that `columns` leave."""
    rest = tau - columns @ np.linalg.lstsq(columns, tau, rcond=None)[0]
    return float(np.linalg.norm(rest) / np.linalg.norm(tau - tau.mean()))


def _clock(e: Evidence) -> Sequence[Check | NotTested]:
    """T06: position and torque were stamped by the same clock."""
    found = clock_offset(e.rows, e.motion, e.telling.tolist())
    if found is None:
        return e.subject.cannot_tell("T06", "no torque follows its motion closely enough to time it", signal="tau")
    if found.joints < 2:
        return e.subject.cannot_tell("T06", "one joint's torque alone is understood, and what its friction does at a reversal "
                                     "looks like an offset of the clocks", signal="tau")
    ms = 1e3 * e.motion.sample_time
    words = (f"torque lies {abs(found.samples):.2f} ± {found.bound:.2f} samples ({abs(found.samples) * ms:.3g} ms) "
             f"{'behind' if found.samples > 0 else 'ahead of'} the motion")
    drift = f"{found.drift:+.2f} ± {found.drift_bound:.2f} samples over the log"
    if abs(found.drift) > 1.0 + found.drift_bound:
        return [e.subject.say("T06", "warn",
                              f"the clocks of q and tau drift by {drift}",
                              signal="tau", gate=abs(found.drift) > 1.0 + _DRIFTS * found.drift_bound,
                              remedy="stamp position and torque by one clock")]
    if abs(found.samples) > 1.0 + found.bound:
        rest = away_from_reversals(e.body, e.motion, found.samples, e.telling.tolist())
        if rest is None or abs(rest.samples - found.samples) > 1.0 + found.bound + rest.bound:
            return e.subject.cannot_tell("T06", f"{words}, but not away from reversals: friction that lags there looks like it",
                                         signal="tau")
        return [e.subject.say("T06", "warn",
                              f"{words}, alike in {found.joints} joints; it drifts by {drift}",
                              signal="tau",
                              remedy="look for a delay between the recorders of q and tau; 'diagnose' tells a late "
                                     "encoder from a late drive")]
    if found.bound > _TIMED:
        return e.subject.cannot_tell("T06", f"{words}: an offset of one sample would not show", signal="tau")
    return e.subject.ok("T06", f"{words}, drift {drift}", signal="tau")
