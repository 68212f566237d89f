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
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pipelines import __version__
from pipelines.errors import RrridError, clean
from pipelines.io.files import Opened, open_log, write_log
from pipelines.io.output import tilde
from pipelines.io.processors import processors
from pipelines.io.sessions import Inputs

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
    linux = platform.system() == "Linux"
    found = f"{platform.python_version()} ({platform.system()} {platform.machine()})"
    yield Finding(
        "Python", "ok" if linux else "warn", found, "rrrid is tested on Linux alone" * (not linux)
    )
    yield Finding("rrrid", "ok", f"{__version__} in {tilde(Path(__file__).resolve().parents[1])}")
    yield from _libraries()
    many = [f"{name}={os.environ[name]}" for name in _THREADS if os.environ.get(name, "1") != "1"]
    remedy = "one thread is the fastest here: unset them, rrrid sets 1 itself" if many else ""
    yield Finding("BLAS", "warn" if many else "ok", ", ".join(many) or "one thread", remedy)
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
    told = set[str]()
    for wanted in map(Requirement, lines):
        extras = [
            extra
            for extra in ("", "bench", "cluster", "export")
            if wanted.marker is None or wanted.marker.evaluate({"extra": extra})
        ]
        if extras and wanted.name not in told:
            told.add(wanted.name)
            yield _library(wanted, extras[0])


def _library(wanted: Requirement, extra: str) -> Finding:
    remedy = f"pip install --upgrade '{f'rrrid[{extra}]' if extra else wanted}'"
    required = f"{wanted.specifier} is required{f' by the extra {extra}' if extra else ''}"
    try:
        version = importlib.metadata.version(wanted.name)
    except importlib.metadata.PackageNotFoundError:
        level: Level = "ok" if extra else "bad"
        return Finding(wanted.name, level, f"not installed, {required}", remedy)
    if wanted.specifier.contains(version, prereleases=True):
        return Finding(wanted.name, "ok", version)
    return Finding(wanted.name, "warn" if extra else "bad", f"{version}, {required}", remedy)


def _folder(name: str, where: Callable[[], Path], otherwise: Level, remedy: str) -> Finding:
    try:
        path = where()
        with tempfile.NamedTemporaryFile(dir=path, prefix=".rrrid-doctor-"):
            return Finding(name, "ok", f"{tilde(path)} can be written")
    except (OSError, RuntimeError) as problem:
        return Finding(name, otherwise, f"cannot be written: {clean(problem, 100)}", remedy)


def self_test() -> Iterator[Finding]:
    """Simulate a log, write, read and fit it, filter and draw: small jobs with known answers."""
    from pipelines.simulation.example import example_session

    logs: list[ExperimentLog] = []

    def simulated() -> str:
        logs.append(example_session()[0])
        return f"{logs[0].n_samples} samples in closed loop"

    yield _tried("simulating a log", simulated)
    if not logs:
        return
    with tempfile.TemporaryDirectory(prefix="rrrid-doctor-") as folder:
        for container, file in (("HDF5", "a.h5"), ("Parquet", "a.parquet")):
            work = partial(_round_trip, Path(folder) / file, logs[0])
            yield _tried(f"{container} log, written and read", work)
        yield _tried("base parameters", partial(_fitted, logs[0]))
    yield _tried("observer", _observed)
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
    return Finding(f"self-test: {name}", "ok", f"{words}, {time.perf_counter() - began:.1f} s")


def _round_trip(path: Path, log: ExperimentLog) -> str:
    write_log(path, log)
    if open_log(path).log != log:
        raise ValueError("what was read is not what was written")
    return "every bit is the same"


def _fitted(log: ExperimentLog, close: float = 6.0) -> str:
    """Compare fitted base parameters with those of the arm that was simulated.

    Args:
        close: [std] a fit is never so far off.
    """
    from pipelines.estimate_bps import Settings, compute
    from pipelines.simulation.example import example_arm

    found = compute(Inputs((Opened(Path("log"), "", log, ()),)), Settings())
    truth = {parameter.name: parameter.value for parameter in example_arm().base}
    away = [
        abs(one.value - truth[one.name]) / one.std
        for one in found.parameters
        if one.name in truth and one.value is not None and one.std
    ]
    if not max(away, default=float("nan")) <= close:
        raise ValueError(f"a parameter is {max(away, default=0.0):.1f} std from the truth")
    return f"{len(away)} parameters within {max(away):.1f} std of the truth"


def _observed(jerk: float = 500.0, noise: float = 1e-12, close: float = 1e-6) -> str:
    """Compare the states that the observer finds, over a gap, with those of filterpy's filter.

    Args:
        jerk: [rad/s^3] std of the jerk.
        noise: [rad^2] variance of the measurement.
        close: of the largest value of each state.
    """
    import numpy as np

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # filterpy imports parts of SciPy that are going away
        from filterpy.kalman import KalmanFilter
    from pipelines.estimation.chain import held_input, transition
    from pipelines.estimation.state_estimation import Start, design, observe

    step, samples, order = 1e-3, 300, 3
    y = np.sin(20.0 * step * np.arange(samples))
    y[100:120] = np.nan
    mean, covariance = np.zeros(order), np.diag([1e-6, 1.0, 1e3])
    reach = jerk * held_input(order, np.array([step]))[0]
    kalman = KalmanFilter(dim_x=order, dim_z=1)
    kalman.F, kalman.Q = transition(order, np.array([step]))[0], np.outer(reach, reach)
    kalman.H, kalman.R = np.eye(order)[:1], np.array([[noise]])
    kalman.x, kalman.P = mean.copy(), covariance.copy()
    seen = [None if np.isnan(value) else value for value in y]
    theirs = kalman.batch_filter(seen, update_first=True)[0]
    start = Start(mean[None], covariance[None])
    ours = observe(y[:, None], design(step, jerk, noise), start).states[:, :, 0].T
    away = float(np.max(np.abs(ours - theirs) / np.abs(theirs).max(axis=0)))
    if not away <= close:
        raise ValueError(f"the observer differs from filterpy's by {away:.1e}")
    return f"equal to filterpy's within {away:.0e}"


def _drawn() -> str:
    from pipelines.report.render import render_report
    from pipelines.report.report import Figure, Report, Section

    figure = Figure("line", "A line.", lambda drawing: drawing.subplots().plot([0.0, 1.0]))
    section = Section("Line", figures=(figure,))
    page = render_report(Report("Self-test", "A line is drawn.", sections=(section,)), {})
    return f"a page of {len(page['report.html']) // 1000} kB without a display"
