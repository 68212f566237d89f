"""Take columns without a clock into SI: maps and calibrations that lie beside the logs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pipelines.errors import InputRejected, did_you_mean
from pipelines.log.experiment import Array
from pipelines.log.recording.raw import RawTable
from pipelines.log.recording.recipe import ColumnSpec, TableSpec
from pipelines.log.results import NOT_STORED
from pipelines.log.units import UNITS

__all__ = ["ImportedTable", "import_table"]

_SI = {
    "time": "s",
    "position": "rad",
    "velocity": "rad/s",
    "acceleration": "rad/s^2",
    "torque": "N m",
    "current": "A",
    "temperature": "degC",
}
_METRES = {
    "m": "m",
    "mm": "m",
    "um": "m",
    "m/s": "m/s",
    "mm/s": "m/s",
    "m/s^2": "m/s^2",
    "mm/s^2": "m/s^2",
    "N": "N",
    "mN": "N",
    "kN": "N",
}


@dataclass(frozen=True)
class ImportedTable:
    """A table in SI."""

    name: str
    file: str
    source: str
    sha256: str
    rows: int
    units: Mapping[str, str]
    data: Mapping[str, Array] = field(metadata=NOT_STORED, repr=False)


def import_table(spec: TableSpec, name: str, file: str, table: RawTable) -> ImportedTable:
    """The columns of a `[[table]]`, converted.

    Raises:
        InputRejected: S01, S04, S05, S12.
    """
    data: dict[str, Array] = {}
    units: dict[str, str] = {}
    for key, column in spec.columns.items():
        source = table.name_of(column.column)
        values, units[key] = _converted(
            table.columns[source],
            column,
            table.units.get(source),
            f"{table.source}, column '{source}'",
        )
        if not np.isfinite(values).all():
            row = table.place(int(np.flatnonzero(~np.isfinite(values))[0]))
            message = f"no number in {row}"
            raise InputRejected(
                "D01", message, where=f"{table.source}, column '{source}'", remedy="remove that row"
            )
        data[key] = values
    return ImportedTable(name, file, table.source, table.sha256, table.rows.size, units, data)


def _converted(
    values: Array, column: ColumnSpec, header: str | None, where: str
) -> tuple[Array, str]:
    unit = column.unit or header
    if unit is None:
        remedy = 'add unit = … to the column ("1" where it has none)'
        raise InputRejected("S04", "no unit", where=where, remedy=remedy)
    values = values * column.scale
    if unit == "1":
        return values, "1"
    if unit == "counts":
        if column.counts_per_rev is None:
            remedy = "add counts_per_rev"
            raise InputRejected("S05", "counts without counts_per_rev", where=where, remedy=remedy)
        return values * (2.0 * math.pi / column.counts_per_rev), "rad"
    known = UNITS.get(unit)
    if known is None:
        message = f"unknown unit '{unit}'{did_you_mean(unit, UNITS)}; known are {', '.join(UNITS)}"
        raise InputRejected("S05", message, where=where, remedy="declare its unit")
    return known.factor * values + known.offset, _METRES.get(unit) or _SI[known.quantity]
