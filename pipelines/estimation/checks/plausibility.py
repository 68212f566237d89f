"""Test whether the torque of a log fits its motion at all, before a model is fitted to it.

    said, boundary = examined(logs)              checks of each log, and what their torque is
    for check in plausibility(Subject(log)): ...

No parameter of the arm has to be known. Each joint's torque is explained by the rigid body with
friction (`rows`); then other explanations are tried on the same rows: another sign, scale or time.
An alternative is reported only where the log as it is is explained badly **and** the alternative
explains it well: what is wrong with an arm that nothing explains better is for `diagnose` to say.

Time: τ(t + d) ≈ τ(t) + d τ̇(t). The residual of τ in a joint's row is compared with that of τ̇
(Gauss-Newton), in each quarter of the log and on each joint: their scatter says how sure the answer
is, their trend is the drift. Friction lags as well after a reversal (Armstrong-Hélouvry, Dupont &
Canudas de Wit 1994), so an offset is accepted only where the rest of the motion shows it too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from pipelines.dynamics.body import RigidBody
from pipelines.dynamics.rrr import rigid_body
from pipelines.errors import Check
from pipelines.estimation.checks.boundary import (
    Boundary,
    boundary_findings,
    torque_boundary,
    without_followers,
)
from pipelines.estimation.checks.rows import (
    Row,
    Sampled,
    relative_residual,
    row_fits,
    sample_motion,
    shared_residual,
)
from pipelines.estimation.config import PlausibilityConfig
from pipelines.estimation.judgements import excited
from pipelines.estimation.least_squares import Indices
from pipelines.io.log import Array, ExperimentLog, recording
from pipelines.quality.checks import check_log
from pipelines.quality.subject import NotTested, Subject, spread

_CONFIG = PlausibilityConfig()
_BLOCKS, _ROUNDS = 4, 6  # numerics
# Student's t for 99.5 % by degrees of freedom: few joints agree by chance more easily than many
# numerics
_STUDENT = (np.inf, 63.7, 9.92, 5.84, 4.60, 4.03, 3.71, 3.50)


@dataclass(frozen=True)
class Offset:
    """Torque lies `samples` later than its motion at mid-log; and how that changes over the log.

    The bounds are 99.5 % ones, from the scatter of the quarters and from that of the joints.
    """

    samples: float
    bound: float
    drift: float
    drift_bound: float
    joints: int  # how many joints' torques are understood well enough to say


def away_from_reversals(
    body: RigidBody, motion: Sampled, offset: float, joints: Sequence[int]
) -> Offset | None:
    """Return the offset from moments at which no joint has just turned round; None of too few.

    Args:
        offset: [samples] that all moments show.
    """
    reach = _CONFIG.lags * abs(offset) * motion.sample_time
    keep = np.ones(motion.dq.shape)
    for j in joints:
        turn = motion.t[:-1][np.diff(np.sign(motion.dq[:, j])) != 0.0]
        if turn.size:
            after = np.searchsorted(turn, motion.t)
            sides = (turn[np.maximum(after - 1, 0)], turn[np.minimum(after, turn.size - 1)])
            near = np.min([np.abs(motion.t - side) for side in sides], axis=0)
            keep[near < reach, j] = 0.0
    rows = row_fits(body, motion, keep)
    if min(keep[:, j].sum() for j in joints) < _CONFIG.moments * len(rows[0].solve):
        return None
    return clock_offset(rows, motion, joints, keep)


def clock_offset(
    rows: Sequence[Row],
    motion: Sampled,
    joints: Sequence[int] | None = None,
    keep: Array | None = None,
) -> Offset | None:
    """Return the offset between the clocks of torque and position; None where nothing tells.

    Args:
        joints: those that are used (from 0); all of them by default.
        keep: as in `row_fits`.
    """
    joints = range(len(rows)) if joints is None else joints
    keep = np.ones_like(motion.dq) if keep is None else keep
    time, span = motion.t - motion.t.mean(), float(np.ptp(motion.t))

    def left(j: int, tau: Array) -> float:
        own = tau[:, j]
        varies = keep[:, j] * (own - own.sum() / max(float(keep[:, j].sum()), 1.0))
        rest = float(np.linalg.norm(rows[j].residual(own)))
        return rest / max(float(np.linalg.norm(varies)), 1e-300)

    # the best of a few offsets, so that the linear steps start near
    offsets = np.linspace(-0.8, 0.8, 17) * motion.reach
    each = [keep * motion.shifted(float(x)) for x in offsets]
    offset = float(offsets[int(np.argmin([sum(left(j, x) ** 2 for j in joints) for x in each]))])
    tau, drift = keep * motion.shifted(offset), 0.0
    timed = [j for j in joints if left(j, tau) < _CONFIG.timed]
    if not timed or span <= 0:
        return None
    middle = np.array([float(part.mean()) for part in np.array_split(time, _BLOCKS)]) / span
    for _ in range(_ROUNDS):
        steps, weight = np.zeros((2, _BLOCKS, len(timed)))  # [samples], and 1 / their variance
        at = offset + drift * time / span
        tau = keep * motion.shifted(at)
        slope = 0.5 * keep * (motion.shifted(at + 1.0) - motion.shifted(at - 1.0))
        for place, j in enumerate(timed):
            rest, turn = rows[j].residual(tau[:, j]), rows[j].residual(slope[:, j])
            variance = max(float(rest @ rest) / len(rest), 1e-300)
            for b, part in enumerate(np.array_split(np.arange(len(rest)), _BLOCKS)):
                power = float(turn[part] @ turn[part])
                if power > 0:
                    steps[b, place] = -float(rest[part] @ turn[part]) / power
                    weight[b, place] = power / variance
        step, bound = _line(steps, weight, middle)
        offset, drift = offset + float(step[0]), drift + float(step[1])
        if np.abs(step).sum() < 1e-3:
            break
    return Offset(offset, float(bound[0]), drift, float(bound[1]), len(timed))


def _line(number: Array, weight: Array, middle: Array) -> tuple[Array, Array]:
    """Return a weighted straight line through the steps, (value, slope), and its bounds."""
    design = np.stack([np.ones_like(middle), middle], axis=-1)
    normal = np.einsum("bj,bk,bl->jkl", weight, design, design)  # of each joint
    right = np.einsum("bj,bk,bj->jk", weight, design, number)
    inverse = np.linalg.pinv(normal.sum(axis=0))
    line = inverse @ right.sum(axis=0)
    rest = weight * (number - (design @ line)[:, None]) ** 2
    freedom, joints = max(1, number.size - 2), number.shape[1]
    bound = 3.0 * np.sqrt(np.diag(inverse) * max(float(rest.sum()) / freedom, 1.0))
    if joints > 1:
        each = (np.linalg.pinv(normal) @ right[..., None])[..., 0]
        share = np.einsum("jkk->jk", normal)
        share = share / share.sum(axis=0)
        between = np.sum(share * (each - line) ** 2, axis=0) / (joints - 1)
        bound = bound + _STUDENT[min(joints - 1, len(_STUDENT) - 1)] * np.sqrt(between)
    return line, bound


Findings = Sequence[Check | NotTested]

_FACTORS = {
    "0.5": 0.5,
    "2": 2.0,
    "0.1": 0.1,
    "10": 10.0,
    "pi/180 (degrees)": np.pi / 180,
    "180/pi": 180 / np.pi,
    "2 pi (turns)": 2 * np.pi,
    "1/(2 pi)": 0.5 / np.pi,
    "-1": -1.0,
}
# what a file may have every angle in
_ANGLE_UNITS = {name: factor for name, factor in _FACTORS.items() if "pi" in name}


@dataclass(frozen=True, eq=False)
class Evidence:
    """The rows of one log, computed once for all questions."""

    subject: Subject
    body: RigidBody
    motion: Sampled

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        return row_fits(self.body, self.motion)

    @cached_property
    def residual(self) -> Array:
        """(joints,) relative residual of each torque by parameters of its own row."""
        return relative_residual(self.rows, self.motion.tau)

    @cached_property
    def telling(self) -> Indices:
        """The joints (from 0) whose row can tell anything: those that move.

        A joint that is held sways within its dry friction, of which no row knows.
        """
        travel = self.subject.travel
        return np.flatnonzero(travel >= _CONFIG.held * travel.max())

    @cached_property
    def few(self) -> Sampled:
        """Fewer moments, for questions that need a new factorisation each."""
        most = 5 * max(row.basis.shape[1] for row in self.rows)
        return self.motion.every(max(1, len(self.motion.t) // most))

    @cached_property
    def slopes(self) -> dict[int, float]:
        """Torque over that of the described links, of each joint (from 0) that they explain."""
        known, motion, slopes = self.body.known_parameters(), self.motion, dict[int, float]()
        if known is None:
            return slopes
        expected = self.body.torque(motion.q, motion.dq, motion.ddq, known)
        for j in self.telling.tolist():
            tau = motion.tau[:, j]
            columns = [motion.dq[:, j], motion.coulomb[:, j], np.ones(len(tau)), expected[:, j]]
            design = np.stack(columns, axis=1)
            fits = [np.linalg.lstsq(design[:, :k], tau, rcond=None)[0] for k in (3, 4)]
            without, left = (np.linalg.norm(tau - design[:, : len(f)] @ f) for f in fits)
            # else the described links are not this arm's; they say nothing
            size = np.linalg.norm(tau - tau.mean())
            if left <= _CONFIG.ratio_residual * size and left <= 0.4 * without:
                slopes[j] = float(fits[1][3])
        return slopes

    @property
    def far(self) -> dict[int, float]:
        """The slopes that no load and no friction explains."""
        far = _CONFIG.ratio
        return {j: s for j, s in self.slopes.items() if s > far or 0 < s < 1 / far}

    def alone(self, motion: Sampled) -> Array:
        """(telling joints,) residual of each by parameters of its own."""
        return relative_residual(row_fits(self.body, motion), motion.tau)[self.telling]

    def together(self, motion: Sampled) -> Array:
        """(telling joints,) residual where all rows share the rigid body's parameters."""
        return shared_residual(self.body, motion, self.telling.tolist())


def plausibility(subject: Subject) -> tuple[Check, ...]:
    """Return S10, S14, S15, T06 and D09 of one log; nothing where it tells nothing."""
    return tuple(found for found in plausibility_findings(subject) if isinstance(found, Check))


def plausibility_findings(subject: Subject) -> tuple[Check | NotTested, ...]:
    """Return the same, and which of these questions the log leaves open, and why."""
    evidence = _evidence(subject)
    found = _found(subject, evidence)
    if isinstance(evidence, str) or _closes(found):
        return found  # what such a torque leaves is no noise to hold the columns against
    return (*found, *excited(subject))


def mismatches(subject: Subject) -> tuple[Check, ...]:
    """Return the checks S10, S14, S15 and T06 of a log that is fitted, other than "ok"."""
    found = _found(subject, _evidence(subject))
    return tuple(one for one in found if isinstance(one, Check) and one.level != "ok")


def _closes(found: Findings) -> bool:
    return any(isinstance(one, Check) and one.gate and one.level != "ok" for one in found)


def _evidence(subject: Subject) -> Evidence | str:
    """Return the rows of a log, or the reason for their absence; empty for a plan."""
    if not subject.sampled or not subject.good.time.known:
        return ""
    log, good, body = subject.log, subject.good, rigid_body(subject.log.robot)
    if log.experiment not in ("excitation", "free", "writing"):
        return f"a '{log.experiment}' log does not move the whole arm"
    if not good.runs:
        return "no stretch of even samples is long enough"
    if (spread(good.log.tau) == 0).any() or (subject.travel == 0).any():
        return "a joint's position or torque never changes"
    numbers, motion = len(body.parameters) + 4, sample_motion(good)
    if motion is None or len(motion.t) < 4 * numbers:
        return f"too short for the {numbers} numbers that explain a joint's torque"
    return Evidence(subject, body, motion)


def _found(subject: Subject, e: Evidence | str) -> tuple[Check | NotTested, ...]:
    """Return what motion shows of a torque; where that closes no gate, what the controller does.

    Of an angle in the wrong scale, nothing else is said.
    """
    if isinstance(e, Evidence):
        if misplaced := _encoder_scale(e):
            return tuple(misplaced)
        found = [*_signs(e), *_sizes(e), *_clock(e)]
    else:
        codes = ("S14", "S15", "T06") if e else ()
        found = [one for code in codes for one in subject.cannot_tell(code, e)]
    if _closes(found):
        return tuple(found)
    clear = {one.code for one in found if isinstance(one, Check) and one.level == "ok"}
    if "RRID-S15" in clear:  # gains may be described wrong, and the torque be right
        clear.add("RRID-S10")
    told = [check for check in _against_command(subject) if check.code not in clear - {"RRID-T06"}]
    codes_told = {check.code for check in told}
    return (*told, *(one for one in found if one.code not in codes_told))


def _against_command(subject: Subject) -> tuple[Check, ...]:
    """Compare the torque with the command of the log's controller, where one is described."""
    if subject.log.controller is None:
        return ()
    from pipelines.simulation.commanded import against_command

    return against_command(subject)


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


def _encoder_scale(e: Evidence) -> list[Check]:
    """S15: would one joint's angle fit better in another scale, or those of all in another unit?

    First with one set of rigid parameters for all rows, where the scale of a joint tells that bends
    nothing and moves little. Then with parameters of its own for each row, where a joint's angle
    bends the arm: that holds for all scales of the torques.
    """
    found = _scaled(e, e.together, _CONFIG.shared_bad) or _scaled(e, e.alone, _CONFIG.scale_bad)
    if found is None or found[2] in e.far:  # what the described links show of a torque
        return []
    before, after, joint, factor = found
    if joint is None:
        words = f"q fits if every angle is multiplied by {factor}"
        remedy = "correct the unit of the angles on import, rad or deg or turns: it is declared "
        remedy += "for all of them"
    else:
        words = f"q of joint {joint + 1} fits if multiplied by {factor}"
        remedy = "correct the gear ratio, the direction or the counts per turn of this encoder; of "
        remedy += "a joint that bends nothing, a wrong torque constant looks alike"
    words += f", residual {before:.2g} -> {after:.2g}"
    place: dict[str, Any] = {"signal": "q"} if joint is None else {"signal": "q", "joint": joint}
    return [e.subject.say("S15", "warn", words, remedy, gate=True, **place)]


def _scaled(
    e: Evidence, residual: Callable[[Sampled], Array], bad: float
) -> tuple[float, float, int | None, str] | None:
    """Return what the log leaves, what the best scale leaves, the joint and the factor.

    Joint None stands for all that turn. Return None where the log leaves at most `bad`, or little
    more than that. By the right scale no row fits worse with its own parameters: a joint that hears
    of another drive may fit far better with an angle scaled down, but the other joints' rows, which
    are correct, do not.
    """
    motion = e.few
    before = _rms(residual(motion))
    if before < bad:
        return None
    rows, found = e.alone(motion), list[tuple[float, int | None, str]]()
    turning = np.array([one.revolute for one in e.subject.log.robot.joints])
    own = [(j, _FACTORS, np.arange(len(turning)) == j) for j in e.telling.tolist()]
    for joint, factors, there in (*own, (None, _ANGLE_UNITS, turning)):
        for name, factor in factors.items():
            s = np.where(there, factor, 1.0)
            other = replace(motion, q=motion.q * s, dq=motion.dq * s, ddq=motion.ddq * s)
            left = _rms(residual(other))
            if left > min(_CONFIG.good, _CONFIG.scale_better * before):
                continue
            fits = e.alone(other)
            # the direction of a joint that bends nothing is that of its torque: S14 tells
            bends = factor > 0.0 or (fits <= _CONFIG.much_better * rows).any()
            if (fits <= _CONFIG.worse * rows).all() and bends:
                found.append((left, joint, name))
    return (before, *min(found, key=lambda one: one[0])) if found else None


def _signs(e: Evidence) -> list[Check]:
    """S14: inertia is positive and friction takes power; a flipped torque says neither."""
    flipped = [j for j in e.telling.tolist() if _negative(e, j)]
    if not flipped:
        return e.subject.ok("S14", "inertia of every joint is positive", signal="tau")
    where = ", ".join(f"joint {j + 1}" for j in flipped)
    if len(flipped) == len(e.rows) > 1:
        where = "all joints"
    words = f"the torque of {where} looks flipped: inertia and friction come out negative"
    remedy, say = "change the sign of this torque on import, or of its position", e.subject.say
    return [
        say("S14", "warn", words, signal="tau", joint=j, gate=True, remedy=remedy) for j in flipped
    ]


def _negative(e: Evidence, joint: int) -> bool:
    """Return whether this row alone needs inertia or friction to be negative.

    And the other does not speak against it. Needs: without it the residual would be twice as large.
    Forcing d·x = 0 on least squares adds (d·x)² / var(d·x) · s² to the squared residual. A late
    torque can make friction negative, but never inertia.
    """
    motion, row = e.motion, e.rows[joint]
    if e.residual[joint] > 0.7:
        return False
    unit, still = np.zeros_like(motion.q), np.zeros_like(motion.q)
    unit[:, joint] = 1.0
    pushed = e.body.regressor(motion.q, still, unit) - e.body.regressor(motion.q, still, still)
    mass, speed = pushed[:, joint].mean(axis=0), motion.dq[:, joint]
    powers = [np.mean(speed**2), np.mean(motion.coulomb[:, joint] * speed)]
    inertia = np.concatenate([mass, [1.0, 0.0, 0.0, 0.0]])
    friction = np.concatenate([np.zeros(len(mass) + 1), powers, [0.0]])
    value, covariance = row.estimate(motion.tau[:, joint])
    mass_sigmas, friction_sigmas = (
        float(d @ value) / max(float(np.sqrt(d @ covariance @ d)), 1e-300)
        for d in (inertia, friction)
    )
    free = max(1, len(motion.t) - row.basis.shape[1])
    decisive, sure = -np.sqrt(_CONFIG.doubled * free), _CONFIG.sure
    light = mass_sigmas < decisive and friction_sigmas < sure
    return light or (friction_sigmas < decisive and mass_sigmas < -sure)


def _sizes(e: Evidence) -> Findings:
    """S15: the torque is as large as the described links need, but for a load and friction."""
    subject, checks = e.subject, []
    for joint, factor in e.far.items():
        words = f"tau of joint {joint + 1} is {factor:.3g} times what the described links need"
        remedy = f"look for a gear ratio or torque constant of about {factor:.3g} or "
        remedy += f"{1 / factor:.3g} that was applied twice or not at all, or another unit of the "
        remedy += f"angles; tau of joint {joint + 1} divided by {factor:.3g} would fit"
        checks.append(subject.say("S15", "warn", words, remedy, True, signal="tau", joint=joint))
    if checks:
        return checks
    if e.body.known_parameters() is None:
        words = "the robot's description has no masses and inertias to compare with"
        return subject.cannot_tell("S15", words, signal="tau")
    if not e.slopes:
        words = "the described masses and inertias do not explain the torque of any joint, so that "
        words += "a wrong gear ratio or unit would not show"
        return subject.cannot_tell("S15", words, signal="tau")
    seen = ", ".join(f"joint {j + 1}: {slope:.3g}" for j, slope in e.slopes.items())
    return subject.ok("S15", f"torque over that of the described links: {seen}", signal="tau")


def _clock(e: Evidence) -> Findings:
    """T06: position and torque were stamped by the same clock."""
    subject, told = e.subject, e.telling.tolist()
    found = clock_offset(e.rows, e.motion, told)
    if found is None or found.joints < 2:
        words = "the torque of fewer than two joints follows its motion closely enough to time it"
        return subject.cannot_tell("T06", words, signal="tau")
    late, bound = abs(found.samples), found.bound
    size = f"{late:.2f} ± {bound:.2f} samples ({late * 1e3 * e.motion.sample_time:.3g} ms)"
    words = f"torque lies {size} {'behind' if found.samples > 0 else 'ahead of'} the motion"
    drift = f"{found.drift:+.2f} ± {found.drift_bound:.2f} samples over the log"
    if abs(found.drift) > 1.0 + found.drift_bound:
        gate = abs(found.drift) > 1.0 + _CONFIG.drifts * found.drift_bound
        remedy = "stamp position and torque by one clock"
        drifts = f"the clocks of q and tau drift by {drift}"
        return [subject.say("T06", "warn", drifts, signal="tau", gate=gate, remedy=remedy)]
    if late > 1.0 + bound:
        rest = away_from_reversals(e.body, e.motion, found.samples, told)
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


__all__ = ["examined"]


def examined(
    logs: Iterable[ExperimentLog], skip_sanity_checks: bool = False, gates: bool = False
) -> tuple[tuple[Check, ...], Boundary | None]:
    """Return the checks of the logs that found something, and the torque boundary.

    Args:
        gates: whether a check that is allowed closes its gate all the same.

    Raises:
        InputRejected: the first reason to reject a log; S13, S23, S24, S25: the torque is not what
            the description says; S13, S14, S15, T06: torque and motion of a log do not belong
            together, with the repair, unless `skip_sanity_checks`.
    """
    every = list(logs)
    said = [_said(log, skip_sanity_checks=skip_sanity_checks) for log in every]
    closed = [told for told in said if isinstance(told, Check)]
    if reject := next((told for told in closed if told.level == "reject"), None):
        raise reject.as_error()
    boundary = torque_boundary(every)
    findings = boundary_findings(boundary, every[0].source or every[0].name if every else "")
    for told in (*(() if skip_sanity_checks else map(_with_way_out, findings)), *closed):
        raise told.as_error()
    checks = (check for told in said if not isinstance(told, Check) for check in told)
    found = (*findings, *without_followers(checks, findings))
    return tuple(check if gates else replace(check, gate=False) for check in found), boundary


def _with_way_out(check: Check) -> Check:
    way_out = "if it is right as it is, say --skip-sanity-checks"
    return replace(check, remedy=f"{check.remedy}; {way_out}")


def _said(log: ExperimentLog, skip_sanity_checks: bool) -> tuple[Check, ...] | Check:
    """Return the checks of one log, or the one that rejects it."""
    subject = Subject(recording(log))
    checks = [check for check in check_log(subject) if check.level != "ok"]
    if reject := next((check for check in checks if check.level == "reject"), None):
        # A controller says by how much a torque is too large, its limits only that it is.
        exact = _against_command(subject) if reject.code == "RRID-S05" else ()
        return next((check for check in exact if check.code == "RRID-S10"), reject)
    against = mismatches(subject)
    if not skip_sanity_checks and (gate := next((check for check in against if check.gate), None)):
        return _with_way_out(gate)
    return (*checks, *against)
