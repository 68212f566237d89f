"""Run a stage on every robot and day of every folder of logs below a root, and say what came of all of them.

    outcome = run_batch(plan, wanted)

The output folder holds, beside the summary, `items/` with what each item's own command would have written, and `ledger/` with a
record of each, by which --resume knows what is done. Everything in it is the old one or the complete new one at any moment.
"""

from __future__ import annotations

import dataclasses
import os
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from pipelines.batch.baseline import against, unheld
from pipelines.batch.drift import drift_of
from pipelines.batch.earlier import make_way
from pipelines.batch.folder import BatchFolder
from pipelines.batch.items import Item, find_items, shard
from pipelines.batch.lock import locked
from pipelines.batch.plan import Plan, plan_key
from pipelines.batch.record import Record, fresh, intact
from pipelines.batch.result import result_of
from pipelines.batch.signals import Listener
from pipelines.batch.summary import Summary, summary_report
from pipelines.batch.work import undone
from pipelines.errors import Check, EnvironmentFault, NothingMatched, UsageError
from pipelines.io.model_file import ModelFile, read_model
from pipelines.io.places import keep_apart, slug, tilde
from pipelines.io.results import encode, headed
from pipelines.stage import Outcome

__all__ = ["Wanted", "run_batch"]


@dataclass(frozen=True)
class Wanted:
    """What the user asked of the batch as a whole."""

    root: Path
    out: Path | None = None
    jobs: int = 1
    each_log: bool = False
    on_error: Literal["continue", "abort"] = "continue"
    resume: bool = False
    shard: tuple[int, int] = (1, 1)
    backend: str = "local"  # or dask://host:port
    baseline: str | None = None
    check: bool = False
    no_report: bool = False
    tell: Callable[[str], None] = field(default=lambda words: None, compare=False)


def run_batch(plan: Plan, wanted: Wanted) -> Outcome[Summary]:
    """Do every item, and write the summary.

    Args:
        plan: the stage with its settings and options; where it works is filled in here.

    Raises:
        UsageError: no such root, an output folder that is not free, a cluster that is none.
        NothingMatched: C06, no log below the root.
        EnvironmentFault: P08, another batch writes there; P02, F13, the output cannot be written; P04, no worker.
    """
    started = time.time()
    baseline = None if wanted.baseline is None else read_model(Path(wanted.baseline))
    root = wanted.root.absolute()
    everything, checks = find_items(root, wanted.each_log)
    items = shard(everything, *wanted.shard)
    out = (wanted.out or Path("runs") / "several" / slug(root.resolve().name) / "batch").absolute()
    keep_apart(out, (), (root,))
    folder = BatchFolder(out)
    folder.claim()
    moved = make_way(folder, plan.stage, root, everything, wanted.out is not None, plan.options.force)
    for check in moved:  # whatever becomes of this batch
        wanted.tell(f"{check.where}: {check.message}")
    plan = dataclasses.replace(plan, root=str(root), out=str(folder.items), folder=os.getcwd())
    with locked(out), Listener() as listener:
        folder.begin(plan, everything)
        done = _Done(plan, plan_key(plan), folder, wanted, listener)
        done.notices += moved
        done.go(items)
        every = [one for item in items for one in done.sessions.get(item.slug, (item,))]
        records = _judged([done.records.get(one.slug) or done.missing(one) for one in every], baseline)
        unmet = () if baseline is None else unheld(plan.stage, records, baseline, wanted.shard[1] > 1)
        remarks = (*(_short(check, root) for check in checks), *unmet)
        summary = Summary(plan.stage, records, drift_of(records), remarks, baseline, bool(listener.number))
        outcome = _written(folder, summary, done, started)
    if done.fault is not None:
        raise done.fault
    return outcome


def _written(folder: BatchFolder, summary: Summary, done: _Done, started: float) -> Outcome[Summary]:
    """Write the summary. Where the disk was full before, it may be full still: the first fault is told then."""
    wanted, named = done.wanted, None if summary.baseline is None else summary.baseline.name
    result = result_of(summary.stage, summary.records, summary.drifts, named, summary.checks)
    json_ = tilde(headed("batch", encode(result)[0]))
    report = tilde(summary_report(summary, figures=not (wanted.no_report or summary.interrupted or done.fault)))
    try:
        folder.finish(summary, json_, None if wanted.no_report else report, wanted.check, _about(done, started))
    except EnvironmentFault:
        if done.fault is None:
            raise
    return Outcome(summary, json_, report, wanted.out or folder.out.relative_to(Path.cwd()), _exit_code(summary, done),
                   (*summary.checks, *done.notices))


def _short(check: Check, root: Path) -> Check:
    return dataclasses.replace(check, where=check.where.removeprefix(f"{root}/"))


def _judged(records: Sequence[Record], baseline: ModelFile | None) -> tuple[Record, ...]:
    return tuple(records if baseline is None else (against(record, baseline) for record in records))


def _exit_code(summary: Summary, done: _Done) -> int:
    if done.listener.number:
        return 128 + done.listener.number
    errors = {(r.exit, (r.error or {}).get("code"), (r.error or {}).get("message")) for r in summary.records}
    if len(errors) == 1 and next(iter(errors))[0] == UsageError.exit_code:
        return UsageError.exit_code  # no item is to blame: what was asked of them all cannot be
    if summary.count("rejected", "failed"):
        return 4
    if any(check.gate for check in summary.checks):
        return NothingMatched.exit_code  # the baseline met nothing: that nothing is beyond it is no news
    return 1 if done.wanted.check and summary.count("found") else 0


def _about(done: _Done, started: float) -> dict[str, object]:
    """What provenance.json says beside the outputs: all that may differ from one run to the next."""
    plan, wanted = done.plan, done.wanted
    return {
        "command": "batch", "stage": plan.stage, "root": plan.root, "key": done.key,
        "seconds": {r.name: r.seconds for r in done.records.values()},
        "options": {"jobs": wanted.jobs, "backend": wanted.backend, "shard": list(wanted.shard), "resume": wanted.resume,
                    "on_error": wanted.on_error, "each_log": wanted.each_log, **dataclasses.asdict(plan.options)},
        "inputs": {name: value for r in done.records.values() for name, value in r.inputs.items()},
        "kept": done.kept, "notices": [check.as_dict() for check in done.notices],
        "started": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(started)), "duration": time.time() - started}


class _Done:
    """The records so far, each in the ledger as soon as it is there."""

    def __init__(self, plan: Plan, key: str, folder: BatchFolder, wanted: Wanted, listener: Listener) -> None:
        self.plan, self.key, self.folder, self.wanted, self.listener = plan, key, folder, wanted, listener
        self.records: dict[str, Record] = {}
        self.sessions: dict[str, tuple[Item, ...]] = {}  # of each item whose logs are of several
        self.notices: list[Check] = []
        self.kept = 0
        self.fault: EnvironmentFault | None = None  # no output can be written, or nobody can do the work
        self.aborted = False

    def go(self, items: Sequence[Item]) -> None:
        """Do what is not done yet, until all is done or something stops it."""
        total = len(items)
        while items and not self.stopped():
            before = len(self.records)
            left = [item for item in items if not (self.wanted.resume and self._keep(item))]
            if kept := len(self.records) - before:
                self.kept += kept
                self.wanted.tell(f"{self.kept} of {total} are done already")
            items = ()
            if left:
                try:
                    items = self._through(left, total)
                except EnvironmentFault as problem:  # no workers, or none any more: what is done is done
                    self.fault = problem
            total += len(items)

    def _through(self, left: Sequence[Item], total: int) -> list[Item]:
        """Do the items; return the sessions of those that hold several, which are still to be done."""
        divided: list[Item] = []
        with closing(self._results(left)) as results:
            for item, record in results:
                self._take(item, record)
                divided += self.sessions.get(item.slug, ())
                if item.slug in self.records:
                    self.wanted.tell(f"{len(self.records)} of {total}: {record.name} {record.status}")
                if self.stopped():
                    break
        return divided

    def stopped(self) -> bool:
        return bool(self.listener.number) or self.fault is not None or self.aborted

    def _results(self, items: Sequence[Item]) -> Generator[tuple[Item, Record], None, None]:
        if self.wanted.backend == "local":
            from pipelines.batch.pool import local

            return local(self.plan, self.key, items, min(self.wanted.jobs, len(items)), self.stopped)
        from pipelines.batch.cluster import cluster

        return cluster(self.wanted.backend, self.plan, self.key, items, self.stopped)

    def _keep(self, item: Item) -> bool:
        """Return whether the item's earlier result still stands (P07), whole (P10)."""
        if self.listener.number:
            return True  # it will be told as missing
        record = self.folder.ledger.get(item)
        if record is None or not fresh(record, item, Path(self.plan.root), self.key):
            return False
        if not intact(record, self.folder.items / item.slug):
            self.notices.append(Check.of("P10", "warn", "its stored result is not what was written; done again", where=record.name,
                                         remedy="check the disk, if you have not changed it"))
            return False
        self.records[item.slug] = record
        return True

    def _take(self, item: Item, record: Record) -> None:
        """Remember what became of an item. One without a result leaves no older one behind."""
        if record.stops and record.error is not None:
            self.fault = EnvironmentFault(record.error["code"].removeprefix("RRID-"), record.error["message"],
                                          where=record.error["where"], remedy="free it, and go on with --resume")
            return
        try:
            if not record.provenance:
                self.folder.discard(item.slug)
            self.folder.ledger.put(self.folder.traced(record))
        except EnvironmentFault as problem:
            self.fault = problem
            return
        if record.sessions:
            self.sessions[item.slug] = item.divided(record.sessions)
            return
        self.records[item.slug] = record
        self.aborted = self.wanted.on_error == "abort" and record.status in ("rejected", "failed")

    def missing(self, item: Item) -> Record:
        """The record of an item that was not reached."""
        why = "the batch was interrupted" if self.listener.number else "the batch was stopped"
        return undone(item, EnvironmentFault("P06", f"not done: {why}", remedy="go on with --resume"), self.plan, self.key)
