"""What a run leaves: every stage's outcome; everything computed, nothing drawn."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from pipelines.diagnosis.result import Diagnosis
from pipelines.errors import Check
from pipelines.estimation.checks.boundary import Boundary
from pipelines.log.results import FLAT, NOT_STORED
from pipelines.report.report import Report

__all__ = ["Result", "Step"]


@dataclass(frozen=True)
class Step:
    """One stage's outcome: its exit code under --check, and its result."""

    name: str
    exit: int
    result: Any
    report: Report = field(metadata=NOT_STORED, repr=False)
    checks: tuple[Check, ...] = field(metadata=NOT_STORED, repr=False)
    kept: Any = field(default=None, metadata=NOT_STORED, repr=False)  # where result and files of the stage lie


@dataclass(frozen=True)
class Result:
    """The stages of a run, on the logs of one robot and one day."""

    stages: tuple[Step, ...]
    runs: tuple[Any, ...] = ()  # one for each of several sessions; empty, for those are refused
    boundary: Boundary | None = None  # what the logged torque is, also where it keeps the arm from being diagnosed
    diagnosis: Diagnosis | None = field(default=None, metadata=FLAT, repr=False)
