"""What can be chosen of a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["DiagnosisSettings"]


@dataclass(frozen=True)
class DiagnosisSettings:
    """Numbers of a diagnosis; the defaults were calibrated on the virtual test bench."""

    replicas: int = 10  # of the twin; 0: no twin
    most: int = 4  # findings
    blocks: int = 10  # of the cross-validation
    without: tuple[str, ...] = ()  # causes that are left out
    cutoff_hz: float | None = None  # low-pass over the equations; None: from the motion
    decimation: int | None = None
    min_speed: tuple[float, ...] = (0.0,)  # [rad/s] slower samples of a joint are left out of its equations
    seed: int = 1
    evidence: bool = True  # series for figures
    limits: bool = True  # detection limits
