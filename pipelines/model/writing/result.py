"""The result of the writing task: both validations and the simulation, or the task itself where it was designed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pipelines.errors import Check
from pipelines.importers.units import ControllerTable
from pipelines.io.log import Array, ExperimentLog
from pipelines.io.results import NOT_STORED
from pipelines.model.simulation.imitate import Imitation
from pipelines.model.writing.cases import Case
from pipelines.model.writing.design import Designed
from pipelines.model.writing.first_validation import FirstValidation

__all__ = ["Gates", "Result", "SimulationError", "TorqueError", "pooled"]


@dataclass(frozen=True)
class TorqueError:
    """Measured against model, over all logs that count; per joint."""

    rms: Array  # [N m]
    signal_rms: Array  # [N m] measured
    relative_error: Array  # rms over signal_rms
    of: str  # "writing" | "validate": which logs count


@dataclass(frozen=True)
class SimulationError:
    """The same task simulated with the model: simulated minus measured, per joint."""

    log: str
    simulation: str  # "closed-loop" | "windowed"
    position_rms: Array | None  # [rad]
    speed_rms: Array | None  # [rad/s]
    torque_rms: Array | None  # [N m]


@dataclass(frozen=True)
class Gates:
    """Passed or not; null where it could not be judged."""

    torque_limit: float  # relative error
    torque: bool | None  # 1: every joint's relative torque error is below the limit
    cases: bool | None  # 2: case 6 is below case 1 in x, y and z


@dataclass(frozen=True)
class Result:
    """Everything computed. `design` stands alone: a task that was designed has not been validated."""

    robot: str
    joints: tuple[str, ...]
    model: str  # in words, where it comes from
    torque: TorqueError | None
    gates: Gates
    logs: tuple[FirstValidation, ...]
    cases: tuple[Case, ...]
    cases_left_out: str  # why some or all of them are missing, in words
    cases_apart: tuple[str, ...]  # writing logs that do not compare: another controller, other gains or another reference
    drawn: str  # what the controllers' models of simulated cases were drawn from, in words; empty: nothing
    draws: int
    simulation: SimulationError | None
    simulation_left_out: str
    imitation: Imitation | None
    design: Designed | None
    data_quality: tuple[Check, ...] = field(default=(), metadata=NOT_STORED, repr=False)
    derived: tuple[tuple[str, ExperimentLog], ...] = field(default=(), metadata=NOT_STORED, repr=False)
    table: ControllerTable | None = field(default=None, metadata=NOT_STORED, repr=False)
    online_seconds: tuple[float, ...] = field(default=(), metadata=NOT_STORED, repr=False)  # [s] a sample, of each log


def pooled(logs: Sequence[FirstValidation]) -> TorqueError | None:
    """Over the writing logs; without any over those that move, for at rest friction is undetermined; None of no log."""
    writing = [log for log in logs if log.experiment == "writing"]
    some = writing or [log for log in logs if log.experiment != "hold"] or list(logs)
    if not some:
        return None
    counts = np.array([log.samples for log in some], dtype=float)[:, None]
    left, whole = (np.sqrt((counts * np.array(x)**2).sum(axis=0) / counts.sum())
                   for x in ([log.rms for log in some], [log.signal_rms for log in some]))
    relative = np.divide(left, whole, out=np.full_like(left, np.inf), where=whole > 0.0)
    return TorqueError(left, whole, relative, "writing" if writing else "validate")
