"""Thresholds as they are stored: what they are, where they come from, and which logs they are good for."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, Literal

from pipelines.log.experiment import Array
from pipelines.log.model_file import Source
from pipelines.model.diagnosis.floor.wide import Wide
from pipelines.model.diagnosis.rows.imperfections import DriveNoise

__all__ = ["FORMAT", "FORMAT_VERSION", "Calibration", "CauseBound", "Conditions", "Floors", "Origin"]

FORMAT: Final = "rrrid-calibration"
FORMAT_VERSION: Final = 1


@dataclass(frozen=True)
class Origin:
    """Where thresholds come from."""

    kind: Literal["twin", "reference logs"]
    logs: tuple[Source, ...]  # whose experiments the twin repeated; the reference logs
    model: str  # SHA-256 of the model that the twin is of; empty without one
    replicas: int  # of the twin
    seed: int
    without: tuple[str, ...]  # causes that were left out
    version: str  # of rrrid
    numpy: str  # version


@dataclass(frozen=True, eq=False)
class Conditions:
    """What logs have to have in common with those of the calibration. Arrays (joints,)."""

    robot: str  # SHA-256 of the description
    controllers: tuple[str, ...]  # SHA-256 of each
    experiments: tuple[str, ...]  # kinds
    laws: tuple[str, ...]  # of friction, of the nominal model
    sample_time: float  # [s]
    row_time: float  # [s] between equations
    cutoff_hz: float | None
    rows: Array  # equations
    speed: Array  # [rad/s] root mean square
    acceleration: Array  # [rad/s^2]
    span: Array  # [rad] between the ends of the motion


@dataclass(frozen=True, eq=False)
class Floors:
    """Spectra of what an arm in order leaves at one joint."""

    frequency: Array | None  # (bins,) [N m], of the longest log
    orders: Array  # (orders,) [N m]


@dataclass(frozen=True)
class CauseBound:
    """Of one cause at one place: gains of the squared residual, weighted as the calibration says."""

    cause: str
    joint: int | None
    gain: float  # to exceed; of reference logs it is worked out with the logs that are judged
    own: float  # the most that an arm in order gives


@dataclass(frozen=True, eq=False)
class Calibration:
    """Thresholds of healthy runs."""

    origin: Origin
    conditions: Conditions
    weight: Array  # (joints,) [1/(N m)] of the residuals
    floor: Array  # (joints,) [N m] what is left of an arm in order
    noise: Array  # (joints,) [N m] of the drives; NaN without a twin
    causes: tuple[CauseBound, ...]
    wide: Wide | None  # of causes that act on several joints
    floors: tuple[Floors, ...]  # spectra
    following: Array | None = None  # (joints,) the most that any replica's residual follows the joint's own motion; None: not known
    wander: Array | None = None  # (joints,) [N m] of the drives' zeros; None: half of the noise, as it was taken for then
    format: Literal["rrrid-calibration"] = field(default=FORMAT, kw_only=True)
    format_version: Literal[1] = field(default=FORMAT_VERSION, kw_only=True)

    @property
    def drives(self) -> DriveNoise:
        return DriveNoise(self.noise, 0.5 * self.noise if self.wander is None else self.wander)
