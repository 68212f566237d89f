"""Where no floor says what is noise, a cause is named by time that it was not chosen by: what wanders without a law has no name."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pipelines.log.experiment import Array, ExperimentLog
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.screened.candidates import families, whole_motion
from pipelines.model.diagnosis.searched import borne_out
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.search import Found, search
from tests.model.diagnosis.screened.test_through import turned

SETTINGS = DiagnosisSettings(replicas=0, cutoff_hz=40.0)


def wandering(seed: int, size: float, ripple: float = 0.0) -> ExperimentLog:
    """A rotor with a torque of `size` [N m] rms that follows nothing but chance and remembers itself for a sixth of a second, as
    what a model leaves of a recorded arm does; and a ripple of seven waves a turn."""
    log = turned(seed, {7.0: ripple}, 0.0)
    tau, rng = log.signals["tau"], np.random.default_rng(100 + seed)
    memory = np.exp(-log.sample_time / 0.15)
    wander = np.zeros(log.n_samples)
    for k, push in enumerate(rng.normal(0.0, size * np.sqrt(1.0 - memory**2), log.n_samples - 1)):
        wander[k + 1] = memory * wander[k] + push
    return replace(log, signals={**log.signals, "tau": replace(tau, values=tau.values + wander[:, None])})


def searched(*logs: ExperimentLog, most: int = 3) -> Found:
    prepared = prepare(Logs(logs), SETTINGS)
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit)
    every = families(columns.laws, whole_motion(prepared.data), model.arm)
    return search(Case(prepared.data, None, model, fit.weight, every, None), most)


@pytest.mark.parametrize("seed", [1, 11, 21])
def test_a_torque_that_follows_nothing_has_no_name(seed: int) -> None:
    assert not searched(wandering(seed, 0.01), most=1).final.model.effects


def test_a_ripple_is_found_beside_it() -> None:
    """Of the same power: one of seven waves a turn, 0.014 N m, whose square is twice that of the wander."""
    found = searched(wandering(1, 0.01, 0.014), wandering(2, 0.01, 0.014), most=1).final.model.effects
    assert [one.effect.name for one in found] == ["cogging"]
    assert found[0].values["order"] == pytest.approx(7.0, rel=0.01)
    assert found[0].values["amplitude"] == pytest.approx(0.014, rel=0.25)


STEADY, LUCK = np.full(20, 1.0), np.array([20.0, *np.full(19, -0.2)])  # gains of blocks: of all alike, and of one alone


@pytest.mark.parametrize(("gains", "cosine", "refused"), [
    ((STEADY, 0.1 * STEADY), 0.0, ()),  # two of their own
    ((LUCK, STEADY), 0.0, (0,)),
    ((2.0 * LUCK, STEADY), 0.7, (0, 1)),  # the greater of two that mean much of the same is luck: the other is not asked
    ((LUCK, 2.0 * STEADY), 0.7, (0,)),
    ((STEADY, STEADY + 0.3 * np.tile([1.0, -1.0], 10)), 0.7, (0, 1)),  # both take half of the same, and neither is better
    ((2.0 * STEADY, STEADY), 0.7, (1,)),  # one is, in every block
    ((STEADY, STEADY + 0.3 * np.tile([1.0, -1.0], 10)), 0.95, ()),  # the same torque by two names
])
def test_of_causes_that_explain_the_same_one_is_named_if_it_is_decidedly_better(
        monkeypatch: pytest.MonkeyPatch, gains: tuple[Array, Array], cosine: float, refused: tuple[int, ...]) -> None:
    """Two causes whose torques are as alike as two unit vectors with this cosine: each takes its square of the other."""
    towards = np.array([[1.0, 0.0], [cosine, np.sqrt(1.0 - cosine**2)]])
    shapes = [SimpleNamespace(fixed_amplitudes=None)]
    some: list[Any] = [SimpleNamespace(family=SimpleNamespace(event=False, shapes=shapes, number=k), amplitude=None)
                       for k in range(2)]
    blocked = SimpleNamespace(gains=lambda family, arm: gains[family.number])
    monkeypatch.setattr(borne_out.Blocked, "of", lambda now, count: blocked)
    monkeypatch.setattr(borne_out, "_taken", lambda now, one: towards[one.family.number])
    monkeypatch.setattr(borne_out, "_share", lambda now, by, of: float(by.taken @ of.taken)**2)
    case: Any = SimpleNamespace(arms=lambda model: SimpleNamespace(of=lambda family: None))
    assert borne_out.not_borne_out(case, cast(Any, SimpleNamespace(model=None)), some) == frozenset(refused)
