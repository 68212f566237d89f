"""A search on made-up numbers: what each model leaves of three joints, and the causes that it accepted."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from pipelines.model.effects import find_effect
from pipelines.model.effects.base import Effect

__all__ = ["FLOOR", "effect", "left", "searched"]

FLOOR = np.array([0.01, 0.01, 0.01])


def left(*rms: float) -> Any:
    return SimpleNamespace(rms=np.array(rms), model=SimpleNamespace(effects=()))


def searched(nominal: Any, *causes: tuple[Effect, Any]) -> Any:
    """A search that accepted these causes, with what each left."""
    before, steps = nominal, []
    for effect, after in causes:
        steps.append(SimpleNamespace(before=before, best=SimpleNamespace(done=after, effect=effect), trials=(), screened=()))
        before = after
    model = SimpleNamespace(effects=tuple(SimpleNamespace(effect=effect, log=None, possible=True) for effect, _ in causes))
    return SimpleNamespace(nominal=nominal, steps=steps, final=SimpleNamespace(rms=before.rms, model=model))


def effect(name: str, joint: int | None) -> Effect:
    return find_effect(name)(joint=joint)
