"""Recordings become logs: what a recipe can do."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from pipelines.errors import InputRejected, UsageError
from pipelines.io.files import open_log
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


def test_two_files_make_one_log(folder: Path) -> None:
    outcome = run(folder, split_files(folder))
    log = open_log(outcome.folder / "logs" / "a.h5").log
    assert np.allclose(log.t, good()["t"], rtol=0, atol=1e-12)
    assert np.array_equal(log.tau[:, 0], good()["tau_1"])
    assert len(outcome.result.logs[0].sources) == 2


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


def test_s07_motor_positions_are_refused_with_both_readings(folder: Path) -> None:
    """Motors at 32 quarter turns at rest: degrees are one reading, [drive] the other; both stand in the remedy."""
    columns = good()
    write(folder, text(columns | {f"q_{j}": 16.0 * np.pi + 40.0 * columns[f"q_{j}"] for j in (1, 2, 3)}))
    joint = '[[robot.joint]]\nname = "j"\ntype = "revolute"\na = 0.0\nalpha = 0.0\nd = 0.0\noffset = 0.0\nposition = [-2.0, 2.0]\n'
    recipe = RECIPE.replace('use = "rrr"',
                            'name = "r"\ngravity = [0.0, 0.0, -9.81]\n[robot.kinematics]\nconvention = "dh"\n' + 3 * joint)
    with pytest.raises(InputRejected, match=r"RRID-S07.*looks like degrees or the motor side") as problem:
        run(folder, recipe)
    assert 'unit = "deg"' in problem.value.remedy
    assert "transmission = the gear ratios" in problem.value.remedy
