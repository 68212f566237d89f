"""The numbers of a cause as it reports them, with their standard deviations.

    told(acting)                    {"order": Value(18.0, 0.01, "1/rev"), …} of an effect whose numbers are known
    parameters(done, place)         the same of effect number `place` of a fitted model

Covariance is that of all numbers of the model together, by the sandwich of `Refined.covariance`; what is reported follows from
them to first order (the delta method): √(s C sᵀ), s the slopes. What follows mostly from a number that these logs do not tell from
others is not known at all: ± ∞. The inertia of a motor that turns with the last two of parallel joints, say, is a part of theirs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from pipelines.fit.differences import difference
from pipelines.log.experiment import Array
from pipelines.model.arm import Acting
from pipelines.model.diagnosis.fitted.exact import number_moved
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.result import Value
from pipelines.model.effects.base import Effect, Values

__all__ = ["acting", "parameters", "standard_deviations", "told"]

Mask = npt.NDArray[np.bool_]

_STEP = 1e-4  # of an amplitude or of its deviation, whichever is larger: an angle between two small ones turns fast


def told(acting: Acting) -> dict[str, Value]:
    """What is reported of an effect, named as in causes.md; numbers that go together are one, with a deviation for each."""
    found = {}
    for name, value in acting.effect.reported(acting.values).items():
        own = [p for p in acting.parameters if p.name == name] or [p for p in acting.parameters if p.name.startswith(f"{name}_")]
        std: float | tuple[float, ...] | None = own[0].std
        if isinstance(value, tuple):
            known = [p.std for p in own]
            std = None if all(x is None for x in known) else tuple(np.inf if x is None else x for x in known)
        found[name] = Value(value, std, own[0].unit)
    return found


def parameters(done: Refined, place: int) -> dict[str, Value]:
    """What is reported of effect number `place`."""
    return told(_with(done, place, _of_effect(done, place, done.covariance())))


def standard_deviations(done: Refined, place: int, covariance: Array) -> dict[str, float]:
    """Of every parameter of effect number `place` that is fitted, and that these logs tell."""
    return _finite(_of_effect(done, place, covariance))


def acting(done: Refined, place: int, covariance: Array) -> Acting:
    """Effect number `place` with its numbers and their standard deviations, for a model."""
    return _with(done, place, standard_deviations(done, place, covariance))


def _with(done: Refined, place: int, std: dict[str, float]) -> Acting:
    one = done.model.effects[place]
    return Acting.of(one.effect, one.values, std, revolute=_turning(one.effect, done.model.columns.body.robot.revolute))


def _turning(effect: Effect, revolute: Sequence[bool]) -> bool:
    return effect.joint is None or revolute[effect.joint - 1]


def _of_effect(done: Refined, place: int, covariance: Array) -> dict[str, float]:
    one = done.model.effects[place]
    index = done.of_effect(place)
    names = [done.names[k - len(done.model.beta)][2] for k in index]
    own, unseen = covariance[np.ix_(index, index)], np.isin(index, done.unseen)
    std = np.sqrt(np.maximum(np.diag(own), 0.0)).tolist()
    steps = [_step(one.amplitudes[int(name)], known) if name.isdigit() else _STEP for name, known in zip(names, std, strict=True)]
    moved = [number_moved(one, name, step).values for name, step in zip(names, steps, strict=True)]
    return _deviations(one.effect, one.values, moved, steps, own, unseen)


def _deviations(effect: Effect, here: Values, moved: Sequence[Values], steps: Sequence[float], covariance: Array, unseen: Mask,
                ) -> dict[str, float]:
    """Of every parameter that follows from numbers that were fitted: `moved` are the values with one after the other of them moved
    by its step."""
    found = {}
    for q in effect.parameters:
        slope = np.array([difference(here[q.name], there[q.name], q.period) for there in moved]) / np.array(steps)
        if slope.any() and np.isfinite(slope).all():
            found[q.name] = np.inf if _untold(slope, unseen) else float(np.sqrt(max(slope @ covariance @ slope, 0.0)))
    return found


def _finite(std: dict[str, float]) -> dict[str, float]:
    return {name: x for name, x in std.items() if np.isfinite(x)}


def _untold(slope: Array, unseen: Mask) -> bool:
    """Return whether a number that is `unseen` moves it more than all that are seen."""
    size = np.abs(slope)
    return bool(np.where(unseen, size, 0.0).max() > np.where(unseen, 0.0, size).max())


def _step(amplitude: float, std: float) -> float:
    return _STEP * (max(abs(amplitude), std) or 1.0)
