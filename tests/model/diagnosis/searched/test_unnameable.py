"""What cannot be named by the residual is held to held-out time as well."""

from __future__ import annotations

import pytest

from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.fitted.refit import refine
from pipelines.model.diagnosis.screened.candidates import families, whole_motion
from pipelines.model.diagnosis.screened.screen import screen
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.unnameable import unnameable
from tests.model.diagnosis.arms import hidden, wave


@pytest.mark.slow
@pytest.mark.parametrize(("there", "nameable", "told"), [(True, (), True), (False, (), False), (True, ("residual",), False)])
def test_what_the_held_out_logs_do_not_have_gives_no_way(there: bool, nameable: tuple[str, ...], told: bool) -> None:
    """Ripple stands for something that gives way: with no name for it, it counts where the held-out logs have it too."""
    logs = Logs((hidden(1, wave), hidden(2, wave)), (hidden(3, wave if there else None, "validate"),))
    prepared = prepare(logs, DiagnosisSettings())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit)
    every = tuple(one for one in families(columns.laws, whole_motion(prepared.data), model.arm) if one.cause == "cogging")
    case = Case(prepared.data, prepared.judge, model, fit.weight, every, None, nameable=nameable)
    now = refine(model, case.data, case.weight)
    passing = [one for one in screen(case.data, now.fit, every, model.arm) if one.joint == 2]
    assert (unnameable(passing, None, (), now, case) is not None) is told
