"""`rrrid run` from the command line: what would be computed, roles by name, completion, help that is not cut."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from pipelines.io.files import write_log
from tests.cli.commands import rrrid
from tests.controlled import controlled_log

SKIP = tuple(word for stage in ("fit-friction", "estimate-bps", "validate-writing", "frf", "diagnose", "extend")
             for word in ("--skip", stage))


@pytest.fixture
def short(tmp_path: Path) -> Path:
    """One log in `logs`."""
    write_log(tmp_path / "logs/a.h5", controlled_log(400))
    return tmp_path


def test_dry_run_writes_nothing_and_tells_why(short: Path) -> None:
    """Before the first run everything would be computed, after it nothing, and with --no-cache everything again."""
    words = ("run", "logs", "--out", "out", "--no-report", *SKIP)
    first = rrrid(*words, "--dry-run", cwd=short)
    assert (first.returncode, first.stderr) == (0, "")
    assert [line.split()[:2] for line in first.stdout.splitlines()[1:]] == [["inspect", "computed"], ["reconstruct", "computed"]]
    assert [p.name for p in short.iterdir()] == ["logs"]
    assert rrrid(*words, cwd=short).returncode == 0
    again = rrrid(*words, "--dry-run", "--json", cwd=short)
    assert json.loads(again.stdout)["stages"] == [
        {"stage": stage, "computed": False, "why": "unchanged"} for stage in ("inspect", "reconstruct")]
    assert rrrid(*words, "--dry-run", "--no-cache", cwd=short).stdout.count("anew") == 2


def test_roles_by_name(short: Path) -> None:
    """--validate and --identify give a log its role, whatever it says of itself; a run then is another run."""
    write_log(short / "logs/b.h5", replace(controlled_log(400, 2), name="b"))
    words = ("run", "logs", "--out", "out", "--no-report", *SKIP, "--json")
    plain = json.loads(rrrid(*words, "--dry-run", cwd=short).stdout)
    assert plain["stages"][0]["why"] == "for the first time here"
    assert rrrid(*words, cwd=short).returncode == 0
    named = json.loads(rrrid(*words, "--dry-run", "--validate", "logs/b.h5", cwd=short).stdout)
    assert "roles" in named["stages"][0]["why"]
    for command in ("fit-friction", "estimate-bps", "validate-writing", "frf", "diagnose", "extend", "run"):
        told = rrrid(command, "--help", cwd=short).stdout
        assert all(f"--{role}" in told for role in ("identify", "validate", "reference")), command
    refused = rrrid("estimate-bps", "logs", "--identify", "logs/b.h5", "--validate", "logs/b.h5", cwd=short)
    assert (refused.returncode, "named for identify and for validate" in refused.stderr) == (2, True)


@pytest.mark.parametrize("command", ["run", "estimate-bps", "frf", "diagnose"])
def test_no_logs_is_wrong_usage(command: str, tmp_path: Path) -> None:
    """Neither LOGS nor a role: exit 2, and what to name."""
    done = rrrid(command, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (2, "rrrid: RRID-C02 LOGS: no logs. Name logs, or folders of logs.\n")


@pytest.mark.parametrize(("line", "answer"), [("rrrid diag", "diagnose"), ("rrrid run --dry", "--dry-run")])
def test_a_shell_completes(line: str, answer: str, tmp_path: Path) -> None:
    """Commands and options, as bash asks for them; the script that makes it ask is printed."""
    done = rrrid(cwd=tmp_path, env={"_RRRID_COMPLETE": "complete_bash", "COMP_WORDS": line,
                                    "COMP_CWORD": str(line.count(" "))})
    assert done.stdout.split() == [answer]
    alone = {"_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}  # what runs the tests need not be a shell
    assert "complete" in rrrid("--show-completion", "bash", cwd=tmp_path, env=alone).stdout
