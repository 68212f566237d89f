"""Let a diagnosis judge cases, one after the other; every answer is kept as one line, and none is asked for twice.

    verdicts.jsonl      {"key", "without", "seconds", "cpu", "answer" | "refused" | "crashed"}

The diagnosis is the command's own stage, or "module:function" of a folder and the causes to leave out, which returns the
object that `rrrid diagnose --json` prints, or a dataclass that becomes it.
"""

from __future__ import annotations

import dataclasses
import importlib
import json
import tempfile
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from benchmarks.hidden_effects.make import Sealed, answers_in
from benchmarks.hidden_effects.score import Score, score
from benchmarks.hidden_effects.verdict import Said, read_verdict
from pipelines.errors import RrridError
from pipelines.io.results import encode
from pipelines.stage import Request, run_stage

__all__ = ["Diagnose", "asked", "by_command", "by_compute", "engine_named", "judge", "scores_in", "tasks"]

Diagnose = Callable[[Path, tuple[str, ...]], Any]
Task = tuple[Sealed, tuple[str, ...]]
_KEPT = ("verdict", "findings", "baseline_effects", "rejected", "not_identifiable", "residual_rms", "reason", "noise_floor_origin")


def by_command(folder: Path, without: tuple[str, ...]) -> Mapping[str, Any]:
    """What `rrrid diagnose FOLDER --json` prints."""
    stage = importlib.import_module("pipelines.diagnose").STAGE
    settings = dataclasses.replace(stage.settings(), exclude=without) if without else stage.settings()
    with tempfile.TemporaryDirectory() as place:
        return run_stage(stage, Request((folder,), out=Path(place) / "out", no_report=True), settings).json


def by_compute(folder: Path, without: tuple[str, ...]) -> Mapping[str, Any]:
    """What `by_command` says without detection limits, series of figures and a folder of output: verdict, findings and numbers are
    the same, `not_identifiable` lacks causes of which the limits say that no arm could have so much."""
    module = importlib.import_module("pipelines.diagnose")
    settings = module.Settings(exclude=without)
    found: Mapping[str, Any] = encode(module.compute(module.read(Request((folder,)), settings), settings, whole=False))[0]
    return found


def engine_named(name: str | None) -> Diagnose:
    """"module:function"; without a name the command."""
    if name is None:
        return by_command
    module, _, function = name.partition(":")
    found: Diagnose = getattr(importlib.import_module(module), function)
    return found


def tasks(out: Path, families: Iterable[str] = (), taken_out: bool = False) -> list[Task]:
    """Every case in `out`, or those of `families`; `taken_out`: single causes at full strength, each left out of the library."""
    wanted = set(families)
    sealed = [one for one in answers_in(out) if not wanted or one.family in wanted]
    if not taken_out:
        return [(one, ()) for one in sealed]
    return [(one, (one.findings[0]["cause"],)) for one in sealed if one.family == "single" and one.strength == 1.0]


def judge(out: Path, kept: Path, chosen: Iterable[Task], diagnose: Diagnose) -> Iterator[Score]:
    """Ask for each of the cases in `out` that has no answer in the file `kept` yet, and keep it there."""
    known = {(line["key"], tuple(line["without"])) for line in _lines(kept)}
    for sealed, without in chosen:
        if (sealed.key, without) in known:
            continue
        line = {"key": sealed.key, "without": list(without), **asked(out / "logs" / sealed.key, without, diagnose)}
        with kept.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
        yield _scored(sealed, line)


def scores_in(out: Path, kept: Path) -> list[Score]:
    """Every answer in the file `kept`, judged."""
    sealed = {one.key: one for one in answers_in(out)}
    return [_scored(sealed[line["key"]], line) for line in _lines(kept) if line["key"] in sealed]


def asked(folder: Path, without: tuple[str, ...] = (), diagnose: Diagnose = by_command) -> dict[str, Any]:
    """{"seconds", "cpu", "answer" | "refused" | "crashed"} of one diagnosis."""
    begun, spent = time.perf_counter(), time.process_time()
    said: dict[str, Any]
    try:
        answer = diagnose(folder, without)
        whole = answer if isinstance(answer, Mapping) else encode(answer)[0]
        said = {"answer": {name: whole[name] for name in _KEPT if name in whole}}
    except RrridError as refused:
        said = {"refused": f"{refused.code}: {refused.message}"}
    except Exception:  # a campaign of hours goes on, and says how often it happened
        said = {"crashed": traceback.format_exc(limit=-3)}
    return {"seconds": time.perf_counter() - begun, "cpu": time.process_time() - spent, **said}


def _scored(sealed: Sealed, line: Mapping[str, Any]) -> Score:
    said = read_verdict(line["answer"]) if "answer" in line else Said("refused" if "refused" in line else "crashed")
    return score(sealed, said, line["seconds"], line["without"])


def _lines(kept: Path) -> list[dict[str, Any]]:
    """Later answers take the place of earlier ones."""
    if not kept.exists():
        return []
    lines = [json.loads(text) for text in kept.read_text(encoding="utf-8").splitlines() if text.strip()]
    return list({(line["key"], tuple(line["without"])): line for line in lines}.values())
