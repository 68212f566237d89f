"""Logs that cannot be fitted, or that judge nothing, are refused before anything is suspected."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.errors import InputRejected
from pipelines.estimation.estimate import Recipe
from pipelines.estimation.preparation import Logs, prepare
from pipelines.io.log import ExperimentLog
from tests.diagnose.sessions import session
from tests.healthy import with_signal


@pytest.fixture(scope="module")
def fitted() -> ExperimentLog:
    return session()[0]


@pytest.fixture(scope="module")
def judging() -> ExperimentLog:
    return session()[1]


def held(log: ExperimentLog, *joints: int) -> ExperimentLog:
    """The same, but that these joints (from 1) stay where they were."""
    still = np.isin(np.arange(log.n_joints), np.array(joints) - 1)
    return with_signal(log, q=np.where(still, log.q[0], log.q))


@pytest.mark.parametrize(("of_fitted", "of_judging", "words"), [
    ((2,), (), "joint 2 is held in the logs of role 'identify'"),
    ((), (1, 2, 3), "every joint is held in the logs of role 'validate'")])
def test_logs_in_which_a_joint_does_not_move_say_nothing_of_it(
        of_fitted: tuple[int, ...], of_judging: tuple[int, ...], words: str, fitted: ExperimentLog, judging: ExperimentLog) -> None:
    with pytest.raises(InputRejected, match=f"RRID-T08.*{words}, and moves in others"):
        prepare(Logs((held(fitted, *of_fitted),), (held(judging, *of_judging),)), Recipe())


def test_a_joint_that_moves_in_one_of_them_is_fitted(fitted: ExperimentLog, judging: ExperimentLog) -> None:
    """Free reversals of one joint after the other; and a log that judges only some."""
    prepared = prepare(Logs((held(fitted, 2), held(judging, 1, 3)), (held(judging, 3),)), Recipe())
    assert np.bincount(prepared.data.joint[prepared.data.counts], minlength=3).min() > 0


@pytest.mark.parametrize("left", [0, 3])
def test_a_log_of_which_saturated_torque_leaves_no_row_is_refused(left: int, fitted: ExperimentLog) -> None:
    """Of a few samples between saturated ones none is left when they are thinned out."""
    limit = np.array([joint.torque for joint in fitted.robot.joints])
    tau = np.tile(limit, (fitted.n_samples, 1))
    middle = slice(fitted.n_samples // 2, fitted.n_samples // 2 + left)
    tau[middle] = 0.5 * limit
    with pytest.raises(InputRejected, match="RRID-D05.*no sample is left: saturated torque touches"):
        prepare(Logs((fitted, with_signal(fitted, tau=tau))), Recipe())


@pytest.mark.parametrize(("settings", "words"), [
    (Recipe(min_speed=(20.0, 0.0, 0.0)), "no equation of joint 1 is left: its largest speed is"),
    (Recipe(cutoff_hz=1.0, decimation=200), "equations")])
def test_too_few_equations_are_refused(
        settings: Recipe, words: str, fitted: ExperimentLog, judging: ExperimentLog) -> None:
    with pytest.raises(InputRejected, match=f"RRID-T08.*{words}"):
        prepare(Logs((fitted,), (judging,)), settings)
