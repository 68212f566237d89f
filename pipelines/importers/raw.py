"""Hold a recording as it was read: named columns of numbers, and where they are in the file."""

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
from pipelines.importers.column_names import read_name, signal_of
from pipelines.importers.text_format import split_unit
from pipelines.io.experiment import Array
from pipelines.io.limits import FEWEST

__all__ = ["Arrays", "RawTable", "columns_of_arrays", "described", "distinct", "expand", "unit_in",
           "unstacked"]  # fmt: skip

Arrays = Mapping[str, npt.NDArray[np.generic]]

_PART = re.compile(r"_\d+$|\[\d+\]$")  # of an array
_MOST_KEYS = 32  # joints, servos or environments in turn
_SEPARATE = 0.5  # mean step from key to key over that from row to row: 1 for noise
_ROUNDED = 1e-3  # of a clock's step: what rounding may take
_WIDEST_MATRIX = 64  # more joints than any arm: what is wider is not "one column a joint"
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
        if isinstance(column, int):
            ordered = list(self.columns)
            if 1 <= column <= len(ordered):
                return ordered[column - 1]
            message = f"no column {column}; the file has {len(ordered)} columns of numbers"
            remedy = "columns count from 1; correct the recipe"
            raise InputRejected("S01", message, where=self.source, remedy=remedy)
        names = [*self.columns, *self.text]
        whole = column if column in names else _PART.sub("", column)  # an array without columns
        if whole in self.text:
            message = f"column '{whole}' holds no numbers but '{self.text[whole]}'"
            remedy = "export it as numbers, one row a sample, or choose another column"
            raise InputRejected("S12", message, where=self.source, remedy=remedy)
        if column not in self.columns:
            there = f"{did_you_mean(column, names)}; there are {', '.join(names[:40])}"
            message, remedy = f"no column '{column}'{there}", self._remedy(column, wanted)
            raise InputRejected("S01", message, where=self.source, remedy=remedy)
        return column

    def _remedy(self, column: str, wanted: str) -> str:
        """Return which columns could be meant: by their names, those of the signal `wanted`."""
        if not wanted:
            return "correct the recipe"
        signal = wanted.rpartition("_")[0] or wanted
        fitting = [name for name in self.columns if signal_of(name) == signal]
        near = difflib.get_close_matches(column, fitting or list(self.columns), n=1) or fitting[:1]
        option = f"correct the recipe, or pass --map {wanted}="
        if not near:
            return f"{option}'…' with the column of {wanted}"
        others = [name for name in fitting if name != near[0]]
        also = f" (or {', '.join(others[:8])})" if others else ""
        return f"{option}'{near[0]}'{also}"


Columns = str | int | tuple[str | int, ...]


def expand(
    table: RawTable, columns: Columns, n: int, signal: str, instead: Mapping[int, str] | None = None
) -> tuple[str, ...]:
    """Return the names of the `n` columns of `signal`: a list, a pattern "Joint_{j}" or a matrix.

    `instead` names the column of single joints (1-based) differently, as --map does.

    Raises:
        InputRejected: S01 a column is missing, S02 there are not `n` of them, S12 no numbers.
        UsageError: C02, one column for two joints.
    """
    if isinstance(columns, str) and "{j}" in columns:
        pattern = columns
        if (further := pattern.replace("{j}", str(n + 1))) in table.columns:
            counted = itertools.count(n + 1)
            have = next(
                j for j in counted if pattern.replace("{j}", str(j + 1)) not in table.columns
            )
            _wrong_count(table, signal, have, n, f"'{further}' is there as well")
        columns = tuple(pattern.replace("{j}", str(j)) for j in range(1, n + 1))
    elif isinstance(columns, str) and columns not in table.columns and columns in table.groups:
        columns = table.groups[columns]
    chosen = (columns,) if isinstance(columns, str | int) else columns
    if len(chosen) != n:
        why = "the recipe names " + ", ".join(str(c) for c in chosen)
        _wrong_count(table, signal, len(chosen), n, why)
    chosen = tuple((instead or {}).get(j, column) for j, column in enumerate(chosen, start=1))
    names = tuple(table.name_of(c, f"{signal}_{j}") for j, c in enumerate(chosen, start=1))
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


def columns_of_arrays(arrays: Arrays, source: str) -> RawTable:
    """Return a table of named arrays of one or two dimensions (NPY, MAT).

    The samples are the side that most arrays share.

    Raises:
        InputRejected: S11 where arrays can be read both ways, S12 where none holds real numbers.
    """
    # MATLAB's timeseries of a vector is (n, 1, samples).
    arrays = {k: array.squeeze() if array.ndim > 2 else array for k, array in arrays.items()}
    problems = {name: _not_real(array) for name, array in arrays.items()}
    text = {name: problem for name, problem in problems.items() if problem}
    usable = {k: array for k, array in arrays.items() if k not in text and array.size > 1}
    samples = _samples_of(usable, source)
    checks: list[Check] = []
    columns: dict[str, Array] = {}
    groups: dict[str, tuple[str, ...]] = {}
    units: dict[str, str] = {}
    others: list[str] = []
    for name, array in usable.items():
        matrix = array[:, None] if array.ndim == 1 else array
        rows, wide = matrix.shape
        if samples not in matrix.shape or rows == wide:
            why = "square" if rows == wide else f"not of {samples} samples"
            text[name] = f"an array of shape {array.shape}, {why}"
            if samples not in matrix.shape and max(matrix.shape) >= FEWEST:
                others.append(f"'{clean(name, 40)}'")
            continue
        if (wide if rows == samples else rows) > _WIDEST_MATRIX:
            continue
        if rows != samples and rows > 1:
            stored = f"'{name}' is stored as {matrix.shape}, read as {(wide, rows)}"
            message, remedy = f"{stored}: time along the long side", "store one row a sample"
            checks.append(Check.of("S11", "warn", message, where=source, remedy=remedy))
        matrix = matrix if rows == samples else matrix.T
        short, unit = split_unit(name)
        several = tuple(f"{short}_{j + 1}" for j in range(matrix.shape[1]))
        groups[short] = names = several if len(several) > 1 else (short,)
        units |= dict.fromkeys(names, unit) if unit else {}
        for j, key in enumerate(names):
            columns[key] = np.ascontiguousarray(matrix[:, j], dtype=np.float64)
    if others:
        message = f"left out, not of {samples} samples: {', '.join(others[:8])}"
        remedy = "save another motion as a file of its own"
        checks.append(Check.of("S11", "warn", message, where=source, remedy=remedy))
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
        notes=(*_texts(arrays, text), *_constants(arrays)),
    )


def _texts(arrays: Arrays, text: Mapping[str, str]) -> Iterator[str]:
    """Yield the texts of arrays of text; the attributes of a file ("@rate") have their names."""
    for name, array in arrays.items():
        if name in text and array.dtype.kind == "U" and array.size <= _MOST_KEYS:
            label = f"{name} = " if name[:1] != "@" else ""
            yield label + " ".join(map(str, array.flat))


def _constants(arrays: Arrays) -> Iterator[str]:
    for name, array in arrays.items():
        if array.size == 1 and array.dtype.kind in "fiub":
            yield f"{name} = {array.flat[0]}"


def _samples_of(arrays: Arrays, source: str) -> int:
    """Return the number of samples: the side of most arrays, the longer one of two shared alike."""
    shared: Counter[int] = Counter()
    for array in arrays.values():
        rows, wide = (array.shape[0], 1) if array.ndim == 1 else array.shape
        sides = ((rows, wide), (wide, rows))
        shared.update({n for n, other in sides if n > 1 and other <= _WIDEST_MATRIX})
    enough = {n: count for n, count in shared.items() if n >= FEWEST} or dict(shared)
    samples = max(enough, key=lambda n: (enough[n], n), default=0)
    alike = [name for name, array in arrays.items() if array.shape == (samples, samples)]
    if len(alike) != enough.get(samples):
        alike = [
            name
            for name, array in arrays.items()
            if samples in array.shape
            and _either_way(array)
            and enough.get(sum(array.shape) - samples) == enough[samples]
        ]
    if alike:
        shape = f"'{alike[0]}' has shape {arrays[alike[0]].shape}"
        message = f"{shape}: which side is time is not known"
        remedy = "store one row a sample, with many more samples than columns"
        raise InputRejected("S11", message, where=source, remedy=remedy)
    return samples


def described(record: Mapping[str, Any]) -> str:
    """Return "hip_angle [rad]" of a record that names its samples and their unit; "" otherwise."""
    names = (v for k, v in record.items() if k.lower() in ("name", "label") and isinstance(v, str))
    name = next(names, "")
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
    """Return " [rad]" of a record, or of an array's attributes, with an entry for the unit."""
    units = (v for key, v in record.items() if key.lower() in ("unit", "units", "einheit"))
    unit = next(units, "")
    return f" [{unit}]" if isinstance(unit, str) and 0 < len(unit) <= 20 else ""


def _not_real(array: npt.NDArray[np.generic]) -> str:
    """Return why an array is not a signal, in words; "" where it is one."""
    kind = array.dtype.kind
    if kind not in "fiub":
        return _NOT_REAL.get(kind, str(array.dtype))
    if kind in "iu" and array.size > 1 and not _exact(array.astype(np.float64).ravel()):
        return f"{array.dtype} beyond 2^53, which a real number of 64 bit cannot hold exactly"
    return f"an array of {array.ndim} dimensions" if array.ndim > 2 or array.ndim == 0 else ""


def _exact(values: Array) -> bool:
    """Return whether whole numbers are below 2^53, or rounding takes little of their steps."""
    rounding = float(np.spacing(np.abs(values).max()))
    return rounding <= 1.0 or bool(np.median(np.abs(np.diff(values))) > rounding / _ROUNDED)


def _either_way(array: npt.NDArray[np.generic]) -> bool:
    """Return whether neither side of a matrix is clearly longer."""
    if array.ndim < 2 or array.size <= 1 or 1 in array.shape:
        return False
    rows, wide = array.shape
    return not (rows >= 4 * wide or (rows > wide and wide <= 3) or wide >= 4 * rows)


def unstacked(table: RawTable) -> RawTable:
    """Return a table of one row a joint with one row a sample; any other table as it is.

    A key is a column of names or numbers that goes through the same k, all different, again and
    again. Rows of one key continue each other and neighbouring rows do not: what merely counts
    modulo k in one motion is no key. Of key "joint", "position" becomes "position[elbow]", …; what
    the k rows of every sample share stays one column.

    Raises:
        InputRejected: S11, the rows of a key come below those of another.
    """
    keys = (*table.cycles.items(), *itertools.islice(_numbers_in_turn(table), _MOST_KEYS))
    for key, words in keys:
        k = len(words)
        interleaved = any(_interleaved(values, k) for values in table.columns.values())
        if len(set(words)) == k and interleaved:
            return _by_key(table, key, words)
    for name, values in table.columns.items():
        if read_name(name).quantity == "time":
            _refuse_stacked(table, name, values)
    return table


def _refuse_stacked(table: RawTable, name: str, stamps: Array) -> None:
    """S11: refuse series below each other: a date comes again and the stamps rise from it again.

    Runs of one experiment do so too, but their clock starts from zero or goes on.
    """
    falls = np.flatnonzero(np.diff(stamps) < 0) + 1
    if not falls.size or (stamps[falls] != stamps[0]).any() or stamps[0] <= np.ptp(stamps):
        return
    message = f"the same times come {falls.size + 1} times: series below each other"
    where = f"{table.source}, column '{name}', {table.place(int(falls[0]))}"
    remedy = "put them side by side, one row a sample: pivot in pandas or in the data base"
    raise InputRejected("S11", message, where=where, remedy=remedy)


def _by_key(table: RawTable, key: str, words: tuple[str, ...]) -> RawTable:
    """Return the table with the rows of every sample side by side."""
    k = len(words)
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
    message = f"{k} rows a sample, one for each '{clean(key, 40)}': put beside each other"
    for name in (name for name in groups if read_name(name).quantity == "time"):
        times = np.column_stack([columns[member] for member in groups[name]])
        apart = np.median(np.nan_to_num(abs(times - times[:, :1])), axis=0).max()
        message += f"; '{clean(name, 40)}' differs by {apart:.3g} in its own unit among them, the log has one time"
    remedy = "export one row a sample"
    check = Check.of("S11", "warn", message, where=table.source, remedy=remedy)
    units = {name: unit for name, unit in table.units.items() if name in columns}
    for name, members in groups.items():
        if name in table.units:
            units |= dict.fromkeys(members, table.units[name])
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
        again = np.flatnonzero(values[1 : _MOST_KEYS + 1] == values[:1]) + 1
        k = int(again[0]) if again.size else 0
        if k < 2 or values.size < 2 * k or not np.array_equal(values[k:], values[:-k]):
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
    return bool(np.abs(from_key[known]).mean() < _SEPARATE * neighbours)
