"""The result of an estimate: everything computed, nothing drawn."""

from __future__ import annotations

from dataclasses import dataclass, field

from pipelines.dynamics.arm import Arm
from pipelines.errors import Check
from pipelines.estimation.checks.boundary import Boundary
from pipelines.io.log import Array, ExperimentLog
from pipelines.io.model_file import ModelFile
from pipelines.io.results import NOT_STORED
from pipelines.model.estimation.balance import Balance
from pipelines.model.estimation.checks import Consistent
from pipelines.model.estimation.compare import Compared
from pipelines.model.estimation.floor import Beside
from pipelines.model.estimation.outcome import Course, Direction, Estimated

__all__ = ["Result"]


@dataclass(frozen=True)
class Result:
    """Everything estimated. What these logs do not determine has no value."""

    robot: str
    joints: tuple[str, ...]
    torque_units: tuple[str, ...]  # per joint: "N m", or "N" of a prismatic one
    parameters: tuple[Estimated, ...]
    condition_number: float  # of Φ in Kostić et al. 2004, eq. (13): rigid columns, unweighted, SI
    condition_number_fit: float  # of the weighted columns at unit length
    rank: int
    relative_error: dict[str, float]  # identify, validate
    torque_rms: dict[str, tuple[float, ...]]  # [torque_units] of the residual, per joint
    torque_signal_rms: dict[str, tuple[float, ...]]  # [torque_units]
    held_out: str  # "logs" | "blocks"
    filter_hz: float | None  # low-pass over torque and columns
    equations: tuple[int, ...]  # of each joint, too slow samples left out
    friction: str  # "fitted" | "given"
    physically_consistent: bool | None  # None: not all parameters are determined
    consistency: Consistent | None
    balance: Balance | None
    unresolved: str  # words; empty where everything shows
    hard_to_see: tuple[Direction, ...]
    not_separated: tuple[tuple[str, ...], ...] = field(default=(), kw_only=True)  # parameters determined only together
    comparison: tuple[Compared, ...]
    rigid_body_alone: tuple[float, ...] | None = field(default=None, kw_only=True)  # [torque_units] held-out rms, no friction
    boundary: Boundary | None = field(default=None, kw_only=True)  # what the logged torque is; null: no log tells
    friction_of: str = field(default="", kw_only=True)  # given: the model file, or "fit-friction" of the same run
    noise_floor: tuple[Beside, ...] = field(default=(), kw_only=True)  # of logs that hold two periods or more
    convergence_samples: tuple[int, ...]
    convergence: Array  # (counts, parameters)
    convergence_std: Array
    courses: tuple[Course, ...]
    data_quality: tuple[Check, ...] = field(default=(), metadata=NOT_STORED, repr=False, kw_only=True)  # of the logs, but "ok"
    arm: Arm = field(metadata=NOT_STORED, repr=False)  # the model with the covariance of its numbers
    model: ModelFile = field(metadata=NOT_STORED, repr=False)
    derived: tuple[tuple[str, ExperimentLog], ...] = field(metadata=NOT_STORED, repr=False)
