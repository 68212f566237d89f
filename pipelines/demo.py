"""Simulate an arm with something wrong at a joint, and run the whole workflow on its logs.

Reads    nothing
Writes   logs/, result.json with what was hidden in them, report.html
Source   Kostić et al. 2004, eq. (22) for the motion, Section III for the arm; causes.md

`rrrid demo` runs the whole workflow on these logs, and ends with the injected
and the identified faults.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from pipelines.diagnosis.result import Diagnosis, NotIdentifiable
from pipelines.effects import find_effect
from pipelines.errors import InputRejected, UsageError
from pipelines.io.files import write_log
from pipelines.io.log import ExperimentLog
from pipelines.io.option import option
from pipelines.io.results import NOT_STORED
from pipelines.report.config import REPORT
from pipelines.report.report import Report, Section, Table
from pipelines.report.style import format_number, unit_in_words
from pipelines.report.words import format_values, in_order, named, spoken, without_keys
from pipelines.simulation.example import FAULT, example_session
from pipelines.stage import Inputs, Request, Stage

__all__ = ["STAGE", "Recorded", "Result", "Settings", "compute", "ending", "hidden", "report"]


@dataclass(frozen=True)
class Settings:
    """Choose the injected faults, and the seed of motions and noise."""

    fault: tuple[str, ...] = option(
        (FAULT,),
        "What to hide: CAUSE:JOINT:NAME=VALUE,…, or none. Repeatable. [cogging at joint 2]",
        causes=True,
    )
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
    """The logs, and the faults injected in them."""

    robot: str
    fault: tuple[str, ...]
    logs: tuple[Recorded, ...]


def read(request: Request, settings: Settings) -> Inputs:
    """Return no input at all."""
    return Inputs(label="demo", robot_name="rrr-tue")


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Simulate the session.

    Raises:
        UsageError: C01, C02, no such fault; a negative seed.
        InputRejected: the arm runs away with it (D17), or is no arm.
    """
    if settings.seed < 0:
        raise UsageError(
            "C02", f"the seed {settings.seed} is negative", where="--seed", remedy="give 0 or more"
        )
    faults = tuple(text for text in settings.fault if text != "none")
    try:
        session = example_session(*faults, seed=settings.seed)
    except InputRejected as problem:
        if problem.code != "RRID-D17":
            raise
        words = f"{problem.message}, with {' '.join(faults)}"
        remedy = (
            "give it another number: the controller of the demo cannot hold an arm with this one"
        )
        raise InputRejected("D17", words, where="--fault", remedy=remedy) from None
    logs = []
    for log in session:
        log = replace(log, recorded="2004-05-17T09:30:00Z")
        logs.append(Recorded(f"logs/{log.name}", log.experiment, log.role, log.n_samples, log))
    return Result(session[0].robot_name, faults, tuple(logs))


def write(result: Result, folder: Path, request: Request) -> None:
    """Write the logs."""
    for item in result.logs:
        write_log(folder / f"{item.file}.{request.format}", item.log)


def hidden(result: Result) -> str:
    """Name the injected faults: "cogging at joint 2 (order 18 per rev, amplitude 0.4 N m)"."""
    return "; ".join(map(_in_words, result.fault)) or "nothing"


def _in_words(fault: str) -> str:
    cause, joint = _place(fault)
    units = {q.name: unit_in_words(q.unit) for q in find_effect(cause).parameters}
    given = {key: format_number(float(value)) for key, value in _given(fault).items()}
    numbers = [f"{spoken(key)} {value} {units[key]}".strip() for key, value in given.items()]
    return f"{named(cause, joint)} ({', '.join(numbers)})"


def _place(fault: str) -> tuple[str, int | None]:
    """Return the cause and its joint."""
    cause, *rest = fault.split(":")
    return cause, next((int(part) for part in rest if part and "=" not in part), None)


def _given(fault: str) -> dict[str, str]:
    """Return the numbers of a fault, as they were given."""
    parts = ",".join(part for part in fault.split(":") if "=" in part).split(",")
    pairs = (part.partition("=") for part in parts if part.strip())
    return {key.strip(): value for key, _, value in pairs}


def ending(result: Result, found: Diagnosis | None) -> tuple[str, ...]:
    """Return the injected faults, the findings, and the experiments for faults not found.

    Args:
        found: the diagnosis of the logs, None where none was made.
    """
    hopeless = [] if found is None else list(_not_identifiable(result, found))
    words = [_found(result, found)]
    for k, (fault, one) in enumerate(hopeless):
        reason = f"of {named(*_place(fault))} such logs say nothing: {without_keys(one.reason)}"
        words.append(f"and {reason}" if k else reason)
    experiments = dict.fromkeys(one.record for _, one in hopeless)
    lines = [f"Was hidden: {hidden(result)}.", f"Was found:  {'; '.join(words)}."]
    return (*lines, *(f"To see it:  {without_keys(record)}" for record in experiments))


def _not_identifiable(result: Result, found: Diagnosis) -> Iterator[tuple[str, NotIdentifiable]]:
    """Yield each fault that was not found because these logs cannot show it."""
    causes = {(one.cause, one.joint) for one in found.findings}
    for fault in result.fault:
        cause, joint = _place(fault)
        # in a residual, joint None stands for all joints alike
        joints = {joint} if find_effect(cause).evidence == "residual" else {joint, None}
        blind = [o for o in found.not_identifiable if o.cause == cause and o.joint in joints]
        if blind and (cause, joint) not in causes:
            yield fault, blind[0]


def _found(result: Result, found: Diagnosis | None) -> str:
    if found is None:
        return "unknown, for diagnose was not done"
    if found.verdict == "no-fault-found":
        return "nothing"
    if found.verdict == "cannot-judge":
        return "nothing, for these logs cannot be judged"
    asked = {_place(fault): _given(fault) for fault in result.fault}
    words = []
    for one in found.findings:
        names = asked.get((one.cause, one.joint), {})
        numbers = in_order(one.cause, one.parameters)
        shown = [(name, value) for name, value in numbers if name in names or not names]
        values = format_values(shown[: REPORT.fault_numbers])
        words.append(f"{named(one.cause, one.joint)} ({values})")
    return "; ".join(words) or "something that has no name here"


def report(result: Result) -> Report:
    """Return the list of logs, and what is hidden in them."""
    names = (item.file.removeprefix("logs/") for item in result.logs)
    pairs = zip(names, result.logs, strict=True)
    rows = tuple((name, item.experiment, item.role, item.samples) for name, item in pairs)
    verdict = (
        f"{len(rows)} logs of {result.robot} were simulated; hidden in them: {hidden(result)}."
    )
    text = "The arm of Kostić et al. 2004 with synthetic links, Coulomb and viscous friction, a PD "
    text += "controller, noisy drives and encoders with steps."
    section = Section("Logs", (text,), (Table(("log", "experiment", "role", "samples"), rows),))
    return Report("Logs to try things on", verdict, "neutral", None, (section,))


STAGE = Stage("demo", "Record logs to try things on", Settings, compute, report, read, write)
