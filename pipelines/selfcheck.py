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
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pipelines import __version__
from pipelines.errors import RrridError, clean
from pipelines.io.files import Opened, open_log, write_log
from pipelines.io.output import tilde
from pipelines.io.sessions import Inputs

if TYPE_CHECKING:
    from pipelines.io.log import ExperimentLog


Level = Literal["ok", "warn", "bad"]

_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
_EXTRAS = ("", "bench", "cluster", "export")


@dataclass(frozen=True)
class Finding:
    """One examination, and what to do where it failed."""

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
    folders: tuple[tuple[str, Callable[[], Path], Level], ...] = (
        ("temporary folder", lambda: Path(tempfile.gettempdir()), "bad"),
        ("HOME", Path.home, "warn"),
        ("working folder", Path.cwd, "warn"),
    )
    for name, where, otherwise in folders:
        try:
            path = where()
            with tempfile.NamedTemporaryFile(dir=path, prefix=".rrrid-doctor-"):
                yield Finding(name, "ok", f"{tilde(path)} can be written")
        except (OSError, RuntimeError) as problem:
            words = f"cannot be written: {clean(problem, 100)}"
            yield Finding(name, otherwise, words, "give --out, or set TMPDIR to another folder")
    if with_self_test:
        yield from self_test()


def _libraries() -> Iterator[Finding]:
    """Compare what is installed with what the package requires; an extra may be missing."""
    from packaging.requirements import Requirement

    try:
        lines = importlib.metadata.requires("rrrid") or []
    except importlib.metadata.PackageNotFoundError:
        found = "rrrid was not installed: nothing says what it needs"
        yield Finding("libraries", "warn", found, "pip install -e .")
        return
    told = set[str]()
    for wanted in map(Requirement, lines):
        marker = wanted.marker
        extras = [x for x in _EXTRAS if marker is None or marker.evaluate({"extra": x})]
        if not extras or wanted.name in told:
            continue
        told.add(wanted.name)
        extra = extras[0]
        remedy = f"pip install --upgrade '{f'rrrid[{extra}]' if extra else wanted}'"
        required = f"{wanted.specifier} is required{f' by the extra {extra}' if extra else ''}"
        try:
            version = importlib.metadata.version(wanted.name)
        except importlib.metadata.PackageNotFoundError:
            found = f"not installed, {required}"
            yield Finding(wanted.name, "ok" if extra else "bad", found, remedy)
            continue
        if wanted.specifier.contains(version, prereleases=True):
            yield Finding(wanted.name, "ok", version)
        else:
            yield Finding(wanted.name, "warn" if extra else "bad", f"{version}, {required}", remedy)


def self_test() -> Iterator[Finding]:
    """Simulate a log, write, read and fit it, filter and draw: small jobs with known answers."""
    from pipelines.simulation.example import example_session

    session = cache(example_session)  # simulated by the first job, where a fault of it is reported
    with tempfile.TemporaryDirectory(prefix="rrrid-doctor-") as folder:
        jobs: tuple[tuple[str, Callable[[], str]], ...] = (
            ("simulating a log", lambda: f"{session()[0].n_samples} samples in closed loop"),
            ("HDF5 log", lambda: _round_trip(Path(folder) / "a.h5", session()[0])),
            ("Parquet log", lambda: _round_trip(Path(folder) / "a.parquet", session()[0])),
            ("base parameters", lambda: _fitted(session()[0])),
            ("observer", _observed),
            ("figure", _drawn),
        )
        for name, work in jobs:
            began = time.perf_counter()
            try:
                words = f"{work()}, {time.perf_counter() - began:.1f} s"
                yield Finding(f"self-test: {name}", "ok", words)
            except RrridError as problem:
                yield Finding(f"self-test: {name}", "bad", problem.message, problem.remedy)
            except Exception as problem:  # a missing, old or damaged library may raise anything
                found = clean(f"{type(problem).__name__}: {problem}", 200)
                remedy = "install rrrid anew into a fresh virtual environment"
                yield Finding(f"self-test: {name}", "bad", found, remedy)


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
