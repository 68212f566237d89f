"""`rrrid fit-friction` of joints that were never driven alone: what it leaves of their torque, and what it says of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines import fit_friction, import_log
from pipelines.fit_friction import Settings
from pipelines.friction.result import Result
from pipelines.io.files import Opened, open_log
from pipelines.stage import Inputs, Request, run_stage


def fitted(*opened: Opened, law: str | None = None) -> Result:
    return fit_friction.compute(Inputs(opened, label="logs"), Settings(law=law))


@pytest.fixture(scope="module")
def outrunner(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> Result:
    """The recorded motor, its six runs."""
    request = Request((), tmp_path_factory.mktemp("odrive") / "out", no_report=True)
    done = run_stage(import_log.STAGE, request, import_log.Settings(recipe="odrive", source=shared / "real/odrive"))
    return fitted(*(open_log(path) for path in sorted((done.folder / "logs").glob("*.h5"))), law="coulomb+viscous")


def test_an_outrunner_that_cogs_is_not_called_good(outrunner: Result) -> None:
    """Cogging is nearly all of its torque: the fit is a problem, and a gate that names the command that finds the cause."""
    assert fit_friction.report(outrunner).tone == "bad"
    (check,) = (check for check in outrunner.checks if check.gate)
    assert check.code == "RRID-D19"
    assert "rrrid diagnose" in check.remedy


@pytest.mark.parametrize("law", [pytest.param("three_sigmoid", marks=pytest.mark.slow), "coulomb+viscous"])
def test_joints_that_move_together_and_are_in_order(law: str, samples: Path) -> None:
    """A healthy arm's excitation: nothing is told, of a law that fits and of one that is too poor; one tenth of it is not left."""
    result = fitted(*(open_log(samples / f"rrr-closed-form/excitation-{number}.h5") for number in (1, 2)), law=law)
    assert not result.checks
    assert max(joint.validation.torque_error or 1.0 for joint in result.joints) < 0.1


def test_a_joint_that_its_brake_holds_is_no_fault(samples: Path) -> None:
    """One encoder step of jitter and a torque that is noise: all of it is left, and that says nothing of the joint."""
    opened, rng = open_log(samples / "rrr-closed-form/excitation-1.h5"), np.random.default_rng(3)
    log = opened.log
    q, tau = log.q.copy(), log.tau.copy()
    step = np.diff(np.unique(q[:, 2])).min()
    q[:, 2] = 0.3 + step * rng.integers(0, 2, len(q))
    tau[:, 2] = 0.02 * rng.standard_normal(len(q))
    signals = {key: value for key, value in log.signals.items() if key == "t"}
    signals |= {key: replace(log.signals[key], values=values) for key, values in (("q", q), ("tau", tau))}
    result = fitted(replace(opened, log=replace(log, signals=signals)), law="coulomb+viscous")
    assert [joint.moved for joint in result.joints] == [True, True, False]
    assert result.joints[2].validation.torque_error == pytest.approx(1.0, abs=0.1)
    assert not [check for check in result.checks if check.gate]
    told = fit_friction.report(result)
    assert told.tone == "attention"
    assert "does not move in these logs" in told.verdict


def test_half_of_the_torque_left_is_no_good_fit(outrunner: Result) -> None:
    """What is left of held-out torque alone decides: 5 % is good, 30 % is not, and unknown is not either."""
    (joint,) = outrunner.joints
    for error, tone in ((0.05, "good"), (0.3, "attention"), (None, "attention")):
        judged = replace(joint, validation=replace(joint.validation, torque_error=error))
        assert fit_friction.report(replace(outrunner, joints=(judged,), checks=())).tone == tone
