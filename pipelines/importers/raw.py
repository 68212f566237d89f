"""Hold a recording as it was read: named columns of numbers, and where they are in the file.

Named arrays and nested documents become such a table here: time is the side that most arrays share.
"""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.errors import Check, InputRejected, UsageError, clean, did_you_mean
from pipelines.importers.config import ARRAYS
from pipelines.importers.names import read_name
from pipelines.io.limits import FEWEST
from pipelines.io.log import Array
from pipelines.io.units import UNITS, canonical_unit

Anything = npt.NDArray[Any]
Columns = str | int | tuple[str | int, ...]
_NUMBERED = r"_?\d+$|\[\d+\]$"  # the end of a column of a matrix: "q_1", "q[0]"
_SAID = ("name", "label", "unit", "units")  # of a record, that the names of its series hold
_NOT_REAL = {"c": "complex numbers", "O": "objects or cells", "U": "text", "S": "text"}


@dataclass(frozen=True, eq=False)
class RawTable:
    """Columns of numbers by name. NaN where a sample is missing."""

    source: str  # the file, as messages name it
    columns: Mapping[str, Array]
    rows: npt.NDArray[np.int64]  # (samples,) 0-based
    units: Mapping[str, str] = field(default_factory=dict)  # what a header says
    text: Mapping[str, str] = field(default_factory=dict)  # columns of no numbers -> an example
    notes: tuple[str, ...] = ()  # lines above the table, texts and single numbers beside arrays
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
            raise InputRejected("S01", message, where, "columns count from 1; correct the recipe")
        if column in self.columns:
            return column
        whole = column if column in self.text else re.sub(_NUMBERED, "", column)
        if whole in self.text:
            message = f"column '{whole}' holds no numbers but '{clean(self.text[whole], 80)}'"
            remedy = "export it as numbers, one row a sample, or choose another column"
            raise InputRejected("S12", message, where, remedy)
        every, remedy = [*names, *self.text], "correct the recipe"
        message = f"no column '{column}'{did_you_mean(column, every)}; there are "
        message += ", ".join(every[: ARRAYS.listed])
        if wanted:
            kind = read_name(wanted).quantity
            alike = [name for name in names if read_name(name).quantity == kind]
            near = did_you_mean(column, alike or names)[16:-2] or [*alike, "…"][0]
            remedy += f", or pass --map {wanted}='{near}'"
        raise InputRejected("S01", message, where, remedy)


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
        counted = (columns.replace("{j}", str(j)) for j in itertools.count(1))
        there = [*itertools.takewhile(lambda name: name in table.columns, counted)]
        why = f"'{there[-1]}' is there as well" if len(there) > n else ""
        expected = [columns.replace("{j}", str(j + 1)) for j in range(n)]
        columns = tuple(there if len(there) > n else expected)
    elif isinstance(columns, str) and columns not in table.columns:
        members = [name for name in table.columns if re.sub(_NUMBERED, "", name) == columns]
        columns = tuple(members) or columns
    chosen = (columns,) if isinstance(columns, str | int) else columns
    if len(chosen) != n:
        why = why or "the recipe names " + ", ".join(str(c) for c in chosen)
        message = f"{len(chosen)} columns for {signal}, but the robot has {n} joints ({why})"
        remedy = "name the robot this was recorded on, or list the columns of its joints"
        raise InputRejected("S02", message, table.source, remedy)
    chosen = tuple((instead or {}).get(j, column) for j, column in enumerate(chosen, start=1))
    names = tuple(table.name_of(c, f"{signal}_{j}") for j, c in enumerate(chosen, start=1))
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        message = f"column '{twice[0]}' serves {signal} of two joints"
        remedy = f"give each joint its own column in signals.{signal}, or by --map {signal}_1=…"
        raise UsageError("C02", message, table.source, remedy)
    return names


def split_unit(name: str) -> tuple[str, str]:
    """Return ("q1", "deg") for "q1 [deg]" or "q1 (deg)"; an index in brackets is no unit."""
    found = re.fullmatch(r"(.*\S)\s*[\[(（]\s*([^\[\]()（）]+?)\s*[\])）]", name.strip())
    if not found or len(found[2]) > ARRAYS.longest_unit or set(found[2]) <= set("0123456789 ,:"):
        return name.strip(), ""
    return found[1], found[2]


def names_and_units(cells: list[str]) -> tuple[list[str], dict[str, str]]:
    """Return names of columns, and the units in brackets behind them.

    Names that differ only in their brackets keep them: "q[elbow]", "axis 1 (deg)", "axis 1 (Nm)".
    """
    pairs = [split_unit(cell) for cell in cells]
    times = Counter(name for name, _ in pairs)
    names, units = [], dict[str, str]()
    for j, (cell, (short, unit)) in enumerate(zip(cells, pairs, strict=True), start=1):
        name = (cell.strip() if times[short] > 1 else short) or f"column_{j}"
        names.append(name)
        if unit and (times[short] == 1 or canonical_unit(unit) in UNITS):
            units[name] = unit
    return names, units


def flatten(value: Any, path: str = "", depth: int = ARRAYS.deepest) -> Iterator[tuple[str, Any]]:
    """Yield (path, value) of all in nested objects and lists of objects that is neither.

    A record that names itself gives that name to its series: {"name": "hip", "unit": "rad",
    "values": […]} is "hip [rad]", and with several series "hip.values" and so on.
    """
    of_objects = isinstance(value, list) and value and all(isinstance(x, Mapping) for x in value)
    if isinstance(value, Mapping) and depth:
        said = {str(key).lower(): x for key, x in value.items() if isinstance(x, str) and x}
        own = said.get("name") or said.get("label") or ""
        unit = said.get("unit") or said.get("units") or ""
        series = [key for key, x in value.items() if own and _is_series(x)]
        for key, inner in value.items():
            if len(series) == 1 and key == series[0]:
                yield f"{own} [{unit}]" if unit else own, inner
            elif not series or str(key).lower() not in _SAID:
                stem = own if key in series else path
                yield from flatten(inner, f"{stem}.{key}".lstrip("."), depth - 1)
    elif of_objects and depth:
        for k, inner in enumerate(value):
            yield from flatten(inner, f"{path}[{k}]", depth - 1)
    else:
        yield path or "column", value


def _is_series(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return value.dtype.kind in "fiu" and value.size > 1
    return isinstance(value, list) and len(value) > 1 and not isinstance(value[0], str | Mapping)


def table_of(document: Any, source: str) -> RawTable:
    """Return a table of nested documents of named arrays of one or two dimensions.

    The samples are the side that most arrays share; texts and single numbers are notes.

    Raises:
        InputRejected: S03 two series of one name, S11 where arrays can be read both ways, S12 where
            none holds real numbers.
    """
    arrays: dict[str, Anything] = {}
    for name, value in flatten(document):
        if (array := _array_of(value)) is None:
            continue
        if name in arrays:
            message = f"two series are both named '{clean(name, 80)}'"
            raise InputRejected("S03", message, source, "rename one of them in the file")
        # MATLAB's timeseries of a vector is (n, 1, samples).
        arrays[name] = array.squeeze() if array.shape[2:] else array
    problems = {name: _not_real(array) for name, array in arrays.items() if array.size != 1}
    text = {name: problem for name, problem in problems.items() if problem}
    usable = {k: array for k, array in arrays.items() if k not in text and array.size > 1}
    samples = _samples_of(usable, source)
    columns, units, checks = dict[str, Array](), dict[str, str](), list[Check]()
    for name, array in usable.items():
        matrix = array[:, None] if array.ndim == 1 else array
        rows, wide = matrix.shape
        if samples not in matrix.shape or rows == wide:
            why = "square" if rows == wide else f"not of {samples} samples"
            text[name] = f"an array of shape {array.shape}, {why}"
            continue
        matrix = matrix if rows == samples else matrix.T
        if matrix.shape[1] > ARRAYS.widest:
            continue
        if rows not in (samples, 1):
            message = f"'{name}' is stored as {(rows, wide)}, read with time along the long side"
            checks.append(Check.of("S11", "warn", message, source, "store one row a sample"))
        short, unit = split_unit(name)
        several = tuple(f"{short}_{j + 1}" for j in range(matrix.shape[1]))
        names = several if several[1:] else (short,)
        units |= dict.fromkeys(names, unit) if unit else {}
        columns |= zip(names, np.ascontiguousarray(matrix.T, dtype=np.float64), strict=True)
    if others := [name for name, why in text.items() if why.endswith(" samples")]:
        message = f"left out, not of {samples} samples: {', '.join(map(repr, others[:8]))}"
        remedy = "save another motion as a file of its own"
        checks.append(Check.of("S11", "warn", message, source, remedy))
    if not columns:
        found = ", ".join(f"{name} ({what})" for name, what in text.items()) or "nothing"
        message = f"no array of real numbers; there is {found}"
        raise InputRejected("S12", message, source, "save plain numeric arrays, one row a sample")
    notes = [
        f"{name} = {' '.join(map(str, array.flat))[: ARRAYS.longest_text]}"
        for name, array in arrays.items()
        if array.size == 1 or (array.dtype.kind == "U" and array.size <= ARRAYS.widest)
    ][: ARRAYS.most_notes]
    rows_of = np.arange(samples)
    return RawTable(source, columns, rows_of, units, text, tuple(notes), checks=tuple(checks))


def _array_of(value: Any) -> Anything | None:
    """Return an array of numbers or of texts; None of anything else."""
    if isinstance(value, np.ndarray):
        return value if value.dtype.kind != "V" else None  # records
    if isinstance(value, str | int | float):
        return np.array(value) if not isinstance(value, int) or abs(value) < 2**63 else None
    if not isinstance(value, list):
        return None
    try:
        return np.array(value, np.str_ if isinstance(value[0], str) else np.float64)
    except (ValueError, TypeError, OverflowError, IndexError):
        return None


def _samples_of(arrays: Mapping[str, Anything], source: str) -> int:
    """Return the number of samples: the side of most arrays, the longer one of two shared alike.

    Raises:
        InputRejected: S11, either side of a matrix may be time.
    """
    shared: Counter[int] = Counter()
    shapes = {k: (array.shape[0], *array.shape[1:], 1)[:2] for k, array in arrays.items()}
    for rows, wide in shapes.values():
        sides = ((rows, wide), (wide, rows))
        shared.update({n for n, other in sides if n > 1 and other <= ARRAYS.widest})
    enough = {n: count for n, count in shared.items() if n >= FEWEST} or dict(shared)
    samples = max(enough, key=lambda n: (enough[n], n), default=0)
    matching = {k: shape for k, shape in shapes.items() if samples in shape}
    only_square = all(rows == wide for rows, wide in matching.values())
    for name, (rows, wide) in matching.items():
        near = rows != wide and max(rows, wide) < ARRAYS.clearly_longer * min(rows, wide)
        if only_square or (near and enough.get(rows) == enough.get(wide)):
            message = f"'{name}' has shape {(rows, wide)}: which side is time is not known"
            remedy = "store one row a sample, with many more samples than columns"
            raise InputRejected("S11", message, source, remedy)
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
