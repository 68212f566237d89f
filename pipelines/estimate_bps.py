"""Estimate the base parameter set by least squares.

Reads    logs with experiment "excitation" or "free", role "identify"; every log of role "validate" judges;
         optionally a model with friction
Writes   result.json, result.h5, model.json, logs/ with the model's torque and the residual, report.html
Source   Kostić et al. 2004, eq. (12)-(15), Table V, Figs. 9, 11, 12
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pipelines.errors import Check, NothingMatched, UsageError
from pipelines.fit.identifiability import hard_to_see
from pipelines.log.atomic import write_file
from pipelines.log.canonical import digest_of
from pipelines.log.derive import derive, recording
from pipelines.log.experiment import Array, ExperimentLog
from pipelines.log.files import write_log
from pipelines.log.model_file import ModelFile, Source, model_text
from pipelines.log.results import NOT_STORED, encode
from pipelines.model.arm import ArmTorque
from pipelines.model.estimation.checks import Balance, Consistent, consistency, power_balance
from pipelines.model.estimation.compare import Compared, compare
from pipelines.model.estimation.logs import Recipe, fit_logs, judge
from pipelines.model.estimation.nominal import fitted_arm, nominal_columns
from pipelines.model.estimation.outcome import Course, Direction, Estimated, course, parameters, validity
from pipelines.model.estimation.outcome import torques as torque_parts
from pipelines.model.motion import Reconstructed
from pipelines.model.tuned import Reconstruction
from pipelines.report.bps import convergence_figure, torque_figure
from pipelines.report.report import Report, Section, Table, Tone
from pipelines.report.style import with_std
from pipelines.stage import Inputs, Request, Stage, read_logs, slug

__all__ = ["STAGE", "Result", "Settings", "compute", "report"]

FITTED = ("excitation", "free")
_COURSES = 3  # logs drawn
_GOOD = 0.1  # relative torque error that is worth calling good


@dataclass(frozen=True)
class Settings:
    """How motion is reconstructed (as `reconstruct`), what is done alike to torque and columns, and what is estimated."""

    method: str = Reconstruction.method
    order: int = Reconstruction.order
    jerk_std: tuple[float, ...] | None = None  # [rad/s^order]
    bandwidth: tuple[float, ...] | None = None  # [Hz]
    filter: float | None = None  # [Hz] low-pass over torque and columns; None: five times the motion's highest frequency
    decimate: int | None = None  # every so-manieth sample; None: four a period of the filter
    min_speed: tuple[float, ...] = (0.0,)  # [rad/s] slower samples of a joint are left out of its own equations
    symmetric: bool = False  # p4 = p15 = 0
    weighted: bool = True  # joints by their own residual; False: all alike
    offset: bool = True
    rotor_inertia: bool | None = None  # None: on geared arms
    blocks: int = 10  # held out in turn where no log is
    compare: bool = True  # the four ways to reconstruct, side by side

    @property
    def reconstruction(self) -> Reconstruction:
        return Reconstruction(self.method, self.order, self.jerk_std, self.bandwidth)


@dataclass(frozen=True)
class Result:
    """Everything estimated."""

    robot: str
    joints: tuple[str, ...]
    parameters: tuple[Estimated, ...]
    condition_number: float
    condition_number_fit: float
    rank: int
    relative_error: dict[str, float]  # identify, validate
    torque_rms: dict[str, tuple[float, ...]]  # [N m] of the residual, per joint
    torque_signal_rms: dict[str, tuple[float, ...]]  # [N m]
    held_out: str  # "logs" | "blocks"
    filter_hz: float | None
    samples: int  # equations a joint
    physically_consistent: bool
    consistency: Consistent
    balance: Balance | None
    unresolved: str  # words; empty where everything shows
    hard_to_see: tuple[Direction, ...]
    comparison: tuple[Compared, ...]
    convergence_samples: tuple[int, ...]
    convergence: Array  # (counts, parameters)
    convergence_std: Array
    courses: tuple[Course, ...]
    model: ModelFile = field(metadata=NOT_STORED, repr=False)
    derived: tuple[tuple[str, ExperimentLog], ...] = field(metadata=NOT_STORED, repr=False)


def compute(inputs: Inputs, settings: Settings) -> Result:
    """Fit, judge, check.

    Raises:
        NothingMatched: no log to fit.
        UsageError: logs of several robots.
        InputRejected: no stretch of a log can be used.
    """
    identify, validate = _chosen(inputs)
    columns = nominal_columns(identify[0].robot, offset=settings.offset, rotor_inertia=settings.rotor_inertia,
                              symmetric=settings.symmetric)
    recipe = Recipe(settings.reconstruction, settings.filter, settings.decimate, settings.min_speed)
    fitted = fit_logs(identify, columns, recipe, settings.weighted)
    judged = judge(fitted, validate, settings.blocks)
    found = fitted.estimate
    arm = fitted_arm(columns, np.where(found.solution.determined, found.beta, 0.0), found.std, found.visible,
                     identify[0].robot_name)
    both = {"identify": found.solution.errors, "validate": judged.errors}
    torques = [(log, motion, torque_parts(arm, log, motion)) for log, motion in (*fitted.motions, *judged.motions)]
    growth, checked = found.convergence(), consistency(found, arm.body)
    names = [column.name for column in columns.names]
    return Result(
        robot=identify[0].robot_name, joints=tuple(joint.name for joint in arm.robot.joints), parameters=parameters(fitted, arm),
        condition_number=found.condition_number, condition_number_fit=found.solution.condition, rank=found.solution.rank,
        relative_error={key: e.relative_error for key, e in both.items()},
        torque_rms={key: tuple(map(float, e.rms)) for key, e in both.items()},
        torque_signal_rms={key: tuple(map(float, e.signal_rms)) for key, e in both.items()},
        held_out=judged.by, filter_hz=fitted.recipe.cutoff_hz, samples=found.statistics.samples,
        physically_consistent=checked.consistent, consistency=checked, balance=power_balance(fitted),
        unresolved=str(found.unresolved) if found.unresolved.parameters else "",
        hard_to_see=tuple(Direction(d.singular_value, d.weights) for d in hard_to_see(found.solution, names)),
        comparison=compare(identify, validate, columns, fitted, settings.blocks) if settings.compare else (),
        convergence_samples=growth.samples, convergence=growth.beta, convergence_std=growth.std,
        courses=tuple(course(log, parts) for log, _, parts in torques[:_COURSES]),
        model=arm.to_model(validity=validity(fitted.motions), sources=_sources(identify, validate),
                           notes=(f"fitted by rrrid estimate-bps, motion by {settings.method}",)),
        derived=tuple(_derived(log, motion, parts, settings) for log, motion, parts in torques))


def _chosen(inputs: Inputs) -> tuple[list[ExperimentLog], list[ExperimentLog]]:
    logs = [opened.log for opened in inputs.logs if opened.log.origin != "planned"]
    identify = [log for log in logs if log.role == "identify" and log.experiment in FITTED]
    if not identify:
        kinds = ", ".join(sorted({f"{log.experiment} ({log.role})" for log in logs})) or "none"
        raise NothingMatched("C06", f"no excitation or free log of role identify; there are: {kinds}", where=inputs.label,
                             remedy="record an excitation, or give the folder that has one")
    if len({log.robot_text for log in logs}) > 1:
        raise UsageError("C02", "logs of several robots", where=inputs.label,
                         remedy="name the logs of one; 'rrrid run' takes a folder of several apart")
    return identify, [log for log in logs if log.role == "validate"]


def _derived(log: ExperimentLog, motion: Reconstructed, parts: ArmTorque, settings: Settings) -> tuple[str, ExperimentLog]:
    with_motion = derive(log, "reconstruct", settings.reconstruction.as_settings(), motion.signals())
    total = parts.total
    signals = {"tau_model": total, "tau_inertia": parts.inertia, "tau_coriolis": parts.coriolis, "tau_gravity": parts.gravity,
               "tau_friction_model": parts.friction, "tau_effects": parts.effects, "tau_residual": log.tau - total}
    return slug(log.name), derive(with_motion, "estimate-bps", encode(settings)[0], signals)


def _sources(identify: list[ExperimentLog], validate: list[ExperimentLog]) -> tuple[Source, ...]:
    """The recordings behind the model, by the digest that is theirs in either container and in every derived log."""
    return tuple(Source(log.name, digest_of(recording(log)), log.experiment, log.role) for log in (*identify, *validate))


def _checks(result: Result) -> tuple[Check, ...]:
    found = []
    if result.unresolved:
        found.append(Check.of("D09", "warn", result.unresolved, where=result.robot, gate=True,
                              remedy="move the joints concerned further and faster, in more postures"))
    if not result.physically_consistent:
        links = ", ".join(result.consistency.violating)
        found.append(Check.of("D15", "warn", f"no links that could exist have these parameters ({result.consistency.distance:.1f} "
                              f"standard deviations away); {links} would need negative mass or inertia",
                              where=result.robot, gate=True,
                              remedy="look for an effect that the model lacks, or for wrong units and signs"))
    return tuple(found)


def write(result: Result, folder: Path, request: Request) -> None:
    """model.json, and every log with the model's torque and the residual."""
    write_file(folder / "model.json", lambda draft: _text(draft, model_text(result.model)))
    for name, log in result.derived:
        write_log(folder / f"logs/{name}.{request.format}", log)


def _text(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def report(result: Result) -> Report:
    """The verdict, Table V with standard deviations, and what the estimate rests on."""
    sections = [_parameter_section(result), _course_section(result), _trust_section(result)]
    if result.comparison:
        sections.append(_comparison_section(result))
    return Report("Base parameters", _verdict(result), _tone(result), _key_figures(result), tuple(sections))


def _tone(result: Result) -> Tone:
    error = result.relative_error["validate"]
    return "bad" if result.unresolved or not result.physically_consistent else "good" if error < _GOOD else "attention"


def _verdict(result: Result) -> str:
    judged = "held-out logs" if result.held_out == "logs" else "held-out blocks of the fitted logs, for none has role validate,"
    if result.unresolved:
        return f"These logs do not determine the model: {result.unresolved}."
    shown = sum(p.visible for p in result.parameters)
    text = (f"{shown} of {len(result.parameters)} parameters are clearly visible; the model explains the torque of {judged} "
            f"to {100 * result.relative_error['validate']:.2g} %.")
    return text if result.physically_consistent else f"{text} No links that could exist have these parameters."


def _key_figures(result: Result) -> Table:
    rows = (("relative torque error, fitted logs [%]", 100 * result.relative_error["identify"]),
            (f"relative torque error, held-out {result.held_out} [%]", 100 * result.relative_error["validate"]),
            ("equations a joint", result.samples), ("condition number of the rigid columns", result.condition_number),
            ("condition number of the fit, unit columns", result.condition_number_fit),
            ("low-pass over torque and columns [Hz]", result.filter_hz),
            ("links that could exist", "yes" if result.physically_consistent else "no"))
    return Table(("what", "figure"), rows)


def _parameter_section(result: Result) -> Section:
    known = any(p.known is not None for p in result.parameters)
    columns = ("parameter", "value ± std", "unit", "seen", "stands for", *(("from the described links",) if known else ()))
    rows = [(p.name, "not determined" if p.value is None or p.std is None else with_std(p.value, p.std), p.unit,
             "clearly" if p.visible else "barely" if p.value is not None else "no", p.combination, *((p.known,) if known else ()))
            for p in result.parameters]
    tones: tuple[Tone, ...] = tuple(
        "good" if p.visible else "bad" if p.value is None else "attention" for p in result.parameters)
    return Section("Parameters", ("Standard deviations allow for a residual whose samples depend on one another.",),
                   (Table(columns, tuple(rows), "Table V of the paper, with what each stands for.", tones),))


def _course_section(result: Result) -> Section:
    left, whole = result.torque_rms, result.torque_signal_rms["validate"]
    rows = tuple((name, left["identify"][j], left["validate"][j], whole[j], 100 * left["validate"][j] / whole[j] if whole[j] else None)
                 for j, name in enumerate(result.joints))
    table = Table(("joint", "residual, fitted [N m]", "residual, held out [N m]", "torque, held out [N m]", "relative [%]"), rows,
                  "Root mean squares, after the low-pass.")
    figures = [torque_figure(f"torque-{c.name}", f"{c.name} ({c.role}): measured torque, the model's, its friction, "
                                                 f"and what is left.",
                             c.t, c.measured, c.model, c.friction, result.joints) for c in result.courses]
    return Section("Torque along the experiment", (), (table,), tuple(figures))


def _trust_section(result: Result) -> Section:
    weak = Table(("singular value", "combination"), tuple(
        (d.singular_value, " ".join(f"{weight:+.2f} {name}" for name, weight in d.parameters[:4])) for d in result.hard_to_see),
        "The directions that these logs show worst; 1 is a column on its own.")
    rules = Table(("condition", "value", "holds"), tuple(
        (i.condition, with_std(i.value, i.std), "yes" if i.holds else "no") for i in result.consistency.inequalities))
    names = tuple(p.name for p in result.parameters)
    tables = [weak, *([rules] if rules.rows else [])]
    text = []
    if result.balance is not None:
        text.append(f"The balance of power, which needs no acceleration, gives "
                    f"{'the same' if result.balance.agree else 'other'} "
                    f"parameters: the largest difference is {max(result.balance.apart):.1f} standard deviations.")
    growth = convergence_figure("convergence", "Estimates as samples come in, each in units of its final value: a "
                                               "model that is right "
                                "settles early.", result.convergence_samples, result.convergence, result.convergence_std, names)
    return Section("What the estimate rests on", tuple(text), tuple(tables), (growth,))


def _comparison_section(result: Result) -> Section:
    rows = tuple((c.method, 100 * c.identify, 100 * c.validate,
                  c.failed or ("used here" if c.used else "")) for c in result.comparison)
    table = Table(("motion by", "fitted [%]", "held out [%]", ""), rows, "Relative torque error on the same equations.")
    names = [p.name for p in result.parameters]
    good = [c for c in result.comparison if c.value]
    values = Table(("parameter", *(c.method for c in good)), tuple(
        (name, *(with_std(c.value[k], c.std[k]) for c in good)) for k,
        name in enumerate(names[:len(good[0].value)]))) if good else None
    return Section("Four ways to reconstruct the motion", (), (table,) if values is None else (table, values))


STAGE = Stage("estimate-bps", "Estimate the base parameter set", Settings, compute, report, read_logs, write,
              lambda result, check: int(check and bool(_checks(result))), _checks)
