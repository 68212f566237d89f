"""Define the result of a diagnosis: everything that was computed, nothing drawn.

Names and nesting are those of `rrrid diagnose --json`. Arrays are per joint where nothing else is
said; torque in N m, angles in rad (of prismatic joints N and m).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from pipelines.dynamics.arm import Acting, Arm
from pipelines.errors import Check
from pipelines.estimation.checks.boundary import Boundary
from pipelines.estimation.model_fit import TorqueGain
from pipelines.estimation.motion import Motions
from pipelines.estimation.preparation import FewerTerms
from pipelines.estimation.residual_analysis import Evidence, Proof
from pipelines.io.log import Array, ExperimentLog
from pipelines.io.model_file import ModelFile
from pipelines.io.results import NOT_STORED
from pipelines.simulation.comparison import SimulatedSpan

__all__ = [
    "Alternative",
    "Answer",
    "BeforeAfter",
    "DetectionLimit",
    "Diagnosis",
    "Extended",
    "Extension",
    "Finding",
    "Gain",
    "JudgedBy",
    "NotIdentifiable",
    "Rejected",
    "ResidualRms",
    "Result",
    "Standing",
    "Threshold",
    "TipError",
    "Trial",
    "Value",
    "Verdict",
    "WithoutLimit",
]


Verdict = Literal["cause", "no-fault-found", "unknown", "cannot-judge"]
JudgedBy = Literal["logs", "blocks"]
FloorOrigin = Literal["reference logs", "repeated motion", "blocks"]


@dataclass(frozen=True)
class Value:
    """One number of a finding."""

    value: float | tuple[float, ...]
    std: float | tuple[float, ...] | None  # None: not known
    unit: str


@dataclass(frozen=True)
class Alternative:
    """Another cause that explains nearly as much of the same."""

    cause: str
    joint: int | None
    similarity: float  # cosine of the angle between the torques that the two explain
    probability: float
    parameters: dict[str, Value] = field(default_factory=dict, metadata=NOT_STORED, repr=False)


@dataclass(frozen=True)
class BeforeAfter:
    """A root mean square over the held-out logs, without and with the finding."""

    before: Array
    after: Array


@dataclass(frozen=True)
class TipError:
    """Root mean square distance [m] of simulated and measured tip, without and with the finding."""

    before: float
    after: float


@dataclass(frozen=True)
class Gain:
    """How much better the model is with a finding, on held-out logs."""

    validate_torque_rms: TorqueGain
    simulated_position_rms: BeforeAfter | None  # [rad]; None where nothing could be simulated
    simulation: Literal["closed-loop", "windowed", "none"]
    tip_error_rms: TipError | None
    simulated_span: tuple[SimulatedSpan, ...] = ()  # over which the simulated figures are taken


@dataclass(frozen=True)
class Answer:
    """The response of a joint in one posture: acceleration per input, flat for a rigid body."""

    joint: int  # 1-based, that is moved
    posture: Array  # (joints,) [rad] or [m]
    unit: str  # 1 where an acceleration is the input, else 1/(kg m^2), of a slide 1/kg
    frequency: Array  # (bins,) [Hz]
    measured: Array  # (bins,) magnitude
    coherence: Array
    fitted: Array  # by the modes that were found


@dataclass(frozen=True)
class Finding:
    """An accepted cause."""

    cause: str
    joint: int | None
    title: str
    parameters: dict[str, Value]
    explained: float  # share of the residual above the floor that it explains
    identifiability: float  # part of its columns that the refitted model cannot absorb
    alternatives: tuple[Alternative, ...]
    experiment: str | None  # what to record to tell the alternatives apart
    gain: Gain
    origin: Literal["residual", "base parameters", "frequency responses", "reversals"]
    torque_rms: float  # [N m] of its torque on its own joint, or of the largest joint
    of_rated: float  # the same as a share of the rated torque; NaN where the description gives none
    proof: Proof | None
    answers: tuple[Answer, ...] = ()  # the responses that name it, one a posture
    probability: float | None = None  # None: a user named it
    log: str | None = None  # of an event, the log it happened in


@dataclass(frozen=True)
class Standing:
    """An effect that the reference logs show as well, at the same strength."""

    cause: str
    joint: int | None
    parameters: dict[str, Value]
    explained: float


@dataclass(frozen=True)
class Rejected:
    """A hypothesis that came close and was not accepted."""

    cause: str
    joint: int | None
    reason: str


@dataclass(frozen=True)
class DetectionLimit:
    """The smallest amplitude that would have been found on these logs with 95 %."""

    cause: str
    joint: int | None
    parameter: str  # whose value it is
    minimum: Value
    at: dict[str, Value] = field(default_factory=dict)  # non-linear numbers for which it is: order
    identifiability: float = float("nan")  # part of its columns that the model cannot absorb
    or_less: bool = False  # the smaller the parameter, the larger the cause: of a saturation, say


@dataclass(frozen=True)
class NotIdentifiable:
    """A cause of which these logs cannot tell."""

    cause: str
    joint: int | None
    reason: str  # "absorbed by p3, p5, p9, p13; needs a reference log"
    record: str  # what to record instead


@dataclass(frozen=True)
class WithoutLimit:
    """A cause of the library that has neither a finding nor a detection limit."""

    cause: str
    reason: str


@dataclass(frozen=True)
class ResidualRms:
    """[N m] of the nominal model, before any extension."""

    identify: Array
    validate: Array
    noise_floor: Array


@dataclass(frozen=True)
class Trial:
    """A candidate cause and the gain of it."""

    step: int  # from 1: the search for the first, second … finding
    cause: str
    joint: int | None
    gain: float  # share of the squared weighted residual that it takes away
    threshold: float  # that it had to exceed
    exact_gain: float  # the same after the exact refit; NaN where it was not refitted
    accepted: bool
    reason: str


@dataclass(frozen=True)
class Threshold:
    """The gain that a cause has to exceed, and where that comes from."""

    cause: str
    joint: int | None
    gain: float  # share of the squared weighted residual
    origin: str  # the logs between whose parts nothing has changed


@dataclass(frozen=True)
class Diagnosis:
    """The errors of the simulation, and their causes."""

    verdict: Verdict
    summary: str  # one sentence a technician understands
    findings: tuple[Finding, ...]  # strongest first
    baseline_effects: tuple[Standing, ...]
    rejected: tuple[Rejected, ...]
    detection_limits: tuple[DetectionLimit, ...]
    not_identifiable: tuple[NotIdentifiable, ...]
    residual_rms: ResidualRms
    question: Literal["what is wrong", "what has changed"]
    held_out: JudgedBy
    noise_floor_origin: FloorOrigin  # "blocks": the residual of the final model itself
    reason: str  # of "unknown" and "cannot-judge"; what remains beside causes
    after_rms: ResidualRms  # the same with all findings and baseline effects
    candidate_causes: tuple[Trial, ...]
    thresholds: tuple[Threshold, ...]
    evidence: tuple[Evidence, ...]
    # fitted before any finding, with the baseline effects; and refitted with all findings
    nominal: Arm | None = field(default=None, metadata=NOT_STORED, repr=False)
    extended: Arm | None = field(default=None, metadata=NOT_STORED, repr=False)
    without_limit: tuple[WithoutLimit, ...] = ()  # causes of the library that no other list has
    fewer_terms: tuple[FewerTerms, ...] = ()  # friction laws with more terms than the logs tell
    boundary: Boundary | None = None  # what the logged torque is; None: no log moves enough
    # of the nominal model
    checks: tuple[Check, ...] = field(default=(), metadata=NOT_STORED, repr=False)


@dataclass(frozen=True, eq=False)
class Extended:
    """A model extended by causes, and what it is worth."""

    arm: Arm | None  # with everything refitted; None where no cause was accepted
    findings: tuple[Finding, ...]  # accepted
    rejected: tuple[Rejected, ...]
    gain: Gain | None  # of all accepted together
    before: ResidualRms
    after: ResidualRms
    held_out: JudgedBy
    standing: tuple[Acting, ...]  # baseline effects
    motions: Motions  # fitted, then judging
    fitted: int  # of them
    fewer: tuple[FewerTerms, ...] = ()


@dataclass(frozen=True)
class Result(Diagnosis):
    """A diagnosis with the names of its robot and the checks of its logs."""

    robot: str = ""
    joints: tuple[str, ...] = ()  # names
    rated: tuple[float, ...] = ()  # [N m] rated torque of each; infinite where it is not known
    without: tuple[str, ...] = ()  # causes that were left out
    data_quality: tuple[Check, ...] = ()
    laws_of: str = ""  # model file whose friction laws were taken; empty: Coulomb and viscous
    # by all causes that were named
    extension: Extended | None = field(default=None, metadata=NOT_STORED, repr=False, compare=False)


@dataclass(frozen=True)
class Extension:
    """A model extended, or why it was not."""

    accepted: bool  # every cause that was named
    causes: tuple[str, ...]  # as they were named
    findings: tuple[Finding, ...]  # accepted
    rejected: tuple[Rejected, ...]
    gain: Gain | None  # of all accepted together
    residual_rms: ResidualRms  # before
    after_rms: ResidualRms
    held_out: JudgedBy
    baseline_effects: tuple[str, ...]  # of the reference logs; the model has them
    robot: str
    joints: tuple[str, ...]
    rated: tuple[float, ...]  # [N m]
    data_quality: tuple[Check, ...]
    model: ModelFile | None  # None where nothing was accepted
    laws_of: str = ""  # model file whose friction laws were taken; empty: Coulomb and viscous
    fewer_terms: tuple[FewerTerms, ...] = ()  # friction laws with more terms than the logs tell
    revolute: tuple[bool, ...] = ()  # which joints turn; the others slide
    derived: tuple[tuple[str, ExperimentLog], ...] = field(
        default=(), metadata=NOT_STORED, repr=False
    )
