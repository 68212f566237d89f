"""The logs of a diagnosis, and what is made of them before anything is suspected.

    prepared = prepare(logs, settings, arm)
    prepared.data, prepared.judge, prepared.columns
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pipelines.errors import InputRejected
from pipelines.log.experiment import ExperimentLog
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.data import Data, gather
from pipelines.model.diagnosis.settings import DiagnosisSettings
from pipelines.model.estimation.logs import Motions, Recipe, motions_of, with_cutoff
from pipelines.model.estimation.nominal import nominal_columns
from pipelines.model.estimation.regression import Columns
from pipelines.model.motion import Reconstruction

__all__ = ["Logs", "Prepared", "prepare"]

_MOVING = ("excitation", "free", "writing")  # experiments in which all joints move: a joint that is held sticks, and no law tells


@dataclass(frozen=True)
class Logs:
    """Logs of one robot, by what they are for."""

    identify: tuple[ExperimentLog, ...]
    validate: tuple[ExperimentLog, ...] = ()
    reference: tuple[ExperimentLog, ...] = ()
    frf: tuple[ExperimentLog, ...] = ()
    frf_before: tuple[ExperimentLog, ...] = ()  # of role "reference"

    @classmethod
    def by_role(cls, logs: Sequence[ExperimentLog]) -> Logs:
        """Chosen by what they say of themselves."""
        moving = [log for log in logs if log.experiment in _MOVING and log.origin != "planned"]
        parts = {role: tuple(log for log in moving if log.role == role) for role in ("identify", "validate", "reference")}
        return cls(parts["identify"], parts["validate"], parts["reference"],
                   *(tuple(log for log in logs if log.experiment == "frf" and (log.role == "reference") is before)
                     for before in (False, True)))


@dataclass(frozen=True, eq=False)
class Prepared:
    """Rows of every kind of logs."""

    logs: Logs
    columns: Columns  # of the nominal model, its friction laws in their first shape
    recipe: Recipe
    motions: Motions  # of the logs that are fitted
    judging: Motions
    referring: Motions
    data: Data
    judge: Data | None  # None: blocks of the fitted ones judge
    reference: Data | None


def prepare(logs: Logs, settings: DiagnosisSettings, arm: Arm | None = None) -> Prepared:
    """Reconstruct every log, and lay its rows; the cut-off is that of the fitted logs.

    Args:
        arm: whose friction laws the nominal model takes; Coulomb and viscous friction where left out.

    Raises:
        InputRejected: S01, no log to fit; T04, a log without a stretch that can be used.
    """
    if not logs.identify:
        raise InputRejected("S01", "no log of role 'identify' in which the arm moves", remedy="record an excitation")
    columns = _columns(logs, arm)
    how = Reconstruction()
    fitted, judging, referring = (motions_of(part, how) for part in (logs.identify, logs.validate, logs.reference))
    recipe = with_cutoff(Recipe(how, settings.cutoff_hz, settings.decimation, settings.min_speed), (*fitted, *referring))
    count = len(fitted)
    return Prepared(logs, columns, recipe, fitted, judging, referring, gather(fitted, columns, recipe),
                    gather(judging, columns, recipe, first=count) if judging else None,
                    gather(referring, columns, recipe, first=count + len(judging)) if referring else None)


def _columns(logs: Logs, arm: Arm | None) -> Columns:
    columns = nominal_columns(logs.identify[0].robot, offset=False)
    if arm is None or not arm.friction:
        return columns
    others = tuple(law for law in columns.laws if not law.friction)
    return replace(columns, laws=(*(law.effect for law in arm.friction), *others))
