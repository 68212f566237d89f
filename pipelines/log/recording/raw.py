"""A recording as it was found: named columns of numbers, with everything a message needs to point back into the file."""

from __future__ import annotations

import difflib
import itertools
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.errors import Check, InputRejected, UsageError, clean, did_you_mean
from pipelines.log.experiment import Array
from pipelines.log.limits import FEWEST
from pipelines.log.recording.header import split_unit

__all__ = ["RawTable", "columns_of_arrays", "expand", "unstacked"]

_PART = re.compile(r"_\d+$|\[\d+\]$")  # of an array
_MOST_KEYS = 32  # joints, servos or environments in turn
_SEPARATE = (
    0.5  # mean step from key to key over that from row to row: 1 for noise, more for one motion
)
_ROUNDED = 1e-3  # of a clock's step: what rounding may take
_WIDEST_MATRIX = 64  # more joints than any arm: what is wider is not "one column a joint"


@dataclass(frozen=True, eq=False)
class RawTable:
    """Columns of equal length. `rows` numbers the samples as they stood in the file, so that one left out leaves a hole."""

    source: str
    columns: Mapping[str, Array]
    rows: npt.NDArray[np.int64]  # (samples,) 0-based
    units: Mapping[str, str] = field(default_factory=dict)  # what a header says
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # matrix -> its columns
    text: Mapping[str, str] = field(
        default_factory=dict
    )  # columns that are not numbers -> an example
    labels: Mapping[str, str] = field(
        default_factory=dict
    )  # those of them that hold one text throughout -> that text
    notes: tuple[str, ...] = ()  # lines above the table that name no column
    cycles: Mapping[str, tuple[str, ...]] = field(
        default_factory=dict
    )  # columns of text that repeat -> their texts
    lines: npt.NDArray[np.int64] | None = None  # (samples,) line numbers, in a text file
    breaks: tuple[
        int, ...
    ] = ()  # index of the first sample after damage: the clock of a fixed rate is lost there
    checks: tuple[Check, ...] = ()
    sha256: str = ""

    def place(self, index: int) -> str:
        """Where sample `index` stands in the file, in words."""
        return (
            f"row {int(self.rows[index]) + 1}"
            if self.lines is None
            else f"line {int(self.lines[index])}"
        )

    def name_of(self, column: str | int, wanted: str = "") -> str:
        """The name of a column asked for by name or by 1-based number, as what is `wanted`: "tau_1", "t".

        Raises:
            InputRejected: S01, there is none; S12, it does not hold numbers.
        """
        names = [*self.columns, *self.text]
        if isinstance(column, int):
            ordered = list(self.columns)
            if not 1 <= column <= len(ordered):
                message = f"no column {column}; the file has {len(ordered)} columns of numbers"
                remedy = "columns count from 1; correct the recipe"
                raise InputRejected("S01", message, where=self.source, remedy=remedy)
            return ordered[column - 1]
        whole = (
            column if column in (*self.columns, *self.text) else _PART.sub("", column)
        )  # an array that is no columns
        if whole in self.text:
            message = f"column '{whole}' holds no numbers but '{self.text[whole]}'"
            remedy = "export it as numbers, one row a sample, or choose another column"
            raise InputRejected("S12", message, where=self.source, remedy=remedy)
        if column not in self.columns:
            message = f"no column '{column}'{did_you_mean(column, names)}; there are {', '.join(names[:40])}"
            raise InputRejected(
                "S01", message, where=self.source, remedy=self._remedy(column, wanted)
            )
        return column

    def _remedy(self, column: str, wanted: str) -> str:
        """Which columns could be meant: by their names, those of the signal that was asked for."""
        from pipelines.log.recording.column_names import signal_of

        if not wanted:
            return "correct the recipe"
        signal = wanted.rpartition("_")[0] or wanted
        fitting = [name for name in self.columns if signal_of(name) == signal]
        near = difflib.get_close_matches(column, fitting or list(self.columns), n=1) or fitting[:1]
        if not near:
            return f"correct the recipe, or pass --map {wanted}='…' with the column of {wanted}"
        others = [name for name in fitting if name != near[0]]
        also = f" (or {', '.join(others[:8])})" if others else ""
        return f"correct the recipe, or pass --map {wanted}='{near[0]}'{also}"


def expand(
    table: RawTable,
    columns: str | int | tuple[str | int, ...],
    n: int,
    signal: str,
    instead: Mapping[int, str] | None = None,
) -> tuple[str, ...]:
    """The names of the `n` columns that hold `signal`: a list, a pattern such as "Joint_{j}", or the name of a matrix.

    `instead` names the column of single joints (1-based) differently: what --map says.

    Raises:
        InputRejected: S01 a column is missing, S02 there are not `n` of them, S12 one holds no numbers.
        UsageError: C02, one column for two joints.
    """
    if isinstance(columns, str) and "{j}" in columns:
        if (further := columns.replace("{j}", str(n + 1))) in table.columns:
            have = next(
                j
                for j in range(n + 1, 1000)
                if columns.replace("{j}", str(j + 1)) not in table.columns
            )
            _wrong_count(table, signal, have, n, f"'{further}' is there as well")
        columns = tuple(columns.replace("{j}", str(j)) for j in range(1, n + 1))
    elif isinstance(columns, str) and columns not in table.columns and columns in table.groups:
        columns = table.groups[columns]
    chosen = (columns,) if isinstance(columns, str | int) else columns
    if len(chosen) != n:
        _wrong_count(
            table, signal, len(chosen), n, "the recipe names " + ", ".join(str(c) for c in chosen)
        )
    names = tuple(
        table.name_of((instead or {}).get(j, column), f"{signal}_{j}")
        for j, column in enumerate(chosen, start=1)
    )
    for j, name in enumerate(names, start=1):
        if (first := names.index(name) + 1) < j:
            message = f"column '{name}' serves {signal} of joint {first} and of joint {j}"
            remedy = (
                f"give each joint its own column in signals.{signal}, or by --map {signal}_{j}=…"
            )
            raise UsageError("C02", message, where=table.source, remedy=remedy)
    return names


def _wrong_count(table: RawTable, signal: str, have: int, n: int, why: str) -> None:
    message = f"{have} columns for {signal}, but the robot has {n} joints ({why})"
    remedy = "name the robot this was recorded on, or list the columns of its joints"
    raise InputRejected("S02", message, where=table.source, remedy=remedy)


def columns_of_arrays(arrays: Mapping[str, npt.NDArray[np.generic]], source: str) -> RawTable:
    """A table from named arrays of one or two dimensions (NPY, MAT); the samples are the side that most arrays share.

    Raises:
        InputRejected: S11 where arrays can be read both ways, S12 where none holds real numbers.
    """
    text = {
        name: problem for name, array in arrays.items() if (problem := _not_real(array)) is not None
    }
    texts = {
        name: array
        for name, array in arrays.items()
        if name in text and array.dtype.kind == "U" and array.size <= _MOST_KEYS
    }
    notes = tuple(
        (f"{name} = " if name[:1] != "@" else "") + " ".join(map(str, array.flat))
        for name, array in texts.items()
    )
    notes += tuple(
        f"{name} = {array.flat[0]}"
        for name, array in arrays.items()
        if array.size == 1 and array.dtype.kind in "fiub"
    )
    usable = {name: array for name, array in arrays.items() if name not in text and array.size > 1}
    samples = _samples_of(usable, source)
    checks: list[Check] = []
    columns: dict[str, Array] = {}
    groups: dict[str, tuple[str, ...]] = {}
    units: dict[str, str] = {}
    for name, array in usable.items():
        matrix = array[:, None] if array.ndim == 1 else array
        rows, wide = matrix.shape
        if samples not in matrix.shape or rows == wide:
            text[name] = f"an array of shape {array.shape}, " + (
                "square" if rows == wide else f"not of {samples} samples"
            )
            continue
        if (wide if rows == samples else rows) > _WIDEST_MATRIX:
            continue
        if rows != samples and rows > 1:
            message = f"'{name}' is stored as {matrix.shape}, read as {(wide, rows)}: time along the long side"
            remedy = "store one row a sample"
            checks.append(Check.of("S11", "warn", message, where=source, remedy=remedy))
        matrix = matrix if rows == samples else matrix.T
        short, unit = split_unit(name)
        names = (
            (short,)
            if matrix.shape[1] == 1
            else tuple(f"{short}_{j + 1}" for j in range(matrix.shape[1]))
        )
        groups[short] = names
        units.update(dict.fromkeys(names, unit) if unit else {})
        columns.update(
            (key, np.ascontiguousarray(matrix[:, j], dtype=np.float64))
            for j, key in enumerate(names)
        )
    if not columns:
        found = ", ".join(f"{name} ({what})" for name, what in text.items()) or "nothing"
        message = f"no array of real numbers; there is {found}"
        remedy = "save plain numeric arrays, one row a sample"
        raise InputRejected("S12", message, where=source, remedy=remedy)
    return RawTable(
        source,
        columns,
        np.arange(samples),
        units=units,
        groups=groups,
        text=text,
        checks=tuple(checks),
        notes=notes,
    )


def _samples_of(arrays: Mapping[str, npt.NDArray[np.generic]], source: str) -> int:
    """Return the number of samples: the side that most arrays have, the longer one where two are shared alike.

    Raises:
        InputRejected: S11, two sides are shared alike, and neither is clearly longer.
    """
    shared: Counter[int] = Counter()
    for array in arrays.values():
        rows, wide = (array.shape[0], 1) if array.ndim == 1 else array.shape
        shared.update(
            {n for n, other in ((rows, wide), (wide, rows)) if n > 1 and other <= _WIDEST_MATRIX}
        )
    enough = {n: count for n, count in shared.items() if n >= FEWEST} or dict(shared)
    samples = max(enough, key=lambda n: (enough[n], n), default=0)
    square = [name for name, array in arrays.items() if array.shape == (samples, samples)]
    alike = (
        square
        if len(square) == enough.get(samples)
        else [
            name
            for name, array in arrays.items()
            if samples in array.shape
            and _either_way(array)
            and enough.get(sum(array.shape) - samples) == enough[samples]
        ]
    )
    if alike:
        message = (
            f"'{alike[0]}' has shape {arrays[alike[0]].shape}: which side is time is not known"
        )
        remedy = "store one row a sample, with many more samples than columns"
        raise InputRejected("S11", message, where=source, remedy=remedy)
    return samples


def described(record: Mapping[str, Any]) -> str:
    """Return "hip_angle [rad]" of a record that names its samples and their unit; "" where it has no name."""
    name = next(
        (
            value
            for key, value in record.items()
            if key.lower() in ("name", "label") and isinstance(value, str)
        ),
        "",
    )
    return name[:200] + unit_in(record) if name else ""


def distinct(name: str, found: Mapping[str, object], source: str) -> str:
    """Return a name that is not yet among those found.

    Raises:
        InputRejected: S03, it is.
    """
    if name in found:
        message = f"two series are both named '{clean(name, 80)}'"
        raise InputRejected("S03", message, where=source, remedy="rename one of them in the file")
    return name


def unit_in(record: Mapping[str, Any]) -> str:
    """Return " [rad]" of a record, or of the attributes of an array, with an entry for the unit; "" without one."""
    unit = next(
        (value for key, value in record.items() if key.lower() in ("unit", "units", "einheit")), ""
    )
    return f" [{unit}]" if isinstance(unit, str) and 0 < len(unit) <= 20 else ""


def _not_real(array: npt.NDArray[np.generic]) -> str | None:
    """Why an array is not a signal, in words; None where it is one."""
    if array.dtype.kind not in "fiub":
        return {"c": "complex numbers", "O": "objects", "U": "text", "S": "text"}.get(
            array.dtype.kind, str(array.dtype)
        )
    if array.dtype.kind in "iu" and array.size > 1 and not _exact(array.astype(np.float64).ravel()):
        return f"{array.dtype} beyond 2^53, which a real number of 64 bit cannot hold exactly"
    if array.ndim > 2 or array.ndim == 0:
        return f"an array of {array.ndim} dimensions"
    return None


def _exact(values: Array) -> bool:
    """Tell whether whole numbers are below 2^53, or their rounding is little beside their steps, as of ns since 1970."""
    rounding = float(np.spacing(np.abs(values).max()))
    return rounding <= 1.0 or bool(np.median(np.abs(np.diff(values))) > rounding / _ROUNDED)


def _either_way(array: npt.NDArray[np.generic]) -> bool:
    """Tell whether neither side of a matrix is clearly longer."""
    if array.ndim < 2 or array.size <= 1 or 1 in array.shape:
        return False
    rows, wide = array.shape
    return not (rows >= 4 * wide or (rows > wide and wide <= 3) or wide >= 4 * rows)


def unstacked(table: RawTable) -> RawTable:
    """Return a table of one row a joint with the rows of one sample beside each other; any other table as it is.

    A key is a column of names or numbers that goes through the same k, all different, again and again. Rows of one key
    continue each other and neighbouring rows do not: what merely counts modulo k in one motion is no key. Of key "joint",
    "position" becomes "position[elbow]", …; what the k rows of every sample share stays one column.
    """
    for key, words in (
        *table.cycles.items(),
        *itertools.islice(_numbers_in_turn(table), _MOST_KEYS),
    ):
        k = len(words)
        if len(set(words)) < k or not any(
            _interleaved(values, k) for values in table.columns.values()
        ):
            continue
        samples = table.rows.size // k
        columns: dict[str, Array] = {}
        groups = {}
        for name, values in table.columns.items():
            rows = values[: samples * k].reshape(samples, k)
            if np.array_equal(rows, np.broadcast_to(rows[:, :1], rows.shape), equal_nan=True):
                columns[name] = rows[:, 0].copy()
            elif not np.array_equal(rows[1:], rows[:-1]):  # the numbers of the keys themselves
                groups[name] = tuple(f"{name}[{word}]" for word in words)
                columns |= zip(groups[name], map(np.ascontiguousarray, rows.T), strict=True)
        check = Check.of(
            "S11",
            "warn",
            f"{k} rows a sample, one for each '{clean(key, 40)}': put beside each other",
            where=table.source,
            remedy="export one row a sample",
        )
        units = {name: unit for name, unit in table.units.items() if name in columns} | {
            column: table.units[name]
            for name, found in groups.items()
            if name in table.units
            for column in found
        }
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
    return table


def _numbers_in_turn(table: RawTable) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield columns of whole numbers that repeat, and the numbers they go through."""
    for name, values in table.columns.items():
        again = np.flatnonzero(values[1 : _MOST_KEYS + 1] == values[:1]) + 1
        if (
            again.size
            and (k := int(again[0])) > 1
            and values.size >= 2 * k
            and np.array_equal(values[k:], values[:-k])
            and (values[:k] == np.round(values[:k])).all()
        ):
            yield name, tuple(f"{value:.0f}" for value in values[:k])


def _interleaved(values: Array, k: int) -> bool:
    """Tell whether every k-th number of a column goes on where its neighbours jump."""
    from_key, from_row = values[k:] - values[:-k], np.diff(values)
    known = np.isfinite(from_key)
    return bool(
        known.any()
        and from_key[known].any()
        and np.abs(from_key[known]).mean()
        < _SEPARATE * np.abs(from_row[np.isfinite(from_row)]).mean()
    )
