"""One good recording, and what a user would do with it: every bad input of the import tests is made from it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import numpy as np
import numpy.typing as npt

from pipelines.import_log import STAGE, Result, Settings
from pipelines.importers.repair import Recording
from pipelines.stage import Outcome, Request, run_stage

Array = npt.NDArray[np.float64]

SAMPLES, STEP, JOINTS = 1200, 0.001, 3

RECIPE = """
[robot]
use = "rrr"

[log]
match = "*.csv"
experiment = "excitation"

[time]
column = "t"
unit = "s"

[signals]
q = { columns = "q_{j}", unit = "rad" }
tau = { columns = "tau_{j}", unit = "N m" }
"""


def good() -> dict[str, Array]:
    """Three joints that swing against friction, 1.2 s at 1 kHz: t, q_1 … q_3, tau_1 … tau_3."""
    t = np.arange(SAMPLES) * STEP
    joint = np.arange(1, JOINTS + 1)
    phase = 2.0 * np.pi * (1.3 + 0.2 * joint) * t[:, None]
    q = 0.6 * np.sin(phase) / joint
    dq = np.gradient(q, t, axis=0)
    tau = 2.0 * np.gradient(dq, t, axis=0) + 1.5 * np.tanh(20.0 * dq) + 0.3 * dq
    return {"t": t} | {f"q_{j}": q[:, j - 1] for j in joint} | {f"tau_{j}": tau[:, j - 1] for j in joint}


def recording() -> Recording:
    columns = good()
    signals = {s: np.column_stack([columns[f"{s}_{j}"] for j in (1, 2, 3)]) for s in ("q", "tau")}
    names = {s: tuple(f"{s}_{j}" for j in (1, 2, 3)) for s in ("q", "tau")}
    return Recording(columns["t"], signals, names, np.arange(2, 1202), "run.csv", word="line")


def text(columns: Mapping[str, Array], delimiter: str = ",") -> str:
    """The recording as a logger writes it."""
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    return delimiter.join(columns) + "\n" + "".join(delimiter.join(map(repr, row)) + "\n" for row in rows)


def lines() -> list[str]:
    """Header and lines of the good file, without line ends. Line k of the file is lines()[k - 1]."""
    return text(good()).splitlines()


def write(folder: Path, content: str | bytes, name: str = "run.csv") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def run(folder: Path, recipe: str = RECIPE, *, strict: bool = False, assume_units: bool = False,
        **settings: object) -> Outcome[Result]:
    """Import what lies in `folder` by `recipe`, into out/ beside it."""
    path = folder.parent / "recipe.toml"
    path.write_text(recipe, encoding="utf-8")
    request = Request((), folder.parent / "out", strict=strict, assume_units=assume_units, no_report=True)
    return run_stage(STAGE, request, Settings(recipe=str(path), source=folder, **settings))  # type: ignore[arg-type]


def codes(outcome: Outcome[Result]) -> dict[str, str]:
    """code -> level of everything that was said."""
    return {check.code.removeprefix("RRID-"): check.level for check in outcome.checks}


@lru_cache
def strict_checker(shared: Path) -> ModuleType:
    """The strict checker of logs that was written apart from the project."""
    spec = spec_from_file_location("check_log", shared / "tools" / "check_log.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
