"""Where in a log something happens: in which letter, stroke or stretch of time, and where the tip then is.

    marks = marks_of(log, motion)        marks.labels[marks.at[k]] names sample k

The letters are read back from the log's reference (`recognise`). Where it is no text, the stretches from one standstill of the
tip's reference to the next are numbered; without a reference, or one that never stops, ten stretches of time are.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from pipelines.io.log import Array, ExperimentLog
from pipelines.model.rigid.geometry import serial_chain
from pipelines.model.rigid.kinematics import tip_position
from pipelines.model.writing.recognise import Letter, read_letters

__all__ = ["Marks", "marks_of", "reference_tip"]

_STRETCHES = 10
_STILL = 0.01  # of the largest speed of the tip
_MOST = 60  # stretches between standstills; more of them name nothing
_BRIEFEST = 0.05  # [s] of a stretch


@dataclass(frozen=True, eq=False)
class Marks:
    """A name for every sample."""

    kind: str  # "letters" | "strokes" | "time"
    text: str  # what is written; empty where it is no text
    labels: tuple[str, ...]
    at: npt.NDArray[np.intp]  # (samples,) which label


def reference_tip(log: ExperimentLog) -> Array | None:
    """The tip (samples, 3) [m] that the log's reference asks for; None without one."""
    if "q_ref" not in log or not np.isfinite(log["q_ref"]).all():
        return None
    return tip_position(serial_chain(log.robot), log["q_ref"])


def marks_of(log: ExperimentLog, wanted: Array | None) -> Marks:
    """Names for the samples of `log`; `wanted` is `reference_tip(log)`."""
    if wanted is not None:
        if letters := read_letters(wanted):
            return _of_letters(letters, log.n_samples)
        if (strokes := _strokes(wanted, log.sample_time)) is not None:
            return strokes
    edges = np.linspace(0.0, log.n_samples, _STRETCHES + 1).astype(int)
    ends = [float(log.t[min(k, log.n_samples - 1)] - log.t[0]) for k in edges]
    labels = tuple(f"{a:.1f} to {b:.1f} s" for a, b in pairwise(ends))
    return Marks("time", "", labels, np.repeat(np.arange(_STRETCHES), np.diff(edges)))


def _of_letters(letters: tuple[Letter, ...], samples: int) -> Marks:
    at = np.zeros(samples, dtype=np.intp)
    for k, letter in enumerate(letters):
        at[letter.first:] = k
    text = "".join(" " * letter.spaces + letter.character for letter in letters)
    places = np.cumsum([letter.spaces + 1 for letter in letters])
    return Marks("letters", text, tuple(f"letter {place}, '{letter.character}'"
                                        for place, letter in zip(places.tolist(), letters, strict=True)), at)


def _strokes(wanted: Array, sample_time: float) -> Marks | None:
    """Numbered stretches between standstills; None where there are too few or too many."""
    speed = np.linalg.norm(np.diff(wanted, axis=0, append=wanted[-1:]), axis=1)
    still = speed <= _STILL * speed.max()
    begins = np.flatnonzero(np.diff(np.concatenate([[True], still]).astype(np.int8)) == -1)
    begins = begins[np.diff(begins, append=len(wanted)) * sample_time >= _BRIEFEST]
    if speed.max() == 0.0 or not 2 <= len(begins) <= _MOST:
        return None
    at = np.maximum(np.searchsorted(begins, np.arange(len(wanted)), side="right") - 1, 0)
    return Marks("strokes", "", tuple(f"stretch {k + 1}" for k in range(len(begins))), at)
