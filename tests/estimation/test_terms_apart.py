"""Friction of simple machines is fitted by as many terms as it has, whatever law was asked for; that of three sigmoids by three."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipelines.dynamics.body import Motion
from pipelines.effects.angle import Cogging
from pipelines.effects.base import Effect
from pipelines.effects.friction import Coulomb, ThreeSigmoid, TwoSigmoid, Viscous
from pipelines.estimation.candidate_columns import Wanted
from pipelines.estimation.estimate import Recipe
from pipelines.estimation.exact_model import Exact
from pipelines.estimation.model_fit import Refined, refine
from pipelines.estimation.nominal import fit_nominal
from pipelines.estimation.preparation import (
    BLOCKS,
    Logs,
    Prepared,
    prepare,
    unclear,
    with_terms_told_apart,
)
from pipelines.io.files import open_log
from pipelines.io.log import Array
from sample_logs.make_model import synthetic_arm
from tests.diagnosis.arms import hidden, wave
from tests.diagnosis.asking import extended
from tests.estimation.experiments import COULOMB, VISCOUS

SETTINGS = Recipe()
JOINTS = (1, 2, 3)
DIP = np.array([-1.5, -0.8, -0.4])  # [N m]


def dipping(motion: Motion) -> Array:
    """A second sigmoid beside that of Coulomb friction, of sharpness 12."""
    return DIP * np.tanh(12.0 * motion.dq)


def dip_at_2(motion: Motion) -> Array:
    """0.4 N m of the same at joint 2."""
    return np.array([0.0, -0.4, 0.0]) * np.tanh(12.0 * motion.dq)


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


@pytest.mark.slow
@pytest.mark.parametrize("cogging", [False, True])
def test_of_three_sigmoids_one_is_left_where_friction_has_one(cogging: bool) -> None:
    """Coulomb and viscous friction come out right at every joint, and what is left is what their own law leaves, waves or none."""
    told = with_terms_told_apart(prepare(simple(cogging), SETTINGS, synthetic_arm()), BLOCKS)
    assert [(one.joint, one.law, one.taken) for one in told.fewer] == [(j, "three_sigmoid", ("coulomb", "viscous")) for j in JOINTS]
    done = fitted(told)
    for joint, level, viscous in zip(JOINTS, COULOMB, VISCOUS, strict=True):
        assert kinds(told, joint) == [Coulomb, Viscous]
        law = law_at(done, joint)
        assert law["level"] == pytest.approx(level, rel=0.02)
        assert law["coefficient"] == pytest.approx(viscous, rel=0.1)
    np.testing.assert_allclose(done.rms, fitted(prepare(simple(cogging), SETTINGS)).rms, rtol=1e-3)


@pytest.mark.slow
def test_of_three_sigmoids_two_are_left_where_friction_has_two() -> None:
    """A dip keeps its own term, with its height and sharpness."""
    logs = Logs((hidden(1, dipping), hidden(2, dipping)), (hidden(3, dipping, "validate"),))
    told = with_terms_told_apart(prepare(logs, SETTINGS, synthetic_arm()), BLOCKS)
    assert {one.taken for one in told.fewer} == {("two_sigmoid",)}
    done = fitted(told)
    for joint, level, dip in zip(JOINTS, COULOMB, DIP, strict=True):
        assert kinds(told, joint) == [TwoSigmoid]
        law = law_at(done, joint)
        assert (law["f1"], law["f2"]) == (pytest.approx(level, rel=0.05), pytest.approx(dip, rel=0.1))
        assert (law["w1"], law["w2"]) == (pytest.approx(100.0, rel=0.1), pytest.approx(12.0, rel=0.1))


@pytest.mark.slow
def test_three_sigmoids_that_are_told_apart_stay(samples: Path) -> None:
    """A machine of three: its sharpnesses 120, 60 and 12 within their uncertainty where nothing is wrong. At joint 2 something is,
    and blurs them: by these logs alone two are left of them, and beside logs of the time before all three stay."""
    now = [f"rrr-changed/{kind}-{number}.h5" for number in (3, 4) for kind in ("excitation", "free")]
    before = [f"rrr-changed/{kind}-3-commissioning.h5" for kind in ("excitation", "free")]
    alone, beside = (with_terms_told_apart(prepare(sampled(samples, *names), SETTINGS, synthetic_arm()), BLOCKS)
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


@pytest.mark.slow
def test_three_sigmoids_come_out_right_beside_cogging(samples: Path) -> None:
    """The motor of joint 2 cogs since the reference logs, 0.35 N m. By its waves two of the three sigmoids had merged (124 +- 6e4
    s/rad), and 0.17 N m was left of what was held out. The machine has 120, 60 and 12 s/rad."""
    names = [f"rrr-changed/{kind}-{which}.h5" for which in ("3", "4", "3-commissioning") for kind in ("excitation", "free")]
    found = extended(sampled(samples, *names), Wanted(Cogging(2)), arm=synthetic_arm())
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


@pytest.mark.slow
def test_merged_terms_are_seen() -> None:
    """Of one sigmoid fitted as three nothing but their sum is seen; a law of one term has none to confuse."""
    prepared = prepare(simple(), SETTINGS, synthetic_arm())
    laws = tuple(ThreeSigmoid(j, 124.0, 123.9, 20.0) for j in JOINTS)
    done = fitted(replace(prepared, columns=replace(prepared.columns, laws=laws)))
    for place in range(3):
        assert unclear(done, place)
    plain = fitted(prepare(simple(), SETTINGS))
    assert not any(unclear(plain, place) for place in range(len(plain.model.columns.laws)))


@pytest.mark.parametrize(("std", "merged"), [
    ((0.05, 0.6, 0.2), True), ((1.1, 0.1, 0.1), True), ((400.0, 0.1, 0.1), True), ((0.01, 0.01, 0.2), False)])
def test_a_sharpness_of_which_only_its_size_is_known_is_unclear(std: tuple[float, ...], merged: bool) -> None:
    """Of a logarithm ± 1.1, three times as much and a third are as likely; ± 400 is nothing known."""
    assert unclear(three_at(70.0, 60.0, 5.0, std), 0) == merged


def three_at(w1: float, w2: float, w3: float, std: tuple[float, ...]) -> Refined:
    """A fitted model whose first law has these sharpnesses, their logarithms with these deviations."""
    done = fitted(prepare(simple(), SETTINGS, synthetic_arm()))
    laws = (ThreeSigmoid(1, w1, w2, w3), *done.model.columns.laws[1:])
    known, first = np.zeros((len(done.slopes),) * 2), len(done.model.beta)
    known[range(first, first + 3), range(first, first + 3)] = np.square(std)
    assert done.names[:3] == tuple((0, 0, name) for name in ("w1", "w2", "w3"))
    return replace(done, model=replace(done.model, columns=replace(done.model.columns, laws=laws)), known=known)


@pytest.mark.slow
def test_the_time_before_says_what_friction_was() -> None:
    """Coulomb and viscous then, and a second sigmoid at joint 2 since: as part of the law it would be nothing wrong. The reason is
    that of the logs that have decided. Where they do not drive the joint, those of now decide."""
    before = tuple(replace(hidden(seed), role="reference") for seed in (4, 5))
    logs = Logs((hidden(1, dip_at_2), hidden(2, dip_at_2)), (hidden(3, dip_at_2, "validate"),), before)
    prepared = prepare(logs, SETTINGS, synthetic_arm())
    told = with_terms_told_apart(prepared, BLOCKS)
    assert kinds(told, 2) == [Coulomb, Viscous]
    assert prepared.reference is not None
    alone = with_terms_told_apart(replace(prepared, data=prepared.reference, reference=None), BLOCKS)
    assert told.fewer == alone.fewer
    now = with_terms_told_apart(replace(prepared, reference=None), BLOCKS)
    assert kinds(now, 2) == [TwoSigmoid]
    still = tuple(replace(one, weighed=one.weighed & (np.array(JOINTS) != 2)[:, None]) for one in prepared.reference.logs)
    unmoved = replace(prepared, reference=replace(prepared.reference, logs=still))
    assert kinds(with_terms_told_apart(unmoved, BLOCKS), 2) == [TwoSigmoid]


@pytest.mark.slow
def test_what_judges_the_model_does_not_choose_it() -> None:
    prepared = prepare(simple(), SETTINGS, synthetic_arm())
    nothing: Any = object()  # whoever asks it fails
    told = with_terms_told_apart(replace(prepared, judge=nothing), BLOCKS)
    assert told.fewer == with_terms_told_apart(prepared, BLOCKS).fewer != ()


def test_laws_of_one_term_are_left_alone() -> None:
    prepared = prepare(simple(), SETTINGS)
    assert with_terms_told_apart(prepared, BLOCKS) is prepared


@pytest.mark.slow
def test_a_part_that_stands_beside_a_law_is_not_laid_twice() -> None:
    """A model with viscous friction of its own beside three sigmoids is left with Coulomb friction and that."""
    prepared = prepare(simple(), SETTINGS, synthetic_arm())
    laws = (*prepared.columns.laws, Viscous(2))
    told = with_terms_told_apart(replace(prepared, columns=replace(prepared.columns, laws=laws)), BLOCKS)
    assert kinds(told, 2) == [Coulomb, Viscous]


@pytest.mark.slow
def test_cogging_is_accepted_with_its_numbers_beside_a_law_of_three_sigmoids() -> None:
    """0.1 N m, eleven waves a turn, on a machine whose friction has one sigmoid; the result says what law it was fitted beside."""
    found = extended(simple(True), Wanted(Cogging(2)), arm=synthetic_arm())
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
