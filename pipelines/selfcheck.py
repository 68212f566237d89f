"""Examine whether this installation can work; nothing of it is changed.

for finding in examine():
    print(finding.level, finding.name, finding.found)
"""

from __future__ import annotations

import importlib.metadata
import os
import platform
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pipelines import __version__
from pipelines.errors import RrridError, clean
from pipelines.io.files import open_log, write_log
from pipelines.io.processors import processors

if TYPE_CHECKING:
    from packaging.requirements import Requirement

    from pipelines.io.log import ExperimentLog

__all__ = ["Finding", "examine", "self_test"]

Level = Literal["ok", "warn", "bad"]

_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at."""

    name: str
    level: Level
    found: str
    remedy: str = ""


def examine(with_self_test: bool = True) -> Iterator[Finding]:
    """Yield every finding; the self-test, which takes some seconds, comes last."""
    system = platform.system()
    level: Level = "ok" if system == "Linux" else "warn"
    remedy = "rrrid is tested on Linux alone" if level == "warn" else ""
    found = f"{platform.python_version()} ({system} {platform.machine()})"
    yield Finding("Python", level, found, remedy)
    place = _tilde(Path(__file__).resolve().parents[1])
    yield Finding("rrrid", "ok", f"{__version__} in {place}")
    yield from _libraries()
    many = [f"{name}={os.environ[name]}" for name in _THREADS if os.environ.get(name, "1") != "1"]
    if many:
        remedy = "one thread is the fastest here: unset them, rrrid sets 1 itself"
        yield Finding("BLAS", "warn", ", ".join(many), remedy)
    else:
        yield Finding("BLAS", "ok", "one thread")
    usable = f"{processors()} of {os.cpu_count()} cores may be used"
    yield Finding("processor", "ok", f"{usable}; rrrid batch takes them all")
    remedy = "set TMPDIR to a folder that can be written"
    yield _folder("temporary folder", lambda: Path(tempfile.gettempdir()), "bad", remedy)
    remedy = "rrrid does not need it; matplotlib keeps its cache in the temporary folder"
    yield _folder("HOME", Path.home, "warn", remedy)
    remedy = "results go to ./runs by default: give --out"
    yield _folder("working folder", Path.cwd, "warn", remedy)
    if with_self_test:
        yield from self_test()


def _libraries() -> Iterator[Finding]:
    """Compare what is installed with what the package requires."""
    from packaging.requirements import Requirement

    try:
        lines = importlib.metadata.requires("rrrid") or []
    except importlib.metadata.PackageNotFoundError:
        found = "rrrid was not installed: nothing says what it needs"
        yield Finding("libraries", "warn", found, "pip install -e .")
        return
    for wanted in map(Requirement, lines):
        for extra in ("", "bench", "cluster"):
            if wanted.marker is None or wanted.marker.evaluate({"extra": extra}):
                yield _library(wanted, extra)
                break


def _library(wanted: Requirement, extra: str) -> Finding:
    missing: Level = "ok" if extra else "bad"
    remedy = f"pip install --upgrade '{f'rrrid[{extra}]' if extra else wanted}'"
    asked = f"{wanted.specifier} is required{f' by the extra {extra}' if extra else ''}"
    try:
        version = importlib.metadata.version(wanted.name)
    except importlib.metadata.PackageNotFoundError:
        return Finding(wanted.name, missing, f"not installed, {asked}", remedy)
    if wanted.specifier.contains(version, prereleases=True):
        return Finding(wanted.name, "ok", version)
    return Finding(wanted.name, "warn" if extra else "bad", f"{version}, {asked}", remedy)


def _folder(name: str, where: Callable[[], Path], otherwise: Level, remedy: str) -> Finding:
    try:
        path = where()
        with tempfile.NamedTemporaryFile(dir=path, prefix=".rrrid-doctor-"):
            return Finding(name, "ok", f"{_tilde(path)} can be written")
    except (OSError, RuntimeError) as problem:
        return Finding(name, otherwise, f"cannot be written: {clean(problem, 100)}", remedy)


def _tilde(path: Path) -> str:
    home = os.path.expanduser("~")
    return str(path).replace(home, "~") if len(home) > 1 else str(path)


def self_test() -> Iterator[Finding]:
    """Simulate a log, write it, read it, fit it and draw: small jobs whose answers are known."""
    from pipelines.simulation.example import example_session

    with tempfile.TemporaryDirectory(prefix="rrrid-doctor-") as name:
        folder = Path(name)
        logs: list[ExperimentLog] = []

        def simulated() -> str:
            logs.append(example_session()[0])
            return f"{logs[0].n_samples} samples in closed loop"

        yield _tried("simulating a log", simulated)
        if logs:
            yield _tried(
                "HDF5 log, written and read", lambda: _round_trip(folder / "a.h5", logs[0])
            )
            parquet = folder / "a.parquet"
            yield _tried("Parquet log, written and read", lambda: _round_trip(parquet, logs[0]))
            yield _tried("base parameters", lambda: _fitted(logs[0]))
            yield _tried("figure", _drawn)


def _tried(name: str, work: Callable[[], str]) -> Finding:
    began = time.perf_counter()
    try:
        words = work()
    except RrridError as problem:
        return Finding(f"self-test: {name}", "bad", problem.message, problem.remedy)
    except Exception as problem:  # a missing, old or damaged library may raise anything
        found = clean(f"{type(problem).__name__}: {problem}", 200)
        remedy = "install rrrid anew into a fresh virtual environment"
        return Finding(f"self-test: {name}", "bad", found, remedy)
    seconds = time.perf_counter() - began
    return Finding(f"self-test: {name}", "ok", f"{words}, {seconds:.1f} s")


def _round_trip(path: Path, log: ExperimentLog) -> str:
    write_log(path, log)
    if open_log(path).log != log:
        raise ValueError("what was read is not what was written")
    return "every bit is the same"


def _fitted(log: ExperimentLog, close: float = 6.0) -> str:
    """Compare fitted base parameters with those of the arm that was simulated.

    Args:
        close: [std] a fit of three sessions is never so far off.
    """
    from pipelines.estimation.motion import Reconstruction, reconstruct
    from pipelines.model.estimation.logs import Recipe, fit_logs, with_cutoff
    from pipelines.model.estimation.nominal import nominal_columns
    from pipelines.simulation.example import example_arm

    how = Reconstruction()
    motions = ((log, reconstruct(log, how)),)
    recipe = with_cutoff(Recipe(how), motions)
    solution = fit_logs(motions, nominal_columns(log.robot), recipe, True).estimate
    truth = {parameter.name: parameter.value for parameter in example_arm().base}
    names = [column.name for column in solution.columns.names]
    away = [
        abs(value - truth[name]) / std
        for name, value, std in zip(names, solution.beta, solution.std, strict=True)
        if name in truth
    ]
    farthest = max(away, default=float("nan"))
    if not farthest <= close:
        raise ValueError(f"a parameter is {farthest:.1f} std from the truth")
    return f"{len(away)} parameters within {farthest:.1f} std of the truth"


def _drawn() -> str:
    from pipelines.report.render import render_report
    from pipelines.report.report import Figure, Report, Section

    figure = Figure("line", "A line.", lambda drawing: drawing.subplots().plot([0.0, 1.0]))
    section = Section("Line", figures=(figure,))
    page = render_report(Report("Self-test", "A line is drawn.", sections=(section,)), {})
    return f"a page of {len(page['report.html']) // 1000} kB without a display"
