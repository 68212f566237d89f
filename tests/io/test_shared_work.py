"""Work shared by two processes gives what one gives; what the other process cannot do is done, or fails, here."""

from __future__ import annotations

import errno
import os
import signal
import sys
import threading
import time
from typing import Any

import numpy as np
import pytest

from pipelines.errors import Interrupted
from pipelines.io import shared_work
from pipelines.io.shared_work import shared_out

PIECES = list(range(9))


@pytest.fixture(autouse=True)
def two_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shared_work, "processors", lambda: 2)
    monkeypatch.setattr("multiprocessing.parent_process", lambda: None)


def slowly(piece: int) -> tuple[int, int]:
    time.sleep(0.03)
    return piece, os.getpid()


def test_both_processes_work_and_answers_stand_in_order() -> None:
    found = shared_out(slowly, PIECES)
    assert [piece for piece, _ in found] == PIECES
    assert len({process for _, process in found}) == 2


def test_large_arrays_come_back_as_they_were() -> None:
    def noise(seed: int) -> np.ndarray:
        time.sleep(0.02)
        return np.random.default_rng(seed).normal(size=200_000)

    assert all((got == noise(seed)).all() for seed, got in zip(PIECES, shared_out(noise, PIECES), strict=True))


def test_there_is_no_third_process() -> None:
    def inner(piece: int) -> set[int]:
        return {process for _, process in shared_out(slowly, PIECES[:3])} | {os.getpid()}

    here = os.getpid()
    assert all(here in made or len(made) == 1 for made in shared_out(inner, PIECES[:4]))


def test_pieces_of_a_process_that_dies_are_done_here() -> None:
    here = os.getpid()

    def only_here(piece: int) -> int:
        time.sleep(0.01)
        if os.getpid() != here:
            os._exit(3)
        return piece

    assert shared_out(only_here, PIECES) == PIECES


@pytest.mark.parametrize("bad", [0, 1, 7])
def test_an_error_is_told_and_no_process_is_left(bad: int, monkeypatch: pytest.MonkeyPatch) -> None:
    started, fork = list[int](), os.fork
    monkeypatch.setattr(os, "fork", lambda: started.append(child := fork()) or child)

    def fails(piece: int) -> int:
        time.sleep(0.01)
        if piece == bad:
            raise ValueError(f"piece {piece}")
        return piece

    with pytest.raises(ValueError, match=f"piece {bad}"):
        shared_out(fails, PIECES)
    assert started
    for child in started:  # not any child: other tests have theirs
        with pytest.raises(ChildProcessError):
            os.waitpid(child, os.WNOHANG)


def _handles() -> int:
    return len(os.listdir("/proc/self/fd"))


@pytest.mark.skipif(sys.platform != "linux", reason="counts handles in /proc")
@pytest.mark.parametrize("beside", [False, True])
def test_ctrl_c_while_the_copy_is_made_leaves_nothing(beside: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """No process and no open pipe, also where a thread beside takes the signal, and its handler runs at once."""
    ended = threading.Event()
    if beside:
        threading.Thread(target=ended.wait, daemon=True).start()
    started, fork, handles = list[int](), os.fork, _handles()

    def interrupted() -> int:
        if child := fork():
            started.append(child)
            os.kill(os.getpid(), signal.SIGINT)
        return child

    monkeypatch.setattr(os, "fork", interrupted)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # who starts tests in the background may have it ignored
    try:
        for _ in range(3):
            with pytest.raises(KeyboardInterrupt):
                shared_out(slowly, PIECES)
    finally:
        signal.signal(signal.SIGINT, before)
    ended.set()
    assert _handles() == handles
    assert len(started) == 3
    for child in started:
        with pytest.raises(ChildProcessError):
            os.waitpid(child, os.WNOHANG)


@pytest.mark.row("P06")
@pytest.mark.skipif(sys.platform != "linux", reason="counts handles in /proc")
def test_a_second_ctrl_c_leaves_no_signal_unheard(monkeypatch: pytest.MonkeyPatch) -> None:
    """P06: it comes while the program's handlers are put back: each of them hears again, and no process and no pipe is left."""
    started, fork, put, handles = list[int](), os.fork, signal.signal, _handles()

    def stop(number: int, _frame: object) -> None:
        raise Interrupted(number)

    def interrupted() -> int:
        if child := fork():
            started.append(child)
            os.kill(os.getpid(), signal.SIGINT)
        return child

    def put_back(number: int, handler: Any) -> Any:
        found = put(number, handler)
        if handler is stop:
            os.kill(os.getpid(), signal.SIGINT)
        return found

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    monkeypatch.setattr(os, "fork", interrupted)
    monkeypatch.setattr(signal, "signal", put_back)
    try:
        with pytest.raises(Interrupted):
            shared_out(slowly, PIECES)
        for number in before:
            with pytest.raises(Interrupted):
                signal.raise_signal(number)
    finally:
        for number, handler in before.items():
            put(number, handler)
    assert _handles() == handles
    assert len(started) == 1
    with pytest.raises(ChildProcessError):
        os.waitpid(started[0], os.WNOHANG)


def test_where_no_process_can_be_had_all_is_done_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """The system lets this user have no more of them (ulimit -u), or has no memory for one."""
    handles = _handles() if sys.platform == "linux" else 0

    def refused() -> int:
        raise BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")

    monkeypatch.setattr(os, "fork", refused)
    assert shared_out(slowly, PIECES) == [(piece, os.getpid()) for piece in PIECES]
    assert handles == (_handles() if sys.platform == "linux" else 0)


def test_a_program_whose_children_nobody_waits_for_gets_its_answers() -> None:
    """SIGCHLD ignored, as a program may inherit it: the system takes the copy away before anybody can wait for it."""
    before = signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    try:
        assert [piece for piece, _ in shared_out(slowly, PIECES)] == PIECES
    finally:
        signal.signal(signal.SIGCHLD, before)


def test_a_process_that_has_answered_leaves_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody kills it or waits for it, and by the next but one call nothing is left of it."""
    started, fork = list[int](), os.fork
    monkeypatch.setattr(os, "fork", lambda: started.append(child := fork()) or child)
    monkeypatch.setattr(os, "kill", None)
    shared_out(slowly, PIECES[:4])
    time.sleep(0.1)
    shared_out(slowly, PIECES[:4])
    assert len(started) == 2
    with pytest.raises(ChildProcessError):
        os.waitpid(started[0], os.WNOHANG)


def test_workers_of_a_batch_share_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("multiprocessing.parent_process", lambda: object())
    assert {process for _, process in shared_out(slowly, PIECES[:3])} == {os.getpid()}
