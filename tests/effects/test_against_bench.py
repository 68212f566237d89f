"""Effects against faults of the same name on MuJoCo's plant, which shares no code with them: signs, units and exact forms.

The same sealed answers that a diagnosis is judged by are put into the effect. What it then says of the log's torque, and of the
motion in closed loop, must be what the fault did.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.plant import as_log
from pipelines.dynamics.arm import Acting, Arm
from pipelines.effects.base import Effect
from pipelines.effects.bodies import LinkLength
from pipelines.effects.contact import Contact
from pipelines.io.log import Array
from pipelines.simulation import Experiment, Plant, run
from tests.effects.on_bench import (
    arm,
    effect_of,
    fault,
    faulty,
    healthy,
    left_over,
    machine,
    motion_and_torque,
    planned,
    rms,
)
from tests.seeds import rarely

SAMPLES = 400  # simulated
SHARE = 0.02  # of what a fault does to the torque may stay unexplained, beside what the healthy arm leaves

CASES = (("cogging", 2), ("viscous_drift", 1), ("torque_gain", 3), ("torque_saturation", 2), ("torque_crosstalk", 3),
         ("drive_lag", 1), ("torque_lag", 2), ("transmission_coupling", 3), ("payload", None), ("contact", None),
         ("spring", 1), ("gravity_tilt", None), ("link_length", None), ("torque_offset", 3), ("load_friction", 2),
         ("quadratic_drag", 1), ("rotor_inertia", 3))
LONG = (("contact", None), ("gravity_tilt", None))  # simulated for longer
NO_MOTION = {"torque_lag"}  # it changes the log, not what the arm does
NO_OPPOSITE = {"torque_saturation", "link_length", "payload"}  # a limit is positive; what fits of base parameters tell has no sign

every_case = pytest.mark.parametrize(("name", "joint"), CASES, ids=[name for name, _ in CASES])


def fitted(name: str, joint: int | None) -> tuple[Arm, Effect, dict[str, float]]:
    """Arm, effect and values: those of the sealed answer, and the numbers fitted that no answer gives.

    The bench's spring is no polynomial; where the weight of a tilted waist lies, and the base parameters on a link of another
    length, a level arm and a wrong length do not tell.
    """
    effect, values = effect_of(name, joint)
    if name in FITTED:
        return FITTED[name](effect, values)
    return arm(), effect, values


def _spring(effect: Effect, values: dict[str, float]) -> tuple[Arm, Effect, dict[str, float]]:
    motion, tau = motion_and_torque(faulty("spring", effect.joint))
    table = effect.columns(motion, arm())[:, (effect.joint or 1) - 1]
    amplitudes = np.linalg.lstsq(table, effect.own(tau - arm().torque(motion)), rcond=None)[0]
    return arm(), effect, effect.values(amplitudes.tolist())


def _tilt(effect: Effect, values: dict[str, float]) -> tuple[Arm, Effect, dict[str, float]]:
    motion, tau = motion_and_torque(faulty("gravity_tilt", None))
    left = (tau - effect.apply(motion, arm(), values))[:, 0]
    sine, cosine = np.linalg.lstsq(effect.columns(motion, arm())[:, 0, 2:], left, rcond=None)[0].tolist()
    return arm(), effect, values | {"waist_sine": sine, "waist_cosine": cosine}


def _length(effect: Effect, values: dict[str, float]) -> tuple[Arm, Effect, dict[str, float]]:
    """Base parameters p with which the model that has the sealed length fits: its torque is linear in them."""
    motion, tau = motion_and_torque(faulty("link_length", None))
    friction = arm().friction_torque(motion)
    columns = [effect.apply(motion, with_parameters(unit), values) - friction for unit in np.eye(len(arm().p))]
    p = np.linalg.lstsq(np.stack(columns, axis=-1).reshape(-1, len(arm().p)), (tau - friction).ravel(), rcond=1e-10)[0]
    return with_parameters(np.asarray(p, dtype=np.float64)), effect, values


FITTED = {"spring": _spring, "gravity_tilt": _tilt, "link_length": _length}


def with_parameters(p: Array) -> Arm:
    return replace(arm(), base=tuple(replace(one, value=float(x)) for one, x in zip(arm().base, p, strict=True)))


def floor() -> float:
    """What is left of a healthy log: friction's change of sign between two samples."""
    motion, _ = motion_and_torque(healthy())
    return rms(left_over(healthy(), arm().torque(motion)))


@every_case
def test_the_log_of_a_faulty_machine_is_explained(name: str, joint: int | None) -> None:
    """More than 99.9 % of the power that the fault adds to the torque, with the numbers of the sealed answer."""
    model, effect, values = fitted(name, joint)
    recording = faulty(name, joint)
    motion, _ = motion_and_torque(recording)
    before, after = (rms(left_over(recording, torque)) for torque in (arm().torque(motion), effect.apply(motion, model, values)))
    assert before > 3.0 * floor()
    assert after <= SHARE * before + 1.2 * floor(), after / before


@pytest.mark.parametrize(("name", "joint"), [case for case in CASES if case[0] not in NO_OPPOSITE], ids=lambda x: str(x))
def test_the_opposite_sign_is_wrong(name: str, joint: int | None) -> None:
    """The other way round the effect makes the residual larger: no sign is right by chance."""
    model, effect, values = fitted(name, joint)
    recording = faulty(name, joint)
    motion, _ = motion_and_torque(recording)
    change = effect.apply(motion, model, values) - model.torque(motion)
    assert rms(left_over(recording, model.torque(motion) - change)) > 1.5 * rms(left_over(recording, model.torque(motion)))


@pytest.mark.parametrize(("name", "joint"), [
    *(case for case in CASES if case not in LONG and case[0] not in NO_MOTION), *rarely(*LONG)], ids=lambda x: str(x))
def test_the_closed_loop_does_what_the_faulty_machine_does(name: str, joint: int | None) -> None:
    """Position under the same controller and reference: the difference that the fault makes is simulated to 3 %."""
    model, effect, values = fitted(name, joint)
    recording = faulty(name, joint)
    log = as_log(machine(), planned(), recording)
    simulated = run(Plant.of(model.extended(Acting.of(effect, values))), Experiment.of_log(log).part(0, SAMPLES), 4)
    made = rms((recording.q - healthy().q)[:SAMPLES])
    assert made > 1e-6
    assert rms(simulated.q[0] - recording.q[:SAMPLES]) <= 0.03 * made


def test_a_lagging_recorder_is_simulated() -> None:
    """The arm does the same; the log differs, as the faulty machine's does."""
    model, effect, values = fitted("torque_lag", 2)
    recording = faulty("torque_lag", 2)
    log = as_log(machine(), planned(), recording)
    simulated = run(Plant.of(model.extended(Acting.of(effect, values))), Experiment.of_log(log).part(0, SAMPLES), 4)
    np.testing.assert_allclose(simulated.q[0], healthy().q[:SAMPLES], atol=1e-9)
    made = rms((recording.tau - healthy().tau)[:SAMPLES])
    assert rms(simulated.tau[0] - recording.tau[:SAMPLES]) <= 1e-3 * made


def test_the_length_that_fits_best_is_the_true_one() -> None:
    """With base parameters refitted at each, the sealed length leaves less than 5 mm more or less, which leave less than none."""
    effect, values = effect_of("link_length", None)
    motion, _ = motion_and_torque(faulty("link_length", None))
    left = []
    for error in (0.0, values["error"] - 5e-3, values["error"], values["error"] + 5e-3):
        model, _, tried = _length(effect, values | {"error": error})
        left.append(rms(left_over(faulty("link_length", None), effect.apply(motion, model, tried))))
    assert left[2] < min(left) + 1e-15
    assert left[2] < 0.5 * min(left[1], left[3]) + floor()
    assert isinstance(effect, LinkLength)


def test_a_touch_is_looked_for_where_it_was() -> None:
    """Among the windows that the residual speaks for is one that overlaps the touch by two thirds."""
    motion, tau = motion_and_torque(faulty("contact", None))
    told = fault("contact", None).parameters()
    begin, lasting = float(told["start"]), float(told["duration"])  # type: ignore[arg-type]
    shared = [min(begin + lasting, one.start + one.duration) - max(begin, one.start)
              for one in Contact().promising(motion, arm(), tau - arm().torque(motion))]
    assert max(shared) > 0.66 * lasting
