"""Hold one log for its checks: as recorded, and what of it can be used."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from pipelines.errors import Check, Level
from pipelines.io.limits import FEWEST
from pipelines.io.log import Array, ExperimentLog
from pipelines.io.schema import joint_unit
from pipelines.quality.segments import Indices, Mask, Usable, usable


@dataclass(frozen=True)
class NotTested:
    """A check that this log gives nothing to judge by: neither passed nor failed."""

    level: ClassVar = "untested"
    code: str  # with prefix: "RRID-S15"
    where: str
    reason: str


@dataclass(frozen=True, eq=False)
class Subject:
    """One log under examination."""

    log: ExperimentLog

    @cached_property
    def good(self) -> Usable:
        return usable(self.log)

    @property
    def sampled(self) -> bool:
        """Return whether there are signals to judge; T08 is of logs with fewer samples."""
        return self.log.origin != "planned" and self.log.n_samples >= FEWEST

    @cached_property
    def travel(self) -> Array:
        """(joints,) [rad] distance between the extreme positions."""
        return spread(self.position)

    @cached_property
    def position(self) -> Array:
        """(samples, joints) [rad] usable position, glitches as NaN."""
        return np.where(self.good.position_spikes, np.nan, self.good.log.q)

    @property
    def moving(self) -> tuple[int, ...]:
        """Joints (from 0) that this kind of experiment has to move."""
        if self.log.experiment in ("friction", "frf") and self.log.joint is not None:
            return (self.log.joint - 1,)
        return tuple(range(self.log.n_joints)) if self.log.experiment == "excitation" else ()

    def unit(self, signal: str, joint: int) -> str:
        return joint_unit(signal, self.log.robot.joints[joint].revolute).replace("^2", "²")

    def with_units(self, signal: str, values: Iterable[float | None]) -> str:
        """Return a number for each joint: "4.82, 2.18 rad/s"; with units "4.8 rad/s, 0.3 m/s"."""
        words, units = [], [self.unit(signal, joint) for joint in range(self.log.n_joints)]
        for j, value in enumerate(values):
            shown = value is not None and not np.isnan(value)
            alike = j + 1 < len(units) and len(set(units)) == 1
            unit = "" if alike else f" {units[j]}"
            words.append(f"{value:.3g}{unit}" if shown else "not visible")
        return ", ".join(words)

    def say(
        self,
        code: str,
        level: Level,
        message: str,
        remedy: str = "",
        gate: bool = False,
        **place: Any,
    ) -> Check:
        """Return a check with its place: signal, joint (from 0), sample of the recording."""
        signal, joint, sample = (place.get(key) for key in ("signal", "joint", "sample"))
        parts = [self.log.source or self.log.name]
        parts += [f"signal {signal}"] if signal else []
        parts += [f"joint {joint + 1}"] if joint is not None else []
        if sample is not None:
            parts.append(f"sample {sample}, t = {self.log.t[sample]:.6g} s")
        return Check.of(code, level, message, ", ".join(parts), remedy, gate=gate)

    def ok(self, code: str, message: str, *, signal: str = "") -> list[Check]:
        return [self.say(code, "ok", message, signal=signal)]

    def cannot_tell(self, code: str, reason: str, *, signal: str = "") -> list[NotTested]:
        """Return what this log cannot show, which is not counted as passed."""
        check = self.say(code, "ok", reason, signal=signal)
        return [NotTested(check.code, check.where, check.message)]


def many(number: int, thing: str) -> str:
    """Return "1 gap", "2 gaps"."""
    return f"{number} {thing}{'' if number == 1 else 's'}"


def spread(x: Array) -> Array:
    """Return the largest minus the smallest finite sample of each column (joints,)."""
    finite = np.isfinite(x)
    high = np.max(np.where(finite, x, -np.inf), axis=0, initial=-np.inf)
    low = np.min(np.where(finite, x, np.inf), axis=0, initial=np.inf)
    return np.asarray(np.maximum(high - low, 0.0))


def flagged(mask: Mask) -> Iterator[tuple[int, Indices]]:
    """Yield each joint (from 0) that `mask` (samples, joints) marks, and its samples."""
    for joint in np.flatnonzero(mask.any(axis=0)).tolist():
        yield joint, np.flatnonzero(mask[:, joint])
