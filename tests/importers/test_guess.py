"""A drafted recipe is nearly right, says what it rests on, and runs once its blanks are filled."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from benchmarks.recorded_arm import THREE, Arm, Run, simulate
from pipelines.errors import InputRejected, UsageError
from pipelines.import_log import draft_recipe
from pipelines.importers.guess import guess_recipe
from pipelines.importers.names import read_name
from pipelines.importers.recipe import parse_recipe
from pipelines.io.files import open_log
from tests.importers.good import Array, good, run, text, write

ABC = Arm("abc", ("a", "b", "c"), "zyy", (150, 150, 150))


DENIED = 'q = { columns = "q{j}", unit = "FILL IN" }'
DEG, NM = "q# [deg]", "tau# [Nm]"


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


@pytest.mark.parametrize(("unit", "factor"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_time_is_told_by_a_plausible_rate(tmp_path: Path, unit: str, factor: float) -> None:
    columns = good()
    draft = drafted(tmp_path, text(columns | {"t": columns["t"] * factor + 5.0 * factor}))
    assert f'unit = "{unit}"' in draft.split("[signals]")[0]


def test_degrees_are_told_by_a_recorded_velocity(tmp_path: Path) -> None:
    columns = good()
    degrees = {f"q_{j}": np.rad2deg(columns[f"q_{j}"]) for j in (1, 2, 3)}
    speeds = {f"dq_{j}": np.gradient(columns[f"q_{j}"], columns["t"]) for j in (1, 2, 3)}
    assert 'columns = "q_{j}", unit = "FILL IN"' in drafted(tmp_path, text({**columns, **degrees, **speeds}))
    assert 'columns = "q_{j}", unit = "FILL IN"' in drafted(tmp_path, text({**columns, **speeds}))
    named = {f"{name} [rad/s]": values for name, values in speeds.items()}
    assert 'columns = "q_{j}", unit = "rad"' in drafted(tmp_path, text({**columns, **named}))
    assert 'columns = "q_{j}", unit = "deg"' in drafted(tmp_path, text({**columns, **degrees, **named}))


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


def test_nanoseconds_since_1970_are_a_time(tmp_path: Path) -> None:
    """Such stamps lie beyond 1e18; they are neither absurd nor a hole."""
    stamps = 1.7e18 + 1024000.0 * np.arange(1200)
    draft = drafted(tmp_path / "data", text({"time_ns": stamps} | {k: v for k, v in stated(good()).items() if k != "t"}))
    recipe = parse_recipe(draft.replace('use = "FILL IN"', 'use = "rrr"'))
    assert (recipe.time.column, recipe.time.unit) == ("time_ns", "ns")


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


@pytest.mark.parametrize(("name", "clock"), [("planned_motion.csv", "t"), ("run.csv", "time_from_start")])
def test_a_plan_is_no_measurement(tmp_path: Path, name: str, clock: str) -> None:
    columns = {(clock if key == "t" else key): values for key, values in good().items()}
    draft = drafted(tmp_path, text(columns), name)
    assert 'q = { columns = "FILL IN"' in draft
    assert "the points of a plan: what was measured?" in draft


def test_rows_with_the_newest_first_are_refused(tmp_path: Path) -> None:
    """Torque against a motion that runs backwards would have its friction reversed."""
    with pytest.raises(InputRejected, match=r"RRID-T01.*newest row is first.*Sort the rows"):
        _table(tmp_path, lambda columns: columns.update({c: v[::-1] for c, v in columns.items()}), {})


@pytest.mark.parametrize(("factor", "unit"), [(1.0, "rad"), (180.0 / np.pi, "deg"), (55.0, "FILL IN")])
def test_the_torque_proves_the_unit_of_positions_without_a_velocity(tmp_path: Path, factor: float, unit: str) -> None:
    """Weight turns with sin(q): a motor's radians behind a gear of 55 would be degrees by their size alone."""
    load = 55.0 if unit == "FILL IN" else 1.0
    draft = _arm(tmp_path, lambda run: _block("position #", run.q * factor) | _block("torque #", run.tau / load))
    assert f'q = {{ columns = "position {{j}}", unit = "{unit}" }}' in draft


@pytest.mark.parametrize(("name", "quantity"), [("time_index", "index"), ("timestep", "index"), ("sample_time", "time"),
                                                ("step_time_ms", "time")])  # fmt: skip
def test_the_last_noun_tells_a_clock_from_a_counter(name: str, quantity: str) -> None:
    """A counter is perfectly even, so it would be preferred to time stamps, and hide samples that are lost."""
    assert read_name(name).quantity == quantity


@pytest.mark.parametrize(("name", "unit"), [("torque_mNm", "mN m"), ("Moment_kNm", "kN m"), ("i_mA", "mA"), ("tau_Nm", "N m")])
def test_a_unit_with_its_prefix_is_one_word(name: str, unit: str) -> None:
    """Read as N m, a bench's torques would be a thousand times too large."""
    assert read_name(name).unit == unit


def test_the_odrive_draft_is_the_shipped_recipe(shared: Path) -> None:
    draft = guess_recipe(shared / "real" / "odrive" / "slow2_nocomp_0.csv")
    assert draft.blanks == ("robot.use", "signals.q.counts_per_rev", "drive.torque_constant")
    filled = draft.text.replace('counts_per_rev = "FILL IN"', "counts_per_rev = 8192")
    recipe = parse_recipe(filled.replace('torque_constant = "FILL IN"', "torque_constant = 0.0551").replace("FILL IN", "rrr"))
    assert (recipe.time.column, recipe.time.unit) == ("t_s", "s")
    assert (recipe.signals["q"].columns, recipe.signals["q"].column) == (None, "pos_counts")
    assert recipe.signals["tau"].unit == "A"
    assert recipe.resample is not None
    assert recipe.resample.rate == 400.0


def test_degrees_that_the_torque_proves_to_be_radians_are_a_blank(tmp_path: Path) -> None:
    """A header of an earlier version, without a velocity that would contradict it."""
    draft = _arm(tmp_path, lambda run: _block(DEG, run.q) | _block(NM, run.tau))
    assert DENIED in draft
    assert "says 'deg', but the torque follows from the motion by the robot's links if it is in rad" in draft
