"""Draw a model as it could have come out of another fit: its numbers within their uncertainty.

    other = drawn(arm, rng)

By the covariance of the fit; of a model file by the deviations of base parameters, as if
independent, friction held.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.body import Array
from pipelines.dynamics.parameter import Parameter

__all__ = ["drawn"]


def drawn(arm: Arm, rng: np.random.Generator) -> Arm:
    """`arm` with its fitted numbers drawn anew; what has no uncertainty stays."""
    names, covariance = _covariance(arm)
    off = dict(zip(names, _normal(covariance, rng), strict=True))

    def acting(law: Acting) -> Acting:
        values = tuple(
            replace(p, value=p.value + off.get(f"{law.place}:{p.name}", 0.0))
            for p in law.parameters)
        return Acting(law.effect.at({p.name: p.value for p in values}), values)

    base = tuple(replace(p, value=p.value + off.get(p.name, 0.0)) for p in arm.base)
    return replace(arm, base=base, friction=tuple(map(acting, arm.friction)),
                   effects=tuple(map(acting, arm.effects)))


def _covariance(arm: Arm) -> tuple[tuple[str, ...], Array]:
    """Names and covariance of all that is not certain."""
    if (known := arm.uncertainty) is not None:
        finite = np.isfinite(np.diag(known.covariance))
        return (tuple(name for name, sure in zip(known.names, finite, strict=True) if sure),
                known.covariance[np.ix_(finite, finite)])
    uncertain: list[Parameter] = [p for p in arm.base if p.std is not None and np.isfinite(p.std)]
    return tuple(p.name for p in uncertain), np.diag([float(p.std or 0.0)**2 for p in uncertain])


def _normal(covariance: Array, rng: np.random.Generator) -> list[float]:
    """One draw of N(0, covariance): C = V Λ Vᵀ, x = V √Λ z, rounding below zero left out."""
    if not covariance.size:
        return []
    scale = np.sqrt(np.diag(covariance))
    unit = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(unit, unit))
    draw: list[float] = (
        unit *
        (vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(len(unit))))).tolist()
    return draw
