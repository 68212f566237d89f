"""Do one item in a process that stays warm: everything is imported once, the plan is read once.

    begin(plan_text(plan), key) once a process
    record = attempt(item)      as often as there are items; what a single command would write, bit for bit
    undone(item, problem)       the record of one that ended in an error
"""

from __future__ import annotations

import dataclasses
import gc
import os
import sys
import time
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pipelines.batch.items import Item
from pipelines.batch.parts import part_of
from pipelines.batch.plan import Plan, load_stage, read_plan
from pipelines.batch.process import economise
from pipelines.batch.record import Record, Status, relative
from pipelines.errors import EnvironmentFault, InputRejected, NothingMatched, RrridError, clean
from pipelines.io.files import PROVENANCE, hash_file
from pipelines.io.guard import die_with_parent
from pipelines.io.mixed import SeveralSessions
from pipelines.io.places import renamed, tilde
from pipelines.stage import Inputs, Outcome, Request, Stage, run_stage

__all__ = ["attempt", "begin", "undone"]

_LAZY = 3  # items, until everything that is imported late is there


@dataclasses.dataclass
class _Warm:
    """What a worker keeps from item to item."""

    plan: Plan
    stage: Stage[Any, Any]
    key: str
    done: int = 0


_warm: list[_Warm] = []


def begin(text: str, key: str) -> None:
    """Make this process ready for the items of a plan, whose key is known."""
    die_with_parent()
    economise()
    plan = read_plan(text)
    if os.path.isdir(plan.folder):  # else on another machine, where relative paths lead nowhere
        os.chdir(plan.folder)
    stage = load_stage(plan.module)
    _warm[:] = [_Warm(plan, stage, key)]
    if plan.options.memory is not None:
        _limit_memory(plan.options.memory)


def _limit_memory(memory: int) -> None:
    """Let the system refuse this process what goes beyond the address space it has now and `memory` [B]."""
    import resource

    if sys.platform == "linux":
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        wanted = pages * resource.getpagesize() + memory
        resource.setrlimit(resource.RLIMIT_AS, (wanted, wanted))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def attempt(item: Item) -> Record:
    """Run the stage on one item, and tell what became of it, whatever that is."""
    warm, began = _warm[0], time.monotonic()
    try:
        return _done(item, warm, began)
    except SeveralSessions as several:
        return dataclasses.replace(undone(item, several, warm.plan, warm.key), sessions=several.names)
    except RrridError as problem:
        return undone(item, problem, warm.plan, warm.key)
    except Exception as problem:  # one item's misfortune, told with its trace; nothing may end the worker but a crash
        return dataclasses.replace(undone(item, problem, warm.plan, warm.key), trace=traceback.format_exc())
    finally:
        _tidy(warm)


def _tidy(warm: _Warm) -> None:
    """Take away what the item left in cycles. What is imported stays, and is not looked at again: that would take 40 ms an item."""
    gc.collect()
    warm.done += 1
    if warm.done <= _LAZY:
        gc.freeze()


def _done(item: Item, warm: _Warm, began: float) -> Record:
    if item.fault is not None:
        raise item.fault
    plan, options = warm.plan, warm.plan.options
    seen: list[Inputs] = []

    def read(request: Request, settings: Any) -> Inputs:
        seen.append(warm.stage.read(request, settings))
        return seen[0]

    request = Request(item.paths, Path(plan.out) / item.slug, options.robot, options.strict, True, options.force,
                      options.no_report, options.assume_units, options.format, joints=options.joints,
                      session=item.session)
    outcome = run_stage(dataclasses.replace(warm.stage, read=read), request, plan.settings)
    return _record(item, warm, outcome, seen[0], Path(plan.root), time.monotonic() - began)


def _record(item: Item, warm: _Warm, outcome: Outcome[Any], inputs: Inputs, root: Path, seconds: float) -> Record:
    status: Status = {0: "ok", 1: "found", 3: "rejected"}.get(outcome.exit_code, "failed")  # type: ignore[assignment]
    wrong = next((check for check in outcome.checks if check.level == "reject"), None) if status in ("rejected", "failed") else None
    error = None if wrong is None else {"code": wrong.code, "where": wrong.where, "message": wrong.message, "remedy": wrong.remedy}
    hashes = {relative(path, root): inputs.hashes.get(path) or hash_file(path) for path in inputs.sources if path.is_file()}
    turning = inputs.logs[0].log.robot.revolute if inputs.logs else ()
    own = [opened.log for opened in inputs.logs if opened.log.role != "reference"]
    recorded = min((log.recorded for log in own if log.recorded), default="")
    return Record(
        clean(item.name), item.slug, status, outcome.exit_code, error, clean(outcome.report.verdict, None),
        inputs.robot_name, recorded,
        part_of(outcome.json, inputs.robot_name, recorded, turning), _only_causes(outcome.json), hashes,
        tuple(relative(log, root) for log in item.logs), hash_file(outcome.folder / PROVENANCE), warm.key, seconds)


def _only_causes(result: Mapping[str, Any]) -> bool:
    """Whether nothing but named causes is wrong: of a run, every stage but the diagnosis, and what extends by it, is in order."""
    others = any(stage["exit"] not in (0, 5) for stage in result.get("stages", ())
                 if stage["name"] not in ("diagnose", "extend"))
    return result.get("verdict") == "cause" and not others


def undone(item: Item, problem: BaseException, plan: Plan, key: str) -> Record:
    """The record of an item without a result."""
    error = _error_of(problem)
    known = isinstance(problem, InputRejected | NothingMatched)
    names = {plan.root: ""}
    words = {name: tilde(renamed(text, names)) for name, text in error.as_dict().items()}
    words["where"] = words["where"] or clean(item.name)  # of its process, not of one of its files
    stops = isinstance(error, EnvironmentFault) and bool(plan.out) and Path(error.where).is_relative_to(plan.out)
    return Record(clean(item.name), item.slug, "rejected" if known else "failed", error.exit_code, words,
                  logs=tuple(relative(log, Path(plan.root)) for log in item.logs), key=key, stops=stops)


def _error_of(problem: BaseException) -> RrridError:
    if isinstance(problem, RrridError):
        return problem
    if isinstance(problem, MemoryError):
        return EnvironmentFault("P03", "memory: it needs more than an item may", remedy="raise --memory, or split its logs")
    return RrridError("Z70", f"internal error: {type(problem).__name__}: {problem}",
                      remedy="please report it, with the file in crashes")
