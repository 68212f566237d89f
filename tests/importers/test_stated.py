"""What a file states of its numbers in plain text decides units, rate and counts; a name alone decides nothing."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.recorded_arm import THREE, simulate
from pipelines.import_log import draft_recipe
from pipelines.importers.clock import counted_on
from pipelines.importers.guess import guess_recipe
from pipelines.importers.notes import (
    stated_counts,
    stated_gear,
    stated_rate,
    stated_scale,
    stated_unit,
)
from tests.importers.good import Array, good, text, write


def drafted(folder: Path, head: str = "", columns: dict[str, Array] | None = None, name: str = "run.csv") -> str:
    return guess_recipe(write(folder, head + text(columns or good()), name)).text


def test_a_name_alone_states_no_unit(tmp_path: Path) -> None:
    """q1 and tau1 are written in degrees, turns and shares of a torque as well."""
    assert guess_recipe(write(tmp_path, text(good()))).blanks == ("robot.use", "signals.q.unit", "signals.tau.unit")


@pytest.mark.parametrize("line", [
    "# joint angles in degrees, joint torques in Nm", "# units: deg, Nm", "# q [deg], tau [Nm]", "% q in deg",
    "# Winkel in Grad; Momente in Nm", "# angles en degrés", "# positions are in degrees and torques in N m",
    "# tool pose in mm and rad; joints in deg", "# units deg deg/s Nm", "# 关节角度（度），力矩（牛米）",
    "# mounted at 1.57 rad, joints in deg", "Units: degrees / Nm"])
def test_a_line_that_states_degrees_is_believed(tmp_path: Path, line: str) -> None:
    draft = drafted(tmp_path, line + "\n")
    assert 'q = { columns = "q_{j}", unit = "deg" }' in draft
    assert "# check: the file states '" in draft


@pytest.mark.parametrize("line", [
    "# not in degrees", "# converted from degrees", "# tool orientation in deg", "# reference in deg",
    "# q in rad\n# angles in deg", "# home position [deg]: 0 -90 0", "# speed limit 90 deg/s", "# motor angles in deg"])
def test_a_line_that_states_no_unit_of_the_joints_leaves_it_open(tmp_path: Path, line: str) -> None:
    assert 'q = { columns = "q_{j}", unit = "FILL IN" }' in drafted(tmp_path, line + "\n")


@pytest.mark.parametrize(("line", "rate"), [
    ("Sampling interval : 8 msec", 125.0), ("% fs = 2000 Hz", 2000.0), ("サンプリング周期,8ms", 125.0), ("fps = 30", 30.0),
    ("physics_dt = 0.005", 200.0), ("Abtastrate: 1 kHz", 1000.0), ("Sample Time;0,004;s", 250.0), ("sample_time_ms = 4", 250.0),
    ("# low-pass filter 20 Hz, logged at 250 Hz", 250.0), ("SampleTime[ms]\t2\t2", 500.0), ('"Sample Period:",10 ms', 100.0),
    ("p.setTimeStep(1./240.)", 240.0), ("dt = 1/50 s", 50.0)])
def test_a_rate_is_read_from_its_line(line: str, rate: float) -> None:
    found = stated_rate([line])
    assert found is not None
    assert found.number == pytest.approx(rate)


@pytest.mark.parametrize("lines", [["control rate 1 kHz"], ["low-pass filter 20 Hz"], ["Start: 22-MAR-24 09:14:33"],
                                   ["Samples,2400"]])
def test_other_frequencies_are_no_rate(lines: list[str]) -> None:
    assert stated_rate(lines) is None


@pytest.mark.parametrize(
    ("line", "known"), [("decimation = 1", True), ("decimation = 4", False), ("every 10th sample stored", False)])
def test_a_rate_that_is_thinned_is_open(line: str, known: bool) -> None:
    found = stated_rate(["physics_dt = 0.005", line])
    assert found is not None
    assert bool(np.isfinite(found.number)) is known


@pytest.mark.parametrize(("line", "counts"), [
    ("# present_position: 4096 ticks per revolution", 4096.0), ("CPR = 8192", 8192.0), ("encoder resolution: 17 bit", 131072.0),
    ("% enc: 10000 counts/rev after x4 decoding", 10000.0), ("1 tick = 0.01 deg", 36000.0), ("0.087890625 deg per tick", 4096.0)])
def test_the_counts_of_a_turn_are_read_from_their_line(line: str, counts: float) -> None:
    found = stated_counts([line])
    assert found is not None
    assert found.number == pytest.approx(counts)
    assert stated_unit([line], "position") is None


def test_gears_and_the_size_of_a_raw_unit_are_read() -> None:
    gear = stated_gear(["# planetary 6:1, started 09:14:33"])
    assert gear is not None
    assert gear.number == 6.0
    assert [(s.number, s.value) for s in stated_scale(["present_current: 2.69 mA per unit"], "current")] == [(2.69, "mA")]


def test_counts_and_raw_currents_are_drafted_as_the_comment_states_them(tmp_path: Path) -> None:
    raw = {"t": good()["t"]} | {f"present_position_{j}": np.round(2048 + 600 * good()[f"q_{j}"]) for j in (1, 2, 3)}
    raw |= {f"present_current_{j}": np.round(20.0 * good()[f"tau_{j}"]) for j in (1, 2, 3)}
    draft = drafted(tmp_path, "# 4096 ticks per revolution\n# present_current: 2.69 mA per unit\n", raw)
    assert 'unit = "counts", counts_per_rev = 4096' in draft
    assert 'unit = "mA", scale = 2.69' in draft


def test_a_counter_takes_the_interval_of_the_preamble(tmp_path: Path) -> None:
    columns = {"Tick": np.arange(1200.0)} | {name: values for name, values in good().items() if name != "t"}
    draft = drafted(tmp_path, "Sampling interval : 8 msec\n", columns)
    assert 'unit = "sample"' in draft
    assert "rate = 125 " in draft


def test_the_step_in_the_metadata_of_json_is_the_rate(tmp_path: Path) -> None:
    frames = [{"step": k, "q": [0.1 * k, 0.2], "tau": [1.0, 2.0 + k]} for k in range(60)]
    (tmp_path / "run.json").write_text(json.dumps({"metadata": {"physics_dt": 1 / 120, "task": "reach"}, "frames": frames}))
    assert "rate = 120 " in guess_recipe(tmp_path / "run.json").text


def test_the_attributes_of_hdf5_state_rate_and_units(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "run.h5", "w") as file:
        file.attrs["sample_rate"], file.attrs["comment"] = 250.0, "joint angles in degrees"
        file["q"], file["tau"] = (np.column_stack([good()[f"{s}_{j}"] for j in (1, 2, 3)]) for s in ("q", "tau"))
    draft = guess_recipe(tmp_path / "run.h5").text
    assert "rate = 250 " in draft
    assert 'q = { columns = "q_{j}", unit = "deg" }' in draft


def test_a_column_that_keeps_0_to_1_is_asked_about(tmp_path: Path) -> None:
    """A gripper's opening beside joints whose unit is stated in a comment."""
    columns = good() | {"q_4": 0.5 + 0.5 * np.sin(3.0 * good()["t"])}
    assert 'unit = ["rad", "rad", "rad", "FILL IN"]' in drafted(tmp_path, "# q in rad\n", columns)


def test_a_column_without_the_unit_that_its_neighbours_have_is_asked_about(tmp_path: Path) -> None:
    columns = {name.replace("q_1", "q_1 [deg]").replace("q_2", "q_2 [deg]"): values for name, values in good().items()}
    assert 'unit = ["deg", "deg", "FILL IN"]' in drafted(tmp_path, "", columns)


def test_encoders_of_different_counts_are_asked_about(tmp_path: Path) -> None:
    raw = {f"enc_{j}": np.round(600 * good()[f"q_{j}"]) for j in (1, 2, 3)}
    draft = drafted(tmp_path, "# axis 1: 4096 counts/rev\n# axis 3: 8192 counts/rev\n", {"t": good()["t"]} | raw)
    assert 'counts_per_rev = "FILL IN"' in draft


def test_the_unit_of_a_velocity_is_that_of_the_position_it_is_the_slope_of(tmp_path: Path) -> None:
    speeds = {f"dq_{j} [deg/s]": np.gradient(good()[f"q_{j}"], good()["t"]) for j in (1, 2, 3)}
    assert 'q = { columns = "q_{j}", unit = "deg" }' in drafted(tmp_path, "", good() | speeds)


def test_a_torque_of_the_other_sign_is_told_by_the_robots_links(tmp_path: Path) -> None:
    moved = simulate(THREE, seed=3)
    (tmp_path / "arm.urdf").write_text(THREE.urdf())
    columns = {"t [s]": moved.t} | {f"q{j + 1} [rad]": moved.q[:, j] for j in range(3)}
    columns |= {f"tau{j + 1} [Nm]": moved.tau[:, j] * (-1.0 if j == 1 else 1.0) for j in range(3)}
    assert 'unit = "N m", sign = [1, -1, 1] }' in draft_recipe(write(tmp_path, text(columns))).text


@pytest.mark.parametrize("stamp", ["05/14/2024 {} {}", "{}{}"])
def test_a_clock_of_twelve_hours_goes_on_after_noon(tmp_path: Path, stamp: str) -> None:
    seconds = [12 * 3600 + 59 * 60 + 50 + 0.02 * k for k in range(1200)]
    clock = [stamp.format(f"{int(s // 3600 - 1) % 12 + 1:02d}:{int(s // 60 % 60):02d}:{s % 60:06.3f}", "PM") for s in seconds]
    rows = text(good()).splitlines()
    lines = [rows[0], *(",".join([at, *row.split(",")[1:]]) for at, row in zip(clock, rows[1:], strict=True))]
    draft = guess_recipe(write(tmp_path, "\n".join(lines) + "\n")).text
    assert "time is even" in draft
    assert "every 20 ms" in draft


def test_a_counter_of_32_bits_goes_on() -> None:
    stamps = np.arange(0.0, 4e6, 4000.0) + 2.0**32 - 1e6
    found, full = counted_on(np.mod(stamps, 2.0**32))
    assert full == 2.0**32
    assert np.array_equal(found, stamps)
    back = np.concatenate([stamps, stamps - 3e8])
    assert counted_on(back)[1] == 0.0


def test_messages_before_the_numbers_are_no_header(tmp_path: Path) -> None:
    rows = [f"14:59:{50 + k / 50:06.3f} -> {np.sin(0.1 * k):.4f}\t{k % 7}\t{np.cos(0.1 * k):.4f}" for k in range(400)]
    draft = guess_recipe(write(tmp_path, "\n".join(["14:59:49.871 -> MOT: Init", *rows]) + "\n", "serial.txt"))
    assert "time is even" in draft.text


def test_files_of_one_joint_each_are_pointed_out(tmp_path: Path) -> None:
    columns = {"t": good()["t"], "position [rev]": good()["q_1"], "torque [Nm]": good()["tau_1"]}
    write(tmp_path, text(columns), "drive_id2.csv")
    draft = drafted(tmp_path, "", columns, "drive_id1.csv")
    assert "one file a joint? beside this one are drive_id2.csv" in draft
    assert "robot.use" in guess_recipe(tmp_path / "drive_id1.csv").blanks


def test_a_comment_above_labelled_lines_states_their_units(tmp_path: Path) -> None:
    c = good()
    rows = [f"t: {c['t'][k]:.3f} q: [{c['q_1'][k]:.6f}, {c['q_2'][k]:.6f}] tau: [{c['tau_1'][k]:.6f}, {c['tau_2'][k]:.6f}]"
            for k in range(600)]
    draft = guess_recipe(write(tmp_path, "\n".join(["# simulator, q in degrees, tau in Nm", *rows]) + "\n", "log.txt"))
    assert 'unit = "deg"' in draft.text
    assert draft.blanks == ("robot.use",)


def test_a_stated_zero_is_no_ratio() -> None:
    """A gear of ratio 0 or 0 counts a turn are no numbers to draft with, and no reason to fail."""
    assert stated_gear(["gear ratio: 0"]) is None
    assert stated_counts(["0 counts per turn", "1 count = 0 deg"]) is None
