"""Seeds and cases of which a few stand for all in a run of every day; the others are run by name alone (pytest -m slow)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def seeds(count: int, usual: int = 1) -> list[Any]:
    """Return `count` seeds; those after the `usual` ones are run by name."""
    return [pytest.param(seed, marks=pytest.mark.slow if seed >= usual else ()) for seed in range(count)]


def rarely(*cases: Any) -> list[Any]:
    """Return cases, each a value or a tuple of values, that are run by name."""
    return [pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=pytest.mark.slow) for case in cases]


def usually(every: Iterable[Any], *kept: Any) -> list[Any]:
    """Return every case; those that are not among `kept` are run by name."""
    return [case if case in kept else rarely(case)[0] for case in every]
