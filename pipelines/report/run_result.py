"""What a run leaves: every stage's outcome, for every group of logs; everything computed, nothing drawn."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from pipelines.errors import Check
from pipelines.estimation.checks.boundary import Boundary
from pipelines.log.results import FLAT, NOT_STORED
from pipelines.model.diagnosis.result import Diagnosis
from pipelines.report.report import Report

__all__ = ["Group", "Result", "Step"]


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
class Group:
    """The logs of one robot, recorded on one day, and what the stages made of them."""

    name: str
    stages: tuple[Step, ...]
    boundary: Boundary | None = None  # what the logged torque is, also where it keeps the arm from being diagnosed
    diagnosis: Diagnosis | None = field(default=None, metadata=FLAT, repr=False)


@dataclass(frozen=True)
class Result:
    """One group's stages; with several groups, `runs` holds each of them and `stages` is empty."""

    stages: tuple[Step, ...]
    runs: tuple[Group, ...] = ()
    boundary: Boundary | None = None  # of one group's logs: what their torque is, also where it keeps the arm from being diagnosed
    diagnosis: Diagnosis | None = field(default=None, metadata=FLAT, repr=False)

    @property
    def groups(self) -> tuple[Group, ...]:
        return self.runs or (Group("", self.stages, self.boundary, self.diagnosis),)
