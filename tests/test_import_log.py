"""Recordings become logs: both recorded sets, every kind of recipe, and every bad input an import can meet."""

from __future__ import annotations

import importlib.util
import json
import os
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest

from pipelines.errors import EnvironmentFault, InputRejected, NothingMatched, RrridError, UsageError
from pipelines.import_log import STAGE, Result, Settings, compute, report
from pipelines.log.files import open_log
from pipelines.log.results import decode
from pipelines.stage import Outcome, Request, run_stage
from tests.log.recording.good import RECIPE, codes, good, lines, run, text, write


@pytest.fixture(scope="session")
def checker(shared: Path) -> ModuleType:
    """The strict checker that was written apart from the project."""
    spec = importlib.util.spec_from_file_location("check_log", shared / "tools" / "check_log.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def imported(name: str, shared: Path, out: Path) -> Outcome[Result]:
    return run_stage(STAGE, Request((), out, no_report=True), Settings(recipe=name, source=shared / "real" / name))


@pytest.fixture(scope="module")
def tx40(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> Outcome[Result]:
    return imported("tx40", shared, tmp_path_factory.mktemp("tx40") / "out")


@pytest.fixture(scope="module")
def odrive(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> Outcome[Result]:
    return imported("odrive", shared, tmp_path_factory.mktemp("odrive") / "out")


# --- recorded data --------------------------------------------------------------------------------------------------


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


def test_odrive_turns_as_it_was_told(odrive: Outcome[Result], shared: Path) -> None:
    """0.1 revolutions a second for ten seconds; and no resampled position strays from the recorded ones."""
    log = open_log(odrive.folder / "logs" / "nocomp_0.h5").log
    assert np.polyfit(log.t, log.q[:, 0], 1)[0] / (2 * np.pi) == pytest.approx(0.1, rel=0.02)
    recorded = np.loadtxt(shared / "real" / "odrive" / "slow2_nocomp_0.csv", delimiter=",", skiprows=1)
    straight = np.interp(log.t, recorded[:, 0], recorded[:, 1]) * 2 * np.pi / 8192
    assert np.abs(log.q[:, 0] - straight).max() < 1.5 * 2 * np.pi / 8192


def test_odrive_maps_become_tables_with_units(odrive: Outcome[Result]) -> None:
    table = pq.read_table(odrive.folder / "tables" / "holding_current_forward.parquet")
    assert table.num_rows == 2048
    assert [table.schema.field(c).metadata[b"units"] for c in ("position", "current")] == [b"rad", b"A"]
    assert table.column("position")[1].as_py() == pytest.approx(4 * 2 * np.pi / 8192)


# --- what a recipe can do -------------------------------------------------------------------------------------------


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the good recording in it."""
    write(tmp_path / "data", text(good()))
    return tmp_path / "data"


def only_log(outcome: Outcome[Result]) -> object:
    (item,) = outcome.result.logs
    return open_log(outcome.folder / item.file).log


def test_a_good_recording_is_imported_bit_for_bit(folder: Path, checker: ModuleType) -> None:
    outcome = run(folder)
    log = open_log(outcome.folder / "logs" / "run.h5").log
    assert np.array_equal(log.t, good()["t"])
    assert np.array_equal(log.tau[:, 2], good()["tau_3"])
    assert not outcome.checks
    assert "nothing had to be repaired" in outcome.report.verdict
    assert not any(checker.check_folder(outcome.folder).values())


def test_c02_samples_are_not_invented(folder: Path) -> None:
    with pytest.raises(UsageError, match="RRID-C02.*1e\\+06 Hz, the recording has 1000 Hz"):
        run(folder, RECIPE + "[resample]\nrate = 1e6\n")


def test_equal_inputs_give_equal_files(folder: Path) -> None:
    first = run(folder, RECIPE + "[resample]\nrate = 500\n")
    bytes_of = (first.folder / "logs" / "run.h5").read_bytes(), (first.folder / "result.json").read_bytes()
    again = run(folder, RECIPE + "[resample]\nrate = 500\n")
    assert ((again.folder / "logs" / "run.h5").read_bytes(), (again.folder / "result.json").read_bytes()) == bytes_of


def test_one_recipe_covers_many_files(folder: Path) -> None:
    (folder / "run.csv").rename(folder / "friction_1_identify.csv")
    for name in ("friction_2_identify.csv", "excitation_2_validate.csv", "warmup.csv"):
        write(folder, text(good()), name)
    recipe = RECIPE.replace('match = "*.csv"\nexperiment = "excitation"',
                            'match = "{experiment}_{joint}_{role}.csv"\nname = "{experiment}-{joint}"')
    outcome = run(folder, recipe)
    assert [(i.name, i.experiment, i.joint, i.role) for i in outcome.result.logs] == [
        ("excitation-2", "excitation", None, "validate"), ("friction-1", "friction", 1, "identify"),
        ("friction-2", "friction", 2, "identify")]
    assert outcome.result.ignored == ("warmup.csv",)


def test_a_table_of_cases_overrules_the_defaults(folder: Path) -> None:
    for name in ("a.csv", "b.csv"):
        write(folder, text(good()), name)
    cases = '[[file]]\nmatch = "a.csv"\nrole = "reference"\nname = "healthy"\n[[file]]\nmatch = "b.csv"\nskip = true\n'
    outcome = run(folder, RECIPE.replace("[time]", cases + "[time]"))
    assert {i.name: i.role for i in outcome.result.logs} == {"healthy": "reference", "run": "identify"}


def test_names_are_unique_and_file_names_harmless(folder: Path) -> None:
    for name in ("../b.csv".replace("../", "ü "), "c d.csv"):
        write(folder, text(good()), name)
    outcome = run(folder, RECIPE.replace('match = "*.csv"', 'match = "*.csv"\nname = "../same name"'))
    assert [i.name for i in outcome.result.logs] == ["../same name", "../same name-2", "../same name-3"]
    assert all((outcome.folder / i.file).resolve().is_relative_to(outcome.folder.resolve()) for i in outcome.result.logs)


def split_files(folder: Path) -> str:
    """Positions in one file, torques in another, no time: as the TX40 was recorded."""
    columns = good()
    (folder / "run.csv").unlink()
    write(folder, text({k: v for k, v in columns.items() if k.startswith("q")}), "a_pos.csv")
    write(folder, text({k: v for k, v in columns.items() if k.startswith("tau")}), "a_tau.csv")
    recipe = RECIPE.replace('"*.csv"', '"{run}_pos.csv"\nname = "{run}"').replace('unit = "N m"',
                                                                                  'unit = "N m", file = "{run}_tau.csv"')
    return recipe.replace('column = "t"\nunit = "s"', "rate = 1000")


def test_two_files_make_one_log(folder: Path) -> None:
    outcome = run(folder, split_files(folder))
    log = open_log(outcome.folder / "logs" / "a.h5").log
    assert np.allclose(log.t, good()["t"], rtol=0, atol=1e-12)
    assert np.array_equal(log.tau[:, 0], good()["tau_1"])
    assert len(outcome.result.logs[0].sources) == 2


def test_s01_a_companion_that_is_missing_is_named(folder: Path) -> None:
    recipe = split_files(folder)
    (folder / "a_tau.csv").rename(folder / "a_tua.csv")
    with pytest.raises(InputRejected, match=r"RRID-S01.*'a_tau.csv' is missing.*did you mean 'a_tua.csv'"):
        run(folder, recipe)


def test_s16_files_of_different_lengths_are_not_one_recording(folder: Path) -> None:
    recipe = split_files(folder)
    rows = (folder / "a_tau.csv").read_text().splitlines()
    (folder / "a_tau.csv").write_text("\n".join(rows[:900]) + "\n")
    with pytest.raises(InputRejected, match="RRID-S16.*1200 and 899 samples"):
        run(folder, recipe)


def two_clocks(folder: Path) -> str:
    columns = good()
    (folder / "run.csv").unlink()
    write(folder, text({k: v for k, v in columns.items() if not k.startswith("tau")}), "a_pos.csv")
    late = columns["t"][100:-1] + 0.0004
    tau = {k: np.interp(late, columns["t"], v) for k, v in columns.items() if k.startswith("tau")}
    write(folder, text({"t": late} | tau), "a_tau.csv")
    return RECIPE.replace('"*.csv"', '"{run}_pos.csv"').replace('unit = "N m"', 'unit = "N m", file = "{run}_tau.csv"')


def test_files_with_clocks_of_their_own_meet_on_one_grid(folder: Path) -> None:
    outcome = run(folder, two_clocks(folder) + "[resample]\nrate = 1000\n")
    log = open_log(outcome.folder / "logs" / "a_pos.h5").log
    assert log.t[0] == pytest.approx(0.1004)
    assert np.abs(log.tau[:, 0] - np.interp(log.t, good()["t"], good()["tau_1"])).max() < 0.05


def test_t06_two_clocks_without_resampling_are_refused(folder: Path) -> None:
    with pytest.raises(InputRejected, match=r"RRID-T06.*different time stamps.*\[resample\]"):
        run(folder, two_clocks(folder))


def test_map_takes_a_column_of_another_name(folder: Path) -> None:
    write(folder, text(good()).replace("q_1", "Joint_1", 1))
    with pytest.raises(InputRejected, match="RRID-S01.*'q_1'"):
        run(folder)
    assert np.array_equal(open_log(run(folder, map=("q_1=Joint_1",)).folder / "logs" / "run.h5").log.q[:, 0], good()["q_1"])


@pytest.mark.parametrize("entry", ["q_1", "q=Joint_1", "speed_1=x", "q_1="])
def test_c02_a_map_that_is_none(folder: Path, entry: str) -> None:
    with pytest.raises(UsageError, match="RRID-C02 --map"):
        run(folder, map=(entry,))


def test_a_controller_is_kept(folder: Path) -> None:
    controller = '[controller]\nlaw = "pd"\nkp = [1.0, 2.0, 3.0]\nkd = [0.1, 0.2, 0.3]\nfeedforward = ["friction"]\n'
    log = open_log(run(folder, RECIPE + controller).folder / "logs" / "run.h5").log
    assert log.controller is not None
    assert log.controller.kp is not None
    assert log.controller.kp.tolist() == [1.0, 2.0, 3.0]
    assert log.controller.feedforward == ("friction",)


def test_a_stored_result_is_redrawn(folder: Path) -> None:
    """`report` needs no samples: what `result.json` holds is enough, figures included."""
    outcome = run(folder)
    stored = decode(Result, json.loads((outcome.folder / "result.json").read_text()), {})
    again = report(stored)
    assert again.verdict == outcome.report.verdict
    from matplotlib.figure import Figure

    for section in again.sections:
        for drawn in section.figures:
            drawn.draw(Figure(drawn.size))


# --- bad input ------------------------------------------------------------------------------------------------------


def spoiled(folder: Path, column: str, at: object, value: float) -> None:
    columns = good()
    columns[column][at] = value  # type: ignore[index]
    write(folder, text(columns))


def rows_changed(folder: Path, change: Callable[[list[str]], list[str]]) -> None:
    write(folder, "\n".join(change(lines())) + "\n")


REPAIRS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "D01": ("repair", lambda f: spoiled(f, "q_2", 77, np.nan)),
    "D03": ("repair", lambda f: spoiled(f, "tau_2", slice(70, 73), -999.0)),
    "F06": ("warn", lambda f: write(f, text(good()), "run.mat") and (f / "run.csv").unlink()),
    "F09": ("repair", lambda f: write(f, text(good())[:-50])),
    "F16": ("warn", lambda f: write(f, text(good()).replace(",", ";").replace(".", ","))),
    "T01": ("repair", lambda f: spoiled(f, "t", slice(600, None), 0.0) or clock_set_back(f)),
    "T02": ("repair", lambda f: rows_changed(f, lambda r: [*r[:50], r[49], *r[50:]])),
    "T03": ("warn", lambda f: rows_changed(f, lambda r: [*r[:50], *r[52:]])),
    "T04": ("warn", lambda f: rows_changed(f, lambda r: [*r[:50], *r[152:]])),
}


def clock_set_back(folder: Path) -> None:
    columns = good()
    columns["t"][600:] -= 0.25
    write(folder, text(columns))


@pytest.mark.parametrize("code", REPAIRS)
def test_what_can_be_mended_is_mended_said_and_an_error_when_strict(code: str, folder: Path, checker: ModuleType) -> None:
    level, spoil = REPAIRS[code]
    spoil(folder)
    recipe = RECIPE.replace('"*.csv"', '["*.csv", "*.mat"]') + "[missing]\nvalues = [-999]\n"
    outcome = run(folder, recipe)
    assert codes(outcome)[code] == level
    assert all(check.where for check in outcome.checks)
    assert not any(checker.check_folder(outcome.folder).values())
    if level == "repair":
        assert all(item.log.derived is not None for item in outcome.result.logs)
        with pytest.raises(InputRejected, match=f"RRID-{code}"):
            run(folder, recipe, strict=True)


def test_t01_the_parts_are_logs_of_their_own(folder: Path) -> None:
    clock_set_back(folder)
    assert [(i.name, i.samples) for i in run(folder).result.logs] == [("run-1", 600), ("run-2", 600)]


def unit_away(recipe: str) -> str:
    return recipe.replace(', unit = "rad"', "")


REFUSED: dict[str, tuple[str, Callable[[Path], object], str, str]] = {
    "empty file": ("F01", lambda f: write(f, ""), RECIPE, "empty file"),
    "directory": ("C06", lambda f: ((f / "run.csv").unlink(), (f / "run.csv").mkdir()), RECIPE, "no file matches"),
    "FIFO": ("F12", lambda f: ((f / "run.csv").unlink(), os.mkfifo(f / "run.csv")), RECIPE, "not a regular file"),
    "device": ("F12", lambda f: ((f / "run.csv").unlink(), (f / "run.csv").symlink_to("/dev/zero")), RECIPE,
               "not a regular file|outside"),
    "column missing": ("S01", lambda f: write(f, text(good()).replace("tau_2", "tua_2", 1)), RECIPE,
                       "'tau_2', did you mean 'tua_2'.*--map"),
    "a fourth joint": ("S02", lambda f: write(f, text(good() | {"q_4": good()["q_1"]})), RECIPE,
                       "4 columns for q, but the robot has 3"),
    "names twice": ("S03", lambda f: write(f, text(good()).replace("q_3", "q_2", 1)), RECIPE,
                    "columns 3 and 4 are both named 'q_2'"),
    "no unit": ("S04", lambda f: None, unit_away(RECIPE), 'signal q: no unit.*unit = "rad"'),
    "volts": ("S05", lambda f: None, RECIPE.replace('"N m"', '"V"'), "unknown unit 'V'; torque needs one of N m"),
    "header says otherwise": ("S05", lambda f: write(f, text(good()).replace("q_1", "q_1 [deg]", 1)), RECIPE,
                              "the header says 'deg'"),
    "milliseconds": ("S08", lambda f: milliseconds(f), RECIPE.replace('unit = "s"', 'unit = "s"\nrate = 1000'),
                     "in ms it would fit"),
    "unit of time open": ("S08", lambda f: milliseconds(f), RECIPE.replace('unit = "s"', ""), "could be"),
    "period for rate": ("S09", lambda f: None, RECIPE.replace('column = "t"\nunit = "s"', "rate = 0.001"), "a period"),
    "current": ("S10", lambda f: None, RECIPE.replace('"N m"', '"A"'), "torque_constant"),
    "words": ("S12", lambda f: rows_changed(f, lambda r: [r[0], *(x.rsplit(",", 1)[0] + ",off" for x in r[1:])]), RECIPE,
              "'tau_3'.*'off'"),
    "wild clock": ("T01", lambda f: spoiled(f, "t", slice(10, None, 100), 0.0), RECIPE, "runs backwards"),
    "stamps twice": ("T02", lambda f: spoiled(f, "t", 100, float(good()["t"][99])), RECIPE, "line 102"),
    "shorter than a period": ("T07", lambda f: None, RECIPE.replace("[time]", "period = 10.0\n[time]"), "1.199 s < 10 s period"),
    "one sample": ("T08", lambda f: write(f, "\n".join(lines()[:2]) + "\n"), RECIPE, "1 time stamp"),
    "no sample": ("T08", lambda f: write(f, lines()[0] + "\n"), RECIPE, "no sample"),
    "channel of NaN": ("D02", lambda f: spoiled(f, "tau_1", slice(None), np.nan), RECIPE, "'tau_1'"),
    "infinite": ("D03", lambda f: spoiled(f, "q_3", 5, np.inf), RECIPE, "inf in line 7"),
    "absurd": ("D03", lambda f: spoiled(f, "q_3", 5, 1e300), RECIPE, "1e\\+300 in line 7"),
    "undeclared sentinel": ("D03", lambda f: spoiled(f, "q_3", 5, -999.0), RECIPE, r"\[missing\] values = \[-999\]"),
    "spreadsheet error": ("F16", lambda f: rows_changed(f, lambda r: [*r[:9], "#REF!," + r[9].split(",", 1)[1], *r[10:]]), RECIPE,
                          "line 10"),
    "much damage": ("F09", lambda f: rows_changed(f, lambda r: [*r[:9], *(x[: len(x) // 2] for x in r[9:40]), *r[40:]]), RECIPE,
                    "31 of 1200"),
    "archive": ("X12", lambda f: write(f, b"PK\x03\x04" + bytes(100)), RECIPE, "archive"),
    "nothing matches": ("C06", lambda f: (f / "run.csv").unlink(), RECIPE, "no file matches"),
    "companion outside": ("X11|S01", lambda f: None, RECIPE.replace('unit = "N m"', 'unit = "N m", file = "../../etc/passwd"'),
                          "passwd"),
    "frf without excitation": ("S01", lambda f: None, RECIPE.replace('"excitation"', '"frf"\njoint = 1'), "excitation v"),
}


def milliseconds(folder: Path) -> None:
    write(folder, text(good() | {"t": np.arange(1200) * 1.0}))


EXITS = {"C06": 5, "X12": 2}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_mended_is_refused_with_place_and_remedy(name: str, folder: Path) -> None:
    code, spoil, recipe, words = REFUSED[name]
    spoil(folder)
    with pytest.raises(RrridError, match=f"(?s)RRID-({code}).*({words})") as caught:
        run(folder, recipe)
    assert caught.value.exit_code == EXITS.get(code, 3)
    assert caught.value.where
    assert caught.value.remedy
    assert not (folder.parent / "out").exists()


def test_f15_a_file_that_is_still_written(folder: Path) -> None:
    import fcntl

    with (folder / "run.csv").open("a") as logger:
        fcntl.flock(logger, fcntl.LOCK_EX)
        with pytest.raises(EnvironmentFault, match=r"RRID-F15.*run.csv.*in use"):
            run(folder)


def test_a_companion_is_no_log_of_its_own(folder: Path) -> None:
    recipe = split_files(folder).replace('"{run}_pos.csv"\nname = "{run}"', '"*.csv"').replace("{run}_tau", "a_tau")
    assert [i.name for i in run(folder, recipe).result.logs] == ["a_pos"]


def test_d07_angles_that_wrap_are_unwrapped_without_being_asked(folder: Path) -> None:
    """D07: joint 1 turns through ±pi; its wrapped angle comes back as the motion it was, but for whole turns."""
    columns = good()
    turning = 3.0 + 6.0 * columns["t"]
    write(folder, text(columns | {"q_1": np.mod(turning + np.pi, 2 * np.pi) - np.pi}))
    outcome = run(folder)
    assert codes(outcome) == {"D07": "warn"}
    assert np.allclose(np.diff(open_log(outcome.folder / "logs" / "run.h5").log.q[:, 0]), np.diff(turning), atol=1e-12)


def test_s04_assume_units_takes_si_and_says_so(folder: Path) -> None:
    assert codes(run(folder, unit_away(RECIPE), assume_units=True)) == {"S04": "warn"}


def test_s07_radians_that_are_degrees(folder: Path) -> None:
    """S07: ±40 degrees declared as radians leave a joint that can do ±2 rad by far."""
    columns = good()
    write(folder, text(columns | {f"q_{j}": np.rad2deg(columns[f"q_{j}"]) for j in (1, 2, 3)}))
    joint = '[[robot.joint]]\nname = "j"\ntype = "revolute"\na = 0.0\nalpha = 0.0\nd = 0.0\noffset = 0.0\nposition = [-2.0, 2.0]\n'
    recipe = RECIPE.replace('use = "rrr"',
                            'name = "r"\ngravity = [0.0, 0.0, -9.81]\n[robot.kinematics]\nconvention = "dh"\n' + 3 * joint)
    with pytest.raises(InputRejected, match=r"RRID-S07.*column 'q_1'.*looks like degrees.*--trust-units"):
        run(folder, recipe)
    assert run(folder, recipe, trust_units=True).result.logs
    assert run(folder, recipe.replace('"rad"', '"deg"')).result.logs


def test_f13_no_permission_is_the_environment(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Tests may run as root, whom no permission stops.
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path).name != "run.csv")
    with pytest.raises(EnvironmentFault, match=r"RRID-F13.*run.csv.*permission denied"):
        run(folder)


def test_f14_a_file_that_changes_meanwhile(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def meddle(inputs: object, settings: Settings) -> Result:
        with (folder / "run.csv").open("a") as file:
            file.write("1\n")
        return compute(inputs, settings)  # type: ignore[arg-type]

    monkeypatch.setattr("tests.log.recording.good.STAGE", __import__("dataclasses").replace(STAGE, compute=meddle))
    with pytest.raises(InputRejected, match="RRID-F14"):
        run(folder)


def test_a_recipe_that_is_not_there() -> None:
    with pytest.raises(UsageError, match="RRID-C04.*did you mean 'tx40'"):
        run_stage(STAGE, Request(()), Settings(recipe="tx4"))


def test_nothing_matched_names_the_patterns(folder: Path) -> None:
    with pytest.raises(NothingMatched, match=r"RRID-C06.*run_\{n\}.csv"):
        run(folder, RECIPE.replace('"*.csv"', '"run_{n}.csv"'))


def test_parquet_on_request(folder: Path) -> None:
    (folder.parent / "recipe.toml").write_text(RECIPE)
    request = Request((), folder.parent / "out", format="parquet", no_report=True)
    outcome = run_stage(STAGE, request, Settings(recipe=str(folder.parent / "recipe.toml"), source=folder))
    assert np.array_equal(open_log(outcome.folder / "logs" / "run.parquet").log.t, good()["t"])


def test_a_log_names_the_recording_it_was_altered_from(folder: Path) -> None:
    outcome = run(folder, RECIPE + "[resample]\nrate = 250\n")
    with h5py.File(outcome.folder / "logs" / "run.h5") as file:
        derived = dict(file["derived"].attrs)
    assert derived["command"] == "import"
    assert derived["source_sha256"] == outcome.result.logs[0].sources[0].sha256
    assert derived["created"] == "1970-01-01T00:00:00Z"
    assert "to 300 at 250 Hz, natural cubic spline" in derived["settings"]
