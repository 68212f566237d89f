"""What is said to be detectable is: a little above its limit a cause that the MuJoCo plant hides is found, well below it is not."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.bench import experiments
from pipelines.bench.fault import Fault
from pipelines.bench.faults import make
from pipelines.bench.machine import Machine, draw_machine
from pipelines.bench.session import record
from pipelines.model.arm import Acting
from pipelines.model.diagnosis.asked.inputs import Logs
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.diagnose import diagnose
from pipelines.model.diagnosis.result import Detectable, Diagnosis, Rejected
from pipelines.model.diagnosis.screened.candidates import Family
from pipelines.model.diagnosis.unseen.injection import _last_root, _raised
from pipelines.model.diagnosis.unseen.limits import _absorbed, _limit, detectable
from pipelines.model.diagnosis.unseen.without_limit import without_limit
from pipelines.model.effects import effect_names
from pipelines.model.effects.rotor_inertia import RotorInertia
from pipelines.model.effects.torque_gain import TorqueGain
from pipelines.model.effects.two_sigmoid import TwoSigmoid
from tests.diagnose.sessions import but

FEW = but("cogging", "torque_offset", "quadratic_drag", "torque_gain")
SECONDS = 5.0


@lru_cache(maxsize=4)
def machine(number: int) -> Machine:
    return draw_machine(number, "fault")


def logs(number: int, *faults: Fault) -> Logs:
    plans = [replace(experiments.excitation(machine(number), 1 + k, SECONDS, 1), name=f"excitation-{k + 1}",
                     role="validate" if k else "identify") for k in range(2)]
    return Logs.by_role(tuple(record(machine(number), faults, plans, 1)))


@lru_cache(maxsize=4)
def healthy(number: int, without: tuple[str, ...]) -> Diagnosis:
    return diagnose(logs(number), settings(without))


def settings(without: tuple[str, ...]) -> DiagnosisSettings:
    return DiagnosisSettings(without=without, replicas=4, evidence=False, most=2)


def limit(number: int, cause: str, joint: int, without: tuple[str, ...]) -> Detectable:
    return next(one for one in healthy(number, without).detectable if (one.cause, one.joint) == (cause, joint))


def named(number: int, cause: str, joint: int, part: float, without: tuple[str, ...]) -> bool:
    """Whether the cause is found at `part` of its limit."""
    there = limit(number, cause, joint, without)
    full = make(cause, machine(number), joint, 1)
    size = full.parameters()[there.parameter]
    assert isinstance(size, float)
    assert isinstance(there.smallest.value, float)
    fault = full.scaled(part * there.smallest.value / abs(size))
    found = diagnose(logs(number, fault), replace(settings(without), limits=False),
                     calibration=healthy(number, without).calibration)
    return (cause, joint) in [(one.cause, one.joint) for one in found.findings]


@pytest.mark.slow
@pytest.mark.parametrize(("cause", "joint"), [pytest.param("cogging", 2, marks=pytest.mark.slow), ("torque_offset", 3)])
def test_above_its_limit_a_cause_is_found(cause: str, joint: int) -> None:
    """With and against what the arm in order leaves."""
    assert limit(7, cause, joint, FEW).way == "injected"
    assert named(7, cause, joint, 1.5, FEW)
    assert named(7, cause, joint, -1.5, FEW)


@pytest.mark.slow
def test_well_below_its_limit_it_is_not() -> None:
    """The limit covers both signs: at 0.7 of it the worse one is not found."""
    assert not all(named(7, "torque_offset", 3, part, FEW) for part in (0.7, -0.7))
    assert not named(7, "cogging", 2, 0.4, FEW)


@pytest.mark.slow
def test_at_its_limit_a_clipped_drive_is_found_and_well_above_it_is_not() -> None:
    """Of a drive that clips there is more the lower it does: three in a hundred below, and three tenths above."""
    few = but("torque_saturation", "torque_offset", "torque_gain")
    there = limit(7, "torque_saturation", 3, few)
    assert (there.parameter, there.way, there.or_less) == ("limit", "injected", True)
    assert isinstance(there.smallest.value, float)
    full = make("torque_saturation", machine(7), 3, 1)
    for part, seen in ((0.97, True), (1.3, False)):
        fault: Any = replace(full, peak=full.peak * part * there.smallest.value / full.limit)  # type: ignore[attr-defined,call-arg]
        found = diagnose(logs(7, fault), replace(settings(few), limits=False))
        assert [(one.cause, one.joint) for one in found.findings] == ([("torque_saturation", 3)] if seen else [])


def test_nothing_of_the_library_goes_unsaid() -> None:
    """Of each cause there is a finding, a smallest size, a record that would show it, or what was seen of it."""
    found = healthy(7, FEW)
    lists = (found.findings, found.standing, found.detectable, found.not_testable, found.without_limit)
    assert {one.cause for some in lists for one in some} == set(effect_names()) - set(FEW) - {"two_sigmoid"}


def test_a_law_that_only_stands_in_for_another_is_said_where_the_model_has_it() -> None:
    """Nobody is told that fit-friction chooses two sigmoids: it does not know them."""
    found = healthy(7, FEW)
    assert found.nominal is not None
    assert "two_sigmoid" not in {one.cause for one in without_limit(found, False)}
    two = Acting.of(TwoSigmoid(1), {"f1": 1.0, "f2": 0.1, "w1": 60.0, "w2": 12.0, "b": 0.1})
    told = replace(found, nominal=replace(found.nominal, friction=(two, *found.nominal.friction)))
    assert "part of the nominal model" in next(one.reason for one in without_limit(told, False) if one.cause == "two_sigmoid")


@pytest.mark.parametrize(("cause", "frf", "refused", "said"), [
    ("coulomb", False, "", "part of the nominal model"), ("three_sigmoid", False, "", "another law of friction"),
    ("joint_elasticity", True, "", "frequency responses show none"), ("joint_elasticity", False, "", "was looked for"),
    ("payload", False, "", "not found to have moved"), ("cogging", False, "", "was looked for"),
    ("payload", False, "the base parameters have moved as link_length or payload moves them", "have moved as link_length")])
def test_what_has_no_limit_is_said_as_it_was_seen(cause: str, frf: bool, refused: str, said: str) -> None:
    """A law of the model, a spring that responses deny, what did not move; what was refused, by the words it was refused with."""
    rejected = (Rejected(cause, None, refused),) if refused else ()
    told = replace(healthy(7, FEW), rejected=rejected, findings=(), standing=(), detectable=(), not_testable=())
    (reason,) = (one.reason for one in without_limit(told, frf) if one.cause == cause)
    assert said in reason


@pytest.mark.slow
@pytest.mark.parametrize("number", [7, 11])
@pytest.mark.parametrize(("cause", "joint"), [
    ("cogging", 1), ("cogging", 3), ("torque_offset", 2), ("quadratic_drag", 1), ("asymmetric_friction", 2), ("torque_gain", 3),
    ("encoder_eccentricity", 1)])
def test_limits_hold_with_the_whole_library(number: int, cause: str, joint: int) -> None:
    assert named(number, cause, joint, 1.5, ())
    assert not named(number, cause, joint, 0.3, ())


def test_a_cogging_limit_says_at_which_order() -> None:
    there = limit(7, "cogging", 2, FEW)
    assert set(there.at) == {"order"}
    assert there.smallest.unit == "N m"
    assert 0.0 < there.visibility <= 1.0


def test_what_no_arm_has_so_much_of_is_no_figure() -> None:
    """A rotor of forty-nine tonnes and metres squared: that these logs cannot show it is all there is to say."""
    family = Family("rotor_inertia", 1, (RotorInertia(joint=1),))
    bounds: Any = SimpleNamespace(gain=np.ones(1), own=np.zeros(1))
    for reach, seen in ((1e3, True), (2e-5, False)):
        one: Any = SimpleNamespace(best_visibility=0.5, family=family, cause="rotor_inertia", joint=1, reach=reach, width=1)
        found, beyond = detectable((one,), bounds, (True,))
        assert [limit.smallest.value for limit in found] == ([1e-3] if seen else [])
        assert [limit.reason for limit in beyond] == (
            [] if seen else ["these logs cannot show it: no arm has so much of it that they would"])


@pytest.mark.parametrize("seed", range(5))
def test_from_which_strength_on_a_gain_stays_above_its_bound(seed: int) -> None:
    """Beside the roots of the polynomial."""
    a, b, c = np.random.default_rng(seed).standard_normal((3, 20))
    a = np.abs(a)
    found = _last_root(a, b, c)
    for one, *line in zip(found, a, b, c, strict=True):
        roots = np.roots([line[0], 2.0 * line[1], line[2]])
        real = roots[np.abs(roots.imag) < 1e-12].real
        assert one == pytest.approx(max([0.0, *real]), abs=1e-9)


def test_a_strength_is_raised_until_it_passes_and_no_further_than_a_torque_goes() -> None:
    """A quarter more at a time; where the torque has run away no greater strength is tried."""
    assert _raised(lambda strength: 1.0 if strength > 3.0 else 1.25, 1.0) == pytest.approx(1.25**5)
    asked: list[float] = []

    def runs_away(strength: float) -> float:
        asked.append(strength)
        return np.inf if strength > 2.0 else 1.5

    assert _raised(runs_away, 1.0) == np.inf
    assert asked == [1.0, 1.5, 2.25]
    assert _raised(lambda strength: 1.0, np.inf) == np.inf


@pytest.mark.parametrize("size", [np.inf, np.nan, 1e200])
def test_of_a_torque_that_runs_away_nobody_says_what_absorbs_it(size: float) -> None:
    """An inertia of the wrong sign lets what rings behind a spring grow without end."""
    column = np.full(5, size)
    effect: Any = SimpleNamespace(name="spring", joint=1, needs=(), experiment="", shapes=lambda motion, arm: (),
                                  columns=lambda motion, arm: column)
    data: Any = SimpleNamespace(logs=[SimpleNamespace(motion=None)], lay=lambda torque: torque(None))
    nothing: Any = None
    said = _absorbed(effect, data, nothing, nothing, nothing, "").reason
    assert "absorbed" not in said
    assert "other motion" in said


@pytest.mark.parametrize(("shows", "told"), [
    (0.001, 1.0 - 1.0 / (1.0 + TorqueGain.slight)), (-0.001, 1.0 / (1.0 - TorqueGain.slight) - 1.0), (-0.03, 1.0 / 0.97 - 1.0)])
def test_no_limit_is_lower_than_what_has_a_name(shows: float, told: float) -> None:
    """A thousandth of a torque is told from none here; arms in order have as much, and where that has no name it is no limit."""
    effect, amplitudes = TorqueGain(joint=1), np.array([shows])
    found, plain = (_limit(effect, amplitudes, (True,), 0.9, "injected", slight) for slight in (True, False))
    assert found is not None
    assert plain is not None
    assert found[0].smallest.value == pytest.approx(told, rel=1e-12)
    assert plain[0].smallest.value == pytest.approx(abs(1.0 / (1.0 + shows) - 1.0), rel=1e-12)
