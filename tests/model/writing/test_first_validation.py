"""The first validation finds how much of a torque the model misses, in which letter, and what one sample at a time gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.io.log import Array, ExperimentLog
from pipelines.model.arm import Arm
from pipelines.model.estimation.outcome import torques
from pipelines.model.motion import Reconstructed, Reconstruction, reconstruct
from pipelines.model.rigid.body import Motion
from pipelines.model.writing.first_validation import (
    FirstValidation,
    first_validation,
    online_validation,
)
from pipelines.model.writing.marks import marks_of, reference_tip
from pipelines.model.writing.reference import writing_task
from sample_logs.make_model import synthetic_arm
from tests.healthy import AMPLIFIER, Path, make_log, with_signal

TEXT = "RID"


@pytest.fixture(scope="module")
def arm() -> Arm:
    return synthetic_arm()


@pytest.fixture(scope="module")
def log(arm: Arm) -> ExperimentLog:
    """The arm of the model along the task, with encoder steps and amplifier noise."""
    task = writing_task(arm.robot, TEXT)

    def path(t: Array) -> tuple[Array, Array, Array]:
        motion = task.motion(np.clip(t, 0.0, task.duration))
        return motion.q, motion.dq, motion.ddq

    def torque(path: Path, t: Array) -> Array:
        return arm.torque(Motion(t, *path(t)))

    log = make_log(path, "writing", duration=task.duration, torque=torque, role="validate")
    t = log.t
    motion = task.motion(t)
    return with_signal(log, q_ref=motion.q, dq_ref=motion.dq, ddq_ref=motion.ddq)


@pytest.fixture(scope="module")
def motion(log: ExperimentLog) -> Reconstructed:
    return reconstruct(log, Reconstruction())


def judged(log: ExperimentLog, motion: Reconstructed, arm: Arm) -> FirstValidation:
    return first_validation(log, motion, arm, torques(arm, log, motion), None, False)


def test_the_true_model_leaves_noise(log: ExperimentLog, motion: Reconstructed, arm: Arm) -> None:
    """What is left is at least the amplifier's noise, and less than 2 % in all: friction turns over in corners within a few
    samples, where a smoother rounds it off."""
    found = judged(log, motion, arm)
    assert (found.rms >= 0.95 * AMPLIFIER).all()
    assert (found.relative_error < 0.02).all()
    np.testing.assert_allclose(found.relative_error, found.rms / np.sqrt(np.mean(log.tau**2, axis=0)), rtol=1e-12)


def test_a_share_that_is_missed_is_that_share(log: ExperimentLog, motion: Reconstructed, arm: Arm) -> None:
    """A drive that gives 5 % more than it is asked for: 5 % of every joint's torque is missed."""
    weak = with_signal(log, tau=log.tau / 1.05)
    found = judged(weak, motion, arm)
    np.testing.assert_allclose(found.relative_error_low_pass, 0.05, rtol=0.05)


@pytest.mark.parametrize(("joint", "letter"), [(1, 1), (2, 2), (3, 3)])
def test_what_is_missed_in_one_letter_is_found_there(log: ExperimentLog, motion: Reconstructed, arm: Arm, joint: int,
                                                     letter: int) -> None:
    """A bump of torque halfway through a letter: the letter, the moment and the height are named."""
    here = np.flatnonzero(marks_of(log, reference_tip(log)).at == letter - 1)
    middle = float(log.t[here[len(here) // 2]])
    tau = log.tau.copy()
    tau[:, joint - 1] += 0.8 * np.exp(-0.5 * ((log.t - middle) / 0.03)**2)
    found = judged(with_signal(log, tau=tau), motion, arm)
    worst = found.largest[joint - 1]
    assert (found.marks, found.text, worst.label) == ("letters", TEXT, f"letter {letter}, '{TEXT[letter - 1]}'")
    assert abs(worst.t - middle) < 0.01
    assert worst.error == pytest.approx(0.8, rel=0.15)


def test_without_a_text_places_have_other_names(log: ExperimentLog, motion: Reconstructed, arm: Arm) -> None:
    """A reference upside down: stretches between standstills; without a reference: stretches of time."""
    joints = log["q_ref"] * [1.0, -1.0, -1.0]
    assert marks_of(log, reference_tip(with_signal(log, q_ref=joints))).kind == "strokes"
    bare = replace(log, signals={name: signal for name, signal in log.signals.items() if "ref" not in name})
    marks = marks_of(bare, reference_tip(bare))
    assert (marks.kind, len(marks.labels)) == ("time", 10)
    found = judged(bare, motion, arm)
    assert found.letters[-1].end == pytest.approx(log.t[-1] - log.t[0])


def test_one_sample_at_a_time_is_the_same_model(log: ExperimentLog, motion: Reconstructed, arm: Arm) -> None:
    """With the motion that a controller logged, the online torque is that of the arrays, and its error is that of that motion."""
    exact = motion.motion
    observed = replace(log, signals={**log.signals, **{
        name: replace(log.signals["q"], values=values) for name, values in
        (("q_obs", exact.q), ("dq_obs", exact.dq), ("ddq_obs", exact.ddq))}})
    online, seconds = online_validation(observed, motion, arm)
    assert (online.observer, seconds > 0.0) == ("the controller's", True)
    assert online.differs <= 1e-12 * np.abs(log.tau).max()
    later, _ = online_validation(log, motion, arm)
    assert later.observer == "a Kalman observer after the fact"
    assert (later.relative_error > online.relative_error).all()


def test_the_largest_miss_is_not_what_filters_make_of_an_end(log: ExperimentLog, motion: Reconstructed, arm: Arm) -> None:
    """A jolt in the last ten milliseconds, beside a smaller one in the middle of the second letter: that one is named."""
    tau = log.tau.copy()
    tau[-10:] += 20.0
    middle = log.n_samples // 2
    tau[middle:middle + 100] += 2.0
    found = judged(with_signal(log, tau=tau), motion, arm)
    assert found.low_pass_hz is not None
    for one in found.largest:
        assert abs(one.t - (log.t[middle + 50] - log.t[0])) < 0.2
        assert log.t[-1] - log.t[0] - one.t > 1.0 / found.low_pass_hz
