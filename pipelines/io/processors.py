"""How many processors there are for this process: it may be held to some of the machine's."""

from __future__ import annotations

import os


def processors() -> int:
    """Return how many this process may use; all where the system does not say (macOS)."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
