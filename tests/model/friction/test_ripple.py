"""A torque of the angle, which no law of friction holds, is told from the friction log itself with its size; else there is none."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pipelines.io.log import ExperimentLog
from pipelines.model.friction.findings import misfits
from pipelines.model.friction.fit import LawEquations, Value
from pipelines.model.friction.joint import JointFit, JointLogs, fit_joint
from pipelines.model.friction.laws import law_named
from pipelines.model.friction.result import joint_result
from pipelines.model.motion import Reconstruction, reconstruct
from pipelines.report.friction_report import ripple_in_words
from tests.model.friction.one_joint import (
    ENCODER,
    INERTIA,
    JOINT,
    NOISE,
    TRUTHS,
    as_log,
    driven,
    recorded,
    torque_plan,
)

_AMPLITUDE, _ORDER = 0.12, 12  # [N m], a tenth of Coulomb friction; waves a turn
_FAST = ("stribeck", "coulomb+viscous")


def cogging(q: float, v: float) -> float:
    return _AMPLITUDE * math.sin(_ORDER * q + 0.7)


def fitted(log: ExperimentLog, law: str = "coulomb+viscous") -> JointFit:
    return fit_joint(JointLogs(JOINT, ((log, reconstruct(log, Reconstruction())),)), 0.02, law_named(law))


def held_back(more: Callable[[float, float], float] | None, seed: int = 1, noise: float = NOISE,
              seconds: float = 20.0) -> ExperimentLog:
    """So many seconds of Coulomb and viscous friction, and `more` [N m] of position and speed."""
    rng, truth = np.random.default_rng([6, seed]), TRUTHS["coulomb+viscous"]
    torque = torque_plan(rng, seconds, truth)
    states = driven(torque + noise * rng.standard_normal(len(torque)), truth.torque, more=more, parts=4)
    return as_log(np.round(states[:, 0] / ENCODER) * ENCODER, torque, f"held-back-{seed}")


def outside(found: JointFit, torque: Callable[[float, float], float]) -> float:
    """What the fitted law cannot take of `torque` in the rows [N m] rms."""
    equations = LawEquations.of(found.stretches, found.fit.joint)
    truth = equations.means(lambda motion, _: np.array([[torque(q, 0.0)] for q in motion.q[:, 0].tolist()]), equations.arms())[:, 0]
    law = found.fit.found.jacobian
    law = law / np.linalg.norm(law, axis=0)
    return float(np.sqrt(np.mean(np.square(truth - law @ np.linalg.lstsq(law, truth, rcond=1e-5)[0]))))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3, 4, 5])
def test_cogging_is_told_with_its_size(seed: int) -> None:
    """A sine along the turn: its order, what it leaves within 3 std and 2 %, and its deviation over the travel within 2 %."""
    log = held_back(cogging, seed)
    found = fitted(log)
    ripple = found.ripple
    assert ripple is not None
    assert ripple.orders[0] == pytest.approx(_ORDER, abs=0.5)
    assert abs(ripple.rms.value - outside(found, cogging)) < min(3.0 * ripple.rms.std, 0.02 * ripple.rms.value)
    q = log.q[:, JOINT - 1]
    truth = float(np.std([cogging(angle, 0.0) for angle in np.linspace(q.min(), q.max(), 2000).tolist()]))
    assert float(np.std(ripple.along.waves)) == pytest.approx(truth, rel=0.02)
    assert ripple.share > 0.8
    assert "about 12 cycles per revolution" in ripple_in_words(joint_result(found, "joint", "varpro"))


def spring(q: float, v: float) -> float:
    return 0.5 * q


def cable(q: float, v: float) -> float:
    """It tightens towards both ends."""
    return 0.3 * q**3


@pytest.mark.slow
def test_a_spring_is_no_more_than_what_is_left() -> None:
    """Gravity takes most of a spring: what it leaves is told, within 3 std, as a torque of the angle, not as waves or cogging."""
    found = fitted(held_back(spring))
    ripple = found.ripple
    assert ripple is not None
    assert 3.0 * ripple.rms.std < ripple.rms.value <= found.fit.found.rms
    assert abs(ripple.rms.value - outside(found, spring)) < 3.0 * ripple.rms.std
    joint = joint_result(found, "joint", "varpro")
    told, (check,) = ripple_in_words(joint), misfits((joint,), "log")
    for words in (told, check.message):
        assert "depends on its angle alone" in words
        assert "waves" not in words
        assert "cog" not in words


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 8))
@pytest.mark.parametrize("torque", [spring, cable])
def test_a_bend_is_told_with_its_size_or_not_at_all(torque: Callable[[float, float], float], seed: int) -> None:
    found = fitted(held_back(torque, seed))
    if found.ripple is not None:
        assert abs(found.ripple.rms.value - outside(found, torque)) < 3.0 * found.ripple.rms.std
        assert 3.0 * found.ripple.rms.std < found.ripple.rms.value <= found.fit.found.rms
        assert "cog" not in ripple_in_words(joint_result(found, "joint", "varpro"))


def test_a_hundred_and_twenty_waves_in_words() -> None:
    """No power of ten stands in a sentence."""
    joint = joint_result(fitted(held_back(lambda q, v: 0.3 * math.sin(120.0 * q), seconds=10.0)), "joint", "varpro")
    (check,) = misfits((joint,), "log")
    for words in (ripple_in_words(joint), check.message):
        assert "about 120 cycles per revolution" in words


@pytest.fixture(scope="module")
def rippled() -> JointFit:
    """An eight times larger ripple than the one above."""
    return fitted(held_back(lambda q, v: 8.0 * cogging(q, v), 4))


def test_value_and_deviation_end_at_one_place(rippled: JointFit) -> None:
    """A deviation of 0.0004 needs the fourth place of its value, be it a zero."""
    joint = joint_result(rippled, "joint", "varpro")
    assert joint.ripple is not None
    ripple = replace(joint.ripple, inertia=Value(0.53002, 0.00037, "kg m^2"))
    (check,) = misfits((replace(joint, inertia=Value(0.5118, 0.0059, "kg m^2"), ripple=ripple),), "log")
    assert "0.512 ± 0.006 kg m^2" in check.message
    assert "0.5300 ± 0.0004 kg m^2" in check.message
    small = replace(joint.ripple, inertia=Value(3.02e-5, 9.6e-6, "kg m^2"))  # one digit of each would be all that is left of them
    (check,) = misfits((replace(joint, inertia=Value(4.1e-5, None, "kg m^2"), ripple=small),), "log")
    assert "0.000041 kg m^2" in check.message
    assert "0.0000302 ± 0.0000096 kg m^2" in check.message


@pytest.mark.slow
def test_friction_by_position_of_a_joint_that_goes_one_way_is_no_ripple() -> None:
    """What turns with the motion is not told from what does not where it never turns."""
    rng, truth = np.random.default_rng(9), TRUTHS["coulomb+viscous"]
    t = np.arange(15_000) * 1e-3
    torque = 2.0 + 0.2 * sum(np.sin(2.0 * np.pi * hz * t) for hz in (0.3, 0.7))
    states = driven(torque + NOISE * rng.standard_normal(len(t)), truth.torque, gravity=(0.0, 0.0), start=(0.0, 3.0), parts=4,
                    more=lambda q, v: 0.3 * math.sin(3.0 * q) * math.tanh(100.0 * v))
    assert states[:, 1].min() > 0.1
    assert fitted(as_log(np.round(states[:, 0] / ENCODER) * ENCODER, torque, "one-way")).ripple is None


def test_inertia_is_right_again_with_the_ripple_known(rippled: JointFit) -> None:
    """The ripple draws the inertia off; with the waves beside the law it is true to 1 %."""
    assert rippled.ripple is not None
    assert rippled.ripple.inertia is not None
    assert rippled.ripple.inertia.value == pytest.approx(INERTIA, rel=0.01)
    assert abs(rippled.fit.inertia - INERTIA) > 2.0 * abs(rippled.ripple.inertia.value - INERTIA)


@pytest.mark.parametrize(("law", "fit"), [pytest.param(law, fit, marks=() if (law, fit) == _FAST else pytest.mark.slow)
                                          for law in TRUTHS for fit in ("coulomb+viscous", "three_sigmoid")])
def test_a_healthy_joint_has_no_ripple(law: str, fit: str) -> None:
    """Six laws of friction, each fitted by a law that is too poor for some of them, and by one that follows most."""
    assert fitted(recorded(law, 7), fit).ripple is None


@pytest.mark.parametrize("seed", [11, *(pytest.param(k, marks=pytest.mark.slow) for k in (12, 13, 14))])
def test_noise_is_no_ripple(seed: int) -> None:
    """Twenty times the noise of torque, so that nearly all that is left is noise."""
    assert fitted(held_back(None, seed, 20.0 * NOISE, 10.0)).ripple is None


@pytest.mark.parametrize("order", [3, pytest.param(1, marks=pytest.mark.slow), pytest.param(12, marks=pytest.mark.slow)])
def test_friction_that_depends_on_position_is_no_ripple(order: int) -> None:
    """It turns with the motion: 40 % of Coulomb friction, more here and less there, is not the same both ways."""
    def uneven(q: float, v: float) -> float:
        return 0.4 * 1.2 * math.sin(order * q) * math.tanh(100.0 * v)

    assert fitted(held_back(uneven, seconds=10.0)).ripple is None


def test_a_ripple_that_matters_to_no_number_is_not_told() -> None:
    """Half a hundredth of the torque, in a log with next to no noise, where it is all that is left."""
    assert fitted(held_back(lambda q, v: 0.06 * cogging(q, v), 5, 1e-4, 10.0)).ripple is None
