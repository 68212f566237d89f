"""One bad item costs itself and nothing else: crash, hang, memory, bug, rejection, full disk (P02-P05, P11)."""

from __future__ import annotations

import json
import multiprocessing
import os
import re
from collections import deque
from pathlib import Path
from xml.etree import ElementTree

import pytest

from pipelines.batch import find_items
from pipelines.errors import EnvironmentFault, NothingMatched
from pipelines.executor import Plan, run_items
from pipelines.io.output import slug
from pipelines.stage import Request
from tests.batch.conftest import QUIET, Lay, contents, obey, statuses
from tests.batch.faulty import Settings

GOOD = {f"good-{i}": f"value {i} std 0.1" for i in range(3)}


@pytest.mark.row("P03", "P04", "P05", "P11")
def test_each_misfortune_costs_its_own_item(lay: Lay) -> None:
    """P03, P04, P05 and a bug of ours beside good items: each failed with its code and cause, the others as if alone."""
    alone = obey(lay(GOOD))
    before = {place: bytes_ for place, bytes_ in contents(alone.folder).items() if place.startswith("items/")}
    bad = {"big": "memory", "bug": "bug", "hung": "sleep 60", "rejected": "reject", "segfault": "crash"}
    outcome = obey(lay(bad), timeout=2.0, memory=1 << 30, jobs=2)
    assert statuses(outcome) == dict.fromkeys(GOOD, "ok") | {
        "big": "failed RRID-P03", "bug": "failed RRID-Z70", "hung": "failed RRID-P05", "rejected": "rejected RRID-F02",
        "segfault": "failed RRID-P04"}
    assert outcome.exit_code == 4
    said = {item["name"]: item["error"]["message"] for item in outcome.json["items"] if item["error"]}
    assert all(item["error"]["where"] and item["error"]["remedy"] for item in outcome.json["items"] if item["error"])
    assert said["big"].startswith("memory")
    assert said["hung"].startswith("timeout")
    assert said["segfault"].startswith("crashed signal 11")
    assert {place: bytes_ for place, bytes_ in contents(outcome.folder).items() if place.startswith("items/")} == before
    assert "nobody foresaw it" in (outcome.folder / "crashes/bug.txt").read_text()
    cases = {case.get("name"): [e.tag for e in case] for case in ElementTree.parse(outcome.folder / "junit.xml").iter("testcase")}
    assert {name for name, tags in cases.items() if tags == ["error"]} == set(bad)
    assert len(cases) == 8


@pytest.mark.row("P04")
@pytest.mark.parametrize("jobs", [2])
def test_a_process_that_leaves_without_a_word_costs_its_item(lay: Lay, jobs: int) -> None:
    """P04: a library that ends its process with 0, no time limit given: the item has failed, the batch ends."""
    outcome = obey(lay(GOOD | {"gone": "leave", "gone-too": "leave"}), jobs=jobs)
    assert statuses(outcome) == dict.fromkeys(GOOD, "ok") | {"gone": "failed RRID-P04", "gone-too": "failed RRID-P04"}
    said = {item["error"]["message"] for item in outcome.json["items"] if item["error"]}
    assert said == {"crashed: its process ended with 0"}


@pytest.mark.row("P04")
def test_a_worker_that_dies_without_an_item_costs_none(lay: Lay, tmp_path: Path) -> None:
    """P04: killed between two items; another takes its place."""
    root = lay(GOOD)
    first, *others = find_items(root)[0]
    waiting = deque([first])
    done = run_items(Plan("tests.batch.faulty", Settings(), QUIET, root, tmp_path / "out"), waiting, lambda: False)
    records = [next(done)[1]]
    (worker,) = multiprocessing.active_children()
    worker.kill()
    worker.join()
    waiting.extend(others)
    records += [record for _, record in done]
    assert [record.item.name for record in records] == list(GOOD)
    assert {record.item.status for record in records} == {"ok"}


@pytest.mark.row("P11")
def test_all_bad_is_exit_4_with_a_table(lay: Lay) -> None:
    """P11: nothing that could be used, and still every form of the summary."""
    outcome = obey(lay({"a": "reject", "b/c": "reject"}))
    assert (outcome.exit_code, statuses(outcome)) == (4, {"a": "rejected RRID-F02", "b/c": "rejected RRID-F02"})
    assert {p.name for p in outcome.folder.iterdir()} >= {"result.json", "summary.parquet", "junit.xml", "provenance.json"}
    assert outcome.json["items"][1]["error"]["where"] == "b/c/log.h5"


def test_found_is_exit_1_with_check_alone(lay: Lay) -> None:
    """1 where something was found and none failed, with --check; 4 where one failed, with or without."""
    root = lay({"a": "found", "b": "fine"})
    assert [obey(root, check=check).exit_code for check in (False, True)] == [0, 1]
    assert obey(lay({"c": "reject"}), check=True).exit_code == 4


@pytest.mark.row("P02")
@pytest.mark.parametrize("fault", ["full", pytest.param("unreadable", marks=pytest.mark.slow)])
def test_a_full_disk_stops_the_batch_and_it_can_go_on(lay: Lay, tmp_path: Path, fault: str) -> None:
    """P02: exit 6 at once, nothing partial, the summary says what is missing; --resume does the rest, to the same bytes."""
    items = {f"{i:02d}": "fine" for i in range(6)}
    whole = contents(obey(lay(items | {"03": "fine again"}), out=tmp_path / "whole").folder)
    with pytest.raises(EnvironmentFault) as stopped:
        obey(lay({"03": fault}))
    assert (stopped.value.exit_code, stopped.value.code) == (6, "RRID-P02")
    out = tmp_path / "out"
    assert not list(out.rglob(".rrrid-tmp-*"))
    there = json.loads((out / "result.json").read_text())["items"]
    assert {(item["error"]["code"], item["error"]["where"] == item["name"], item["error"]["remedy"]) for item in there
            if item["status"] != "ok"} == {("RRID-P06", True, "go on with --resume")}
    assert there[-1]["status"] == "failed"
    outcome = obey(lay({"03": "fine again"}), resume=True)
    assert outcome.exit_code == 0
    assert contents(outcome.folder) == whole


@pytest.mark.row("C06")
def test_nothing_below_the_root_is_exit_5(tmp_path: Path) -> None:
    """C06."""
    (tmp_path / "root/empty").mkdir(parents=True)
    with pytest.raises(NothingMatched):
        obey(tmp_path / "root")
    assert not (tmp_path / "out").exists()


@pytest.mark.row("X08", "X09", "X11")
def test_hostile_names_are_inert(lay: Lay) -> None:
    """X08, X09, X11: markup, escape sequences, bytes that are no text in a folder's name; every file of the summary is whole."""
    good = ["<script>alert(1)</script>", "\x1b]0;owned\x07", "[bold]$a_{", os.fsdecode(b"\xff\xfe")]
    bad = ["=1+1", "a\nb", os.fsdecode(b"\xfd"), "]]>", "&amp;"]
    outcome = obey(lay(dict.fromkeys(good, "fine") | dict.fromkeys(bad, "reject")), request=Request(()))
    names = [item["name"] for item in json.loads((outcome.folder / "result.json").read_text(encoding="utf-8"))["items"]]
    assert len(set(names)) == 9
    assert not re.search(r"[\x00-\x08\x0b-\x1f]", "".join(names))
    cases = {case.get("name") for case in ElementTree.parse(outcome.folder / "junit.xml").iter("testcase")}
    assert cases == set(names)
    page = (outcome.folder / "report.html").read_text(encoding="utf-8")
    assert "<script" not in page
    assert "\x1b" not in page
    assert {p.parent.name for p in outcome.folder.glob("items/*/result.json")} == {slug(name) for name in good}
