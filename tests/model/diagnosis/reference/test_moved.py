"""What the base parameters take in since the reference logs, though no mass has changed, is told by their move."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pipelines.log.experiment import ExperimentLog
from pipelines.log.robot import format_robot
from pipelines.model.arm import Acting, Arm
from pipelines.model.diagnosis import changed as changed_module
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.diagnose import diagnose
from pipelines.model.diagnosis.fitted.refit import refine
from pipelines.model.diagnosis.given.since import since_reference
from pipelines.model.diagnosis.reference.absorbed import Absorbed, Move, chosen
from pipelines.model.diagnosis.result import Diagnosis
from pipelines.model.diagnosis.worth.numbers import told
from pipelines.model.effects import effect_names
from pipelines.model.effects.base import Effect
from pipelines.model.effects.link_length import LinkLength
from pipelines.model.effects.payload import Payload
from pipelines.model.effects.spring import Spring
from pipelines.model.effects.torque_gain import TorqueGain
from pipelines.model.effects.torque_offset import TorqueOffset
from pipelines.model.rigid.altered import chain_of, with_longer_link
from pipelines.model.rigid.chain import inverse_dynamics
from sample_logs.make_closed_form import quantised, recorded, torque_step
from tests.model.diagnosis.arms import arm
from tests.model.estimation.experiments import Quick, motion_of
from tests.model.rigid.serial_arms import physical_links

TRIED = ("quadratic_drag", "torque_offset", "torque_gain", "asymmetric_friction", "payload")
SETTINGS = DiagnosisSettings(without=tuple(name for name in effect_names() if name not in TRIED), evidence=False, limits=False)
OFFSET = 30.0 / 2048  # [N m] one step of the converter of joint 2
BODIES = 0.1 * physical_links(3, np.random.default_rng(3))
LITTLE = 0.2  # of the usual angles: over so few, weight hardly changes


def turning_little(seed: int) -> Quick:
    wide = motion_of(seed)
    return Quick(wide.q0, LITTLE * wide.a, LITTLE * wide.b, wide.df)


def pushed(seed: int, offset: float, role: str = "identify") -> ExperimentLog:
    """A constant torque at joint 2."""
    log = recorded(arm(), turning_little(seed), 8.0, np.random.default_rng([4, seed]), name=f"{role}-{seed}",
                   experiment="excitation", role=role, period=10.0)
    tau = log.tau + quantised(np.tile([0.0, offset, 0.0], (log.n_samples, 1)), torque_step(log.robot))
    return replace(log, signals={**log.signals, "tau": replace(log.signals["tau"], values=tau)})


@pytest.fixture(scope="module")
def offset() -> Diagnosis:
    return diagnose(Logs((pushed(1, OFFSET), pushed(2, OFFSET)), (pushed(3, OFFSET, "validate"),),
                         (pushed(4, 0.0, "reference"), pushed(5, 0.0, "reference"))), SETTINGS)


def test_a_constant_torque_that_passes_for_weight_is_named(offset: Diagnosis) -> None:
    """The masses are those of the reference logs: an offset of the drive is the simpler story."""
    assert [(one.cause, one.joint, one.origin) for one in offset.findings] == [("torque_offset", 2, "base parameters")]
    found = offset.findings[0].parameters["offset"]
    assert isinstance(found.value, float)
    assert isinstance(found.std, float)
    assert abs(found.value - OFFSET) < max(3.0 * found.std, 0.05 * OFFSET)


def test_held_out_torque_bears_it_out_and_the_model_has_it_apart(offset: Diagnosis) -> None:
    gain = offset.findings[0].gain.validate_torque_rms
    assert gain.ci95[1, 1] < 0.0
    assert gain.after[1] < 0.5 * gain.before[1]
    assert offset.extended is not None
    assert [one.place for one in offset.extended.effects] == ["torque_offset:2"]


def test_without_a_change_the_base_parameters_have_not_moved() -> None:
    found = diagnose(Logs((pushed(1, OFFSET), pushed(2, OFFSET)), (),
                          (pushed(4, OFFSET, "reference"), pushed(5, OFFSET, "reference"))), SETTINGS)
    assert found.verdict == "nothing-wrong"


def sprung(seed: int, stiffness: float, role: str = "identify") -> ExperimentLog:
    """A spring at joint 2, at rest at -1.5 rad."""
    path = turning_little(seed)
    log = recorded(arm(), path, 8.0, np.random.default_rng([6, seed]), name=f"{role}-{seed}", experiment="excitation", role=role,
                   period=10.0)
    more = np.zeros_like(log.tau)
    more[:, 1] = stiffness * (path(log.t).q[:, 1] + 1.5)
    tau = log.tau + quantised(more, torque_step(log.robot))
    return replace(log, signals={**log.signals, "tau": replace(log.signals["tau"], values=tau)})


@pytest.mark.slow
@pytest.mark.parametrize(("amplitude", "moved"), [(0.0, True), (0.5, False), (1.0, False)])
def test_what_a_spring_shares_with_weight_is_no_load(amplitude: float, moved: bool) -> None:
    """Fitted beside base parameters that are free, a spring leaves them a part of what it does, here half of it; with those of the
    reference it takes all of it. Without a spring they have moved."""
    logs = Logs((sprung(1, 2.0), sprung(2, 2.0)), (), (sprung(4, 0.0, "reference"), sprung(5, 0.0, "reference")))
    prepared = prepare(logs, SETTINGS)
    assert prepared.reference is not None
    since = since_reference(prepared, prepared.reference, SETTINGS)
    spring, size = Spring(2, degree=1), 2.0 * np.array([1.0, 1.5])  # slope and constant
    model = since.case.model.with_effect(spring, amplitude * size) if amplitude else since.case.model
    found = since.absorbed(refine(model, since.case.data, since.case.weight, steps=0), ())
    assert (found is not None) is moved


def loaded(seed: int, mass: float, role: str = "identify") -> ExperimentLog:
    """A load 0.1 m beyond the tip, along the last link."""
    body = {"mass": mass, "first_moment_x": 0.1 * mass, "inertia_yy": 0.01 * mass, "inertia_zz": 0.01 * mass}
    values = {q.name: body.get(q.name, 0.0) for q in Payload.parameters}
    return recorded(arm().extended(Acting.of(Payload(), values)), motion_of(seed), 8.0, np.random.default_rng([4, seed]),
                    name=f"{role}-{seed}", experiment="excitation", role=role, period=10.0)


@pytest.mark.slow
@pytest.mark.parametrize(("without", "verdict"), [((), "cause"), (("payload",), "unknown")])
def test_base_parameters_that_moved_as_no_cause_moves_them_are_no_arm_in_order(without: tuple[str, ...], verdict: str) -> None:
    """Nothing stands in the residual, and yet the arm is another: with the load in the library it has a name, without it none."""
    brief = replace(SETTINGS, without=(*SETTINGS.without, *without))
    found = diagnose(Logs((loaded(1, 0.3), loaded(2, 0.3)), (loaded(3, 0.3, "validate"),),
                          (loaded(4, 0.0, "reference"), loaded(5, 0.0, "reference"))), brief)
    assert found.verdict == verdict
    assert [one.cause for one in found.findings] == ([] if without else ["payload"])
    if without:
        assert "base parameters have moved" in found.summary
        told = re.search(r"leaves ([\d.e+]+) times", found.reason)
        assert told is not None
        assert float(told[1]) > 1.5


@pytest.mark.slow
@pytest.mark.parametrize(("mass", "verdict"), [(0.3, "unknown"), (0.0, "nothing-wrong")])
def test_a_load_that_is_not_accepted_leaves_no_arm_in_order(mass: float, verdict: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The base parameters have moved all the same, and the ledger says why the load has no name."""
    doubted = SimpleNamespace(doubt="it is farther", gained=-0.2, finding=SimpleNamespace(cause="payload", joint=None))
    monkeypatch.setattr(changed_module, "carried", lambda *_: doubted)
    found = diagnose(Logs((loaded(1, mass), loaded(2, mass)), (loaded(3, mass, "validate"),),
                          (loaded(4, 0.0, "reference"), loaded(5, 0.0, "reference"))), SETTINGS)
    assert (found.verdict, found.findings) == (verdict, ())
    assert [one.reason for one in found.rejected if one.cause == "payload"] == (["it is farther"] if mass else [])
    told = [(one.reason, one.accepted) for one in found.ledger if one.cause == "payload"]
    assert told == ([("it is farther", False)] if mass else [])
    assert found.unmoved_rms is None


def altered(error: float, mass: float = 0.0) -> Arm:
    """Link 2 longer than described by `error` [m], its links solid bodies; or `mass` [kg] at the elbow, on the axis of joint 3."""
    bare = arm()
    body = with_longer_link(bare.body, 2, error) if error else bare.body
    bodies = BODIES.copy()
    bodies[10 * 1] += mass  # links of DH have their frames at their ends
    rng = np.random.default_rng(5)
    states = rng.uniform(-3.0, 3.0, (40, 3)), rng.normal(size=(40, 3)), rng.normal(size=(40, 3))
    torque = inverse_dynamics(chain_of(body), *states, bodies)
    p = np.linalg.lstsq(body.regressor(*states).reshape(120, -1), torque.ravel(), rcond=None)[0]
    return bare.with_body(body, p)


def turned(whose: Arm, seed: int, role: str = "identify") -> ExperimentLog:
    return recorded(whose, turning_little(seed), 8.0, np.random.default_rng([4, seed]), name=f"{role}-{seed}",
                    experiment="excitation", role=role, period=10.0, robot_text=format_robot(arm().robot))


def compared(now: Arm, tried: tuple[str, ...]) -> Diagnosis:
    brief = replace(SETTINGS, without=tuple(name for name in effect_names() if name not in tried))
    before = altered(0.0)
    return diagnose(Logs((turned(now, 1), turned(now, 2)), (turned(now, 3, "validate"),),
                         (turned(before, 4, "reference"), turned(before, 5, "reference"))), brief)


@pytest.mark.slow
@pytest.mark.parametrize("error", [-2e-3, 2e-3])
def test_a_longer_link_is_told_by_the_masses_beyond_it(error: float) -> None:
    """Within a session base parameters take nearly all of it in. How heavy what is beyond the link is they do not say, so that they
    move by numbers of their own; with these the length puts them back, and a load, for all its ten numbers, does not."""
    now, before = altered(error), altered(0.0)
    logs = Logs((turned(now, 1), turned(now, 2)), (), (turned(before, 4, "reference"), turned(before, 5, "reference")))
    prepared = prepare(logs, SETTINGS)
    assert prepared.reference is not None
    every = replace(SETTINGS, without=tuple(name for name in SETTINGS.without if name != "link_length"))
    since = since_reference(prepared, prepared.reference, every)
    found = since.absorbed(refine(since.case.model, since.case.data, since.case.weight, steps=0), since.case.families)
    assert isinstance(found, Absorbed)
    numbers = told(found.acting)
    assert (found.effect.name, numbers["link"].value, found.unsure) == ("link_length", 2, "")
    assert isinstance(numbers["error"].value, float)
    assert isinstance(numbers["error"].std, float)
    assert abs(numbers["error"].value - error) < min(3.0 * numbers["error"].std, 0.5 * abs(error))


@pytest.mark.slow
def test_the_model_of_a_longer_link_is_as_right_as_one_fitted_after_it() -> None:
    """The length is an effect of it, and the masses beyond the link stay on their longer lever."""
    now = altered(1.5e-3)
    found = compared(now, (*TRIED, "link_length"))
    assert [(one.cause, one.origin) for one in found.findings] == [("link_length", "base parameters")]
    assert found.findings[0].parameters["link"].std is None
    assert found.findings[0].gain.validate_torque_rms.ci95[1, 1] < 0.0
    alone = diagnose(Logs((turned(now, 1), turned(now, 2))), SETTINGS).nominal
    assert alone is not None
    assert found.extended is not None
    fine = turning_little(3)(np.linspace(1.0, 7.0, 500))
    true = now.torque(fine)
    after, plain, before = (float(np.linalg.norm(one.torque(fine) - true)) for one in (found.extended, alone, altered(0.0)))
    assert after < 1.1 * plain < 0.8 * before


@pytest.mark.slow
@pytest.mark.parametrize("mass", [-0.05, pytest.param(0.05, marks=pytest.mark.slow), 0.1])
def test_a_load_at_the_elbow_is_no_longer_link(mass: float) -> None:
    """Masses that nobody knows explain .98 of what it moves, and ten numbers of a load all of it."""
    found = compared(altered(0.0, mass), tuple(name for name in effect_names() if name not in ("contact", "viscous_drift")))
    assert not [one for one in found.findings if one.cause == "link_length"]
    assert found.verdict != "nothing-wrong"


def story(effect: Effect, explained: float, numbers: int) -> Absorbed:
    return Absorbed(Acting(effect, ()), numbers, explained, explained)


def test_a_longer_link_has_to_explain_as_much_as_the_best() -> None:
    """Three numbers, two of them masses that nobody knows, are no plainer a story than ten."""
    link = replace(story(LinkLength(link=2.0), 0.985, 1), unknowns=2)
    found = chosen([story(Payload(), 0.999, 10), link], Move(1.0, 1.0, 5e4))
    assert found is not None
    assert (found.effect.name, found.rivals) == ("payload", ())
    other = replace(link, acting=Acting(LinkLength(link=3.0), ()))
    found = chosen([story(Payload(), 0.9851, 10), link, other], Move(1.0, 1.0, 5e4))
    assert found is not None
    assert "link_length of link 2 or link_length of link 3 or payload" in found.unsure


@pytest.mark.parametrize(("variances", "rivals"), [(500.0, ["payload"]), (5e4, [])])
def test_two_stories_are_told_apart_by_five_standard_deviations(variances: float, rivals: list[str]) -> None:
    """A load leaves .1 %, a scale of one torque 3.1 % of a move of so many variances: 15 between them decide nothing, 1500 do."""
    found = chosen([story(Payload(), 0.999, 10), story(TorqueGain(2), 0.969, 1)], Move(1.0, 1.0, variances))
    assert found is not None
    assert [one.name for one in found.rivals] == rivals
    assert bool(found.unsure) == bool(rivals)


@pytest.mark.parametrize(("length", "rivals"), [(1.026, []), (0.979, ["payload"]), (0.96, ["payload"])])
def test_of_two_stories_that_explain_as_much_the_one_with_fewer_numbers_is_nearer(length: float, rivals: list[str]) -> None:
    """Of a move of 374 variances a load leaves .021 by ten numbers: 17.6 variances more than a longer link by three, which fits the
    residual as well, and 31.6 with numbers counted twice (Akaike 1974); as far off as the load, or farther, is not told."""
    link = replace(story(LinkLength(link=2.0), length, 1), unknowns=2)
    found = chosen([story(Payload(), 0.979, 10), link], Move(1.0, 1.0, 374.0))
    assert found is not None
    assert (found.effect.name, [one.name for one in found.rivals]) == ("link_length", rivals)


def test_a_load_that_leaves_some_of_the_move_has_no_name() -> None:
    """A body moves the parameters as bodies do, and leaves nothing; a longer link moves the same ones, and leaves 2 %."""
    found = chosen([story(Payload(), 0.98, 10)], Move(1.0, 1.0, 5e4))
    assert found is not None
    assert "not altogether" in found.unsure


def test_of_what_explains_the_same_at_a_joint_the_fewest_numbers_win() -> None:
    """A spring has a constant torque in it."""
    found = chosen([story(Spring(2), 0.996, 2), story(TorqueOffset(2), 0.995, 1)], Move(1.0, 1.0, 1e4))
    assert found is not None
    assert (found.effect.name, found.rivals) == ("torque_offset", ())


def test_a_joint_of_its_own_is_another_place() -> None:
    found = chosen([story(TorqueOffset(2), 0.99, 1), story(TorqueOffset(3), 0.985, 1)], Move(1.0, 1.0, 1e4))
    assert found is not None
    assert "torque_offset:2 or torque_offset:3" in found.unsure
