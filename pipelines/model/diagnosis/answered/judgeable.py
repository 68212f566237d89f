"""Limit a diagnosis to what its logs can show: the verdict "cannot-judge", and model checks.

    found = limited_by_estimate(found, prepared)
"""

from __future__ import annotations

from dataclasses import replace
from itertools import chain

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.asked.inputs import Prepared
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.result import Diagnosis
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.rows.repeated import Repeated
from pipelines.model.estimation.estimate import Estimate, estimate
from pipelines.model.estimation.judgeable import Facts, cannot_judge, predicted_std, unresolved
from pipelines.model.estimation.negative_viscous import negative_viscous
from pipelines.model.estimation.regression import Columns, LogEquations

__all__ = ["facts", "limited_by_estimate", "nominal_estimate"]

_ABOVE = 1.6  # times the noise between rows of one state, up to which a residual is explained by it


def limited_by_estimate(found: Diagnosis, prepared: Prepared) -> Diagnosis:
    """Return the diagnosis, "cannot-judge" where its logs cannot show that nothing is wrong.

    An estimate is made only for that verdict, and where viscous friction of the nominal model is
    negative: its check is added then.
    """
    nothing = found.verdict == "no-fault-found"
    if not nothing and not _negative(found.nominal):
        return found
    estimated = nominal_estimate(prepared)
    found = replace(found, checks=negative_viscous(estimated, prepared.logs.identify[0].robot_name))
    why = cannot_judge(facts(found, prepared, estimated)) if nothing else ""
    if not why:
        return found
    return replace(found, verdict="cannot-judge", reason=why,
                   summary=f"Whether anything is wrong with this arm cannot be judged: {why}.")


def nominal_estimate(prepared: Prepared) -> Estimate:
    """Return the nominal model as `estimate-bps` fits it, on the rows of a diagnosis."""
    return estimate(_equations(prepared.data, prepared.columns), prepared.columns)


def facts(found: Diagnosis, prepared: Prepared, estimated: Estimate) -> Facts:
    """Return the errors of the nominal model on held-out motion, and the state of its floor."""
    judge = prepared.data if prepared.judge is None else prepared.judge
    left = found.residual_rms.validate
    known = np.full(len(left), found.noise_floor_origin != "blocks")
    if not known.all():
        known = left <= _ABOVE * _noise(prepared)
    return Facts(left, judge.rms(judge.y), predicted_std(estimated, chain.from_iterable(_equations(judge, prepared.columns))),
                 unresolved(estimated), known)


def _noise(prepared: Prepared) -> Array:
    """Return the noise (joints,) [N m] of the residual by rows of one state; 0 without any."""
    _, fit = fit_nominal(prepared.data, prepared.columns)
    return np.sqrt(np.nan_to_num(Repeated.of(prepared.data).noise(fit.left)))


def _equations(data: Data, columns: Columns) -> list[LogEquations]:
    """Return the equations of each log in `columns`; rows may hold more terms of a friction law."""
    return [replace(log.equations, columns=columns) for log in data.logs]


def _negative(arm: Arm | None) -> bool:
    """Return whether viscous friction of any joint is negative."""
    laws = () if arm is None else arm.friction
    return any(law.effect.name == "viscous" and law.values["coefficient"] < 0.0 for law in laws)
