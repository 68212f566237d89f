"""Frequency responses go first: what they name is subtracted, and all else is looked for beside it.

    first = responding(prepared, logs, settings)
    first.held             the case and the rows less what gives way, and what that is worth
    first.standing         what gave way before as well
    first.undecided        what gives way now, of which nobody knows whether it did before
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.model.arm import Acting, Arm
from pipelines.model.diagnosis.asked.inputs import Prepared, narrowed
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.linear import deviations
from pipelines.model.diagnosis.fitted.nominal import Fit, fit_columns, fit_nominal
from pipelines.model.diagnosis.given.compliance import Compliance, compared, compliance
from pipelines.model.diagnosis.result import Answer, NotTestable, Standing
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.searched.beside import Held, beside, less, torque_of, unsolved
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.worth.numbers import told

__all__ = ["BELOW", "Responding", "responding"]

# Of the frequency at which the link, or the arm's base, swings while the encoder stands: there a torque out of motion is the noise
# of the encoder, times a hundred.
BELOW = 0.7
# Of the speed at which friction has turned over: the drive's noise lets a motor on a spring rattle by less than the encoder counts,
# and where it hardly moves that smears its friction.
_RATTLES = 3.0
_SURE = 3.0  # standard deviations
_THERE, _NOT_THERE = 0.4, 0.6  # of its strength now, that the reference shows at least; at most
_OPEN = "it gives way now; whether it did before, the reference logs do not tell"


@dataclass(frozen=True, eq=False)
class Responding:
    """What frequency responses say, put to use."""

    stiff: Compliance | None  # None without frf logs
    held: Held
    standing: tuple[Standing, ...] = ()
    undecided: tuple[NotTestable, ...] = ()

    def answers(self, acting: Acting) -> tuple[Answer, ...]:
        """The responses that name a cause."""
        return () if self.stiff is None else self.stiff.answers(acting)

    def nameable(self, case: Case) -> Case:
        """`case`, where frequency responses show no spring: what gives way may be a gap then, which the residual names."""
        return replace(case, nameable=(*case.nameable, "reversals")) if self.stiff is not None and not self.stiff.named else case


def responding(case: Case, prepared: Prepared, without: Sequence[str] = (), only: Sequence[str] | None = None) -> Responding:
    """What gives way is taken out of all rows: out of those of the reference where it did before as well.

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
        return Responding(stiff, Held(case, prepared), (), failed)
    case, prepared = _told_apart(case, prepared, stiff.named)
    if prepared.reference is None:
        held = beside(case, prepared, stiff.named)
        return Responding(stiff, held, (), (*failed, *map(_failed, held.failed)))
    new, old, open_ = _apart(stiff, compliance(logs.frf_before, arm, without), prepared.reference, arm, prepared)
    stands = []
    for acting in (*old, *open_):
        case, prepared, share = _taken_out(case, prepared, acting, arm, both=acting in old)
        if acting in old:
            stands.append(Standing(acting.effect.name, acting.effect.joint, told(acting), share))
    left = tuple(NotTestable(one.effect.name, one.effect.joint, _OPEN, f"{one.effect.experiment} Before and after.")
                 for one in open_)
    held = beside(case, prepared, new)
    return Responding(stiff, held, tuple(stands), (*left, *failed, *map(_failed, held.failed)))


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


def _apart(stiff: Compliance, before: Compliance | None, reference: Data, arm: Arm,
           prepared: Prepared) -> tuple[tuple[Acting, ...], tuple[Acting, ...], tuple[Acting, ...]]:
    """What is new, what stands, what nobody knows: by the reference's own responses, else by how it moved."""
    new: list[Acting] = []
    old: list[Acting] = []
    open_: list[Acting] = []
    asked = stiff.named
    if before is not None:
        both = compared(stiff, before)
        # What the reference's responses leave open, or are of no use for, is no news for being missing there.
        asked = tuple(one for one in both.new if before.open and one.place not in {other.place for other in before.named})
        new, old = [one for one in both.new if one not in asked], list(both.standing)
    if not asked:
        return tuple(new), tuple(old), ()
    _, fit = fit_nominal(reference, prepared.columns)
    for acting in asked:
        share, std = _strength(acting, reference, fit, arm)
        where = old if share - _SURE * std > _THERE else new if share + _SURE * std < _NOT_THERE else open_
        where.append(acting)
    return tuple(new), tuple(old), tuple(open_)


def _strength(acting: Acting, reference: Data, fit: Fit, arm: Arm) -> tuple[float, float]:
    """The share of the effect's torque that the reference logs ask for, and its standard deviation."""
    column = torque_of((acting,), arm, reference)[None]
    done = fit_columns(reference, np.concatenate([fit.table, column]), weight=fit.weight)
    return float(done.beta[-1]), float(deviations(done.table * done.weights, done.residual)[-1])


def _taken_out(case: Case, prepared: Prepared, acting: Acting, arm: Arm, both: bool) -> tuple[Case, Prepared, float]:
    """Out of the later logs, and out of the reference where it stood then; the share of the reference's residual that it was."""
    torque = torque_of((acting,), arm, prepared.data)
    data = less(prepared.data, torque)
    judge = None if prepared.judge is None else less(prepared.judge, torque_of((acting,), arm, prepared.judge))
    reference, share = prepared.reference, 0.0
    if both and reference is not None:
        lower = less(reference, torque_of((acting,), arm, reference))
        joint = (acting.effect.joint or 1) - 1
        was, now = (fit_nominal(rows, prepared.columns)[1].rms[joint] for rows in (reference, lower))
        reference, share = lower, float(max(0.0, 1.0 - (now / max(was, 1e-300)) ** 2))
    prepared = replace(prepared, data=data, judge=judge, reference=reference)
    columns, fit = fit_nominal(data, prepared.columns)
    case = replace(case, data=data, judge=judge, model=Exact.start(columns, fit), weight=fit.weight, beside=(*case.beside, acting))
    return case, prepared, share
