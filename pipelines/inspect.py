"""Examine logs: container, units, clock, signals, and whether torque fits motion.

Reads    any logs, also broken ones: what cannot be opened is reported, not refused
Writes   result.json (checks, one summary a log), result.h5 (what the figures show), report.html; no log is changed
Source   bad-inputs.md, rows F, S, T and D; diagnosis.md, step 1

A log is *rejected* where a check says "reject"; the exit code is then 3. With --check, a check that wants mending
("repair") or closes a gate ends in exit 1; a warning alone does not.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace

from pipelines.errors import Check, RrridError
from pipelines.estimation.checks.boundary import Boundary, torque_boundary
from pipelines.estimation.checks.findings import boundary_findings, without_followers
from pipelines.io.codes import first_to_read, title_of
from pipelines.io.derive import recording
from pipelines.io.files import Opened
from pipelines.io.option import option
from pipelines.io.robot import RobotDescription, format_robot
from pipelines.model.plausibility import plausibility_findings
from pipelines.quality.checks import NotTested, Subject, check_together, findings
from pipelines.quality.checks_subject import many
from pipelines.quality.checks_unit import TRUSTED
from pipelines.quality.columns_first import columns_first
from pipelines.quality.summary import LogSummary, summary_of
from pipelines.report.log_preview import Preview, log_preview, preview_figures
from pipelines.report.report import Report, Section, Table
from pipelines.report.sections import boundary_card, checks_table, level_tone
from pipelines.stage import Inputs, Request, Stage, Uses, read_logs

__all__ = ["STAGE", "Result", "Settings", "compute", "report"]

_PREVIEWS = 8
_FINDINGS_SHOWN = 200
_TRUST = "--trust-units"


@dataclass(frozen=True)
class Settings:
    """`trust_units`: units are what the log says, however large the numbers (S05, S07). `allow_overlap`: one recording may have two
    roles (D14)."""

    trust_units: bool = option(False, "Units are as declared, however large the numbers.")
    allow_overlap: bool = option(False, "One recording may be fitted and judged by.")


@dataclass(frozen=True)
class Result:
    """Everything the doctor found."""

    checks: tuple[Check, ...]
    not_tested: tuple[NotTested, ...]  # checks that a log gives nothing to judge by: neither passed nor failed
    from_reading: int  # how many of them, the first, were made while reading
    logs: tuple[LogSummary, ...]
    rejected: tuple[str, ...]  # files that could not be opened
    previews: tuple[Preview, ...]
    boundary: Boundary | None = None  # what the logged torque is; null: no log tells, or the logs are of several robots


def read(request: Request, settings: Settings) -> Inputs:
    """Every log; one that cannot be opened is a finding."""
    return replace(read_logs(request, settings, keep_rejected=True), material=_TRUST)


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Run every check on every log."""
    reading = [*inputs.checks, *(check for opened in inputs.logs for check in opened.checks)]
    found = [_as_check(rejected.error, rejected.path) for rejected in inputs.rejected]
    logs: list[LogSummary] = []
    previews: list[Preview] = []
    blind: list[NotTested] = []
    subjects: list[Subject] = []
    for opened in inputs.logs:
        subject, judged = _examine(opened, inputs.robot, settings)
        judged = [_with_way_out(item) if inputs.material == _TRUST else item for item in judged]
        subjects.append(subject)
        mine = [item for item in judged if isinstance(item, Check)]
        blind += [item for item in judged if isinstance(item, NotTested)]
        found += mine
        logs.append(summary_of(opened, subject, (*opened.checks, *mine)))
        if len(previews) < _PREVIEWS and subject.sampled:
            previews.append(log_preview(subject))
    found += [check for check in check_together(inputs.logs, subjects) if not (settings.allow_overlap and check.code == "RRID-D14")]
    boundary, of_torque = _torque(inputs, subjects, logs)
    found = [*of_torque, *without_followers(found, of_torque)]
    if len({log.robot for log in logs}) == 1:
        found = list(columns_first(found))
    return Result((*reading, *found), tuple(blind), len(reading), tuple(logs),
                  tuple(str(r.path) for r in inputs.rejected), tuple(previews), boundary)


def _torque(inputs: Inputs, subjects: list[Subject], logs: list[LogSummary]) -> tuple[Boundary | None, tuple[Check, ...]]:
    """What the torque of the logs that can be used is; nothing of several robots, which are told apart by `run` and `batch`."""
    usable = [(subject.log, opened.path) for subject, opened, summary in zip(subjects, inputs.logs, logs, strict=True)
              if summary.verdict != "reject"]
    if len({log.robot_text for log, _ in usable}) != 1:
        return None, ()
    try:
        boundary = torque_boundary([log for log, _ in usable])
    except RrridError:  # a description without usable geometry, which is told of the log
        return None, ()
    place = usable[0][1] if len(usable) == 1 else usable[0][1].parent
    return boundary, boundary_findings(boundary, str(place))


def _with_way_out(item: Check | NotTested) -> Check | NotTested:
    """S05 and S07 with the option that this command has for whoever knows better; within `run` there is none."""
    if isinstance(item, NotTested) or item.code not in TRUSTED or item.level != "reject":
        return item
    return replace(item, remedy=f"{item.remedy}; if all is right as it is, pass {_TRUST}")


def _as_check(error: RrridError, path: object) -> Check:
    return Check(error.code, "reject", error.message, error.where or str(path), error.remedy, True)


def _examine(opened: Opened, robot: RobotDescription | None, settings: Settings) -> tuple[Subject, list[Check | NotTested]]:
    log = opened.log
    if robot is not None and robot.n_joints != log.n_joints:
        mismatch = Check.of("S02", "reject", f"log has {log.n_joints} joints, model {robot.n_joints}", where=opened.path,
                            remedy="give the description of this robot, or choose the columns with --joints")
        return Subject(log), [mismatch]
    subject = Subject(log if robot is None else replace(log, robot_text=format_robot(robot)))
    found = [*findings(subject, TRUSTED if settings.trust_units else ())]
    if any(isinstance(item, Check) and item.level == "reject" for item in found):
        return subject, found
    twins = any(item.code == "RRID-S13" for item in found)
    try:
        # Of two channels with the same samples nobody can say that each fits best where it stands.
        found += [item for item in plausibility_findings(subject)
                  if not (twins and item.code == "RRID-S13" and (isinstance(item, NotTested) or item.level == "ok"))]
        found += _periods(subject, opened)
    except RrridError as problem:  # a description without usable geometry
        found.append(_as_check(problem, opened.path))
    return subject, found


def _periods(subject: Subject, opened: Opened) -> list[Check]:
    """T10 as the stages say it that average periods: those that are unlike the others, and how long the first takes to settle."""
    log = recording(subject.log)
    if not subject.sampled or log.period is None or not subject.good.runs:
        return []
    # Observers, for the few logs that have periods.
    from pipelines.model.estimation.conditioning import cutoff_at, wanted_cutoff
    from pipelines.model.mean_period import doubts, noise_floor
    from pipelines.model.motion import Reconstruction, reconstruct

    how = Reconstruction()
    found = reconstruct(log, how, subject.good)
    rate = 1.0 / log.sample_time
    return doubts(noise_floor(log, found, cutoff_at(wanted_cutoff(found.motion, rate), rate)), opened.path)


def exit_code(result: Result, check: bool) -> int:
    """3 where anything is rejected; with --check 1 where something had to be mended or a gate closed."""
    if any(c.level == "reject" for c in result.checks):
        return 3
    return int(check and any(c.gate or c.level == "repair" for c in result.checks))


def report(result: Result) -> Report:
    """The verdict, what was found, what was looked at, and the signals of the first logs."""
    found = sorted((c for c in result.checks if c.level != "ok"), key=first_to_read)
    sections = [*boundary_card(result.boundary), _found_section(found), _logs_section(result), _passed_section(result),
                _not_tested_section(result)]
    sections = [section for section in sections if any(table.rows for table in section.tables)]
    sections += [_log_section(summary, preview) for summary, preview in _paired(result)]
    tone = level_tone(c.level for c in result.checks)
    return Report("Log doctor", _verdict(result, found), tone, _key_figures(result), tuple(sections))


def _paired(result: Result) -> list[tuple[LogSummary, Preview]]:
    remaining = list(result.logs)
    pairs = []
    for preview in result.previews:
        at = next(i for i, summary in enumerate(remaining) if summary.name == preview.name)
        pairs.append((remaining.pop(at), preview))
    return pairs


def _verdict(result: Result, found: list[Check]) -> str:
    total = len(result.logs) + len(result.rejected)
    robots = len({log.robot for log in result.logs})
    many_robots = f" of {robots} robots" if robots > 1 else ""
    if not found:
        which = "The log is" if total == 1 else f"All {total} logs{many_robots} are"
        return f"{which} in order: nothing was found that a fit would suffer from.{_open_questions(result)}"
    bad = len(result.rejected) + sum(log.verdict == "reject" for log in result.logs)
    mended = sum(log.verdict == "repair" for log in result.logs)
    warned = sum(log.verdict == "warn" for log in result.logs)
    counted = [(count, words) for count, words in
               ((bad, "cannot be used"), (mended, "can be used after repair"), (warned, "should be looked at")) if count]
    if total == 1:
        said = f"The log {counted[0][1] if counted else 'is not bad in itself'}"
    else:
        said = f"Of {total} logs{many_robots} {', '.join(f'{n} {words}' for n, words in counted) or 'none is bad alone'}"
    return f"{said}. First of all: {found[0].message}."


def _open_questions(result: Result) -> str:
    codes = {item.code for item in result.not_tested}
    return f" {many(len(codes), 'check')} could not be made on every log; the report says why." if codes else ""


def _key_figures(result: Result) -> Table:
    count: dict[str, int] = defaultdict(int)
    for check in result.checks:
        count[check.level] += 1
    rows = (("logs", len(result.logs) + len(result.rejected)), ("checks made", len(result.checks)), ("passed", count["ok"]),
            ("warnings", count["warn"]), ("repaired", count["repair"]), ("not usable", count["reject"]),
            ("not tested", len(result.not_tested)))
    return Table(("what", "number"), rows)


def _found_section(found: list[Check]) -> Section:
    more = len(found) - _FINDINGS_SHOWN
    text = (f"{more} more are in result.json.",) if more > 0 else ()
    return Section("Findings", text, (checks_table(found[:_FINDINGS_SHOWN], as_given=True),))


def _passed_section(result: Result) -> Section:
    groups: dict[str, list[Check]] = defaultdict(list)
    for check in result.checks:
        if check.level == "ok":
            groups[check.code].append(check)
    rows = tuple((group[0].message, len({c.where.split(",")[0] for c in group}), f"{code} {title_of(code)}".strip())
                 for code, group in sorted(groups.items()))
    columns = ("what was measured, in the first of them", "logs", "code")
    return Section("What was looked at and is in order", (), (Table(columns, rows),))


def _not_tested_section(result: Result) -> Section:
    groups: dict[tuple[str, str], list[str]] = defaultdict(list)
    for item in result.not_tested:
        groups[item.code, item.reason].append(item.where)
    rows = tuple((reason, len(places), places[0], f"{code} {title_of(code)}".strip())
                 for (code, reason), places in sorted(groups.items()))
    return Section("Not tested, and why", ("Neither passed nor failed: these logs give nothing to judge by.",),
                   (Table(("why", "logs", "the first of them", "code"), rows),))


def _logs_section(result: Result) -> Section:
    several = len({log.robot for log in result.logs}) > 1
    columns = ("name", *(("robot",) if several else ()), "experiment", "role", "joints", "samples", "duration [s]", "rate [Hz]",
               "integrity")
    rows = tuple((log.name, *((log.robot,) if several else ()),
                  log.experiment if log.moving_joint is None else f"{log.experiment}, joint {log.moving_joint}",
                  log.role, log.joints, log.samples, log.duration, 1.0 / log.sample_time, log.integrity) for log in result.logs)
    return Section("The logs", (), (Table(columns, rows, tones=tuple(level_tone([log.verdict]) for log in result.logs)),))


def _log_section(log: LogSummary, preview: Preview) -> Section:
    ranges = Table(("signal", "joint", "lowest", "highest", "unit"),
                   tuple((r.signal, r.joint, r.low, r.high, r.unit) for r in log.ranges))
    uneven = log.jitter > 1e-3 or log.dropped_samples > 0 or bool(log.gaps)
    steps = ", ".join("not visible" if step is None else f"{step:.3g}" for step in log.encoder_step)
    # a hyphen and a blank at which no line is broken
    text = (f"{log.usable_samples} of {log.samples} samples can be used. Encoder steps [rad]: {steps}. "
            f"SHA\u2011256\u00a0{log.sha256[:16]}…",)
    return Section(f"Log {log.name}", text, (ranges,) if ranges.rows else (), preview_figures(preview, uneven))


def _onward(result: Result, inputs: Inputs) -> Inputs:
    """Later stages see the logs that can be used."""
    usable = tuple(opened for opened, summary in zip(inputs.logs, result.logs, strict=True) if summary.verdict != "reject")
    return replace(inputs, logs=usable)


STAGE = Stage("inspect", "Examine logs", Settings, compute, report, read, exit_code=exit_code,
              checks=lambda result: result.checks[result.from_reading:], onward=_onward, hands_on="choice",
              uses=Uses(rejected=True), sessions="folder")
