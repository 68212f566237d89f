"""Which numbers whoever makes equations of logs may be asked for: `estimate-bps`, `diagnose` and `extend` take the same ones."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from pipelines.errors import UsageError
from pipelines.io.log import ExperimentLog
from pipelines.model.estimation.conditioning import HIGHEST

__all__ = ["Asked", "refuse_strange", "refuse_unfit"]

_FEWEST_BLOCKS = 2


class Asked(Protocol):
    """The settings that stages share; None where left open."""

    @property
    def cutoff_hz(self) -> float | None: ...  # [Hz]

    @property
    def decimate(self) -> int | None: ...

    @property
    def min_speed(self) -> tuple[float, ...]: ...  # [rad/s] or [m/s], one or one a joint

    @property
    def blocks(self) -> int: ...


def refuse_strange(asked: Asked) -> None:
    """C02: a number that no log can be done with; told before any log is opened."""
    if asked.blocks < _FEWEST_BLOCKS:
        blocks = "1 block" if asked.blocks == 1 else f"{asked.blocks} blocks"
        raise UsageError("C02", blocks, where="--blocks", remedy="give 2 or more")
    if not all(0.0 <= speed < np.inf for speed in asked.min_speed):
        raise UsageError("C02", "a speed that is no number from zero up", where="--min-speed", remedy="give 0 or more [rad/s]")
    if asked.decimate is not None and asked.decimate < 1:
        raise UsageError("C02", f"every {asked.decimate}th sample", where="--decimate", remedy="give 1 or more")
    if asked.cutoff_hz is not None and not 0.0 < asked.cutoff_hz < np.inf:
        raise UsageError("C02", f"a low-pass at {asked.cutoff_hz:g} Hz", where="--cutoff-hz", remedy="give a frequency above 0")


def refuse_unfit(asked: Asked, log: ExperimentLog) -> None:
    """C02: what no log of this rate and so many joints can be done with."""
    if len(asked.min_speed) not in (1, log.n_joints):
        raise UsageError("C02", f"{len(asked.min_speed)} values for {log.n_joints} joints", where="--min-speed",
                         remedy="give one, or one a joint")
    highest = HIGHEST / log.sample_time
    if asked.cutoff_hz is not None and not asked.cutoff_hz < highest:
        raise UsageError("C02", f"a low-pass at {asked.cutoff_hz:g} Hz for {log.name}, sampled at {1.0 / log.sample_time:g} Hz",
                         where="--cutoff-hz", remedy=f"give a frequency above 0 and below {HIGHEST:g} of the rate, {highest:g} Hz")
