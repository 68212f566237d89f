"""A model extended by causes, with the standard deviations of all its numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Acting, Arm
from pipelines.model.diagnosis.asked.unasked import FewerTerms
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.result import Finding, Gain, JudgedBy, Rejected, ResidualRms
from pipelines.model.effects.kinds import FrictionLaw
from pipelines.model.estimation.logs import Motions
from pipelines.model.parameter import Parameter

__all__ = ["Extended", "with_uncertainty"]


@dataclass(frozen=True, eq=False)
class Extended:
    """A model extended."""

    arm: Arm | None  # with everything refitted; None where no cause was accepted
    findings: tuple[Finding, ...]  # accepted
    rejected: tuple[Rejected, ...]
    gain: Gain | None  # of all accepted together
    before: ResidualRms
    after: ResidualRms
    held_out: JudgedBy
    standing: tuple[Acting, ...]  # what the reference logs show as well
    motions: Motions  # fitted, then judging
    fitted: int  # of them
    fewer: tuple[FewerTerms, ...] = ()  # laws of friction that gave way to plainer ones


def with_uncertainty(arm: Arm, done: Refined) -> Arm:
    """The arm with the standard deviations of its base parameters and friction laws."""
    std = np.sqrt(np.maximum(np.diagonal(done.covariance()), 0.0))
    columns = done.model.columns
    place = {i: k for k, i in enumerate(columns.kept)}
    base = tuple(replace(p, std=float(std[place[i]])) if i in place else p for i, p in enumerate(arm.base))
    return replace(arm, base=base, friction=_friction(arm, done, std))


def _friction(arm: Arm, done: Refined, std: Array) -> tuple[Acting, ...]:
    """Amplitudes have the deviation of their column; a shape moves by its logarithm."""
    columns = done.model.columns
    first, count = len(columns.kept), len(done.model.beta)
    shapes = {(place, name): float(std[count + k]) for k, (kind, place, name) in enumerate(done.names)
              if kind == 0 and std[count + k] > 0.0}
    found, kept = [], iter(arm.friction)
    for place, law in enumerate(columns.laws):
        linear = [q.name for q in law.parameters if not q.shape]
        own = {name: float(std[first + k]) for k, name in enumerate(linear)}
        first += len(linear)
        if not isinstance(law, FrictionLaw):
            continue
        acting = next(kept)

        def deviation(p: Parameter, own: Mapping[str, float] = own, place: int = place) -> float | None:
            return own[p.name] if p.name in own else shapes[place, p.name] * abs(p.value) if (place, p.name) in shapes else p.std

        found.append(replace(acting, parameters=tuple(replace(p, std=deviation(p)) for p in acting.parameters)))
    return tuple(found)
