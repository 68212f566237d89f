"""What result.json of a batch holds. Nothing of it hangs on how, where and how fast the items were done."""

from __future__ import annotations

from dataclasses import dataclass

from pipelines.batch.drift import Course, Drift
from pipelines.batch.record import Record, Status
from pipelines.errors import Check

__all__ = ["DoneItem", "DriftFigure", "Problem", "Result", "RobotDrift", "result_of"]


@dataclass(frozen=True)
class Problem:
    """Why an item was rejected or failed."""

    code: str
    where: str
    message: str
    remedy: str


@dataclass(frozen=True)
class DoneItem:
    """One item."""

    name: str  # its path below the root; with the session, where the folder holds several
    status: Status
    error: Problem | None
    verdict: str
    exit: int  # what its own command would have ended in, with --check
    robot: str
    recorded: str | None  # the earliest of its logs
    folder: str | None  # of its own result; None where there is none


@dataclass(frozen=True)
class DriftFigure:
    """One figure through the items, in the order of their recording. `std` and what follows from it are null for a residual."""

    name: str
    unit: str
    items: tuple[str, ...]
    value: tuple[float, ...]
    std: tuple[float, ...] | None
    away: tuple[float, ...]  # [std] of each from the mean of those that have not moved
    chi_square: float | None
    freedom: int | None
    probability: float | None
    trend: float  # [std] from the first to the last
    moved: tuple[str, ...]  # the items beyond three std


@dataclass(frozen=True)
class RobotDrift:
    """Every figure that more than one item of a robot has."""

    robot: str
    figures: tuple[DriftFigure, ...]
    residuals: tuple[DriftFigure, ...]


@dataclass(frozen=True)
class Result:
    """A batch."""

    stage: str
    items: tuple[DoneItem, ...]
    counts: dict[str, int]  # of each status
    drift: tuple[RobotDrift, ...]
    baseline: str | None  # its name
    checks: tuple[Check, ...]


def result_of(stage: str, records: tuple[Record, ...], drifts: tuple[Drift, ...], baseline: str | None,
              checks: tuple[Check, ...]) -> Result:
    """The result of a batch, from what is known when it ends."""
    counts = {status: sum(record.status == status for record in records) for status in ("ok", "found", "rejected", "failed")}
    drift = tuple(RobotDrift(d.robot, tuple(map(_figure, d.figures)), tuple(map(_figure, d.residuals))) for d in drifts)
    return Result(stage, tuple(map(_item, records)), counts, drift, baseline, checks)


def _item(record: Record) -> DoneItem:
    error = None if record.error is None else Problem(**record.error)
    return DoneItem(record.name, record.status, error, record.verdict, record.exit, record.robot, record.recorded or None,
                    f"items/{record.slug}" if record.provenance else None)


def _figure(course: Course) -> DriftFigure:
    std = None if course.std is None else tuple(map(float, course.std))
    return DriftFigure(course.name, course.unit, course.items, tuple(map(float, course.value)), std, tuple(map(float, course.away)),
                       course.chi_square, course.freedom, course.probability, course.trend, course.moved)
