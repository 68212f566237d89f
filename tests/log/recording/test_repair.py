"""What is mended is mended honestly: nothing is filled in, everything done is said, the rest is refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pipelines.errors import Check, InputRejected
from pipelines.log.recording.clock import time_of
from pipelines.log.recording.joint_side import drive_of, joint_side
from pipelines.log.recording.raw import RawTable, expand
from pipelines.log.recording.recipe import Recipe, TimeSpec
from pipelines.log.recording.recipe_reader import parse_recipe
from pipelines.log.recording.repair import Limits, Recording, mend, split_at_gaps
from pipelines.log.robot_files import load_robot
from pipelines.signal.resample import grid, resample
from tests.log.recording.good import RECIPE, Array, good


def recording() -> Recording:
    columns = good()
    signals = {s: np.column_stack([columns[f"{s}_{j}"] for j in (1, 2, 3)]) for s in ("q", "tau")}
    names = {s: tuple(f"{s}_{j}" for j in (1, 2, 3)) for s in ("q", "tau")}
    return Recording(columns["t"], signals, names, np.arange(2, 1202), "run.csv", word="line")


def changed(signal: str, at: object, joint: int, value: float) -> Recording:
    """The good recording with some samples of one joint set to `value`."""
    good_one = recording()
    values = good_one.signals[signal].copy()
    values[at, joint] = value  # type: ignore[call-overload]
    return replace(good_one, signals={**good_one.signals, signal: values})


def clocked(t: Array) -> Recording:
    return replace(recording(), t=t)


def levels(checks: tuple[Check, ...]) -> dict[str, str]:
    return {check.code.removeprefix("RRID-"): check.level for check in checks}


def test_a_good_recording_is_left_alone() -> None:
    parts, checks = mend(recording(), Limits())
    assert len(parts) == 1
    assert not checks
    assert np.array_equal(parts[0].signals["tau"], recording().signals["tau"])


def test_d01_an_isolated_nan_leaves_a_gap_in_time() -> None:
    """D01: two holes are left out, nothing is put in their place."""
    (part,), checks = mend(changed("q", [100, 700], 1, np.nan), Limits())
    assert levels(checks) == {"D01": "repair", "T03": "warn"}
    assert "lines 102, 702" in checks[0].message
    assert part.t.size == 1198
    assert np.isclose(np.diff(part.t).max(), 0.002)
    assert np.array_equal(part.signals["q"], np.delete(recording().signals["q"], [100, 700], axis=0))


@pytest.mark.parametrize(("where", "words"), [(slice(None), "no number at all"), (slice(300, 800), "42 % of its samples")])
def test_d02_a_channel_of_holes_is_named(where: slice, words: str) -> None:
    with pytest.raises(InputRejected, match=f"RRID-D02.*column 'tau_3'.*{words}"):
        mend(changed("tau", where, 2, np.nan), Limits())


@pytest.mark.parametrize("value", [np.inf, -np.inf, 1e300, -999.0])
def test_d03_an_absurd_number_is_refused_unless_it_is_declared_missing(value: float) -> None:
    bad = changed("q", [10, 20], 0, value)
    with pytest.raises(InputRejected, match=r"RRID-D03.*column 'q_1'.*lines 12, 22.*Add|RRID-D03.*lines 12, 22.*missing"):
        mend(bad, Limits())
    (part,), checks = mend(bad, Limits(missing=(value,)))
    assert levels(checks)["D03"] == "repair"
    assert part.t.size == 1198


def test_t01_a_clock_that_was_set_back_splits_the_log() -> None:
    t = recording().t.copy()
    t[500:] -= 0.3
    parts, checks = mend(clocked(t), Limits())
    assert [part.t.size for part in parts] == [500, 700]
    assert all((np.diff(part.t) > 0).all() for part in parts)
    assert levels(checks) == {"T01": "repair"}
    assert "line 502" in checks[0].message


def test_t01_a_clock_that_runs_wild_is_refused() -> None:
    t = recording().t.copy()
    t[100::50] -= 0.5
    with pytest.raises(InputRejected, match=r"RRID-T01.*runs backwards 22 times \(lines 102"):
        mend(clocked(t), Limits())


def test_t02_a_sample_written_twice_is_dropped() -> None:
    good_one = recording()
    twice = good_one.take(np.repeat([True], 1200))
    index = np.insert(np.arange(1200), 300, 299)
    twice = replace(good_one, t=good_one.t[index], places=np.arange(2, 1203),
                    signals={k: v[index] for k, v in good_one.signals.items()})
    (part,), checks = mend(twice, Limits())
    assert levels(checks) == {"T02": "repair"}
    assert np.array_equal(part.t, good_one.t)


def test_t02_one_stamp_with_two_values_is_refused() -> None:
    t = recording().t.copy()
    t[300] = t[299]
    with pytest.raises(InputRejected, match=r"RRID-T02.*twice with different values \(line 302\).*more digits"):
        mend(clocked(t), Limits())


def test_t03_lost_samples_stay_lost() -> None:
    keep = np.ones(1200, dtype=bool)
    keep[[50, 400, 401, 900]] = False
    (part,), checks = mend(recording().take(keep), Limits())
    assert levels(checks) == {"T03": "warn"}
    assert "4 samples (0.33 %) are lost in 3 gaps" in checks[0].message
    assert part.t.size == 1196


def test_t04_nothing_is_interpolated_across_a_long_gap() -> None:
    keep = np.ones(1200, dtype=bool)
    keep[400:600] = False
    limits = Limits(resampled=True)
    (part,), checks = mend(recording().take(keep), limits)
    assert levels(checks)["T04"] == "repair"
    assert [p.t.size for p in split_at_gaps(part, limits)] == [400, 600]


def test_t04_gaps_that_are_most_of_the_recording_are_refused() -> None:
    keep = np.ones(1200, dtype=bool)
    keep[100:1000] = False
    with pytest.raises(InputRejected, match="RRID-T04"):
        mend(recording().take(keep), Limits())


def test_t05_uneven_time_is_said() -> None:
    rng = np.random.default_rng(1)
    assert levels(mend(clocked(recording().t + rng.uniform(0, 0.0004, 1200)), Limits())[1]) == {"T05": "warn"}


@pytest.mark.parametrize("count", [0, 1, 5])
def test_t08_hardly_a_sample_is_no_log(count: int) -> None:
    with pytest.raises(InputRejected, match=f"RRID-T08.*{count} sample"):
        mend(recording().take(slice(0, count)), Limits())


def test_f09_without_a_clock_damage_splits_the_log() -> None:
    """F09: with a fixed rate nobody knows how many samples a torn line stands for."""
    parts, checks = mend(replace(recording(), clocked=False, breaks=(499,)), Limits())
    assert [part.t.size for part in parts] == [499, 701]
    assert levels(checks) == {"F09": "repair"}


# --- time -----------------------------------------------------------------------------------------------------------


def table(t: Array, **units: str) -> RawTable:
    return RawTable("run.csv", {"t": t}, np.arange(t.size), units=units)


@pytest.mark.parametrize(("unit", "factor"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_s08_the_unit_of_time_is_detected_from_the_declared_rate(unit: str, factor: float) -> None:
    t, checks = time_of(table(good()["t"] * factor), TimeSpec(column="t", rate=1000.0))
    assert np.allclose(t, good()["t"], atol=1e-9)
    assert f"{unit} fits the declared rate of 1000 Hz" in checks[0].message
    assert checks[0].code == "RRID-S08"


def test_s08_a_sample_index_is_detected() -> None:
    t, _ = time_of(table(np.arange(1200.0)), TimeSpec(column="t", rate=500.0))
    assert np.allclose(t, np.arange(1200) / 500)


def test_s08_an_open_unit_is_refused_with_what_it_could_be() -> None:
    with pytest.raises(InputRejected, match=r"RRID-S08.*could be: ms \(.*us \(.*Add unit or rate"):
        time_of(table(good()["t"] * 2e4), TimeSpec(column="t"))


def test_s08_a_unit_that_contradicts_the_rate_is_refused() -> None:
    with pytest.raises(InputRejected, match=r"RRID-S08.*time in s makes 1 Hz, but 1000 Hz is declared; in ms it would fit"):
        time_of(table(good()["t"] * 1e3), TimeSpec(column="t", unit="s", rate=1000.0))


def test_s08_an_absurd_rate_is_refused() -> None:
    with pytest.raises(InputRejected, match=r"RRID-S08.*ms looks right|RRID-S08.*us or ns|RRID-S08.*us"):
        time_of(table(good()["t"] * 1e6), TimeSpec(column="t", unit="s"))


def test_an_epoch_in_nanoseconds_keeps_its_digits() -> None:
    t, _ = time_of(table(1.7e18 + np.arange(1200) * 1024000.0), TimeSpec(column="t", unit="ns"))
    assert np.allclose(np.diff(t), 1.024e-3, rtol=1e-9)


# --- columns --------------------------------------------------------------------------------------------------------


def columns(*names: str) -> RawTable:
    return RawTable("run.csv", {name: np.zeros(20) for name in names}, np.arange(20))


def test_s01_a_missing_column_is_named_with_its_neighbour() -> None:
    with pytest.raises(InputRejected, match=r"RRID-S01 run.csv: no column 'Joint_2', did you mean 'Joint2'\?.*--map q_1="):
        expand(columns("Joint_1", "Joint2", "Joint_3"), "Joint_{j}", 3, "q")


def test_s01_map_puts_another_column_in_its_place() -> None:
    assert expand(columns("Joint_1", "Joint2", "Joint_3"), "Joint_{j}", 3, "q", {2: "Joint2"}) == ("Joint_1", "Joint2", "Joint_3")


@pytest.mark.parametrize("chosen", ["q_{j}", ("q_1", "q_2", "q_3", "q_4")])
def test_s02_more_columns_than_joints_are_refused(chosen: str | tuple[str, ...]) -> None:
    with pytest.raises(InputRejected, match=r"RRID-S02.*4 columns for q, but the robot has 3 joints"):
        expand(columns("q_1", "q_2", "q_3", "q_4"), chosen, 3, "q")


# --- joint side -----------------------------------------------------------------------------------------------------


def recipe(edit: Callable[[str], str] = lambda text: text, more: str = "") -> Recipe:
    return parse_recipe(edit(RECIPE) + more)


def convert(part: Recording, made: Recipe, units: dict[str, str] | None = None) -> dict[str, Array]:
    robot = load_robot("rrr")
    said = units or {name: str(spec.unit) for name, spec in made.signals.items()}
    converted = joint_side(part, made, said, robot, drive_of(made.drive, robot, ""))
    return {name: signal.values for name, signal in converted.signals.items()}


def test_joint_power_equals_motor_power_sample_by_sample() -> None:
    """With q_motor = N q_joint and tau_joint = Nᵀ tau_motor, no transmission makes or loses power, coupled or not."""
    made = recipe(more="[drive]\ntransmission = [[32.0, 0, 0], [0, -48.0, 0], [5.0, 32.0, 45.0]]\n")
    part = recording()
    joint = convert(part, made)
    motor_power = (np.gradient(part.signals["q"], part.t, axis=0) * part.signals["tau"]).sum(axis=1)
    joint_power = (np.gradient(joint["q"], part.t, axis=0) * joint["tau"]).sum(axis=1)
    assert np.abs(joint_power - motor_power).max() < 1e-12 * np.abs(motor_power).max()


def test_gear_ratios_alone_are_a_diagonal_matrix() -> None:
    joint = convert(recording(), recipe(more="[drive]\ntransmission = [10.0, 20.0, -30.0]\n"))
    assert np.allclose(joint["q"] * [10.0, 20.0, -30.0], recording().signals["q"], rtol=1e-14, atol=0)
    assert np.allclose(joint["tau"] / [10.0, 20.0, -30.0], recording().signals["tau"], rtol=1e-14, atol=0)


def test_current_becomes_torque_and_is_kept() -> None:
    joint = convert(recording(), recipe(lambda s: s.replace('"N m"', '"mA"'), "[drive]\ntorque_constant = [0.1, 0.2, 0.3]\n"))
    assert np.allclose(joint["current"], 1e-3 * recording().signals["tau"], rtol=1e-15, atol=0)
    assert np.allclose(joint["tau"], joint["current"] * [0.1, 0.2, 0.3], rtol=1e-15, atol=0)


def test_s10_current_without_constant_is_refused() -> None:
    with pytest.raises(InputRejected, match=r"RRID-S10.*motor current instead of torque.*torque_constant"):
        convert(recording(), recipe(lambda s: s.replace('"N m"', '"A"')))


@pytest.mark.parametrize(("wrong", "right"), [("V", "N m"), ("deg", "N m")])
def test_s05_a_unit_of_something_else_is_refused(wrong: str, right: str) -> None:
    with pytest.raises(InputRejected, match=f"RRID-S05.*needs one of .*{right}"):
        convert(recording(), recipe(lambda s: s.replace('"N m"', f'"{wrong}"')))


def test_s05_a_length_for_a_turning_joint_is_refused() -> None:
    with pytest.raises(InputRejected, match=r"RRID-S05.*'mm' for joint 1.*revolute.*rad"):
        convert(recording(), recipe(lambda s: s.replace('"rad"', '"mm"')))


def test_s06_degrees_are_converted() -> None:
    joint = convert(recording(), recipe(lambda s: s.replace('"rad"', '"deg"')))
    assert np.allclose(joint["q"], np.deg2rad(recording().signals["q"]), rtol=1e-15, atol=0)


def test_d07_a_rollover_is_followed_through() -> None:
    """D07: a counter of 8192 that starts again four times gives the motion it came from, to the last count."""
    counts = np.round(np.linspace(100, 100 + 4.3 * 8192, 1200))
    wrapped = replace(recording(), signals={**recording().signals, "q": np.column_stack([np.mod(counts, 8192)] * 3)})
    made = recipe(lambda s: s.replace('unit = "rad"', 'unit = "counts", counts_per_rev = 8192, wrap = 8192'))
    converted = joint_side(wrapped, made, {"q": "counts", "tau": "N m"}, load_robot("rrr"), None)
    assert np.allclose(converted.signals["q"].values[:, 0], counts * 2 * np.pi / 8192, rtol=1e-14)
    assert {(c.code, c.level) for c in converted.checks} == {("RRID-D07", "warn")}
    assert "4 rollovers of 8192" in converted.altered[0]


def test_sign_scale_and_offset_act_in_this_order() -> None:
    joint = convert(recording(),
                    recipe(lambda s: s.replace('unit = "rad"', 'unit = "deg", sign = -1, scale = 2.0, offset = [0.5, 0.0, 0.0]')))
    expected = np.deg2rad(-2.0 * recording().signals["q"]) + np.array([0.5, 0.0, 0.0])
    assert np.allclose(joint["q"], expected, rtol=1e-14, atol=1e-16)


# --- resampling -----------------------------------------------------------------------------------------------------


def test_the_spline_follows_a_smooth_motion_between_uneven_samples() -> None:
    """Fourth order: halving the steps makes the error about sixteen times smaller."""
    rng = np.random.default_rng(3)
    errors = []
    for n in (200, 400):
        t = np.linspace(0.0, 2.0, n) + rng.uniform(-0.2, 0.2, n) * 2.0 / n
        at = grid(0.3, 1.7, 500.0)
        errors.append(np.abs(resample(t, np.sin(9.0 * t)[:, None], at)[:, 0] - np.sin(9.0 * at)).max())
    assert errors[0] < 1e-5
    assert errors[1] < errors[0] / 8.0


def test_resampling_on_the_samples_themselves_changes_nothing() -> None:
    t, q = recording().t, recording().signals["q"]
    for method in ("spline", "linear"):
        assert np.allclose(resample(t, q, t, method), q, rtol=0, atol=1e-15)  # type: ignore[arg-type]


def test_a_grid_has_every_sample_it_can() -> None:
    assert grid(0.0, 10.0, 400.0).size == 4001
    assert grid(0.0, 9.9999, 400.0)[-1] == 9.9975
