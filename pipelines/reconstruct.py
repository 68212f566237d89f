"""Reconstruct position, speed and acceleration of every joint from its encoder.

Reads    any logs but planned ones
Writes   logs/<name>.h5 or .parquet with q_hat, dq_hat, ddq_hat and their std; result.json, result.h5, report.html
Source   Kostić et al. 2004, Section IV.C.2 and IV.C.4, eq. (16)-(21), Figs. 7 and 10; Rauch, Tung & Striebel 1965

The observer is eq. (20), its jerk the one its innovations ask for; the default goes on to smooth, with later samples as well.
A derived log holds the motion of every sample. Periods of a periodic log are compared, and how well their mean is known is
reported; equations are taken from the mean by who makes them, `estimate-bps`, out of those same samples.

Positions alone are asked. Whether torque belongs to the motion, joint by joint, in sign, in scale and in time (S13 to S15,
T06), changes nothing here: `inspect` tells, and `estimate-bps` refuses such a log.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipelines.errors import Check, InputRejected, NothingMatched
from pipelines.io.derive import derive, recording
from pipelines.io.experiment import Array
from pipelines.io.files import Opened, open_log, write_log
from pipelines.io.robot import RobotDescription, format_robot
from pipelines.model.mean_period import doubts
from pipelines.model.motion import Reconstruction, reconstruct
from pipelines.model.motion_result import (
    LogResult,
    ObserverResult,
    Place,
    alarm,
    assess,
    coloured,
    straying,
)
from pipelines.quality.checks import Subject, check_log
from pipelines.report.motion_report import motion_report
from pipelines.report.report import Report
from pipelines.stage import Inputs, Request, Stage, read_logs, slug

__all__ = ["STAGE", "Result", "Settings", "compute", "report"]

Settings = Reconstruction

_DRAWN = 8  # logs whose series are kept for figures


@dataclass(frozen=True)
class Result:
    """Every log; in front the observer of the longest one, and the worst error of all logs of its robot."""

    observer: ObserverResult
    reconstruction_error_max: Array  # [rad] (joints,)
    innovation_whiteness: Array  # of the longest log
    logs: tuple[LogResult, ...]
    checks: tuple[Check, ...]


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Reconstruct the motion of every log that has one.

    Raises:
        NothingMatched: all logs are plans.
        InputRejected: the doctor rejects a log: its first reason.
        UsageError: C02, settings that do not fit.
    """
    taken: set[str] = set()
    found: list[LogResult] = []
    checks: list[Check] = []
    for opened in inputs.logs:
        if opened.log.origin == "planned":
            checks.append(Check.of("S01", "warn", "is a plan: nothing moved, nothing to reconstruct", where=opened.path,
                                   remedy="give the log of the motion itself"))
            continue
        stem = slug(opened.path.stem)
        while stem in taken:
            stem += "+"
        taken.add(stem)
        one, said = _one(opened, inputs.robot, settings, f"logs/{stem}", len(found) < _DRAWN)
        found.append(one)
        checks += said
    if not found:
        raise NothingMatched("C06", "no log holds a measured position", remedy="name logs of experiments, not plans")
    longest = max(found, key=lambda log: log.samples)
    alike = [log.reconstruction_error_max for log in found if len(log.units) == len(longest.units)]
    return Result(longest.observer, np.fmax.reduce(alike), longest.innovation_whiteness, tuple(found), tuple(checks))


def _one(opened: Opened, robot: RobotDescription | None, settings: Settings, file: str,
         draw: bool) -> tuple[LogResult, list[Check]]:
    bare = recording(opened.log)
    if robot is not None:
        if robot.n_joints != bare.n_joints:
            raise InputRejected("S02", f"log has {bare.n_joints} joints, model {robot.n_joints}", where=opened.path,
                                remedy="give the description of this robot")
        bare = replace(bare, robot_text=format_robot(robot))
    subject = Subject(bare)
    checks = [check for check in check_log(subject) if check.level != "ok"]
    if reject := next((check for check in checks if check.level == "reject"), None):
        raise reject.as_error()
    found = reconstruct(bare, settings, subject.good)
    derived = derive(bare, "reconstruct", settings.as_settings(), found.signals())
    result = assess(bare, found, settings, Place(opened.path.name, file), derived, draw)
    odd = doubts(result.noise_floor, opened.path, settings.average)
    return result, [*checks, *odd, *_doubts(result, settings, opened.path)]


def _doubts(log: LogResult, settings: Settings, path: Path) -> list[Check]:
    """A motion far from what was measured; deviations that the settings asked for make meaningless."""
    found = []
    if far := straying(log):
        worst = max(float(log.reconstruction_error_max[j - 1]) for j in far)
        limit = max(float(alarm(log)[j - 1]) for j in far)
        found.append(Check.of("D12", "warn", f"the reconstructed position of joint {_listed(far)} is up to {worst:.2g} rad from "
                              f"the measured one, more than {limit:.3g} rad", where=path, gate=True,
                              remedy="allow more jerk or bandwidth, or look for jumps and slips of the encoder"))
    forced = settings.jerk_std is not None or settings.bandwidth is not None
    if forced and (doubtful := coloured(log)) and not np.isnan(log.speed_std).all():
        found.append(Check.of("C02", "warn", f"with the settings asked for the innovations of joint {_listed(doubtful)} are "
                              "strongly coloured; the stated standard deviations hold only where they are white", where=path,
                              remedy="leave --jerk-std and --bandwidth to be found from the data"))
    return found


def _listed(joints: tuple[int, ...]) -> str:
    return ", ".join(map(str, joints))


def exit_code(result: Result, check: bool) -> int:
    """With --check 1 where a reconstructed position is further from the measured one than the paper's ever is."""
    return int(check and any(straying(log) for log in result.logs))


def write(result: Result, folder: Path, request: Request) -> None:
    """Write every log with its motion, in the container asked for."""
    for item in result.logs:
        request.tell(f"writing {item.file}")
        write_log(folder / f"{item.file}.{request.format}", item.log)


def report(result: Result) -> Report:
    """The verdict, the observer, and how well the motion is known."""
    return motion_report(result.logs)


def _onward(result: Result, inputs: Inputs) -> Inputs:
    """Later stages take the motion from the derived logs instead of reconstructing it again."""
    found = iter(result.logs)
    logs = tuple(opened if opened.log.origin == "planned" else
                 replace(opened, log=replace(next(found).log, source=opened.log.source)) for opened in inputs.logs)
    return replace(inputs, logs=logs)


def _restored(result: Result, folder: Path) -> Result:
    """A stored result with its logs, out of the files that `write` wrote."""
    files = {path.stem: path for path in (folder / "logs").iterdir()}
    return replace(result, logs=tuple(replace(item, log=open_log(files[Path(item.file).name]).log) for item in result.logs))


STAGE = Stage("reconstruct", "Reconstruct motion", Settings, compute, report, read_logs, write,
              exit_code=exit_code, checks=lambda result: result.checks, onward=_onward, hands_on="logs", restored=_restored,
              sessions="folder")
