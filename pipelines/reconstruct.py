"""Reconstruct position, speed and acceleration of every joint from its encoder.

Reads    any logs but planned ones
Writes   logs/<name>.h5 or .parquet with q_hat, dq_hat, ddq_hat and their std; result.json, .h5
Source   Kostić et al. 2004, Section IV.C.2 and IV.C.4, eq. (16)-(21), Figs. 7 and 10;
         Rauch, Tung & Striebel 1965

The observer is eq. (20), its jerk the one that makes its innovations white; by default a smoother
follows, with later samples as well. A derived log holds the motion of every sample. Periods of a
periodic log are compared, and the accuracy of their mean is reported.

Only positions are used. Whether torque fits the motion in sign, scale and time (S13 to S15, T06)
changes nothing here: `inspect` reports it, and `estimate-bps` refuses such a log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipelines.errors import Check, InputRejected, NothingMatched
from pipelines.estimation.motion import Reconstruction, reconstruct
from pipelines.estimation.motion_result import LogResult, ObserverResult, assess
from pipelines.estimation.periods import doubts
from pipelines.io.files import Opened, open_log, write_log
from pipelines.io.log import Array, derive, recording
from pipelines.io.robot import RobotDescription, format_robot
from pipelines.quality.checks import Subject, accepted
from pipelines.report.config import REPORT
from pipelines.report.motion_report import motion_report
from pipelines.report.report import Report
from pipelines.stage import Inputs, Request, Stage, read_logs, slug

__all__ = ["STAGE", "Result", "Settings", "compute", "report"]

Settings = Reconstruction


@dataclass(frozen=True)
class Result:
    """All logs; the observer of the longest one, and the worst error of all logs of its robot."""

    observer: ObserverResult
    reconstruction_error_max: Array  # [rad] (joints,)
    innovation_whiteness: Array  # of the longest log
    logs: tuple[LogResult, ...]
    checks: tuple[Check, ...]


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Reconstruct the motion of every log that has one.

    Raises:
        NothingMatched: all logs are plans.
        InputRejected: `inspect` rejects a log: its first reason.
        UsageError: C02, settings that do not fit.
    """
    taken: set[str] = set()
    found: list[LogResult] = []
    checks: list[Check] = []
    for opened in inputs.logs:
        if opened.log.origin == "planned":
            words, remedy = "is a plan: nothing moved", "give the log of the motion itself"
            checks.append(Check.of("S01", "warn", words, where=opened.path, remedy=remedy))
            continue
        stem = slug(opened.path.stem)
        while stem in taken:
            stem += "+"
        taken.add(stem)
        motion, warnings = _motion(opened, inputs.robot, settings, f"logs/{stem}", found)
        found.append(motion)
        checks += warnings
    if not found:
        remedy = "name logs of experiments, not plans"
        raise NothingMatched("C06", "no log holds a measured position", remedy=remedy)
    longest = max(found, key=lambda log: log.samples)
    alike = [log.reconstruction_error_max for log in found if len(log.units) == len(longest.units)]
    worst, whiteness = np.fmax.reduce(alike), longest.innovation_whiteness
    return Result(longest.observer, worst, whiteness, tuple(found), tuple(checks))


def _motion(
    opened: Opened,
    robot: RobotDescription | None,
    settings: Settings,
    file: str,
    before: Sequence[LogResult],
) -> tuple[LogResult, list[Check]]:
    """Reconstruct one log; the series of the first few are kept for figures."""
    log = recording(opened.log)
    if robot is not None and robot.n_joints != log.n_joints:
        words = f"log has {log.n_joints} joints, model {robot.n_joints}"
        remedy = "give the description of this robot"
        raise InputRejected("S02", words, where=opened.path, remedy=remedy)
    if robot is not None:
        log = replace(log, robot_text=format_robot(robot))
    subject = Subject(log)
    checks = accepted(subject)
    found = reconstruct(log, settings, subject.good)
    derived = derive(log, "reconstruct", settings.as_settings(), found.signals())
    drawn = len(before) < REPORT.reconstructed
    result = assess(log, found, settings, (opened.path.name, file), derived, drawn)
    checks += doubts(result.noise_floor, opened.path)
    return result, [*checks, *_warnings(result, settings, opened.path)]


def _warnings(log: LogResult, settings: Settings, path: Path) -> list[Check]:
    """D12: a motion far from the measured one. C02: settings that make deviations meaningless."""
    found = []
    if far := log.straying:
        joints = ", ".join(map(str, far))
        worst = max(float(log.reconstruction_error_max[j - 1]) for j in far)
        limit = max(float(log.alarm[j - 1]) for j in far)
        words = f"the reconstructed position of joint {joints} is up to {worst:.2g} rad from "
        words += f"the measured one, more than {limit:.3g} rad"
        remedy = "allow more bandwidth, or look for jumps and slips of the encoder"
        found.append(Check.of("D12", "warn", words, where=path, gate=True, remedy=remedy))
    correlated = log.coloured
    if settings.bandwidth is not None and correlated:
        joints = ", ".join(map(str, correlated))
        words = f"with these settings the innovations of joint {joints} are strongly "
        words += "coloured; the stated standard deviations hold only where they are white"
        remedy = "leave --bandwidth to be found from the data"
        found.append(Check.of("C02", "warn", words, where=path, remedy=remedy))
    return found


def exit_code(result: Result, check: bool) -> int:
    """Return 1 with --check where a position is farther from the measured one than the paper's."""
    return int(check and any(log.straying for log in result.logs))


def write(result: Result, folder: Path, request: Request) -> None:
    """Write every log with its motion, in the container that `request` names."""
    for item in result.logs:
        request.tell(f"writing {item.file}")
        write_log(folder / f"{item.file}.{request.format}", item.log)


def report(result: Result) -> Report:
    """Return the verdict, the observer, and how well the motion is known."""
    return motion_report(result.logs)


def _onward(result: Result, inputs: Inputs) -> Inputs:
    """Return the derived logs, so that later stages do not reconstruct their motion again."""
    found, logs = iter(result.logs), []
    for opened in inputs.logs:
        if opened.log.origin != "planned":
            opened = replace(opened, log=replace(next(found).log, source=opened.log.source))
        logs.append(opened)
    return replace(inputs, logs=tuple(logs))


def _restored(result: Result, folder: Path) -> Result:
    """Return a stored result with its logs, from the files that `write` wrote."""
    files = {path.stem: path for path in (folder / "logs").iterdir()}
    logs = ((item, open_log(files[Path(item.file).name]).log) for item in result.logs)
    return replace(result, logs=tuple(replace(item, log=log) for item, log in logs))


STAGE = Stage(
    "reconstruct",
    "Reconstruct motion",
    Settings,
    compute,
    report,
    read_logs,
    write,
    exit_code=exit_code,
    checks=lambda result: result.checks,
    onward=_onward,
    hands_on="logs",
    restored=_restored,
    sessions="folder",
)
