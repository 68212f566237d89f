"""What is estimated does not depend on where the samples lie, and is no more than they show."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines import estimate_bps, reconstruct
from pipelines.estimation.nominal import column_in_words
from pipelines.io.files import open_log, write_log
from pipelines.io.log import ExperimentLog
from pipelines.io.model_file import read_model
from pipelines.stage import Request, run_stage
from tests.estimate_bps.estimates import SYMMETRIC, contents, of_elbow, stage
from tests.estimation.experiments import experiment, truth
from tests.healthy import begun, with_signal


def test_derived_logs_give_what_recordings_give(good: ExperimentLog, held_out: ExperimentLog, tmp_path: Path) -> None:
    """`reconstruct` and then `estimate-bps` on its logs: the same result, series and model, in either container and mixed."""
    good, held_out = begun(good, 4000), begun(held_out, 4000)
    direct = contents(stage(tmp_path / "h5", good, held_out).folder)
    assert contents(stage(tmp_path / "parquet", good, held_out, suffix="parquet").folder) == direct
    request = Request((tmp_path / "h5/logs",), out=tmp_path / "motion", no_report=True, format="parquet")
    motion = run_stage(reconstruct.STAGE, request, SYMMETRIC.reconstruction)
    again = Request((motion.folder,), out=tmp_path / "again", no_report=True)
    assert contents(run_stage(estimate_bps.STAGE, again, SYMMETRIC).folder) == direct
    write_log(tmp_path / "mixed/logs/one.h5", open_log(next((motion.folder / "logs").glob("*-0.parquet"))).log)
    write_log(tmp_path / "mixed/logs/two.parquet", held_out)
    mixed = Request((tmp_path / "mixed/logs",), out=tmp_path / "mixed/out", no_report=True)
    assert contents(run_stage(estimate_bps.STAGE, mixed, SYMMETRIC).folder) == direct


def test_its_own_logs_give_the_same_again(good: ExperimentLog, tmp_path: Path) -> None:
    first = stage(tmp_path, good)
    again = Request((first.folder,), out=tmp_path / "again", no_report=True)
    assert contents(run_stage(estimate_bps.STAGE, again, SYMMETRIC).folder) == contents(first.folder)


def test_derived_torques_add_up(good: ExperimentLog, tmp_path: Path) -> None:
    """tau_model is the sum of its parts, and tau_residual what the recording has beside it: the noise of the amplifier."""
    out = stage(tmp_path, good)
    log = open_log(next((out.folder / "logs").iterdir())).log
    parts = sum(log[name] for name in ("tau_inertia", "tau_coriolis", "tau_gravity", "tau_friction_model", "tau_effects"))
    np.testing.assert_allclose(parts, log["tau_model"], atol=1e-12)
    np.testing.assert_allclose(log["tau_model"] + log["tau_residual"], log.tau, atol=1e-12)
    middle = log["tau_residual"][1000:-1000]
    np.testing.assert_allclose(np.median(np.abs(middle), axis=0) / 0.6745, [0.020, 0.010, 0.005], rtol=0.25)


@pytest.mark.row("D09")
def test_a_log_of_one_joint_names_what_it_cannot_show(tmp_path: Path) -> None:
    """D09: only the elbow moves. No number for what is not seen, gate 1, and the same again as null in the JSON."""
    only = np.array([0.0, 0.0, 1.0])
    out = stage(tmp_path, of_elbow(experiment(0, moving=only)), check=True)
    assert out.exit_code == 1
    assert any(check.code == "RRID-D09" and check.gate for check in out.checks)
    printed = {p["name"]: p for p in json.loads((out.folder / "result.json").read_text())["parameters"]}
    lost = {name for name, p in printed.items() if p["value"] is None}
    # what turns with the waist, the shoulder's own inertia and gravity, and the friction of both need those joints to move
    assert {"p1", "p2", "p5", "p6", "p7", "p12", "p14", "coulomb:1:level", "viscous:1:coefficient", "coulomb:2:level"} <= lost
    assert all(printed[name]["std"] is None and not printed[name]["visible"] for name in lost)
    assert not lost & {"p3", "p13", "coulomb:3:level", "viscous:3:coefficient"}  # the elbow's weight and inertia show
    assert all(column_in_words(name) in out.result.unresolved for name in lost)
    assert not any(name in out.result.unresolved for name in lost if ":" in name)  # keys are no words
    for name in set(printed) - lost:
        assert abs(printed[name]["value"] - truth([name])[0]) < 4.0 * printed[name]["std"], name
    stored = read_model(out.folder / "model.json")
    assert {p.name for p in stored.base_parameters if p.std is None} == {n for n in lost if ":" not in n} | {"p4", "p15"}
    assert out.result.physically_consistent is None


@pytest.mark.row("D15")
def test_an_inconsistent_estimate_names_the_link(good: ExperimentLog, tmp_path: Path) -> None:
    """D15: an elbow torque of the wrong sign asks for an elbow of negative inertia."""
    wrong = with_signal(good, tau=good.tau * np.array([1.0, 1.0, -1.0]))
    out = stage(tmp_path, wrong, check=True, settings=replace(SYMMETRIC, skip_sanity_checks=True))
    assert out.exit_code == 1
    (check,) = [c for c in out.checks if c.code == "RRID-D15" and "links" in c.message]
    assert check.gate
    assert good.robot.joints[2].name in check.message
    assert out.result.physically_consistent is False


def test_a_healthy_log_passes_every_gate(good: ExperimentLog, tmp_path: Path) -> None:
    out = stage(tmp_path, good, check=True)
    assert out.exit_code == 0
    assert out.result.physically_consistent is True
    assert out.result.unresolved == ""
