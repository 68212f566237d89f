"""Nobody knows by which curve the dry friction of a real joint changes its sign: no cause is found in that."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest

from pipelines.log.experiment import Array
from pipelines.model.arm import Acting
from pipelines.model.diagnosis import diagnose as diagnose_module
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.given.change_of_sign import loosened, plainer_of, shows, wrong_law
from pipelines.model.diagnosis.result import Value
from pipelines.model.diagnosis.screened.candidates import families, whole_motion
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.search import search
from pipelines.model.effects import effect_names
from pipelines.model.effects.coulomb import Coulomb
from pipelines.model.effects.three_sigmoid import ThreeSigmoid
from pipelines.model.rigid.body import Motion
from tests.model.diagnosis.arms import hidden
from tests.model.estimation.experiments import COULOMB

if TYPE_CHECKING:
    from pipelines.model.diagnosis.asked.inputs import Prepared
    from pipelines.model.diagnosis.floor.calibration import Calibration
    from pipelines.model.diagnosis.result import Diagnosis

LAWS = ("stribeck", "concave_friction", "quadratic_drag")


def changing_by(curve: Callable[[Array], Array]) -> Callable[[Motion], Array]:
    """What friction that changes its sign by `curve` has more than that of the logs."""
    return lambda motion: np.array(COULOMB) * (curve(100.0 * motion.dq) - np.tanh(100.0 * motion.dq))


def case_with(curve: Callable[[Array], Array]) -> Case:
    """Logs of an arm whose joints change the sign of their friction by `curve`, with laws of friction as the only causes."""
    instead = changing_by(curve)
    logs = Logs((hidden(1, instead), hidden(2, instead)), (hidden(3, instead, "validate"),))
    prepared = loosened(prepare(logs, DiagnosisSettings()))
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit)
    without = tuple(name for name in effect_names() if name not in LAWS)
    return Case(prepared.data, prepared.judge, model, fit.weight,
                families(columns.laws, whole_motion(prepared.data), model.arm, without), None)


@pytest.mark.slow
@pytest.mark.parametrize("curve", [
    pytest.param(lambda x: x / np.sqrt(1.0 + x**2), id="root"),
    pytest.param(lambda x: 2.0 / np.pi * np.arctan(x), id="arc tangent"),
    pytest.param(lambda x: np.sign(x) * (1.0 - np.exp(-np.abs(x))), id="exponential")])
def test_no_law_of_friction_is_found_in_another_change_of_sign(curve: Callable[[Array], Array]) -> None:
    """v/√(v² + ε²), an arc tangent and an exponential: about as steep as tanh at rest, and the same at speed."""
    assert search(case_with(curve), 2).steps[0].best is None


@pytest.mark.slow
def test_concave_friction_is_still_found_beside_it() -> None:
    """A fifth of the dry friction levels off over 0.3 rad/s, thirty times the speed over which the rest changes its sign; how fast
    is told to two fifths, for a gradual change of sign passes for a part of it."""
    found = search(case_with(lambda x: 0.8 * x / np.sqrt(1.0 + x**2) + 0.2 * np.tanh(x / 30.0)), 1).steps[0].best
    assert found is not None
    assert found.effect.name == "concave_friction"
    assert found.done.model.effects[0].values["speed"] == pytest.approx(0.3, rel=0.4)


@pytest.mark.parametrize(("roundness", "curve"), [
    (2.0, lambda x: x / np.sqrt(1.0 + x**2)), (3.0, lambda x: 2.0 / np.pi * np.arctan(x))])
def test_root_and_arc_tangent_are_met_by_their_sigmoids(roundness: float, curve: Callable[[Array], Array]) -> None:
    """Within an eighth of a per cent of the level at any speed."""
    v = np.concatenate([np.linspace(0.0, 0.1, 2001), np.geomspace(0.1, 10.0, 2001)])
    made = Coulomb(1).speed_curve({"level": 1.0, "sharpness": 100.0, "roundness": roundness})
    np.testing.assert_allclose(made.torque(v), curve(100.0 * v), atol=1.25e-3)


def test_where_slow_samples_are_left_out_the_curve_is_not_asked() -> None:
    """The change of sign is not among the equations then."""
    kept = loosened(prepare(Logs((hidden(1),)), DiagnosisSettings(min_speed=(0.05,)))).columns.laws
    assert [law.free for law in kept if isinstance(law, Coulomb)] == [("sharpness",)] * 3


def test_laws_that_fit_the_curve_or_cannot_are_not_fitted_again() -> None:
    """The whole diagnosis would be done twice for the same answer."""
    prepared = prepare(Logs((hidden(1),)), DiagnosisSettings())
    loose = loosened(prepared)
    assert loose is not prepared
    assert loosened(loose) is loose
    other = replace(prepared, columns=replace(prepared.columns, laws=tuple(ThreeSigmoid(joint) for joint in (1, 2, 3))))
    assert loosened(other) is other


def test_curves_that_leave_no_less_are_no_reason_to_ask_again() -> None:
    """Of a joint that changes its sign by tanh nothing is missed by tanh; by the root it is."""
    for curve, less in ((np.tanh, False), (lambda x: x / np.sqrt(1.0 + x**2), True)):
        prepared = prepare(Logs((hidden(1, changing_by(curve)),)), DiagnosisSettings())
        assert shows(prepared, loosened(prepared)) is less


NO_LIMITS = DiagnosisSettings(limits=False)  # of what `told` stands for there are none


def wrong_law_of(found: Diagnosis) -> bool:
    """After a search for four."""
    return wrong_law(found, 4)


def told(verdict: str, causes: Sequence[str], question: str = "what is wrong", tried: Sequence[str] = (),
         left: Sequence[str] = ()) -> Diagnosis:
    """What `wrong_law` reads of a diagnosis: causes and their joints, named, only tried, and left above thresholds at last."""
    findings, taken, above = ([SimpleNamespace(cause=name, joint=int(joint), parameters={}, accepted=names is not left, gain=0.2,
                                               threshold=0.1, step=5 if names is left else 1)
                               for name, _, joint in (one.partition(":") for one in names)] for names in (causes, tried, left))
    end = SimpleNamespace(cause="spring", joint=1, accepted=False, gain=0.01, threshold=0.1, step=5)
    ledger = [*findings, *taken, *above, end]
    return cast("Diagnosis", SimpleNamespace(verdict=verdict, findings=findings, question=question, nominal=None, ledger=ledger,
                                             held_out="blocks"))


@pytest.mark.parametrize(("causes", "question", "asked"), [
    (("concave_friction:1", "concave_friction:3", "cogging:2"), "what is wrong", True),
    (("concave_friction:1", "stribeck:3", "cogging:2", "cogging:3"), "what is wrong", False),
    (("concave_friction:1", "concave_friction:3"), "what has changed", False)])
def test_one_law_at_several_joints_is_no_fault_of_several_joints(causes: tuple[str, ...], question: str, asked: bool) -> None:
    """Bearings of one make rub by one law; two ripples are two faults, and what was there before is no news."""
    assert wrong_law_of(told("cause", causes, question)) is asked


def test_what_was_found_at_some_of_many_joints_is_asked_again() -> None:
    """Six joints rub by an arc tangent, and a search for four causes ends beside the others without a name for them."""
    assert wrong_law_of(told("unknown", (), tried=("torque_gain:2", "concave_friction:6", "concave_friction:4")))
    assert not wrong_law_of(told("unknown", (), tried=("torque_gain:2", "cogging:6", "cogging:4")))
    assert wrong_law_of(told("unknown", (), tried=("concave_friction:1",)))  # the only joint of an arm of one
    assert not wrong_law_of(told("cause", ("torque_gain:2",), tried=("torque_gain:2", "concave_friction:6", "concave_friction:4")))


def test_what_a_search_for_a_few_causes_leaves_at_several_joints_is_asked_again() -> None:
    """Two joints that are late count once; with three more they make four, and the friction of others is left above thresholds."""
    named = ("time_delay:1", "time_delay:2", "drive_lag:3", "presliding:3", "spring:1")
    assert wrong_law_of(told("cause", named, left=("concave_friction:1", "concave_friction:2")))
    assert not wrong_law_of(told("cause", named, left=("concave_friction:1", "cogging:2", "cogging:3")))
    assert not wrong_law_of(told("cause", named[:4], left=("concave_friction:1", "concave_friction:2")))
    assert not wrong_law(told("cause", named, left=("concave_friction:1", "concave_friction:2")), 5)


def test_what_has_changed_without_a_name_is_asked_again() -> None:
    """Other motion shows more of the curve than the reference logs did."""
    assert wrong_law_of(told("unknown", (), "what has changed"))
    assert not wrong_law_of(told("nothing-wrong", (), "what has changed"))


def test_of_two_diagnoses_the_one_that_finds_less_holds_and_an_answer_before_none() -> None:
    unknown, one, two = told("unknown", ()), told("cause", ("cogging:3",)), told("cause", ("cogging:3", "stribeck:3"))
    well = told("nothing-wrong", ())
    assert plainer_of(two, one) is one
    assert plainer_of(one, two) is one
    assert plainer_of(told("cause", ("concave_friction:1",)), one) is one  # the curve is fitted in the second
    assert plainer_of(unknown, two) is two
    assert plainer_of(unknown, well) is well
    assert plainer_of(two, unknown) is unknown
    changed = told("cause", ("cogging:3", "stribeck:3"), "what has changed")
    assert plainer_of(changed, unknown) is changed
    assert plainer_of(changed, one) is one


@pytest.mark.parametrize(("first", "second", "held"), [
    ((0.010, 0.010), (0.016, 0.010), 0), ((0.010, 0.010), (0.0102, 0.010), 1), ((0.010, 0.016), (0.016, 0.010), 1),
    ((0.016, 0.010), (0.010, 0.010), 1)])
def test_of_the_same_names_the_one_that_leaves_clearly_less_holds(first: tuple[float, ...], second: tuple[float, ...],
                                                                 held: int) -> None:
    """Held out, at some joint, and more at none; else the one whose curve is fitted."""
    both = [told("cause", ("concave_friction:1",)) for _ in range(2)]
    for one, left in zip(both, (first, second), strict=True):
        one.after_rms = SimpleNamespace(validate=np.array(left))  # type: ignore[misc, assignment]
    assert plainer_of(*both) is both[held]


@pytest.mark.parametrize("question", ["what is wrong", "what has changed"])
@pytest.mark.parametrize(("speed", "asked"), [(0.02, True), (0.3, False)])
def test_a_law_that_bends_where_dry_friction_changes_its_sign_is_asked_again(speed: float, asked: bool, question: str) -> None:
    """Two widths of tanh are the curve by which it does; thirty are another law."""
    law = Acting.of(Coulomb(1), {"level": 1.0, "sharpness": 100.0})
    finding = SimpleNamespace(cause="concave_friction", joint=1, parameters={"speed": Value(speed, 0.001, "rad/s")})
    found = SimpleNamespace(verdict="cause", findings=(finding,), question=question, ledger=(),
                            nominal=SimpleNamespace(friction=(law,)))
    assert wrong_law_of(cast("Diagnosis", found)) is asked


@pytest.mark.slow
@pytest.mark.parametrize("stored", [None, cast("Calibration", SimpleNamespace(conditions=SimpleNamespace(laws=())))])
def test_stored_thresholds_are_for_the_other_curve_as_well(stored: Calibration | None, monkeypatch: pytest.MonkeyPatch) -> None:
    """An arm in order whose friction changes its sign by an arc tangent is in order with and without --calibration."""
    asked = []

    def diagnosed(seen: Any, chosen: object, say: object, calibration: object, memory: object) -> Diagnosis:
        free = {law.free for law in seen.prepared.columns.laws if isinstance(law, Coulomb)}
        asked.append((free, calibration))
        return told("cause", () if ("sharpness", "roundness") in free else ("concave_friction:1", "concave_friction:2"))

    monkeypatch.setattr(diagnose_module, "_diagnosed", diagnosed)
    assert len(diagnose_module.diagnose(Logs((hidden(1),)), NO_LIMITS, calibration=stored).findings) == 0
    assert [calibration for _, calibration in asked] == [stored, stored]


@pytest.mark.slow
@pytest.mark.parametrize(("loose", "plain", "asked", "verdict"), [
    (told("cause", ("cogging:1",)), None, [True], "cause"),  # nothing that the laws as they are find could hold
    (told("cause", ("cogging:1", "stribeck:1")), told("nothing-wrong", ()), [True, False], "nothing-wrong"),
    (told("unknown", ()), told("nothing-wrong", ()), [True, False], "nothing-wrong"),
    (told("unknown", ()), told("cause", ("concave_friction:1", "concave_friction:2")), [True, False], "unknown")])
def test_where_the_first_look_shows_one_law_at_several_joints_the_twin_is_made_once(
        loose: Diagnosis, plain: Diagnosis | None, asked: list[bool], verdict: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the laws that fit the curve; those as they are have their turn only where these find several causes, or no name."""
    made = []

    def diagnosed(seen: Any, *rest: object) -> Diagnosis:
        made.append(any("roundness" in law.free for law in seen.prepared.columns.laws))
        return loose if made[-1] else cast("Diagnosis", plain)

    monkeypatch.setattr(diagnose_module, "greatest", lambda rough: [("concave_friction", 1), ("concave_friction", 2)])
    monkeypatch.setattr(diagnose_module, "_diagnosed", diagnosed)
    monkeypatch.setattr(diagnose_module, "limited_by_estimate", lambda found, prepared: found)
    assert diagnose_module.diagnose(Logs((hidden(1),)), NO_LIMITS).verdict == verdict
    assert made == asked


def test_what_was_worked_out_of_the_other_curve_is_worked_out_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The comparison with the reference logs, which is most of the work, is asked for by the first look and by what follows."""
    asked: list[tuple[str, bool, object]] = []

    def is_loose(prepared: Prepared) -> bool:
        return any("roundness" in law.free for law in prepared.columns.laws)

    def looked_at(prepared: Prepared, chosen: object, say: object, calibration: object, memory: object) -> Any:
        asked.append(("look", is_loose(prepared), memory))
        return SimpleNamespace(prepared=prepared, rough=())

    def diagnosed(seen: Any, chosen: object, say: object, calibration: object, memory: object) -> Diagnosis:
        asked.append(("rest", is_loose(seen.prepared), memory))
        return told("cause", () if is_loose(seen.prepared) else ("concave_friction:1", "concave_friction:2"))

    monkeypatch.setattr(diagnose_module, "_looked_at", looked_at)
    monkeypatch.setattr(diagnose_module, "_diagnosed", diagnosed)
    diagnose_module.diagnose(Logs((hidden(1),)), NO_LIMITS)
    assert [one[:2] for one in asked] == [("look", False), ("rest", False), ("look", True), ("rest", True)]
    assert asked[2][2] is asked[3][2]
