"""Decide: a cause, none, or unknown."""

from __future__ import annotations

from dataclasses import dataclass

from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.refit import Later
from pipelines.diagnosis.screening import Baseline, best_of
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
    first, last = selection.start.rss / rows, selection.end.rss / rows
    explained = (first - last) / max(first - baseline.usual_fit, 1e-9)
    largest = float(selection.end.mean_squares.max())
    fits = last <= baseline.worst_fit or largest < config.excess * max(1.0, baseline.usual_fit)
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
    if reason := selection.stopped or _misfit(later, selection, baseline, fits):
        return Decision("unknown", reason, (), explained)
    return Decision("no-fault-found", "", (), explained)


def _misfit(later: Later, selection: Selection, baseline: Baseline, fits: bool) -> str:
    """Return what the final model leaves unexplained; "" where the reference leaves as much."""
    rows = later.rows.count
    if not fits:
        return (
            f"the mean square residual is {selection.end.rss / rows:.2f} of the noise, "
            f"{baseline.worst_fit:.2f} at most in the reference"
        )
    for one in best_of(later.screened(selection.end)).values():
        if one.group.kind == "unnamed" and one.gain > baseline.threshold(
            "unnamed", one.freedom, rows
        ):
            signal, joint = one.group.key
            return f"the residual follows {signal} of joint {joint}, and no cause explains it"
    return ""
