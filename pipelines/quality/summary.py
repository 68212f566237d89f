"""What a log says of itself, and what its samples say: the doctor's summary, one a log."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from pipelines.errors import Check, Level
from pipelines.io.experiment import ExperimentLog
from pipelines.io.files import Opened
from pipelines.io.schema import joint_unit
from pipelines.quality.checks_subject import Subject
from pipelines.quality.faults import quantum

__all__ = ["LogSummary", "Range", "summary_of"]

_WORST_FIRST: tuple[Level, ...] = ("reject", "repair", "warn")


@dataclass(frozen=True)
class Range:
    """Extreme finite values of one signal of one joint."""

    signal: str
    joint: int  # 1-based
    unit: str
    low: float
    high: float


@dataclass(frozen=True)
class LogSummary:
    """What a log says of itself, and what its samples say."""

    name: str
    file: str
    sha256: str
    integrity: str  # "digest" | "none": whether a flipped bit would be noticed
    experiment: str
    role: str
    origin: str
    robot: str
    joints: int
    moving_joint: int | None
    controller: str  # its law; "" where the log does not say
    signals: tuple[str, ...]
    samples: int
    usable_samples: int  # that a fit may use
    duration: float  # [s]
    sample_time: float  # [s]
    period: float | None  # [s]
    jitter: float  # rms, in sample times
    dropped_samples: int
    gaps: tuple[tuple[float, float], ...]  # [s] from, to
    encoder_step: tuple[float | None, ...]  # [rad]
    torque_step: tuple[float | None, ...]  # [N m]
    ranges: tuple[Range, ...]
    verdict: Level  # worst level of its checks


def summary_of(opened: Opened, subject: Subject, checks: Iterable[Check]) -> LogSummary:
    """Of a log that was examined, with all checks on it."""
    log, good = subject.log, subject.good if subject.sampled else None
    t = good.log.t if good else log.t[np.abs(log.t) < 1e20]
    time = good.time if good else None
    gaps = tuple((float(log.t[k]) * time.scale, float(log.t[k + 1]) * time.scale) for k in time.gaps) if time else ()
    levels = [check.level for check in checks]
    return LogSummary(
        log.name, str(opened.path), opened.sha256, "none" if any(c.code == "RRID-F05" for c in opened.checks) else "digest",
        log.experiment, log.role, log.origin, log.robot_name, log.n_joints, log.joint,
        log.controller.law if log.controller else "", tuple(log.signals), log.n_samples, int(good.fit.sum()) if good else 0,
        float(t.max() - t.min()) if t.size else 0.0, log.sample_time, log.period, time.jitter if time else 0.0,
        time.dropped_samples if time else 0, gaps, subject.steps if good else (),
        tuple(quantum(column) for column in good.log.tau.T) if good else (), _ranges(log),
        next((level for level in _WORST_FIRST if level in levels), "ok"))


def _ranges(log: ExperimentLog) -> tuple[Range, ...]:
    found = []
    for name in ("q", "dq", "tau", "q_ref", "current", "temperature"):
        for j, joint in enumerate(log.robot.joints if name in log else ()):
            finite = log[name][np.isfinite(log[name][:, j]), j]
            low, high = (float(finite.min()), float(finite.max())) if finite.size else (np.nan, np.nan)
            found.append(Range(name, j + 1, joint_unit(name, joint.revolute), low, high))
    return tuple(found)
