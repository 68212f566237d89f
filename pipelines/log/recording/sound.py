"""Leave out the samples of a recording that would disturb a guess: holes, absurd numbers, marks of a lost sample."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipelines.errors import InputRejected
from pipelines.log.limits import FEWEST
from pipelines.log.recording.raw import RawTable

__all__ = ["lost_numbers", "sound_samples"]

_USABLE = 0.8  # of the cells of a column that is looked at
_FAR_OFF = 3.0  # ranges of the other numbers between them and one that marks a lost sample
_NO_NUMBER = 1e20  # nanoseconds since 1970 are 2e18


def lost_numbers(table: RawTable) -> list[float]:
    """Return whole numbers that mark a lost sample: in cells of their own, farther off than all others are apart."""
    found: Counter[float] = Counter()
    for column in table.columns.values():
        values = column[np.isfinite(column) & (np.abs(column) < _NO_NUMBER)]
        for number in (float(values.min()), float(values.max())) if values.size else ():
            others = values[values != number]
            rare = others.size > _USABLE * values.size and np.unique(others[:1000]).size >= 50
            if number == 0.0 or number != round(number) or not rare:
                continue  # zero is also a joint at rest
            room = float(np.ptp(others))
            if min(abs(number - others.min()), abs(number - others.max())) > _FAR_OFF * room > 0.0:
                found[number] += values.size - others.size
    return sorted(number for number, cells in found.items() if cells > 1)


def sound_samples(table: RawTable, lost: Sequence[float]) -> RawTable:
    """Leave out what would disturb a guess: rows with a hole, an absurd or a lost number, columns of nothing else."""
    usable = {
        name: np.isfinite(values) & (np.abs(values) < _NO_NUMBER) & ~np.isin(values, lost)
        for name, values in table.columns.items()
    }
    # A table of several topics leaves the cells of the others empty: the rows in which most columns hold numbers.
    masks = Counter(known.tobytes() for known in usable.values() if known.any())
    topic = np.frombuffer(masks.most_common(1)[0][0] if masks else b"", dtype=np.bool_)
    usable = {name: known[topic] for name, known in usable.items()}
    table = replace(
        table,
        columns={name: values[topic] for name, values in table.columns.items()},
        rows=table.rows[topic],
        lines=None if table.lines is None else table.lines[topic],
    )
    columns = {
        name: values for name, values in table.columns.items() if usable[name].mean() > _USABLE
    }
    keep = (
        np.all([usable[name] for name in columns], axis=0) if columns else np.zeros(0, dtype=bool)
    )
    if keep.sum() < FEWEST:
        message = f"{int(keep.sum())} samples without a hole"
        remedy = "give a recording of a motion"
        raise InputRejected("T08", message, where=table.source, remedy=remedy)
    return replace(
        table,
        columns={name: values[keep] for name, values in columns.items()},
        rows=table.rows[keep],
        lines=None if table.lines is None else table.lines[keep],
    )
