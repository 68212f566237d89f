"""A reading child that a file has taken over may claim anything: it is held against what is there before it is allocated."""

from __future__ import annotations

import contextlib
import json
import os
import stat
import struct
import sys
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipelines.errors import InputRejected
from pipelines.importers.sources import read_table
from pipelines.io import log_reader
from pipelines.io.files import open_log, write_log
from pipelines.io.guard import Answer, Guard, guarded
from tests.io.logs import small_log

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="finds the child's handles in /proc")
MB = 1 << 20


def _handle(kind: Callable[[int], bool]) -> int:
    """In the child, which has no other: where its parent listens (S_ISSOCK), or the file for samples (S_ISREG)."""
    for name in os.listdir("/proc/self/fd"):
        with contextlib.suppress(OSError):  # the listing itself
            if int(name) > 2 and kind(os.fstat(int(name)).st_mode):
                return int(name)
    raise AssertionError


def _say(text: bytes, length: int | None = None) -> None:
    """Past all that the child would say by itself."""
    os.write(_handle(stat.S_ISSOCK), struct.pack("<Q", len(text) if length is None else length) + text)
    time.sleep(60.0)


def _claim(arrays: dict[str, Any], there: int = 0) -> None:
    """Samples, in a shared file of `there` bytes."""
    os.ftruncate(_handle(stat.S_ISREG), there)
    _say(json.dumps({"about": {}, "arrays": arrays}).encode())


CLAIMS = {
    "more than there is": lambda: _claim({"x": [0, 1 << 40]}, 8),
    "more than memory": lambda: _claim({"x": [0, 1 << 40]}, 8 << 40),
    "the same again and again": lambda: _claim({str(i): [0, MB] for i in range(10_000)}, 8 * MB),
    "one behind the other, and not there": lambda: _claim({str(i): [8 * MB * i, MB] for i in range(100)}, 8 * MB),
    "before the beginning": lambda: _claim({"x": [-8, 2]}, 8),
    "a side of less than nothing": lambda: _claim({"x": [0, -1, -1]}, 8),
    "nothing, endlessly wide": lambda: _claim({"x": [0, 0, 1 << 70]}),
    "no numbers": lambda: _claim({"x": [0, "1"]}, 8),
    "no table": lambda: _say(b"[]"),
    "no JSON": lambda: _say(b"\xff\xfe{"),
    "nested": lambda: _say(b"[" * 100_000),
    "an error of another form": lambda: _say(b'{"error": {"exit": [], "code": 3}}'),
}


def _refused(path: Path, work: Any, code: str) -> None:
    """By a child for this file alone, and by one that has read another before."""
    asked = iter(range(10))

    def turned(words: Any) -> Answer:
        if words == "good" and next(asked) == 0:
            return Answer({}, {"x": np.arange(3.0)})
        work()
        raise AssertionError

    guard = Guard(turned)
    guard.ask("good", path, "numpy", lambda answer: (answer, True))
    tracemalloc.start()
    try:
        began = time.monotonic()
        for ask in (lambda: guarded(work, path), lambda: guard.ask("bad", path, "numpy", lambda answer: (answer, True))):
            with pytest.raises(InputRejected, match=f"RRID-{code}"):
                ask()
        assert time.monotonic() - began < 5.0
        assert tracemalloc.get_traced_memory()[1] < 64 * MB
    finally:
        tracemalloc.stop()
        guard.let_go()


@pytest.mark.row("F03")
@pytest.mark.parametrize("claim", CLAIMS)
def test_what_is_claimed_is_not_allocated(tmp_path: Path, claim: str) -> None:
    """F03 at once, whatever it says of samples and errors; the parent needs no memory for it."""
    (tmp_path / "a").write_bytes(b"x")
    _refused(tmp_path / "a", CLAIMS[claim], "F03 .*makes no sense")


@pytest.mark.row("X05")
def test_an_endless_text_is_not_waited_for(tmp_path: Path) -> None:
    """X05: an exabyte of text, of which a few bytes come."""
    (tmp_path / "a").write_bytes(b"x")
    _refused(tmp_path / "a", lambda: _say(b"{}", 1 << 60), "X05")


@pytest.mark.row("F03")
@pytest.mark.parametrize("about", [{}, {"text": 3, "digest": None}, {"text": "{}", "digest": 3}])
def test_a_log_that_is_none_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, about: dict[str, Any]) -> None:
    """F03: what came of reading it has not the form of a log."""
    write_log(tmp_path / "a.h5", small_log())
    guard = Guard(lambda words: Answer(about, {}))
    monkeypatch.setattr(log_reader, "_guard", guard)
    with pytest.raises(InputRejected, match="RRID-F03 .*makes no sense"):
        open_log(tmp_path / "a.h5")
    guard.let_go()


@pytest.mark.row("F08")
@pytest.mark.parametrize("about", [{}, {"names": ["a"]}, {"names": [], "text": {}, "groups": {}, "checks": []}])
def test_a_recording_that_is_none_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, about: dict[str, Any]) -> None:
    """F08, as of any damaged MAT file."""
    import scipy.io

    scipy.io.savemat(tmp_path / "a.mat", {"q": np.zeros((50, 3))})
    monkeypatch.setattr("pipelines.importers.sources.guarded", lambda work, path: Answer(about, {}))
    with pytest.raises(InputRejected, match="RRID-F08"):
        read_table(tmp_path / "a.mat")


def test_samples_of_every_shape_come_as_they_are(tmp_path: Path) -> None:
    """None, one, empty ones among others, many dimensions: bounds refuse nothing that is there."""
    (tmp_path / "a").write_bytes(b"x")
    rng = np.random.default_rng(1)
    for shapes in ((), ((0,),), ((5,), (0, 3), (4, 2, 3), (1,), (2000, 6))):
        sent = {str(i): rng.normal(size=shape) for i, shape in enumerate(shapes)}
        got = guarded(lambda sent=sent: Answer({"n": 1}, sent), tmp_path / "a").arrays  # type: ignore[misc]
        assert set(got) == set(sent)
        assert all(np.array_equal(got[name], sent[name]) for name in sent)
