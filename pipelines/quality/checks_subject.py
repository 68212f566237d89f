"""What every check of one log looks at: the log as recorded, and what of it is usable, worked out once."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipelines.errors import Check, Level, clean
from pipelines.io.experiment import Array, ExperimentLog
from pipelines.io.limits import FEWEST
from pipelines.io.schema import joint_unit
from pipelines.quality.segments import Usable, usable

__all__ = ["NotTested", "Subject", "many", "spread"]


@dataclass(frozen=True)
class NotTested:
    """A check that this log gives nothing to judge by: neither passed nor failed."""

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
    def planned(self) -> bool:
        return self.log.origin == "planned"

    @property
    def sampled(self) -> bool:
        """Return whether there are signals to judge; of fewer samples T08 says all there is to say."""
        return not self.planned and self.log.n_samples >= FEWEST

    @property
    def steps(self) -> tuple[float | None, ...]:
        """Step in which each encoder counts, where it can be seen. [rad]"""
        return self.good.steps

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
        """A number for each joint: "4.82, 2.18 rad/s", or "4.82 rad/s, 0.3 m/s" where some turn and some slide."""
        units = [self.unit(signal, joint) for joint in range(self.log.n_joints)]
        told = ["not visible" if value is None or np.isnan(value) else f"{value:.3g}" for value in values]
        if len(set(units)) == 1 and told[-1] != "not visible":
            return f"{', '.join(told)} {units[0]}"
        return ", ".join(word if word == "not visible" else f"{word} {unit}" for word, unit in zip(told, units, strict=True))

    def place(self, signal: str = "", joint: int | None = None, sample: int | None = None) -> str:
        """Where: file, signal, joint (from 0), sample of the recording."""
        parts = [self.log.source or self.log.name]
        parts += [f"signal {signal}"] if signal else []
        parts += [f"joint {joint + 1}"] if joint is not None else []
        if sample is not None:
            parts.append(f"sample {sample}, t = {self.log.t[sample]:.6g} s")
        return ", ".join(parts)

    def say(self, code: str, level: Level, message: str, *, signal: str = "", joint: int | None = None, sample: int | None = None,
            remedy: str = "", gate: bool = False) -> Check:
        return Check.of(code, level, message, where=self.place(signal, joint, sample), remedy=remedy, gate=gate)

    def ok(self, code: str, message: str, *, signal: str = "") -> list[Check]:
        return [self.say(code, "ok", message, signal=signal)]

    def cannot_tell(self, code: str, reason: str, *, signal: str = "") -> list[NotTested]:
        """What this log cannot show is said, and not counted as passed."""
        return [NotTested(f"RRID-{code}", clean(self.place(signal)), clean(reason))]


def many(number: int, thing: str) -> str:
    """"1 gap", "2 gaps"."""
    return f"{number} {thing}{'' if number == 1 else 's'}"


def spread(x: Array) -> Array:
    """(joints,) largest minus smallest finite sample of each column."""
    finite = np.isfinite(x)
    high = np.max(np.where(finite, x, -np.inf), axis=0, initial=-np.inf)
    low = np.min(np.where(finite, x, np.inf), axis=0, initial=np.inf)
    return np.asarray(np.maximum(high - low, 0.0))
