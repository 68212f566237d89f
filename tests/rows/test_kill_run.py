"""P01: SIGKILL at random points of `run`, then of the same again: the old output or the complete new one, and the same bytes."""

from __future__ import annotations

import json
import os
import signal
import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines import run
from pipelines.log.files import hash_file, write_log
from pipelines.stage import Request, run_stage
from tests.controlled import controlled_log

BRIEF = run.Settings(skip=tuple(m.replace("_", "-") for m in run.STEPS if m not in ("inspect", "reconstruct")))
POINTS = [5, pytest.param(200, marks=pytest.mark.slow)]


def _recorded(folder: Path, seed: int) -> None:
    """Two logs, one of which another recording replaces from time to time."""
    for name, which in (("a", seed), ("b", 1)):
        write_log(folder / f"logs/{name}.h5", replace(controlled_log(400, which), name=f"log {name}"))


def _run(folder: Path) -> None:
    run_stage(run.STAGE, Request((folder / "logs",), out=folder / "out", no_report=True), BRIEF)


def _contents(out: Path) -> dict[str, str]:
    """Every file by its hash, provenance.json apart."""
    return {p.relative_to(out).as_posix(): hash_file(p) for p in out.rglob("*") if p.is_file() and p.name != "provenance.json"}


def _killed(folder: Path, after: float) -> bool:
    """Run in a child of its own group that is killed after so many seconds; False where it had ended before."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # a fork beside threads: this child takes none of their locks
        child = os.fork()
    if child == 0:
        os.setpgid(0, 0)
        try:
            _run(folder)
        finally:
            os._exit(0)
    time.sleep(after)
    os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    return os.WIFSIGNALED(status)


@pytest.mark.parametrize("points", POINTS)
@pytest.mark.row("P01", "P07")
def test_a_killed_run_leaves_the_old_output_or_the_new_one(points: int, tmp_path: Path) -> None:
    """After every kill: a whole folder, each file as its provenance says. Run again: the bytes of a run that nobody killed."""
    wanted = {}
    for seed in (2, 3):
        _recorded(tmp_path / f"reference-{seed}", seed)
        began = time.monotonic()
        _run(tmp_path / f"reference-{seed}")
        lasts = time.monotonic() - began
        wanted[seed] = _contents(tmp_path / f"reference-{seed}/out")
    assert wanted[2] != wanted[3]
    folder, chance = tmp_path / "killed", np.random.default_rng(8)
    _recorded(folder, 2)
    _run(folder)
    killed, seed = 0, 2
    for _ in range(points):
        old, seed = seed, 5 - seed
        _recorded(folder, seed)
        killed += _killed(folder, float(chance.uniform(0.0, lasts)))
        left = _contents(folder / "out")
        assert left in (wanted[old], wanted[seed])
        said = json.loads((folder / "out/provenance.json").read_text())["outputs"]
        assert said == {name: left[name] for name in said}
        _run(folder)
        assert _contents(folder / "out") == wanted[seed]
        assert sorted(path.name for path in folder.iterdir()) == ["logs", "out"], "the next run sweeps up what the killed one left"
    assert killed > points // 2, "most runs had ended before: the test proves nothing"
