"""Plans of the other experiments: friction, frequency responses, held postures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.dynamics.arm import Arm
from pipelines.dynamics.base_parameters import BaseArm
from pipelines.inspect import STAGE as DOCTOR
from pipelines.io.files import open_log
from pipelines.io.robot_files import load_robot
from pipelines.stage import Request, run_stage
from tests.design_excitation.short import QUICK, designed


@pytest.mark.parametrize(("purpose", "count"), [("friction", 3), ("frf", 6), ("hold", 8)])
def test_the_other_experiments(purpose: str, count: int, tmp_path: Path) -> None:
    """One log an experiment, each within the limits, its speed and acceleration the derivatives of its position."""
    out = designed(tmp_path / "out", replace(QUICK, experiment=purpose)).folder
    robot = load_robot("rrr")
    paths = sorted((out / "logs").glob("*.h5"))
    assert len(paths) == count
    for path in paths:
        log = open_log(path).log
        assert (log.experiment, log.origin) == (purpose, "planned")
        q, dq, ddq = (log[name] for name in ("q_ref", "dq_ref", "ddq_ref"))
        np.testing.assert_allclose(np.diff(q, axis=0), 0.5e-3 * (dq[1:] + dq[:-1]), atol=2e-6)
        np.testing.assert_allclose(dq[[0, -1]], 0.0, atol=1e-9)
        for j, joint in enumerate(robot.joints):
            assert np.abs(dq[:, j]).max() <= joint.velocity
            assert np.abs(ddq[:, j]).max() <= joint.acceleration
    examined = run_stage(DOCTOR, Request((out,), out=tmp_path / "examined", no_report=True), DOCTOR.settings()).result
    assert [check for check in examined.checks if check.level in ("reject", "repair")] == []


def test_friction_speeds_span_two_decades(tmp_path: Path) -> None:
    """Both directions, each of nine speeds held constant, the slowest a hundredth of the fastest; the others stay."""
    out = designed(tmp_path / "out", replace(QUICK, experiment="friction")).folder
    log = open_log(out / "logs/friction-2.h5").log
    assert log.joint == 2
    assert not np.ptp(log["q_ref"][:, [0, 2]], axis=0).any()
    speed, still = log["dq_ref"][:, 1], np.abs(log["ddq_ref"][:, 1]) < 1e-9
    held = np.unique(np.round(speed[still & (np.abs(speed) > 1e-6)], 6))
    assert len(held) == 18
    np.testing.assert_allclose(held, -held[::-1])
    assert held[-1] / held[9] == pytest.approx(100.0, rel=1e-3)


def test_frf_plans_tell_distortion_from_noise(tmp_path: Path) -> None:
    """Odd lines alone, one of four left out; two realisations on the same lines; two periods each way where the joint turns."""
    out = designed(tmp_path / "out", replace(QUICK, experiment="frf")).folder
    one, two = (open_log(out / f"logs/frf-2-{k}.h5").log for k in (1, 2))
    assert one.period is not None
    period = round(one.period / one.sample_time)
    sizes = []
    for log in (one, two):
        steady = np.abs(log["dq_ref"][:, 1]) > 0.999 * np.abs(log["dq_ref"][:, 1]).max()
        assert steady.sum() >= 2 * (2 * period + 500)
        np.testing.assert_array_equal(log["v"][period:, 1], log["v"][:-period, 1])
        sizes.append(np.abs(np.fft.rfft(log["v"][:period, 1])))
    excited = [np.flatnonzero(size > 1e-6 * size.max()) for size in sizes]
    np.testing.assert_array_equal(excited[0], excited[1])
    assert (excited[0] % 2 == 1).all()
    possible = (excited[0][-1] - excited[0][0]) // 2 + 1
    assert len(excited[0]) / possible == pytest.approx(0.75, abs=0.01)
    assert abs(np.corrcoef(one["v"][:period, 1], two["v"][:period, 1])[0, 1]) < 0.1


def test_held_postures_show_gravity(tmp_path: Path) -> None:
    """Together the postures determine all four parameters of gravity (rank 4, verified.md, section 3)."""
    out = designed(tmp_path / "out", replace(QUICK, experiment="hold")).folder
    postures = np.array([open_log(path).log.posture for path in sorted((out / "logs").glob("*.h5"))])
    body = Arm.from_links(load_robot("rrr")).body
    still = np.zeros_like(postures)
    values = np.linalg.svd(body.regressor(postures, still, still).reshape(-1, 15), compute_uv=False)
    assert (values > 1e-6 * values[0]).sum() == 4
    assert values[3] > 0.1 * values[0]
    p = BaseArm(body.robot).known_parameters()
    assert p is not None
    tau = BaseArm(body.robot).torque(postures, still, still, p)
    assert (np.abs(tau) <= 0.9 * np.array([60.0, 30.0, 15.0])).all()
