"""The numbers of a finding as it reports them, with their standard deviations.

    parameters(done, place)         {"order": Value(18.0, 0.01, "1/rev"), …} of effect number `place`

Covariance is that of all numbers of the model together, by the sandwich of `Refined.covariance`; what is reported follows from
them to first order. What follows mostly from a number that these logs do not tell from others is not known at all: ± ∞. The inertia
of a motor that turns with the last two of parallel joints, say, is a part of theirs.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipelines.log.experiment import Array
from pipelines.model.arm import Acting
from pipelines.model.diagnosis.exact import Named, number_moved
from pipelines.model.diagnosis.refit import Refined
from pipelines.model.diagnosis.result import Value

__all__ = ["acting", "of_no_size", "parameters", "standard_deviations", "too_slight"]

_STEP = 1e-4
# Deviations from zero: of 410 named causes of the test bench the least true one of one number was 6.9, a false gain 4.9; delays of
# two arms in order 2.3 and 3.5.
_STDS = 5.0
_SURE = 2.0  # deviations by which it is less


def parameters(done: Refined, place: int, covariance: Array | None = None) -> dict[str, Value]:
    """What is reported of effect number `place`, named as in causes.md."""
    one = done.model.effects[place]
    whole = done.covariance() if covariance is None else covariance
    index = done.of_effect(place)
    names = [done.names[k - len(done.model.beta)][2] for k in index]
    own, unseen = whole[np.ix_(index, index)], np.isin(index, done.unseen)
    here = _reported(one)
    slopes: dict[str, Array] = {name: np.zeros((len(value), len(names))) for name, value in here.items()}
    for k, name in enumerate(names):
        step = _step(one, name)
        there = _reported(number_moved(one, name, step))
        for key in here:
            slopes[key][:, k] = _difference(there[key], here[key]) / step
    found = {}
    for key, value in here.items():
        std = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", slopes[key], own, slopes[key]), 0.0))
        std = np.where(_untold(slopes[key], unseen), np.inf, std)
        plain = one.effect.reported(one.values)[key]
        unit = _unit(one, key, done.model.columns.body.robot.revolute)
        fixed = not slopes[key].any()
        if isinstance(plain, tuple):
            found[key] = Value(tuple(value.tolist()), None if fixed else tuple(std.tolist()), unit)
        else:
            found[key] = Value(plain, None if fixed else float(std[0]), unit)
    return found


def of_no_size(done: Refined) -> list[int]:
    """Places of effects of one number alone that is not told from zero, in the model with all of them."""
    return [place for place, size, std in _sizes(done) if std > 0.0 and size < _STDS * std]


def too_slight(done: Refined) -> list[int]:
    """Places of effects of which there surely is less than machines in order have, in the model with all of them."""
    return [place for place, size, std in _sizes(done)
            if std > 0.0 and size + _SURE * std < done.model.effects[place].effect.slight]


def _sizes(done: Refined) -> list[tuple[int, float, float]]:
    """Place, amplitude and its standard deviation of the effects of one number alone."""
    whole, found = done.covariance(), []
    for place, one in enumerate(done.model.effects):
        index = done.of_effect(place)
        if len(index) == 1 and one.free_amplitudes and len(one.amplitudes) == 1:
            found.append((place, abs(float(one.amplitudes[0])), float(np.sqrt(max(whole[index[0], index[0]], 0.0)))))
    return found


def standard_deviations(done: Refined, place: int, covariance: Array) -> dict[str, float]:
    """Of every parameter of effect number `place` that is fitted, and that these logs tell."""
    one = done.model.effects[place]
    index = done.of_effect(place)
    names = [done.names[k - len(done.model.beta)][2] for k in index]
    own, unseen = covariance[np.ix_(index, index)], np.isin(index, done.unseen)
    here, found = one.values, {}
    moved = [number_moved(one, name, _step(one, name)).values for name in names]
    for key, value in here.items():
        slope = np.array([(there[key] - value) / _step(one, name) for there, name in zip(moved, names, strict=True)])
        if slope.any() and np.isfinite(slope).all() and not _untold(slope, unseen):
            found[key] = float(np.sqrt(max(slope @ own @ slope, 0.0)))
    return found


def acting(done: Refined, place: int, covariance: Array) -> Acting:
    """Effect number `place` with its numbers and their standard deviations, for a model."""
    one = done.model.effects[place]
    joint = one.effect.joint
    turning = joint is None or done.model.columns.body.robot.revolute[joint - 1]
    return Acting.of(one.effect, one.values, standard_deviations(done, place, covariance), revolute=turning)


def _untold(slopes: Array, unseen: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """(…,) of `slopes` (…, numbers): whether one of those `unseen` (numbers,) moves it more than all that are seen."""
    size = np.abs(slopes)
    return np.asarray(np.where(unseen, size, 0.0).max(axis=-1) > np.where(unseen, 0.0, size).max(axis=-1))


def _reported(one: Named) -> dict[str, Array]:
    return {name: np.atleast_1d(np.asarray(value, dtype=np.float64)) for name, value in one.effect.reported(one.values).items()}


def _difference(there: Array, here: Array) -> Array:
    """An angle may come round."""
    apart = there - here
    return np.where(np.abs(apart) > np.pi, (apart + np.pi) % (2.0 * np.pi) - np.pi, apart) if np.abs(here).max() <= np.pi else apart


def _step(one: Named, name: str) -> float:
    if name.isdigit():
        return _STEP * (max(abs(a) for a in one.amplitudes) or 1.0)
    return _STEP


def _unit(one: Named, name: str, revolute: tuple[bool, ...]) -> str:
    for quantity in one.effect.parameters:
        if quantity.name == name or quantity.name.startswith(f"{name}_"):
            return quantity.unit_at(one.effect.joint is None or revolute[one.effect.joint - 1])
    return "1"

