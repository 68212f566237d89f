"""Ask the engine of a diagnosis, or of an extension, about logs that a test has made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pipelines.diagnosis.answer import answer
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.engine import Diagnosis, diagnose, diagnose_prepared
from pipelines.diagnosis.extension import extend
from pipelines.diagnosis.result import Diagnosis as Answer
from pipelines.diagnosis.result import Extended
from pipelines.dynamics.arm import Acting, Arm
from pipelines.estimation.candidate_columns import Wanted
from pipelines.estimation.preparation import BLOCKS, Logs, Prepared, prepare, with_terms_told_apart
from pipelines.io.log import ExperimentLog

__all__ = ["answered", "before", "causes", "diagnosed", "effects", "extended", "prepared_for"]

_USUAL = DiagnosisConfig()


def diagnosed(
    *logs: ExperimentLog, exclude: Sequence[str] = (), cutoff_hz: float | None = None
) -> Diagnosis:
    """Return what the engine says of logs in their roles."""
    return diagnose(logs, replace(_USUAL, cutoff_hz=cutoff_hz), exclude)


def answered(
    logs: Logs,
    arm: Arm | None = None,
    exclude: Sequence[str] = (),
    whole: bool = False,
) -> Answer:
    """Return the result of a diagnosis, with gains and deviations.

    Args:
        whole: with figures, simulated arms and detection limits.
    """
    prepared = prepared_for(logs, arm)
    found = diagnose_prepared(prepared, _USUAL, exclude)
    return answer(prepared, found, lambda words: None, BLOCKS, whole, exclude)[0]


def causes(found: Diagnosis) -> list[tuple[str, int | None]]:
    """Return the causes that are named, with their joints."""
    return [one.key for one in found.decision.causes]


def effects(found: Diagnosis) -> tuple[Acting, ...]:
    """Return the effects of the model that was found."""
    return found.look.selection.end.model.effects


def prepared_for(
    logs: Logs, arm: Arm | None = None, cutoff_hz: float | None = None
) -> Prepared:
    """Return the rows of logs, with friction laws of as many terms as the logs tell apart."""
    return with_terms_told_apart(prepare(logs, replace(_USUAL, cutoff_hz=cutoff_hz).recipe(), arm), BLOCKS)


def extended(
    logs: Logs, *wanted: Wanted, arm: Arm | None = None, cutoff_hz: float | None = None
) -> Extended:
    """Return the model extended by the wanted causes."""
    config = replace(_USUAL, cutoff_hz=cutoff_hz)
    return extend(prepared_for(logs, arm, cutoff_hz), wanted, config, BLOCKS)


def before(*logs: ExperimentLog) -> tuple[ExperimentLog, ...]:
    """Return logs as reference logs."""
    return tuple(replace(log, name=f"{log.name}-before", role="reference") for log in logs)
