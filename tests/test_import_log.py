"""Recordings become logs: what a recipe can do."""

from __future__ import annotations

import json
from pathlib import Path
from types import ModuleType

import h5py
import numpy as np
import pytest

from pipelines.errors import InputRejected, UsageError
from pipelines.import_log import STAGE, Result, Settings, report
from pipelines.io.files import open_log
from pipelines.io.results import decode
from pipelines.stage import Request, run_stage
from tests.importers.good import RECIPE, good, run, strict_checker, text, write
from tests.repairs import split_files


@pytest.fixture(scope="module")
def checker(shared: Path) -> ModuleType:
    return strict_checker(shared)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the good recording in it."""
    write(tmp_path / "data", text(good()))
    return tmp_path / "data"


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


def test_parquet_on_request(folder: Path) -> None:
    (folder.parent / "recipe.toml").write_text(RECIPE)
    request = Request((), folder.parent / "out", format="parquet", no_report=True)
    outcome = run_stage(STAGE, request, Settings(recipe=str(folder.parent / "recipe.toml"), source=folder))
    assert [item.file for item in outcome.result.logs] == ["logs/run.parquet"]
    assert np.array_equal(open_log(outcome.folder / "logs" / "run.parquet").log.t, good()["t"])


@pytest.mark.parametrize("container", ["h5", "parquet"])
def test_every_file_that_the_result_names_is_there(folder: Path, container: str) -> None:
    (folder.parent / "recipe.toml").write_text(RECIPE)
    request = Request((), folder.parent / "out", format=container, no_report=True)
    outcome = run_stage(STAGE, request, Settings(recipe=str(folder.parent / "recipe.toml"), source=folder))
    named = {item["file"] for item in json.loads((outcome.folder / "result.json").read_text())["logs"]}
    assert named == {path.relative_to(outcome.folder).as_posix() for path in outcome.folder.glob("logs/*")}


def test_a_log_names_the_recording_it_was_altered_from(folder: Path) -> None:
    outcome = run(folder, RECIPE + "[resample]\nrate = 250\n")
    with h5py.File(outcome.folder / "logs" / "run.h5") as file:
        derived = dict(file["derived"].attrs)
    assert derived["command"] == "import"
    assert derived["source_sha256"] == outcome.result.logs[0].sources[0].sha256
    assert derived["created"] == "1970-01-01T00:00:00Z"
    assert "to 300 at 250 Hz, natural cubic spline" in derived["settings"]


@pytest.mark.parametrize(("samples", "periods"), [(1000, 1), (1001, 1), (999, 0)])
def test_t07_exactly_one_period_is_a_whole_one(folder: Path, samples: int, periods: int) -> None:
    """N samples of a period of N sample times are enough; the last of them holds until the period ends."""
    write(folder, text({name: values[:samples] for name, values in good().items()}))
    recipe = RECIPE.replace("[time]", "period = 1.0\n[time]")
    if not periods:
        with pytest.raises(InputRejected, match="RRID-T07.*0.999 s < 1 s period"):
            run(folder, recipe)
        return
    (item,) = run(folder, recipe).result.logs
    assert item.log.period == 1.0


def test_c02_one_column_for_two_joints_is_refused(folder: Path) -> None:
    """A torque used twice makes a log whose second joint is the first once more."""
    twice = RECIPE.replace('columns = "tau_{j}"', 'columns = ["tau_1", "tau_1", "tau_3"]')
    with pytest.raises(UsageError, match=r"RRID-C02.*'tau_1' serves tau of joint 1 and of joint 2"):
        run(folder, twice)
    with pytest.raises(UsageError, match=r"RRID-C02.*'tau_2' serves tau of joint 1 and of joint 2"):
        run(folder, map=("tau_1=tau_2",))


def test_a_column_that_is_missing_is_asked_for_by_its_signal(folder: Path) -> None:
    """The remedy names the signal that was asked for, and columns that can be it: never the time for a position."""
    with pytest.raises(InputRejected, match=r"RRID-S01.*no column 'foo'.*--map tau_1='tau_1'") as problem:
        run(folder, map=("tau_1=foo",))
    assert "q_1=" not in problem.value.remedy
    assert "'t'" not in problem.value.remedy


def test_what_the_header_says_of_units_is_said_in_the_result(folder: Path) -> None:
    columns = good()
    write(folder, text({"t [s]": columns["t"]} | {f"{k} [{'rad' if k[0] == 'q' else 'N m'}]": v
                                                  for k, v in columns.items() if k != "t"}))
    recipe = RECIPE.replace('unit = "s"\n', "").replace(', unit = "rad"', "").replace(', unit = "N m"', "")
    outcome = run(folder, recipe)
    assert {"t: unit s from the header", "q: unit rad from the header", "tau: unit N m from the header"} <= set(
        outcome.result.logs[0].steps)
    assert "unit rad from the header" in str(outcome.report.sections[-1].tables[0].rows)


def test_the_verdict_says_what_was_resampled_and_warned(folder: Path) -> None:
    """Green is for samples that are as recorded."""
    outcome = run(folder, RECIPE + "[resample]\nrate = 500\n")
    assert "1 log resampled to 500 Hz; 1 warning, listed below." in outcome.report.verdict
    assert outcome.report.tone == "attention"
    assert all(check.remedy for check in outcome.result.checks if check.level != "ok")


def test_pictures_stay_out_of_the_json_and_their_number_is_said(folder: Path) -> None:
    for name in "abc":
        write(folder, text(good()), f"{name}.csv")
    outcome = run(folder)
    assert len(json.dumps(outcome.json)) < 30_000
    assert [log["preview"] and list(log["preview"]) for log in outcome.json["logs"]] == [["t", "q", "tau"]] * 3 + [None]
    assert "first 3 of 4 logs" in outcome.report.sections[0].text[0]


def test_a_place_is_the_path_below_the_source_folder(folder: Path) -> None:
    """Two days, one file name: the message says which of the two."""
    for day in ("monday", "tuesday"):
        write(folder / day, text(good()))
    broken = (folder / "tuesday" / "run.csv").read_text().replace("tau_3", "tau_x", 1)
    (folder / "tuesday" / "run.csv").write_text(broken)
    with pytest.raises(InputRejected, match="RRID-S01") as problem:
        run(folder, RECIPE.replace("*.csv", "*/run.csv"))
    assert problem.value.where == "tuesday/run.csv"


def test_c04_the_folder_of_the_recordings_is_asked_for(tmp_path: Path) -> None:
    """A shipped recipe without --source, with a folder that is not there, and with one that lacks the robot."""
    def attempt(source: Path | None) -> str:
        with pytest.raises(UsageError, match="RRID-C04") as problem:
            run_stage(STAGE, Request((), tmp_path / "out", no_report=True), Settings(recipe="tx40", source=source))
        return str(problem.value)

    assert "--source FOLDER" in attempt(None)
    assert "nowhere: no such folder" in attempt(tmp_path / "nowhere")
    (tmp_path / "data").mkdir()
    assert "'tx40.urdf' that the recipe names lies neither in" in attempt(tmp_path / "data")


def test_s07_motor_positions_are_named_with_the_ratio_they_need(folder: Path) -> None:
    """Motors at 32 quarter turns at rest: degrees are one reading, [drive] the other; both stand in the remedy."""
    columns = good()
    write(folder, text(columns | {f"q_{j}": 16.0 * np.pi + 40.0 * columns[f"q_{j}"] for j in (1, 2, 3)}))
    joint = '[[robot.joint]]\nname = "j"\ntype = "revolute"\na = 0.0\nalpha = 0.0\nd = 0.0\noffset = 0.0\nposition = [-2.0, 2.0]\n'
    recipe = RECIPE.replace('use = "rrr"',
                            'name = "r"\ngravity = [0.0, 0.0, -9.81]\n[robot.kinematics]\nconvention = "dh"\n' + 3 * joint)
    with pytest.raises(InputRejected, match=r"RRID-S07.*motor side; it starts at 32, 32, 32 times pi/2") as problem:
        run(folder, recipe)
    assert 'unit = "deg"' in problem.value.remedy
    assert "transmission = the gear ratios of at least 12" in problem.value.remedy


def test_s07_radians_of_motors_declared_as_degrees_are_noticed(folder: Path) -> None:
    """32 quarter turns in radians, called degrees: a log that nothing else contradicts, with torques 30 times too small."""
    columns = good()
    write(folder, text(columns | {f"q_{j}": 16.0 * np.pi + 40.0 * columns[f"q_{j}"] for j in (1, 2, 3)}))
    outcome = run(folder, RECIPE.replace('"rad"', '"deg"'))
    (found,) = [c for c in outcome.checks if c.code == "RRID-S07"]
    assert "start at 32, 32, 32 times pi/2" in found.message
    assert outcome.report.tone == "attention"


def test_s08_milliseconds_declared_as_seconds_are_asked_about(folder: Path) -> None:
    """A warning: nothing in the recording contradicts it, but no arm is that slow. Declared as they are there is none."""
    write(folder, text(good() | {"t": np.arange(1200) * 1.0}))
    (check,) = run(folder).checks
    assert (check.code, check.level, check.gate) == ("RRID-S08", "warn", False)
    assert "with steps in ms, joint" in check.message
    assert 'unit = "ms"' in check.remedy
    assert not run(folder, RECIPE.replace('unit = "s"', 'unit = "ms"')).checks
