"""D09: whether an excitation shows what `estimate-bps` would estimate from it, by its own equations and its own measure.

    for finding in excited(subject): ...

The motion is that of the quickest filter, which costs a tenth of a smoother; low-pass, columns, weights and what counts as lost in
the noise are those of an estimate, so that one log is not told two things under one code.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.errors import Check, InputRejected
from pipelines.estimation.motion import Reconstruction, reconstruct
from pipelines.io.log import recording
from pipelines.model.estimation.estimate import Estimate, estimate
from pipelines.model.estimation.logs import Recipe, equations_of, with_cutoff
from pipelines.model.estimation.nominal import nominal_columns
from pipelines.model.estimation.words import columns_in_words
from pipelines.quality.subject import NotTested, Subject

__all__ = ["REMEDY", "excitation", "excited"]

REMEDY = "move the joints concerned further and faster, in more postures, and all of them at once"

_LEAST_TRAVEL, _STEPS = 1e-3, 50.0  # [rad or m], encoder steps: a joint that moves less is held


def excited(subject: Subject) -> Sequence[Check | NotTested]:
    """D09 of an "excitation" log: that every base parameter and friction shows, or what does not."""
    if subject.log.experiment != "excitation":
        return []
    try:
        found = excitation(subject)
    except InputRejected as why:
        return subject.cannot_tell("D09", why.message)
    words = found.unresolved.told(columns_in_words(column.name for column in found.columns.names))
    if held := _held(subject, found):  # what sways within its dry friction has columns of friction, and they are made of it
        still = f"joints {', '.join(held)} hardly move" if len(held) > 1 else f"joint {held[0]} hardly moves"
        words = "; ".join(filter(None, (words, f"{still}, which shows nothing of friction")))
    condition = found.solution.condition
    if not words:
        return subject.ok("D09", f"every base parameter and friction shows, condition number {condition:.3g} (unit columns)")
    number = f" (condition number {condition:.3g}, unit columns)" if np.isfinite(condition) else ""
    return [subject.say("D09", "warn", f"insufficient excitation: {words}{number}", gate=True, remedy=REMEDY)]


def excitation(subject: Subject) -> Estimate:
    """What `estimate-bps` fits to this log alone.

    Raises:
        InputRejected: T04, T05, a log of which no equations can be made.
    """
    log, how = recording(subject.log), Reconstruction(method="zero-phase")
    motions = ((log, reconstruct(log, how, subject.good)),)
    columns = nominal_columns(log.robot)
    return estimate(equations_of(motions, with_cutoff(Recipe(how), motions), columns), columns)


def _held(subject: Subject, found: Estimate) -> list[str]:
    """The joints that hardly move, and whose friction seems to show all the same."""
    steps = np.array([step or 0.0 for step in subject.good.steps])
    held = np.flatnonzero(subject.travel < np.maximum(_LEAST_TRAVEL, _STEPS * steps)) + 1
    return [str(joint) for joint in held if f"coulomb:{joint}:level" not in found.unresolved.parameters]
