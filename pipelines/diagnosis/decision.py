"""Decide: a cause, none, or unknown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.diagnosis.baseline import Baseline
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.refit import Later, State
from pipelines.diagnosis.selection import Cause, Selection
from pipelines.diagnosis.table import Array
from pipelines.model.diagnosis.rows.repeated import Repeated

__all__ = ["Decision", "decide"]


@dataclass(frozen=True)
class Decision:
    """The verdict, and why."""

    verdict: str  # "cause" | "no-fault-found" | "unknown"
    reason: str
    causes: tuple[Cause, ...]


def decide(
    later: Later, selection: Selection, baseline: Baseline, config: DiagnosisConfig
) -> Decision:
    """Return the verdict by significance and goodness of fit.

    Causes lose their names where they explain less than half of what is more than noise at the
    joints on which they act. What is left at others is told beside them.
    """
    causes, end = selection.causes, selection.end
    left = end.mean_squares * later.dataset.noise_ratio
    bound = max(config.excess * max(1.0, baseline.usual_fit), baseline.worst_fit)
    missing, (followed, shapes) = _missing(later, end, config), _followed(later, selection, config)
    rest = _rest(later, selection, missing, shapes, left, bound, config)
    if causes:
        power = np.array([float(y @ y) for y in later.rows.y])
        too_much = np.where(left < bound, 0.0, left - baseline.usual_fit) * _counts(end)
        beyond = np.maximum(np.maximum(missing**2 * power, too_much), followed)
        strained = end.cost / later.rows.count >= bound
        explained = _explained(later, selection, beyond, strained)
        if explained < config.share:
            reason = f"{causes[0].key[0]} explains {explained:.0%} of the excess residual"
            return Decision("unknown", reason, ())
        if confused := _confused(later, end, config):
            return Decision("unknown", confused, ())
        if causes[0].alternatives:
            return Decision("unknown", "several causes explain it", causes)
        return Decision("cause", rest, causes)
    fits = max(float(left.max()), end.cost / later.rows.count) < bound
    if not rest and fits:
        return Decision("no-fault-found", "", ())
    told = (rest or _too_large(left, bound), selection.stopped)
    return Decision("unknown", "; ".join(one for one in told if one), ())


def _counts(state: State) -> Array:
    """(joints,) rows of each."""
    return np.array([len(r) for r in state.residual], dtype=np.float64)


def _explained(later: Later, selection: Selection, beyond: Array, strained: bool) -> float:
    """Return the share that causes explain of what is more than noise where they act.

    Args:
        beyond: (joints,) squared residual that is more than noise, and left.
        strained: what the prior says against the numbers is more than usual.
    """
    start, end = selection.start, selection.end
    acting = later.acting(end)
    weight = acting / max(float(acting.max()), 1e-12) if acting.any() else np.ones(len(acting))
    gained = np.maximum((start.mean_squares - end.mean_squares) * _counts(end), 0.0)
    before, after = (one.cost - one.rss for one in (start, end))
    taken = float(weight @ gained) + max(before - after, 0.0)
    rest = float(weight @ beyond) + (after if strained else 0.0)
    return taken / max(taken + rest, 1e-12)


def _rest(
    later: Later,
    selection: Selection,
    missing: Array,
    shapes: Sequence[str],
    left: Array,
    bound: float,
    config: DiagnosisConfig,
) -> str:
    """Return what the model leaves that is more than noise; "" where it is none."""
    more = f"; it follows {selection.follows}" if selection.follows else ""
    if missing.any():
        return (
            f"{missing.max():.1%} of the torque of joint {int(missing.argmax()) + 1} comes again "
            f"with the motion, and no cause explains it{more}"
        )
    if shapes:
        return shapes[0]
    if left.max() >= bound:
        return _too_large(left, bound) + more
    if selection.moment:
        return selection.moment
    slow = _wandering(later)
    return _wanders(slow) if slow.max() > config.misfit else ""


def _wanders(slow: Array) -> str:
    joint = int(slow.argmax()) + 1
    return f"{slow.max():.1%} of the torque of joint {joint} wanders, whatever the motion is"


def _too_large(left: Array, bound: float) -> str:
    if left.max() < bound:
        return "the numbers of the model are further from the reference than is usual"
    return (
        f"the mean square residual is {left.max():.2f} of the noise at joint "
        f"{int(left.argmax()) + 1}, where {bound:.2f} is usual at most"
    )


def _missing(later: Later, state: State, config: DiagnosisConfig) -> Array:
    """Return the share of each joint's torque (joints,) that no noise is and the model leaves.

    With reference logs it may have been there before, and their residual is what is usual. Without
    them the noise is what differs between rows of one state. Where both parts of a pair are noise,
    common over differing has an F distribution; 0 below its bound and below `config.misfit`.
    """
    from scipy.stats import f as f_law

    rows = later.rows
    if later.dataset.reference is not None:
        return np.zeros(rows.n_joints)
    left = np.empty(rows.count)
    for j, own in enumerate(state.residual):
        left[rows.joint == j] = own
    pairs = Repeated.of(rows.data)
    common, differing = pairs.parts(left)
    bound = f_law.isf(config.alpha / rows.n_joints, pairs.count, pairs.count)
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
    measured = np.concatenate([one.unwhitened for one in rows.data.logs], axis=1)
    lasting = later.dataset.noise_power / (each * whitening.weights[:, -1].sum(axis=1) ** 2)
    return np.asarray(np.sqrt(lasting / np.maximum(np.mean(measured**2, axis=1), 1e-300)))


def _confused(later: Later, end: State, config: DiagnosisConfig) -> str:
    """Return why torque that wanders may look like a cause; "" where it cannot.

    In closed loop the drive answers such a torque a moment later, and so do the motion and its
    record (Ljung 1999, 13.4): only a load that comes again with the motion is told from it.
    """
    others = [
        one.effect.joint
        for one in end.model.effects
        if one.log is not None or one.effect.acts_on not in ("load", "body")
    ]
    slow = _wandering(later)
    at = [j for j in range(len(slow)) if None in others or j + 1 in others]
    slow = np.where(np.isin(np.arange(len(slow)), at), slow, 0.0)
    return _wanders(slow) if slow.max() > config.misfit else ""


def _followed(
    later: Later, selection: Selection, config: DiagnosisConfig
) -> tuple[Array, tuple[str, ...]]:
    """Return what shapes without a name would take off each joint (joints,), and which they are.

    Without reference logs, and of a relevant part of a joint's torque; with them it may have been
    there before.
    """
    taken = np.zeros(later.rows.n_joints)
    if later.dataset.reference is not None or not selection.rounds:
        return taken, ()
    power, told = [float(y @ y) for y in later.rows.y], []
    for one in sorted(selection.rounds[-1].significant, key=lambda s: -s.gain):
        name, joint = one.group.key
        if one.group.kind != "unnamed" or joint is None or taken[joint - 1]:
            continue
        share = np.sqrt(one.gain / power[joint - 1])
        if share > config.misfit:
            taken[joint - 1] = one.gain
            told.append(f"{share:.1%} of the torque of joint {joint} follows {name}:{joint}")
    return taken, tuple(told)
