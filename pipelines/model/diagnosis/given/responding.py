"""Frequency responses go first: what they name is subtracted, and all else is looked for beside it.

    first = responding(prepared, logs, settings)
    first.held             the case and the rows less what gives way, and what that is worth
    first.undecided        what responses name, and beside which nothing can be fitted
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.model.arm import Acting, Arm
from pipelines.model.diagnosis.asked.inputs import Prepared, narrowed
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.given.compliance import Compliance, compliance
from pipelines.model.diagnosis.result import Answer, NotTestable
from pipelines.model.diagnosis.searched.beside import Held, beside, torque_of, unsolved
from pipelines.model.diagnosis.searched.case import Case

__all__ = ["BELOW", "Responding", "responding"]

# Of the frequency at which the link, or the arm's base, swings while the encoder stands: there a torque out of motion is the noise
# of the encoder, times a hundred.
BELOW = 0.7
# Of the speed at which friction has turned over: the drive's noise lets a motor on a spring rattle by less than the encoder counts,
# and where it hardly moves that smears its friction.
_RATTLES = 3.0


@dataclass(frozen=True, eq=False)
class Responding:
    """What frequency responses say, put to use."""

    stiff: Compliance | None  # None without frf logs
    held: Held
    undecided: tuple[NotTestable, ...] = ()

    def answers(self, acting: Acting) -> tuple[Answer, ...]:
        """The responses that name a cause."""
        return () if self.stiff is None else self.stiff.answers(acting)

    def nameable(self, case: Case) -> Case:
        """`case`, where frequency responses show no spring: what gives way may be a gap then, which the residual names."""
        return replace(case, nameable=(*case.nameable, "reversals")) if self.stiff is not None and not self.stiff.named else case


def responding(case: Case, prepared: Prepared, without: Sequence[str] = (), only: Sequence[str] | None = None) -> Responding:
    """What gives way is taken out of all rows.

    Args:
        without: names of causes that it is not.
        only: places of causes that are wanted; None: all.
    """
    logs, arm = prepared.logs, case.model.nominal
    stiff = compliance(logs.frf, arm, without)
    if stiff is not None and only is not None:
        stiff = replace(stiff, named=tuple(one for one in stiff.named if one.place in only))
    if stiff is None or not stiff.named:
        return Responding(stiff, Held(case, prepared))
    stiff, failed = _solvable(stiff, prepared, arm)
    if not stiff.named:
        return Responding(stiff, Held(case, prepared), failed)
    case, prepared = _told_apart(case, prepared, stiff.named)
    held = beside(case, prepared, stiff.named)
    return Responding(stiff, held, (*failed, *map(_failed, held.failed)))


def _solvable(stiff: Compliance, prepared: Prepared, arm: Arm) -> tuple[Compliance, tuple[NotTestable, ...]]:
    """Without those named by the responses whose numbers make no torque; these with their numbers."""
    kept, failed = [], []
    for acting in stiff.named:
        try:
            torque_of((acting,), arm, prepared.data)
        except np.linalg.LinAlgError as error:
            failed.append(_failed((acting, unsolved(acting, error))))
        else:
            kept.append(acting)
    return replace(stiff, named=tuple(kept)), tuple(failed)


def _failed(one: tuple[Acting, str]) -> NotTestable:
    acting, why = one
    return NotTestable(acting.effect.name, acting.effect.joint, why, acting.effect.experiment)


def _told_apart(case: Case, prepared: Prepared, named: Sequence[Acting]) -> tuple[Case, Prepared]:
    """Rows in which what gives way can be told from the noise of encoder and drive."""
    arm, speeds = case.model.nominal, [0.0] * case.data.n_joints
    for joint in {one.effect.joint for one in named} - {None}:
        assert joint is not None
        sharp = [w for curve in arm.friction_curves(joint) or () for w in curve.sharpnesses]
        speeds[joint - 1] = _RATTLES / max(sharp) if sharp else 0.0
    prepared = narrowed(prepared, BELOW * min(one.values["frequency"] for one in named), speeds)
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    return replace(case, data=prepared.data, judge=prepared.judge, model=Exact.start(columns, fit), weight=fit.weight), prepared
