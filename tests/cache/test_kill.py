"""SIGKILL at any point of a run: the old output or the complete new one, and the next run ends as if nothing had been."""

from __future__ import annotations

import json
import os
import random
import signal
import time
import warnings
from dataclasses import replace
from pathlib import Path

import pytest

from pipelines import reconstruct, run
from pipelines.io.files import write_log
from pipelines.io.output import hash_file
from pipelines.stage import Request, run_stage
from tests.controlled import controlled_log

SKIPPED = tuple(m.replace("_", "-") for m in run.STEPS if m not in ("inspect", "reconstruct", "frf"))
SETTINGS = tuple(run.Settings({"reconstruct": reconstruct.Settings(order=order)}, SKIPPED) for order in (3, 4))


def go(folder: Path, settings: run.Settings, out: str = "out") -> None:
    run_stage(run.STAGE, Request((folder / "logs",), out=folder / out, no_report=True), settings)


def contents(out: Path) -> dict[str, str]:
    return {p.relative_to(out).as_posix(): hash_file(p) for p in sorted(out.rglob("*"))
            if p.is_file() and p.name != "provenance.json"}


def killed(folder: Path, settings: run.Settings, after: float) -> bool:
    """Run in a child that is killed after so many seconds; whether it was still at work."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # a fork beside threads: this child takes none of their locks
        child = os.fork()
    if child == 0:
        try:
            go(folder, settings)
        finally:
            os._exit(0)
    time.sleep(after)
    os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    return os.WIFSIGNALED(status)


def sweep(folder: Path, points: int, seed: int) -> int:
    """Kill at `points` random moments; how many of them met a run at work."""
    for number in (1, 2):
        write_log(folder / f"logs/{number}.h5", replace(controlled_log(400, number), name=f"log {number}"))
    wanted = []
    for number, settings in enumerate(SETTINGS):
        began = time.monotonic()
        go(folder, settings, f"whole-{number}")
        lasted = time.monotonic() - began
        wanted.append(contents(folder / f"whole-{number}"))
    go(folder, SETTINGS[0])
    drawn, met, now = random.Random(seed), 0, 0
    for _ in range(points):
        other = 1 - now
        met += killed(folder, SETTINGS[other], drawn.uniform(0.0, 1.1 * lasted))
        left = contents(folder / "out")
        assert left in wanted
        assert left == json.loads((folder / "out/provenance.json").read_text())["outputs"]
        go(folder, SETTINGS[other])
        assert contents(folder / "out") == wanted[other]
        assert sorted(p.name for p in folder.iterdir()) == ["logs", "out", "whole-0", "whole-1"]
        now = other
    return met


@pytest.mark.row("P01", "P07")
def test_a_killed_run_leaves_the_old_or_the_new(tmp_path: Path) -> None:
    """P01, P07: some moments of a sweep."""
    assert sweep(tmp_path, 4, 1) > 1


@pytest.mark.row("P01", "P07")
@pytest.mark.slow
def test_200_moments(tmp_path: Path) -> None:
    """P01, P07: the whole sweep."""
    assert sweep(tmp_path, 200, 2) > 120
