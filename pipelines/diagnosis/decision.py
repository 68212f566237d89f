"""Decide: a cause, none, unknown, or that the logs cannot show it.

decision = decide(later, selection, baseline)
result = limited_by_estimate(result, prepared)         the verdict "cannot-judge"
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.diagnosis.baseline import Baseline
from pipelines.diagnosis.events import DIRECTIONS
from pipelines.diagnosis.refit import Later
from pipelines.diagnosis.result import Diagnosis, Verdict
from pipelines.diagnosis.selection import Cause, Round, Selection
from pipelines.diagnosis.state import State
from pipelines.diagnosis.unnamed import in_words
from pipelines.dynamics.arm import Arm
from pipelines.estimation.bootstrap import chi2_bound
from pipelines.estimation.joint_table import Array, in_rows
from pipelines.estimation.judgements import (
    Repeated,
    cannot_judge,
    facts,
    negative_viscous,
    nominal_estimate,
)
from pipelines.estimation.preparation import Prepared

__all__ = ["Decision", "decide", "limited_by_estimate"]


@dataclass(frozen=True)
class Decision:
    """The verdict, and why."""

    verdict: Verdict
    reason: str
    causes: tuple[Cause, ...]


def decide(later: Later, selection: Selection, baseline: Baseline) -> Decision:
    """Return the verdict by significance and goodness of fit.

    Causes lose their names where they explain less than half of what is more than noise at the
    joints on which they act. The residual at other joints is reported with them.
    """
    causes, end, config = selection.causes, selection.end, later.config
    left = end.mean_squares * later.dataset.noise_ratio
    bound = max(config.excess * max(1.0, baseline.usual_fit), baseline.worst_fit)
    missing, (followed, shapes) = _missing(later, end), _followed(later, selection)
    rest = _rest(later, selection.rounds[-1], missing, shapes, left, bound)
    if causes:
        power = np.array([float(y @ y) for y in later.rows.y])
        counts = [len(y) for y in later.rows.y]
        too_much = np.where(left < bound, 0.0, left - baseline.usual_fit) * counts
        beyond = np.maximum(np.maximum(missing**2 * power, too_much), followed)
        strained = end.cost / later.rows.count >= bound
        explained = _explained(later, selection, beyond, strained)
        if explained < config.share:
            reason = f"{causes[0].key[0]} explains {explained:.0%} of the excess residual"
            return Decision("unknown", reason, ())
        if wandering := _confused(later, end):
            first = min(wandering)  # effects that were selected earlier do not depend on it
            rest, causes = wandering[first], causes[:first]
        if not causes:
            return Decision("unknown", rest, ())
        if causes[0].alternatives:
            return Decision("unknown", "several causes explain it", causes)
        return Decision("cause", rest, causes)
    fits = max(float(left.max()), end.cost / later.rows.count) < bound
    doubt = selection.rounds[-1].doubt
    if fits and not rest:
        reason = f"{doubt}; record quicker motion" if doubt else ""
        return Decision("cannot-judge" if doubt else "no-fault-found", reason, ())
    told = (rest or _too_large(left, bound), selection.rounds[-1].stopped)
    return Decision("unknown", "; ".join(one for one in told if one), ())


def _explained(later: Later, selection: Selection, beyond: Array, strained: bool) -> float:
    """Return the share that causes explain of what is more than noise where they act.

    Args:
        beyond: (joints,) squared residual that is more than noise, and left.
        strained: what the prior says against the numbers is more than usual.
    """
    start, end = selection.start, selection.end
    acting = later.acting(end)
    weight = acting / max(float(acting.max()), 1e-12) if acting.any() else np.ones(len(acting))
    gained = np.maximum(start.squares - end.squares, 0.0)
    before, after = (one.cost - one.rss for one in (start, end))
    taken = float(weight @ gained) + max(before - after, 0.0)
    rest = float(weight @ beyond) + (after if strained else 0.0)
    return taken / max(taken + rest, 1e-12)


def _rest(
    later: Later, last: Round, missing: Array, shapes: Sequence[str], left: Array, bound: float
) -> str:
    """Return how the residual exceeds the noise, in words; "" where it does not."""
    more = f"; it follows {last.follows}" if last.follows else ""
    if missing.any():
        return (
            f"{missing.max():.1%} of the torque of joint {int(missing.argmax()) + 1} comes again "
            f"with the motion, and no cause explains it{more}"
        )
    if shapes:
        return shapes[0]
    if left.max() >= bound:
        return _too_large(left, bound) + more
    if last.moment:
        return last.moment
    slow = _wandering(later)
    return _wanders(slow) if slow.max() > later.config.misfit else ""


def _wanders(slow: Array) -> str:
    joint = int(slow.argmax()) + 1
    return f"{slow.max():.1%} of the torque of joint {joint} wanders independently of the motion"


def _too_large(left: Array, bound: float) -> str:
    if left.max() < bound:
        return "the numbers of the model are further from the reference than is usual"
    return (
        f"the mean square residual is {left.max():.2f} of the noise at joint "
        f"{int(left.argmax()) + 1}, where {bound:.2f} is usual at most"
    )


def _missing(later: Later, state: State) -> Array:
    """Return the share of each joint's torque (joints,) that no noise is and the model leaves.

    With reference logs it may have been there before, and their residual is what is usual. Without
    them the noise is what differs between rows of one state. Where both parts of a pair are noise,
    common over differing has an F distribution; 0 below its bound and below `config.misfit`.
    """
    from scipy.special import fdtri

    rows, config = later.rows, later.config
    if later.dataset.reference is not None:
        return np.zeros(rows.n_joints)
    left = in_rows(state.residual, rows.joint)
    pairs = Repeated.of(rows.data)
    common, differing = pairs.parts(left)
    bound = fdtri(pairs.count, pairs.count, 1.0 - config.alpha / rows.n_joints)
    torque = np.array([float(np.mean(y**2)) for y in rows.y])
    share = np.sqrt(np.maximum(common - differing, 0.0) / torque)
    return np.where((common > bound * differing) & (share > config.misfit), share, 0.0)


def _wandering(later: Later) -> Array:
    """Return the share of each joint's torque (joints,) that its noise keeps for a block of time.

    Noise of level σ whitened by A has the density σ² / A(1)² at the lowest frequencies: its means
    over n rows have the variance σ² / (n A(1)²). With reference logs their noise is what is usual.
    """
    rows = later.rows
    whitening = rows.data.logs[0].whitening
    if later.dataset.reference is not None or whitening is None:
        return np.zeros(rows.n_joints)
    each = float(later.block_rows.mean()) / rows.n_joints
    lasting = later.dataset.noise_power / (each * whitening.weights[:, -1].sum(axis=1) ** 2)
    return np.asarray(np.sqrt(lasting / np.maximum(_torque_squared(later), 1e-300)))


def _torque_squared(later: Later) -> Array:
    """Return the mean square (joints,) of the torque as it was measured [(N m)²]."""
    measured = np.concatenate([one.unwhitened for one in later.rows.data.logs], axis=1)
    return np.asarray(np.mean(measured**2, axis=1))


def _confused(later: Later, end: State) -> dict[int, str]:
    """Return {index of the effect: reason} of pushes that wandering torque may look like.

    Only one that is larger at its moment than chance allows is distinguished from it.
    """
    slow, config, found = _wandering(later), later.config, {}
    lasting = slow**2 * _torque_squared(later)  # variance of means over a block
    bound = chi2_bound(config.alpha / config.event_candidates, DIRECTIONS)
    for place, one in enumerate(end.model.effects if slow.max() > config.misfit else ()):
        if one.log is not None:
            motion = later.rows.data.logs[one.log - later.rows.data.first].motion
            size = np.abs(one.effect.torque(motion, end.model.nominal, one.values)).max(axis=0)
            chance = 2.0 * lasting * config.block / one.values["duration"]  # of a half sine
            if np.sum(size**2 / chance) < bound:
                found[place] = _wanders(slow)
    return found


def _followed(later: Later, selection: Selection) -> tuple[Array, tuple[str, ...]]:
    """Return what shapes without a name would take off each joint (joints,), and which they are.

    Without reference logs, and of a relevant part of a joint's torque; with them it may have been
    there before.
    """
    taken = np.zeros(later.rows.n_joints)
    if later.dataset.reference is not None:
        return taken, ()
    power, told = [float(y @ y) for y in later.rows.y], []
    for one in sorted(selection.rounds[-1].significant, key=lambda s: -s.gain):
        joint = one.group.key[1]
        if one.group.kind != "unnamed" or joint is None or taken[joint - 1]:
            continue
        share = np.sqrt(one.gain / power[joint - 1])
        if share > later.config.misfit:
            taken[joint - 1] = one.gain
            shape = in_words(one.group.key)
            told.append(f"{share:.1%} of the torque of joint {joint} follows {shape}")
    return taken, tuple(told)


def limited_by_estimate(found: Diagnosis, prepared: Prepared) -> Diagnosis:
    """Return the diagnosis, "cannot-judge" where its logs cannot show that nothing is wrong.

    An estimate is made only for that verdict, and where viscous friction of the nominal model is
    negative: its check is added then.
    """
    nothing = found.verdict == "no-fault-found"
    if not nothing and not _negative(found.nominal):
        return found
    estimated = nominal_estimate(prepared)
    found = replace(found, checks=negative_viscous(estimated, prepared.logs.identify[0].robot_name))
    left, floor = found.residual_rms.validate, found.noise_floor_origin == "reference logs"
    why = cannot_judge(facts(left, floor, prepared, estimated)) if nothing else ""
    return replace(found, verdict="cannot-judge", reason=why) if why else found


def _negative(arm: Arm | None) -> bool:
    """Return whether viscous friction of any joint is negative."""
    laws = () if arm is None else arm.friction
    return any(law.effect.name == "viscous" and law.values["coefficient"] < 0.0 for law in laws)
