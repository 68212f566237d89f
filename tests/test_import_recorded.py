"""Both recorded sets become logs that hold what was recorded."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from pipelines.import_log import STAGE, Result, Settings
from pipelines.io.files import open_log
from pipelines.stage import Outcome, Request, run_stage
from tests.importers.good import strict_checker


@pytest.fixture(scope="module")
def checker(shared: Path) -> ModuleType:
    return strict_checker(shared)


def imported(name: str, shared: Path, out: Path) -> Outcome[Result]:
    return run_stage(STAGE, Request((), out, no_report=True), Settings(recipe=name, source=shared / "real" / name))


@pytest.fixture(scope="module")
def tx40(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> Outcome[Result]:
    return imported("tx40", shared, tmp_path_factory.mktemp("tx40") / "out")


@pytest.fixture(scope="module")
def odrive(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> Outcome[Result]:
    return imported("odrive", shared, tmp_path_factory.mktemp("odrive") / "out")


def test_both_recorded_sets_pass_the_strict_checker(tx40: Outcome[Result], odrive: Outcome[Result], checker: ModuleType) -> None:
    for outcome, logs in ((tx40, 1), (odrive, 6)):
        faults = checker.check_folder(outcome.folder)
        assert len(faults) == logs
        assert not any(faults.values()), faults


def test_tx40_is_the_joint_side_of_what_was_recorded(tx40: Outcome[Result], shared: Path) -> None:
    """The numbers of the files, taken through the transmission by hand."""
    log = open_log(tx40.folder / "logs" / "tx40.h5").log
    motor_q, motor_tau = (np.loadtxt(shared / "real" / "tx40" / f, delimiter=",", skiprows=1)
                          for f in ("pos_read_data.csv", "curr_data.csv"))
    ratios = np.array([32.0, 32.0, 45.0, -48.0, 45.0, 32.0])
    q = motor_q / ratios
    q[:, 5] = (motor_q[:, 5] - 32.0 * q[:, 4]) / 32.0
    q[:, 1] -= np.pi / 2
    q[:, 2] += np.pi / 2
    tau = motor_tau * ratios
    tau[:, 4] += 32.0 * motor_tau[:, 5]
    assert np.allclose(log.q, q, rtol=0, atol=1e-13)
    assert np.allclose(log.tau, tau, rtol=1e-13, atol=1e-12)
    assert (log.n_samples, log.sample_time, log.experiment, log.role, log.torque) == (45000, 0.0002, "excitation", "identify",
                                                                                      "measured")
    assert log.derived is None  # units and transmission only
    assert log.robot.drive is not None
    assert log.robot.drive.transmission is not None
    assert log.robot.drive.transmission[5][4] == 32.0


def test_tx40_motors_put_energy_into_every_joint(tx40: Outcome[Result]) -> None:
    """Friction takes it out again: a joint with the wrong sign would show a negative mean power."""
    log = open_log(tx40.folder / "logs" / "tx40.h5").log
    power = (np.gradient(log.q, log.t, axis=0) * log.tau).mean(axis=0)
    assert (power > 5.0).all()


def test_odrive_runs_have_their_roles_and_an_even_grid(odrive: Outcome[Result]) -> None:
    roles = {item.name: item.role for item in odrive.result.logs}
    assert roles == {"nocomp_0": "identify", "nocomp_1": "identify", "nocomp_2": "validate", "slower_nocomp_0": "validate",
                     "comp_0": "validate", "slower_comp_0": "validate"}
    log = open_log(odrive.folder / "logs" / "slower_nocomp_0.h5").log
    assert (log.sample_time, log.experiment, log.n_joints) == (0.0025, "free", 1)
    assert np.allclose(np.diff(log.t), 0.0025, rtol=1e-9)
    assert np.allclose(log.tau, 0.0551 * log["current"])
    assert log.derived is not None
    assert "resampled from 14732 samples 1.449 to 6.057 ms apart (median 2.269 ms) to 13333 at 400 Hz" in log.derived.settings
