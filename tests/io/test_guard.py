"""A reading child that is kept from file to file: what a crash, a hang or a trace of an earlier file costs is that file alone."""

from __future__ import annotations

import contextlib
import fcntl
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from pipelines.errors import InputRejected
from pipelines.io import log_reader
from pipelines.io.files import open_log, write_log
from pipelines.io.guard import Answer, Guard
from tests.cli.commands import REPO
from tests.io.logs import small_log

Ask = Callable[..., Answer]


class _Served:
    """A child's work: it counts what it was asked, and misbehaves as the words say once it has been asked before."""

    def __init__(self) -> None:
        self.count = 0

    def __call__(self, words: Any) -> Answer:
        self.count += 1
        if words == "crash" or (words == "crash later" and self.count > 1):
            os.kill(os.getpid(), signal.SIGSEGV)
        if words == "hang" or (words == "hang later" and self.count > 1):
            time.sleep(60.0)
        if words == "refuse later" and self.count > 1:
            raise InputRejected("F02", "damaged", where="", remedy="copy it again")
        if words == "stumble" or (words == "stumble later" and self.count > 1):
            raise KeyError("a fault of its own")
        if words == "leave":
            os._exit(3)
        return Answer({"pid": os.getpid(), "count": self.count}, {"x": np.arange(3.0) + self.count})


@pytest.fixture
def ask(tmp_path: Path) -> Iterator[Ask]:
    """Ask a guard about a file; its answer is verified unless said otherwise."""
    guard, path = Guard(_Served()), tmp_path / "a"
    path.write_bytes(b"x")

    def asked(words: str = "", verified: bool = True, path: Path = path, needs: str = "numpy") -> Answer:
        return guard.ask(words, path, needs, lambda answer: (answer, verified))

    yield asked
    guard.let_go()


def test_a_child_is_kept_while_its_answers_are_verified(ask: Ask) -> None:
    """One process for file after file; a fresh one after a file that nobody could verify, or with a library it has not got."""
    first, second, third = ask(), ask(verified=False), ask()
    assert first.about["pid"] == second.about["pid"] != third.about["pid"]
    assert [a.about["count"] for a in (first, second, third)] == [1, 2, 1]
    assert [a.arrays["x"].tolist() for a in (first, second, third)] == [[1.0, 2.0, 3.0], [2.0, 3.0, 4.0], [1.0, 2.0, 3.0]]
    assert ask(needs="no.such.module").about["count"] == 1


@pytest.mark.row("F03")
@pytest.mark.parametrize("trace", ["crash later", "hang later", "refuse later", "stumble later"])
def test_no_file_pays_for_an_earlier_one(ask: Ask, trace: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """What only a used child does is not the file's fault: a fresh child decides, within the time that the file has."""
    monkeypatch.setattr("pipelines.io.guard._SECONDS", 2.0)
    ask()
    began = time.monotonic()
    assert ask(trace).about["count"] == 1
    assert time.monotonic() - began < 2.0


def test_a_fault_of_the_reader_itself_is_told(ask: Ask) -> None:
    """Of a fresh child and of a kept one, which a fresh one follows; the next file is read."""
    for kept in (False, True):
        if kept:
            ask()
        with pytest.raises(RuntimeError, match="a fault of its own"):
            ask("stumble")
        assert ask(verified=False).about["count"] == 1


@pytest.mark.row("F04")
@pytest.mark.parametrize("harm", ["sample", "digest", "text"])
def test_what_a_used_child_gets_wrong_is_read_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, harm: str) -> None:
    """An earlier file has left something broken behind: sound logs are read by a fresh child, and none is called damaged."""
    counts = iter(range(1000))

    def spoilt(words: Any) -> Answer:
        answer = log_reader._read(words)
        if next(counts) > 0:
            answer.about.update({"digest": {"digest": "0" * 64}, "text": {"text": "{}"}}.get(harm, {}))
            answer.arrays["q"][-1, -1] += harm == "sample"
        return answer

    guard = Guard(spoilt)
    monkeypatch.setattr(log_reader, "_guard", guard)
    logs = [small_log(seed=seed) for seed in range(3)]
    for seed, log in enumerate(logs):
        write_log(tmp_path / f"{seed}.h5", log)
    try:
        assert [open_log(tmp_path / f"{seed}.h5").log for seed in range(3)] == logs
        with h5py.File(tmp_path / "1.h5", "r+") as file:
            file["signals/q"][0, 0] += 1.0
        with pytest.raises(InputRejected, match="RRID-F04"):
            open_log(tmp_path / "1.h5")
    finally:
        guard.let_go()


@pytest.mark.row("F03")
def test_a_file_that_harms_every_child_is_refused(ask: Ask, monkeypatch: pytest.MonkeyPatch) -> None:
    """Crash and hang of the file itself: F03 in time, kept child or not, and the next file is read."""
    monkeypatch.setattr("pipelines.io.guard._SECONDS", 1.0)
    for words, said in (("crash", "signal 11"), ("hang", "did not end within 1 s"), ("leave", "ended its process")):
        ask()
        began = time.monotonic()
        with pytest.raises(InputRejected, match=f"RRID-F03 .*{said}"):
            ask(words)
        assert time.monotonic() - began < 3.0
        assert ask().about["count"] == 1


@pytest.mark.row("F14")
@pytest.mark.parametrize("harm", ["refuse", "crash"])
def test_a_file_that_is_written_while_it_is_read_is_not_called_damaged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                                      harm: str) -> None:
    """Half of it is old, half new: whatever the library makes of that, it is told to wait."""
    write_log(tmp_path / "a.h5", small_log())

    def meddled(words: Any) -> Answer:
        with (tmp_path / "a.h5").open("ab") as file:
            file.write(b"more")
        if harm == "crash":
            os.kill(os.getpid(), signal.SIGSEGV)
        raise InputRejected("F02", "damaged", where="", remedy="copy it again")

    guard = Guard(meddled)
    monkeypatch.setattr(log_reader, "_guard", guard)
    try:
        with pytest.raises(InputRejected, match="RRID-F14"):
            open_log(tmp_path / "a.h5")
    finally:
        guard.let_go()


@pytest.mark.row("F03")
@pytest.mark.parametrize("words", ["crash", "leave"])
def test_a_crash_is_told_where_nobody_can_wait_for_a_child(ask: Ask, words: str) -> None:
    """SIGCHLD ignored, as a program may inherit it: the system takes the dead child away, and says nothing of its end."""
    before = signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    try:
        with pytest.raises(InputRejected, match="RRID-F03 .*ended its process"):
            ask(words)
        assert ask().about["count"] == 1
    finally:
        signal.signal(signal.SIGCHLD, before)


def test_relative_paths_are_read_from_where_the_program_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The program changes its folder, and its kept child does not."""
    for name in "ab":
        write_log(tmp_path / name / "log.h5", small_log(name=name))
    for name in ("a", "b", "a"):
        monkeypatch.chdir(tmp_path / name)
        assert open_log("log.h5").log.name == name


def test_what_is_read_stays_what_it_was(ask: Ask) -> None:
    """Arrays of earlier files are not those of later ones, and nobody can write to them."""
    first = ask()
    ask()
    assert first.arrays["x"].tolist() == [1.0, 2.0, 3.0]
    with pytest.raises(ValueError, match="read-only"):
        first.arrays["x"][0] = 9.0


@pytest.mark.skipif(sys.platform != "linux", reason="counts handles in /proc")
def test_a_log_that_is_kept_holds_no_file(tmp_path: Path) -> None:
    """A command has 1000 logs open at once, and the system gives it 1024 handles."""
    write_log(tmp_path / "a.h5", small_log())
    open_log(tmp_path / "a.h5")
    before = len(os.listdir("/proc/self/fd"))
    logs = [open_log(tmp_path / "a.h5").log for _ in range(20)]
    assert len(os.listdir("/proc/self/fd")) == before
    assert logs == [small_log()] * 20


def test_an_opened_log_is_not_kept_locked(tmp_path: Path) -> None:
    """F15 looks for a lock; the child holds none when the log has been read."""
    path = tmp_path / "a.h5"
    write_log(path, small_log())
    log_reader._guard.let_go()
    open_log(path)
    assert log_reader._guard._child is not None
    with path.open("r+b") as file:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def test_the_reader_can_be_ended(tmp_path: Path) -> None:
    """No child is left to wait for, and the next log is read all the same."""
    write_log(tmp_path / "a.h5", small_log())
    for _ in range(2):
        assert open_log(tmp_path / "a.h5").log == small_log()
        child = log_reader._guard._child
        assert child is not None
        assert child._process > 0
        process = child._process
        log_reader.end_reader()
        with pytest.raises(ChildProcessError):
            os.waitpid(process, os.WNOHANG)


def test_each_thread_has_a_child_of_its_own(tmp_path: Path) -> None:
    """A child dies with the thread that made it; logs are read in any."""
    path = tmp_path / "a.h5"
    write_log(path, small_log())
    found: list[object] = []

    def read() -> None:
        found.extend(open_log(path).log for _ in range(3))

    open_log(path)
    threads = [threading.Thread(target=read) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    read()
    assert found == [small_log()] * 12


@pytest.mark.parametrize("end", ["", "os._exit(0)", "os.kill(os.getpid(), 9)"])
def test_the_child_goes_with_its_program(tmp_path: Path, end: str) -> None:
    """However a program ends: nobody waits for its output any longer, and no process stays."""
    write_log(tmp_path / "a.h5", small_log())
    program = ("import os, sys\nfrom pipelines.io import files, log_reader\nfiles.open_log(os.path.abspath('a.h5'))\n"
               f"print(log_reader._guard._child._process, flush=True)\n{end}\n")
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(REPO)}, timeout=20,
                          stdout=subprocess.PIPE, text=True, check=False)
    child = int(done.stdout)
    for _ in range(200):
        with contextlib.suppress(OSError):
            if Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()[0] != "Z":
                time.sleep(0.01)
                continue
        return
    pytest.fail("the child lives on")


def test_arrow_reserves_no_memory_that_a_child_may_not_use() -> None:
    code = "import pipelines.io.files, pyarrow; print(pyarrow.default_memory_pool().backend_name)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "system\n"
