"""All failures of one import come together; what an error advises works when it is followed."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pipelines.errors import InputRejected, UsageError
from pipelines.importers.guess import guess_recipe
from pipelines.importers.recipe import parse_recipe
from pipelines.io.files import open_log
from tests.importers.good import RECIPE, good, run, text, write


def test_every_file_that_fails_is_named_with_its_own_reason(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    columns = good()
    write(folder, text(columns), "good.csv")
    write(folder, text({k: v for k, v in columns.items() if k != "q_2"}), "lacks.csv")
    write(folder, text(columns | {"tau_1": np.where(np.arange(1200) == 7, 1e300, columns["tau_1"])}), "absurd.csv")
    with pytest.raises(InputRejected, match=r"RRID-D03 absurd.csv") as failed:
        run(folder)
    assert [problem.code for problem in failed.value.others] == ["RRID-S01"]
    assert "lacks.csv: no column 'q_2'" in str(failed.value.others[0])


def test_each_failure_is_one_line_and_in_the_json(tmp_path: Path) -> None:
    write(tmp_path, text(good()).replace("q_2", "x", 1), "a.csv")
    write(tmp_path, text(good()).replace("q_3", "y", 1), "b.csv")
    write(tmp_path, RECIPE, "recipe.toml")
    command = [sys.executable, "-m", "rrrid_cli.main", "import", "recipe.toml", "--out", str(tmp_path.with_name(f"{tmp_path.name}-out")), "--json"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False,
                          env={"PYTHONPATH": str(Path(__file__).parents[2]), "PATH": ""})
    assert done.returncode == 3
    assert done.stderr.count("\n") == 2
    assert [other["where"] for other in json.loads(done.stdout)["others"]] == ["b.csv"]


@pytest.mark.parametrize("value", [1.7976931348623157e300, -123456789012.5, -999.0, np.inf])
def test_the_remedy_for_a_missing_value_works_as_it_is_written(tmp_path: Path, value: float) -> None:
    columns = good()
    columns["q_1"] = np.where(np.arange(1200) == 600, value, columns["q_1"])
    write(tmp_path / "data", text(columns))
    with pytest.raises(InputRejected, match="RRID-D03") as failed:
        run(tmp_path / "data")
    remedy = failed.value.remedy.split("add ")[1].split(";")[0]
    outcome = run(tmp_path / "data", RECIPE + "\n" + remedy.replace("] ", "]\n", 1) + "\n")
    assert outcome.result.logs[0].samples == 1199


def test_a_clock_of_two_columns_keeps_every_digit(tmp_path: Path) -> None:
    columns = good()
    ticks = np.arange(1200) * 1_000_001
    stamps = {"sec": 1_700_000_000 + ticks // 1_000_000_000, "nanosec": ticks % 1_000_000_000}
    rows = ["sec,nanosec," + ",".join(name for name in columns if name != "t")]
    signals = [values for name, values in columns.items() if name != "t"]
    for k in range(1200):
        rows.append(",".join([str(stamps["sec"][k]), str(stamps["nanosec"][k]), *(repr(float(x[k])) for x in signals)]))
    write(tmp_path / "data", "\n".join(rows) + "\n")
    two = RECIPE.replace('column = "t"\nunit = "s"', 'column = ["sec", "nanosec"]\nunit = ["s", "ns"]')
    log = open_log(run(tmp_path / "data", two).folder / "logs" / "run.h5").log
    assert np.abs(log.t - ticks * 1e-9).max() < 1e-12
    with pytest.raises(UsageError, match=r"'time.unit' holds 3 units for 2 columns"):
        parse_recipe(two.replace('["s", "ns"]', '["s", "ns", "ns"]'))


def test_a_sliding_joint_in_millimetres_declared_as_metres_is_refused(shared: Path, tmp_path: Path) -> None:
    folder = next((shared / "cases").glob("30-*"))
    data = np.loadtxt(folder / "run1.csv", delimiter=",", skiprows=1)
    data[:, 3] *= 1e3
    names = ["t", *(f"{s}_{j}" for s in ("q", "tau") for j in range(1, 5))]
    write(tmp_path / "data", text(dict(zip(names, data.T, strict=True))), "run1.csv")
    write(tmp_path / "data", (folder / "arm.urdf").read_bytes(), "arm.urdf")
    with pytest.raises(InputRejected, match=r"RRID-S07.*column 'q_3'.*looks like mm"):
        run(tmp_path / "data", (folder / "r.toml").read_text())


@pytest.mark.parametrize(("names", "blank"), [
    ({"tau": "torque_{} [%]"}, "signals.tau.unit"), ({"tau": "torque_percent_{}"}, "signals.tau.unit"),
    ({"q": "position {} [inch]"}, "signals.q.unit"), ({"t": "time [h]"}, "time.unit"),
])
def test_a_unit_that_is_not_known_is_asked_for(tmp_path: Path, names: dict[str, str], blank: str) -> None:
    """A header that says "%" is no torque in N m."""
    names = {"q": "q_{} [rad]", "tau": "tau_{} [Nm]"} | names
    columns = {names.get(name.split("_")[0], name).format(name[-1]): values for name, values in good().items()}
    draft = guess_recipe(write(tmp_path, text(columns)))
    assert draft.blanks == ("robot.use", blank)


def test_a_share_of_a_rated_torque_is_scaled_as_the_refusal_says(tmp_path: Path) -> None:
    """A drive counts torque in per cent of a rated one, which is no unit, and no file states it."""
    columns = good()
    rated = np.array([50.0, 20.0, 8.0])
    shares = {f"tau_{j}": 100.0 * columns[f"tau_{j}"] / rated[j - 1] for j in (1, 2, 3)}
    write(tmp_path / "data", text(columns | shares))
    line = next(line for line in RECIPE.splitlines() if line.startswith("tau"))
    with pytest.raises(InputRejected, match=r"RRID-S05.*scale = rated torque / 100.*unit = 'N m'"):
        run(tmp_path / "data", RECIPE.replace(line, line.replace("N m", "%")))
    scaled = line.replace('unit = "N m"', f'unit = "N m", scale = {(rated / 100).tolist()}')
    out = run(tmp_path / "data", RECIPE.replace(line, scaled))
    log = open_log(out.folder / "logs" / "run.h5").log
    np.testing.assert_allclose(log.signals["tau"].values[:, 0], columns["tau_1"], atol=1e-6)
