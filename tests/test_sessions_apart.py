"""A folder with several robots or days: every command of one robot reports each by itself, and mixes nothing."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from pipelines.log.files import open_log, write_log
from pipelines.log.mixed import SeveralSessions
from pipelines.stage import Request, Stage, run_stage
from tests.cli.commands import rrrid

STAGES = ("fit_friction", "estimate_bps", "validate_writing", "frf", "diagnose", "extend")
QUICK = ("--no-report", "--set", "estimate-bps.compare=false")


def _put(folder: Path, prefix: str, kinds: tuple[str, ...], origin: Path, **about: Any) -> None:
    """Copies of the sample logs `kinds`, with other attributes."""
    folder.mkdir(exist_ok=True)
    for kind in kinds:
        write_log(folder / f"{prefix}{kind}.h5", replace(open_log(origin / f"{kind}.h5").log, **about))


@pytest.fixture
def two_arms(tmp_path: Path, samples: Path) -> Path:
    """Two machines of one make: the description is the same, to the letter. The second lacks the logs that would judge it."""
    origin = samples / "rrr-closed-form"
    _put(tmp_path / "logs", "arm-a-", ("excitation-1", "excitation-2"), origin, robot_name="arm-a")
    _put(tmp_path / "logs", "arm-b-", ("free-1",), origin, robot_name="arm-b")
    return tmp_path / "logs"


@pytest.mark.parametrize("apart_by", [{"robot_name": "arm-b"}, {"recorded": "2026-05-18T09:00:00Z"}])
@pytest.mark.parametrize("module", STAGES)
def test_no_stage_mixes_two_sessions(module: str, apart_by: dict[str, str], samples: Path, tmp_path: Path) -> None:
    """One description, two machines or two days: each stage names both before it computes anything."""
    kinds = {"fit_friction": ("friction-1-1",), "frf": ("frf-1-1",)}.get(module, ("excitation-1", "excitation-2"))
    _put(tmp_path / "logs", "", kinds, samples / "rrr-healthy")
    _put(tmp_path / "logs", "again-", kinds, samples / "rrr-healthy", **apart_by)
    stage: Stage[Any, Any] = import_module(f"pipelines.{module}").STAGE
    settings = stage.settings(causes=("cogging:2",)) if module == "extend" else stage.settings()
    with pytest.raises(SeveralSessions) as refused:
        run_stage(stage, Request((tmp_path / "logs",), out=tmp_path / "out"), settings)
    assert len(refused.value.names) == 2
    assert not (tmp_path / "out").exists()


def test_a_batch_of_one_stage_mixes_no_item(two_arms: Path, tmp_path: Path) -> None:
    """An item is a folder: one of two robots fails with their names, and the others are what they are."""
    (tmp_path / "root").mkdir()
    two_arms.rename(tmp_path / "root/two")
    (tmp_path / "root/one").mkdir()
    (tmp_path / "root/one/free.h5").write_bytes((tmp_path / "root/two/arm-b-free-1.h5").read_bytes())
    done = rrrid("batch", "root", "--stage", "estimate-bps", "--jobs", "1", "--out", "out", "--json", *QUICK, cwd=tmp_path)
    items = {one["name"]: one for one in json.loads(done.stdout)["items"]}
    assert (done.returncode, items["one"]["status"], items["two"]["status"]) == (4, "ok", "failed")
    assert items["two"]["error"]["code"] == "RRID-C02"
    assert "arm-a" in items["two"]["error"]["message"]


def test_each_has_the_result_that_it_has_alone(two_arms: Path, tmp_path: Path) -> None:
    """The output of each robot is what the command makes of its logs in a folder of their own, to the bit; twice over."""
    for arm in ("arm-a", "arm-b"):
        (tmp_path / arm).mkdir()
        for log in two_arms.glob(f"{arm}*"):
            (tmp_path / arm / log.name).write_bytes(log.read_bytes())
        assert rrrid("estimate-bps", arm, "--out", f"alone-{arm}", *QUICK, cwd=tmp_path).returncode == 0
    for _ in range(2):
        done = rrrid("estimate-bps", "logs", "--out", "out", *QUICK, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert "C05" not in done.stdout
        assert "Logs of several robots: arm-a (arm-a-excitation-1.h5, arm-a-excitation-2.h5); arm-b" in done.stdout
        for arm in ("arm-a", "arm-b"):
            there, alone = (json.loads((tmp_path / place / "result.json").read_text()) for place in (f"out/{arm}", f"alone-{arm}"))
            assert there == alone


def test_one_can_be_taken_alone(two_arms: Path, tmp_path: Path) -> None:
    """--session takes one, into the folder of its robot; a name that is none is told with those that are."""
    done = rrrid("estimate-bps", "logs", "--session", "arm-b", *QUICK, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert [path.parent.name for path in (tmp_path / "runs").glob("*/logs")] == ["arm-b"]
    wrong = rrrid("estimate-bps", "logs", "--session", "arm-c", *QUICK, cwd=tmp_path)
    assert (wrong.returncode, wrong.stdout) == (2, "")
    assert "RRID-C01 --session: no session 'arm-c'" in wrong.stderr
    assert "arm-a, arm-b" in wrong.stderr


def test_json_has_an_object_of_each_and_what_one_lacks_costs_it_alone(two_arms: Path, tmp_path: Path) -> None:
    """`runs`, as in the result of `run`; arm-b has nothing that judges, and arm-a's verdict is none the worse for it."""
    done = rrrid("validate-writing", "logs", "--json", "--no-report", cwd=tmp_path)
    told = json.loads(done.stdout)
    # What is not read is not mixed: only arm-a has logs that judge, but a model would be fitted to those of both.
    assert told["command"] == "validate-writing"
    assert [one["name"] for one in told["runs"]] == ["arm-a", "arm-b"]
    assert told["runs"][0]["torque"]
    assert (told["runs"][1]["error"]["code"], told["runs"][1]["exit"]) == ("RRID-C06", 5)
    assert done.returncode == 0


def test_an_output_of_one_is_not_made_one_of_several(two_arms: Path, tmp_path: Path) -> None:
    """C05: what lies in --out is the result of one robot; the results of two do not go between its files."""
    assert rrrid("estimate-bps", "logs", "--session", "arm-a", "--out", "out", *QUICK, cwd=tmp_path).returncode == 0
    before = sorted(path.name for path in (tmp_path / "out").iterdir())
    refused = rrrid("estimate-bps", "logs", "--out", "out", *QUICK, cwd=tmp_path)
    assert (refused.returncode, "RRID-C05 out" in refused.stderr) == (2, True)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == before


def test_named_logs_of_two_days_are_the_users_choice_and_of_two_robots_none(samples: Path, tmp_path: Path) -> None:
    """Fitted to Monday's logs and judged by Tuesday's, because the user says so; never one robot by another's."""
    _put(tmp_path / "logs", "", ("excitation-1",), samples / "rrr-closed-form", recorded="2026-05-18T09:00:00Z")
    log = open_log(samples / "rrr-closed-form/excitation-2.h5").log
    write_log(tmp_path / "logs/other-day.h5", replace(log, recorded="2026-05-19T09:00:00Z", role="identify"))
    write_log(tmp_path / "other-arm.h5", replace(log, robot_name="arm-b"))
    named = ("--identify", "logs/excitation-1.h5", "--validate")
    done = rrrid("estimate-bps", *named, "logs/other-day.h5", "--json", *QUICK, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["relative_error"]["validate"] is not None
    refused = rrrid("estimate-bps", *named, "other-arm.h5", *QUICK, cwd=tmp_path)
    assert refused.returncode == 2
    assert "RRID-C02" in refused.stderr
    assert "logs of several robots" in refused.stderr
