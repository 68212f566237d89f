"""Friction of simple machines is fitted by as many terms as it has, whatever law was asked for; that of three sigmoids by three."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from pipelines.log.experiment import Array
from pipelines.log.files import open_log
from pipelines.model.diagnosis.exact import Exact
from pipelines.model.diagnosis.extend import Wanted, extend
from pipelines.model.diagnosis.inputs import Logs, Prepared, narrowed, prepare
from pipelines.model.diagnosis.nominal import fit_nominal
from pipelines.model.diagnosis.refit import Refined, refine
from pipelines.model.diagnosis.settings import DiagnosisSettings
from pipelines.model.diagnosis.terms_apart import unclear, with_terms_told_apart
from pipelines.model.effects.base import Effect
from pipelines.model.effects.cogging import Cogging
from pipelines.model.effects.coulomb import Coulomb
from pipelines.model.effects.three_sigmoid import ThreeSigmoid
from pipelines.model.effects.two_sigmoid import TwoSigmoid
from pipelines.model.effects.viscous import Viscous
from pipelines.model.rigid.body import Motion
from sample_logs.make_model import synthetic_arm
from tests.model.diagnosis.arms import hidden, wave
from tests.model.estimation.experiments import COULOMB, VISCOUS

SETTINGS = DiagnosisSettings()
JOINTS = (1, 2, 3)
DIP = np.array([-1.5, -0.8, -0.4])  # [N m]


def dipping(motion: Motion) -> Array:
    """A second sigmoid beside that of Coulomb friction, of sharpness 12."""
    return DIP * np.tanh(12.0 * motion.dq)


def fitted(prepared: Prepared) -> Refined:
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    return refine(Exact.start(columns, fit), prepared.data, fit.weight)


def law_at(done: Refined, joint: int) -> dict[str, float]:
    """Every number of the laws of a joint."""
    found, first = dict[str, float](), len(done.model.columns.kept)
    for law in done.model.columns.laws:
        count = sum(not q.shape for q in law.parameters)
        found |= law.values(done.model.beta[first:first + count]) if law.joint == joint else {}
        first += count
    return found


def kinds(prepared: Prepared, joint: int) -> list[type[Effect]]:
    return [type(law) for law in prepared.columns.laws if law.joint == joint]


@lru_cache
def simple(cogging: bool = False) -> Logs:
    load = wave if cogging else None
    return Logs((hidden(1, load), hidden(2, load)), (hidden(3, load, "validate"),))


def sampled(samples: Path, *names: str) -> Logs:
    return Logs.by_role([open_log(samples / name).log for name in names])


@pytest.mark.parametrize("cogging", [False, True])
def test_of_three_sigmoids_one_is_left_where_friction_has_one(cogging: bool) -> None:
    """Coulomb and viscous friction come out right at every joint, and what is left is what their own law leaves, waves or none."""
    told = with_terms_told_apart(prepare(simple(cogging), SETTINGS, synthetic_arm()), SETTINGS.blocks)
    assert [(one.joint, one.law, one.taken) for one in told.fewer] == [(j, "three_sigmoid", ("coulomb", "viscous")) for j in JOINTS]
    done = fitted(told)
    for joint, level, viscous in zip(JOINTS, COULOMB, VISCOUS, strict=True):
        assert kinds(told, joint) == [Coulomb, Viscous]
        law = law_at(done, joint)
        assert law["level"] == pytest.approx(level, rel=0.02)
        assert law["coefficient"] == pytest.approx(viscous, rel=0.1)
    np.testing.assert_allclose(done.rms, fitted(prepare(simple(cogging), SETTINGS)).rms, rtol=1e-3)


def test_of_three_sigmoids_two_are_left_where_friction_has_two() -> None:
    """A dip keeps its own term, with its height and sharpness."""
    logs = Logs((hidden(1, dipping), hidden(2, dipping)), (hidden(3, dipping, "validate"),))
    told = with_terms_told_apart(prepare(logs, SETTINGS, synthetic_arm()), SETTINGS.blocks)
    assert {one.taken for one in told.fewer} == {("two_sigmoid",)}
    done = fitted(told)
    for joint, level, dip in zip(JOINTS, COULOMB, DIP, strict=True):
        assert kinds(told, joint) == [TwoSigmoid]
        law = law_at(done, joint)
        assert (law["f1"], law["f2"]) == (pytest.approx(level, rel=0.05), pytest.approx(dip, rel=0.1))
        assert (law["w1"], law["w2"]) == (pytest.approx(100.0, rel=0.1), pytest.approx(12.0, rel=0.1))


def test_three_sigmoids_that_are_told_apart_stay(samples: Path) -> None:
    """A machine of three: its sharpnesses 120, 60 and 12 within their uncertainty where nothing is wrong. At joint 2 something is,
    and blurs them: by these logs alone two are left of them, and beside logs of the time before all three stay."""
    now = [f"rrr-changed/{kind}-{number}.h5" for number in (3, 4) for kind in ("excitation", "free")]
    before = [f"rrr-changed/{kind}-3-commissioning.h5" for kind in ("excitation", "free")]
    alone, beside = (with_terms_told_apart(prepare(sampled(samples, *names), SETTINGS, synthetic_arm()), SETTINGS.blocks)
                     for names in (now, [*now, *before]))
    assert [(one.joint, one.taken) for one in alone.fewer] == [(2, ("two_sigmoid",))]
    assert beside.fewer == ()
    done = fitted(alone)
    std = np.sqrt(np.diag(done.covariance()))
    for place, law in enumerate(done.model.columns.laws):
        if isinstance(law, ThreeSigmoid):
            own = {which[2]: std[len(done.model.beta) + k] for k, which in enumerate(done.names) if which[:2] == (0, place)}
            for name, truth in (("w1", 120.0), ("w2", 60.0), ("w3", 12.0)):
                assert abs(np.log(getattr(law, name) / truth)) < 3.0 * own[name]
    assert [type(law) for law in done.model.columns.laws] == [ThreeSigmoid, TwoSigmoid, ThreeSigmoid]


def test_three_sigmoids_come_out_right_beside_cogging(samples: Path) -> None:
    """The motor of joint 2 cogs since the reference logs, 0.35 N m. By its waves two of the three sigmoids had merged (124 +- 6e4
    s/rad), and 0.17 N m was left of what was held out. The machine has 120, 60 and 12 s/rad."""
    names = [f"rrr-changed/{kind}-{which}.h5" for which in ("3", "4", "3-commissioning") for kind in ("excitation", "free")]
    found = extend(sampled(samples, *names), (Wanted(Cogging(2)),), SETTINGS, synthetic_arm())
    assert found.findings[0].parameters["amplitude"].value == pytest.approx(0.35, rel=0.02)
    assert found.after.validate[1] < 0.03
    assert found.fewer == ()
    assert found.arm is not None
    law = next(one for one in found.arm.friction if one.effect.joint == 2)
    for name, truth in (("w1", 120.0), ("w2", 60.0), ("w3", 12.0)):
        number = next(p for p in law.parameters if p.name == name)
        assert number.std is not None
        assert number.std < 0.1 * truth
        assert number.value == pytest.approx(truth, abs=3.0 * number.std)


def test_merged_terms_are_said() -> None:
    """Of one sigmoid fitted as three nothing but their sum is seen, and the words have both numbers; a law of one term has none to
    confuse."""
    prepared = prepare(simple(), SETTINGS, synthetic_arm())
    laws = tuple(ThreeSigmoid(j, 124.0, 123.9, 20.0) for j in JOINTS)
    done = fitted(replace(prepared, columns=replace(prepared.columns, laws=laws)))
    for place in range(3):
        assert "±" in unclear(done, place)
        assert "s/rad" in unclear(done, place)
    plain = fitted(prepare(simple(), SETTINGS))
    assert not any(unclear(plain, place) for place in range(len(plain.model.columns.laws)))


def test_laws_of_one_term_are_left_alone() -> None:
    prepared = prepare(simple(), SETTINGS)
    assert with_terms_told_apart(prepared, SETTINGS.blocks) is prepared


def test_a_part_that_stands_beside_a_law_is_not_laid_twice() -> None:
    """A model with viscous friction of its own beside three sigmoids is left with Coulomb friction and that."""
    prepared = prepare(simple(), SETTINGS, synthetic_arm())
    laws = (*prepared.columns.laws, Viscous(2))
    told = with_terms_told_apart(replace(prepared, columns=replace(prepared.columns, laws=laws)), SETTINGS.blocks)
    assert kinds(told, 2) == [Coulomb, Viscous]


def test_a_narrower_look_still_says_so() -> None:
    told = with_terms_told_apart(prepare(simple(), SETTINGS, synthetic_arm()), SETTINGS.blocks)
    assert narrowed(told, 10.0, [0.0] * 3).fewer == told.fewer != ()


def test_cogging_is_accepted_with_its_numbers_beside_a_law_of_three_sigmoids() -> None:
    """0.1 N m, eleven waves a turn, on a machine whose friction has one sigmoid; the result says what law it was fitted beside."""
    found = extend(simple(True), (Wanted(Cogging(2)),), SETTINGS, synthetic_arm())
    (one,) = found.findings
    assert one.parameters["order"].value == pytest.approx(11.0, abs=0.01)
    assert one.parameters["amplitude"].value == pytest.approx(0.1, rel=0.03)
    assert found.rejected == ()
    assert {fewer.joint for fewer in found.fewer} == set(JOINTS)
    assert (found.after.validate < np.array([0.012, 0.006, 0.004])).all()
    assert found.arm is not None
    numbers = [p for law in found.arm.friction for p in law.parameters if p.std is not None]
    assert len(numbers) == 9
    assert all(p.std is not None and p.std < 0.5 * p.value for p in numbers)
