"""Settings of the rows of a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["BLOCKS", "DiagnosisSettings"]

BLOCKS = 10  # of time, held out in turn where no log is of role "validate"


@dataclass(frozen=True)
class DiagnosisSettings:
    """Which rows of the logs are used."""

    cutoff_hz: float | None = None  # low-pass over the equations; None: from the motion
    decimation: int | None = None
    min_speed: tuple[float, ...] = (0.0,)  # [rad/s] slower samples of a joint are left out of its equations
