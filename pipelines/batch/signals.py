"""Hear that a batch shall end (Ctrl-C, SIGTERM) without being torn out of what is just being written (P06)."""

from __future__ import annotations

import signal
import threading
from types import FrameType
from typing import Any, Final

__all__ = ["Listener"]

_STOPPING: Final = (signal.SIGINT, signal.SIGTERM)


class Listener:
    """While it is entered, signals to stop are noted: `number` is the first one's, 0 where there was none."""

    def __init__(self) -> None:
        self.number = 0
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Listener:
        if threading.current_thread() is threading.main_thread():  # no other thread may have handlers
            self._before = {number: signal.signal(number, self._heard) for number in _STOPPING}
        return self

    def _heard(self, number: int, _frame: FrameType | None) -> None:
        self.number = self.number or number

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
