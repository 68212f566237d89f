"""Let a diagnosis judge cases, one after the other; every answer is kept as a line, and no case is
judged twice.

    verdicts.jsonl      {"key", "without", "seconds", "cpu", "answer" | "refused" | "crashed"}

An engine takes a folder and the causes to leave out, and returns the object that
`rrrid diagnose --json` prints.
"""

from __future__ import annotations

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
from pipelines import diagnose
from pipelines.errors import RrridError
from pipelines.io.results import encode
from pipelines.stage import Request, run_stage

Engine = Callable[[Path, tuple[str, ...]], Mapping[str, Any]]
Task = tuple[Sealed, tuple[str, ...]]
_KEPT = (
    "verdict",
    "findings",
    "baseline_effects",
    "rejected",
    "not_identifiable",
    "residual_rms",
    "reason",
    "noise_floor_origin",
)


def by_command(folder: Path, without: tuple[str, ...]) -> Mapping[str, Any]:
    """Return what `rrrid diagnose FOLDER --json` prints."""
    with tempfile.TemporaryDirectory() as place:
        request = Request((folder,), out=Path(place) / "out", no_report=True)
        return run_stage(diagnose.STAGE, request, diagnose.Settings(exclude=without)).json


def by_compute(folder: Path, without: tuple[str, ...]) -> Mapping[str, Any]:
    """Return what `by_command` says without detection limits, series of figures and a folder of
    output: verdict, findings and numbers are the same, `not_identifiable` lacks causes of which the
    limits say that no arm could have so much.
    """
    settings = diagnose.Settings(exclude=without)
    inputs = diagnose.read(Request((folder,)), settings)
    found: Mapping[str, Any] = encode(diagnose.compute(inputs, settings, whole=False))[0]
    return found


def tasks(out: Path, families: Iterable[str] = (), taken_out: bool = False) -> list[Task]:
    """Every case in `out`, or those of `families`; `taken_out`: single causes at full strength,
    each left out of the library.
    """
    wanted = set(families)
    sealed = [one for one in answers_in(out) if not wanted or one.family in wanted]
    if not taken_out:
        return [(one, ()) for one in sealed]
    return [
        (one, (one.findings[0]["cause"],))
        for one in sealed
        if one.family == "single" and one.strength == 1.0
    ]


def judge(out: Path, kept: Path, chosen: Iterable[Task], engine: Engine) -> Iterator[Score]:
    """Ask for each of the cases in `out` that has no answer in the file `kept` yet, and keep it
    there.
    """
    known = {(line["key"], tuple(line["without"])) for line in _lines(kept)}
    for sealed, without in chosen:
        if (sealed.key, without) in known:
            continue
        line = {
            "key": sealed.key,
            "without": list(without),
            **asked(out / "logs" / sealed.key, without, engine),
        }
        with kept.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
        yield _scored(sealed, line)


def scores_in(out: Path, kept: Path) -> list[Score]:
    """Every answer in the file `kept`, judged."""
    sealed = {one.key: one for one in answers_in(out)}
    return [_scored(sealed[line["key"]], line) for line in _lines(kept) if line["key"] in sealed]


def asked(
    folder: Path, without: tuple[str, ...] = (), engine: Engine = by_command
) -> dict[str, Any]:
    """{"seconds", "cpu", "answer" | "refused" | "crashed"} of one diagnosis."""
    begun, spent = time.perf_counter(), time.process_time()
    said: dict[str, Any]
    try:
        answer = engine(folder, without)
        said = {"answer": {name: answer[name] for name in _KEPT if name in answer}}
    except RrridError as refused:
        said = {"refused": f"{refused.code}: {refused.message}"}
    except Exception:  # a campaign of hours goes on, and says how often it happened
        said = {"crashed": traceback.format_exc(limit=-3)}
    return {"seconds": time.perf_counter() - begun, "cpu": time.process_time() - spent, **said}


def _scored(sealed: Sealed, line: Mapping[str, Any]) -> Score:
    if "answer" in line:
        said = read_verdict(line["answer"])
    else:
        said = Said("refused" if "refused" in line else "crashed")
    return score(sealed, said, line["seconds"], line["without"])


def _lines(kept: Path) -> list[dict[str, Any]]:
    """Later answers take the place of earlier ones."""
    if not kept.exists():
        return []
    lines = [
        json.loads(text) for text in kept.read_text(encoding="utf-8").splitlines() if text.strip()
    ]
    return list({(line["key"], tuple(line["without"])): line for line in lines}.values())
