"""What the stage `diagnose` leaves: the diagnosis, and what its report says besides."""

from __future__ import annotations

from dataclasses import dataclass

from pipelines.errors import Check
from pipelines.model.diagnosis.result import Diagnosis

__all__ = ["Result"]


@dataclass(frozen=True)
class Result(Diagnosis):
    """A diagnosis with the names of its robot and what the doctor remarked."""

    robot: str = ""
    joints: tuple[str, ...] = ()  # names
    rated: tuple[float, ...] = ()  # [N m] rated torque of each; infinite where nobody knows it
    without: tuple[str, ...] = ()  # causes that were left out
    doctor: tuple[Check, ...] = ()
