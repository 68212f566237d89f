"""Smooth logs that are longer than memory, part by part."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from pipelines.signal.observer import Observer
from pipelines.signal.smoother import Smoother, smooth

__all__ = ["smooth_in_parts"]

Array = npt.NDArray[np.float64]


def smooth_in_parts(read: Callable[[int, int], Array], samples: int, observer: Observer,
                    size: int = 65536) -> Iterator[tuple[int, Array]]:
    """What `smooth` gives of a log of any length, in constant memory: (first sample, states (order, size, joints)) part by part.

    `read(first, last)` gives measured samples. Each part is smoothed with as many samples on either side as the filter
    needs to forget them, so the parts join to about 1e-15 of the signal.
    """
    own, reach = Smoother(observer), observer.settled
    for first in range(0, samples, size):
        last = min(samples, first + size)
        before, behind = max(0, first - reach), min(samples, last + reach)
        while True:
            y = read(before, behind)
            known = np.isfinite(y)
            short = known[:first - before].sum(axis=0).min() < reach and before > 0
            brief = known[last - before:].sum(axis=0).min() < reach and behind < samples
            if not (short or brief):
                break
            before = max(0, first - 2 * (first - before)) if short else before
            behind = min(samples, last + 2 * (behind - last)) if brief else behind
        yield first, smooth(y, own).states[:, first - before:last - before]
