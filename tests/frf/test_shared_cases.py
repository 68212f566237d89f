"""Recorded cases of which the truth is known: an independent plant, and logs as the field brings them."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.frequency.findings import Findings, frf_findings
from pipelines.frequency.modes import fitted_modes, informative, with_enough_bins
from pipelines.frequency.responses import measured_responses
from pipelines.frequency.result import posture_of
from pipelines.frequency.spectra import inside
from pipelines.io.files import open_log
from tests.cli.commands import rrrid


def _imported(shared: Path, tmp_path: Path, case: str) -> Path:
    for path in (shared / "cases" / case).iterdir():
        shutil.copyfile(path, tmp_path / path.name)
    assert rrrid("import", "r.toml", "--out", "imported", "--no-report", cwd=tmp_path).returncode == 0
    return tmp_path


def _found(shared: Path, arm: str) -> Findings:
    return frf_findings([open_log(shared / "plant-b" / f"arm-{arm}" / f"frf-{k}.h5").log for k in range(1, 7)])


def test_lost_samples_do_not_speed_time_up(shared: Path, tmp_path: Path) -> None:
    """2.9 % of the samples lost at random: the resonance at 19.37 Hz and 0.5 kg m² as without."""
    folder = _imported(shared, tmp_path, "18-frf-lost-3-percent")
    (log,) = [open_log(path).log for path in folder.glob("imported/**/*.h5")]
    found = frf_findings([log])
    modes = found.seen[0].modes
    assert modes.pairs[0].resonance.frequency.value == pytest.approx(15.0 * 1.291, rel=2e-3)
    assert modes.inertia is not None
    assert modes.inertia.value == pytest.approx(0.5, rel=0.01)
    assert found.seen[0].measured.first.filled == pytest.approx(0.029, abs=0.003)
    told = posture_of(found.seen[0]).delay
    assert told is None or told.value >= 0.0  # no position comes before its torque


def test_no_mode_where_coherence_is_lost(shared: Path, tmp_path: Path) -> None:
    """v of a third of the disturbance: the resonance at 19.37 Hz, or none."""
    folder = _imported(shared, tmp_path, "20-frf-weak-in-loop")
    (log,) = [open_log(path).log for path in folder.glob("imported/**/*.h5")]
    found = frf_findings([log])
    assert found.seen or found.unusable
    assert found.classification == ()
    resonances = [m.frequency.value for seen in found.seen for m in seen.modes.modes if m.kind == "resonance"]
    assert all(value == pytest.approx(15.0 * 1.291, rel=0.01) for value in resonances)


def test_aliasing_is_said_and_no_lag(shared: Path, tmp_path: Path) -> None:
    """Every fourth sample of a mode at 232 Hz: T09, exit 1 under --check, and nothing named."""
    folder = _imported(shared, tmp_path, "22-frf-negative-delay")
    ended = rrrid("frf", "imported", "--check", "--json", "--no-report", "--out", "out", cwd=folder)
    assert ended.returncode == 1
    result = json.loads(ended.stdout)
    assert result["classification"] == result["undecided"] == []
    assert any("aliasing" in check["message"] for check in result["data_quality"])


@pytest.mark.parametrize("arm", ["02", "03", "05", "08"])
def test_a_firm_arm_under_pd_is_rigid(shared: Path, arm: str) -> None:
    """v covers 4 to 150 Hz, and the other joints swing behind their controllers: no base, no spring, no delay."""
    found = _found(shared, arm)
    assert found.seen
    assert {one.kind for one in found.classification} <= {"rigid"}


def test_a_soft_base_under_pd(shared: Path) -> None:
    """Its frequency within 3 %, its inertia within 15 %, and no other finding."""
    truth = json.loads((shared / "plant-b" / "answers.json").read_text())["arm-06"]["truth"][0]["parameters"]
    base, *others = _found(shared, "06").classification
    assert base.kind == "base"
    assert {one.kind for one in others} <= {"rigid"}
    assert base.parameters["frequency"].value == pytest.approx(truth["frequency"], rel=0.03)
    assert base.parameters["inertia"].value == pytest.approx(truth["inertia"], rel=0.15)


def test_experiments_that_start_within_their_stroke_are_superposed(shared: Path) -> None:
    """Without a stated posture each log begins where its joint is by then: what the others hold is the same posture."""
    logs = [open_log(shared / "plant-b" / "arm-06" / f"frf-{k}.h5").log for k in range(1, 5)]
    whole = [one.held is not None for one in measured_responses(logs)]
    later = [replace(log, posture=None, signals={
        name: replace(signal, values=signal.values[log.n_samples // 10:]) for name, signal in log.signals.items()})
        for log in logs]
    found = measured_responses(later)
    own = [one.first.posture[one.joint - 1] for one in found]
    held = [other.first.posture[one.joint - 1] for one, other in zip(found, found[1:] + found[:1], strict=True)]
    assert any(whole)
    assert np.abs(np.subtract(own, held)).max() > 0.05
    assert [one.held is not None for one in found] == whole


def test_too_few_superposed_bins_leave_the_plant(shared: Path) -> None:
    """Of 17 bins no mode is fitted: the response of the joint alone is."""
    logs = [open_log(shared / "plant-b" / "arm-06" / f"frf-{k}.h5").log for k in range(1, 7)]
    measured = next(one for one in measured_responses(logs) if one.held is not None)
    assert with_enough_bins(measured) is measured
    assert measured.held is not None
    few = replace(measured, held=measured.held.where(np.arange(len(measured.held.frequency)) < 17))
    plain = with_enough_bins(few)
    assert plain.held is None
    assert informative(plain)
    assert fitted_modes(plain).relative.frequency.size == plain.plant.frequency.size


def test_a_spring_in_a_joint_under_pd(shared: Path) -> None:
    """Joint 2: stiffness within 5 %, motor within 3 %."""
    truth = json.loads((shared / "plant-b" / "answers.json").read_text())["arm-07"]["truth"][0]["parameters"]
    (one,) = _found(shared, "07").classification
    assert (one.kind, one.joint) == ("joint", 2)
    assert one.parameters["stiffness"].value == pytest.approx(truth["stiffness"], rel=0.05)
    assert one.parameters["motor_inertia"].value == pytest.approx(truth["drive_inertia"], rel=0.03)


def test_a_gap_is_no_spring(shared: Path) -> None:
    """Joint 2 with a gap of 2.2 mrad: left open, with gap and spring among the candidates."""
    found = _found(shared, "04")
    assert found.classification == ()
    assert {"backlash", "joint_elasticity"} <= set(found.undecided[0].candidates)


@pytest.mark.slow
def test_the_excited_band_is_that_of_v(shared: Path) -> None:
    """Of v from 4 to 150 Hz: within 2 Hz of it."""
    (measured,) = measured_responses([open_log(shared / "plant-b" / "arm-02" / "frf-3.h5").log])
    ((low, high),) = measured.excited
    assert low == pytest.approx(4.0, abs=2.0)
    assert high == pytest.approx(150.0, abs=2.0)
    assert not inside(measured.excited, np.array([1.0, 160.0, 400.0])).any()
