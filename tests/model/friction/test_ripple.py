"""Cogging, which no law of friction holds, is told from the friction log itself with its size; a joint without it has none."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from pipelines.log.experiment import ExperimentLog
from pipelines.model.friction.joint import JointFit, JointLogs, fit_joint
from pipelines.model.friction.laws import law_named
from pipelines.model.motion import Reconstruction, reconstruct
from tests.model.friction.one_joint import ENCODER, INERTIA, JOINT, NOISE, TRUTHS, as_log, driven, recorded, torque_plan

_AMPLITUDE, _ORDER = 0.12, 12  # [N m], a tenth of Coulomb friction; waves a turn


def cogging(q: float, v: float) -> float:
    return _AMPLITUDE * math.sin(_ORDER * q + 0.7)


def fitted(log: ExperimentLog, law: str = "coulomb+viscous") -> JointFit:
    return fit_joint(JointLogs(JOINT, ((log, reconstruct(log, Reconstruction())),)), 0.02, law_named(law))


def held_back(more: Callable[[float, float], float] | None, seed: int = 1, noise: float = NOISE) -> ExperimentLog:
    """20 s of Coulomb and viscous friction, and `more` [N m] of position and speed."""
    rng, truth = np.random.default_rng([6, seed]), TRUTHS["coulomb+viscous"]
    torque = torque_plan(rng, 20.0, truth)
    states = driven(torque + noise * rng.standard_normal(len(torque)), truth.torque, more=more)
    return as_log(np.round(states[:, 0] / ENCODER) * ENCODER, torque, f"held-back-{seed}")


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_cogging_is_told_with_its_size(seed: int) -> None:
    """Order and size of a sine along the turn: 12, and its deviation over the travel within 2 % and four standard deviations."""
    log = held_back(cogging, seed)
    ripple = fitted(log).ripple
    assert ripple is not None
    assert ripple.orders[0] == pytest.approx(_ORDER, abs=0.5)
    q = log.q[:, JOINT - 1]
    truth = float(np.std([cogging(angle, 0.0) for angle in np.linspace(q.min(), q.max(), 2000).tolist()]))
    assert abs(ripple.rms - truth) < min(4.0 * ripple.std, 0.02 * truth)
    assert ripple.share > 0.8


def test_inertia_is_right_again_with_the_ripple_known() -> None:
    """An eight times larger ripple than the one above draws the inertia off; with the waves beside the law it is true to 1 %."""
    found = fitted(held_back(lambda q, v: 8.0 * cogging(q, v), 4))
    assert found.beside_ripple is not None
    assert found.beside_ripple.beta[0] == pytest.approx(INERTIA, rel=0.01)
    assert abs(found.fit.inertia - INERTIA) > 2.0 * abs(found.beside_ripple.beta[0] - INERTIA)


@pytest.mark.parametrize("law", list(TRUTHS))
@pytest.mark.parametrize("fit", ["coulomb+viscous", "three_sigmoid"])
def test_a_healthy_joint_has_no_ripple(law: str, fit: str) -> None:
    """Six laws of friction, each fitted by a law that is too poor for some of them, and by one that follows most."""
    assert fitted(recorded(law, 7), fit).ripple is None


@pytest.mark.parametrize("seed", [11, 12, 13, 14])
def test_noise_is_no_ripple(seed: int) -> None:
    """Twenty times the noise of torque, so that nearly all that is left is noise."""
    assert fitted(held_back(None, seed, 20.0 * NOISE)).ripple is None


@pytest.mark.parametrize("order", [1, 3, 12])
def test_friction_that_depends_on_position_is_no_ripple(order: int) -> None:
    """It turns with the motion: 40 % of Coulomb friction, more here and less there, is not the same both ways."""
    def uneven(q: float, v: float) -> float:
        return 0.4 * 1.2 * math.sin(order * q) * math.tanh(100.0 * v)

    assert fitted(held_back(uneven)).ripple is None


def test_a_ripple_that_matters_to_no_number_is_not_told() -> None:
    """Half a hundredth of the torque, in a log with next to no noise, where it is all that is left."""
    assert fitted(held_back(lambda q, v: 0.06 * cogging(q, v), 5, 1e-4)).ripple is None
