"""Causes that the base parameters take in within one session: told by how these parameters moved since the reference logs.

    found = absorbed(case...)        a load at the tip, say, with its numbers

The same base parameters before and after, and the cause's columns after: what that explains of the difference between one set of
parameters for all and one for each. A cause takes ten numbers at most, the parameters of the RRR arm are fifteen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.candidates import lay_one
from pipelines.model.diagnosis.data import Data
from pipelines.model.diagnosis.linear import deviations
from pipelines.model.diagnosis.nominal import fit_columns
from pipelines.model.diagnosis.result import Value
from pipelines.model.diagnosis.standing import Mask, apart
from pipelines.model.effects import all_effects
from pipelines.model.effects.base import Effect

__all__ = ["Absorbed", "absorbed"]

_EXPLAINS = 0.7  # of what one set of parameters for all leaves too much
_WORTH = 0.05  # of the squared residual, that separate parameters take away at least
_SURE = 5.0  # standard deviations of its first number


@dataclass(frozen=True, eq=False)
class Absorbed:
    """A cause that the base parameters show."""

    effect: Effect
    values: dict[str, float]
    parameters: dict[str, Value]
    std: dict[str, float]  # of the values that were fitted
    explained: float  # of the difference between one set of base parameters and two


def absorbed(data: Data, later: Mask, rigid: Array, others: Array, common: Array, weight: Array, arm: Arm,
             without: Sequence[str] = ()) -> Absorbed | None:
    """The cause that explains best how the base parameters moved; None where they did not, or none does.

    Args:
        rigid: (k, rows) columns of the rigid body.
        others: (m, rows) of friction, with coefficients of their own before and after.
        common: (n, rows) of the standing set.
    """
    beside = np.concatenate([apart(others, later), common])
    one = fit_columns(data, np.concatenate([rigid, beside]), weight=weight)
    two = fit_columns(data, np.concatenate([apart(rigid, later), beside]), weight=weight)
    powers = [float(fit.residual @ fit.residual) for fit in (one, two)]
    if powers[0] - powers[1] < _WORTH * powers[1]:
        return None
    best: Absorbed | None = None
    for kind in all_effects():
        if kind.evidence != "base parameters" or kind.name in without:
            continue
        for place in kind.everywhere(arm.n_joints):
            found = _tried(place.full(), data, later, np.concatenate([rigid, beside]), weight, arm, powers)
            if found is not None and (best is None or found.explained > best.explained):
                best = found
    return best


def _tried(effect: Effect, data: Data, later: Mask, beside: Array, weight: Array, arm: Arm,
           powers: list[float]) -> Absorbed | None:
    columns = np.where(later, lay_one(data, effect, arm), 0.0)
    fit = fit_columns(data, np.concatenate([beside, columns]), weight=weight)
    share = (powers[0] - float(fit.residual @ fit.residual)) / (powers[0] - powers[1])
    amplitudes = fit.beta[len(beside):]
    std = deviations(fit.table * fit.weights, fit.residual)[len(beside):]
    if share < _EXPLAINS or abs(amplitudes[0]) < _SURE * std[0]:
        return None
    values = effect.values(amplitudes)
    if not effect.possible(values):
        return None
    names = [q.name for q in effect.parameters if not q.shape]
    return Absorbed(effect, values, _reported(effect, amplitudes, std), dict(zip(names, std.tolist(), strict=False)), share)


def _reported(effect: Effect, amplitudes: Array, std: Array) -> dict[str, Value]:
    here, above = effect.reported(effect.values(amplitudes)), effect.reported(effect.values(amplitudes + std))
    units = {q.name: q.unit for q in effect.parameters}
    found: dict[str, Value] = {}
    for name, value in here.items():
        unit = next((unit for own, unit in units.items() if own == name or own.startswith(f"{name}_")), "1")
        off = np.abs(np.atleast_1d(above[name]) - np.atleast_1d(value))
        found[name] = Value(value, tuple(off.tolist()) if isinstance(value, tuple) else float(off[0]), unit)
    return found
