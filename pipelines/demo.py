"""Simulate an arm with something wrong at a joint, and run the whole workflow on its logs.

Reads    nothing
Writes   logs/, result.json with what was hidden in them, report.html
Source   Kostić et al. 2004, eq. (22) for the motion, Section III for the arm; causes.md for what can be hidden

`rrrid demo` runs the whole workflow on these logs, and ends in what was hidden and what was found.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from pipelines.diagnosis.result import Diagnosis, NotIdentifiable
from pipelines.errors import InputRejected, UsageError
from pipelines.io.experiment import ExperimentLog
from pipelines.io.files import write_log
from pipelines.io.option import option
from pipelines.io.results import NOT_STORED
from pipelines.model.effects import find_effect
from pipelines.model.simulation.example import FAULT, example_session
from pipelines.report.report import Report, Section, Table
from pipelines.report.style import format_number, unit_in_words
from pipelines.report.words import format_values, in_order, named, spoken, without_keys
from pipelines.stage import Inputs, Request, Stage

__all__ = ["STAGE", "Recorded", "Result", "Settings", "compute", "ending", "hidden", "report"]

_NUMBERS = 3  # of a finding whose numbers nobody has chosen


@dataclass(frozen=True)
class Settings:
    """What is hidden, and which motions and which noise there are."""

    fault: tuple[str, ...] = option((FAULT,), "What to hide: CAUSE:JOINT:NAME=VALUE,…, or none. Repeatable. [cogging at joint 2]", causes=True)
    seed: int = option(1, "Seed of motions and noise.")


@dataclass(frozen=True)
class Recorded:
    """One log."""

    file: str
    experiment: str
    role: str
    samples: int
    log: ExperimentLog = field(metadata=NOT_STORED, repr=False)


@dataclass(frozen=True)
class Result:
    """What was recorded, and what was hidden."""

    robot: str
    fault: tuple[str, ...]
    logs: tuple[Recorded, ...]


def read(request: Request, settings: Settings) -> Inputs:
    """No input at all."""
    return Inputs(label="demo", robot_name="rrr-tue")


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Simulate the session.

    Raises:
        UsageError: C01, C02, a fault that is none; a negative seed.
        InputRejected: the arm runs away with it (D17), or is no arm.
    """
    if settings.seed < 0:
        raise UsageError("C02", f"the seed {settings.seed} is negative", where="--seed", remedy="give 0 or more")
    faults = tuple(text for text in settings.fault if text != "none")
    try:
        session = example_session(*faults, seed=settings.seed)
    except InputRejected as problem:
        if problem.code != "RRID-D17":
            raise
        # what it says of the gains in a log is no help to who has none
        raise InputRejected("D17", f"{problem.message}, with {' '.join(faults)}", where="--fault",
                            remedy="give it another number: the controller of the demo cannot hold an arm with this one") from None
    logs = tuple(replace(log, recorded="2004-05-17T09:30:00Z") for log in session)
    return Result(logs[0].robot_name, faults,
                  tuple(Recorded(f"logs/{log.name}", log.experiment, log.role, log.n_samples, log) for log in logs))


def write(result: Result, folder: Path, request: Request) -> None:
    """The logs."""
    for item in result.logs:
        write_log(folder / f"{item.file}.{request.format}", item.log)


def hidden(result: Result) -> str:
    """What was hidden, in words: "cogging at joint 2 (order 18 per rev, amplitude 0.4 N m)"."""
    return "; ".join(map(_in_words, result.fault)) or "nothing"


def _in_words(fault: str) -> str:
    cause, joint = _place(fault)
    units = {q.name: unit_in_words(q.unit) for q in find_effect(cause).parameters}
    numbers = ", ".join(f"{spoken(key)} {format_number(float(value))} {units[key]}".strip() for key, value in _given(fault).items())
    return f"{named(cause, joint)} ({numbers})"


def _place(fault: str) -> tuple[str, int | None]:
    """The cause and its joint."""
    cause, *rest = fault.split(":")
    return cause, next((int(part) for part in rest if part and "=" not in part), None)


def _given(fault: str) -> dict[str, str]:
    """The numbers of a fault, as they were given."""
    pairs = (pair.split("=") for part in fault.split(":") if "=" in part for pair in part.split(",") if pair.strip())
    return {key.strip(): value for key, value in pairs}


def ending(result: Result, found: Diagnosis | None) -> tuple[str, ...]:
    """What was hidden and what was found, a line each; and what would show that of which such logs say nothing.

    Args:
        found: the diagnosis of the logs, None where none was made.
    """
    beyond = [] if found is None else list(_beyond(result, found))
    untold = "; and ".join(f"of {named(*_place(fault))} such logs say nothing: {without_keys(one.reason)}" for fault, one in beyond)
    return (f"Was hidden: {hidden(result)}.", f"Was found:  {_found(result, found)}{untold and f'; {untold}'}.",
            *(f"To see it:  {without_keys(record)}" for record in dict.fromkeys(one.record for _, one in beyond)))


def _beyond(result: Result, found: Diagnosis) -> Iterator[tuple[str, NotIdentifiable]]:
    """Each fault that is not found, for the logs cannot tell it."""
    told = {(one.cause, one.joint) for one in found.findings}
    for fault in result.fault:
        cause, joint = _place(fault)
        at = {joint} if find_effect(cause).evidence == "residual" else {joint, None}  # of the former None is: at all joints alike
        blind = (one for one in found.not_identifiable if one.cause == cause and one.joint in at)
        if (cause, joint) not in told and (one := next(blind, None)) is not None:
            yield fault, one


def _found(result: Result, found: Diagnosis | None) -> str:
    if found is None:
        return "unknown, for diagnose was not done"
    if found.verdict == "no-fault-found":
        return "nothing"
    if found.verdict == "cannot-judge":
        return "nothing, for these logs cannot be judged"
    asked = {_place(fault): _given(fault) for fault in result.fault}
    told = []
    for one in found.findings:
        names = asked.get((one.cause, one.joint), {})
        shown = [(name, value) for name, value in in_order(one.cause, one.parameters) if name in names or not names][:_NUMBERS]
        told.append(f"{named(one.cause, one.joint)} ({format_values(shown)})")
    return "; ".join(told) or "something that has no name here"


def report(result: Result) -> Report:
    """What was recorded, and what was hidden."""
    rows = tuple((item.file.removeprefix("logs/"), item.experiment, item.role, item.samples) for item in result.logs)
    verdict = f"{len(rows)} logs of {result.robot} were simulated; hidden in them: {hidden(result)}."
    return Report("Logs to try things on", verdict, "neutral", None,
                  (Section("Logs", ("The arm of Kostić et al. 2004 with synthetic links, Coulomb and viscous friction, a PD "
                                    "controller, noisy drives and encoders with steps.",),
                           (Table(("log", "experiment", "role", "samples"), rows),)),))


STAGE = Stage("demo", "Record logs to try things on", Settings, compute, report, read, write)
