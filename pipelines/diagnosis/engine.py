"""The whole way: dataset → prior → candidates → baseline → selection → decision."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pipelines.diagnosis.candidates import Dictionary
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.dataset import load
from pipelines.diagnosis.decision import Decision, decide
from pipelines.diagnosis.events import event_threshold
from pipelines.diagnosis.prior import prior_of
from pipelines.diagnosis.refit import Later
from pipelines.diagnosis.screening import Baseline, baseline
from pipelines.diagnosis.selection import Selection, select
from pipelines.diagnosis.variance import settle
from pipelines.log.experiment import ExperimentLog
from pipelines.model.arm import Acting
from pipelines.model.diagnosis.asked.inputs import Logs, Prepared, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.given.compliance import Compliance, compared, compliance

__all__ = ["Diagnosis", "diagnose", "diagnose_prepared", "pose"]


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Everything that was computed."""

    decision: Decision
    selection: Selection
    baseline: Baseline
    later: Later
    responses: Compliance | None  # None: there are no frequency responses
    config: DiagnosisConfig


def diagnose(
    logs: Sequence[ExperimentLog],
    config: DiagnosisConfig | None = None,
    exclude: Sequence[str] = (),
) -> Diagnosis:
    """Return what has changed since the reference logs, or without them what is wrong.

    Args:
        exclude: causes that are not considered.

    Raises:
        InputRejected: as `prepare`, logs that give no rows.
    """
    config = config or DiagnosisConfig()
    prepared = prepare(Logs.by_role(logs), DiagnosisSettings(cutoff_hz=config.cutoff_hz))
    return diagnose_prepared(prepared, config, exclude)


def pose(prepared: Prepared, config: DiagnosisConfig, exclude: Sequence[str] = ()) -> Later:
    """Return the rows of later logs beside their prior, with all candidates."""
    rough = load(prepared, prepared.logs.frf)
    dataset, dictionary = settle(rough, Dictionary.of(rough, config, exclude), config)
    return Later.of(dataset, dictionary, prior_of(dataset, dictionary, config), config)


def diagnose_prepared(
    prepared: Prepared, config: DiagnosisConfig, exclude: Sequence[str] = ()
) -> Diagnosis:
    """Return the same of rows that were prepared."""
    later = pose(prepared, config, exclude)
    dataset, parts = later.dataset, (later.dataset, later.dictionary, later.prior)
    known = baseline(*parts, event_threshold(*parts, config), config)
    responses = compliance(dataset.frf, dataset.model.nominal, exclude)
    found = select(later, known, _new(responses, later, prepared, exclude), config)
    decision = decide(later, found, known, config)
    return Diagnosis(decision, found, known, later, responses, config)


def _new(
    now: Compliance | None, later: Later, prepared: Prepared, exclude: Sequence[str]
) -> tuple[Acting, ...]:
    """Return what frequency responses name, and those of the reference did not."""
    if now is None:
        return ()
    before = compliance(prepared.logs.frf_before, later.dataset.model.nominal, exclude)
    return now.named if before is None else compared(now, before).new
