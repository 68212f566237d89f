"""A second look in white rows: a ripple below a drive's slow wander, which plain least squares do not tell from it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from pipelines.bench import experiments
from pipelines.bench.faults.cogging import Cogging
from pipelines.bench.machine import draw_machine
from pipelines.bench.session import record
from pipelines.log.experiment import ExperimentLog
from pipelines.model.diagnosis import diagnose as whole
from pipelines.model.diagnosis.answered import told
from pipelines.model.diagnosis.asked.inputs import Logs
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.believed import second_look
from pipelines.model.diagnosis.believed.pruned import NEAR_THE_FLOOR
from pipelines.model.diagnosis.diagnose import diagnose
from pipelines.model.diagnosis.floor.twin import Twin
from pipelines.model.diagnosis.named.verdict import REST_OF_A_LAW, Ruling
from pipelines.model.diagnosis.result import Diagnosis
from tests.diagnose.sessions import but
from tests.model.diagnosis.made_up import FLOOR, effect, left, searched

JOINT = 2
WANDER, FADES = 0.05, 0.1  # [N m] std, [s] in which the drive's zero forgets where it was
RIPPLE = 0.05  # [N m]


def wandering(log: ExperimentLog, seed: int) -> ExperimentLog:
    """The log of a drive whose zero wanders as an autoregression of first order."""
    pole = np.exp(-log.sample_time / FADES)
    white = np.random.default_rng(seed).standard_normal(log.n_samples + 5000)
    tau = log.tau.copy()
    tau[:, JOINT - 1] += WANDER * lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], white)[5000:]
    return replace(log, signals={**log.signals, "tau": replace(log.signals["tau"], values=tau)})


def diagnosed(ripple: float, waves: float, seed: int) -> Diagnosis:
    """Of two excitations of six seconds on an arm that has felt the ripple, so many `waves` a turn."""
    machine = draw_machine(7, "fault")
    faults = (Cogging(JOINT, waves, ripple, phase=0.8, second_phase=2.1),) if ripple else ()
    plans = [replace(experiments.excitation(machine, seed + k, 6.0, 1), name=f"excitation-{k + 1}", role=role)
             for k, role in enumerate(("identify", "validate"))]
    logs = [wandering(log, 10 * seed + k) for k, log in enumerate(record(machine, faults, plans, seed))]
    return diagnose(Logs.by_role(logs), DiagnosisSettings(
        replicas=4, most=2, without=but("cogging", "encoder_eccentricity", "torque_offset"), evidence=False, limits=False))


@pytest.mark.slow
@pytest.mark.parametrize(("waves", "seed"), [(90.0, 4), pytest.param(90.0, 5, marks=pytest.mark.slow)])
def test_a_ripple_below_slow_noise_is_named_at_a_second_look(waves: float, seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """As large as the wander, but quicker. What it brings is told in newton metres of the rows as they are: on the held-out log
    its own power, with its second harmonic, and not that of whitened rows, of which most is noise. What sampling does to numbers
    is told of each arm for itself, and left out here."""
    monkeypatch.setattr(told, "unbiased", lambda found, *_: found)
    found = diagnosed(RIPPLE, waves, seed)
    assert [(one.cause, one.joint) for one in found.findings] == [("cogging", JOINT)]
    size = found.findings[0].parameters["amplitude"]
    assert size.std is not None
    assert abs(size.value - RIPPLE) < 3.0 * size.std < 0.3 * RIPPLE
    gain = found.findings[0].gain.validate_torque_rms
    taken = (gain.before**2 - gain.after**2)[JOINT - 1]
    np.testing.assert_allclose(np.sqrt(taken), RIPPLE / np.sqrt(2.0), rtol=0.3)

    monkeypatch.setattr(whole, "looked_again", lambda done, *_: done)
    once = diagnosed(RIPPLE, waves, seed)
    assert once.verdict == "nothing-wrong"
    np.testing.assert_allclose(found.residual_rms.validate, once.residual_rms.validate)  # of the nominal model of either


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_slow_noise_alone_is_nothing_wrong(seed: int) -> None:
    assert diagnosed(0.0, 0.0, seed).verdict == "nothing-wrong"


@dataclass(frozen=True)
class SimpleFit:
    """What a replica left."""

    rms: Any


def looked(*causes: tuple[Any, Any]) -> Any:
    """A search that names each of these, and what it left of three joints with a floor of 0.01."""
    found = searched(left(0.1, 0.1, 0.01), *causes)
    return SimpleNamespace(found=found, ruling=SimpleNamespace(named=range(len(causes)), reason="", doubts={}))


HUMP, DRAG, OTHER, THERE = effect("stribeck", 1), effect("quadratic_drag", 1), effect("concave_friction", 1), effect("stribeck", 2)


@pytest.mark.parametrize(("first", "second", "believed"), [
    ((), ((HUMP, left(0.011, 0.1, 0.01)),), True),  # where nothing was
    (((HUMP, left(0.02, 0.1, 0.01)),), ((OTHER, left(0.011, 0.1, 0.01)),), True),  # another name, that leaves less
    (((HUMP, left(0.011, 0.1, 0.01)),), ((OTHER, left(0.09, 0.1, 0.01)),), False),  # that explains next to nothing
    (((HUMP, left(0.011, 0.1, 0.01)),), ((THERE, left(0.1, 0.01, 0.01)),), False),  # at another joint alone
    (((HUMP, left(0.02, 0.1, 0.01)),), ((HUMP, left(0.02, 0.1, 0.01)), (THERE, left(0.02, 0.01, 0.01))), True),  # one more
    (((HUMP, left(0.0101, 0.1, 0.01)),), ((HUMP, left(0.0101, 0.1, 0.01)), (DRAG, left(0.01, 0.1, 0.01))), False),  # a trifle more
    (((HUMP, left(0.0101, 0.1, 0.01)), (DRAG, left(0.01, 0.1, 0.01))), ((HUMP, left(0.0101, 0.1, 0.01)),), True),  # a trifle less
    (((HUMP, left(0.0167, 0.1, 0.01)), (DRAG, left(0.01, 0.1, 0.01))), ((HUMP, left(0.0167, 0.1, 0.01)),), False),  # it stands high
    (((HUMP, left(0.02, 0.1, 0.01)), (THERE, left(0.02, 0.01, 0.01))), ((HUMP, left(0.02, 0.1, 0.01)),), False)])  # half of it less
def test_a_second_look_is_believed_where_it_explains_as_much(first: Any, second: Any, believed: bool) -> None:
    assert second_look._believed(looked(*first), looked(*second), FLOOR, np.full(3, 0.02)) is believed


@pytest.mark.parametrize(("why", "named"), [(REST_OF_A_LAW, (0, 2)), ("it takes away less", (0, 1, 2))])
def test_what_was_doubted_beside_much_without_a_name_is_not_named_by_white_rows(why: str, named: tuple[int, ...]) -> None:
    """Cogging in the rest of a friction that differs by direction and passes for an offset: in white rows the joint stands nearer
    to its floor. What they find elsewhere keeps its name."""
    offset, waves = (effect("torque_offset", 1), left(0.02, 0.1, 0.01)), (effect("cogging", 1), left(0.019, 0.1, 0.01))
    first = looked(offset, waves)
    first.ruling.named, first.ruling.doubts = (0,), {1: why}
    found = looked(offset, waves, (THERE, left(0.019, 0.01, 0.01))).found
    ruling = second_look._less_the_rest(Ruling("cause", (0, 1, 2), ""), found, first)
    assert ruling.named == named
    assert set(ruling.doubts) == {0, 1, 2} - set(named)


@pytest.mark.parametrize(("scatter", "elsewhere", "leaves", "believed"), [
    (0.02, 0.02, 0.0107, False), (0.08, 0.02, 0.0107, True), (0.02, 0.5, 0.0107, False), (0.5, 0.5, 0.0117, False)])
def test_a_second_look_leaves_more_by_as_much_as_one_run_of_an_arm_in_order_may(scatter: float, elsewhere: float, leaves: float,
                                                                                believed: bool) -> None:
    """Slow waves at an offset's place fit the wander as well, and leave less than an arm in order; the offset a seventh more. What
    scatters at another joint is no matter, and a third of a floor is too much for chance."""
    waves, offset = effect("cogging", 1), effect("torque_offset", 1)
    first, second = looked((waves, left(0.0093, 0.01, 0.01))), looked((offset, left(leaves, 0.01, 0.01)))
    assert second_look._believed(first, second, FLOOR, np.array([scatter, elsewhere, elsewhere])) is believed


def test_what_one_run_may_leave_by_chance_is_told_by_the_replicas() -> None:
    """White noise of n rows: its power scatters by sqrt(2/n)."""
    noise: Any = None
    fits: list[Any] = [SimpleFit(rms) for rms in np.sqrt(np.random.default_rng(5).chisquare(200.0, (400, 2)) / 200.0)]
    assert Twin(tuple(fits), (0,), noise).scatter == pytest.approx(np.sqrt(2.0 / 200.0), rel=0.15)


@pytest.mark.parametrize(("steps", "even"), [((0.01, 0.01, 0.01), True), ((0.01, 0.02, 0.01), False), ((0.01, 0.01, 0.02), False)])
def test_rows_of_different_spacing_have_no_second_look(steps: tuple[float, float, float], even: bool) -> None:
    """Of fitted, held-out and simulated logs."""
    fitted, held_out, twin = (SimpleNamespace(logs=(SimpleNamespace(rows=50, t=step * np.arange(50)),)) for step in steps)
    case: Any = SimpleNamespace(data=fitted, judge=held_out)
    assert second_look._evenly(case, SimpleNamespace(data=twin)) is even  # type: ignore[arg-type]
    assert second_look._evenly(SimpleNamespace(data=fitted, judge=None), SimpleNamespace(data=fitted))  # type: ignore[arg-type]


@pytest.mark.parametrize(("verdict", "names"), [("unknown", ()), ("cause", (effect("cogging", 1),))])
def test_what_is_unknown_stays_so_and_what_happened_once_is_all(verdict: str, names: tuple[Any, ...],
                                                                monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(second_look, "_in_white", lambda *_: pytest.fail("looked again"))
    done = looked(*((one, left(0.01, 0.1, 0.01)) for one in names))
    done.ruling.verdict = verdict
    case: Any = SimpleNamespace(families=(SimpleNamespace(cause="cogging", event=True),))
    assert second_look.looked_again(done, case, None, None, 4, FLOOR) is done  # type: ignore[arg-type]


def test_what_stands_a_little_above_the_floor_is_looked_at_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Something weak under slow noise may have its name in white rows, whatever first had a part of it."""
    monkeypatch.setattr(second_look, "_in_white", lambda *_: pytest.fail("looked again"))
    monkeypatch.setattr(second_look, "_evenly", lambda *_: True)
    done = looked()
    done.ruling.verdict, done.ruling.reason = "unknown", NEAR_THE_FLOOR
    with pytest.raises(pytest.fail.Exception, match="looked again"):
        second_look.looked_again(done, SimpleNamespace(families=()), None, None, 4, FLOOR)  # type: ignore[arg-type]
