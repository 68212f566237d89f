"""The first validation finds how much of a torque the model misses, in which letter, and what one sample at a time gives."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.dynamics.arm import Arm
from pipelines.dynamics.body import Motion
from pipelines.estimation.motion import Reconstructed, Reconstruction, reconstruct
from pipelines.estimation.result import torques
from pipelines.io.log import Array, ExperimentLog
from pipelines.writing.task import writing_task
from pipelines.writing.validation import TorqueValidation, torque_validation
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


def judged(log: ExperimentLog, motion: Reconstructed, arm: Arm) -> TorqueValidation:
    return torque_validation(log, motion, torques(arm, log, motion), False)


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
