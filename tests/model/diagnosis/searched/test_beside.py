"""What responses have named is judged beside all that was found."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.model.arm import Acting
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.fitted.refit import moved_by, refine
from pipelines.model.diagnosis.searched import beside
from pipelines.model.diagnosis.searched.beside import judged, less, torque_of
from pipelines.model.effects.spring import Spring
from tests.model.diagnosis.arms import hidden


def test_what_was_taken_out_of_the_numbers_is_taken_out_of_those_without_the_effect() -> None:
    """Sampling has moved numbers by what it leaves of the rows. Beside a torque of no size nothing is left between the two models
    then; a fit alone would leave all of it."""
    prepared = prepare(Logs((hidden(1), hidden(2))), DiagnosisSettings())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    law = Spring(2, degree=1, highest=1)
    slight = Acting.of(law, law.values([1e-9, 0.0]))
    model, arm = Exact.start(columns, fit), Exact.start(columns, fit).nominal
    data = less(prepared.data, torque_of((slight,), arm, prepared.data))
    fitted = refine(model, data, fit.weight)
    final = moved_by(fitted, -0.02 * fitted.slopes[3])
    held: Any = SimpleNamespace(case=SimpleNamespace(beside=(slight,), blocks=10), acting=(slight,),
                                prepared=replace(prepared, data=data))
    part, = judged(held, final).parts
    moved = np.abs(final.model.beta - fitted.model.beta).max()
    assert moved > 1e-6
    assert np.abs(part.before.model.beta - final.model.beta).max() < 1e-3 * moved


@pytest.mark.parametrize(("doubt", "useless", "paying", "kept"), [
    ("", "", False, True), ("", "", True, True), ("", "no nearer", False, True), ("", "no nearer", True, False),
    ("harm", "no nearer", False, False)])
def test_who_asks_for_a_model_that_pays_has_it_without_what_is_of_no_use(
        doubt: str, useless: str, paying: bool, kept: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A diagnosis names it all the same."""
    monkeypatch.setattr(beside, "_part", lambda acting, held, final: beside.Part(acting, final, final, None, doubt, useless))
    monkeypatch.setattr(beside, "less", lambda data, torque: data)
    monkeypatch.setattr(beside, "torque_of", lambda acting, arm, data: np.zeros(1))
    monkeypatch.setattr(beside, "refine", lambda model, data, weight: "without it")
    held: Any = SimpleNamespace(case=SimpleNamespace(beside=("base",)), prepared=SimpleNamespace(judge=None), acting=("base",))
    final: Any = SimpleNamespace(model=SimpleNamespace(nominal=None), data=None, weight=None)
    found = judged(held, final, paying)
    assert found.acting == (("base",) if kept else ())
    assert (found.final is final) is kept
    assert bool(found.parts[0].doubt) is not kept
