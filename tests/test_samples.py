"""The sample logs: what is committed is what the script makes, and it is what its README says."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.dynamics.arm import Arm
from pipelines.io.files import open_log
from pipelines.io.log import ExperimentLog, digest_of
from sample_logs.make_changed import changed_logs
from sample_logs.make_closed_form import (
    SAMPLE_TIME,
    Fourier,
    averaged_torque,
    closed_form_logs,
)
from sample_logs.make_healthy import healthy_logs
from sample_logs.make_model import synthetic_arm
from sample_logs.make_samples import FOLDERS, rounds_alike

FILES = ["excitation-1.h5", "excitation-2.h5", "free-1.h5", "friction-1.h5", "friction-2.h5", "friction-3.h5",
         "hold-1.h5"]


@pytest.fixture(scope="module")
def rebuilt() -> dict[str, ExperimentLog]:
    return closed_form_logs()


@pytest.fixture(scope="module")
def arm() -> Arm:
    return synthetic_arm()


@pytest.fixture(scope="module")
def folder(samples: Path) -> Path:
    return samples / "rrr-closed-form"


def test_committed_logs_are_what_the_script_makes(rebuilt: dict[str, ExperimentLog], folder: Path) -> None:
    """Same files, same content, digest by digest, and nothing to be said on opening them."""
    assert sorted(rebuilt) == FILES == sorted(path.name for path in folder.iterdir())
    for name, log in rebuilt.items():
        opened = open_log(folder / name)
        assert digest_of(opened.log) == digest_of(log), name
        assert not opened.checks


@pytest.mark.parametrize(("name", "made"), [
    ("rrr-healthy/hold-1", healthy_logs), pytest.param("rrr-changed/writing-6", changed_logs, marks=pytest.mark.slow)])
def test_a_bench_log_is_what_the_script_makes(name: str, made: Callable[[str], Iterator[tuple[str, ExperimentLog]]],
                                              samples: Path) -> None:
    """The same digest from the committed file and from the machine recorded anew; by another MuJoCo, or on a processor whose LAPACK
    rounds otherwise, the same motion to the noise."""
    file, log = next(made(name.split("/")[1]))
    assert name.endswith(file.removesuffix(".h5"))
    committed = open_log(samples / f"{name}.h5").log
    if rounds_alike():
        assert digest_of(committed) == digest_of(log)
    assert np.abs(committed.q - log.q).max() < 2e-4


@pytest.mark.slow
@pytest.mark.parametrize("name", FOLDERS)
def test_every_log_is_what_the_script_makes(name: str, samples: Path) -> None:
    """All three folders: the same files, digest by digest where the bench rounds alike."""
    logs = dict(FOLDERS[name]())
    alike = rounds_alike() or name == "rrr-closed-form"
    assert sorted(logs) == sorted(path.name for path in (samples / name).iterdir())
    for file, log in logs.items():
        committed = open_log(samples / name / file).log
        if alike:
            assert digest_of(committed) == digest_of(log), file
        assert np.abs(committed.q - log.q).max() < 2e-4, file


def test_nothing_in_the_changed_logs_tells_what_changed(samples: Path) -> None:
    """Logs from before and after of one experiment differ in name, role, date and samples, and in nothing else."""
    before, after = (open_log(samples / f"rrr-changed/{name}.h5").log for name in ("excitation-3-commissioning", "excitation-3"))
    assert (before.role, after.role) == ("reference", "identify")
    assert before.recorded is not None
    assert after.recorded is not None
    assert before.recorded < after.recorded
    told = {key: getattr(before, key) for key in ("name", "role", "recorded", "signals", "source")}
    assert replace(after, **told) == before
    assert set(after.signals) == set(before.signals)
    assert "link" not in after.robot_text


def test_writing_by_feedback_alone_errs_by_millimetres(samples: Path, arm: Arm) -> None:
    """By 1.1, 1.7 and 4.6 mm in x, y and z, Kostić et al. 2004, Table IV, within a factor of two; with feed-forward far less."""
    spread = []
    for case in (1, 6):
        log = open_log(samples / f"rrr-healthy/writing-{case}.h5").log
        spread.append(1e3 * np.std(arm.body.tip(log.q) - arm.body.tip(log["q_ref"]), axis=0))
    assert (np.abs(np.log2(spread[0] / [1.1, 1.7, 4.6])) < 1.0).all()
    assert (spread[0] / spread[1] > [3.2, 6.9, 4.3]).all()


def test_logs_pass_the_strict_checker(shared: Path, samples: Path) -> None:
    """check_log.py finds no fault."""
    done = subprocess.run([sys.executable, str(shared / "tools" / "check_log.py"), str(samples)], check=False,
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("name", ["excitation-1.h5", "excitation-2.h5"])
def test_excitations_start_from_rest_and_tell_every_parameter(rebuilt: dict[str, ExperimentLog], arm: Arm,
                                                              name: str) -> None:
    """No speed at either end of the period; the 15 columns of the regressor are well apart."""
    log = rebuilt[name]
    assert np.abs(np.diff(log.q[:3], axis=0)).max() <= 2e-5
    assert np.abs(log.q[0] - log.q[-1]).max() <= 1e-4
    dq = np.gradient(log.q, SAMPLE_TIME, axis=0)
    smooth = np.apply_along_axis(lambda x: np.convolve(x, np.ones(15) / 15, "same"), 0, dq)
    ddq = np.gradient(smooth, SAMPLE_TIME, axis=0)
    columns = arm.body.regressor(log.q, dq, ddq)[50:-50].reshape(-1, 15)
    assert np.linalg.cond(columns / np.linalg.norm(columns, axis=0)) < 10
    assert (np.abs(dq) < [joint.velocity for joint in arm.robot.joints]).all()


def test_torque_is_the_mean_over_each_sample(arm: Arm) -> None:
    """Averaging equals a fine integral, and differs from sampling at t_k by far more than its own error."""
    rng = np.random.default_rng(5)
    swing = Fourier(np.zeros(3), rng.normal(size=(3, 5)), rng.normal(size=(3, 5)), 0.5)
    t = np.linspace(0.0, 1.999, 2000)
    fine = (np.arange(400) + 0.5) / 400 * SAMPLE_TIME
    integral = np.stack([arm.torque(swing(one + fine)).mean(axis=0) for one in t[::50]])
    assert np.abs(averaged_torque(arm, swing, t[::50]) - integral).max() < 1e-6
    assert np.abs(arm.torque(swing(t)) - averaged_torque(arm, swing, t)).max() > 0.01
