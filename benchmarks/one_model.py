"""Let the one Gaussian model judge: the cases of `hidden_effects`, or folders with answers.

    python -m benchmarks.hidden_effects judge --out CASES --verdicts CASES/new.jsonl \\
        --engine benchmarks.one_model:answer
    python -m benchmarks.one_model ../shared/plant-b
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pipelines.diagnosis.engine import Diagnosis, diagnose
from pipelines.io.files import read_unguarded

__all__ = ["answer", "diagnosed"]


def diagnosed(folder: Path, exclude: Sequence[str] = ()) -> Diagnosis:
    """Return the diagnosis of the HDF5 logs of a folder."""
    return diagnose([read_unguarded(path) for path in sorted(folder.glob("*.h5"))], exclude=exclude)


def answer(folder: Path, exclude: tuple[str, ...]) -> dict[str, Any]:
    """Return the fields of `rrrid diagnose --json` that the judge of `hidden_effects` reads."""
    found = diagnosed(folder, exclude)
    verdict = (
        found.decision.verdict
    )
    nothing: dict[str, Any] = {
        "validate_torque_rms": {"after": []},
        "simulation": "none",
        "simulated_position_rms": None,
    }
    effects = found.look.selection.end.model.effects
    findings = [
        {
            "cause": cause.key[0],
            "joint": cause.key[1],
            "gain": nothing,
            "alternatives": [{"cause": name, "joint": joint} for name, joint in cause.alternatives],
            "parameters": {
                name: {"value": value, "std": None} for name, value in one.values.items()
            },
        }
        for cause, one in zip(found.decision.causes, effects, strict=False)
    ]
    return {
        "verdict": verdict,
        "reason": found.decision.reason,
        "findings": findings,
        "baseline_effects": [],
        "not_identifiable": [],
        "residual_rms": {"noise_floor": []},
    }


def main(root: Path) -> None:
    """Print the verdict on every folder that `answers.json` knows, beside the truth."""
    for name, known in json.loads((root / "answers.json").read_text(encoding="utf-8")).items():
        begun = time.process_time()
        found = diagnosed(root / name)
        truth = [f"{one['cause']}:{one['joint']}" for one in known["truth"]] or [known["kind"]]
        causes = [(cause.key, cause.alternatives) for cause in found.decision.causes]
        print(
            f"{name} {'+'.join(truth):24} {found.decision.verdict:14} {causes} "
            f"{found.decision.reason} "
            f"{time.process_time() - begun:.0f} s",
            flush=True,
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
