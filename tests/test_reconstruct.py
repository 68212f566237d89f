"""Reconstruct as a stage: what it writes can be trusted, what it reports holds, and what is wrong with a log is said."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from pipelines import reconstruct
from pipelines.errors import InputRejected, NothingMatched
from pipelines.estimation.chain import held_input, transition
from pipelines.estimation.motion import Reconstruction
from pipelines.estimation.motion import reconstruct as motion_of
from pipelines.io.files import open_log, write_log
from pipelines.io.log import ExperimentLog, recording
from pipelines.stage import Outcome, Request, run_stage
from tests.cli.commands import rrrid
from tests.fault_table import FAULTS
from tests.faulty import good_path
from tests.healthy import AMPLIFIER, ENCODER, good_log, make_log, rest

Settings = reconstruct.Settings


def stage(folder: Path, *logs: ExperimentLog, settings: Reconstruction | None = None, report: bool = False,
          container: str = "h5", strict: bool = False) -> Outcome[reconstruct.Result]:
    paths = [folder / f"log-{k}.h5" for k in range(len(logs))]
    for path, log in zip(paths, logs, strict=True):
        write_log(path, log)
    request = Request(tuple(paths), out=folder / "out", no_report=not report, format=container, strict=strict)
    return run_stage(reconstruct.STAGE, request, settings or Settings())


@pytest.fixture(scope="module")
def sampled(tmp_path_factory: pytest.TempPathFactory) -> Outcome[reconstruct.Result]:
    folder = Path(__file__).resolve().parents[1] / "sample_logs/rrr-closed-form"
    request = Request((folder,), out=tmp_path_factory.mktemp("samples") / "out", no_report=True)
    return run_stage(reconstruct.STAGE, request, Settings())


def test_measured_minus_reconstructed_is_below_the_papers(sampled: Outcome[reconstruct.Result]) -> None:
    """Fig. 10(a): at most 5e-4 rad on every RRR log; in fact within an encoder step."""
    assert len(sampled.result.logs) == 7
    for log in sampled.result.logs:
        assert (log.reconstruction_error_max <= 5e-4).all(), log.name
        assert (log.reconstruction_error_max <= ENCODER).all(), log.name
    assert (sampled.result.reconstruction_error_max <= 5e-4).all()


def test_gains_are_those_of_the_riccati_equation(tmp_path: Path) -> None:
    """The result's gains follow from its own jerk, noise and sample time by (18)-(20)."""
    o = stage(tmp_path, good_log(), settings=Settings(order=3)).result.observer
    for j in range(3):
        e, g = transition(o.order, np.array(o.sample_time)), held_input(o.order, np.array(o.sample_time))
        r = o.measurement_std[j] ** 2
        p = solve_discrete_are(e.T, np.eye(o.order)[:, :1], o.jerk_std[j] ** 2 * np.outer(g, g), np.array([[r]]))
        np.testing.assert_allclose(o.gains[j], p[:, 0] / (p[0, 0] + r), rtol=1e-6)


@pytest.mark.parametrize("container", ["h5", "parquet"])
def test_a_derived_log_is_a_log(container: str, shared: Path, tmp_path: Path) -> None:
    """It holds its recording bit for bit, passes the strict checker and is trusted by whoever asks for the same motion."""
    log = good_log(period=5.0)
    folder = stage(tmp_path, log, container=container).folder
    (path,) = (folder / "logs").iterdir()
    assert path.suffix == f".{container}"
    derived = open_log(path).log
    assert recording(derived) == log
    assert motion_of(derived, Settings()).derived
    fresh, taken = motion_of(log, Settings()), motion_of(derived, Settings())
    for name, values in fresh.signals().items():
        assert np.array_equal(values, derived[name])
        assert np.array_equal(values, taken.signals()[name])
    assert not motion_of(derived, Settings(order=3)).derived
    if container == "h5":
        done = subprocess.run([sys.executable, shared / "tools/check_log.py", path], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout


REJECTED = [f.row for f in FAULTS if f.row[0] in "TD" and f.level == "reject"]
# what only torque and motion together show (T06, D09) is no matter of reconstruction
MENDED = [f.row for f in FAULTS if f.row[0] in "TD" and f.level in ("repair", "warn") and f.row[:3] not in ("T06", "D09")]


@pytest.mark.parametrize("row", REJECTED)
def test_what_the_doctor_rejects_is_rejected(row: str, tmp_path: Path) -> None:
    """Exit 3 with the doctor's own code, and nothing is written."""
    fault = next(f for f in FAULTS if f.row == row)
    with pytest.raises(InputRejected) as refused:
        stage(tmp_path, fault.make(good_log()))
    assert refused.value.code == fault.code
    assert refused.value.remedy
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("row", [pytest.param(row, marks=pytest.mark.slow if k % 6 else ()) for k, row in enumerate(MENDED)])
def test_what_the_doctor_mends_is_reconstructed_and_said(row: str, tmp_path: Path) -> None:
    """Exit 0; the finding stands in the result; the motion is finite at every sample; with --strict a repair is an error."""
    fault = next(f for f in FAULTS if f.row == row)
    log = fault.make(good_log())
    outcome = stage(tmp_path / "a", log)
    assert fault.code in {check["code"] for check in outcome.json["checks"]}
    derived = open_log(outcome.folder / "logs/log-0.h5").log
    assert recording(derived) == log
    for name in ("q_hat", "dq_hat", "ddq_hat", "q_hat_std", "dq_hat_std", "ddq_hat_std"):
        assert np.isfinite(derived[name]).all()
    if fault.level == "repair":
        with pytest.raises(InputRejected, match=fault.code):
            stage(tmp_path / "b", log, strict=True)


def test_periods_tell_the_noise(tmp_path: Path) -> None:
    """Three periods: their scatter is the noise that was put in, encoder steps and amplifier noise, within 5 %."""
    log = make_log(good_path(), duration=15.0, period=5.0)
    floor = stage(tmp_path, log).result.logs[0].noise_floor
    assert floor is not None
    assert floor.periods == 3
    np.testing.assert_allclose(floor.position, np.hypot(ENCODER / np.sqrt(12), 3e-6), rtol=0.05)
    counts = np.array([60.0, 30.0, 15.0]) / 4096
    np.testing.assert_allclose(floor.torque, np.hypot(counts / np.sqrt(12), AMPLIFIER), rtol=0.05)
    assert stage(tmp_path / "one", make_log(good_path(), period=5.0)).result.logs[0].noise_floor is None


def test_innovations_are_judged(tmp_path: Path) -> None:
    """A bandwidth far too low is seen: the innovations are coloured, and the words say so; a joint at rest is not judged."""
    tuned = stage(tmp_path / "a", good_log()).result.logs[0]
    stiff = stage(tmp_path / "b", good_log(), settings=Settings(bandwidth=(8.0,))).result.logs[0]
    assert (stiff.innovation_correlation > 3 * tuned.innovation_correlation).all()
    assert all(words.startswith("coloured") for words in stiff.innovation_verdict)
    assert not any(words.startswith("coloured") for words in tuned.innovation_verdict)
    still = stage(tmp_path / "c", make_log(rest, "hold", duration=2.0, noise=0.0)).result.logs[0]
    assert np.isnan(still.innovation_whiteness).all()


def test_plans_have_no_motion(tmp_path: Path) -> None:
    """A planned trajectory beside logs is passed over and named; alone it is nothing to reconstruct."""
    log = good_log()
    plan = replace(log, origin="planned", name="plan", signals={k: s for k, s in log.signals.items() if k not in ("q", "tau")})
    outcome = stage(tmp_path / "a", log, plan)
    assert [item.name for item in outcome.result.logs] == [log.name]
    assert any("plan" in check.message for check in outcome.result.checks)
    with pytest.raises(NothingMatched):
        stage(tmp_path / "b", plan)


def test_command_line(samples: Path, tmp_path: Path) -> None:
    """--bandwidth as a list, --method, --format and --json; a wrong list is wrong usage."""
    log = str(samples / "rrr-closed-form/friction-1.h5")
    done = rrrid("reconstruct", log, "--out", "out", "--bandwidth", "50,60", "--bandwidth", "70", "--method", "observer",
                 "--format", "parquet", "--json", "--no-report", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    np.testing.assert_allclose(result["observer"]["bandwidth_hz"], [50.0, 60.0, 70.0], rtol=1e-6)
    assert (tmp_path / "out/logs/friction-1.parquet").exists()
    for key in ("gains", "bandwidth_hz", "measurement_std", "jerk_std"):
        assert len(result["observer"][key]) == 3
    assert len(result["reconstruction_error_max"]) == len(result["innovation_whiteness"]) == 3
    wrong = rrrid("reconstruct", log, "--out", "x", "--bandwidth", "fast", cwd=tmp_path)
    assert (wrong.returncode, "C02" in wrong.stderr) == (2, True)
