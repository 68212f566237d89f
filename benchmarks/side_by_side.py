"""Time two ways of doing one thing, in turn, in one process: on a shared machine only their ratio
means anything.

    from benchmarks import side_by_side        # first of all imports: it keeps BLAS to one thread
    race = side_by_side.race(ours, peer)
    print(side_by_side.row("TX40, 1e4 samples", race, ours_error=1e-15, peer_error=0.0))

Run a benchmark from the repository's root as `python -m benchmarks.regressor`.
"""

from __future__ import annotations

import os
import sys

# NumPy's BLAS reads these once, when it is loaded; set afterwards they do nothing, silently.
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
if "numpy" in sys.modules and any(os.environ.get(name) != "1" for name in _THREADS):
    raise ImportError(
        "import benchmarks.side_by_side before numpy: it sets the number of BLAS threads"
    )
os.environ.update(dict.fromkeys(_THREADS, "1"))

import gc  # noqa: E402
import statistics  # noqa: E402
import time  # noqa: E402
from collections.abc import Callable  # noqa: E402
from dataclasses import dataclass  # noqa: E402

HEADER = f"{'':44s}{'ours':>11s}{'peer':>11s}{'ratio':>16s}{'error ours':>13s}{'error peer':>13s}"


@dataclass(frozen=True)
class Race:
    """Medians of several repeats; the ratio is the median of the ratios of neighbouring runs."""

    ours_s: float  # [s]
    peer_s: float  # [s]
    ratio: float  # peer / ours: how many times faster ours is
    low: float  # smallest and largest of those ratios
    high: float


def race(ours: Callable[[], object], peer: Callable[[], object], repeats: int = 7) -> Race:
    """Run `ours` and `peer` alternately, `repeats` times each after one run to warm up.

    Each ratio is of two runs that follow one another, so that a load that comes and goes touches
    both; who goes first changes every time. Garbage is collected between the runs, not in them.
    """
    ours()
    peer()
    times: list[tuple[float, float]] = []
    for k in range(repeats):
        if k % 2:
            theirs = _seconds(peer)
            mine = _seconds(ours)
        else:
            mine = _seconds(ours)
            theirs = _seconds(peer)
        times.append((mine, theirs))
    ratios = [theirs / mine for mine, theirs in times]
    return Race(
        statistics.median(mine for mine, _ in times),
        statistics.median(theirs for _, theirs in times),
        statistics.median(ratios),
        min(ratios),
        max(ratios),
    )


def _seconds(work: Callable[[], object]) -> float:
    gc.collect()
    gc.disable()
    try:
        start = time.perf_counter()
        work()
        return time.perf_counter() - start
    finally:
        gc.enable()


def row(name: str, race: Race, ours_error: float, peer_error: float) -> str:
    """Return one line of a table under `HEADER`. Errors are relative, against one common judge."""
    spread = f"×{race.ratio:.1f} ({race.low:.1f}-{race.high:.1f})"
    times = f"{_time(race.ours_s):>11s}{_time(race.peer_s):>11s}"
    return f"{name:44s}{times}{spread:>16s}{ours_error:13.1e}{peer_error:13.1e}"


def _time(seconds: float) -> str:
    return f"{seconds:.3f} s" if seconds >= 1.0 else f"{seconds * 1e3:.2f} ms"
