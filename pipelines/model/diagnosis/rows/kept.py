"""Rows that were laid before: the columns of an effect that follow from the motion alone are the same whatever was fitted since.

    kept.of(key, lay)                       what `lay()` makes, made once as long as there is room
    together(stores, work, pieces)          [work(piece) for piece in pieces] by two processes, what either lays kept for both
"""

from __future__ import annotations

import os
import weakref
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable, Sequence
from functools import partial
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from pipelines.log.shared_work import shared_out

__all__ = ["Kept", "together"]

Rows = npt.NDArray[Any]

P = TypeVar("P")
A = TypeVar("A")

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

    def keys(self) -> frozenset[Hashable]:
        """Of all there is."""
        return frozenset(self._rows)

    def since(self, before: frozenset[Hashable]) -> list[tuple[Hashable, Rows]]:
        """What came in after `before`, the newest last."""
        return [(key, rows) for key, rows in self._rows.items() if key not in before]

    def take(self, more: Iterable[tuple[Hashable, Rows]]) -> None:
        for key, rows in more:
            self.of(key, partial(np.asarray, rows))


def together(stores: Iterable[Kept], work: Callable[[P], A], pieces: Sequence[P]) -> list[A]:
    """What `work` makes of each piece, in order; rows that another process lays for it come into the `stores` of this one."""
    own = list({id(store): store for store in stores}.values())
    before = [store.keys() for store in own]

    def left() -> list[list[tuple[Hashable, Rows]]]:
        return [store.since(keys) for store, keys in zip(own, before, strict=True)]

    def take(more: list[list[tuple[Hashable, Rows]]]) -> None:
        for store, rows in zip(own, more, strict=True):
            store.take(rows)

    return shared_out(work, pieces, left=left, take=take)
