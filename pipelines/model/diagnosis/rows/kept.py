"""Rows that were laid before: the columns of an effect that follow from the motion alone are the same whatever was fitted since.

    kept.of(key, lay)                       what `lay()` makes, made once as long as there is room
"""

from __future__ import annotations

import os
import weakref
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any

import numpy.typing as npt

__all__ = ["Kept"]

Rows = npt.NDArray[Any]


_ROOM = 192 << 20  # [bytes]


class Kept:
    """The rows asked for last; the oldest make room. What comes out is not to be written to."""

    def __init__(self, room: int = _ROOM) -> None:
        self._room, self._used = room, 0
        self._rows: OrderedDict[Hashable, Rows] = OrderedDict()
        self._numbered: list[tuple[weakref.ref[object], Hashable]] = []
        self._count = 0

    def of(self, key: Hashable, lay: Callable[[], Rows]) -> Rows:
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

    def number(self, thing: object) -> Hashable:
        """One for each object, as part of a key; what a copy of this process numbers has no number of this one's.

        Only objects that somebody else holds have one, and no number is given twice.
        """
        self._numbered = [(other, number) for other, number in self._numbered if other() is not None]
        for other, number in self._numbered:
            if other() is thing:
                return number
        self._count += 1
        self._numbered.append((weakref.ref(thing), (os.getpid(), self._count)))
        return self._numbered[-1][1]
