"""Record cases: their logs in one folder, their answers in another. What is there already is not
made again.

OUT/logs/<key>/<log>.h5       a folder of logs of one robot
OUT/answers/<key>.json        what is hidden in them; no log names it
"""

from __future__ import annotations

import json
import math
import shutil
import time
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from bench.plant import answer
from benchmarks.hidden_effects.cases import SealedCase
from benchmarks.hidden_effects.sessions import Session, record_case
from pipelines.errors import UsageError
from pipelines.io.files import write_log
from pipelines.io.output import write_file

_VERDICTS = {
    "zero": "no-fault-found",
    "outside": "unknown",
    "invisible": "not-testable",
    "uncentred": "flagged",
}


@dataclass(frozen=True)
class Sealed:
    """The answer of one case."""

    key: str
    family: str
    verdict: str
    """What a diagnosis should say: "cause", "no-fault-found", "unknown", "not-testable"; "flagged":
    anything."""
    findings: tuple[
        dict[str, Any], ...
    ]  # cause, joint, parameters of each true cause; of "not-testable" what it must name
    standing: tuple[dict[str, Any], ...]
    case: dict[str, Any]  # the SealedCase, whose strength, session and so on the table is split by

    @property
    def strength(self) -> float | None:
        """Of the only cause, or the weakest of several."""
        return min((float(one["strength"]) for one in self.case["hidden"]), default=None)


def make_cases(cases: Iterable[SealedCase], out: Path) -> Iterator[tuple[SealedCase, float]]:
    """Record each case into `out`; yields it with the CPU seconds it took, nothing for one that was
    there.

    Of a case whose loop runs away with what is hidden there are no logs: it comes with NaN seconds.
    """
    for case in cases:
        begun = time.process_time()
        try:
            if make_case(case, out):
                yield case, time.process_time() - begun
        except UsageError:
            yield case, math.nan


def make_case(case: SealedCase, out: Path) -> bool:
    """Record one case, unless it is there; True where it was recorded."""
    folder, sheet = out / "logs" / case.key, out / "answers" / f"{case.key}.json"
    if folder.is_dir() and sheet.is_file():
        return False
    session = record_case(case)
    draft = out / "draft" / case.key
    shutil.rmtree(draft, ignore_errors=True)
    draft.mkdir(parents=True)
    for log in session.logs:
        write_log(draft / f"{log.name}.h5", log)
    for place in (folder.parent, sheet.parent):
        place.mkdir(parents=True, exist_ok=True)
    sealed = seal(case, session)
    write_file(sheet, lambda path: _write(path, json.dumps(asdict(sealed), indent=1) + "\n"))
    shutil.rmtree(folder, ignore_errors=True)
    draft.rename(folder)
    return True


def seal(case: SealedCase, session: Session) -> Sealed:
    """Return the answer of a case."""
    verdict = _VERDICTS.get(case.family, "cause" if case.hidden else "no-fault-found")
    findings = answer(session.hidden) if verdict != "no-fault-found" else []
    return Sealed(
        case.key,
        case.family,
        verdict,
        tuple(findings),
        tuple(answer(session.standing)),
        asdict(case),
    )


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def answers_in(out: Path) -> list[Sealed]:
    """Every answer in `out`, by key."""
    found = []
    for sheet in sorted((out / "answers").glob("*.json")):
        values = json.loads(sheet.read_text(encoding="utf-8"))
        found.append(
            Sealed(**values | {name: tuple(values[name]) for name in ("findings", "standing")})
        )
    return found
