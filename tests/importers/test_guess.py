"""A drafted recipe is nearly right, says what it rests on, and runs once its blanks are filled."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from benchmarks.recorded_arm import LIFT, PANDA, THREE, Arm, Run, simulate
from pipelines.errors import InputRejected, UsageError
from pipelines.import_log import draft_recipe
from pipelines.importers.evidence import rollover, sign_of
from pipelines.importers.guess import guess_recipe
from pipelines.importers.names import read_name
from pipelines.importers.recipe import parse_recipe
from pipelines.io.files import open_log
from tests.importers.good import Array, good, run, text, write

ABC = Arm("abc", ("a", "b", "c"), "zyy", (150, 150, 150))


def stated(columns: Mapping[str, Array]) -> dict[str, Array]:
    """Name the units in the header: a column's name alone states none."""
    units = {"q": "rad", "tau": "Nm"}
    return {f"{name} [{unit}]" if (unit := units.get(name.partition("_")[0])) else name: v for name, v in columns.items()}


def drafted(folder: Path, content: str, name: str = "run.csv") -> str:
    return guess_recipe(write(folder, content, name)).text


def test_a_recording_that_states_its_units_needs_only_its_robot(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    draft = guess_recipe(write(folder, text(stated(good()))))
    assert draft.blanks == ("robot.use",)
    outcome = run(folder, draft.text.replace("FILL IN\"", 'rrr"', 1).replace('says rrr"', "says", 1))
    assert np.array_equal(open_log(outcome.folder / "logs" / "run.h5").log.q[:, 1], good()["q_2"])


def test_a_blank_that_is_left_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"RRID-C02.*'robot.use' is still marked FILL IN.*Replace the blank.*at robot.use"):
        run(tmp_path / "data", drafted(tmp_path / "data", text(good())))


@pytest.mark.parametrize(("line", "place"), [('rate = "FILL IN"', "time.rate"), ('q = "FILL IN"', "signals.q")])
def test_any_blank_is_named_with_its_place(line: str, place: str) -> None:
    section, _, key = place.partition(".")
    with pytest.raises(UsageError, match=f"RRID-C02.*at {section}.{key}"):
        parse_recipe(f"[{section}]\n{line}\n")


def test_units_in_a_header_are_used_and_sure(tmp_path: Path) -> None:
    """"[Nm]" is a unit as good as "[s]" and "[rad]"; Winkel and Drehmoment are an angle and a torque."""
    columns = good()
    named = {"Zeit [s]": columns["t"]} | {f"Winkel {j} [rad]": columns[f"q_{j}"] for j in (1, 2, 3)}
    for word in ("Drehmoment ", "M"):  # the second is known by its unit alone
        _draft_with_header_units(tmp_path, named | {f"{word}{j} [Nm]": columns[f"tau_{j}"] for j in (1, 2, 3)})


def _draft_with_header_units(tmp_path: Path, named: dict[str, Array]) -> None:
    draft = guess_recipe(write(tmp_path, text(named)))
    assert draft.blanks == ("robot.use",)
    assert 'unit = "N m" }' in draft.text
    assert any(words.startswith("tau unit: N m (sure: named so") for words in draft.evidence)
    assert any(words.startswith("q unit: rad (sure: named so") for words in draft.evidence)


def test_a_held_torque_is_drafted_as_a_command(tmp_path: Path) -> None:
    """Held over four samples, or called a command; where nothing tells, the draft says whom to ask."""
    columns = good()
    held = {f"tau_{j}": np.repeat(columns[f"tau_{j}"][::4], 4) for j in (1, 2, 3)}
    assert 'torque = "held-command"' in drafted(tmp_path, text(columns | held))
    named = {("tau_cmd_" + k[-1] if k.startswith("tau") else k): v for k, v in columns.items()}
    assert 'torque = "held-command"' in drafted(tmp_path, text(named))
    assert "ask who recorded them" in drafted(tmp_path, text(columns))


def test_the_odrive_draft_is_the_shipped_recipe(shared: Path, tmp_path: Path) -> None:
    draft = guess_recipe(shared / "real" / "odrive" / "slow2_nocomp_0.csv")
    assert draft.blanks == ("robot.gravity", "drive.torque_constant")
    text_ = draft.text.replace('torque_constant = "FILL IN"', "torque_constant = 0.0551")
    text_ = text_.replace('gravity = "FILL IN"', "gravity = [0.0, 0.0, -9.81]")
    recipe = parse_recipe(text_)
    assert (recipe.time.column, recipe.time.unit) == ("t_s", "s")
    assert (recipe.signals["q"].unit, recipe.signals["q"].counts_per_rev) == ("counts", 8192)
    assert recipe.signals["tau"].unit == "A"
    assert recipe.resample is not None
    assert recipe.resample.rate == 400.0
    (tmp_path / "recipe.toml").write_text(text_)
    from pipelines.import_log import STAGE, Settings
    from pipelines.stage import Request, run_stage

    request = Request((), tmp_path / "out", no_report=True)
    outcome = run_stage(STAGE, request, Settings(recipe=str(tmp_path / "recipe.toml"), source=shared / "real" / "odrive"))
    assert outcome.result.logs[0].samples == 4000


def test_the_axis_of_one_joint_without_a_robot_is_asked_for(tmp_path: Path) -> None:
    named = {"t [s]": good()["t"], "angle [rad]": good()["q_1"], "torque [Nm]": good()["tau_1"]}
    draft = draft_recipe(write(tmp_path, text(named)))
    assert draft.blanks == ("robot.gravity",)
    assert "[0.0, 0.0, -9.81] on a vertical axis" in draft.text
    with pytest.raises(UsageError, match="gravity"):
        parse_recipe(draft.text)


@pytest.mark.parametrize("name", ["pos_read_data.csv", "curr_data.csv"])
def test_the_tx40_draft_finds_both_files_and_the_motor_side(shared: Path, name: str) -> None:
    draft = guess_recipe(shared / "real" / "tx40" / name)
    assert draft.blanks == ("time.rate", "signals.q.unit", "signals.tau.unit", "drive.transmission")  # named after a current
    filled = draft.text.replace('rate = "FILL IN"', "rate = 5000").replace('unit = "FILL IN"', 'unit = "rad"', 1)
    filled = filled.replace('unit = "FILL IN"', 'unit = "N m"')
    recipe = parse_recipe(filled.replace('"FILL IN"', str([40.0] * 6)))
    assert recipe.robot["use"] == "tx40.urdf"
    assert recipe.log.match == "pos_read_data.csv"
    assert (recipe.signals["q"].columns, recipe.signals["q"].unit, recipe.signals["tau"].file) == ("Joint_{j}", "rad",
                                                                                                   "curr_data.csv")
    assert "starts at 32, -45 times pi/2: by chance, or radians of the motor side" in draft.text


@pytest.mark.parametrize("brackets", ["（°）", "［deg］", "【度】", " （deg)"])
@pytest.mark.parametrize("encoding", ["utf-8", "gb18030"])
def test_units_in_wide_brackets_are_read(tmp_path: Path, brackets: str, encoding: str) -> None:
    named = {f"关节{name[-1]}角度{brackets}" if name[0] == "q" else name: values for name, values in good().items()}
    draft = draft_recipe(write(tmp_path, text(named).encode(encoding))).text
    assert 'q = { columns = "关节{j}角度", unit = "deg" }' in draft


@pytest.mark.parametrize(("top", "shares"), [(0.83, False), (1.0, True)])
def test_a_joint_is_a_share_of_a_range_only_where_it_reaches_its_end(tmp_path: Path, top: float, shares: bool) -> None:
    opening = top * np.abs(np.sin(3.0 * good()["t"]))
    assert ("a gripper's opening" in drafted(tmp_path, "# q in rad\n" + text(good() | {"q_3": opening}))) is shares


def test_one_joint_at_a_quarter_turn_is_chance_and_no_gear(tmp_path: Path) -> None:
    degrees = {f"q_{j}": np.rad2deg(good()[f"q_{j}"]) + (7.5 * np.pi if j == 2 else 0.0) for j in (1, 2, 3)}
    draft = drafted(tmp_path, text(good() | degrees))
    assert 'columns = "q_{j}", unit = "FILL IN"' in draft
    assert "# transmission = [100.0, 100.0, 100.0]" in draft


def test_a_map_is_recognised(shared: Path) -> None:
    assert "[[table]]" in guess_recipe(shared / "real" / "odrive" / "holding_current_forward.csv").text


@pytest.mark.parametrize(("unit", "factor"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_time_is_told_by_a_plausible_rate(tmp_path: Path, unit: str, factor: float) -> None:
    columns = good()
    draft = drafted(tmp_path, text(columns | {"t": columns["t"] * factor + 5.0 * factor}))
    assert f'unit = "{unit}"' in draft.split("[signals]")[0]


def test_degrees_are_told_by_a_recorded_velocity(tmp_path: Path) -> None:
    columns = good()
    degrees = {f"q_{j}": np.rad2deg(columns[f"q_{j}"]) for j in (1, 2, 3)}
    speeds = {f"dq_{j}": np.gradient(columns[f"q_{j}"], columns["t"]) for j in (1, 2, 3)}
    assert 'columns = "q_{j}", unit = "deg"' in drafted(tmp_path, text({**columns, **degrees, **speeds}))
    assert 'columns = "q_{j}", unit = "FILL IN"' in drafted(tmp_path, text({**columns, **speeds}))
    named = {f"{name} [rad/s]": values for name, values in speeds.items()}
    assert 'columns = "q_{j}", unit = "rad"' in drafted(tmp_path, text({**columns, **named}))


def test_a_flipped_torque_is_noticed(tmp_path: Path) -> None:
    columns = good()
    draft = drafted(tmp_path, text(columns | {"tau_2": -columns["tau_2"]}))
    assert "torque of joint 2 jumps against the speed" in draft
    assert "as friction does" in drafted(tmp_path, text(columns))


@pytest.mark.parametrize(("size", "found"), [(8192.0, 8192.0), (360.0, 360.0), (2 * np.pi, 2 * np.pi)])
def test_a_rollover_is_told_by_jumps_of_one_size(size: float, found: float) -> None:
    assert rollover(np.mod(np.linspace(0, 3.7 * size, 3000), size)[:, None]) == pytest.approx(found)
    assert rollover(np.sin(np.linspace(0, 9, 3000))[:, None]) is None


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300])
def test_holes_do_not_disturb_a_guess(tmp_path: Path, value: float) -> None:
    columns = good()
    columns["q_1"][5] = value
    columns["tau_2"][900] = value
    whole = guess_recipe(write(tmp_path, text(good()))).text
    assert guess_recipe(write(tmp_path, text(columns))).text == whole.replace("1200 samples", "1198 samples")


def test_a_handful_of_samples_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputRejected, match="RRID-T08"):
        drafted(tmp_path, "\n".join(text(good()).splitlines()[:6]) + "\n")


def test_names_that_are_toml_are_quoted(tmp_path: Path) -> None:
    columns = good()
    odd = {"t": columns["t"], 'pos "1" \\ (rad)': columns["q_1"], "tau #1 (Nm)": columns["tau_1"]}
    draft = guess_recipe(write(tmp_path, text(odd).replace('pos "1"', "pos '1'")))
    text_ = draft.text.replace('gravity = "FILL IN"', "gravity = [0.0, 0.0, -9.81]")
    assert parse_recipe(text_).signals["q"].column


def test_nanoseconds_since_1970_are_a_time(tmp_path: Path) -> None:
    """Such stamps lie beyond 1e18; they are neither absurd nor a hole."""
    stamps = 1.7e18 + 1024000.0 * np.arange(1200)
    draft = drafted(tmp_path / "data", text({"time_ns": stamps} | {k: v for k, v in stated(good()).items() if k != "t"}))
    recipe = parse_recipe(draft.replace('use = "FILL IN"', 'use = "rrr"'))
    assert (recipe.time.column, recipe.time.unit) == ("time_ns", "ns")


def test_a_reference_that_leads_the_torque_decides_no_sign() -> None:
    """Positions 20 ms ahead of the torque: its jumps lie off the reversals, and a sign read from them would be a false one."""
    t = np.arange(3000) / 250.0
    q, ahead = (np.sin(2.0 * at) + 0.4 * np.sin(5.1 * at) for at in (t, t + 0.02))
    speed = 2.0 * np.cos(2.0 * t) + 2.04 * np.cos(5.1 * t)
    tau = (10.0 * np.cos(q) + 4.0 * np.tanh(speed / 0.02) + 0.05 * np.random.default_rng(3).normal(size=t.size))[:, None]
    assert sign_of(q[:, None], -tau).value == "sign = -1?"
    assert sign_of(ahead[:, None], tau).value == "as recorded"


def test_positions_that_differ_by_a_constant_are_asked_about(tmp_path: Path) -> None:
    columns = good()
    further = {f"obs_q_{j}": columns[f"q_{j}"] - 0.3 for j in (1, 2, 3)}
    assert "signals.q" in guess_recipe(write(tmp_path, text(columns | further))).blanks


def _table(folder: Path, edit: Callable[[dict[str, Array]], None], header: Mapping[str, str]) -> str:
    """Return the draft for 700 samples at 250 Hz of three joints, edited, with their robot in the folder."""
    moved = simulate(ABC, seed=1, rate=250.0, seconds=2.8)
    columns: dict[str, Array] = {"t": moved.t}
    for name, values in (("q", moved.q), ("dq", moved.dq), ("tau", moved.tau)):
        columns |= {f"{name}{j + 1}": column for j, column in enumerate(values.T)}
    edit(columns)
    (folder / "arm.urdf").write_text(ABC.urdf())
    named = {header.get(name.rstrip("123"), name).replace("#", name[-1]): v for name, v in columns.items()}
    return drafted(folder, text(named))


def _scale(name: str, factor: float, offset: float = 0.0) -> Callable[[dict[str, Array]], None]:
    def edit(columns: dict[str, Array]) -> None:
        columns.update({c: np.round(factor * v + offset, 12) for c, v in columns.items() if c.rstrip("123") == name})
    return edit


def test_a_named_unit_that_the_robots_limits_contradict_is_a_blank(tmp_path: Path) -> None:
    """No joint moves over twice its range: "[rad]" above degrees is left open, and so is the side of the torque."""
    draft = _table(tmp_path, _scale("q", 180.0 / np.pi), {"q": "q# [rad]"})
    assert 'q = { columns = "q{j}", unit = "FILL IN" }' in draft
    assert "its name or header says 'rad', but joint 'a' would move over" in draft
    assert 'tau = { columns = "tau{j}", unit = "FILL IN" }' in draft


def test_a_named_unit_of_time_that_a_velocity_contradicts_is_a_blank(tmp_path: Path) -> None:
    draft = _table(tmp_path, _scale("t", 1000.0), {"t": "time [s]"})
    assert 'unit = "FILL IN"' in draft
    assert "says 's', but the recorded velocity is the slope of the position in ms" in draft


@pytest.mark.parametrize(("factor", "offset", "unit", "year"), [
    (1e7, 638503345312500000.0, "100 ns", "1"),
    (1.0 / 86400.0, 45415.5848524, "d", "1900"), (1.0, 3.797591e9, "s", "1970 or 1904"),
])
def test_a_clock_is_known_by_the_century_it_counts_to(tmp_path: Path, factor: float, offset: float, unit: str, year: str) -> None:
    """.NET counts 100 ns since the year 1, spreadsheets days since 1900, LabVIEW seconds since 1904."""
    draft = _table(tmp_path, _scale("t", factor, offset), {"t": "Ticks"})
    assert f'unit = "{unit}"   # sure, counted since the year {year},' in draft


def _arm(folder: Path, columns: Callable[[Run], dict[str, Array]], arm: Arm = THREE, head: str = "") -> str:
    """Return the draft for a simulated arm with its description, whose links are known, in the folder."""
    moved = simulate(arm, seed=3)
    (folder / "arm.urdf").write_text(arm.urdf())
    return draft_recipe(write(folder, head + text({"t [s]": moved.t} | columns(moved)))).text


def _block(pattern: str, values: Array) -> dict[str, Array]:
    return {pattern.replace("#", str(j)): column for j, column in enumerate(values.T, start=1)}


@pytest.mark.parametrize(("factor", "header", "unit"), [
    (1.0, "torque#", "N m"), ([0.3, 1.0, 4.0], "torque#", "FILL IN"), (0.01, "torque# [Nm]", "FILL IN")])
def test_a_torque_is_compared_with_what_the_robots_links_ask_for(tmp_path: Path, factor: object, header: str, unit: str) -> None:
    """A share of rated torques is several times the links' at one joint; the motor's is a hundredth of it."""
    draft = _arm(tmp_path, lambda run: _block("q#", run.q) | _block(header, run.tau * np.asarray(factor)))
    assert f'tau = {{ columns = "torque{{j}}", unit = "{unit}" }}' in draft


@pytest.mark.parametrize("wrong", ["order", "external"])
def test_motion_and_torque_that_the_robots_links_do_not_join_are_asked_about(tmp_path: Path, wrong: str) -> None:
    """Joints counted from the tip, or an external torque as the only one."""
    def columns(run: Run) -> dict[str, Array]:
        q = run.q[:, ::-1] if wrong == "order" else run.q
        return _block("q#", q) | _block("tau#", run.tau_ext if wrong == "external" else run.tau)

    assert 'q = { columns = "FILL IN", unit = "FILL IN" }' in _arm(tmp_path, columns)


@pytest.mark.parametrize("name", ["tau_dob#", "dstrb torque #", "外力矩# [Nm]"])
def test_a_torque_with_an_unexplained_word_is_asked_about(tmp_path: Path, name: str) -> None:
    """Where no links are known, a word that the positions' names have not may make it a part of the torque."""
    columns = good()
    named = {"t": columns["t"]} | {f"q{j}": columns[f"q_{j}"] for j in (1, 2, 3)}
    named |= {name.replace("#", str(j)): columns[f"tau_{j}"] for j in (1, 2, 3)}
    assert 'tau = { columns = "FILL IN", unit = "FILL IN" }' in drafted(tmp_path, text(named))


def test_a_computed_torque_does_not_pass_for_a_measured_one(tmp_path: Path) -> None:
    """Inverse dynamics follow the links without any friction: a word not known is not confirmed by that."""
    draft = _arm(tmp_path, lambda run: _block("q#", run.q) | _block("invdyn torque # [Nm]", run.tau_model))
    assert 'tau = { columns = "FILL IN", unit = "FILL IN" }' in draft


def test_joints_named_in_a_comment_give_the_order(tmp_path: Path) -> None:
    names = ", ".join(reversed(THREE.joints))
    draft = _arm(tmp_path, lambda run: _block("q#", run.q[:, ::-1]) | _block("tau#", run.tau[:, ::-1]), head=f"# joints: {names}\n")
    assert 'q = { columns = ["q3", "q2", "q1"], unit = "rad" }' in draft


def test_joints_named_in_a_list_of_a_parquet_file_give_the_order(tmp_path: Path) -> None:
    """Nanoseconds since 1970 are beyond 2^53, and rounded to far less than a step: they are the clock."""
    moved = simulate(THREE, seed=3)
    (tmp_path / "arm.urdf").write_text(THREE.urdf())
    frame = pd.DataFrame({"stamp_ns": 1712143331250000000 + np.round(1e9 * moved.t).astype(np.int64)})
    frame["name"] = [THREE.joints[::-1]] * len(frame)
    frame["position"], frame["effort"] = list(moved.q[:, ::-1]), list(moved.tau[:, ::-1])
    frame.to_parquet(tmp_path / "run.parquet")
    draft = draft_recipe(tmp_path / "run.parquet").text
    assert 'column = "stamp_ns"\nunit = "ns"' in draft
    assert 'columns = ["position_3", "position_2", "position_1"], unit = "rad"' in draft


def test_a_gripper_in_a_list_of_names_is_no_joint_of_an_arm_whose_end_is_open(tmp_path: Path) -> None:
    run = simulate(PANDA, seed=3, seconds=2.0)
    (tmp_path / "arm.urdf").write_text(PANDA.urdf())
    fingers = np.full((len(run.t), 2), 0.02)
    data = {"t": run.t, "name": [sorted((*PANDA.joints, *PANDA.fingers))] * len(run.t)}
    data |= {"position": np.hstack([fingers, run.q]).tolist(), "effort": np.hstack([fingers, run.tau]).tolist()}
    pd.DataFrame(data).to_parquet(tmp_path / "run.parquet")
    draft = draft_recipe(tmp_path / "run.parquet").text
    for name in ("position", "effort"):
        assert f"columns = {json.dumps([f'{name}_{j}' for j in range(3, 10)])}" in draft
        assert f"# left out, a gripper's by the file's names: {name}_1, {name}_2" in draft


def test_words_of_a_control_mode_are_no_names_of_columns(tmp_path: Path) -> None:
    """Three words, one of them "mode", beside three joints took the third joint for a gripper."""
    run = simulate(THREE, seed=3, seconds=2.0)
    data = {"control": "joint position mode", "t": run.t.tolist(), "position": run.q.tolist(), "effort": run.tau.tolist()}
    (tmp_path / "run.json").write_text(json.dumps(data))
    draft = draft_recipe(tmp_path / "run.json").text
    assert "position_3" in draft
    assert "gripper" not in draft


def test_a_position_that_never_moves_is_no_joint(tmp_path: Path) -> None:
    columns = good()
    named = {"t": columns["t"], "grippers_angle": 0.0 * columns["t"]} | {f"joint_{j}": columns[f"q_{j}"] for j in (1, 2, 3)}
    assert 'q = { columns = "FILL IN"' in drafted(tmp_path, text(named))


@pytest.mark.parametrize(("name", "clock"), [("planned_motion.csv", "t"), ("run.csv", "time_from_start")])
def test_a_plan_is_no_measurement(tmp_path: Path, name: str, clock: str) -> None:
    columns = {(clock if key == "t" else key): values for key, values in good().items()}
    draft = drafted(tmp_path, text(columns), name)
    assert 'q = { columns = "FILL IN"' in draft
    assert "the points of a plan: what was measured?" in draft


def test_a_feedback_torque_beside_its_feedforward_is_a_part(tmp_path: Path) -> None:
    """Alone, tau_fb is what an encoder or drive feeds back: the measured torque."""
    columns = {key.replace("tau", "tau_fb"): values for key, values in good().items()}
    assert 'tau = { columns = "tau_fb_{j}"' in drafted(tmp_path, text(columns))
    parts = columns | {f"tau_ff_{j}": columns[f"tau_fb_{j}"] for j in (1, 2, 3)}
    assert 'tau = { columns = "FILL IN"' in drafted(tmp_path, text(parts))


def test_a_list_of_names_in_one_cell_orders_the_joints(tmp_path: Path) -> None:
    """As a message of ROS holds them, in an order that is not the robot's."""
    rows = text(good()).splitlines()
    content = "\n".join([f"name,{rows[0]}", *(f"\"['c', 'a', 'b']\",{row}" for row in rows[1:])]) + "\n"
    (tmp_path / "arm.urdf").write_text(ABC.urdf())
    assert 'q = { columns = ["q_2", "q_3", "q_1"],' in drafted(tmp_path, content)


def test_rows_with_the_newest_first_are_refused(tmp_path: Path) -> None:
    """Torque against a motion that runs backwards would have its friction reversed."""
    with pytest.raises(InputRejected, match=r"RRID-T01.*newest row is first.*Sort the rows"):
        _table(tmp_path, lambda columns: columns.update({c: v[::-1] for c, v in columns.items()}), {})


def test_a_number_that_marks_a_lost_sample_is_proposed(tmp_path: Path) -> None:
    def lose(columns: dict[str, Array]) -> None:
        columns["q1"][[50, 300]] = columns["tau2"][400] = -9999.0
    draft = _table(tmp_path, lose, {})
    assert "[missing]\nvalues = [-9999.0]" in draft
    assert 'q = { columns = "q{j}"' in draft


def test_rows_of_zeros_are_proposed_as_lost_samples(tmp_path: Path) -> None:
    """A bus that answered nothing: the motion is judged by the other rows."""
    def columns(run: Run) -> dict[str, Array]:
        q, tau = run.q.copy(), run.tau.copy()
        q[[90, 91, 700]] = tau[[90, 91, 700]] = 0.0
        return _block("q#", q) | _block("q_ref#", run.q_ref) | _block("tau#", tau)
    draft = _arm(tmp_path, columns)
    assert "[missing]\nrows = [0.0]   # check: likely, 3 of " in draft
    assert 'q = { columns = "q{j}", unit = "rad" }' in draft


def test_an_arm_that_rests_at_its_zero_has_lost_no_samples(tmp_path: Path) -> None:
    def columns(run: Run) -> dict[str, Array]:
        near = np.clip(np.abs(np.arange(len(run.t)) - 600) / 100.0 - 1.0, 0.0, 1.0)[:, None]
        return _block("q#", near * run.q) | _block("tau#", near * run.tau)
    assert "[missing]" not in _arm(tmp_path, columns)


def test_files_of_one_signal_each_are_candidates_for_each_other(tmp_path: Path) -> None:
    """By their names, tau beside q; else all of as many columns and rows, but no other run."""
    moved = simulate(THREE, seed=3)
    (tmp_path / "arm.urdf").write_text(THREE.urdf())
    for name, block in (("q", moved.q), ("dq", moved.dq), ("tau", moved.tau)):
        np.save(tmp_path / f"{name}.npy", block)
    for name in ("q.npy", "tau.npy"):
        assert '# candidate: columns = "column_{j}", file = "tau.npy"' in guess_recipe(tmp_path / name).text
    for name, block in (("out_x1", moved.q), ("out_x2", moved.q), ("out_y1", moved.dq), ("out_z1", moved.tau)):
        np.savetxt(tmp_path / f"{name}.txt", np.column_stack([moved.t, block]))
    assert '# as many columns and rows: file = "out_y1.txt", file = "out_z1.txt"' in guess_recipe(tmp_path / "out_x1.txt").text


def test_a_quaternion_is_no_position_of_joints(tmp_path: Path) -> None:
    """Four columns whose squares add up to one, called q0 to q3, and the four joints' angles."""
    four = Arm("abcd", ("a", "b", "c", "d"), "zyyy", (150,) * 4)
    moved = simulate(four, seed=1, rate=250.0)
    half = 0.5 * moved.q[:, 0]
    turned = (np.cos(half), 0.6 * np.sin(half), 0.8 * np.sin(half), 0.0 * half)
    columns = {"t": moved.t} | {f"q{k}": v for k, v in enumerate(turned)}
    columns |= {f"angle{j + 1}": v for j, v in enumerate(moved.q.T)} | {f"tau{j + 1}": v for j, v in enumerate(moved.tau.T)}
    (tmp_path / "arm.urdf").write_text(four.urdf())
    assert 'q = { columns = "angle{j}", unit = "rad" }' in draft_recipe(write(tmp_path, text(columns))).text


@pytest.mark.parametrize(("position", "torque", "encoding"), [
    ("Posizione misurata giunto # [gradi]", "Coppia giunto # [N·m]", "utf-8"), ("実角度J#[deg]", "関節トルクJ#[Nm]", "cp932"),
    ("关节#实际角度(度)", "关节#力矩(牛米)", "gb18030"), ("Угол оси #, град", "Момент оси #, Нм", "cp1251"),
    ("Nivel # kulma [°]", "Nivel # momentti [Nm]", "cp1252")])
def test_names_in_other_languages_and_encodings_are_read(tmp_path: Path, position: str, torque: str, encoding: str) -> None:
    columns = good()
    named = {"t": columns["t"]}
    for name, signal in ((position, "q"), (torque, "tau")):
        named |= {name.replace("#", str(j)): columns[f"{signal}_{j}"] * (57.3 if signal == "q" else 1.0) for j in (1, 2, 3)}
    (tmp_path / "run.csv").write_bytes(text(named, ";").encode(encoding))
    draft = guess_recipe(tmp_path / "run.csv")
    assert draft.blanks == ("robot.use",)
    assert 'unit = "deg" }' in draft.text
    assert 'unit = "N m" }' in draft.text


@pytest.mark.parametrize(("factor", "unit"), [(1.0, "rad"), (180.0 / np.pi, "deg"), (55.0, "FILL IN")])
def test_the_torque_proves_the_unit_of_positions_without_a_velocity(tmp_path: Path, factor: float, unit: str) -> None:
    """Weight turns with sin(q): a motor's radians behind a gear of 55 would be degrees by their size alone."""
    load = 55.0 if unit == "FILL IN" else 1.0
    draft = _arm(tmp_path, lambda run: _block("position #", run.q * factor) | _block("torque #", run.tau / load))
    assert f'q = {{ columns = "position {{j}}", unit = "{unit}" }}' in draft


def test_a_small_motion_without_a_unit_is_asked_about(tmp_path: Path) -> None:
    """Up to 5.7: less than a turn in rad, and as well a few degrees."""
    columns = good()
    named = {"t": columns["t"]} | {f"axis position {j}": 4.0 * columns[f"q_{j}"] for j in (1, 2, 3)}
    named |= {f"axis torque {j} [Nm]": columns[f"tau_{j}"] for j in (1, 2, 3)}
    assert "rad, or the degrees of a small motion, or turns" in drafted(tmp_path, text(named))


@pytest.mark.parametrize("also", [True, False])
def test_joints_that_stand_in_each_others_place_are_asked_about(tmp_path: Path, also: bool) -> None:
    """Joints 2 and 3 exchanged in both, or in the torques alone: the robot's links agree far better the other way round."""
    order = [0, 2, 1]
    draft = _arm(tmp_path, lambda run: _block("q#", run.q[:, order] if also else run.q) | _block("tau#", run.tau[:, order]))
    assert "agree far better with joints 2 and 3 exchanged" in draft


def test_velocities_in_another_order_than_the_positions_are_asked_about(tmp_path: Path) -> None:
    draft = _arm(tmp_path, lambda run: _block("q#_rad", run.q) | _block("dq#", run.dq[:, [1, 0, 2]]) | _block("tau#_Nm", run.tau))
    assert 'q = { columns = "FILL IN"' in draft


def test_a_table_of_records_in_hdf5_is_read_like_named_columns(tmp_path: Path) -> None:
    import h5py

    columns = good()
    records = np.zeros(len(columns["t"]), [("t", "f8"), ("state", "S4"), ("q", "f8", 3), ("tau", "f8", 3)])
    records["t"] = columns["t"]
    for signal in ("q", "tau"):
        records[signal] = np.column_stack([columns[f"{signal}_{j}"] for j in (1, 2, 3)])
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["session/samples"] = records
    draft = guess_recipe(tmp_path / "run.h5")
    assert 'q = { columns = "session.samples.q_{j}"' in draft.text
    assert draft.blanks == ("robot.use", "signals.q.unit", "signals.tau.unit")


@pytest.mark.parametrize("orient", ["columns", "split", "records"])
def test_a_frame_that_pandas_wrote_as_json_is_read(tmp_path: Path, orient: str) -> None:
    pd.DataFrame(good()).to_json(tmp_path / "run.json", orient=orient)
    assert guess_recipe(tmp_path / "run.json").blanks == ("robot.use", "signals.q.unit", "signals.tau.unit")


def test_a_header_that_comes_again_is_left_out(tmp_path: Path) -> None:
    rows = text(good()).splitlines()
    draft = drafted(tmp_path, "\n".join([*rows[:600], rows[0], *rows[600:]]) + "\n")
    assert "the header comes again in 1 lines" in draft
    assert "1200 samples" in draft


def test_letters_that_may_mean_desired_or_derivative_are_decided_by_slopes(tmp_path: Path) -> None:
    """q1, q1d, q1dd: velocity and acceleration here, set points there; a commanded velocity is not measured."""
    def columns(run: Run) -> dict[str, Array]:
        return _block("q#", run.q) | _block("q#d", run.dq) | _block("q#dd", run.ddq) | _block("tau#", run.tau)

    draft = _arm(tmp_path, columns)
    assert 'q = { columns = "q{j}", unit = "rad" }' in draft
    assert 'dq = { columns = "q{j}d", unit = "rad/s" }' in draft
    draft = _arm(tmp_path, lambda run: columns(run) | _block("q#d", run.q_ref))
    assert 'dq = {' not in draft
    assert 'dq = {' not in _arm(tmp_path, lambda run: _block("q#", run.q) | _block("q#d_cmd", run.dq) | _block("tau#", run.tau))


def test_several_columns_of_each_joint_are_one_signal_each(tmp_path: Path) -> None:
    """waist, waist_u and waist_moment of a motion file in degrees: positions, their slopes and torques."""
    def columns(run: Run) -> dict[str, Array]:
        parts = (("", np.degrees(run.q)), ("_u", np.degrees(run.dq)), ("_moment", run.tau))
        return {joint + end: values[:, j] for end, values in parts for j, joint in enumerate(THREE.joints)}

    draft = _arm(tmp_path, columns)
    assert 'q = { columns = ["waist", "shoulder", "elbow"], unit = "deg" }' in draft
    assert 'tau = { columns = ["waist_moment", "shoulder_moment", "elbow_moment"], unit = "N m" }' in draft


@pytest.mark.parametrize(("path", "open_"), [("/model/meas/", False), ("cmd.", True), ("/model/", True)])
def test_a_path_of_all_signals_counts_where_it_says_commanded_or_computed(tmp_path: Path, path: str, open_: bool) -> None:
    draft = drafted(tmp_path, text({(path + key if key != "t" else key): values for key, values in good().items()}))
    assert ('columns = "FILL IN"' in draft) is open_


def test_the_rate_that_a_velocity_shows_lets_the_links_prove_the_torque(tmp_path: Path) -> None:
    moved = simulate(THREE, seed=3, rate=125.0)
    (tmp_path / "arm.urdf").write_text(THREE.urdf())
    columns = _block("position #", moved.q) | _block("velocity #", moved.dq) | _block("effort #", moved.tau)
    draft = draft_recipe(write(tmp_path, text(columns))).text
    assert "rate = 125 " in draft
    assert 'tau = { columns = "effort {j}", unit = "N m" }' in draft


@pytest.mark.parametrize(("head", "name"), [("# motor side; gear 50\n", "torque # [Nm]"), ("", "motor torque # [Nm]")])
def test_torques_of_a_motor_are_not_sure_to_be_the_joints(tmp_path: Path, head: str, name: str) -> None:
    """By a line above the table, or by their names, where no links are known to weigh a joint's torque."""
    named = {(name.replace("#", key[-1]) if "tau" in key else key): values for key, values in good().items()}
    draft = drafted(tmp_path, head + text(named))
    assert "# check: unsure, named so" in draft.partition("tau =")[2]
    assert ('transmission = "FILL IN"' in draft) is bool(head)


def test_settings_above_a_table_with_a_line_of_units_are_skipped(tmp_path: Path) -> None:
    """As oscilloscopes write them: two cells a setting, then a unit for each channel, then names."""
    moved = simulate(Arm("pendulum", ("joint",), "y", (30,)), seed=3)
    head = "Model,MSO58\nFirmware Version,1.38.5\n\nVertical Units,deg,deg/s,Nm\nLabels,angle,speed,torque\n"
    columns = {"TIME": moved.t - 6.0, "CH1": np.degrees(moved.q[:, 0]), "CH2": np.degrees(moved.dq[:, 0]), "CH3": moved.tau[:, 0]}
    draft = drafted(tmp_path, head + text(columns))
    assert 'q = { column = "CH1", unit = "deg" }' in draft
    assert 'tau = { column = "CH3", unit = "N m" }' in draft


def test_words_that_come_once_a_joint_are_a_signal_each(tmp_path: Path) -> None:
    """pyfri: a word that comes once, as dt, does not make one group of all that no word explains."""
    draft = _arm(tmp_path, lambda run: _block("mp#", run.q) | _block("mt#", run.tau) | {"dt": np.full(len(run.t), 0.005)})
    assert 'candidate: columns = "mp{j}"' in draft
    assert 'candidate: columns = "mt{j}"' in draft


def test_names_that_differ_in_their_units_alone_are_two_signals(tmp_path: Path) -> None:
    draft = _arm(tmp_path, lambda run: _block("q#_ticks", np.round(652 * run.q)) | _block("q#", run.q) | _block("tau#", run.tau))
    assert 'candidate: columns = "q{j}_ticks"' in draft
    assert 'candidate: columns = "q{j}"' in draft


def test_a_current_in_a_rms_keeps_its_unit_and_asks_for_the_constant(tmp_path: Path) -> None:
    draft = _arm(tmp_path, lambda run: _block("pos_# [rad]", run.q) | _block("I_# [Arms]", run.current))
    assert 'columns = "I_{j}", unit = "Arms"' in draft
    assert 'torque_constant = "FILL IN"' in draft


def test_a_velocity_that_is_not_imported_is_named(tmp_path: Path) -> None:
    moved = simulate(Arm("pendulum", ("joint",), "y", (30,)), seed=3)
    columns = {"t": moved.t, "q": moved.q[:, 0], "dq": moved.dq[::-1, 0], "tau": moved.tau[:, 0]}
    assert '# left out: dq (velocity), column = "dq"' in drafted(tmp_path, text(columns))


@pytest.mark.parametrize(("name", "quantity"), [("time_index", "index"), ("timestep", "index"), ("sample_time", "time"),
                                                ("step_time_ms", "time"), ("time of frame", "time")])  # fmt: skip
def test_the_last_noun_tells_a_clock_from_a_counter(name: str, quantity: str) -> None:
    """A counter is perfectly even, so it would be preferred to time stamps, and hide samples that are lost."""
    assert read_name(name).quantity == quantity


@pytest.mark.parametrize(("name", "unit"), [("torque_mNm", "mN m"), ("Moment_kNm", "kN m"), ("i_mA", "mA"), ("tau_Nm", "N m")])
def test_a_unit_with_its_prefix_is_one_word(name: str, unit: str) -> None:
    """Read as N m, a bench's torques would be a thousand times too large."""
    assert read_name(name).unit == unit


def test_numbers_named_by_the_texts_beside_them_are_columns(tmp_path: Path) -> None:
    """ROS 2's DynamicJointState: interface_names ["position", …] and values of each joint."""
    moved = simulate(THREE, seed=3)
    (tmp_path / "arm.urdf").write_text(THREE.urdf())
    names = ["position", "velocity", "effort"]
    lines = []
    for t, *row in zip(moved.t, moved.q, moved.dq, moved.tau, strict=True):
        held = [{"interface_names": names, "values": list(each)} for each in zip(*row, strict=True)]
        message = {"time": t, "joint_names": list(THREE.joints), "interface_values": held}
        lines.append(json.dumps(message))
    draft = draft_recipe(write(tmp_path, "\n".join(lines), "states.jsonl")).text
    assert '"interface_values[2].values[position]"], unit = "rad"' in draft
    assert '"interface_values[2].values[effort]"], unit = "N m"' in draft


@pytest.mark.parametrize("further", ["", "J#.6041h"])
def test_the_number_of_a_signal_beside_that_of_the_joint_tells_signals_apart(
    tmp_path: Path, further: str
) -> None:
    """Objects of CiA 402, 6064h a position, 6077h a torque; also where they are as many as joints."""

    def columns(run: Run) -> dict[str, Array]:
        more = _block(further, run.temperature) if further else {}
        return _block("J#.6064h", run.q) | _block("J#.6077h", run.tau) | more

    draft = _arm(tmp_path, columns)
    assert 'candidate: columns = "J{j}.6064h"' in draft
    assert 'candidate: columns = "J{j}.6077h"' in draft


def test_a_turning_joint_behind_a_sliding_one_has_a_velocity_of_its_own_unit(tmp_path: Path) -> None:
    moved = simulate(LIFT, seed=3)
    (tmp_path / "arm.urdf").write_text(LIFT.urdf())
    columns = {"t [s]": moved.t}
    for j, (factor, unit) in enumerate([(1e3, "mm"), *[(180 / np.pi, "deg")] * 3]):
        columns[f"q{j + 1} [{unit}]"] = factor * moved.q[:, j]
        columns[f"dq{j + 1} [{unit}/s]"] = factor * moved.dq[:, j]
        columns[f"tau{j + 1} [{'N m' if j else 'N'}]"] = moved.tau[:, j]
    draft = draft_recipe(write(tmp_path, text(columns))).text
    assert 'unit = ["mm", "deg", "deg", "deg"]' in draft


def test_times_with_their_milliseconds_behind_a_semicolon_are_a_clock(tmp_path: Path) -> None:
    """Studio 5000 writes 14:02:11;250."""
    columns = stated(good())
    seconds = columns.pop("t")
    times = [f"14:{int(s // 60):02d}:{int(s % 60):02d};{round(s % 1 * 1e3):03d}" for s in seconds]
    draft = drafted(tmp_path, pd.DataFrame({"Time": times} | columns).to_csv(index=False))
    assert 'column = "Time"\nunit = "s"' in draft


def test_times_that_differ_within_a_sample_are_reported(tmp_path: Path) -> None:
    """Motors on one bus are polled in turn; the log has one time for all of them."""
    moved = simulate(THREE, seed=3)
    times = (moved.t[:, None] + [0.0, 0.0004, 0.0008]).ravel()
    motor = np.tile([1, 2, 3], moved.t.size)
    columns = {"time": times, "motor_id": motor, "pos": moved.q.ravel(), "torque": moved.tau.ravel()}
    assert "'time' differs by 0.0008 in its own unit among them" in drafted(tmp_path, text(columns))


def test_a_stated_torque_constant_is_quoted(tmp_path: Path) -> None:
    columns = {f"I_{key[-1]} [A]" if "tau" in key else key: v for key, v in good().items()}
    line = "torque constants Kt [Nm/A]: 0.08, 0.08, 0.05"
    assert f"# the file states '{line}'" in drafted(tmp_path, f"# {line}\n{text(columns)}")


def test_another_file_that_may_hold_the_torques_is_named(tmp_path: Path) -> None:
    moved = simulate(THREE, seed=3)
    for name in (".hidden.csv", "forces.csv"):
        write(tmp_path, text({"t": moved.t} | _block("force_#", moved.tau)), name)
    (tmp_path / "folder.csv").mkdir()
    draft = drafted(tmp_path, text({"t": moved.t} | _block("q#", moved.q)), "angles_1.csv")
    assert 'if the torques are in another file: file = "forces.csv"\n' in draft


def test_lists_within_objects_of_a_list_are_no_columns(tmp_path: Path) -> None:
    """A laser scan of 2400 ranges in every frame does not hide the joints."""
    scan = [{"ranges": [1.0] * 60} for _ in range(40)]
    moved = simulate(THREE, seed=3)
    rows = zip(moved.t[:300].tolist(), moved.q[:300].tolist(), moved.tau[:300].tolist(), strict=True)
    frames = [{"t": t, "q": q, "tau": tau, "points": scan} for t, q, tau in rows]
    draft = drafted(tmp_path, json.dumps(frames), "run.json")
    assert 'columns = ["q[0]", "q[1]", "q[2]"]' in draft
    assert "ranges" not in draft
