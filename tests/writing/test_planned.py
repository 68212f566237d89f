"""A reference as a log: written, read and inspected like any other, in both containers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipelines.dynamics.body import Motion
from pipelines.io.files import open_log, write_log
from pipelines.io.robot_files import load_robot
from pipelines.quality.checks import check_log
from pipelines.writing.task import planned_log, writing_task
from pipelines.writing.via_points import via_points


@pytest.fixture(scope="module")
def motion() -> Motion:
    return writing_task(load_robot("rrr"), "Kostic").sampled(1e-3).motion


@pytest.mark.parametrize("ending", ["h5", "parquet"])
def test_it_comes_back_sample_for_sample(motion: Motion, tmp_path: Path, ending: str) -> None:
    log = planned_log("writing", load_robot("rrr"), motion)
    path = tmp_path / f"writing.{ending}"
    write_log(path, log)
    back = open_log(path).log
    assert back == log
    assert (back.origin, back.experiment, back.role) == ("planned", "writing", "validate")
    for name, values in (("q_ref", motion.q), ("dq_ref", motion.dq), ("ddq_ref", motion.ddq)):
        assert back[name].tobytes() == values.tobytes()
    assert back.sample_time == pytest.approx(1e-3)


def test_the_log_doctor_has_nothing_to_say(motion: Motion) -> None:
    """Neither of a writing reference nor of via points."""
    robot = load_robot("rrr")
    via = via_points(robot, np.random.default_rng(1)).sampled(1e-3)
    for log in (planned_log("writing", robot, motion), planned_log("via", robot, via, experiment="free")):
        assert [check.code for check in check_log(log) if check.level != "ok"] == []
