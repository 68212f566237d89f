"""Show what half and twice of the share change that decides "cannot-judge".

    python -m benchmarks.judgeable FOLDER...        folders of logs, each a session
    python -m benchmarks.judgeable FOLDER... --keep facts.jsonl     add to these, and print all

Each session is diagnosed once. The facts are kept; the verdict "no-fault-found" is then decided
with half of, once and twice `JudgeableConfig.largest_share`.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from pipelines import diagnose
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.errors import RrridError
from pipelines.estimation.judgements import (
    Facts,
    JudgeableConfig,
    cannot_judge,
    facts,
    nominal_estimate,
)
from pipelines.estimation.preparation import logs_of_roles, prepare, with_terms_told_apart
from pipelines.stage import Request

_TIMES = (0.5, 1.0, 2.0)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--keep", type=Path, default=Path("facts.jsonl"))
    given = parser.parse_args()
    lines = _lines(given.keep)
    for folder in given.folders:
        name = f"{folder.resolve().parent.name}/{folder.resolve().name}"
        if name in lines:
            continue
        lines[name] = asked(folder)
        with given.keep.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"name": name, **lines[name]}) + "\n")
    _table(lines)


def asked(folder: Path) -> dict[str, Any]:
    """Return verdict, origin of the floor, and facts of one diagnosis; or why it was refused."""
    settings = diagnose.Settings(skip_sanity_checks=True)
    try:
        inputs = diagnose.read(Request((folder,)), settings)
        found = diagnose.compute(inputs, settings, whole=False)
    except RrridError as refused:
        return {"refused": f"{refused.code}: {refused.message}"}
    chosen = logs_of_roles([opened.log for opened in inputs.logs], inputs.label)
    rows = DiagnosisConfig().recipe()
    prepared = with_terms_told_apart(prepare(chosen, rows), settings.blocks)
    known = facts(
        found.residual_rms.validate,
        found.noise_floor_origin == "reference logs",
        prepared,
        nominal_estimate(prepared),
    )
    return {
        "verdict": found.verdict,
        "origin": found.noise_floor_origin,
        "findings": [f"{one.cause}:{one.joint}" for one in found.findings],
        "left": known.left.tolist(),
        "torque": known.torque.tolist(),
        "std": known.std.tolist(),
        "unresolved": known.unresolved,
        "floor_known": known.floor_known.tolist(),
    }


def decided(line: dict[str, Any], times: float) -> str:
    """Return the verdict with so many times the share."""
    if line["verdict"] not in ("no-fault-found", "cannot-judge"):
        return str(line["verdict"])
    left, torque, std = (np.array(line[name]) for name in ("left", "torque", "std"))
    known = Facts(left, torque, std, line["unresolved"], np.array(line["floor_known"]))
    config = JudgeableConfig(times * JudgeableConfig.largest_share)
    return "cannot-judge" if cannot_judge(known, config) else "no-fault-found"


def _lines(kept: Path) -> dict[str, dict[str, Any]]:
    if not kept.exists():
        return {}
    return {line.pop("name"): line for line in map(json.loads, kept.read_text().splitlines())}


def _table(lines: dict[str, dict[str, Any]]) -> None:
    print("| session | floor | largest misfit | largest std | share × 0.5 | × 1 | × 2 |")
    print("|---|---|---|---|---|---|---|")
    for name, line in lines.items():
        if "refused" in line:
            print(f"| {name} | {line['refused']} | | | | | |")
            continue
        torque = np.array(line["torque"])
        misfit, std = (100.0 * np.max(np.array(line[part]) / torque) for part in ("left", "std"))
        said = " | ".join(decided(line, times) for times in _TIMES)
        print(f"| {name} | {line['origin']} | {misfit:.2g} % | {std:.2g} % | {said} |")


if __name__ == "__main__":
    main()
