"""Every bad input that an import can meet is mended and said, or refused with place and remedy."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from pipelines.errors import EnvironmentFault, InputRejected, RrridError
from pipelines.import_log import STAGE, Result, Settings, compute
from tests.importers.good import RECIPE, codes, good, lines, run, strict_checker, text, write
from tests.repairs import REPAIRS, Repair, lossy, rows_changed, spoiled


@pytest.fixture(scope="module")
def checker(shared: Path) -> ModuleType:
    return strict_checker(shared)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the good recording in it."""
    write(tmp_path / "data", text(good()))
    return tmp_path / "data"


@pytest.mark.parametrize("repair", [pytest.param(r, marks=pytest.mark.row(r.code), id=r.row.replace(" ", "-")) for r in REPAIRS])
def test_what_can_be_mended_is_mended_said_and_an_error_when_strict(repair: Repair, folder: Path, checker: ModuleType) -> None:
    repair.spoil(folder)
    outcome = run(folder, repair.recipe)
    assert codes(outcome)[repair.code] == repair.level
    assert all(check.where for check in outcome.checks)
    assert not any(checker.check_folder(outcome.folder).values())
    if repair.level == "repair":
        assert all(item.log.derived is not None for item in outcome.result.logs)
        assert "nothing had to be repaired" not in outcome.report.verdict
        with pytest.raises(InputRejected, match="RRID-"):
            run(folder, repair.recipe, strict=True)
    elif repair.code != "T05":
        assert run(folder, repair.recipe, strict=True).result.logs


def test_t04_a_part_without_a_whole_period_has_none(folder: Path) -> None:
    (repair,) = (r for r in REPAIRS if r.row == "T04 in a periodic log")
    repair.spoil(folder)
    first, second = run(folder, repair.recipe).result.logs
    assert (first.log.period, second.log.period) == (None, 0.5)
    assert "period left out: 0.4 s < 0.5 s period" in first.altered


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
                    "columns 3, 4 are all named 'q_2'"),
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
    "shorter than a period": ("T07", lambda f: None, RECIPE.replace("[time]", "period = 10.0\n[time]"), "1.2 s < 10 s period"),
    "one sample": ("T08", lambda f: write(f, "\n".join(lines()[:2]) + "\n"), RECIPE, "1 time stamp"),
    "no sample": ("T08", lambda f: write(f, lines()[0] + "\n"), RECIPE, "no sample"),
    "channel of NaN": ("D02", lambda f: spoiled(f, "tau_1", slice(None), np.nan), RECIPE, "'tau_1'"),
    "infinite": ("D03", lambda f: spoiled(f, "q_3", 5, np.inf), RECIPE, "inf in line 7"),
    "absurd": ("D03", lambda f: spoiled(f, "q_3", 5, 1e300), RECIPE, "1e\\+300 in line 7"),
    "absurd and finite": ("D03", lambda f: spoiled(f, "tau_3", 5, 1e10), RECIPE, "1e\\+10 in line 7"),
    "filler of 16 bits": ("D03", lambda f: spoiled(f, "q_3", 5, 32767.0), RECIPE, r"\[missing\] values = \[32767\]"),
    "dead torque": ("D04", lambda f: spoiled(f, "tau_3", slice(None), 0.25), RECIPE, "run.csv, signal tau, joint 3.*constant"),
    "19 samples": ("T08", lambda f: write(f, "\n".join(lines()[:20]) + "\n"), RECIPE, "19 samples left; a log needs 20"),
    "gaps everywhere": ("T04", lambda f: lossy(f, *((k, k + 60) for k in range(15, 1200, 75))), RECIPE, "no stretch"),
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


@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.row(case[0][:3])) for name, case in REFUSED.items()])
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


def test_s07_radians_that_are_degrees(folder: Path) -> None:
    """S07: ±40 degrees declared as radians leave a joint that can do ±2 rad by far."""
    columns = good()
    write(folder, text(columns | {f"q_{j}": np.rad2deg(columns[f"q_{j}"]) for j in (1, 2, 3)}))
    joint = '[[robot.joint]]\nname = "j"\ntype = "revolute"\na = 0.0\nalpha = 0.0\nd = 0.0\noffset = 0.0\nposition = [-2.0, 2.0]\n'
    recipe = RECIPE.replace('use = "rrr"',
                            'name = "r"\ngravity = [0.0, 0.0, -9.81]\n[robot.kinematics]\nconvention = "dh"\n' + 3 * joint)
    with pytest.raises(InputRejected, match=r"RRID-S07 run.csv, signal q, joint 1.*looks like degrees or the motor side.*--trust-units"):
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

    monkeypatch.setattr("tests.importers.good.STAGE", dataclasses.replace(STAGE, compute=meddle))
    with pytest.raises(InputRejected, match="RRID-F14"):
        run(folder)
