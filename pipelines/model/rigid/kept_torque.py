"""Torques of a chain over a motion, kept for whoever asks the same again.

    tau = kept(chain, (q, dq, ddq, phi), work)        what `work()` makes; made once for the same numbers

The slopes of an arm whose encoder misreads are found by differences: every friction law is moved a little, and the rigid body is
asked for the same torque over the same corrected motion each time. Comparing motions costs a hundredth of the recursion.
"""

from __future__ import annotations

from collections.abc import Callable
from threading import Lock

import numpy as np
import numpy.typing as npt

from pipelines.model.rigid.geometry import SerialChain

__all__ = ["kept"]

Array = npt.NDArray[np.float64]

_FEWEST = 256  # samples: of fewer, as in the steps of a simulation, working them out is as quick
_MOST = 64_000_000  # bytes that are kept

_Entry = tuple[SerialChain, tuple[Array, ...], Array]
_known: list[_Entry] = []  # newest first
_lock = Lock()


def kept(chain: SerialChain, asked: tuple[Array, ...], work: Callable[[], Array]) -> Array:
    """A copy of its own for who asks; `asked` begins with the array that is most likely to differ."""
    if asked[0].ndim != 2 or len(asked[0]) < _FEWEST:
        return work()
    with _lock:
        for place, (other, same, torque) in enumerate(_known):
            if other is chain and all(map(_equal, asked, same)):
                _known.insert(0, _known.pop(place))
                return torque.copy()
    made = work()
    entry = chain, tuple(x.copy() for x in asked), made.copy()
    with _lock:
        _known.insert(0, entry)
        while len(_known) > 1 and sum(map(_size, _known)) > _MOST:
            _known.pop()
    return made


def _equal(one: Array, other: Array) -> bool:
    """The first row tells most apart."""
    return one.shape == other.shape and np.array_equal(one[:1], other[:1]) and np.array_equal(one, other)


def _size(entry: _Entry) -> int:
    return sum(x.nbytes for x in entry[1]) + entry[2].nbytes
