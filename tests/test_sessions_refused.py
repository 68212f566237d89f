"""A folder with several robots or days is refused with their list; --session takes one, batch takes all."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from pipelines.io.files import open_log, write_log
from pipelines.io.sessions import SeveralSessions
from pipelines.stage import Request, Stage, run_stage
from tests.cli.commands import rrrid
from tests.healthy import begun

READING = ("run", "inspect", "convert", "reconstruct", "fit_friction", "estimate_bps", "validate_writing", "frf", "diagnose",
           "extend", "simulate", "design_excitation")
QUICK = ("--no-report",)


def _put(folder: Path, prefix: str, kinds: tuple[str, ...], origin: Path, **about: Any) -> None:
    """Eight seconds of the sample logs `kinds`, with other attributes."""
    folder.mkdir(exist_ok=True)
    for kind in kinds:
        write_log(folder / f"{prefix}{kind}.h5", replace(begun(open_log(origin / f"{kind}.h5").log, 8000), **about))


@pytest.fixture
def two_arms(tmp_path: Path, samples: Path) -> Path:
    """Two machines of one make: the description is the same, to the letter."""
    origin = samples / "rrr-closed-form"
    _put(tmp_path / "logs", "arm-a-", ("excitation-1", "excitation-2"), origin, robot_name="arm-a")
    _put(tmp_path / "logs", "arm-b-", ("free-1",), origin, robot_name="arm-b")
    return tmp_path / "logs"


@pytest.mark.parametrize(("module", "other"), [*((module, {"robot_name": "arm-b"}) for module in READING),
                                               ("run", {"recorded": "2026-05-18T09:00:00Z"})])
def test_every_command_refuses_two_sessions(module: str, other: dict[str, str], samples: Path, tmp_path: Path) -> None:
    """Two machines of one description, or two days: each command names both before it computes anything."""
    _put(tmp_path / "logs", "", ("hold-1",), samples / "rrr-healthy")
    _put(tmp_path / "logs", "again-", ("hold-1",), samples / "rrr-healthy", **other)
    stage: Stage[Any, Any] = import_module(f"pipelines.{module}").STAGE
    settings = stage.settings(**{"extend": {"causes": ("cogging:2",)}, "simulate": {"model": "rrr"}}.get(module, {}))
    with pytest.raises(SeveralSessions) as refused:
        run_stage(stage, Request((tmp_path / "logs",), out=tmp_path / "out"), settings)
    assert len(refused.value.names) == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["logs"]


def test_one_can_be_taken_alone(two_arms: Path, tmp_path: Path) -> None:
    """--session gives what a folder of that session alone gives; a name that is none is refused with those that are."""
    (tmp_path / "alone").mkdir()
    for log in two_arms.glob("arm-a*"):
        (tmp_path / "alone" / log.name).write_bytes(log.read_bytes())
    for words in (("logs", "--session", "arm-a", "--out", "one"), ("alone", "--out", "other")):
        done = rrrid("estimate-bps", *words, *QUICK, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    one, other = (json.loads((tmp_path / name / "result.json").read_text()) for name in ("one", "other"))
    assert one == other
    wrong = rrrid("estimate-bps", "logs", "--session", "arm-c", *QUICK, cwd=tmp_path)
    assert (wrong.returncode, wrong.stdout) == (2, "")
    assert "RRID-C01 --session: no session 'arm-c'" in wrong.stderr
    assert "arm-a, arm-b" in wrong.stderr


def test_batch_takes_all(two_arms: Path, tmp_path: Path) -> None:
    """Each robot is an item with the result that it has alone; so it is with --resume."""
    (tmp_path / "root/one").mkdir(parents=True)
    (tmp_path / "root/one/free.h5").write_bytes((two_arms / "arm-b-free-1.h5").read_bytes())
    two_arms.rename(tmp_path / "root/two")
    words = ("batch", "root", "--stage", "estimate-bps", "--jobs", "1", "--out", "out", "--json", *QUICK)
    done = rrrid(*words, cwd=tmp_path)
    told = json.loads(done.stdout)
    assert {one["name"]: one["status"] for one in told["items"]} == {"one": "ok", "two: arm-a": "ok", "two: arm-b": "ok"}
    assert [one["robot"] for one in told["items"]] == ["arm-b", "arm-a", "arm-b"]
    alone = rrrid("estimate-bps", "root/two", "--session", "arm-b", "--out", "alone", *QUICK, cwd=tmp_path)
    assert (done.returncode, alone.returncode) == (0, 0)
    (folder,) = [tmp_path / "out" / one["folder"] for one in told["items"] if one["name"] == "two: arm-b"]
    assert (folder / "result.json").read_bytes() == (tmp_path / "alone/result.json").read_bytes()
    again = rrrid(*words, "--resume", cwd=tmp_path)
    assert json.loads(again.stdout) == told
    assert json.loads((tmp_path / "out/provenance.json").read_text())["kept"] == 3


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
