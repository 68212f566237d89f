"""Decide: a cause, none, or unknown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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


def decide(later: Later, selection: Selection, baseline: Baseline, config: DiagnosisConfig) -> Decision:
    """Return the verdict by significance and goodness of fit."""
    rows = later.rows.count
    first, last = selection.start.rss / rows, selection.end.rss / rows
    explained = (first - last) / max(first - baseline.usual_fit, 1e-9)
    largest = float(selection.end.mean_squares.max())
    fits = last <= baseline.worst_fit or largest < config.excess * max(1.0, baseline.usual_fit)
    if selection.causes and (fits or explained > 0.5):
        sets = selection.causes[0].alternatives
        told = "cause" if not sets else "unknown"
        return Decision(told, "several causes explain it" if sets else "", selection.causes, explained)
    if selection.causes:
        return Decision("unknown", f"{selection.causes[0].key[0]} explains {explained:.0%} of the excess residual",
                        (), explained)
    unnamed = [one for one in best_of(later.screened(selection.end)).values() if one.group.kind == "unnamed"]
    free = any(one.gain > baseline.threshold("unnamed", one.freedom, rows) for one in unnamed)
    if selection.stopped or not fits or free:
        what = selection.stopped or (f"the residual is {last:.2f} of the noise, {baseline.worst_fit:.2f} in the reference"
                                     if not fits else "the residual follows a signal, and no cause explains it")
        return Decision("unknown", what, (), explained)
    return Decision("no-fault-found", "", (), float(np.nan))
