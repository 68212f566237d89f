"""What a search may spend, counted in evaluations: equal numbers of them give equal designs, however fast the machine."""

from __future__ import annotations

import time
from collections.abc import Callable

__all__ = ["Budget", "SpentError"]

_TELL_EVERY = 1.0  # [s]
_LOOK_EVERY = 8  # evaluations: asking for the time of the process may cost as much as one of them


class SpentError(Exception):
    """The search is over; what it has found by then is its answer."""


class Budget:
    """Count evaluations; end the search at a number of them, or after seconds of computing."""

    def __init__(self, seconds: float | None, evaluations: int | None, tell: Callable[[int], None] = lambda done: None,
                 reserve: float = 0.0) -> None:
        """One of both may be None; `tell` is called about every second with the evaluations so far.

        Args:
            reserve: of the seconds, what so many evaluations take is left for what comes after the search; half of them at
                most, for the first evaluations take longer than those to come.
        """
        self.seconds, self.limit, self.reserve = seconds, evaluations, reserve
        self.done = 0
        self._tell, self._start, self._told, self._elapsed = tell, time.process_time(), 0.0, 0.0

    @property
    def elapsed(self) -> float:
        """Seconds of computing since the search began."""
        return time.process_time() - self._start

    def spend(self) -> None:
        """Before each evaluation.

        Raises:
            SpentError: nothing is left.
        """
        if self.done % _LOOK_EVERY == 1:
            self._elapsed = self.elapsed
        elapsed = self._elapsed
        if self.limit is not None:
            spent = self.done >= self.limit
        else:
            left = min(self.reserve * elapsed / max(self.done, 1), 0.5 * (self.seconds or 0.0))
            spent = self.seconds is not None and elapsed + left >= self.seconds
        if spent and (self.limit is not None or self.done > 0):  # one at least: else there is nothing to answer with
            raise SpentError
        self.done += 1
        if elapsed - self._told >= _TELL_EVERY:
            self._told = elapsed
            self._tell(self.done)
