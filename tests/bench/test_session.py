"""Recorded logs: of the format, neutral, fit to be read by every stage, and the answers apart."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench import experiments
from bench.draw import draw_machine
from bench.experiments import Experiment
from bench.faults import fault_names, make
from bench.machine import Machine
from bench.plant import answer, record
from pipelines.io.files import write_log
from pipelines.io.log import ExperimentLog
from tests.bench.link_model import LinkModel
from tests.bench.machines import CENTRE, sway


@pytest.fixture(scope="module")
def machine() -> Machine:
    return draw_machine(21, "fault")


@pytest.fixture(scope="module")
def plans(machine: Machine) -> list[Experiment]:
    model = LinkModel(machine)
    writing = experiments.writing(sway(0.5), model)
    return [
        experiments.excitation(machine, 1, period=1.0, periods=1),
        experiments.free(machine, 1, duration=0.5),
        experiments.hold(CENTRE, duration=0.5),
        *(experiments.friction(machine, j, 1, duration=1.0) for j in (1, 2, 3)),
        experiments.reversal(machine, 2, duration=1.0),
        writing[0].before(),
        *writing[1:],
        *(
            experiments.frf(machine, j, experiments.frf_postures(machine)[0], model, duration=2.0)
            for j in (1, 2, 3)
        ),
    ]


@pytest.fixture(scope="module")
def logs(machine: Machine, plans: list[Experiment]) -> list[ExperimentLog]:
    return record(machine, [], plans, seed=3)


@pytest.fixture(scope="module")
def of_a_moment(machine: Machine) -> tuple[Experiment, ExperimentLog]:
    """Record a short experiment on the healthy machine."""
    moment = experiments.free(machine, 1, duration=0.1)
    return moment, record(machine, [], [moment], seed=3)[0]


def test_logs_pass_the_strict_checker(
    logs: list[ExperimentLog], shared: Path, tmp_path: Path
) -> None:
    """check_log.py finds no fault."""
    import subprocess
    import sys

    for log in logs:
        write_log(tmp_path / f"{log.name}.h5", log)
    done = subprocess.run(
        [sys.executable, str(shared / "tools" / "check_log.py"), str(tmp_path)],
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_kind_of_experiment_is_there(logs: list[ExperimentLog]) -> None:
    assert {log.experiment for log in logs} == {
        "excitation",
        "free",
        "hold",
        "friction",
        "writing",
        "frf",
    }
    assert {log.role for log in logs} == {"identify", "validate", "reference"}
    assert len({log.name for log in logs}) == len(logs)


@pytest.mark.parametrize("name", fault_names())
def test_nothing_in_a_log_tells_the_fault(
    name: str, machine: Machine, of_a_moment: tuple[Experiment, ExperimentLog]
) -> None:
    """But for the samples, the log of a sick machine is that of the healthy one; its numbers have
    the same steps.
    """
    moment, well = of_a_moment
    (sick,) = record(machine, [make(name, machine, 2)], [moment], seed=3)
    assert list(well.signals) == list(sick.signals)
    assert replace(sick, signals=well.signals) == well
    assert "link" not in sick.robot_text
    for values, step in ((sick.q, 1e-5), (sick.tau, np.array(machine.torque_resolution))):
        assert np.abs(values / step - np.round(values / step)).max() < 1e-6


@pytest.mark.parametrize(
    "joint", [pytest.param(1, marks=pytest.mark.slow), 2, pytest.param(3, marks=pytest.mark.slow)]
)
def test_friction_logs_go_through_two_decades_of_speed_both_ways(
    joint: int, machine: Machine
) -> None:
    """Of the open joint alone; the held ones stay within 0.05 rad of where they are."""
    (log,) = record(machine, [], [experiments.friction(machine, joint, 2, duration=5.0)])
    speed = np.gradient(log.q[:, joint - 1], 1e-3)
    for way in (speed, -speed):
        moving = way[way > 0.01]
        assert np.quantile(moving, 0.99) > 30.0 * np.quantile(moving, 0.05)
    held = np.delete(log.q, joint - 1, axis=1)
    assert np.ptp(held, axis=0).max() < 0.05
    assert (np.delete(log.controller.kp, joint - 1) > 0).all()  # type: ignore[union-attr, arg-type]


def test_answers_are_named_as_findings_are(machine: Machine) -> None:
    """Cause, joint and parameters."""
    found: Any = answer([make("cogging", machine, 2)])[0]
    assert (found["cause"], found["joint"]) == ("cogging", 2)
    assert {"order", "amplitude", "phase"} <= set(found["parameters"])
