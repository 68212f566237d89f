"""Simulate a model in the experiment of a log, optionally with a fault.

Reads    a model file, and the logs to imitate: any but plans whose controller is not described
Writes   logs/<name>.h5 or .parquet as the model would have produced them, result.json, result.h5
Source   Kostić et al. 2004, eq. (4), (23)-(27); classical Runge-Kutta method, step by halving

A log that describes its controller is simulated in closed loop: same controller, references,
encoders. Any other is simulated in short windows, from the reconstructed state under the logged
torque; windows make no log.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.dynamics.named_cause import acting_cause
from pipelines.errors import Check, NothingMatched, UsageError
from pipelines.io.files import write_log
from pipelines.io.log import Array, ExperimentLog, recording
from pipelines.io.model_file import read_model
from pipelines.io.option import option
from pipelines.io.results import encode
from pipelines.quality.checks import Subject, accepted
from pipelines.report.config import REPORT
from pipelines.report.report import Report
from pipelines.report.simulation_report import simulation_report
from pipelines.simulation.imitate import How, Imitation, imitate
from pipelines.stage import Inputs, Request, Stage, read_logs, slug

__all__ = ["STAGE", "Result", "Settings", "compute", "read", "report"]

_NAME_ONE = "name one: --replay LOG"


@dataclass(frozen=True)
class Settings(How):
    """Choose the model, its faults, and how the logs are imitated."""

    model: str = option("", "The model.json of estimate-bps, or the shipped 'rrr'.", "MODEL")
    fault: tuple[str, ...] = option(
        (),
        "CAUSE:JOINT:NAME=VALUE,…: quadratic_drag:2:coefficient=0.1. Repeatable. All causes are "
        "listed below; a wrong NAME is refused with a list of the right ones.",
        causes=True,
    )


@dataclass(frozen=True)
class Result:
    """All logs that were imitated."""

    model: str
    others: tuple[str, ...]  # robots of the logs that are not the model's
    faults: tuple[str, ...]  # as they were written
    logs: tuple[Imitation, ...]
    # [rad] measured minus reference, of each log that was simulated in closed loop
    tracking_rms: tuple[Array | None, ...]
    data_quality: tuple[Check, ...]  # what the logs are like


def read(request: Request, settings: Settings) -> Inputs:
    """Read the model, and the logs to imitate.

    Raises:
        UsageError: C02, no model was named, or one without inertia; C04, no such file.
    """
    if not settings.model:
        remedy = "name a model.json, or the shipped 'rrr'"
        raise UsageError("C02", "no model", where="simulate", remedy=remedy)
    if not request.paths:
        raise UsageError("C02", "no log to imitate", where="simulate", remedy=_NAME_ONE)
    inputs = read_logs(request, settings)
    path = Path(settings.model).absolute()
    sources = (path,) if path.is_file() else ()  # a shipped model is not one of the user's files
    arm = Arm.from_model(read_model(settings.model), path)
    if not arm.p.any() and not arm.effects:
        words = f"the model {path.name} holds friction alone, no inertia"
        remedy = "name the model.json of estimate-bps"
        raise UsageError("C02", words, where="simulate", remedy=remedy)
    return replace(inputs, sources=(*inputs.sources, *sources), material=arm)


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Imitate every log.

    Raises:
        NothingMatched: C06, there is no log.
        UsageError: C01, C02, settings, faults or a model that do not fit.
        InputRejected: D17, the simulated arm runs away; S22, a plan whose controller is not
            described; what a log lacks.
    """
    if not inputs.logs:
        raise NothingMatched("C06", "no log to imitate", where=inputs.label, remedy=_NAME_ONE)
    nominal: Arm = inputs.material
    arm = nominal.extended(*(acting_cause(text, nominal.robot.revolute) for text in settings.fault))
    recorded = encode(replace(settings, model=Path(settings.model).name))[0]
    found: list[Imitation] = []
    checks: list[Check] = []
    taken: set[str] = set()
    for opened in inputs.logs:
        stem = slug(opened.path.stem)
        while taken & (names := _names(stem, settings.replicas)):
            stem += "+"
        taken |= names
        if opened.log.origin != "planned":
            checks += accepted(Subject(recording(opened.log)))
        drawn = len(found) < REPORT.simulated
        one = imitate(opened.log, arm, settings, f"logs/{stem}", recorded, drawn)
        found.append(replace(one, source=opened.path.name))
    pairs = zip(inputs.logs, found, strict=True)
    return Result(
        model=nominal.name,
        others=tuple(sorted({o.log.robot.name for o in inputs.logs} - {nominal.robot.name})),
        faults=settings.fault,
        logs=tuple(found),
        tracking_rms=tuple(_tracking(opened.log, one) for opened, one in pairs),
        data_quality=tuple(checks),
    )


def _names(stem: str, replicas: int) -> set[str]:
    """Return the names of the simulated logs of one log, which another log could have: "run-2"."""
    return {stem, *(f"{stem}-{k + 1}" for k in range(1, replicas))}


def _tracking(log: ExperimentLog, one: Imitation) -> Array | None:
    """Return the RMS (joints,) of measured minus reference position; feedback keeps it small."""
    if one.position_rms is None or one.simulation == "windowed" or "q_ref" not in log:
        return None
    return np.asarray(np.sqrt(np.nanmean((log.q - log["q_ref"]) ** 2, axis=0)))


def _checks(result: Result) -> tuple[Check, ...]:
    """Return the checks of the logs, and why a log could not be simulated in closed loop."""
    found = list(result.data_quality)
    for one in result.logs:
        if one.simulation == "windowed" and one.reason != "asked for":
            words = f"simulated in windows of {one.window:.3g} s: {one.reason}"
            remedy = "describe the controller in the log to simulate it in closed loop"
            found.append(Check.of("S22", "warn", words, where=one.source, remedy=remedy))
    return tuple(found)


def write(result: Result, folder: Path, request: Request) -> None:
    """Write every simulated log, in the container that `request` names."""
    for one in result.logs:
        for file, log in zip(one.files, one.logs, strict=True):
            request.tell(f"writing {file}")
            write_log(folder / f"{file}.{request.format}", log)


def report(result: Result) -> Report:
    """Return measured and simulated position, speed and torque, their difference, its spectrum."""
    model = result.model
    if result.others:
        model += f" in logs of {', '.join(result.others)}"
    return simulation_report(model, result.faults, result.logs, result.tracking_rms)


STAGE = Stage(
    "simulate",
    "Simulate a model",
    Settings,
    compute,
    report,
    read,
    write,
    checks=_checks,
    sessions="folder",
)
