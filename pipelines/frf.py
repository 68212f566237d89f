"""Measure frequency responses and classify compliance beside the rigid body.

Reads    logs with experiment "frf": a joint turning slowly under an injected excitation v, with r (computed torque) or PD
Writes   result.json, result.h5 (every response), report.html
Source   Kostić et al. 2004, Section IV.D, eq. (25)-(29), Fig. 17

Responses are those of v to input and position: no disturbance in the loop biases their quotient, and no controller has to be
known. The direct and the indirect method stand beside it. Base, joint, delay and rigid are told apart across postures.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.errors import Check, NothingMatched, UsageError
from pipelines.frequency.findings import Findings, frf_findings
from pipelines.frequency.grouping import GroupingConfig, advance
from pipelines.frequency.modes import BAND
from pipelines.frequency.responses import How, Measured
from pipelines.frequency.result import (
    COHERENCE,
    Classified,
    Method,
    Posture,
    Undecided,
    classified,
    methods_of,
    posture_of,
    undecided,
)
from pipelines.io.log import ExperimentLog, recording
from pipelines.io.model_file import read_model
from pipelines.io.option import option
from pipelines.quality.checks import Subject, accepted
from pipelines.report.frf_report import frf_report
from pipelines.report.report import Report
from pipelines.stage import Inputs, Request, Stage, Uses, read_logs

__all__ = ["STAGE", "Result", "Settings", "compute", "read", "report"]

_RECORD = ("let one joint turn slowly there and back with v injected, in two postures or more; design-excitation --experiment frf "
           "plans one, at home or where --home says")
_UNFOLDED = "log all signals by one clock at the controller's own rate; or thin them out behind the same low-pass"


@dataclass(frozen=True)
class FrfConfig:
    """Limits of warnings.

    Attributes:
        swing: of the turning speed, std of the speed that v makes; beyond it a normal swing turns friction's sign
            (four deviations) in one sample of 30,000 or more often
    """

    swing: float = 0.25


_CONFIG = FrfConfig()


@dataclass(frozen=True)
class Settings:
    """How responses are estimated, where modes are looked for, and what is drawn."""

    estimator: str = option("auto", "auto, multisine, local-polynomial or welch.")
    resolution: float | None = option(None, "Of the spectra [Hz]. [0.25, or one over the period]")
    low: float = option(BAND[0], "Modes are looked for from here [Hz].")
    high: float = option(BAND[1], "To here [Hz]. [250, or 0.3 of the rate]")
    model: str | None = option(None, "model.json whose inertia is expected. [the controller's own]")
    postures: tuple[int, ...] = option((), "Postures to draw, by their numbers: 1,3. [nearest to the two of Kostić et al. 2004]", "--posture")


@dataclass(frozen=True)
class Result:
    """Every response, and what they say together."""

    robot: str
    responses: tuple[Method, ...]
    postures: tuple[Posture, ...]
    classification: tuple[Classified, ...]
    undecided: tuple[Undecided, ...]
    drawn: tuple[int, ...]
    data_quality: tuple[Check, ...]


def read(request: Request, settings: Settings) -> Inputs:
    """The logs, and the model where one is named."""
    inputs = read_logs(request, settings)
    if settings.model is None:
        return inputs
    path = Path(settings.model).absolute()
    sources = (path,) if path.is_file() else ()  # a shipped model is not one of the user's files
    return replace(inputs, sources=(*inputs.sources, *sources), material=Arm.from_model(read_model(settings.model), path))


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Responses by three methods, modes, grouping.

    Raises:
        NothingMatched: C06, no frf log.
        UsageError: C02, settings that do not fit, or logs of several robots.
        InputRejected: the doctor rejects a log, or no spectrum can be taken of it: S01, T05, T08, D09.
    """
    if not 0.1 <= settings.low < settings.high:
        raise UsageError("C02", f"modes from {settings.low:g} to {settings.high:g} Hz", where="--low, --high",
                         remedy="give two frequencies, the lower one first, from 0.1 Hz on")
    _refuse_no_posture(settings, 0)
    logs = _chosen(inputs)
    arm = inputs.material if isinstance(inputs.material, Arm) and inputs.material.n_joints == logs[0].n_joints else None
    said = tuple(check for log in logs for check in accepted(Subject(log)))
    found = frf_findings(logs, arm, How(settings.estimator, settings.resolution), (settings.low, settings.high))
    postures = tuple(posture_of(seen) for seen in found.seen)
    _refuse_no_posture(settings, max(Counter(posture.joint for posture in postures).values(), default=0))
    return Result(logs[0].robot_name, tuple(m for seen in found.seen for m in methods_of(seen)), postures, classified(found),
                  undecided(found), settings.postures, (*said, *_complaints(found, settings)))


def _refuse_no_posture(settings: Settings, most: int) -> None:
    """C02: a number that no posture can have, or none of the `most` that a joint was recorded in; 0: not known yet."""
    if wrong := [number for number in settings.postures if number < 1 or 0 < most < number]:
        there = "they are counted from 1" if not most else "give 1" if most == 1 else f"give 1 to {most}"
        raise UsageError("C02", f"no joint has a posture {wrong[0]}", where="--posture",
                         remedy=f"{there}, as numbered in the report under 'How it was measured'")


def _chosen(inputs: Inputs) -> list[ExperimentLog]:
    """The "frf" logs that were measured; those of role "reference" only where there are no others."""
    logs = [recording(o.log) for o in inputs.logs if o.log.experiment == "frf" and o.log.origin != "planned"]
    now = [log for log in logs if log.role != "reference"] or logs
    if not now:
        kinds = ", ".join(sorted({o.log.experiment for o in inputs.logs})) or "none"
        raise NothingMatched("C06", f"no frf log; there are: {kinds}", where=inputs.label, remedy=_RECORD)
    if len({log.robot_text for log in now}) > 1:
        raise UsageError("C02", "logs of several robots", where=inputs.label,
                         remedy="name the logs of one; 'rrrid run' takes a folder of several apart")
    return now


def _complaints(found: Findings, settings: Settings) -> list[Check]:
    """D13, coherence too low; D09, friction that turns its sign."""
    said = []
    for one in found.unusable:
        if one.aliased:
            said.append(Check.of("T09", "warn", f"torque of joint {one.joint} was sampled, and v has power up to half the rate: "
                                 "what is faster has folded back (aliasing), and no mode can be identified", where=_logs_of(one),
                                 gate=True, remedy=_UNFOLDED))
            continue
        said.append(Check.of("D13", "warn", f"v tells nothing of joint {one.joint} from {settings.low:g} to {settings.high:g} Hz: "
                             "no frequency can be relied on, no mode is looked for", where=_logs_of(one), gate=True,
                             remedy="excite more strongly, record longer, or look for what disturbs the joint"))
    for joint in sorted({seen.measured.joint for seen in found.seen}):
        own = [seen for seen in found.seen if seen.measured.joint == joint]
        first = own[0].measured.first
        early = advance([seen.modes for seen in own], first.sample_time, first.held)
        if early is not None and max(seen.modes.flat for seen in own) < GroupingConfig().flat:
            said.append(Check.of("T06", "warn", f"joint {joint} moves {-1e3 * early.value:.3g} ms before its torque: torque and "
                                 "position have different clocks, or what is faster has folded back (aliasing)",
                                 where=", ".join(_logs_of(seen.measured) for seen in own), gate=True, remedy=_UNFOLDED))
    for seen in found.seen:
        m = seen.measured
        inside = m.plant.within(*seen.modes.band)
        low = float(np.mean(inside.coherence < COHERENCE))
        if low > 0.0:
            said.append(Check.of("D13", "warn", f"the coherence of joint {m.joint} is under {COHERENCE:g} at {100.0 * low:.2g} % "
                                 "of the frequencies of its excited band; they are shaded and hardly weigh", where=_logs_of(m),
                                 remedy="excite these frequencies more strongly, or record longer"))
        said += _turning(m.joint, m.first.speed, max(t.swing for t in m.turned), _logs_of(m))
    return said


def _logs_of(measured: Measured) -> str:
    return ", ".join(t.name for t in measured.turned)


def _turning(joint: int, speed: float, swing: float, where: str) -> Sequence[Check]:
    if speed == 0.0:
        return [Check.of("D09", "warn", f"joint {joint} did not turn: friction sticks, and looks like a spring in the response",
                         where=where, remedy="let it turn slowly while it is excited")]
    if swing > _CONFIG.swing * speed:
        return [Check.of("D09", "warn", f"the excitation swings the speed of joint {joint} by {swing:.2g} about {speed:.2g} rad/s: "
                         "friction now and then turns its sign, which adds damping", where=where,
                         remedy="turn faster, or excite more weakly")]
    return []


def report(result: Result) -> Report:
    """The verdict, Fig. 17's Bode plots with coherence, modes, rigid body, grouping."""
    return frf_report(result.responses, result.postures, result.classification, result.undecided, result.data_quality, result.drawn)


STAGE = Stage("frf", "Measure frequency responses and classify compliance", Settings, compute, report, read, None,
              lambda result, check: int(check and any(found.gate for found in result.data_quality)),
              lambda result: result.data_quality,
              uses=Uses(lambda log, settings: log.experiment == "frf", before=True), sessions="one")
