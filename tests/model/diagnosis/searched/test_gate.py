"""What an exact fit alone tells, where a threshold is no floor: a hump of friction that the nominal law has half made up for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.log.files import open_log
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.diagnose import diagnose
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.fitted.refit import Refined, refine
from pipelines.model.diagnosis.floor.thresholds import without_twin
from pipelines.model.diagnosis.screened.candidates import families, whole_motion
from pipelines.model.diagnosis.screened.screen import Screened, screen
from pipelines.model.diagnosis.searched.case import Case, HeldOut
from pipelines.model.diagnosis.searched.gate import Gate, gate_of
from pipelines.model.diagnosis.searched.hypotheses import fitted

ASKED = ("stribeck", "concave_friction", "cogging", "asymmetric_friction")


def _logs(samples: Path) -> list[Path]:
    return [samples / f"rrr-closed-form/{name}.h5" for name in ("excitation-1", "free-1", "excitation-2")]


@pytest.fixture(scope="module")
def of_three_sigmoids(samples: Path) -> tuple[Case, Refined, list[Screened]]:
    """The arm of three sigmoids by Coulomb and viscous friction, which have no hump at low speed."""
    logs = [open_log(path).log for path in _logs(samples)]
    prepared = prepare(Logs.by_role(logs), DiagnosisSettings())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit)
    every = tuple(one for one in families(columns.laws, whole_motion(prepared.data), model.arm) if one.cause in ASKED)
    case = Case(prepared.data, prepared.judge, model, fit.weight, every, None)
    now = refine(case.model, case.data, case.weight)
    return case, now, screen(case.data, now.fit, every, case.arms(now.model))


@pytest.mark.slow
def test_every_joint_of_three_sigmoids_has_its_hump(samples: Path) -> None:
    """Recorded without a controller, and so without a floor: what takes nine tenths of a joint is not left without a name."""
    logs = Logs.by_role([open_log(path).log for path in _logs(samples)])
    found = diagnose(logs, DiagnosisSettings(replicas=0, evidence=False, limits=False))
    assert {(one.cause, one.joint) for one in found.findings} == {("stribeck", joint) for joint in (1, 2, 3)}
    (below,) = [one for one in found.ledger if one.accepted and one.gain <= one.threshold]
    assert (below.cause, below.joint) == ("stribeck", 1)
    assert below.exact_gain > 5.0 * below.gain
    assert below.reason.startswith("below its threshold to first order")


def test_what_is_near_has_to_take_most_of_its_joint_when_it_is_fitted(
        of_three_sigmoids: tuple[Case, Refined, list[Screened]]) -> None:
    """The hump does; a difference between the directions does not, and passes by its threshold alone."""
    case, now, screened = of_three_sigmoids
    error, bounds = HeldOut.of(now, case), without_twin(screened, now.rss, now.weight)
    for cause, most in (("stribeck", True), ("asymmetric_friction", False)):
        seen = next(one for one in screened if (one.cause, one.joint) == (cause, 1))
        done = fitted(case, now, seen, error)
        assert Gate(screened, bounds, (), frozenset(), near=(seen,)).told(done, now) is most
        assert Gate(screened, bounds, (seen,), frozenset()).told(done, now)
        assert not Gate(screened, bounds, (), frozenset()).told(done, now)


def test_only_what_changes_the_laws_is_near_and_only_where_nothing_passes(
        of_three_sigmoids: tuple[Case, Refined, list[Screened]]) -> None:
    """The hump of joint 1 the lighter this joint weighs; with a floor nothing is."""
    case, now, _ = of_three_sigmoids
    for weigh, passes, near in ((0.2, False, True), (0.1, False, False)):
        lighter = refine(now.model, now.data, now.weight * np.array([weigh, 1.0, 1.0]))
        left = screen(case.data, lighter.fit, case.families, case.arms(lighter.model))
        gate = gate_of(case, lighter, left)
        assert ("stribeck", 1) in {(one.cause, one.joint) for one in gate.passed} or not passes
        assert [(one.cause, one.joint) for one in gate.near] == ([("stribeck", 1)] if near else [])
        bounds = without_twin(left, lighter.rss, lighter.weight)
        assert not gate_of(replace(case, thresholds=bounds), lighter, left).near
