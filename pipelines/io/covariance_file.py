"""How the errors of a model's numbers go together, as a file beside model.json, which holds their standard deviations alone.

    {"names": ["p1", …, "coulomb:1:torque", …], "covariance": [[…], …]}      null: a number that is not determined
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pipelines.errors import InputRejected
from pipelines.io.atomic import write_file
from pipelines.io.experiment import Array
from pipelines.io.results import json_text
from pipelines.io.text import read_small_text

__all__ = ["read_covariance", "write_covariance"]


def write_covariance(path: Path, names: Sequence[str], covariance: Array) -> None:
    """Write `covariance` (k, k) of the `names`, atomically."""
    rows = [[value if math.isfinite(value) else None for value in row] for row in covariance.tolist()]
    text = json_text({"names": list(names), "covariance": rows})
    write_file(path, lambda draft: _put(draft, text))


def _put(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def read_covariance(path: Path) -> tuple[tuple[str, ...], Array]:
    """What `write_covariance` wrote; NaN where a number is not determined.

    Raises:
        InputRejected: S18, it is not of that form.
    """
    text = read_small_text(path, what="a covariance (JSON)")
    try:
        told = json.loads(text)
        rows = [[math.nan if value is None else float(value) for value in row] for row in told["covariance"]]
        names = tuple(map(str, told["names"]))
        return names, np.array(rows, dtype=np.float64).reshape(len(names), len(names))
    except (ValueError, TypeError, KeyError, RecursionError, OverflowError) as problem:
        raise InputRejected("S18", f"not the covariance of a model's parameters: {type(problem).__name__}: {problem}", where=path,
                            remedy="run estimate-bps again, or take the file away") from None
