"""`rrrid batch` as a user calls it: exit codes, --json, signals, the surroundings."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from pathlib import Path

import pytest

from pipelines import convert
from pipelines.batch import run_batch
from pipelines.executor import Plan
from pipelines.io.files import write_log
from tests.batch.conftest import QUIET, contents
from tests.cli.commands import REPO, RRRID, rrrid
from tests.io.logs import small_log
from tests.seeds import rarely


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """14 folders of one small log each."""
    folder = tmp_path_factory.mktemp("many")
    write_log(folder / "log.h5", small_log(samples=100))
    for i in range(14):
        (folder / f"root/{i:03d}").mkdir(parents=True)
        os.link(folder / "log.h5", folder / f"root/{i:03d}/log.h5")
    return folder


def nobody_left(group: int) -> bool:
    """Whether every process of a group ends within a second. The dead ones that init has not noticed yet are dead."""
    for _ in range(100):
        states = [text.rpartition(")")[2].split() for path in Path("/proc").glob("[0-9]*/stat") if (text := _text(path))]
        if not [state for state, _, its, *_ in states if int(its) == group and state != "Z"]:
            return True
        time.sleep(0.01)
    return False


def _text(path: Path) -> str:
    try:
        return path.read_text()
    except OSError:  # it has just ended
        return ""


@pytest.mark.row("P06", "P07")
@pytest.mark.parametrize(("number", "exit_code"), [(signal.SIGINT, 130), *rarely((signal.SIGTERM, 143))])
def test_a_signal_ends_with_a_summary_and_resume_ends_the_same(many: Path, tmp_path: Path, number: signal.Signals,
                                                               exit_code: int) -> None:
    """P06, P07: to the whole group, as a terminal sends it; within 5 s, a summary of all, no orphan, nothing half written."""
    words = (*RRRID, "batch", str(many / "root"), "--stage", "convert", "--no-report", "--jobs", "2", "--out",
             str(tmp_path / "out"))
    environment = os.environ | {"PYTHONPATH": str(REPO)}
    with subprocess.Popen([*words, "-v"], env=environment, text=True, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL,
                          start_new_session=True) as process:
        assert process.stderr is not None
        while not process.stderr.readline().startswith("2 of 14"):
            assert process.poll() is None
        began = time.monotonic()
        os.killpg(process.pid, number)
        said = process.stderr.read()
        process.wait()
        lasted = time.monotonic() - began
    assert process.returncode == exit_code, said
    assert lasted < 5.0
    assert "Traceback" not in said
    assert nobody_left(process.pid)
    assert not list((tmp_path / "out").rglob(".rrrid-*"))
    items = json.loads((tmp_path / "out/result.json").read_text())["items"]
    done = [item["name"] for item in items if item["status"] == "ok"]
    assert len(items) == 14
    assert 2 <= len(done) < 14
    assert {item["error"]["code"] for item in items if item["status"] != "ok"} == {"RRID-P06"}
    if number == signal.SIGINT:
        resumed, whole = (run_batch(Plan("pipelines.convert", convert.Settings(), QUIET, many / "root", tmp_path / name,
                                         resume=True)) for name in ("out", "whole"))
        assert json.loads((tmp_path / "out/provenance.json").read_text())["kept"] == len(done)
        assert contents(resumed.folder) == contents(whole.folder)


@pytest.mark.row("P13")
def test_json_is_the_result_and_nothing_else(tmp_path: Path) -> None:
    """One object on standard output; each folder an item; a bad one is exit 4 in the words of its stage."""
    write_log(tmp_path / "root/a/a.h5", small_log(samples=100))
    write_log(tmp_path / "root/b/b.h5", small_log(samples=100))
    (tmp_path / "root/b/b.h5").write_bytes((tmp_path / "root/b/b.h5").read_bytes()[:3000])
    (tmp_path / "home").mkdir(mode=0o555)
    done = rrrid("batch", "root", "--stage", "convert", "--json", cwd=tmp_path,
                 env={"HOME": str(tmp_path / "home"), "DISPLAY": "", "TERM": "dumb"})
    assert done.returncode == 4
    result = json.loads(done.stdout)
    assert [(item["name"], item["status"], (item["error"] or {}).get("code")) for item in result["items"]] == [
        ("a", "ok", None), ("b", "rejected", "RRID-F02")]
    assert result == json.loads((tmp_path / "runs/several/root/batch/result.json").read_text())
    assert (tmp_path / "runs/several/root/batch/items/a/logs/a.parquet").is_file()
    assert "<html" in (tmp_path / "runs/several/root/batch/report.html").read_text()
    assert list((tmp_path / "home").iterdir()) == []


@pytest.mark.parametrize(("words", "code"), [
    (("--stage", "inspekt"), "C01"), (("--shard", "5/4"), "C02"), (("--jobs", "0"), "C02"), (("--memory", "much"), "C02"),
    (("--timeout", "-1"), "C02"), (("--backend", "spark://x"), "C02"),
    (("--set", "convert.too=h5"), "C01")])
def test_a_wrong_option_is_exit_2(tmp_path: Path, words: tuple[str, ...], code: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """C01, C02, C04: before anything is written."""
    from pipelines.errors import UsageError
    from rrrid_cli.main import call

    write_log(tmp_path / "root/a/a.h5", small_log(samples=100))
    monkeypatch.chdir(tmp_path)
    stage = () if "--stage" in words else ("--stage", "convert")
    with pytest.raises(UsageError) as refused:
        call(["batch", "root", "--out", "out", "-q", *stage, *words])
    assert refused.value.code == f"RRID-{code}"
    assert not list(tmp_path.glob("out/result.json"))
