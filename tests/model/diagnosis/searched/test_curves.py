"""A fault bends what passes for the curve by which friction changes its sign; once it is known, the curve is found again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.log.experiment import Array
from pipelines.log.files import open_log
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.fitted.refit import Refined, refine
from pipelines.model.diagnosis.given.change_of_sign import loosened
from pipelines.model.diagnosis.searched.curves import with_curves_anew
from pipelines.model.effects.coulomb import Coulomb
from pipelines.model.effects.stribeck import Stribeck
from pipelines.model.effects.three_sigmoid import ThreeSigmoid
from pipelines.model.effects.torque_offset import TorqueOffset
from pipelines.model.rigid.body import Motion
from sample_logs.make_model import synthetic_arm
from tests.model.diagnosis.arms import hidden
from tests.model.estimation.experiments import COULOMB


def by_the_root(motion: Motion) -> Array:
    """Friction that changes its sign as v/sqrt(v^2 + 0.01^2), less the tanh that the logs have."""
    x = 100.0 * motion.dq
    return np.array(COULOMB) * (x / np.sqrt(1.0 + x**2) - np.tanh(x))


def led_astray(loose: bool, **away: float) -> tuple[Refined, Refined]:
    """The model fitted from where it should, and from where a fault has left the curve of joint 2; both beside an offset."""
    prepared = prepare(Logs((hidden(1, by_the_root), hidden(2, by_the_root))), DiagnosisSettings())
    prepared = loosened(prepared) if loose else prepared
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit).with_effect(TorqueOffset(2), np.zeros(1))
    laws = tuple(replace(law, **away) if isinstance(law, Coulomb) and law.joint == 2 else law for law in columns.laws)
    astray = replace(model, columns=replace(columns, laws=laws))
    good, bad = (refine(one, prepared.data, fit.weight) for one in (model, astray))
    return good, bad


@pytest.mark.slow
@pytest.mark.parametrize(("sharpness", "roundness"), [(2000.0, 3.5), (900.0, 0.4), (5.0, 3.5)])
def test_the_curve_is_found_from_where_no_step_leads_back(sharpness: float, roundness: float) -> None:
    good, bad = led_astray(True, sharpness=sharpness, roundness=roundness)
    assert bad.rms[1] > 2.0 * good.rms[1]
    again = with_curves_anew(bad)
    np.testing.assert_allclose(again.rms, good.rms, rtol=0.01)
    curve = next(law for law in again.model.columns.laws if isinstance(law, Coulomb) and law.joint == 2)
    assert curve.roundness == pytest.approx(2.0, abs=0.4)
    assert curve.sharpness == pytest.approx(100.0, rel=0.2)
    assert again.model.effects[0].effect == TorqueOffset(2)


def test_where_the_curve_is_not_fitted_nothing_is_done_again() -> None:
    _, bad = led_astray(False, sharpness=900.0)
    assert with_curves_anew(bad) is bad


def test_a_law_of_a_model_that_was_given_keeps_its_form() -> None:
    """Stribeck friction whose tail is held: a number more in the nominal model would pass for what the cause explains."""
    _, bad = led_astray(False)
    laws = (*bad.model.columns.laws, Stribeck(1))
    given = replace(bad, model=replace(bad.model, columns=replace(bad.model.columns, laws=laws)))
    assert with_curves_anew(given) is given


@pytest.mark.slow
def test_of_three_sigmoids_that_have_merged_all_are_found_again_beside_a_cause(samples: Path) -> None:
    """Joint 3 of the arm of three sigmoids, whose second and third a fault has made one: by where they began the truth comes back,
    and without that knowledge nothing is done again."""
    logs = [open_log(samples / f"rrr-closed-form/{name}.h5").log for name in ("excitation-1", "free-1")]
    prepared = prepare(Logs.by_role(logs), DiagnosisSettings(), synthetic_arm())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit).with_effect(TorqueOffset(3), np.zeros(1))
    merged = tuple(ThreeSigmoid(3, 13.2, 2.77, 2.76) if law.joint == 3 else law for law in columns.laws)
    good, bad = (refine(one, prepared.data, fit.weight) for one in (model, replace(model, columns=replace(columns, laws=merged))))
    assert bad.rms[2] > 2.0 * good.rms[2]
    assert with_curves_anew(bad) is bad
    again = with_curves_anew(bad, prepared.columns.laws)
    np.testing.assert_allclose(again.rms, good.rms, rtol=0.01)
    curve = next(law for law in again.model.columns.laws if isinstance(law, ThreeSigmoid) and law.joint == 3)
    assert curve.w3 == pytest.approx(12.0, rel=0.05)
    assert curve.w1 > 1.3 * curve.w2 > 3.9 * curve.w3
    assert again.model.effects[0].effect == TorqueOffset(3)
