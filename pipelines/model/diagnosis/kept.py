"""Rows that were laid before: the columns of an effect that follow from the motion alone are the same whatever was fitted since.

    kept.of(key, lay)       what `lay()` makes, made once as long as there is room
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable

from pipelines.log.experiment import Array

__all__ = ["Kept"]

_ROOM = 128 << 20  # [bytes]


class Kept:
    """The rows asked for last; the oldest make room. What comes out is not to be written to."""

    def __init__(self, room: int = _ROOM) -> None:
        self._room, self._used = room, 0
        self._rows: OrderedDict[Hashable, Array] = OrderedDict()

    def of(self, key: Hashable, lay: Callable[[], Array]) -> Array:
        found = self._rows.pop(key, None)
        if found is None:
            found = lay()
            found.flags.writeable = False
            self._used += found.nbytes
        self._rows[key] = found
        while self._used > self._room and len(self._rows) > 1:
            _, old = self._rows.popitem(last=False)
            self._used -= old.nbytes
        return found
