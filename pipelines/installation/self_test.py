"""A small job whose answer is known: a log is simulated, written, read back, fitted and drawn."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pipelines.errors import RrridError, clean
from pipelines.io.files import open_log, write_log

if TYPE_CHECKING:
    from pipelines.installation.examine import Finding
    from pipelines.io.experiment import ExperimentLog

__all__ = ["run_self_test"]

# What libraries that are missing, too old or damaged have been seen to raise.
_BROKEN = (ImportError, OSError, ValueError, TypeError, AttributeError, LookupError, ArithmeticError, RuntimeError, SystemError)
_CLOSE = 6.0  # std: a fit of three sessions is never so far off


def run_self_test() -> Iterator[Finding]:
    """Each step by itself; one that fails says why, and the others go on as far as they can."""
    with tempfile.TemporaryDirectory(prefix="rrrid-doctor-") as folder:
        log, found = _tried("simulating a log", _simulated)
        yield found
        if log is None:
            return
        for name, work in (("HDF5 log, written and read", lambda: _round_trip(Path(folder) / "a.h5", log)),
                           ("Parquet log, written and read", lambda: _round_trip(Path(folder) / "a.parquet", log)),
                           ("base parameters", lambda: _fitted(log)), ("figure", _drawn)):
            yield _tried(name, work)[1]


def _tried(name: str, work: Callable[[], tuple[Any, str]]) -> tuple[Any, Finding]:
    """What `work` gives, and how it went."""
    from pipelines.installation.examine import Finding

    began = time.perf_counter()
    try:
        result, words = work()
    except RrridError as problem:
        return None, Finding(f"self-test: {name}", "bad", problem.message, problem.remedy)
    except _BROKEN as problem:
        return None, Finding(f"self-test: {name}", "bad", clean(f"{type(problem).__name__}: {problem}", 200),
                             "install rrrid anew into a fresh virtual environment")
    return result, Finding(f"self-test: {name}", "ok", f"{words}, {time.perf_counter() - began:.1f} s")


def _simulated() -> tuple[ExperimentLog, str]:
    from pipelines.model.simulation.example import example_session

    log = example_session()[0]
    return log, f"{log.n_samples} samples in closed loop"


def _round_trip(path: Path, log: ExperimentLog) -> tuple[bool, str]:
    write_log(path, log)
    if open_log(path).log != log:
        raise ValueError("what was read is not what was written")
    return True, "every bit is the same"


def _fitted(log: ExperimentLog) -> tuple[bool, str]:
    """Base parameters against those of the arm that was simulated."""
    from pipelines.model.estimation.logs import Recipe, fit_logs, with_cutoff
    from pipelines.model.estimation.nominal import nominal_columns
    from pipelines.model.motion import Reconstruction, reconstruct
    from pipelines.model.simulation.example import example_arm

    how = Reconstruction()
    motions = ((log, reconstruct(log, how)),)
    fitted = fit_logs(motions, nominal_columns(log.robot), with_cutoff(Recipe(how), motions), True)
    truth = {p.name: p.value for p in example_arm().base}
    solution = fitted.estimate
    names = [column.name for column in solution.columns.names]
    away = [abs(value - truth[name]) / std for name, value, std in zip(names, solution.beta, solution.std, strict=True)
            if name in truth]
    if not away or max(away) > _CLOSE or not np.isfinite(away).all():
        raise ValueError(f"a parameter is {max(away, default=float('nan')):.1f} std from the truth")
    return True, f"{len(away)} parameters within {max(away):.1f} std of the truth"


def _drawn() -> tuple[bool, str]:
    from pipelines.report.render import render_report
    from pipelines.report.report import Figure, Report, Section

    figure = Figure("line", "A line.", lambda drawing: drawing.subplots().plot([0.0, 1.0]))
    page = render_report(Report("Self-test", "A line is drawn.", sections=(Section("Line", figures=(figure,)),)), {})
    return True, f"a page of {len(page['report.html']) // 1000} kB without a display"
