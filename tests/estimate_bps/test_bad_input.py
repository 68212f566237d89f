"""Bad input is left out, or refused in words."""

from __future__ import annotations

import contextlib
import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines import estimate_bps
from pipelines.errors import InputRejected, NothingMatched, UsageError
from pipelines.io.files import Opened, write_log
from pipelines.io.log import ExperimentLog
from pipelines.io.robot import format_robot
from pipelines.quality.checks import check_log
from pipelines.stage import Inputs
from tests.cli.commands import rrrid
from tests.estimate_bps.estimates import SYMMETRIC, Settings, stage
from tests.estimation.experiments import truth
from tests.fault_table import FAULTS
from tests.faulty import dropped, spiky
from tests.healthy import changed, good_log, with_signal
from tests.seeds import rarely


def _saturated(log: ExperimentLog) -> ExperimentLog:
    """Torque clipped in the busiest hundredth of the samples of the shoulder."""
    limit = np.array([60.0, 30.0, 15.0])
    at = np.sort(np.argsort(-np.abs(log.tau[:, 1]))[:100])
    tau = log.tau.copy()
    tau[at, 1] = np.sign(tau[at, 1]) * limit[1]
    return with_signal(log, tau=tau)


SPOILT: dict[str, Callable[[ExperimentLog], ExperimentLog]] = {
    "T03 dropped": lambda log: dropped(log, lambda k: np.delete(k, np.arange(500, 9500, 97))),
    "T04 gap": lambda log: dropped(log, lambda k: np.delete(k, np.arange(4000, 4600))),
    "D01 q": lambda log: changed(log, "q", (np.arange(700, 9000, 331), 1), np.nan),
    "D01 tau": lambda log: changed(log, "tau", (np.arange(700, 9000, 331), 0), np.nan),
    "D02 block": lambda log: changed(log, "tau", (slice(3000, 3500), 2), np.nan),
    "D06 q": lambda log: spiky(log, "q", 1, 0.3),
    "D06 tau": lambda log: spiky(log, "tau", 0, 200.0),
    "D05": _saturated,
}


@pytest.mark.parametrize("fault", [pytest.param(name, marks=pytest.mark.slow if k % 3 else ()) for k, name in enumerate(SPOILT)])
def test_what_is_spoilt_is_left_out(fault: str, good: ExperimentLog, tmp_path: Path) -> None:
    """Gaps, missing samples, spikes and saturation: the truth stays within the standard deviations.

    Of 22 parameters the largest deviation stays below 4; their root mean square is about 1.
    """
    found = stage(tmp_path, SPOILT[fault](good)).result
    z = np.array([(p.value - truth([p.name])[0]) / p.std for p in found.parameters])  # type: ignore[operator]
    assert np.abs(z).max() < 4.0, dict(zip([p.name for p in found.parameters], z.round(1), strict=True))
    assert np.sqrt(np.mean(z**2)) < 1.6


def test_nothing_to_fit_is_said_so(held_out: ExperimentLog, tmp_path: Path) -> None:
    with pytest.raises(NothingMatched) as refused:
        stage(tmp_path, held_out)
    assert refused.value.exit_code == 5


def test_several_robots_are_refused(good: ExperimentLog, held_out: ExperimentLog, tmp_path: Path) -> None:
    other = replace(held_out.robot, gravity=(0.0, 0.0, -9.7))
    with pytest.raises(UsageError, match="several robots") as refused:
        stage(tmp_path, good, replace(held_out, robot_text=format_robot(other)))
    assert refused.value.exit_code == 2


def test_too_short_for_the_low_pass_is_rejected(good: ExperimentLog, tmp_path: Path) -> None:
    with pytest.raises(InputRejected) as refused:
        stage(tmp_path, with_rows(good, 80), settings=replace(SYMMETRIC, cutoff_hz=2.0))
    assert refused.value.exit_code == 3
    assert refused.value.remedy


def with_rows(log: ExperimentLog, count: int) -> ExperimentLog:
    return replace(log, signals={k: replace(s, values=s.values[:count]) for k, s in log.signals.items()})


@pytest.mark.row("D14")
def test_one_recording_does_not_judge_itself(good: ExperimentLog, tmp_path: Path) -> None:
    """D14: the same samples in both roles are refused, in whatever container, unless --allow-overlap."""
    copy = replace(good, name="copy", role="validate")
    with pytest.raises(InputRejected) as refused:
        stage(tmp_path / "a", good, copy)
    assert (refused.value.code, refused.value.exit_code) == ("RRID-D14", 3)
    allowed = stage(tmp_path / "b", good, copy, settings=replace(SYMMETRIC, allow_overlap=True)).result
    assert allowed.relative_error["validate"] == pytest.approx(allowed.relative_error["identify"])


@pytest.mark.parametrize("row", [pytest.param(fault.row, marks=pytest.mark.slow if k % 12 else ())
                                 for k, fault in enumerate(FAULTS)])
def test_every_fault_ends_in_words(row: str, tmp_path: Path) -> None:
    """Whatever the doctor can meet: an estimate, a gate under --check, or a rejection; never a crash."""
    fault = next(fault for fault in FAULTS if fault.row == row)
    log = replace(fault.make(good_log()), role="identify")
    if retold := log.experiment not in estimate_bps.FITTED:  # what is wrong with a friction log may be right of an excitation
        log = replace(log, experiment="excitation")
    opened = Opened(tmp_path / "a.h5", "", log, ())
    result = None
    with contextlib.suppress(InputRejected):  # which ends in exit 3; anything else fails here
        result = estimate_bps.compute(Inputs((opened,), label="logs"), Settings())
    if result is not None:
        assert fault.level != "reject" or retold
        assert estimate_bps.STAGE.exit_code(result, False) == 0
        gates = [check for check in check_log(log) if check.gate and check.code != "RRID-D09"]  # D09 is for all logs together
        assert {(check.code, check.message) for check in gates} <= {(c.code, c.message) for c in estimate_bps.STAGE.checks(result)}
        assert estimate_bps.STAGE.exit_code(result, True) == 1 or not gates


@pytest.mark.parametrize("row", ["S13 tau", "S14", "S15 encoder", "T06 drift", *(
    pytest.param(row, marks=pytest.mark.slow) for row in ("S13 q", "S14 all", "S15 torque"))])
@pytest.mark.parametrize("role", ["identify", pytest.param("validate", marks=pytest.mark.slow)])
def test_torque_of_another_motion_gives_no_parameters(role: str, row: str, tmp_path: Path) -> None:
    """Swapped joints, a flipped sign, a wrong scale, a clock apart: said before any number, in a log that judges as well."""
    fault = next(fault for fault in FAULTS if fault.row == row)
    log = replace(fault.make(good_log()), role=role, name="wrong", experiment="excitation")
    logs = (log,) if role == "identify" else (replace(good_log(2), role="identify", name="right"), log)
    with pytest.raises(InputRejected, match=fault.says) as refused:
        stage(tmp_path, *logs)
    assert (refused.value.code, refused.value.exit_code) == (f"RRID-{row[:3]}", 3)
    assert "wrong" in refused.value.where
    assert "--skip-sanity-checks" in refused.value.remedy


def test_a_mismatch_may_be_fitted_on_purpose(tmp_path: Path) -> None:
    """--skip-sanity-checks: the estimate says it and fails --check; an arm built otherwise than described is not locked out."""
    write_log(tmp_path / "logs/a.h5", with_signal(good_log(), tau=good_log().tau * [1.0, -1.0, 1.0]))
    command = ("estimate-bps", "logs", "--out", "o", "--no-report", "--check")
    refused = rrrid(*command, cwd=tmp_path)
    assert (refused.returncode, "RRID-S14" in refused.stderr, (tmp_path / "o").exists()) == (3, True, False)
    allowed = rrrid(*command, "--skip-sanity-checks", cwd=tmp_path)
    assert (allowed.returncode, "RRID-S14" in allowed.stdout + allowed.stderr) == (1, True), allowed.stderr


@pytest.mark.row("T07", "D05")
def test_the_doctor_is_asked(good: ExperimentLog, tmp_path: Path) -> None:
    """T07, less than a period: rejected. D05, a flat top: said, and exit 1 under --check."""
    with pytest.raises(InputRejected) as refused:
        stage(tmp_path / "short", replace(good, period=20.0))
    assert refused.value.code == "RRID-T07"
    (limited,) = [fault.make(good_log()) for fault in FAULTS if fault.row == "D05 limit"]
    clipped = stage(tmp_path / "clipped", limited, check=True)
    assert any(check.code == "RRID-D05" and check.gate for check in clipped.checks)
    assert clipped.exit_code == 1
    assert stage(tmp_path / "clipped", limited).exit_code == 0
    constant = changed(good, "tau", (slice(None), 1), 0.3)
    with pytest.raises(InputRejected, match="constant"):
        stage(tmp_path / "constant", constant)


def test_torque_that_saturates_throughout_is_rejected(good: ExperimentLog, tmp_path: Path) -> None:
    """D05: no equation is left where the filter spreads clipped samples over everything."""
    with pytest.raises(InputRejected) as refused:
        stage(tmp_path, with_signal(good, tau=np.clip(good.tau, -0.5, 0.5)))
    assert refused.value.exit_code == 3


@pytest.mark.parametrize(("settings", "where"), [
    ({"min_speed": (0.1, 0.2)}, "--min-speed"), ({"min_speed": (-1.0,)}, "--min-speed"),
    ({"min_speed": (math.nan,)}, "--min-speed"), ({"min_speed": (math.inf,)}, "--min-speed"),
    ({"decimate": 0}, "--decimate"), ({"decimate": -3}, "--decimate"), ({"cutoff_hz": 0.0}, "--cutoff-hz"),
    ({"cutoff_hz": -1.0}, "--cutoff-hz"), ({"cutoff_hz": 500.0}, "--cutoff-hz"), ({"cutoff_hz": math.nan}, "--cutoff-hz"),
    ({"blocks": 1}, "--blocks"), ({"blocks": 0}, "--blocks"), ({"order": 7}, "--order")])
def test_settings_have_bounds(settings: dict[str, object], where: str, good: ExperimentLog, tmp_path: Path) -> None:
    with pytest.raises(UsageError) as refused:
        stage(tmp_path, good, settings=replace(SYMMETRIC, **settings))  # type: ignore[arg-type]
    assert (refused.value.code, refused.value.where, refused.value.exit_code) == ("RRID-C02", where, 2)


@pytest.mark.parametrize("settings", [
    {"decimate": 500}, {"cutoff_hz": 0.01}, *rarely({"decimate": 100000}, {"min_speed": (100.0,)})])
def test_too_few_equations_are_rejected(settings: dict[str, object], good: ExperimentLog, tmp_path: Path) -> None:
    with pytest.raises(InputRejected) as refused:
        stage(tmp_path, good, settings=replace(SYMMETRIC, **settings))  # type: ignore[arg-type]
    assert refused.value.code in ("RRID-T04", "RRID-T08")
    assert refused.value.remedy


def test_options_of_the_observer(good: ExperimentLog, tmp_path: Path) -> None:
    """--order and --bandwidth reach the reconstruction, as with `reconstruct`."""
    write_log(tmp_path / "logs/a.h5", good)
    made = rrrid("estimate-bps", "logs", "--out", "o0", "--no-report", "--order", "3", "--bandwidth", "30,40,50", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    about = json.loads((tmp_path / "o0/provenance.json").read_text())["settings"]
    assert (about["order"], about["bandwidth"]) == (3, [30, 40, 50])
    wrong = rrrid("estimate-bps", "logs", "--out", "o", "--bandwidth", "1,2", cwd=tmp_path)
    assert (wrong.returncode, "RRID-C02" in wrong.stderr) == (2, True)


def test_a_least_speed_beyond_every_speed_names_the_joint(good: ExperimentLog, tmp_path: Path) -> None:
    """T08: which joint is never that fast, and how fast it is at most."""
    fastest = np.abs(np.gradient(good.q, good.t, axis=0)).max(axis=0)
    settings = replace(SYMMETRIC, min_speed=(0.1, 50.0, 0.1))
    with pytest.raises(InputRejected, match=r"T08 .* joint 2 .* --min-speed asks for 50") as refused:
        stage(tmp_path, good, settings=settings)
    said = re.search(r"largest speed is (\S+) rad/s", str(refused.value))
    assert said is not None
    assert float(said.group(1)) == pytest.approx(fastest[1], rel=0.05)
