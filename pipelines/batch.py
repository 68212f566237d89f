"""Run a stage on every robot and day of every folder of logs below a root.

Reads    many folders of logs
Writes   items/ with what each item's own command writes, ledger/ with what became of each item,
         result.json, summary.parquet, junit.xml, report.html, and last of all provenance.json
Source   cli-contract.md; bad-inputs.md, rows P01 to P13

Everything in the output is the old one or the complete new one at any moment. The ledger has a line
of JSON an item, in one file a shard, so that the folders of shards can be copied together;
--resume reads it.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from pipelines import __version__
from pipelines.cache import code_of, digest_of_json, libraries, locked, read_sources
from pipelines.errors import Check, EnvironmentFault, UsageError, clean, did_you_mean
from pipelines.estimation.drift import Session, drift_of
from pipelines.executor import Item, Plan, Record, failed, relative, run_items
from pipelines.io.files import find_logs
from pipelines.io.output import (
    PROVENANCE,
    environment_faults,
    hash_file,
    provenance_of,
    refuse_place,
    renamed,
    staging_folder,
    sweep,
    tilde,
    write_text,
    written_by,
)
from pipelines.io.parquet import write_rows
from pipelines.io.results import decode, encode, headed, json_text
from pipelines.io.robot_files import robot_sources
from pipelines.io.sandbox import regular_file
from pipelines.report.batch_report import Result, batch_report
from pipelines.run import STEPS
from pipelines.stage import Outcome

# The commands that read a folder of logs and nothing else.
STAGES = ("run", "convert", "simulate", *(module.replace("_", "-") for module in STEPS))
_LIBRARIES = ("numpy", "scipy", "h5py", "pyarrow", "pandas", "matplotlib", "jinja2")
_MARK = "batch.json"
_APART = {"items", "ledger", "crashes"}  # what result.json and the page are made of
_OURS = _APART | {"figures", _MARK, "report.html", "summary.parquet", "junit.xml", "result.json"}
_TEXTS = ["item", "status", "code", "message", "verdict", "robot", "recorded", "quantity", "unit"]
_COLUMNS = {**dict.fromkeys(_TEXTS, "string"), "exit": "int64"}
_COLUMNS |= dict.fromkeys(("value", "std", "away"), "Float64")


def module_of(stage: str) -> str:
    """Return the module of the stage that a command runs.

    Raises:
        UsageError: C01, no batch can run it.
    """
    if stage not in STAGES:
        words = f"'{stage}' is no stage of a batch{did_you_mean(stage, STAGES)}"
        raise UsageError("C01", words, "--stage", f"one of: {', '.join(STAGES)}")
    return f"pipelines.{stage.replace('-', '_')}"


def find_items(root: Path) -> tuple[tuple[Item, ...], tuple[Check, ...]]:
    """Return every folder of logs below `root`, sorted by name, and what was passed over.

    A folder that cannot be listed is an item as well: it fails alone.

    Raises:
        UsageError: C04, `root` does not exist; C02, it is no folder.
        NothingMatched: C06, there is no log below it.
    """
    root = root.absolute()
    if not os.path.isdir(root):
        regular_file(root)
        words = "is a log, not a folder of folders"
        raise UsageError("C02", words, root, "run the stage on it alone")
    unreadable: list[Path] = []
    logs, checks = find_logs([root], unreadable)
    folders: dict[Path, list[Path]] = {folder: [] for folder in unreadable}
    for log in logs:
        folders.setdefault(log.parent, []).append(log)
    items = []
    for folder, own in folders.items():
        nested = any(other.is_relative_to(folder) for other in folders if other != folder)
        paths = tuple(own) if nested else (folder,)
        items.append(Item(folder.relative_to(root).as_posix(), paths, tuple(own)))
    return tuple(sorted(items, key=lambda item: item.name)), checks


def run_batch(plan: Plan, tell: Callable[[str], None] = lambda words: None) -> Outcome[Result]:
    """Do every item that is not done yet, and write the summary.

    Raises:
        UsageError: no such root, an output folder that is not free, no such cluster.
        NothingMatched: C06, no log below the root.
        EnvironmentFault: P08, another batch writes there; P02, F13, the output cannot be written;
            P04, no worker.
    """
    wanted, plan = plan.out, replace(plan, root=plan.root.absolute(), out=plan.out.absolute())
    items, checks = find_items(plan.root)
    refuse_place(plan.out, (), (plan.root,), inside=True)
    claim(plan.out, plan.stage, plan.request.force)
    number, of = plan.shard
    with locked(plan.out / "ledger", plan.out), _signals() as heard:
        batch = _Batch(plan, heard)
        batch.go(items[number - 1 :: of], tell)
        outcome = batch.finish(items[number - 1 :: of], renamed(checks, {str(plan.root): ""}))
    if batch.fault is not None:
        raise batch.fault
    return replace(outcome, folder=wanted)


def claim(out: Path, stage: str, force: bool = False) -> None:
    """Refuse an output that is not new, empty, or that of a batch of the same stage (C05)."""

    def refused(words: str, instead: str = "") -> UsageError:
        return UsageError("C05", words, out, f"choose another folder with --out{instead}")

    if out.is_symlink() or (out.exists() and not out.is_dir()):
        raise refused("is not a folder")
    with environment_faults(out):
        out.mkdir(parents=True, exist_ok=True)
        there = {path.name for path in out.iterdir() if not path.name.startswith(".rrrid-tmp-")}
    earlier = _stage_of(out)
    if there - {"ledger"} and not earlier:
        command = written_by(out)
        raise refused(f"holds the result of '{command}'" if command else "holds files of no batch")
    if foreign := sorted(there - _OURS - {PROVENANCE}):
        words = f"holds files that rrrid did not write there: {', '.join(foreign[:3])}"
        raise refused(words, ", or move them")
    if earlier not in ("", stage) and not force:
        words = f"holds a batch of {clean(earlier, 40)}"
        raise refused(words, ", or replace it with --force")


def _stage_of(out: Path) -> str:
    """Return the stage of the batch in `out`, or ""."""
    with contextlib.suppress(OSError, ValueError, RecursionError):
        about = json.loads((out / _MARK).read_text(encoding="utf-8"))
        if isinstance(about, dict) and about.get("command") == "batch":
            return str(about.get("stage"))
    return ""


@contextlib.contextmanager
def _signals() -> Iterator[list[int]]:
    """Note signals to stop, instead of being torn out of what is just being written (P06)."""
    heard: list[int] = []
    stopping = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(s, lambda number, frame: heard.append(number)) for s in stopping]
    try:
        yield heard
    finally:
        for number, handler in zip(stopping, before, strict=True):
            signal.signal(number, handler)


class _Batch:
    """The records so far, each in the ledger as soon as it is there."""

    def __init__(self, plan: Plan, heard: list[int]) -> None:
        """Mark the folder, and read what was done in it."""
        self.plan, self.heard, self.out = plan, heard, plan.out
        self.started, self.key = time.time(), _key(plan)
        self.records: dict[str, Record] = {}
        self.divided: dict[str, list[Item]] = {}  # sessions of the items that hold several
        self.kept = 0
        self.notices: list[Check] = []
        self.fault: EnvironmentFault | None = None  # no output can be written, or no worker is left
        self.ledger = self.out / "ledger" / "{}-of-{}.jsonl".format(*plan.shard)
        if _stage_of(self.out) != plan.stage:  # replaced, as --force says
            for folder in ("items", "crashes"):
                shutil.rmtree(self.out / folder, ignore_errors=True)
        self.earlier = read_ledger(self.out)
        about = {"tool": "rrrid", "command": "batch", "version": __version__, "stage": plan.stage}
        write_text(self.out / _MARK, json_text(about))
        with environment_faults(self.out):
            (self.out / PROVENANCE).unlink(missing_ok=True)
            (self.out / "items").mkdir(exist_ok=True)
            sweep(self.out / "items")
            write_text(self.ledger, "".join(map(record_line, self.earlier.values())))
            for path in self.ledger.parent.glob("*.jsonl"):
                if path != self.ledger and plan.shard == (1, 1):
                    path.unlink()

    def stopped(self) -> bool:
        return bool(self.heard) or self.fault is not None

    def go(self, items: Iterable[Item], tell: Callable[[str], None]) -> None:
        """Do what is not done yet, until all is done or something stops it."""
        waiting = deque(item for item in items if not self._keep(item))
        total = len(self.records) + len(waiting)
        if self.kept:
            tell(f"{self.kept} of {total} are done already")
        try:
            for item, record in run_items(self.plan, waiting, self.stopped):
                self._take(item, record)
                if sessions := self.divided.get(item.slug):
                    waiting += [one for one in sessions if not self._keep(one)]
                    total += len(sessions) - 1
                elif item.slug in self.records:
                    done = record.item
                    tell(f"{len(self.records)} of {total}: {done.name} {done.status}")
        except EnvironmentFault as problem:  # no room, or no workers: what is done is done
            self.fault = problem

    def _keep(self, item: Item) -> bool:
        """Return whether the item's earlier result is as it was written, of the same logs (P07)."""
        record = self.earlier.get(item.slug)
        if not self.plan.resume or self.heard or record is None or record.key != self.key:
            return False
        logs = sorted(relative(log, self.plan) for log in item.logs)
        same = all(_hash(self.plan.root / name) == sha for name, sha in record.inputs.items())
        if not record.provenance or sorted(record.logs) != logs or not same:
            return False
        if not is_intact(record, self.out / "items" / item.slug):
            words = "its stored result is not what was written; done again"
            remedy = "check the disk, if you have not changed it"
            self.notices.append(Check.of("P10", "warn", words, item.name, remedy))
            return False
        self.records[item.slug] = record
        self.kept += 1
        return True

    def _take(self, item: Item, record: Record) -> None:
        """Remember the outcome of an item; one without a result leaves no older one behind.

        Raises:
            EnvironmentFault: no output can be written, by this process or the item's.
        """
        error = record.item.error
        is_ours = error is not None and error.where.startswith(tilde(f"{self.out}/"))
        if error is not None and is_ours and record.item.exit == EnvironmentFault.exit_code:
            code, remedy = error.code.removeprefix("RRID-"), "free it, and go on with --resume"
            raise EnvironmentFault(code, error.message, error.where, remedy)
        if not record.provenance:
            self._discard(item.slug)
        crash = self.out / "crashes" / f"{item.slug}.txt"
        crash.unlink(missing_ok=True)
        if record.trace:
            write_text(crash, record.trace)
        record = replace(record, trace="", key=self.key)
        with environment_faults(self.ledger), self.ledger.open("a", encoding="ascii") as file:
            file.write(record_line(record))
        if record.sessions:
            self.divided[item.slug] = [
                replace(item, name=f"{item.name}: {name}", session=name) for name in record.sessions
            ]
            return
        self.records[item.slug] = record

    def _discard(self, slug: str) -> None:
        """Remove an item's result, in one step."""
        folder = self.out / "items" / slug
        if folder.is_dir() and not folder.is_symlink() and written_by(folder):
            with environment_faults(folder):
                aside = staging_folder(folder)  # the next batch sweeps it where this one is killed
                os.replace(folder, aside)
                shutil.rmtree(aside)

    def finish(self, items: Iterable[Item], checks: tuple[Check, ...]) -> Outcome[Result]:
        """Write the summary; where the disk is full still, the first fault is reported."""
        out, plan = self.out, self.plan
        every = [one for item in items for one in self.divided.get(item.slug, [item])]
        how = "interrupted" if self.heard else "stopped"
        words, remedy = f"not done: the batch was {how}", "go on with --resume"
        missing = EnvironmentFault("P06", words, remedy=remedy)
        records = [self.records.get(one.slug) or failed(plan, one, missing) for one in every]
        result = result_of(plan.stage, records, checks)
        done = not self.stopped()
        report = tilde(batch_report(result, figures=done and not plan.request.no_report))
        object_ = tilde(headed("batch", encode(result)[0]))
        try:
            with environment_faults(out):
                self._sweep({one.slug for one in every} if done and plan.shard == (1, 1) else None)
            write_rows(out / "summary.parquet", _rows(result, records), _COLUMNS)
            write_text(out / "junit.xml", tilde(_junit(result, plan.request.check)))
            if not plan.request.no_report:
                from pipelines.report.render import write_report

                footer = {"command": "rrrid batch", "version": __version__, "stage": plan.stage}
                write_report(report, out, footer)
            write_text(out / "result.json", json_text(object_))
            write_text(out / PROVENANCE, json_text(tilde(self._about(records))))
        except EnvironmentFault:
            if self.fault is None:
                raise
        checks = (*result.checks, *self.notices)
        return Outcome(result, object_, report, out, self._exit(result), checks)

    def _sweep(self, slugs: set[str] | None) -> None:
        """Remove the earlier summary's page, drafts of dead processes, and items that are gone."""
        sweep(self.out)
        sweep(self.out / "items")
        shutil.rmtree(self.out / "figures", ignore_errors=True)
        (self.out / "report.html").unlink(missing_ok=True)
        with contextlib.suppress(OSError):
            (self.out / "crashes").rmdir()  # where it is empty
        if slugs is not None:
            for path in (self.out / "items").iterdir():
                if path.name not in slugs:
                    self._discard(path.name)
            write_text(self.ledger, "".join(map(record_line, self.records.values())))

    def _about(self, records: list[Record]) -> dict[str, Any]:
        """Return the provenance of the summary."""
        names = (path.relative_to(self.out) for path in sorted(self.out.rglob("*")))
        files = [n for n in names if n.parts[0] not in _APART and (self.out / n).is_file()]
        plan = self.plan
        options = {"jobs": plan.jobs, "backend": plan.backend, "shard": list(plan.shard)}
        return {
            "tool": "rrrid",
            "version": __version__,
            "command": "batch",
            "stage": plan.stage,
            "key": self.key,
            "kept": self.kept,
            "options": _options(plan) | options,
            "settings": encode(plan.settings)[0],
            "libraries": libraries(*_LIBRARIES),
            "notices": [check.as_dict() for check in self.notices],
            "started": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(self.started)),
            "duration": time.time() - self.started,
            "inputs": {name: sha for record in records for name, sha in record.inputs.items()},
            "outputs": {name.as_posix(): hash_file(self.out / name) for name in files},
            "items": {record.slug: record.provenance for record in records if record.provenance},
        }

    def _exit(self, result: Result) -> int:
        if self.heard:
            return 128 + self.heard[0]
        if {item.exit for item in result.items} == {UsageError.exit_code}:
            return UsageError.exit_code  # no item is to blame: what was asked of them cannot be
        if result.counts["rejected"] or result.counts["failed"]:
            return 4
        return 1 if self.plan.request.check and result.counts["found"] else 0


def _options(plan: Plan) -> dict[str, Any]:
    """Return the options of every item that decide on its result."""
    names = ("robot", "strict", "no_report", "assume_units", "format", "joints")
    return {name: getattr(plan.request, name) for name in names}


def _key(plan: Plan) -> str:
    """Return the digest of all that decides on an item's result beside its logs."""
    robot = robot_sources(plan.request.robot) if plan.request.robot is not None else ()
    hashes = [hash_file(path) for path in robot if path.is_file()]
    sources = read_sources()
    modules = [module_of(name) for name in STAGES] if plan.stage == "run" else [plan.module]
    code = {module: code_of(module, sources) for module in modules}
    given = [plan.module, encode(plan.settings)[0], _options(plan)]
    return digest_of_json([*given, hashes, code, libraries(*_LIBRARIES)])


def read_ledger(out: Path) -> dict[str, Record]:
    """Return what is known, the last line of each item; torn lines are skipped."""
    records = {}
    for path in sorted((out / "ledger").glob("*.jsonl")):
        for line in path.read_text(encoding="ascii", errors="replace").splitlines():
            with contextlib.suppress(ValueError, KeyError, TypeError, AttributeError):
                record = decode(Record, json.loads(line), {})
                records[record.slug] = record
    return records


def record_line(record: Record) -> str:
    """Return the record as JSON; figures keep their order, which is that of a run's stages."""
    return json.dumps(encode(record)[0]) + "\n"


def _hash(path: Path) -> str:
    return hash_file(path) if path.is_file() else ""


def is_intact(record: Record, folder: Path) -> bool:
    """Return whether an item's folder holds exactly what was written there (P10)."""
    if _hash(folder / PROVENANCE) != record.provenance:
        return False
    outputs = {PROVENANCE: record.provenance, **provenance_of(folder)["outputs"]}
    there = {p.relative_to(folder).as_posix() for p in folder.rglob("*") if not p.is_dir()}
    return there == set(outputs) and all(_hash(folder / n) == sha for n, sha in outputs.items())


def result_of(stage: str, records: list[Record], checks: tuple[Check, ...]) -> Result:
    """Return the result of a batch; nothing in it depends on how the items were done."""
    items = tuple(record.item for record in records)
    counted = Counter(item.status for item in items)
    counts = {status: counted[status] for status in ("ok", "found", "rejected", "failed")}
    sessions = [
        Session(r.item.name, r.item.robot, r.item.recorded or "", r.figures, r.residuals)
        for r in records
    ]
    return Result(stage, items, counts, drift_of(sessions), checks)


def _rows(result: Result, records: list[Record]) -> list[dict[str, Any]]:
    """Return a row for each figure and residual of each item, and one for an item without any."""
    away = {
        (figure.name, item): far
        for drift in result.drift
        for figure in (*drift.figures, *drift.residuals)
        for item, far in zip(figure.items, figure.away, strict=True)
    }
    rows: list[dict[str, Any]] = []
    for record in records:
        item, error = record.item, record.item.error
        about = {name: getattr(item, name, getattr(error, name, None)) for name in _COLUMNS}
        about["item"] = item.name
        numbers: dict[str, tuple[float, float | None, str]] = dict(record.figures)
        numbers |= {name: (value, None, unit) for name, (value, unit) in record.residuals.items()}
        for name, (value, std, unit) in numbers.items():
            row = {"quantity": name, "value": value, "std": std, "unit": unit}
            rows.append(about | row | {"away": away.get((name, item.name))})
        rows += [] if numbers else [about]
    return rows


def _junit(result: Result, check: bool) -> str:
    """Return JUnit XML, a test case an item; with `check`, a finding is a failure."""
    kinds = {"rejected": "error", "failed": "error"} | ({"found": "failure"} if check else {})
    counts = Counter(kinds.get(item.status, "") for item in result.items)
    about = {"name": f"rrrid batch {result.stage}", "tests": str(len(result.items))}
    about |= {"failures": str(counts["failure"]), "errors": str(counts["error"]), "skipped": "0"}
    suite = ElementTree.Element("testsuite", about)
    for item in result.items:
        about_case = {"classname": f"rrrid.{result.stage}", "name": _plain(item.name)}
        case = ElementTree.SubElement(suite, "testcase", about_case)
        if item.status in kinds:
            code = item.error.code if item.error else item.status
            words = _plain(item.error.message if item.error else item.verdict)
            tag = kinds[item.status]
            element = ElementTree.SubElement(case, tag, type=code, message=words)
            if item.error:
                where, remedy = item.error.where, item.error.remedy
                element.text = _plain(f"{where}: {item.error.message}. {remedy}")
    ElementTree.indent(suite)
    text = ElementTree.tostring(suite, encoding="unicode")
    return f'<?xml version="1.0" encoding="utf-8"?>\n{text}\n'


def _plain(text: str) -> str:
    """Return text that XML may hold: it has no place for control characters, and two others."""
    return clean(text, None).replace("\ufffe", "").replace("\uffff", "")
