"""Faults of files and of the machine: each ends in a clear error or a fallback, in bounded time and memory, never in exit 70."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import signal
import subprocess
import time
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.mutations import read_apart, warm_up
from pipelines.errors import UsageError
from pipelines.importers import patterns
from pipelines.importers.patterns import matches
from tests.cli.commands import REPO, RRRID

SECONDS, MEGABYTES = 5.0, 500.0  # of CPU and of memory beyond the program's own
_NUMBERS = ",".join(["0.25"] * 80_000)

HOSTILE: dict[str, tuple[str, str]] = {
    "dotted key": ("robot", "a." * 50_000 + "a = 1"),
    "dotted key in a table": ("robot", "x = {" + "a." * 3_000 + "a = 1}"),
    "dotted keys within each other": ("recipe", "x = " + "{a.a.a.a.a.a.a.a = " * 60 + "1" + "}" * 60),
    "many deep tables": ("recipe", "".join(f"[a{k}.b.c.d.e.f]\n" for k in range(300_000))),
    "deep array": ("settings", "a = " + "[" * 100_000),
    "wide inline table": ("recipe", "a = {" + ",".join(f"a{k} = 1" for k in range(300_000)) + "}"),
    "header of 60,000 names": ("csv", ",".join(f"c{k}" for k in range(60_000)) + "\n" + f"{_NUMBERS[:300_000]}\n" * 3),
    "number of 400,000 digits": ("csv", "t,q\n" + "1" * 400_000 + ",2x\n" + "1,2\n" * 50),
    "blanks before a unit": ("csv", "a" + " " * 200_000 + "[x" + " " * 200_000 + "\n1\n2\n3\n"),
    "400,000 quotes": ("csv", '"' * 400_000 + "\n1,2\n3,4\n"),
    "chain of 5,000 joints": ("urdf", '<robot name="r">' + "".join(
        f'<link name="l{k}"/><joint name="j{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/></joint>'
        for k in range(5000)) + '<link name="l5000"/></robot>'),
}


@pytest.fixture(scope="module")
def _warm() -> None:
    warm_up()


@pytest.mark.usefixtures("_warm")
@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_text_costs_little(name: str) -> None:
    """Reading it ends within 5 s and 500 MB, in a draft or in an error with a code."""
    kind, text = HOSTILE[name]
    reading = read_apart(kind, text.encode())
    assert not reading.outcome.startswith("internal"), reading.outcome
    assert reading.seconds < SECONDS
    assert reading.megabytes < MEGABYTES


@pytest.mark.parametrize("pattern", ["{x:(a+)+}!.csv"])
def test_a_pattern_cannot_hang_the_import(pattern: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An expression that would take ages is refused when its time, here a second, is over; healthy ones give their groups."""
    monkeypatch.setattr(patterns, "RECIPE", replace(patterns.RECIPE, seconds=1.0))
    began = time.monotonic()
    with pytest.raises(UsageError, match=r"RRID-C02.*takes more than 1 s"):
        matches([pattern], ["a" * 60 + ".csv"], tmp_path)
    assert time.monotonic() - began < 15.0  # on a busy machine
    assert matches([r"{x:run}_{n:\d{2}}.csv", "*.mat"], ["run_07.csv", "b.mat"], tmp_path) == [
        {"run_07.csv": {"stem": "run_07", "x": "run", "n": "07"}}, {"b.mat": {"stem": "b"}}]


def _shell(line: str, cwd: Path, **environment: str) -> subprocess.CompletedProcess[bytes]:
    command = line.replace("RRRID", shlex.join(RRRID))
    return subprocess.run(["bash", "-c", command], capture_output=True, cwd=cwd, check=False, timeout=120,
                          env=os.environ | {"PYTHONPATH": str(REPO)} | environment)


@pytest.mark.parametrize("closed", ["<&- >&- 2>&-"])
def test_closed_streams_are_no_error(closed: str, logs: Path) -> None:
    """Without standard output, error, or any stream the work is done all the same, and an error keeps its code."""
    done = _shell(f"RRRID convert logs --to csv --out out {closed}; echo $? > code; "
                  f"RRRID convert nowhere {closed}; echo $? >> code", logs)
    assert (logs / "code").read_text().split() == ["0", "2"], done.stderr
    assert (logs / "out" / "provenance.json").is_file()


def test_a_full_standard_error_leaves_the_error_object(tmp_path: Path) -> None:
    done = _shell("RRRID inspect nowhere --json 2>/dev/full", tmp_path)
    assert done.returncode == json.loads(done.stdout)["exit"] == 2
    done = _shell("RRRID inspect nowhere --json >/dev/full", tmp_path)
    assert done.returncode == 2
    assert b"nowhere" in done.stderr


@pytest.mark.slow
def test_a_killed_batch_leaves_no_temporary_folder(logs: Path) -> None:
    """Nor does one that comes to its end."""
    (temporary := logs / "tmp").mkdir()
    for k in range(40):
        shutil.copytree(logs / "logs", logs / "many" / str(k))
    words = [*RRRID, "batch", "many", "--stage", "convert", "--jobs", "1", "--out", "out", "-q"]
    environment = os.environ | {"PYTHONPATH": str(REPO), "TMPDIR": str(temporary)}
    with subprocess.Popen(words, cwd=logs, env=environment, stderr=subprocess.DEVNULL) as process:
        while not list((logs / "out").glob("items/*/result.json")):
            assert process.poll() is None
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
    assert not list(temporary.iterdir())
    shutil.rmtree(logs / "many")
    shutil.copytree(logs / "logs", logs / "many" / "0")
    done = subprocess.run([*words[:-1], "--no-report"], cwd=logs, env=environment, capture_output=True, text=True, check=False,
                          timeout=120)
    assert done.returncode == 0, done.stderr
    assert not list(temporary.iterdir())
