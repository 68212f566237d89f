"""Decide: a cause, none, or unknown."""

from __future__ import annotations

from dataclasses import dataclass

from pipelines.diagnosis.baseline import Baseline
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.refit import Later
from pipelines.diagnosis.selection import Cause, Selection

__all__ = ["Decision", "decide"]


@dataclass(frozen=True)
class Decision:
    """The verdict, and why."""

    verdict: str  # "cause" | "no-fault-found" | "unknown"
    reason: str
    causes: tuple[Cause, ...]
    explained: float  # share of the excess over the baseline


def decide(
    later: Later, selection: Selection, baseline: Baseline, config: DiagnosisConfig
) -> Decision:
    """Return the verdict by significance and goodness of fit."""
    rows, causes = later.rows.count, selection.causes
    first, last = selection.start.cost / rows, selection.end.cost / rows
    gained = max(selection.explained / rows, 1e-12)
    explained = gained / max(first - baseline.usual_fit, gained) if causes else 0.0
    left = selection.end.mean_squares * later.dataset.noise_ratio
    bound = max(config.excess * max(1.0, baseline.usual_fit), baseline.worst_fit)
    fits = bool(max(float(left.max()), last) < bound)
    if causes and not fits and explained < config.share:
        return Decision(
            "unknown",
            f"{causes[0].key[0]} explains {explained:.0%} of the excess residual",
            (),
            explained,
        )
    if causes and causes[0].alternatives:
        return Decision("unknown", "several causes explain it", causes, explained)
    if causes:
        return Decision("cause", "", causes, explained)
    if not fits and selection.stopped:
        return Decision("unknown", selection.stopped, (), explained)
    if not fits:
        more = f"; it follows {selection.follows}" if selection.follows else ""
        reason = (
            f"the mean square residual is {left.max():.2f} of the noise at joint "
            f"{int(left.argmax()) + 1}, where {bound:.2f} is usual at most{more}"
        )
        return Decision("unknown", reason, (), explained)
    return Decision("no-fault-found", "", (), explained)
