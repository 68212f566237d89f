"""Whether links that could exist have the estimated parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.base_parameters import BaseArm
from pipelines.dynamics.body import RigidBody
from pipelines.dynamics.consistency import rrr_inequalities
from pipelines.dynamics.rrr import RRR, combined
from pipelines.fit.consistency import physical_consistency
from pipelines.model.estimation.estimate import Estimate

__all__ = ["Consistent", "Inequal", "consistency"]


@dataclass(frozen=True)
class Inequal:
    """A condition that positive mass puts on the parameters."""

    condition: str
    value: float
    std: float
    holds: bool  # or cannot be said to be broken


@dataclass(frozen=True)
class Consistent:
    """Whether links that could exist have the estimated parameters."""

    consistent: bool
    distance: float  # [standard deviations] to the nearest parameters that could
    violating: tuple[str, ...]  # links without whose condition they would
    inequalities: tuple[Inequal, ...]  # of the RRR arm


def consistency(found: Estimate, body: RigidBody) -> Consistent | None:
    """Pseudo-inertias that are positive definite (Wensing et al. 2018), and for the RRR arm what (A4) demands.

    None where a parameter is not determined: nothing can be said of links then.
    """
    if not found.trusted[list(found.columns.rigid)].all():
        return None
    count, kept = len(body.parameters), list(found.columns.kept)
    beta, covariance = np.zeros(count), np.zeros((count, count))
    beta[kept] = found.beta[:len(kept)]
    covariance[np.ix_(kept, kept)] = found.robust.covariance[:len(kept), :len(kept)]
    combine = combined(body.robot) if isinstance(body, RRR) else body.base.combine if isinstance(body, BaseArm) else None
    if combine is None:
        raise TypeError(f"no links are known behind a {type(body).__name__}")
    rest = np.array(kept)
    answer = physical_consistency(beta[rest], covariance[np.ix_(rest, rest)], combine[rest])
    names = tuple(body.robot.joints[i].name for i in answer.violating)
    rules = rrr_inequalities(beta, covariance) if isinstance(body, RRR) else ()
    return Consistent(answer.consistent, answer.distance, names,
                      tuple(Inequal(rule.name, rule.value, rule.std, rule.satisfied) for rule in rules))
