"""Decide whether logs can show that nothing is wrong with an arm.

    why = cannot_judge(facts)      in words, with what to record; empty where they can

"Nothing is wrong" says that a model leaves no more torque than that of a healthy arm would. That
takes a noise floor, from reference logs, or a model that leaves next to nothing on held-out motion
but what differs between repeated periods; and a model that the logs determine. One that they do
not determine predicts held-out torque with a large standard deviation:

    std τ̂_j(t) = sqrt(a_j(t)ᵀ C a_j(t)),  a_j the regressor of joint j, C the covariance of β

(Draper & Smith 1998, ch. 3.1; C allows for autocorrelation, `pipelines.fit.covariance`). Misfit
and standard deviation are both a share of the joint's torque, so that one number decides.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from pipelines.fit import identifiability
from pipelines.fit.equations import Array, Block, Flags
from pipelines.model.estimation.estimate import Estimate
from pipelines.model.estimation.words import columns_in_words
from pipelines.model.excited import REMEDY

__all__ = ["Facts", "JudgeableConfig", "cannot_judge", "one_way", "predicted_std", "unresolved"]

_RECORD = "record reference logs while the arm is known to be healthy, or a motion that repeats itself"


@dataclass(frozen=True)
class JudgeableConfig:
    """The number that decides; `python -m benchmarks.judgeable` shows half and twice of it."""

    # Share of a joint's torque (rms, held-out motion). Published identifications of industrial
    # arms leave 1.4 % (Gaz et al. 2019, Panda) to 5 % (figaroh, TX40): a larger residual
    # needs a noise floor to be judged by.
    largest_share: float = 0.05


@dataclass(frozen=True, eq=False)
class Facts:
    """Errors of a model on held-out motion, and the state of its noise floor.

    Arrays (joints,) are root mean squares [N m], of prismatic joints [N].
    """

    left: Array  # residual of the nominal model
    torque: Array  # measured
    std: Array  # of the predicted torque, by the covariance of the parameters
    unresolved: str  # parameters that the logs do not separate, in words; empty: none
    floor_known: Flags  # (joints,) whether the residual can be held against a noise floor


def unresolved(found: Estimate) -> str:
    """Return which parameters the fitted logs do not separate, in words; empty where they do."""
    return found.unresolved.told(columns_in_words(one.name for one in found.columns.names))


def one_way(found: Estimate) -> str:
    """Return which friction is linearly dependent on an offset, for its joint moves one way; empty where none is.

    The constant gravity of a vertical slide is an offset too, and no reason to doubt a model.
    """
    names = [one.name for one in found.columns.names]
    lost = identifiability.unresolved(found.solution, names, 0.0)
    friction = tuple(group for group in lost.confused if all(":" in name for name in group))  # no base parameters
    return replace(lost, never_moved=(), confused=friction).told(columns_in_words(names))


def predicted_std(found: Estimate, equations: Iterable[Block]) -> Array:
    """Return the standard deviation of the predicted torque, its rms over `equations`.

    Parameters that the fitted logs do not determine at all have no covariance: they count as known
    here, and are listed as unresolved.

    Returns:
        (joints,) [N m]
    """
    covariance = found.robust.covariance
    covariance = np.where(np.isfinite(covariance), covariance, 0.0)
    variance = np.zeros(found.columns.body.robot.n_joints)
    count = np.zeros(len(variance))
    for block in equations:
        for j, (index, values) in enumerate(zip(block.columns, block.values, strict=True)):
            variance[j] += np.sum(values * (covariance[np.ix_(index, index)] @ values))
        count += block.counts
    return np.asarray(np.sqrt(np.maximum(variance, 0.0) / np.maximum(count, 1.0)))


def cannot_judge(facts: Facts, config: JudgeableConfig | None = None) -> str:
    """Return why nothing can be said of the arm, and what to record; empty where it can be."""
    limit = (config or JudgeableConfig()).largest_share
    why = []
    misfit = _large(np.where(facts.floor_known, 0.0, facts.left), facts.torque, limit)
    if misfit:
        why.append("no noise floor is known, and on held-out motion the model leaves "
                   f"{misfit}, as a fault may and a healthy arm may; {_RECORD}")
    unsure = _large(facts.std, facts.torque, limit)
    if facts.unresolved or unsure:
        spread = f"its prediction of held-out torque has a standard deviation of {unsure}"
        said = "; ".join([*filter(None, (facts.unresolved,)), *((spread,) if unsure else ())])
        why.append(f"the logs do not determine the model: {said}; {REMEDY}")
    return "; and ".join(why)


def _large(part: Array, torque: Array, limit: float) -> str:
    """Return "25 % of the torque of joint 1, 12 % of joint 3": shares above the limit."""
    share = part / np.maximum(torque, 1e-300)
    joints = np.flatnonzero(share > limit).tolist()
    words = [f"{100.0 * share[j]:.2g} % of joint {j + 1}" for j in joints]
    return ", ".join(words).replace(" of joint", " of the torque of joint", 1)
