"""Set up the process of a command, or of a worker: threads, garbage, memory. Of a run of half a second it saves a fifth.

    economise()      first of all, before NumPy is loaded
"""

from __future__ import annotations

import atexit
import ctypes
import gc
import os

__all__ = ["economise", "one_thread"]

_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
_OBJECTS = 100_000  # made since the last search for cycles, before the next
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # malloc.h
_ARRAY = 32 << 20  # [B] the largest array whose memory is kept for the next: where glibc would end by itself
_KEPT = 64 << 20  # [B] free memory at most


def economise() -> None:
    """One BLAS thread, few searches for cycles, memory of arrays used again."""
    one_thread()
    # Modules stay and arrays go by reference counts: to look for cycles among them at every 700th object costs 30 ms,
    # and again at the very end, when all goes anyway.
    gc.set_threshold(_OBJECTS, 20, 20)
    atexit.register(gc.freeze)
    # Each array of a 10 s log would be mapped anew, and every page of it faults: 40 ms.
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)  # glibc has it
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, _ARRAY)
        mallopt(_M_TRIM_THRESHOLD, _KEPT)


def one_thread() -> None:
    """One BLAS thread, here and in every process made from here. Default threading makes the many small solves 5-10 times slower
    (design.md), and beside as many processes as cores more threads only stand in each other's way."""
    for name in _THREADS:
        os.environ.setdefault(name, "1")
