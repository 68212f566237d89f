"""Examine logs: container, units, clock, signals, and whether torque fits motion.

Reads    any logs, also broken ones: what cannot be opened is reported, not refused
Writes   result.json (checks, one summary a log), result.h5 (the figures' data), report.html
Source   bad-inputs.md, rows F, S, T and D; diagnosis.md, step 1

A log is *rejected* where a check has the level "reject"; the exit code is then 3. With --check, a
check that needs a repair ("repair") or closes a gate ends in exit 1; a warning alone does not.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from pipelines.errors import Check, Level, RrridError
from pipelines.estimation.checks.boundary import (
    Boundary,
    boundary_findings,
    torque_boundary,
    without_followers,
)
from pipelines.estimation.checks.plausibility import plausibility_findings
from pipelines.io.files import Opened
from pipelines.io.log import ExperimentLog, recording
from pipelines.io.option import option
from pipelines.io.schema import joint_unit
from pipelines.quality.checks import NotTested, Subject, check_together, columns_first, findings
from pipelines.quality.config import CONFIG
from pipelines.quality.segments import quantum
from pipelines.quality.units import TRUSTED
from pipelines.report.codes import first_to_read, title_of
from pipelines.report.config import REPORT
from pipelines.report.document import document
from pipelines.report.log_preview import Preview, log_preview, preview_figures
from pipelines.report.report import Report
from pipelines.report.sections import checks_table, level_tone, with_card
from pipelines.stage import Inputs, Request, Stage, Uses, read_logs

_TRUST = "--trust-units"


@dataclass(frozen=True)
class Settings:
    """Choose which checks are left out.

    `trust_units`: units are what the log says, however large the numbers (S05, S07).
    `allow_overlap`: one recording may have two roles (D14).
    """

    trust_units: bool = option(False, "Units are as declared, however large the numbers.")
    allow_overlap: bool = option(False, "One recording may be fitted and judged by.")


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
    """Attributes of a log, and what its samples show."""

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


@dataclass(frozen=True)
class Result:
    """All checks of all logs."""

    checks: tuple[Check, ...]
    # checks that a log gives nothing to judge by: neither passed nor failed
    not_tested: tuple[NotTested, ...]
    from_reading: int  # how many of them, the first, were made while reading
    logs: tuple[LogSummary, ...]
    rejected: tuple[str, ...]  # files that could not be opened
    previews: tuple[Preview, ...]
    # what the logged torque is; null: no log tells, or the logs are of several robots
    boundary: Boundary | None = None


def read(request: Request, settings: Settings) -> Inputs:
    """Read every log; one that cannot be opened is a finding."""
    return replace(read_logs(request, settings, keep_rejected=True), material=_TRUST)


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Run every check on every log."""
    reading = [*inputs.checks, *(check for opened in inputs.logs for check in opened.checks)]
    found = [_as_check(rejected.error, rejected.path) for rejected in inputs.rejected]
    logs: list[LogSummary] = []
    subjects: list[Subject] = []
    previews: list[Preview] = []
    untested: list[NotTested] = []
    for opened in inputs.logs:
        subject = Subject(opened.log)
        items = _examine(subject, opened, settings)
        checks = [item for item in items if isinstance(item, Check)]
        if inputs.material == _TRUST:  # within `run` there is no such option
            way_out = f"; if all is right as it is, pass {_TRUST}"
            checks = [
                replace(check, remedy=f"{check.remedy}{way_out}")
                if check.code in TRUSTED and check.level == "reject"
                else check
                for check in checks
            ]
        subjects.append(subject)
        found += checks
        untested += [item for item in items if isinstance(item, NotTested)]
        logs.append(_summary(opened, subject, (*opened.checks, *checks)))
        if len(previews) < REPORT.previews and subject.sampled:
            previews.append(log_preview(subject))
    together = check_together(inputs.logs, subjects)
    found += [c for c in together if not (settings.allow_overlap and c.code == "RRID-D14")]
    boundary, of_torque = _torque(inputs, subjects, logs)
    found = [*of_torque, *without_followers(found, of_torque)]
    if len({log.robot for log in logs}) == 1:
        found = list(columns_first(found))
    return Result(
        checks=(*reading, *found),
        not_tested=tuple(untested),
        from_reading=len(reading),
        logs=tuple(logs),
        rejected=tuple(str(rejected.path) for rejected in inputs.rejected),
        previews=tuple(previews),
        boundary=boundary,
    )


def _as_check(error: RrridError, path: object) -> Check:
    return Check(error.code, "reject", error.message, error.where or str(path), error.remedy, True)


def _examine(subject: Subject, opened: Opened, settings: Settings) -> list[Check | NotTested]:
    """Return the checks of one log, and of the model where none of them rejects it."""
    found = [*findings(subject, TRUSTED if settings.trust_units else ())]
    if any(item.level == "reject" for item in found):
        return found
    of_model: list[Check | NotTested] = []
    try:
        of_model += plausibility_findings(subject)
        of_model += _periods(subject, opened)
    except RrridError as problem:  # a description without usable geometry
        of_model.append(_as_check(problem, opened.path))
    return [*found, *of_model]


def _periods(subject: Subject, opened: Opened) -> list[Check]:
    """T10 as in the stages that average periods: unlike ones, and how long the first settles."""
    log = recording(subject.log)
    if not subject.sampled or log.period is None or not subject.good.runs:
        return []
    # observers, for the few logs that have periods
    from pipelines.estimation.motion import Reconstruction, reconstruct
    from pipelines.estimation.periods import doubts, mean_period
    from pipelines.estimation.regression import cutoff_at, wanted_cutoff

    found = reconstruct(log, Reconstruction(), subject.good)
    rate = 1.0 / log.sample_time
    cutoff = cutoff_at(wanted_cutoff(found.motion, rate), rate)
    return doubts(mean_period(log, found, cutoff)[0], opened.path)


def _torque(
    inputs: Inputs, subjects: Iterable[Subject], logs: Iterable[LogSummary]
) -> tuple[Boundary | None, tuple[Check, ...]]:
    """Return what the torque of the usable logs is, if they are of one robot with a geometry."""
    every = zip(subjects, inputs.logs, logs, strict=True)
    usable = [(s.log, opened.path) for s, opened, log in every if log.verdict != "reject"]
    if len({log.robot_text for log, _ in usable}) != 1:
        return None, ()
    try:
        boundary = torque_boundary([log for log, _ in usable])
    except RrridError:  # a description without usable geometry: a finding of the log
        return None, ()
    place = usable[0][1] if len(usable) == 1 else usable[0][1].parent
    return boundary, boundary_findings(boundary, str(place))


def _summary(opened: Opened, subject: Subject, checks: Iterable[Check]) -> LogSummary:
    """Return the summary of a log that has these checks."""
    log, good = subject.log, subject.good if subject.sampled else None
    t = good.log.t if good else log.t[np.abs(log.t) < CONFIG.no_time]
    gaps: tuple[tuple[float, float], ...] = ()
    if good:
        t_s = log.t * good.time.scale
        gaps = tuple((float(t_s[k]), float(t_s[k + 1])) for k in good.time.gaps)
    found = {check.level for check in checks}
    order: tuple[Level, ...] = ("reject", "repair", "warn")
    return LogSummary(
        name=log.name,
        file=str(opened.path),
        sha256=opened.sha256,
        integrity="none" if any(c.code == "RRID-F05" for c in opened.checks) else "digest",
        experiment=log.experiment,
        role=log.role,
        origin=log.origin,
        robot=log.robot_name,
        joints=log.n_joints,
        moving_joint=log.joint,
        controller=log.controller.law if log.controller else "",
        signals=tuple(log.signals),
        samples=log.n_samples,
        usable_samples=int(good.fit.sum()) if good else 0,
        duration=float(np.ptp(t)) if t.size else 0.0,
        sample_time=log.sample_time,
        period=log.period,
        jitter=good.time.jitter if good else 0.0,
        dropped_samples=good.time.dropped_samples if good else 0,
        gaps=gaps,
        encoder_step=good.steps if good else (),
        torque_step=tuple(quantum(column) for column in good.log.tau.T) if good else (),
        ranges=_ranges(log),
        verdict=next((level for level in order if level in found), "ok"),
    )


def _ranges(log: ExperimentLog) -> tuple[Range, ...]:
    found = []
    for name in ("q", "dq", "tau", "q_ref", "current", "temperature"):
        for j, joint in enumerate(log.robot.joints if name in log else ()):
            x = log[name][:, j]
            x = x[np.isfinite(x)] if np.isfinite(x).any() else np.array([np.nan])
            unit = joint_unit(name, joint.revolute)
            found.append(Range(name, j + 1, unit, float(x.min()), float(x.max())))
    return tuple(found)


def exit_code(result: Result, check: bool) -> int:
    """Return 3 where a log is rejected; with --check 1 for a repair or a closed gate."""
    if any(c.level == "reject" for c in result.checks):
        return 3
    return int(check and any(c.gate or c.level == "repair" for c in result.checks))


def report(result: Result) -> Report:
    """Return the verdict, the findings, what was checked, and the signals of the first logs."""
    found = sorted((c for c in result.checks if c.level != "ok"), key=first_to_read)
    levels = Counter(check.level for check in result.checks)
    of_logs = Counter(log.verdict for log in result.logs)
    worst = [
        (of_logs["reject"] + len(result.rejected), "cannot be used"),
        (of_logs["repair"], "can be used after repair"),
        (of_logs["warn"], "should be looked at"),
    ]
    passed = {check.code: check for check in reversed(result.checks) if check.level == "ok"}
    times = Counter(check.code for check in result.checks if check.level == "ok")
    untested = Counter((item.code, item.reason) for item in result.not_tested)
    drawn = {preview.name: preview_figures(preview) for preview in result.previews}
    page = document(
        "inspect",
        level_tone(levels),
        result=result,
        robots=len({log.robot for log in result.logs}),
        found=found,
        levels=levels,
        worst=[(count, words) for count, words in worst if count],
        most=REPORT.findings,
        checks_table=checks_table,
        level_tone=level_tone,
        untested=len({code for code, _ in untested}),
        passed=[
            (check.message, times[code], f"{code} {title_of(code)}".strip())
            for code, check in sorted(passed.items())
        ],
        untested_rows=[
            (reason, count, f"{code} {title_of(code)}".strip())
            for (code, reason), count in sorted(untested.items())
        ],
        drawn=[(log, drawn[log.name]) for log in result.logs if log.name in drawn],
    )
    return with_card(page, result.boundary)


def _onward(result: Result, inputs: Inputs) -> Inputs:
    """Return the inputs of later stages: the logs that can be used."""
    pairs = zip(inputs.logs, result.logs, strict=True)
    return replace(inputs, logs=tuple(o for o, log in pairs if log.verdict != "reject"))


STAGE = Stage(
    "inspect",
    "Examine logs",
    Settings,
    compute,
    report,
    read,
    exit_code=exit_code,
    checks=lambda result: result.checks[result.from_reading :],
    onward=_onward,
    hands_on="choice",
    uses=Uses(rejected=True),
    sessions="folder",
)
