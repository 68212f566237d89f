"""Logs of which the truth is known: the cause, its place and its numbers; nothing where nothing is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pipelines.dynamics.body import Motion
from pipelines.estimation.preparation import Logs
from pipelines.io.log import Array, ExperimentLog
from tests.diagnose.sessions import but
from tests.diagnosis.arms import arm, hidden, wave
from tests.diagnosis.asking import answered, causes, diagnosed, effects
from tests.diagnosis.rotor import turned
from tests.estimation.experiments import VISCOUS
from tests.healthy import begun, with_signal

Load = Callable[[Motion], Array]  # torque (samples, joints) [N m] that a motion costs beside

FEW = ("cogging", "torque_offset", "spring", "time_delay", "quadratic_drag")
SHARP = 100.0  # [s/rad] of the dry friction of these arms


def logs(load: Load | None = None) -> tuple[ExperimentLog, ...]:
    """Two logs to fit and one that judges."""
    roles = ((1, "identify"), (2, "identify"), (3, "validate"))
    return tuple(hidden(seed, load, role) for seed, role in roles)


def short(load: Load) -> list[ExperimentLog]:
    """Four seconds of a log to fit and of one that judges."""
    return [begun(log, 4000) for log in logs(load)[1:]]


@pytest.mark.slow
def test_cogging_is_found_at_its_joint_with_its_numbers() -> None:
    """And what is left is the noise of the drives, 20, 10 and 5 mN m, as far as the low-pass lets it through."""
    found = answered(Logs.by_role(short(wave)), exclude=but("cogging", "torque_offset", "quadratic_drag"))
    assert [(one.cause, one.joint) for one in found.findings] == [("cogging", 2)]
    values = {name: one.value for name, one in found.findings[0].parameters.items()}
    assert values["order"] == pytest.approx(11.0, abs=0.01)
    assert values["amplitude"] == pytest.approx(0.1, rel=0.03)
    assert values["phase"] == pytest.approx(0.6, abs=0.05)
    assert (found.after_rms.identify < np.array([0.012, 0.006, 0.004])).all()


def warming(motion: Motion) -> Array:
    """Joint 2 has 6 N m s/rad of viscous friction more, and loses seven tenths of all it has, with a time constant of 2 s."""
    out, more = np.zeros_like(motion.q), 6.0
    out[:, 1] = (more + 0.7 * (VISCOUS[1] + more) * np.expm1(-motion.t / 2.0)) * motion.dq[:, 1]
    return out


@pytest.mark.slow
def test_a_joint_that_loses_most_of_its_viscous_friction_tells_how_much_and_how_fast() -> None:
    """Both numbers and the friction itself are unknown, and their product acts."""
    found = diagnosed(*logs(warming)[1:], exclude=but("viscous_drift", "quadratic_drag", "load_friction"))
    assert causes(found) == [("viscous_drift", 2)]
    (drift,) = effects(found)
    assert drift.values["relative_change"] == pytest.approx(-0.7, abs=0.02)
    assert drift.values["time_constant"] == pytest.approx(2.0, rel=0.05)


def humps(motion: Motion) -> Array:
    """Every joint has a hump of friction below .1 rad/s (Stribeck), of another size each."""
    v = motion.dq
    return np.array([2.0, 1.5, 0.7]) * np.exp(-(v / 0.1) ** 2) * np.tanh(SHARP * v)


@pytest.mark.slow
def test_a_law_that_all_joints_have_is_named_at_each_with_its_numbers() -> None:
    """No form of friction without a name, and no other law, takes its place."""
    found = diagnosed(*logs(humps), exclude=but("stribeck", "concave_friction", "quadratic_drag"))
    assert sorted(causes(found)) == [("stribeck", 1), ("stribeck", 2), ("stribeck", 3)]
    sizes = {one.effect.joint: one.values for one in effects(found)}
    assert [sizes[joint]["amplitude"] for joint in (1, 2, 3)] == pytest.approx([2.0, 1.5, 0.7], rel=0.02)
    assert [sizes[joint]["speed"] for joint in (1, 2, 3)] == pytest.approx([0.1] * 3, rel=0.02)


def nameless(motion: Motion) -> Array:
    """Weak cogging at joint 2, and at joint 1 a torque that no cause of the library has: it rises and falls with the speed."""
    out = 0.25 * wave(motion)
    out[:, 0] += np.cos(5.0 * motion.dq[:, 0])
    return out


@pytest.mark.slow
def test_what_is_surely_named_is_named_beside_a_larger_torque_without_a_name() -> None:
    found = diagnosed(*logs(nameless), exclude=but("cogging"))
    assert causes(found) == [("cogging", 2)]
    assert "joint 1" in found.decision.reason


@pytest.mark.slow
def test_a_delay_is_fitted_exactly() -> None:
    """Position 3 ms late at joint 3: to first order the torque is a slope, exactly it is another moment."""
    late = 3

    def delayed(log: ExperimentLog) -> ExperimentLog:
        q = log.q.copy()
        q[late:, 2] = q[:-late, 2]
        return with_signal(log, q=q)

    found = diagnosed(*map(delayed, logs()), exclude=but(*FEW))
    assert causes(found) == [("time_delay", 3)]
    assert effects(found)[0].values["delay"] == pytest.approx(0.003, abs=5e-5)


def pushed(motion: Motion) -> Array:
    """A push of 12 N on the tip, three seconds after the start."""
    since, out = (motion.t - 3.0) / 0.3, np.zeros_like(motion.q)
    window = np.where((since > 0.0) & (since < 1.0), np.sin(np.pi * since), 0.0)
    for j in range(3):
        moved = motion.q.copy()
        moved[:, j] += 1e-6
        jacobian = (arm().body.tip(moved) - arm().body.tip(motion.q)) / 1e-6
        out[:, j] = -window * (jacobian @ np.array([0.0, 6.0, 10.0]))
    return out


@pytest.mark.slow
def test_a_push_belongs_to_its_log() -> None:
    """In the second of two logs it is found there, at its time."""
    found = diagnosed(hidden(1), hidden(2, pushed), hidden(3, None, "validate"), exclude=but(*FEW, "contact"))
    assert causes(found) == [("contact", None)]
    push = found.look.selection.end.model.effects[0]
    assert push.log == 1
    assert push.values["start"] == pytest.approx(3.0, abs=0.01)
    assert push.values["force"] == pytest.approx(np.hypot(6.0, 10.0), rel=0.05)


def one_sided(motion: Motion) -> Array:
    """A drag at joint 1, and friction that is larger forwards than backwards."""
    v, out = motion.dq[:, 0], np.zeros_like(motion.q)
    out[:, 0] = 0.3 * v * np.abs(v) + 0.15 * np.abs(np.tanh(SHARP * v))
    return out


@pytest.mark.slow
def test_friction_that_differs_by_direction_is_no_offset() -> None:
    """Beside a drag, which an offset does not tell from it."""
    few = but("torque_offset", "asymmetric_friction", "quadratic_drag")
    found = set(causes(diagnosed(*logs(one_sided), exclude=few)))
    assert found == {("asymmetric_friction", 1), ("quadratic_drag", 1)}


@pytest.mark.slow
def test_a_drive_that_hunts_is_unknown() -> None:
    """A line of 5.3 Hz, whose rate is pulled by a tenth to and fro, follows no signal of the arm."""

    def hunting(motion: Motion) -> Array:
        out = np.zeros_like(motion.q)
        phase = 2.0 * np.pi * 5.3 * motion.t + 2.0 * np.sin(2.0 * np.pi * 0.3 * motion.t)
        out[:, 1] = 0.05 * np.sin(phase)
        return out

    found = diagnosed(*logs(hunting)).decision
    assert (found.verdict, found.causes) == ("unknown", ())


def rotor(waves: dict[float, float], mean: float = 0.65) -> list[float]:
    """Return the first orders that are found of a rotor with these amplitudes [N m] of each order."""
    few = but("cogging", "spring", "torque_offset")
    found = diagnosed(*(turned(seed, waves, 0.0, mean) for seed in (1, 2)), exclude=few, cutoff_hz=40.0)
    return sorted(one.values["order"] for one in effects(found))


@pytest.mark.slow
@pytest.mark.parametrize("mean", [0.65, 0.575])
def test_waves_of_a_rotor_have_whole_orders(mean: float) -> None:
    """Seven waves to a turn and what is four times that, and twelve of another kind; stops at 330° as well."""
    assert rotor({7.0: 0.05, 12.0: 0.014, 28.0: 0.03}, mean) == [7.0, 12.0, 28.0]


def wandering(seed: int, size: float, ripple: float = 0.0) -> ExperimentLog:
    """A rotor with a torque of `size` [N m] rms that follows nothing but chance and remembers itself for a sixth of a second, as
    what a model leaves of a recorded arm does; and a ripple of seven waves a turn."""
    log = turned(seed, {7.0: ripple}, 0.0)
    rng, memory = np.random.default_rng(100 + seed), np.exp(-log.sample_time / 0.15)
    wander = np.zeros(log.n_samples)
    pushes = rng.normal(0.0, size * np.sqrt(1.0 - memory**2), log.n_samples - 1)
    for k, push in enumerate(pushes):
        wander[k + 1] = memory * wander[k] + push
    return with_signal(log, tau=log.tau + wander[:, None])


@pytest.mark.parametrize("seed", [1, *(pytest.param(s, marks=pytest.mark.slow) for s in (11, 21))])
def test_a_torque_that_follows_nothing_has_no_name(seed: int) -> None:
    assert causes(diagnosed(wandering(seed, 0.01), cutoff_hz=40.0)) == []
