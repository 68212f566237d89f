"""What is reported of a finding and how sure it is: what these logs do not tell has no finite deviation."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.exact import Exact
from pipelines.model.diagnosis.inputs import Logs, prepare
from pipelines.model.diagnosis.nominal import fit_nominal
from pipelines.model.diagnosis.numbers import of_no_size, parameters, standard_deviations, too_slight
from pipelines.model.diagnosis.refit import Refined, refine
from pipelines.model.diagnosis.settings import DiagnosisSettings
from pipelines.model.effects.transmission_coupling import TransmissionCoupling
from pipelines.model.rigid.body import Motion
from tests.model.diagnosis.arms import hidden

INERTIA, VISCOUS, COULOMB, SHARPNESS = 0.004, 0.03, 0.2, 90.0


def _shared(one: int, other: int, motion: Motion) -> Array:
    """A motor that turns with two joints."""
    out = np.zeros_like(motion.q)
    speed = motion.dq[:, one] + motion.dq[:, other]
    load = INERTIA * (motion.ddq[:, one] + motion.ddq[:, other]) + VISCOUS * speed + COULOMB * np.tanh(SHARPNESS * speed)
    out[:, one] = out[:, other] = load
    return out


def _fitted(joint: int) -> Refined:
    prepared = prepare(Logs((hidden(1, lambda motion: _shared(joint - 2, joint - 1, motion)),)), DiagnosisSettings())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    start = TransmissionCoupling(joint=joint, sharpness=SHARPNESS)
    model = Exact.start(columns, fit).with_effect(start, np.array([0.0, 0.0, 0.1]), held=("sharpness",))
    return refine(model, prepared.data, fit.weight)


@pytest.mark.parametrize(("joint", "told"), [(3, False), (2, True)])
def test_an_inertia_that_is_a_part_of_the_links_is_not_known(joint: int, told: bool) -> None:
    """Joints 2 and 3 are parallel: what turns with both has the columns of link 3's own inertia. Joint 1 stands across."""
    done = _fitted(joint)
    found = parameters(done, 0)
    assert np.isfinite(found["inertia"].std) is np.bool_(told)
    assert ("inertia" in standard_deviations(done, 0, done.covariance())) is told
    for name, true in (("viscous", VISCOUS), ("coulomb", COULOMB), *((("inertia", INERTIA),) if told else ())):
        assert found[name].value == pytest.approx(true, abs=max(4.0 * found[name].std, 0.02 * true))
        assert 0.0 < found[name].std < 0.2 * true


@pytest.mark.parametrize(("size", "small"), [(4.9e-5, [0]), (5.1e-5, []), (-4.9e-5, [0]), (-5.1e-5, [])])
def test_one_number_within_five_deviations_of_none_is_no_cause(size: float, small: list[int]) -> None:
    """A delay of some microseconds, as sampling leaves it in an arm in order; a spring has more numbers, each of them poor."""
    delay = SimpleNamespace(free_amplitudes=True, amplitudes=(size,))
    spring = SimpleNamespace(free_amplitudes=True, amplitudes=(1e-5, 1e-5))
    done: Any = SimpleNamespace(covariance=lambda: 1e-10 * np.eye(3), model=SimpleNamespace(effects=(delay, spring)),
                                of_effect=lambda place: [0] if place == 0 else [1, 2])
    assert of_no_size(done) == small


@pytest.mark.parametrize(("size", "least", "few"), [
    (0.0019, 0.002, []), (-0.0017, 0.002, [0]), (0.0017, 0.002, [0]), (0.0017, 0.0, [])])
def test_what_surely_is_less_than_arms_in_order_have_is_slight(size: float, least: float, few: list[int]) -> None:
    """A deviation of 1e-4: of 0.0019 nobody knows whether it is less than 0.002."""
    gain = SimpleNamespace(free_amplitudes=True, amplitudes=(size,), effect=SimpleNamespace(slight=least))
    spring = SimpleNamespace(free_amplitudes=True, amplitudes=(1e-5, 1e-5), effect=SimpleNamespace(slight=1.0))
    done: Any = SimpleNamespace(covariance=lambda: 1e-8 * np.eye(3), model=SimpleNamespace(effects=(gain, spring)),
                                of_effect=lambda place: [0] if place == 0 else [1, 2])
    assert too_slight(done) == few
    done.covariance = lambda: np.zeros((3, 3))  # of what logs do not show nobody knows whether it is less
    assert too_slight(done) == []
