"""`rrrid doctor`: an installation in order is said to be, and each thing that is missing or too old is named with its remedy."""

from __future__ import annotations

import importlib.metadata
import json
from pathlib import Path

import pytest

from pipelines import selfcheck
from pipelines.selfcheck import Finding
from tests.cli.commands import rrrid


def named(findings: list[Finding], name: str) -> Finding:
    return next(one for one in findings if one.name == name)


def test_this_installation_works(tmp_path: Path) -> None:
    """Exit 0, every step of the self-test passed, and nothing is left behind."""
    done = rrrid("doctor", "--json", cwd=tmp_path, env={"TMPDIR": str(tmp_path)})
    told = json.loads(done.stdout)
    assert (done.returncode, told["works"]) == (0, True)
    assert len([one for one in told["findings"] if one["name"].startswith("self-test") and one["level"] == "ok"]) == 6
    assert list(tmp_path.iterdir()) == []


def test_a_simulation_that_fails_is_a_finding(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """`rrrid doctor` goes on with the other jobs and ends in 6."""
    monkeypatch.setattr("pipelines.simulation.example.example_session", lambda: 1 / 0)
    done = rrrid("doctor", "--json", cwd=tmp_path)
    told = {one["name"]: one["level"] for one in json.loads(done.stdout)["findings"]}
    assert done.returncode == 6
    assert (told["self-test: simulating a log"], told["self-test: observer"]) == ("bad", "ok")


def test_a_library_that_is_missing_or_too_old(monkeypatch: pytest.MonkeyPatch) -> None:
    """numpy 1.9 is not 1.26; h5py is not there; an extra that is not there is no fault."""
    version = importlib.metadata.version

    def other(name: str) -> str:
        if name in ("h5py", "mujoco"):
            raise importlib.metadata.PackageNotFoundError(name)
        return "1.9.3" if name == "numpy" else version(name)

    monkeypatch.setattr(importlib.metadata, "version", other)
    found = list(selfcheck.examine(with_self_test=False))
    assert (named(found, "numpy").level, named(found, "h5py").level, named(found, "mujoco").level) == ("bad", "bad", "ok")
    assert named(found, "numpy").found == "1.9.3, >=1.26 is required"
    assert "rrrid[bench]" in named(found, "mujoco").remedy
