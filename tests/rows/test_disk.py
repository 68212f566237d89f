"""P02: the disk is full or fails while a stage writes. Exit 6, nothing partial, the old output as it was; then it works again.

Files that may not grow (RLIMIT_FSIZE) are the kernel's own refusal, in every library that writes; full disks and I/O errors are set
at the calls that meet them: of `fsync`, `replace` and `open` the first, the last and some between.
"""

from __future__ import annotations

import errno
import os
import resource
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from pipelines.errors import RrridError
from pipelines.io.files import open_log, write_log
from pipelines.io.output import hash_file
from pipelines.stage import Inputs, Request, Stage, run_stage
from tests import test_every_stage
from tests.cli.commands import REPO, RRRID
from tests.io.logs import small_log
from tests.rows.commanded import Command
from tests.seeds import usually

# HDF5 complains once more when its objects of a file that found no room are taken apart.
pytestmark = [pytest.mark.row("P02"), pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")]
EVERY = usually(test_every_stage.MODULES, "convert", "import_log", "simulate")


@contextmanager
def small_files(size: int) -> Iterator[None]:
    """No file of this process may grow beyond `size` bytes: write(2) says EFBIG, as it says ENOSPC of a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@contextmanager
def failing(name: str, number: int, at: int) -> Iterator[list[int]]:
    """The `at`-th call of os.`name` fails; yields [calls so far]."""
    real: Callable[..., Any] = getattr(os, name)
    calls, here = [0], os.getpid()

    def call(*words: Any, **more: Any) -> Any:
        calls[0] += os.getpid() == here  # once, not in a child as well
        if os.getpid() == here and calls[0] == at:
            raise OSError(number, os.strerror(number))
        return real(*words, **more)

    setattr(os, name, call)
    try:
        yield calls
    finally:
        setattr(os, name, real)


def _contents(folder: Path) -> dict[str, str]:
    return {path.relative_to(folder).as_posix(): hash_file(path) for path in _files(folder)}


def _files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file() and path.name != "provenance.json"]


class Writer:
    """A stage whose result is known: what is tried is its writing alone."""

    def __init__(self, module: str, tmp_path: Path, samples: Path) -> None:
        stage = test_every_stage._stage(module)
        known: dict[str, Any] = {}

        def remember(inputs: Inputs, settings: Any) -> Any:
            known["inputs"], known["settings"], known["result"] = inputs, settings, stage.compute(inputs, settings)
            return known["result"]

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(test_every_stage, "_stage", lambda _: replace(stage, compute=remember))
            _, outcome = test_every_stage._run(module, tmp_path, samples)
        self.known, self.out = known, outcome.folder
        self.stage: Stage[Any, Any] = replace(stage, read=lambda request, settings: known["inputs"])
        assert self.write(lambda: failing("fsync", 0, -1))[0] is None
        self.before = _contents(self.out)
        self.beside = sorted(path.name for path in self.out.parent.iterdir())

    def write(self, fault: Callable[[], Any]) -> tuple[RrridError | None, int]:
        """Write again, under a fault that begins when all is computed; the error, and how often the call was met."""
        held: list[Any] = []

        def compute(inputs: Inputs, settings: Any) -> Any:
            held.append(fault())
            self.calls = held[0].__enter__()
            return self.known["result"]

        error: RrridError | None = None
        try:
            run_stage(replace(self.stage, compute=compute), Request((), out=self.out, no_report=True), self.known["settings"])
        except RrridError as problem:
            error = problem
        finally:
            held[0].__exit__(None, None, None)
        return error, self.calls[0] if self.calls else 0

    def hold(self, error: RrridError | None, fault: str) -> None:
        """Exit 6 with place and remedy, the old output whole, nothing beside it; and then it works again."""
        assert error is not None, fault
        assert (error.exit_code, error.code) == (6, "RRID-P02"), error
        assert error.where
        assert "rrrid-tmp" not in str(error)
        assert error.remedy
        assert _contents(self.out) == self.before, fault
        assert sorted(path.name for path in self.out.parent.iterdir()) == self.beside, fault


@pytest.mark.parametrize("module", EVERY)
def test_no_stage_leaves_half_an_output(module: str, tmp_path: Path, samples: Path) -> None:
    writer = Writer(module, tmp_path, samples)
    largest = max(path.stat().st_size for path in _files(writer.out))
    for size in (0, 512, largest // 2, largest - 1):
        writer.hold(writer.write(lambda size=size: small_files(size))[0], f"files of {size}")  # type: ignore[misc]
    for name, number in (("fsync", errno.EIO), ("replace", errno.ENOSPC), ("open", errno.EMFILE)):
        error, calls = writer.write(lambda name=name: failing(name, 0, -1))  # type: ignore[misc]
        assert error is None
        # The very last fsync, of the folder around, comes when the new output stands; it is the same as the old here.
        for at in sorted({1, 2, calls // 2, calls - 1, calls} - {0}):
            writer.hold(writer.write(lambda name=name, number=number, at=at: failing(name, number, at))[0],  # type: ignore[misc]
                        f"{name}, call {at} of {calls}")
    assert writer.write(lambda: failing("fsync", 0, -1))[0] is None


def test_a_first_output_that_cannot_be_written_is_not_there(command: Command, tmp_path: Path) -> None:
    """Through the command: exit 6, and no folder at all."""
    write_log(tmp_path / "a.h5", small_log())
    with failing("fsync", errno.ENOSPC, 1):
        command("convert", "a.h5", "--out", "out").refused("P02", 6, "out", "free space and run again")
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5"]
    assert command("convert", "a.h5", "--out", "out").exit == 0


def test_a_limit_of_files_is_no_damaged_log(command: Command, tmp_path: Path) -> None:
    """A log is read where no file may grow: the limit is the machine's, not the log's."""
    write_log(tmp_path / "a.h5", small_log())
    with small_files(1000):
        command("convert", "a.h5", "--out", "out").refused("P02", 6, "out", "ulimit -f")
    assert open_log(tmp_path / "a.h5").log == small_log()


def test_a_disk_that_fails_while_reading_is_no_damaged_log(command: Command, tmp_path: Path) -> None:
    write_log(tmp_path / "a.h5", small_log())
    with failing("pread", errno.EIO, 1):
        command("convert", "a.h5", "--out", "out").refused("P02", 6, "a.h5", "Input/output error")


def test_a_full_standard_output_is_the_environment(tmp_path: Path) -> None:
    """/dev/full refuses every byte: one line, exit 6; the output folder is complete all the same."""
    write_log(tmp_path / "a.h5", small_log())
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([*RRRID, "convert", "a.h5", "--out", "out", "--json"], stdout=full, stderr=subprocess.PIPE, text=True,
                              cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(REPO)}, check=False)
    assert done.returncode == 6
    assert done.stderr.splitlines()[-1].startswith("rrrid: RRID-P02 standard output: no space left")
    assert "Traceback" not in done.stderr
    assert (tmp_path / "out/provenance.json").is_file()
