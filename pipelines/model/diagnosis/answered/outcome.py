"""What the stages `diagnose` and `extend` leave: what was found, and what their reports say besides."""

from __future__ import annotations

from dataclasses import dataclass, field

from pipelines.errors import Check
from pipelines.log.experiment import ExperimentLog
from pipelines.log.model_file import ModelFile
from pipelines.log.results import NOT_STORED
from pipelines.model.diagnosis.asked.unasked import FewerTerms
from pipelines.model.diagnosis.result import Diagnosis, Finding, Gain, JudgedBy, Rejected, ResidualRms
from pipelines.model.diagnosis.worth.extended import Extended

__all__ = ["Extension", "Result"]


@dataclass(frozen=True)
class Result(Diagnosis):
    """A diagnosis with the names of its robot and what the doctor remarked."""

    robot: str = ""
    joints: tuple[str, ...] = ()  # names
    rated: tuple[float, ...] = ()  # [N m] rated torque of each; infinite where nobody knows it
    without: tuple[str, ...] = ()  # causes that were left out
    data_quality: tuple[Check, ...] = ()
    laws_of: str = ""  # model file whose friction laws were taken; empty: Coulomb and viscous
    extension: Extended | None = field(default=None, metadata=NOT_STORED, repr=False, compare=False)  # by all that was named


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
    baseline_effects: tuple[str, ...]  # effects that the reference logs show as well; the model has them
    robot: str
    joints: tuple[str, ...]
    rated: tuple[float, ...]  # [N m]
    data_quality: tuple[Check, ...]
    model: ModelFile | None  # None where nothing was accepted
    laws_of: str = ""  # model file whose friction laws were taken; empty: Coulomb and viscous
    fewer_terms: tuple[FewerTerms, ...] = ()  # friction laws that were asked for, and have more terms than these logs tell apart
    revolute: tuple[bool, ...] = ()  # which joints turn; the others slide
    derived: tuple[tuple[str, ExperimentLog], ...] = field(default=(), metadata=NOT_STORED, repr=False)
