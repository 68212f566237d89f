"""Seeds of which the first few stand for all in a run of every day."""

from __future__ import annotations

from typing import Any

import pytest


def seeds(count: int, usual: int = 1) -> list[Any]:
    """Return `count` seeds; those after the `usual` ones are run by name alone (pytest -m slow)."""
    return [pytest.param(seed, marks=pytest.mark.slow if seed >= usual else ()) for seed in range(count)]
