"""Examine the installation, one named finding after the other; nothing of it is changed.

    for finding in examine():
        print(finding.level, finding.name, finding.found)
"""

from __future__ import annotations

import importlib.metadata
import os
import platform
import re
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from pipelines import __version__
from pipelines.errors import clean
from pipelines.io.processors import processors

__all__ = ["Finding", "examine"]

Level = Literal["ok", "warn", "bad"]

_THREADS: Final = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
_EXTRAS: Final = {"bench": "virtual test bench", "cluster": "rrrid batch on a Dask cluster"}
_NEEDS: Final = re.compile(r"\s*([A-Za-z0-9._-]+)(?:\[[^\]]*\])?\s*(?:\(?\s*>=\s*([0-9][0-9.]*))?")
_EXTRA: Final = re.compile(r"""extra\s*==\s*['"]([\w-]+)['"]""")


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at."""

    name: str
    level: Level
    found: str
    remedy: str = ""


def examine(self_test: bool = True) -> Iterator[Finding]:
    """Everything in turn; the self-test, which takes some seconds, last."""
    yield _python()
    yield Finding("rrrid", "ok", f"{__version__} in {_tilde(Path(__file__).resolve().parents[2])}")
    yield from _libraries()
    yield _blas()
    yield _processor()
    yield _folder("temporary folder", lambda: Path(tempfile.gettempdir()), "bad", "set TMPDIR to a folder that can be written")
    yield _folder("HOME", Path.home, "warn", "nothing of rrrid needs it; matplotlib then keeps its cache in the temporary folder")
    yield _folder("working folder", Path.cwd, "warn", "results go to ./runs by default: say --out")
    yield Finding("display", "ok", "none is needed: figures are drawn into files")
    if self_test:
        from pipelines.installation.self_test import run_self_test

        yield from run_self_test()


def _python() -> Finding:
    found = f"{platform.python_version()} ({platform.system()} {platform.machine()})"
    if platform.system() != "Linux":
        return Finding("Python", "warn", found,
                       "rrrid is tested on Linux alone; elsewhere folders are replaced in two steps, not in one")
    return Finding("Python", "ok", found)


def _libraries() -> Iterator[Finding]:
    """What the package itself asks for, and the extras, each against its floor."""
    try:
        wanted = importlib.metadata.requires("rrrid") or []
    except importlib.metadata.PackageNotFoundError:
        yield Finding("libraries", "warn", "rrrid runs out of a folder that was not installed: nothing says what it needs",
                      "pip install -e .")
        return
    for line in wanted:
        extra = _EXTRA.search(line)
        if (extra is None or extra[1] in _EXTRAS) and (needed := _NEEDS.match(line)):
            yield _library(needed[1], needed[2], extra[1] if extra else None)


def _library(name: str, floor: str | None, extra: str | None) -> Finding:
    asked = f", {floor} or later is asked for" if floor else ""
    remedy = f"pip install 'rrrid[{extra}]'" if extra else f"pip install --upgrade '{name}>={floor}'"
    use = f" ({_EXTRAS[extra]})" if extra else ""
    try:
        version = importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        if extra:
            return Finding(name, "ok", f"not installed; optional{use}", remedy)
        return Finding(name, "bad", f"not installed{asked}", remedy)
    if floor and _numbers(version) < _numbers(floor):
        return Finding(name, "warn" if extra else "bad", f"{version}{asked}{use}", remedy)
    return Finding(name, "ok", f"{version}{use}")


def _numbers(version: str) -> tuple[int, ...]:
    """"1.26.4rc1" as (1, 26, 4)."""
    return tuple(int(part) for part in re.findall(r"\d+", re.split(r"[a-zA-Z+]", version)[0]))


def _blas() -> Finding:
    import numpy as np

    try:
        about = np.show_config(mode="dicts")["Build Dependencies"]["blas"]  # type: ignore[call-overload, index]
        name = f"{about['name']} {about['version']}"
    except (KeyError, TypeError):
        name = "unknown to NumPy"
    threads = {key: os.environ[key] for key in _THREADS if key in os.environ}
    told = ", ".join(f"{key}={value}" for key, value in threads.items())
    if any(value != "1" for value in threads.values()):
        return Finding("BLAS", "warn", f"{name}; {told}", "one thread is the fastest here: unset them, rrrid sets 1 itself")
    return Finding("BLAS", "ok", f"{name}; one thread")


def _processor() -> Finding:
    usable = f"{processors()} of {os.cpu_count()} cores may be used"
    return Finding("processor", "ok", f"{usable}; a run takes two at most, rrrid batch all")


def _folder(name: str, where: Callable[[], Path], otherwise: Level, remedy: str) -> Finding:
    try:
        path = where()
        with tempfile.NamedTemporaryFile(dir=path, prefix=".rrrid-doctor-"):
            return Finding(name, "ok", f"{_tilde(path)} can be written")
    except (OSError, RuntimeError) as problem:
        reason = problem.strerror if isinstance(problem, OSError) and problem.strerror else str(problem)
        return Finding(name, otherwise, f"cannot be written: {clean(reason, 100)}", remedy)


def _tilde(path: Path) -> str:
    home = os.path.expanduser("~")
    return str(path).replace(home, "~") if len(home) > 1 else str(path)
