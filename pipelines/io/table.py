"""Write tables for other programs: flat CSV of a log, and Parquet with units for what has no time column."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from pipelines.io.atomic import write_file
from pipelines.io.experiment import Array, ExperimentLog

__all__ = ["csv_cell", "write_csv", "write_rows", "write_table"]


def csv_cell(text: str) -> str:
    """`text` as a CSV cell that no spreadsheet takes for a formula (X10)."""
    safe = f"'{text}" if text[:1] in ("=", "+", "-", "@", "\t", "\r") else text
    return '"' + safe.replace('"', '""') + '"' if any(c in safe for c in ',;"\n\r') or safe != text else safe


def write_csv(path: Path, log: ExperimentLog) -> None:
    """Every signal of `log` as one flat CSV table, `q_1 [rad]` and so on, each number with all its digits."""
    columns: list[tuple[str, Array]] = []
    for name, signal in log.signals.items():
        if signal.values.ndim == 1:
            columns.append((f"{name} [{signal.units}]", signal.values))
        else:
            columns += [(f"{name}_{j + 1} [{signal.units}]", signal.values[:, j]) for j in range(signal.values.shape[1])]
    header = ",".join(csv_cell(name) for name, _ in columns)

    def fill(draft: Path) -> None:
        with draft.open("w", encoding="utf-8", newline="\n") as file:
            file.write(header + "\n")
            for start in range(0, log.n_samples, 8192):
                block = np.column_stack([values[start:start + 8192] for _, values in columns]).tolist()
                file.writelines(",".join(map(repr, row)) + "\n" for row in block)

    write_file(path, fill)


def write_table(path: Path, columns: Mapping[str, Array], units: Mapping[str, str]) -> None:
    """Named columns with their units as Parquet, page checksums included."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = pa.schema([pa.field(name, pa.float64(), metadata={"units": units.get(name, "1")}) for name in columns])
    table = pa.table([pa.array(values) for values in columns.values()], schema=schema)
    write_file(path, lambda draft: pq.write_table(table, draft, compression="zstd", write_page_checksum=True))


def write_rows(path: Path, rows: Sequence[Mapping[str, str | float | int | None]], kinds: Mapping[str, type]) -> None:
    """Rows of named cells as Parquet; `kinds`: column -> str, float or int. What a row lacks is null."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    arrow = {str: pa.string(), float: pa.float64(), int: pa.int64()}
    schema = pa.schema([pa.field(name, arrow[kind]) for name, kind in kinds.items()])
    table = pa.table([pa.array([row.get(name) for row in rows], type=arrow[kind]) for name, kind in kinds.items()], schema=schema)
    write_file(path, lambda draft: pq.write_table(table, draft, compression="zstd", write_page_checksum=True))
