"""Record logs to try things on: the shipped arm in simulation, with something wrong at one of its joints.

Reads    nothing
Writes   logs/, result.json with what was hidden in them, report.html
Source   Kostić et al. 2004, eq. (22) for the motion, Section III for the arm; causes.md for what can be hidden

`rrrid demo` runs the whole workflow on these logs and says then what was hidden.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from pipelines.errors import UsageError
from pipelines.log.experiment import ExperimentLog
from pipelines.log.files import write_log
from pipelines.log.results import NOT_STORED
from pipelines.model.effects import find_effect
from pipelines.model.simulation.example import FAULT, example_session
from pipelines.report.report import Report, Section, Table
from pipelines.report.style import format_number, format_unit
from pipelines.stage import Inputs, Request, Stage

__all__ = ["STAGE", "Recorded", "Result", "Settings", "compute", "hidden", "report"]


@dataclass(frozen=True)
class Settings:
    """What is hidden, and which motions and which noise there are."""

    fault: tuple[str, ...] = (FAULT,)  # CAUSE:JOINT:NAME=VALUE,…; none: the arm is in order
    seed: int = 1


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
        InputRejected: D17, the arm runs away with it.
    """
    if settings.seed < 0:
        raise UsageError("C02", f"the seed {settings.seed} is negative", where="--seed", remedy="give 0 or more")
    faults = tuple(text for text in settings.fault if text != "none")
    logs = tuple(replace(log, recorded="2004-05-17T09:30:00Z") for log in example_session(*faults, seed=settings.seed))
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
    name, *rest = fault.split(":")
    kind = find_effect(name)
    units = {q.name: _unit(q.unit) for q in kind.parameters}
    place = "".join(f" at joint {part}" for part in rest if "=" not in part)
    given = dict(pair.split("=") for part in rest if "=" in part for pair in part.split(",") if pair.strip())
    numbers = ", ".join(f"{key.strip().replace('_', ' ')} {format_number(float(value))}{units[key.strip()]}"
                        for key, value in given.items())
    return f"{kind.title[:1].lower()}{kind.title[1:]}{place} ({numbers})"


def _unit(unit: str) -> str:
    """Behind a number in a sentence: " N m", " per rev", nothing for a ratio."""
    return "" if unit == "1" else f" per {unit[2:]}" if unit.startswith("1/") else f" {format_unit(unit)}"


def report(result: Result) -> Report:
    """What was recorded, and what was hidden."""
    rows = tuple((item.file.removeprefix("logs/"), item.experiment, item.role, item.samples) for item in result.logs)
    verdict = f"{len(rows)} logs of {result.robot} were simulated; hidden in them: {hidden(result)}."
    return Report("Logs to try things on", verdict, "neutral", None,
                  (Section("Logs", ("The arm of Kostić et al. 2004 with synthetic links, Coulomb and viscous friction, a PD "
                                    "controller, noisy drives and encoders with steps.",),
                           (Table(("log", "experiment", "role", "samples"), rows),)),))


STAGE = Stage("demo", "Record logs to try things on", Settings, compute, report, read, write)
