"""Decide: a cause, none, or unknown."""

from __future__ import annotations

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

    Causes lose their names where they explain less than half of what is more than noise.
    """
    rows, causes = later.rows.count, selection.causes
    first, last = selection.start.cost / rows, selection.end.cost / rows
    gained = max(selection.explained / rows, 1e-12)
    left = selection.end.mean_squares * later.dataset.noise_ratio
    bound = max(config.excess * max(1.0, baseline.usual_fit), baseline.worst_fit)
    missing, followed = _missing(later, selection.end, config), _followed(later, selection, config)
    fits = bool(max(float(left.max()), last) < bound)
    power = np.array([float(y @ y) for y in later.rows.y])
    excess = max(
        0.0 if fits else first - baseline.usual_fit, gained + float(missing**2 @ power) / rows
    )
    explained = gained / excess if causes else 0.0
    if causes and explained < config.share:
        return Decision(
            "unknown",
            f"{causes[0].key[0]} explains {explained:.0%} of the excess residual",
            (),
        )
    if causes and causes[0].alternatives:
        return Decision("unknown", "several causes explain it", causes)
    if causes:
        return Decision("cause", "", causes)
    if selection.stopped and (missing.any() or followed or not fits):
        return Decision("unknown", selection.stopped, ())
    more = f"; it follows {selection.follows}" if selection.follows else ""
    if missing.any():
        reason = (
            f"{missing.max():.1%} of the torque of joint {int(missing.argmax()) + 1} comes again "
            f"with the motion, and no cause explains it{more}"
        )
        return Decision("unknown", reason, ())
    if followed:
        return Decision("unknown", followed, ())
    if not fits:
        reason = (
            f"the mean square residual is {left.max():.2f} of the noise at joint "
            f"{int(left.argmax()) + 1}, where {bound:.2f} is usual at most{more}"
        )
        return Decision("unknown", reason, ())
    return Decision("no-fault-found", "", ())


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


def _followed(later: Later, selection: Selection, config: DiagnosisConfig) -> str:
    """Return which shape without a name a relevant part of a joint's torque follows; "" if none.

    Without reference logs; with them it may have been there before.
    """
    if later.dataset.reference is not None or not selection.rounds:
        return ""
    power = [float(y @ y) for y in later.rows.y]
    for one in sorted(selection.rounds[-1].significant, key=lambda s: -s.gain):
        name, joint = one.group.key
        if one.group.kind != "unnamed" or joint is None:
            continue
        share = np.sqrt(one.gain / power[joint - 1])
        if share > config.misfit:
            return f"{share:.1%} of the torque of joint {joint} follows {name}:{joint}"
    return ""
