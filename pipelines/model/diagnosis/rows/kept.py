"""Rows that were laid before: the columns of an effect that follow from the motion alone are the same whatever was fitted since.

    kept.of(key, lay)                       what `lay()` makes, made once as long as there is room
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any

import numpy.typing as npt

__all__ = ["Kept"]

Rows = npt.NDArray[Any]

_ROOM = 192 << 20  # [bytes]


class Kept:
    """The rows asked for last; the oldest make room. What comes out is not to be written to."""

    def __init__(self) -> None:
        self._used = 0
        self._rows: OrderedDict[Hashable, Rows] = OrderedDict()

    def of(self, key: Hashable, lay: Callable[[], Rows]) -> Rows:
        found = self._rows.pop(key, None)
        if found is None:
            found = lay()
            found.flags.writeable = False
            self._used += found.nbytes
        self._rows[key] = found
        while self._used > _ROOM and len(self._rows) > 1:
            _, old = self._rows.popitem(last=False)
            self._used -= old.nbytes
        return found
