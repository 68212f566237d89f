"""A torque in another scale than the other joints' is told from the rows' common parameters, without a description of the links;
arms with faults of their drives are left to `diagnose`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipelines.dynamics.rrr import rigid_body
from pipelines.estimation.checks.joint_rows import sample_motion
from pipelines.estimation.checks.plausibility import Evidence, plausibility, torque_scale
from pipelines.io.files import open_log
from pipelines.io.log import ExperimentLog
from pipelines.quality.checks import Subject
from tests.faulty import healthy_without_reference
from tests.healthy import good_log, with_signal
from tests.model.estimation.experiments import experiment
from tests.seeds import rarely, seeds


def evidence(log: ExperimentLog) -> Evidence:
    subject = Subject(log)
    motion = sample_motion(subject.good)
    assert motion is not None
    return Evidence(subject, rigid_body(log.robot), motion)


@pytest.fixture(scope="module")
def excited(samples: Path) -> ExperimentLog:
    return open_log(samples / "rrr-healthy/excitation-1.h5").log


def scaled(log: ExperimentLog, joint: int, factor: float) -> ExperimentLog:
    return with_signal(log, tau=log.tau * np.where(np.arange(log.n_joints) == joint, factor, 1.0))


@pytest.mark.parametrize("joint", [0, *rarely(1), 2])
@pytest.mark.parametrize("factor", [0.1, *rarely(0.25), 4.0])
def test_a_torque_in_another_scale_is_measured(excited: ExperimentLog, joint: int, factor: float) -> None:
    found = torque_scale(evidence(scaled(excited, joint, factor)))
    assert found is not None
    assert found.joint == joint
    assert found.factor == pytest.approx(factor, rel=0.03)
    (check,) = [c for c in plausibility(Subject(scaled(excited, joint, factor))) if c.code == "RRID-S15"]
    assert check.gate
    assert f"tau of joint {joint + 1} is {found.factor:.3g} times what the other joints' torques need" in check.message


@pytest.mark.parametrize("joint", range(3))
@pytest.mark.parametrize("factor", [0.8, 1.0, 1.3])
def test_a_gain_is_left_to_diagnose(excited: ExperimentLog, joint: int, factor: float) -> None:
    assert torque_scale(evidence(scaled(excited, joint, factor))) is None


@pytest.mark.parametrize(("joint", "factor"), [(1, 4.0), (2, 0.2)])
def test_of_two_joints_that_move_only_the_ratio_shows(joint: int, factor: float) -> None:
    """The waist is held: which of the other two torques is in another scale, nothing tells, and both are named."""
    log = scaled(experiment(3, moving=np.array([0.0, 1.0, 1.0])), joint, factor)
    found = torque_scale(evidence(log))
    assert found is not None
    scales = dict(((found.joint, found.factor), *found.others))
    assert scales == {joint: pytest.approx(factor, rel=0.05), 3 - joint: pytest.approx(1.0 / factor, rel=0.05)}


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_factor_that_a_load_could_make_is_told_by_the_other_joints(factor: float) -> None:
    """Of links that are described, twice the torque may be a load: not where the other joints do not feel it."""
    found = [c for c in plausibility(Subject(scaled(good_log(), 1, factor))) if c.code == "RRID-S15" and c.level != "ok"]
    assert [c.message.partition(" is")[0] for c in found] == ["tau of joint 2"]


@pytest.mark.parametrize("seed", seeds(6, 2))
def test_an_encoder_in_another_scale_is_no_torque(seed: int) -> None:
    """The angle of joint 1 bends nothing, but its square in the others' centrifugal torque tells it from a torque."""
    log = healthy_without_reference(good_log(seed))
    wrong = with_signal(log, q=log.q * [2.0, 1.0, 1.0])
    (check,) = [c for c in plausibility(Subject(wrong)) if c.code == "RRID-S15"]
    assert check.message.startswith("q of joint 1 fits if multiplied by 0.5")
    assert "its tau" not in check.message


@pytest.mark.parametrize("factor", [0.1, 8.0])
def test_a_waist_that_pushes_too_hard_is_not_blamed_on_its_encoder(excited: ExperimentLog, factor: float) -> None:
    (check,) = [c for c in plausibility(Subject(scaled(excited, 0, factor))) if c.code == "RRID-S15"]
    assert check.message.startswith("tau of joint 1 is")
