"""The result of a diagnosis: everything found, nothing drawn.

Names and nesting are those of `rrrid diagnose --json`. Arrays are per joint where nothing else is said; torque in N m, angles
in rad (of prismatic joints N and m).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from pipelines.errors import Check
from pipelines.estimation.checks.boundary import Boundary
from pipelines.log.experiment import Array
from pipelines.log.results import NOT_STORED
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.asked.unasked import FewerTerms, WithoutLimit

__all__ = [
    "RIVALS",
    "Alternative",
    "Answer",
    "BeforeAfter",
    "Curve",
    "DetectionLimit",
    "Diagnosis",
    "Evidence",
    "Finding",
    "Gain",
    "JudgedBy",
    "NotIdentifiable",
    "Proof",
    "Rejected",
    "ResidualRms",
    "SimulatedSpan",
    "Spectrum",
    "Standing",
    "Threshold",
    "TipError",
    "TorqueGain",
    "Trial",
    "Value",
    "Verdict",
]

RIVALS = 0.8  # similarity from which two causes explain the same
Verdict = Literal["cause", "no-fault-found", "unknown", "cannot-judge"]
JudgedBy = Literal["logs", "blocks"]


@dataclass(frozen=True)
class Value:
    """One number of a finding."""

    value: float | tuple[float, ...]
    std: float | tuple[float, ...] | None  # None: nobody knows
    unit: str


@dataclass(frozen=True)
class Alternative:
    """Another cause that explains nearly as much of the same."""

    cause: str
    joint: int | None
    similarity: float  # cosine of the angle between what the two explain, after the model was refitted beside each
    probability: float


@dataclass(frozen=True)
class TorqueGain:
    """Root mean square of the torque residual on held-out equations."""

    before: Array  # [N m]
    after: Array
    ci95: Array  # (joints, 2) [N m] in which `after` - `before` lies with 95 %: blocks of time drawn again


@dataclass(frozen=True)
class BeforeAfter:
    """A root mean square over the held-out logs, without and with the finding."""

    before: Array
    after: Array


@dataclass(frozen=True)
class TipError:
    """How far the simulated tip is from the measured one [m], root mean square, without and with the finding."""

    before: float
    after: float


@dataclass(frozen=True)
class SimulatedSpan:
    """How much of a log was simulated: in closed loop from where it begins on, else in windows all over it."""

    log: str  # its name
    seconds: float  # [s] over which the simulated arm was compared with the measured one


@dataclass(frozen=True)
class Gain:
    """How much better the model is with a finding than with those before it, on what was held out."""

    validate_torque_rms: TorqueGain
    simulated_position_rms: BeforeAfter | None  # [rad]; None where nothing could be simulated
    simulation: Literal["closed-loop", "windowed", "none"]
    tip_error_rms: TipError | None
    simulated_span: tuple[SimulatedSpan, ...] = ()  # what the simulated figures are taken over; empty where there are none


@dataclass(frozen=True)
class Proof:
    """The figure that proves a finding: the residual before and after, beside what the cause predicts.

    Of the joint that shows most of it, over the signal that the cause depends on, in bins of equal count, or, where it depends on
    none, the amplitudes of all three over frequency; and a stretch of time.
    """

    joint: int  # 1-based, whose residual is shown
    against: str  # "time" | "position" | "speed" | "load" | "travel since reversal" | "speed of joint 2" | "frequency" …
    unit: str
    x: Array  # (bins,) middle of each
    before: Array  # (bins,) [N m] mean residual without the finding
    after: Array  # with it
    predicted: Array  # what the finding predicts of `before`
    spread: Array  # (bins,) [N m] standard error of `before`; none over frequency
    t: Array  # (samples,) [s] a stretch of time where it shows most
    before_in_time: Array
    after_in_time: Array
    predicted_in_time: Array


@dataclass(frozen=True)
class Answer:
    """How a joint answers in one posture: acceleration per input over frequency, which a rigid body has flat."""

    joint: int  # 1-based, that is moved
    posture: Array  # (joints,) [rad] or [m]
    unit: str  # of acceleration per input: 1 where an acceleration is asked for, else 1/(kg m^2), of a slide 1/kg
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
    doubt: str = ""  # of what frequency responses name: why the extended model goes without it; empty where it has it
    answers: tuple[Answer, ...] = ()  # the responses that name it, one a posture; empty where others do, or none is drawn
    probability: float | None = None  # over its alternatives and shapes without a name; None: a user named it
    log: str | None = None  # of what happened once, the log it happened in; None: it lasts, or comes in every log


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
    at: dict[str, Value] = field(default_factory=dict)  # non-linear numbers for which it is: order, speed
    way: Literal["injected", "analytic"] = "analytic"  # hidden in these logs and found, or worked out
    identifiability: float = float("nan")  # part of its columns that the refitted model cannot absorb
    or_less: bool = False  # of less of the parameter there is more of the cause: of a limit, the largest that would have been found


@dataclass(frozen=True)
class NotIdentifiable:
    """A cause of which these logs cannot tell."""

    cause: str
    joint: int | None
    reason: str  # "absorbed by p3, p5, p9, p13; needs a reference log"
    record: str  # what to record instead


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
    gain: float  # share of the squared weighted residual that it takes away, fitted; of base parameters that have moved, of
    # what one set of them for before and after leaves more
    threshold: float  # that it had to exceed
    identifiability: float
    exact_gain: float  # the same after the exact refit; NaN where it was not refitted
    accepted: bool
    reason: str


@dataclass(frozen=True)
class Threshold:
    """What a cause has to exceed before it is believed, and where that comes from."""

    cause: str
    joint: int | None
    gain: float  # share of the squared weighted residual
    origin: str  # the logs between whose parts nothing has changed


@dataclass(frozen=True)
class Curve:
    """The residual against one signal of its joint, in bins of equal count."""

    joint: int
    against: str
    unit: str
    x: Array  # (bins,)
    mean: Array  # [N m]
    spread: Array  # [N m] standard deviation within the bin
    explained: float  # share of the residual's power that the means hold


@dataclass(frozen=True)
class Spectrum:
    """Of one joint's residual: over time's frequency or over the orders of its angle."""

    joint: int
    over: Literal["frequency", "order"]
    unit: str  # "Hz" | "1/rev"
    x: Array  # (bins,)
    amplitude: Array  # [N m] of each line or bin


@dataclass(frozen=True)
class Evidence:
    """Residual analysis of one log."""

    log: str  # name of the log that is shown
    t: Array  # [s] (points,)
    measured: Array  # [N m] (points, joints) after the low-pass
    predicted: Array
    residual: Array
    simulated_t: Array | None  # [s] (points,)
    simulated_position_error: Array | None  # [rad] (points, joints) simulated minus measured
    curves: tuple[Curve, ...]
    spectra: tuple[Spectrum, ...]
    above_noise_floor: Array  # (joints,) share of the residual's power that is above the floor
    band: Array  # (joints, 2) [Hz] in which most of that lies
    correlation: Array  # (joints, joints) of the residual of one joint with the torque of another
    torques: Array  # (joints, joints) each measured torque on every joint's modelled torque: near the identity
    simulated_log: str = ""  # name of the log that was simulated in closed loop
    extended_position_error: Array | None = None  # [rad] (points, joints) of the extended model


@dataclass(frozen=True)
class Diagnosis:
    """What the simulation gets wrong, and why."""

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
    noise_floor_origin: str  # "reference logs" | "blocks"
    reason: str  # why "unknown" or "cannot-judge"; what "no-fault-found" cannot exclude; what remains beside causes; else empty
    after_rms: ResidualRms  # the same with all findings and standing effects
    candidate_causes: tuple[Trial, ...]
    thresholds: tuple[Threshold, ...]
    evidence: tuple[Evidence, ...]
    nominal: Arm | None = field(default=None, metadata=NOT_STORED, repr=False)  # fitted before any finding, with what stands
    extended: Arm | None = field(default=None, metadata=NOT_STORED, repr=False)  # refitted with findings and standing effects
    without_limit: tuple[WithoutLimit, ...] = ()  # causes of the library that no other list has
    fewer_terms: tuple[FewerTerms, ...] = ()  # friction laws that were asked for, and have more terms than these logs tell apart
    boundary: Boundary | None = None  # what the logged torque is; null where no log moves the arm enough to tell
    checks: tuple[Check, ...] = field(default=(), metadata=NOT_STORED, repr=False)  # of the nominal model
