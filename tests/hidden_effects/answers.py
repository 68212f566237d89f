"""Answers in the form of `rrrid diagnose --json` by engines that know the truth, or do not care; and sealed cases without logs."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from bench.faults import make
from benchmarks.hidden_effects.cases import SealedCase
from benchmarks.hidden_effects.make import Sealed, answers_in, seal
from benchmarks.hidden_effects.sessions import Session, machine_of_case

Engine = Callable[[Path, tuple[str, ...]], Mapping[str, Any]]
FLOOR = 0.02  # [N m]


def sealed(case: SealedCase) -> Sealed:
    """The answer of a case that nobody records."""
    machine = machine_of_case(case)
    hidden, standing = (tuple(make(one.cause, machine, one.joint, one.seed, one.strength) for one in group)
                        for group in (case.hidden, case.standing))
    return seal(case, Session((), hidden, standing))


def written(out: Path, cases: list[SealedCase]) -> Path:
    """The answers of `cases` in `out`, without any log."""
    (out / "answers").mkdir(parents=True)
    for case in cases:
        (out / "answers" / f"{case.key}.json").write_text(json.dumps(asdict(sealed(case))), encoding="utf-8")
    return out


def finding(cause: str, joint: int | None, parameters: Mapping[str, float] | None = None, std: float = 0.0,
            after: float = FLOOR) -> dict[str, Any]:
    return {"cause": cause, "joint": joint, "explained": 0.9, "identifiability": 0.9, "alternatives": [], "experiment": None,
            "parameters": {name: {"value": value, "std": std, "unit": ""} for name, value in (parameters or {}).items()},
            "gain": {"validate_torque_rms": {"before": [1.0] * 3, "after": [after] * 3, "ci95": [[0.0, 0.0]] * 3},
                     "simulated_position_rms": {"before": [1e-3] * 3, "after": [5e-4] * 3}, "simulation": "closed-loop",
                     "tip_error_rms": {"before": 1e-3, "after": 5e-4}}}


def answer(*findings: dict[str, Any], verdict: str | None = None,
           not_identifiable: Mapping[str, str] | None = None) -> dict[str, Any]:
    return {"verdict": verdict or ("cause" if findings else "no-fault-found"), "findings": list(findings), "baseline_effects": [],
            "rejected": [], "detection_limits": [],
            "not_identifiable": [{"cause": cause, "reason": reason} for cause, reason in (not_identifiable or {}).items()],
            "residual_rms": {"identify": [1.0] * 3, "validate": [1.0] * 3, "noise_floor": [FLOOR] * 3}}


def oracle(out: Path) -> Engine:
    """Who has read the sealed answers of `out`."""
    truth = {one.key: one for one in answers_in(out)}

    def diagnose(folder: Path, without: tuple[str, ...]) -> Mapping[str, Any]:
        one = truth[folder.name]
        if one.verdict in ("unknown", "flagged") or without:
            return answer(verdict="unknown")
        if one.verdict == "not-testable":
            return answer(not_identifiable={cause["cause"]: "absorbed by p3" for cause in one.findings})
        return answer(*(finding(cause["cause"], cause["joint"], cause["parameters"]) for cause in one.findings))

    return diagnose


def always(said: Mapping[str, Any]) -> Engine:
    """Who says the same of any logs."""
    return lambda folder, without: said
