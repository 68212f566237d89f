"""What stands since the reference logs has the shape and the size that these say, and other causes act on it as well."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from pipelines.log import shared_work
from pipelines.log.experiment import Array, ExperimentLog
from pipelines.model.arm import Acting
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.extend import extend
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.given.since import Since, since_reference
from pipelines.model.diagnosis.reference.standing import Chosen
from pipelines.model.diagnosis.reference.standing_shapes import fitted_shapes
from pipelines.model.diagnosis.searched.wanted import Wanted
from pipelines.model.effects import effect_names
from pipelines.model.effects.stribeck import Stribeck
from pipelines.model.effects.torque_gain import TorqueGain
from pipelines.model.rigid.body import Motion
from tests.model.diagnosis.arms import hidden

SETTINGS = DiagnosisSettings(without=tuple(name for name in effect_names() if name != "stribeck"), evidence=False, limits=False)
AMPLITUDE, SPEED, SHARPNESS = 1.2, 0.23, 100.0  # [N m], [rad/s], [s/rad]
NOISE = np.array([0.012, 0.006, 0.004])  # [N m] more than a low-pass leaves of it


def hump(motion: Motion, size: float) -> Array:
    """Friction of joint 2 at low speed, between two of the speeds that a screening tries."""
    v, out = motion.dq[:, 1], np.zeros_like(motion.q)
    out[:, 1] = size * np.exp(-((v / SPEED) ** 2)) * np.tanh(SHARPNESS * v)
    return out


def wide(motion: Motion) -> Array:
    """The same with a tail."""
    v, out = motion.dq[:, 1], np.zeros_like(motion.q)
    out[:, 1] = AMPLITUDE / (1.0 + (v / SPEED) ** 2) * np.tanh(SHARPNESS * v)
    return out


def log_of(seed: int, role: str, size: float = AMPLITUDE) -> ExperimentLog:
    load: Callable[[Motion], Array] = partial(hump, size=size)
    log = hidden(seed, load)
    return replace(log, role=role, name=f"{role}-{seed}")


@pytest.fixture(scope="module")
def grown() -> Since:
    """Twice as much of it in the later logs."""
    logs = Logs((log_of(1, "identify", 2.0 * AMPLITUDE),), (), (log_of(4, "reference"), log_of(5, "reference")))
    prepared = prepare(logs, SETTINGS)
    assert prepared.reference is not None
    return since_reference(prepared, prepared.reference, SETTINGS)


def test_it_has_the_shape_and_the_size_that_the_reference_logs_say(grown: Since) -> None:
    assert [(one.cause, one.joint) for one in grown.standing] == [("stribeck", 2)]
    values = grown.acting[0].values
    assert values["speed"] == pytest.approx(SPEED, rel=0.03)
    assert values["amplitude"] == pytest.approx(AMPLITUDE, rel=0.05)


def test_forms_fitted_by_two_processes_are_those_that_one_fits(monkeypatch: pytest.MonkeyPatch) -> None:
    """To the last bit: a hump with another tail than the one that was chosen."""
    data = prepare(Logs((hidden(4, wide), hidden(5, wide))), SETTINGS)
    columns, fit = fit_nominal(data.data, data.columns)
    chosen = [Chosen(Stribeck(2, speed=SPEED, sharpness=SHARPNESS), 0.1, np.array([AMPLITUDE]))]
    monkeypatch.setattr("multiprocessing.parent_process", lambda: None)
    found = []
    for count in (1, 2):
        monkeypatch.setattr(shared_work, "processors", lambda count=count: count)
        (one,), laws, beta = fitted_shapes(chosen, columns, fit)
        found.append((one.effect, one.amplitudes.tolist(), laws.laws, beta.tolist()))
    assert found[0] == found[1]
    assert found[0][0] != Stribeck(2, speed=SPEED, sharpness=SHARPNESS)


def test_the_reference_logs_then_leave_noise(grown: Since) -> None:
    assert (grown.floor < NOISE).all()


def test_a_drive_that_gives_too_little_gives_too_little_of_what_stands() -> None:
    """Torque of joint 2 and what stands beside it, scaled; less what was subtracted from the rows, which is the whole of it."""
    prepared = prepare(Logs((hidden(1),)), SETTINGS)
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    values = {"amplitude": AMPLITUDE, "speed": SPEED, "sharpness": SHARPNESS, "tail": 0.0, "exponent": 2.0}
    beside = replace(Exact.start(columns, fit), standing=(Acting.of(Stribeck(2), values),))
    model = beside.with_effect(TorqueGain(2), np.array([-0.2]))
    done = prepared.data.lay(lambda motion: model.nominal.torque(motion) * np.array([1.0, 0.8, 1.0])
                             + hump(motion, AMPLITUDE) * -0.2)
    np.testing.assert_allclose(model.torque(prepared.data), done, atol=1e-9 * np.abs(done).max())


@pytest.mark.slow
def test_what_stands_is_no_extension() -> None:
    """Who asks for it is told that it is in the model already; no model is written for it."""
    logs = Logs((log_of(1, "identify"),), (log_of(2, "validate"),), (log_of(4, "reference"), log_of(5, "reference")))
    found = extend(logs, (Wanted(Stribeck(2)),), SETTINGS)
    assert found.arm is None
    assert [(one.cause, one.joint) for one in found.rejected] == [("stribeck", 2)]
    assert "stands in the model already" in found.rejected[0].reason
