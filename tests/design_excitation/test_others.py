"""Plans of the other experiments: friction, frequency responses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.inspect import STAGE as DOCTOR
from pipelines.io.files import open_log
from pipelines.io.robot_files import load_robot
from pipelines.stage import Request, run_stage
from tests.design_excitation.short import QUICK, designed


@pytest.mark.parametrize(("purpose", "count"), [("friction", 3), ("frf", 6)])
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


def test_frf_plans_excite_all_joints_at_the_same_odd_lines(tmp_path: Path) -> None:
    """All odd lines, of every joint and realisation; two periods each way where the joint turns."""
    out = designed(tmp_path / "out", replace(QUICK, experiment="frf")).folder
    one, two, other = (open_log(out / f"logs/frf-{name}.h5").log for name in ("2-1", "2-2", "3-1"))
    assert one.period is not None
    period = round(one.period / one.sample_time)
    sizes = []
    for log, j in ((one, 1), (two, 1), (other, 2)):
        steady = np.abs(log["dq_ref"][:, j]) > 0.999 * np.abs(log["dq_ref"][:, j]).max()
        assert steady.sum() >= 2 * (2 * period + 500)
        np.testing.assert_array_equal(log["v"][period:, j], log["v"][:-period, j])
        sizes.append(np.abs(np.fft.rfft(log["v"][:period, j])))
    excited = [np.flatnonzero(size > 1e-6 * size.max()) for size in sizes]
    np.testing.assert_array_equal(excited[0], excited[1])
    np.testing.assert_array_equal(excited[0], excited[2])
    np.testing.assert_array_equal(excited[0], np.arange(9, excited[0][-1] + 1, 2))
    assert abs(np.corrcoef(one["v"][:period, 1], two["v"][:period, 1])[0, 1]) < 0.1
