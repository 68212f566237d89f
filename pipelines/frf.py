"""Measure frequency responses and classify compliance beside the rigid body.

Reads    logs with experiment "frf": a joint turning slowly under an injected excitation v, with r
         (computed torque) or PD
Writes   result.json, result.h5 (every response), report.html
Source   Kostić et al. 2004, Section IV.D, eq. (25)-(29), Fig. 17

Responses are those of v to input and position: no disturbance in the loop biases their quotient,
and no controller has to be known. The direct and the indirect method are compared with it. Base,
joint, delay and rigid are distinguished across postures.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.errors import Check, NothingMatched, UsageError
from pipelines.frequency.config import GroupingConfig, ReportConfig
from pipelines.frequency.findings import Findings, frf_findings
from pipelines.frequency.grouping import Finding, Open, delay_of
from pipelines.frequency.modes import BAND
from pipelines.frequency.responses import Measured
from pipelines.frequency.result import COHERENCE, Method, Posture, methods_of, posture_of
from pipelines.frequency.spectra import inside
from pipelines.io.log import ExperimentLog, recording
from pipelines.io.model_file import read_model
from pipelines.io.option import option
from pipelines.quality.checks import Subject, accepted
from pipelines.report.frf_report import frf_report
from pipelines.report.report import Report
from pipelines.stage import Inputs, Request, Stage, Uses, read_logs

__all__ = ["STAGE", "Result", "Settings", "compute", "read", "report"]

_RECORD = (
    "let one joint turn slowly there and back with v injected, in two postures or more; "
    "design-excitation --experiment frf plans one, at home or where --home says"
)
_UNFOLDED = (
    "log all signals by one clock at the controller's own rate; or thin them out behind the same "
    "low-pass"
)
_DRAWN = "Postures to draw, by their numbers: 1,3. [nearest to the two of Kostić et al. 2004]"
_LOWEST = 0.1  # numerics: [Hz] slower than any arm


@dataclass(frozen=True)
class Settings:
    """Where modes are looked for, and what is drawn."""

    low: float = option(BAND[0], "Modes are looked for from here [Hz].")
    high: float = option(BAND[1], "To here [Hz]. [250, or 0.3 of the rate]")
    model: str | None = option(None, "model.json whose inertia is expected. [the controller's own]")
    postures: tuple[int, ...] = option((), _DRAWN, "--posture")


@dataclass(frozen=True)
class Result:
    """Every response, and the classification of all."""

    robot: str
    responses: tuple[Method, ...]
    postures: tuple[Posture, ...]
    classification: tuple[Finding, ...]
    undecided: tuple[Open, ...]
    drawn: tuple[int, ...]
    data_quality: tuple[Check, ...]


def read(request: Request, settings: Settings) -> Inputs:
    """Read the logs, and the model where one is named."""
    inputs = read_logs(request, settings)
    if settings.model is None:
        return inputs
    path = Path(settings.model).absolute()
    # a shipped model is not one of the user's files
    sources = (*inputs.sources, path) if path.is_file() else inputs.sources
    return replace(
        inputs, sources=sources, material=Arm.from_model(read_model(settings.model), path)
    )


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Estimate responses by three methods, their modes, and what bends.

    Raises:
        NothingMatched: C06, no frf log.
        UsageError: C02, settings that do not fit, or logs of several robots.
        InputRejected: `inspect` rejects a log, or no spectrum can be taken of it: S01, T05, T08,
            D09.
    """
    band = (settings.low, settings.high)
    if not _LOWEST <= settings.low < settings.high:
        words = f"modes from {settings.low:g} to {settings.high:g} Hz"
        remedy = "give two frequencies, the lower one first, from 0.1 Hz on"
        raise UsageError("C02", words, where="--low, --high", remedy=remedy)
    logs, arm = _chosen(inputs), inputs.material
    if not isinstance(arm, Arm) or arm.n_joints != logs[0].n_joints:
        arm = None
    checks = tuple(check for log in logs for check in accepted(Subject(log)))
    found = frf_findings(logs, arm, band)
    counts = Counter(seen.measured.joint for seen in found.seen)
    wrong = [k for k in settings.postures if not 1 <= k <= max(counts.values(), default=k)]
    if wrong:
        remedy = "give numbers as in the report under 'How it was measured', from 1 on"
        raise UsageError("C02", f"no joint has a posture {wrong[0]}", "--posture", remedy=remedy)
    return Result(
        robot=logs[0].robot_name,
        responses=tuple(m for seen in found.seen for m in methods_of(seen)),
        postures=tuple(posture_of(seen) for seen in found.seen),
        classification=found.classification,
        undecided=found.undecided,
        drawn=settings.postures,
        data_quality=(*checks, *_complaints(found)),
    )


def _chosen(inputs: Inputs) -> list[ExperimentLog]:
    """Return the "frf" logs that were measured; of role "reference" only without others."""
    every = [opened.log for opened in inputs.logs]
    logs = [recording(o) for o in every if o.experiment == "frf" and o.origin != "planned"]
    now = [log for log in logs if log.role != "reference"] or logs
    if not now:
        kinds = ", ".join(sorted({o.experiment for o in every})) or "none"
        words = f"no frf log; there are: {kinds}"
        raise NothingMatched("C06", words, where=inputs.label, remedy=_RECORD)
    if len({log.robot_text for log in now}) > 1:
        remedy = "name the logs of one; 'rrrid run' takes a folder of several apart"
        raise UsageError("C02", "logs of several robots", where=inputs.label, remedy=remedy)
    return now


def _complaints(found: Findings) -> list[Check]:
    """T09, T06, what has folded back; D13, coherence too low; D09, friction that turns its sign."""
    checks = []

    def warn(code: str, words: str, measured: Measured, remedy: str, gate: bool = False) -> None:
        where = ", ".join(t.name for t in measured.turned)
        checks.append(Check.of(code, "warn", words, where=where, gate=gate, remedy=remedy))

    for m in found.unusable:
        if m.aliased:
            words = f"torque of joint {m.joint} was sampled, and v has power up to half the rate: "
            words += "what is faster has folded back (aliasing), and no mode can be identified"
            warn("T09", words, m, _UNFOLDED, gate=True)
        else:
            words = f"v tells too little of joint {m.joint}: no mode is looked for"
            remedy = "excite more strongly, record longer, or look for what disturbs the joint"
            warn("D13", words, m, remedy, gate=True)
    config = GroupingConfig()
    for seen in found.seen:
        m, first = seen.measured, seen.measured.first
        late = delay_of([seen.modes], first.sample_time, first.held, config)
        if late is not None and late.value < 0.0 and seen.modes.flat < config.flat:
            words = f"joint {m.joint} moves {-1e3 * late.value:.3g} ms before its torque: torque "
            words += "and position have different clocks, or what is faster has folded back "
            warn("T06", f"{words}(aliasing)", m, _UNFOLDED, gate=True)
        plant = m.plant.within(*seen.modes.band)
        low = np.mean(plant.coherence[inside(m.excited, plant.frequency)] < COHERENCE)
        if low > 0.0:
            words = f"the coherence of joint {m.joint} is under {COHERENCE:g} at {100.0 * low:.2g} "
            words += "% of the frequencies of its excited band; they are shaded and hardly weigh"
            warn("D13", words, m, "excite these frequencies more strongly, or record longer")
        swing = max(t.swing for t in m.turned)
        if swing > ReportConfig().swing * first.speed:
            words = f"the excitation swings the speed of joint {m.joint} by {swing:.2g} about "
            words += f"{first.speed:.2g} rad/s: friction turns its sign, which adds damping; or it "
            words += "sticks, which looks like a spring"
            warn("D09", words, m, "let the joint turn slowly and faster, or excite more weakly")
    return checks


def report(result: Result) -> Report:
    """Report the verdict, Fig. 17's Bode plots with coherence, modes, rigid body, grouping."""
    return frf_report(
        result.responses,
        result.postures,
        result.classification,
        result.undecided,
        result.data_quality,
        result.drawn,
    )


STAGE = Stage(
    "frf",
    "Measure frequency responses and classify compliance",
    Settings,
    compute,
    report,
    read,
    None,
    lambda result, check: int(check and any(found.gate for found in result.data_quality)),
    lambda result: result.data_quality,
    uses=Uses(lambda log, settings: log.experiment == "frf", before=True),
    sessions="one",
)
