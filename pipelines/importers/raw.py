"""Hold a recording as it was read: named columns of numbers, and where they are in the file.

Arrays and nested documents become such a table here: time is the side that most arrays share, and a
table of one row a joint becomes one of one row a sample.
"""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.errors import Check, InputRejected, UsageError, clean, did_you_mean
from pipelines.importers.config import ARRAYS
from pipelines.importers.header import split_unit
from pipelines.importers.names import read_name
from pipelines.io.limits import FEWEST
from pipelines.io.log import Array

Anything = npt.NDArray[Any]
Columns = str | int | tuple[str | int, ...]
# Entries of a record that the names of its series hold.
_SAID = ("name", "label", "unit", "units", "einheit")
_NOT_REAL = {"c": "complex numbers", "O": "objects or cells", "U": "text", "S": "text"}


@dataclass(frozen=True, eq=False)
class RawTable:
    """Columns of numbers by name. NaN where a sample is missing."""

    source: str  # the file, as messages name it
    columns: Mapping[str, Array]
    rows: npt.NDArray[np.int64]  # (samples,) 0-based
    units: Mapping[str, str] = field(default_factory=dict)  # what a header says
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # matrix -> its columns
    text: Mapping[str, str] = field(default_factory=dict)  # columns of text -> an example
    labels: Mapping[str, str] = field(default_factory=dict)  # those that hold one text throughout
    notes: tuple[str, ...] = ()  # lines above the table that name no column
    cycles: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # texts that repeat
    lines: npt.NDArray[np.int64] | None = None  # (samples,) line numbers, in a text file
    breaks: tuple[int, ...] = ()  # first samples after damage: the clock of a fixed rate is lost
    checks: tuple[Check, ...] = ()
    sha256: str = ""

    def place(self, index: int) -> str:
        """Return where sample `index` is in the file, in words."""
        row = f"row {int(self.rows[index]) + 1}"
        return row if self.lines is None else f"line {int(self.lines[index])}"

    def name_of(self, column: str | int, wanted: str = "") -> str:
        """Return the column of a name or a 1-based number, for the signal `wanted`: "tau_1", "t".

        Raises:
            InputRejected: S01, it does not exist; S12, it does not hold numbers.
        """
        names, where = [*self.columns], self.source
        if isinstance(column, int):
            if 1 <= column <= len(names):
                return names[column - 1]
            message = f"no column {column}; the file has {len(names)} columns of numbers"
            remedy = "columns count from 1; correct the recipe"
            raise InputRejected("S01", message, where=where, remedy=remedy)
        array = re.sub(r"_\d+$|\[\d+\]$", "", column)  # that has no columns
        whole = column if column in names or column in self.text else array
        if whole in self.text:
            message = f"column '{whole}' holds no numbers but '{self.text[whole]}'"
            remedy = "export it as numbers, one row a sample, or choose another column"
            raise InputRejected("S12", message, where=where, remedy=remedy)
        if column in self.columns:
            return column
        every, remedy = [*names, *self.text], "correct the recipe"
        there = ", ".join(every[: ARRAYS.listed])
        message = f"no column '{column}'{did_you_mean(column, every)}; there are {there}"
        if wanted:
            kind = read_name(wanted).quantity
            alike = [name for name in names if read_name(name).quantity == kind]
            near = did_you_mean(column, alike or names)[16:-2] or [*alike, "…"][0]
            remedy += f", or pass --map {wanted}='{near}'"
        raise InputRejected("S01", message, where=where, remedy=remedy)


def expand(
    table: RawTable, columns: Columns, n: int, signal: str, instead: Mapping[int, str] | None = None
) -> tuple[str, ...]:
    """Return the names of the `n` columns of `signal`: a list, a pattern "Joint_{j}" or a matrix.

    `instead` names the column of single joints (1-based) differently, as --map does.

    Raises:
        InputRejected: S01 a column is missing, S02 there are not `n` of them, S12 no numbers.
        UsageError: C02, one column for two joints.
    """
    why = ""
    if isinstance(columns, str) and "{j}" in columns:
        counted = itertools.count(n + 1)
        name = columns.replace
        have = next(j - 1 for j in counted if name("{j}", str(j)) not in table.columns)
        why = f"'{name('{j}', str(n + 1))}' is there as well"
        columns = tuple(name("{j}", str(j)) for j in range(1, have + 1))
    elif isinstance(columns, str) and columns not in table.columns and columns in table.groups:
        columns = table.groups[columns]
    chosen = (columns,) if isinstance(columns, str | int) else columns
    if len(chosen) != n:
        why = why or "the recipe names " + ", ".join(str(c) for c in chosen)
        message = f"{len(chosen)} columns for {signal}, but the robot has {n} joints ({why})"
        remedy = "name the robot this was recorded on, or list the columns of its joints"
        raise InputRejected("S02", message, where=table.source, remedy=remedy)
    chosen = tuple((instead or {}).get(j, column) for j, column in enumerate(chosen, start=1))
    names = tuple(table.name_of(c, f"{signal}_{j}") for j, c in enumerate(chosen, start=1))
    for j, name_j in enumerate(names, start=1):
        if (first := names.index(name_j) + 1) < j:
            message = f"column '{name_j}' serves {signal} of joint {first} and of joint {j}"
            remedy = f"give each joint its own column in signals.{signal}"
            remedy += f", or by --map {signal}_{j}=…"
            raise UsageError("C02", message, where=table.source, remedy=remedy)
    return names


def flatten(
    document: Any, path: str = "", depth: int = ARRAYS.deepest
) -> Iterator[tuple[str, Any]]:
    """Yield (path, value) of all in nested objects and lists of objects that is neither.

    A record that names itself gives that name to its samples: {"name": "hip", "unit": "rad",
    "values": […]} is "hip [rad]", and with several series "hip.values" and so on.
    """
    items: list[tuple[str, Any]] = []
    if isinstance(document, Mapping):
        texts = {str(key).lower(): x for key, x in document.items() if isinstance(x, str)}
        name = (texts.get("name") or texts.get("label") or "")[: ARRAYS.longest_text]
        own = name + unit_in(texts) if name else ""
        series = [key for key, value in document.items() if own and _is_series(value)]
        alone = [key for key in series if read_name(key).quantity != "time"]
        for key, value in document.items():
            if not series or str(key).lower() not in _SAID:
                stem = name if key in series else path
                items.append((own if alone == [key] else f"{stem}.{key}".lstrip("."), value))
    elif isinstance(document, list) and document and all(isinstance(x, Mapping) for x in document):
        items = [(f"{path}[{k}]", item) for k, item in enumerate(document)]
    else:
        yield path or "column", document
    for inner, value in items if depth else ():
        yield from flatten(value, inner, depth - 1)


def unit_in(record: Mapping[str, Any]) -> str:
    """Return " [rad]" of a record, or of an array's attributes, with an entry for the unit."""
    unit = next((v for key, v in record.items() if key.lower() in _SAID[2:]), "")
    return f" [{unit}]" if isinstance(unit, str) and 0 < len(unit) <= ARRAYS.longest_unit else ""


def _is_series(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return value.dtype.kind in "fiu" and value.size > 1
    return isinstance(value, list) and len(value) > 1 and not isinstance(value[0], str | Mapping)


def columns_of_arrays(arrays: Mapping[str, Anything], source: str) -> RawTable:
    """Return a table of named arrays of one or two dimensions (JSON, NPY, MAT).

    The samples are the side that most arrays share; texts and single numbers are notes.

    Raises:
        InputRejected: S11 where arrays can be read both ways, S12 where none holds real numbers.
    """
    # MATLAB's timeseries of a vector is (n, 1, samples).
    arrays = {k: array.squeeze() if array.shape[2:] else array for k, array in arrays.items()}
    problems = {name: _not_real(array) for name, array in arrays.items() if array.size != 1}
    text = {name: problem for name, problem in problems.items() if problem}
    usable = {k: array for k, array in arrays.items() if k not in text and array.size > 1}
    samples = _samples_of(usable, source)
    checks: list[Check] = []
    columns, units = dict[str, Array](), dict[str, str]()
    groups: dict[str, tuple[str, ...]] = {}
    others: list[str] = []
    for name, array in usable.items():
        matrix = array[:, None] if array.ndim == 1 else array
        rows, wide = matrix.shape
        if samples not in matrix.shape or rows == wide:
            why = "square" if rows == wide else f"not of {samples} samples"
            text[name] = f"an array of shape {array.shape}, {why}"
            long = samples not in matrix.shape and max(matrix.shape) >= FEWEST
            others += [f"'{clean(name, 40)}'"] if long else []
            continue
        matrix = matrix if rows == samples else matrix.T
        if matrix.shape[1] > ARRAYS.widest:
            continue
        if rows not in (samples, 1):
            message = f"'{name}' is stored as {(rows, wide)}, read as {matrix.shape}: time along "
            words, remedy = f"{message}the long side", "store one row a sample"
            checks.append(Check.of("S11", "warn", words, where=source, remedy=remedy))
        short, unit = split_unit(name)
        several = tuple(f"{short}_{j + 1}" for j in range(matrix.shape[1]))
        groups[short] = names = several if several[1:] else (short,)
        units |= dict.fromkeys(names, unit) if unit else {}
        columns |= zip(names, np.ascontiguousarray(matrix.T, dtype=np.float64), strict=True)
    if others:
        message = f"left out, not of {samples} samples: {', '.join(others[:8])}"
        remedy = "save another motion as a file of its own"
        checks.append(Check.of("S11", "warn", message, where=source, remedy=remedy))
    if not columns:
        found = ", ".join(f"{name} ({what})" for name, what in text.items()) or "nothing"
        message = f"no array of real numbers; there is {found}"
        remedy = "save plain numeric arrays, one row a sample"
        raise InputRejected("S12", message, where=source, remedy=remedy)
    return RawTable(source, columns, np.arange(samples), units, groups, text,
                    checks=tuple(checks), notes=notes_of(arrays))  # fmt: skip


def notes_of(arrays: Mapping[str, Anything]) -> tuple[str, ...]:
    """Return "physics_dt = 0.005" of texts and single numbers, whose names may be paths."""
    found = []
    for name, array in arrays.items():
        text = array.dtype.kind == "U" and array.size <= ARRAYS.most_keys
        if text or (array.size == 1 and array.dtype.kind in "fiub"):
            found.append(f"{name} = {' '.join(map(str, array.flat))[: ARRAYS.longest_text]}")
    return tuple(found[: ARRAYS.most_notes])


def _samples_of(arrays: Mapping[str, Anything], source: str) -> int:
    """Return the number of samples: the side of most arrays, the longer one of two shared alike."""
    shared: Counter[int] = Counter()
    for array in arrays.values():
        rows, wide = (array.shape[0], 1) if array.ndim == 1 else array.shape
        sides = ((rows, wide), (wide, rows))
        shared.update({n for n, other in sides if n > 1 and other <= ARRAYS.widest})
    enough = {n: count for n, count in shared.items() if n >= FEWEST} or dict(shared)
    samples = max(enough, key=lambda n: (enough[n], n), default=0)
    matrices = {k: x.shape for k, x in arrays.items() if x.ndim > 1 and 1 not in x.shape}
    open_ = [name for name, shape in matrices.items() if shape == (samples, samples)]
    if len(open_) != enough.get(samples):
        ratio = ARRAYS.clearly_longer
        open_ = [
            name
            for name, (rows, wide) in matrices.items()
            if samples in (rows, wide)
            # Neither side is clearly longer, and as many arrays have the other one:
            and not (rows >= ratio * wide or wide >= ratio * rows or (rows > wide < ratio))
            and enough.get(rows + wide - samples) == enough[samples]
        ]
    if open_:
        message = f"'{open_[0]}' has shape {matrices[open_[0]]}: which side is time is not known"
        remedy = "store one row a sample, with many more samples than columns"
        raise InputRejected("S11", message, where=source, remedy=remedy)
    return samples


def _not_real(array: Anything) -> str:
    """Return why an array is not a signal, in words; "" where it is one."""
    kind = array.dtype.kind
    if kind not in "fiub":
        return _NOT_REAL.get(kind, str(array.dtype))
    if kind in "iu" and array.size > 1:
        # Whole numbers are below 2^53, or rounding takes little of their steps.
        values = array.astype(np.float64).ravel()
        rounding = float(np.spacing(np.abs(values).max()))
        if rounding > max(1.0, ARRAYS.rounded * float(np.median(np.abs(np.diff(values))))):
            return f"{array.dtype} beyond 2^53, which a real number of 64 bit cannot hold exactly"
    return f"an array of {array.ndim} dimensions" if array.shape[2:] or not array.shape else ""


def unstacked(table: RawTable) -> RawTable:
    """Return a table of one row a joint with one row a sample; any other table as it is.

    A key is a column of names or numbers that goes through the same k, all different, again and
    again. Rows of one key continue each other and neighbouring rows do not: what merely counts
    modulo k in one motion is no key. Of key "joint", "position" becomes "position[elbow]", …; what
    the k rows of every sample share stays one column.

    Raises:
        InputRejected: S11, the rows of a key come below those of another.
    """
    keys = (*table.cycles.items(), *itertools.islice(_numbers_in_turn(table), ARRAYS.most_keys))
    for key, words in keys:
        if len(set(words)) == len(words) and any(
            _interleaved(values, len(words)) for values in table.columns.values()
        ):
            return _by_key(table, key, words)
    for name, stamps in table.columns.items():
        # A date comes again and the stamps rise from it again. Runs of one experiment do so too,
        # but their clock starts from zero or goes on.
        falls = np.flatnonzero(np.diff(stamps) < 0) + 1
        again = falls.size and (stamps[falls] == stamps[0]).all() and stamps[0] > np.ptp(stamps)
        if again and read_name(name).quantity == "time":
            message = f"the same times come {falls.size + 1} times: series below each other"
            where = f"{table.source}, column '{name}', {table.place(int(falls[0]))}"
            remedy = "put them side by side, one row a sample: pivot in pandas or in the data base"
            raise InputRejected("S11", message, where=where, remedy=remedy)
    return table


def _by_key(table: RawTable, key: str, words: tuple[str, ...]) -> RawTable:
    """Return the table with the rows of every sample side by side."""
    k = len(words)
    samples = table.rows.size // k
    message = f"{k} rows a sample, one for each '{clean(key, 40)}': put beside each other"
    columns: dict[str, Array] = {}
    groups: dict[str, tuple[str, ...]] = {}
    units: dict[str, str] = {}
    for name, values in table.columns.items():
        rows = values[: samples * k].reshape(samples, k)
        members: tuple[str, ...] = (name,)
        if np.array_equal(rows, np.broadcast_to(rows[:, :1], rows.shape), equal_nan=True):
            columns[name] = rows[:, 0].copy()
        elif not np.array_equal(rows[1:], rows[:-1]):  # the numbers of the keys themselves
            groups[name] = members = tuple(f"{name}[{word}]" for word in words)
            columns |= zip(members, np.ascontiguousarray(rows.T), strict=True)
            if read_name(name).quantity == "time":
                apart = np.median(np.nan_to_num(abs(rows - rows[:, :1])), axis=0).max()
                message += f"; '{clean(name, 40)}' differs by {apart:.3g} in its own unit among"
                message += " them, the log has one time"
        if name in table.units:
            units |= dict.fromkeys(members, table.units[name])
    remedy = "export one row a sample"
    check = Check.of("S11", "warn", message, where=table.source, remedy=remedy)
    first = slice(0, samples * k, k)
    return replace(
        table,
        columns=columns,
        rows=table.rows[first] // k,
        units=units,
        groups=groups,
        cycles={},
        lines=None if table.lines is None else table.lines[first],
        checks=(*table.checks, check),
        breaks=tuple(sorted({at // k for at in table.breaks})),
    )


def _numbers_in_turn(table: RawTable) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield columns of whole numbers that repeat, and the numbers they go through."""
    for name, values in table.columns.items():
        again = np.flatnonzero(values[1 : ARRAYS.most_keys + 1] == values[:1]) + 1
        k = int(again[0]) if again.size else 0
        if k <= 1 or values.size < 2 * k or not np.array_equal(values[k:], values[:-k]):
            continue
        if (values[:k] == np.round(values[:k])).all():
            yield name, tuple(f"{value:.0f}" for value in values[:k])


def _interleaved(values: Array, k: int) -> bool:
    """Return whether every k-th number of a column goes on where its neighbours jump."""
    from_key, from_row = values[k:] - values[:-k], np.diff(values)
    known = np.isfinite(from_key)
    if not known.any() or not from_key[known].any():
        return False
    neighbours = np.abs(from_row[np.isfinite(from_row)]).mean()
    return bool(np.abs(from_key[known]).mean() < ARRAYS.separate * neighbours)
