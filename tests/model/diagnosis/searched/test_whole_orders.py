"""Waves on a closed circle are whole: a free order is pulled off its place by waves that are not found yet."""

from __future__ import annotations

import pytest

from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.screened.candidates import families, whole_motion
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.search import Found, search
from tests.diagnose.sessions import but
from tests.model.diagnosis.screened.test_through import turned

_LIBRARY = but("cogging", "spring", "torque_offset")


def searched(waves: dict[float, float], most: int, mean: float = 0.65, runs: int = 2) -> Found:
    """`mean` [rad/s] over ten seconds."""
    logs = Logs(tuple(turned(1 + k, waves, 0.0, mean) for k in range(runs)))
    prepared = prepare(logs, DiagnosisSettings(replicas=0, cutoff_hz=40.0))
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit)
    every = families(columns.laws, whole_motion(prepared.data), model.arm, _LIBRARY)
    return search(Case(prepared.data, None, model, fit.weight, every, None), most)


def orders(found: Found) -> list[float]:
    return [one.values["order"] for one in found.final.model.effects]


def test_an_order_stays_whole_while_its_neighbours_are_missing() -> None:
    """Twelve slots and 14 magnets, the greater half of them found."""
    assert orders(searched({12.0: 0.04, 13.0: 0.02, 14.0: 0.015}, 1)) == [12.0]


def test_every_wave_of_a_turn_is_found() -> None:
    """The first wave too: a joint without limits that has come round has no spring."""
    assert sorted(orders(searched({1.0: 0.01, 7.0: 0.04, 12.0: 0.02}, 3))) == [1.0, 7.0, 12.0]


@pytest.mark.parametrize("mean", [0.575, 0.597])
def test_stops_at_330_degrees_leave_every_wave_its_whole_order(mean: float) -> None:
    """Seven waves to a turn and what is four times that, and twelve of another kind: .915 and .95 of a turn tell them apart."""
    assert sorted(orders(searched({7.0: 0.05, 12.0: 0.014, 28.0: 0.03}, 3, mean))) == [7.0, 12.0, 28.0]


@pytest.mark.slow
@pytest.mark.parametrize("mean", [0.575, 0.597, 0.65])
@pytest.mark.parametrize("order", [6.8, 8.25, 12.37])
def test_behind_a_gear_an_order_is_what_it_is(order: float, mean: float) -> None:
    """However close to a whole one: alone on its joint it leaves noise, the whole one does not."""
    assert abs(orders(searched({order: 0.04}, 1, mean))[0] - order) < 0.01
