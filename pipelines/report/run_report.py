"""The report of a run: the verdict, error by model stage, what the logs lack, then every stage."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from pipelines.diagnosis.result import Diagnosis, Extension, Finding, Gain
from pipelines.diagnosis.result import Result as Diagnosed
from pipelines.errors import Check, NothingMatched
from pipelines.estimation.checks.boundary import Boundary
from pipelines.estimation.result import Result as Estimate
from pipelines.io.output import slug
from pipelines.io.results import FLAT, NOT_STORED
from pipelines.report import style
from pipelines.report.diagnosis_finding import span_words
from pipelines.report.figures import Look, one_figure
from pipelines.report.report import Figure, Report, Section, Table, Tone
from pipelines.report.sections import CARD, boundary_card
from pipelines.report.sentences import paragraphs, sentence
from pipelines.report.style import format_number, to_one_place
from pipelines.report.words import together, units_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_WORST: tuple[Tone, ...] = ("neutral", "good", "attention", "bad")
_FIGURES = (
    12  # numerics: of one stage: ten logs drawn four times each are for who asks for that stage
)
_NAMED = 3  # numerics: logs that are left out

_SAME = 0.005  # numerics: three digits are shown
_COLOURS = (style.BLUE, style.VERMILLION, style.GREEN)

_say = partial(sentence, "run")


@dataclass(frozen=True)
class Step:
    """One stage's outcome: its exit code under --check, and its result."""

    name: str
    exit: int
    result: Any
    report: Report = field(metadata=NOT_STORED, repr=False)
    checks: tuple[Check, ...] = field(metadata=NOT_STORED, repr=False)
    kept: Any = field(default=None, metadata=NOT_STORED, repr=False)  # where its files lie


@dataclass(frozen=True)
class Result:
    """The stages of a run, on the logs of one robot and one day."""

    stages: tuple[Step, ...]
    runs: tuple[Any, ...] = ()  # one for each of several sessions; empty, for those are refused
    boundary: Boundary | None = None  # what the logged torque is, also where no arm is diagnosed
    diagnosis: Diagnosis | None = field(default=None, metadata=FLAT, repr=False)


@dataclass(frozen=True)
class Line:
    """One step of the model: its held-out torque error, joint by joint, and that before it."""

    step: str
    stage: str  # that computed it
    rms: tuple[float, ...]  # [N m] held-out torque error with this step
    before: tuple[float, ...] | None = None  # without it, on the same equations; None: the first
    sure: bool | None = None  # whether the gain is beyond its bootstrap interval; None: not known
    tip: tuple[float, float] | None = None  # [m] simulated tip error before and after
    over: str = ""  # how much of which logs that was simulated over, in words

    @property
    def gain(self) -> float | None:
        """[%] of the error of all joints together that it takes away."""
        if self.before is None:
            return None
        before = math.hypot(*self.before)
        return 100.0 * (1.0 - math.hypot(*self.rms) / before) if before > 0.0 else None


def run_report(result: Result) -> Report:
    """The answer before its sources."""
    steps = result.stages
    tone = max((step.report.tone for step in steps), key=_WORST.index)
    advice = tuple(line for step in steps for line in step.report.advice)
    if len(steps) == 1:
        sections = list(steps[0].report.sections)
    else:
        sections = [*boundary_card(result.boundary), *stages_section(stage_lines(steps))]
        sections += [_stages(steps), *_lacking(steps)]
        for step in sorted(steps, key=lambda step: not isinstance(step.result, Diagnosis)):
            shown = _titled(_fewer(step.report.sections, step.name), step.name)
            folds = not isinstance(step.result, Diagnosis)
            sections += [replace(one, folded=one.folded or folds) for one in shown]
    key, verdict = _key_figures(steps), "\n".join(_verdicts(steps))
    return Report(_title(steps), verdict, tone, key, tuple(sections), advice)


def _title(steps: Iterable[Step]) -> str:
    """With the robot, where a diagnosis knows it."""
    robots = {step.result.robot for step in steps if isinstance(step.result, Diagnosed)} - {""}
    return f"Run: {robots.pop()}" if len(robots) == 1 else "Run"


def _verdicts(steps: Sequence[Step]) -> list[str]:
    """The logs left out, the answer of the diagnosis, that of the extended model, the refusals.

    Without a refusal, the stages with remarks, or their verdicts where there is no answer. Without
    all that, the last verdict.
    """
    answers = [s for kind in (Diagnosis, Extension) for s in steps if isinstance(s.result, kind)]
    said = [_left_out(steps)] if answers else []
    said += [step.report.verdict for step in answers]
    others = [step for step in steps if step not in answers]
    bad, attention = ([s for s in others if s.report.tone == t] for t in ("bad", "attention"))
    if refusals := _refusals(steps):
        said += refusals
    elif answers:
        said.append(_say("remarks", [s.name for s in bad], [s.name for s in attention]))
    else:
        said += [step.report.verdict for step in others if step in bad or step in attention]
    done = [step.report.verdict for step in steps if step.result is not None]
    return [words for words in said if words] or done[-1:]


def _left_out(steps: Iterable[Step]) -> str:
    checks = (check for step in steps if step.name == "inspect" for check in step.checks)
    bad = [f"{check.where} ({check.message})" for check in checks if check.level == "reject"]
    return _say("left_out", bad[:_NAMED], len(bad) - _NAMED)


def _refusals(steps: Iterable[Step]) -> list[str]:
    """Why stages were not done: one sentence for each reason, with the stages it stopped."""
    reasons: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for step in steps:
        if step.result is None and step.exit != NothingMatched.exit_code:
            for check in step.checks:
                stopped = reasons.setdefault((check.code, check.message), [])
                stopped.append((step.name, check.remedy.split("; ")[0]))
    return [
        _say("refusal", [name for name, _ in stopped], message, stopped[0][1])
        for (_, message), stopped in reasons.items()
    ]


def _key_figures(steps: Sequence[Step]) -> Table | None:
    """Those of the diagnosis, where there is one alone; of a single stage its own.

    Its extended model is not the one in the folder of `extend`, which fits everything again: what
    that leaves is said below.
    """
    if len(steps) == 1:
        return steps[0].report.key_figures
    tables = [s.report.key_figures for s in steps if isinstance(s.result, Diagnosis)]
    table = tables[0] if len(tables) == 1 else None
    extensions = (s.result for s in steps if isinstance(s.result, Extension))
    anew = next((found for found in extensions if found.model is not None), None)
    if table is None or anew is None:
        return table
    said = _say("extended", anew.after_rms.validate.tolist(), units_in(anew).torque)
    return replace(table, caption=f"{table.caption} {said}")


def _stages(steps: Iterable[Step]) -> Section:
    rows = tuple((step.name, step.report.verdict) for step in steps)
    tones = tuple(step.report.tone for step in steps)
    table = Table(("stage", "verdict"), rows, "Each stage in the order it was run.", tones)
    return Section("Stages", tables=(table,))


def _lacking(steps: Iterable[Step]) -> list[Section]:
    """The stages that lack a recording, and the recording that each needs."""
    lacking = [step for step in steps if step.exit == NothingMatched.exit_code]
    rows = tuple((s.name, check.message, check.remedy) for s in lacking for check in s.checks)
    table = Table(("stage", "why it was passed over", "what to record"), rows)
    return [Section("What these logs lack", tables=(table,))] if rows else []


def _fewer(sections: Iterable[Section], stage: str) -> list[Section]:
    """`sections` of one stage with its first figures; the words say what draws the others."""
    kept: list[Section] = []
    drawn = 0
    for section in sections:
        if section.title == CARD:  # it is at the top, once for all stages
            continue
        if drawn + len(section.figures) > _FIGURES and drawn:
            words = _say("not_drawn", stage, len(section.figures))
            section = replace(section, text=(*section.text, words), figures=())
        drawn += len(section.figures)
        kept.append(section)
    return kept


def _titled(sections: Iterable[Section], prefix: str) -> list[Section]:
    """`sections`, with titles and figures named after their stage."""
    return [
        replace(
            section,
            title=f"{prefix}: {section.title}",
            figures=tuple(replace(f, name=f"{slug(prefix)}-{f.name}") for f in section.figures),
        )
        for section in sections
    ]


def stage_lines(stages: Sequence[Step]) -> tuple[Line, ...]:
    """Every step that was judged on held-out logs, in the order in which the model grows."""
    lines: list[Line] = []
    for line in (line for step in stages for line in _of(step.result, step.name)):
        if line.before is not None and not any(_alike(x.rms, line.before) for x in lines):
            step = f"the model of {line.stage}, without it"
            lines.append(Line(step, line.stage, line.before))
        lines.append(line)
    return tuple(lines)


def _of(result: Any, stage: str) -> Iterator[Line]:
    if isinstance(result, Estimate):
        yield from _nominal(result, stage)
    elif isinstance(result, Diagnosis):
        yield from _found(result, stage)
    elif isinstance(result, Extension) and result.gain is not None and result.findings:
        if not _in_torque(result.gain):
            return
        causes = ", ".join(words for _, words in together(result.findings))
        line = _with(f"the model with {causes}, everything refitted", stage, result.gain)
        # the model that is written, as in the key figures: a finding's own gain is an earlier one
        now, before = _floats(result.after_rms.validate), _floats(result.residual_rms.validate)
        yield replace(line, rms=now, before=before)


def _found(result: Diagnosis, stage: str) -> Iterator[Line]:
    """Every finding below the line that its gain is counted from.

    Most are counted from the model fitted to these logs, and from one another. A load that the base
    parameters took in is counted from the arm of the reference logs: fitted to these logs, the
    rigid body holds it already.
    """
    waiting = [one for one in result.findings if _in_torque(one.gain)]
    nominal = _floats(result.residual_rms.validate)
    last: tuple[float, ...] | None = None
    while waiting:
        following = (one for one in waiting if _alike(_before(one), last or nominal))
        one = next(following, waiting[0])
        waiting.remove(one)
        words = together((one,))[0][1]
        if last is None or not _alike(_before(one), last):
            step = f"the model of diagnose, without {words}"
            if _alike(_before(one), nominal):
                step = "rigid body and friction, as diagnose fits them"
            yield Line(step, stage, _before(one))
        yield (line := _with(f"+ {words}", stage, one.gain))
        last = line.rms


def _floats(values: Any) -> tuple[float, ...]:
    return tuple(map(float, values))


def _before(one: Finding) -> tuple[float, ...]:
    return _floats(one.gain.validate_torque_rms.before)


def _alike(x: tuple[float, ...], y: tuple[float, ...]) -> bool:
    """Return whether two lines show the same figures."""
    return bool(np.allclose(x, y, rtol=_SAME))


def _nominal(result: Estimate, stage: str) -> Iterator[Line]:
    """No model, the rigid body alone, with friction."""
    before = result.torque_signal_rms["validate"]
    yield Line("no model: the torque itself", stage, before)
    if result.rigid_body_alone is not None:
        yield Line("rigid body", stage, result.rigid_body_alone, before)
        before = result.rigid_body_alone
    friction = "+ Coulomb and viscous friction"
    if result.friction == "given":
        friction = "+ friction, as fit-friction found it"
    yield Line(friction, stage, result.torque_rms["validate"], before)


def _with(step: str, stage: str, gain: Gain) -> Line:
    torque, tip = gain.validate_torque_rms, gain.tip_error_rms
    sure = bool(np.any(np.asarray(torque.ci95)[:, 1] < 0.0))
    line = Line(step, stage, _floats(torque.after), _floats(torque.before), sure)
    return (
        line if tip is None else replace(line, tip=(tip.before, tip.after), over=span_words(gain))
    )


def _in_torque(gain: Gain) -> bool:
    """Return whether the gain is one in torque: one of frequency responses need not be."""
    torque = gain.validate_torque_rms
    return bool(np.isfinite(torque.after).all() and np.isfinite(torque.before).all())


def stages_section(lines: Sequence[Line]) -> tuple[Section, ...]:
    """The table and its picture; nothing where no step was judged."""
    if not lines:
        return ()
    joints = len(lines[0].rms)
    rounded = iter(to_one_place([error for line in lines for error in line.rms]))
    rows, tones = [], list[Tone]()
    for line in lines:
        errors = [next(rounded) for _ in line.rms]
        gain = None if line.gain is None or not math.isfinite(line.gain) else round(line.gain, 1)
        sure = {None: "–", True: "yes, 95 %", False: "no"}[line.sure]
        tip = "–" if line.tip is None else " → ".join(format_number(1e3 * x, 3) for x in line.tip)
        rows.append((line.step, *errors, gain, sure, tip))
        tone: dict[bool | None, Tone] = {None: "neutral", True: "good", False: "attention"}
        tones.append(tone[line.sure])
    joint_columns = (f"joint {j + 1} [N m]" for j in range(joints))
    columns = ("step", *joint_columns, "gain in rms [%]", "beyond chance", "simulated tip [mm]")
    table = Table(columns, tuple(rows), tones=tuple(tones))
    stages = list(dict.fromkeys(line.stage for line in lines))
    spans = list(dict.fromkeys(line.over for line in lines if line.over))
    text = paragraphs("run", "stages", stages, spans)
    title = "Error by model stage, on held-out logs"
    return (Section(title, text, (table,), (_picture(lines, len(stages) > 1),)),)


def _two_lines(step: str) -> str:
    """A label that leaves room for its picture."""
    return textwrap.fill(textwrap.shorten(step, 68, placeholder=" …"), 36)


def _picture(lines: Sequence[Line], several: bool) -> Figure:
    def draw(axes: Axes) -> None:
        rows = np.arange(len(lines), dtype=np.float64)
        ends = [k for k in range(1, len(lines)) if lines[k].stage != lines[k - 1].stage]
        for j in range(len(lines[0].rms)):
            errors = np.array([line.rms[j] for line in lines])
            color, alpha = _COLOURS[j % len(_COLOURS)], 1.0 if j < len(_COLOURS) else 0.5
            look: Look = {"marker": "o", "markersize": 4.0, "linewidth": 1.0, "color": color}
            broken = (np.insert(x, ends, math.nan) for x in (errors, rows))
            axes.plot(*broken, alpha=alpha, label=f"joint {j + 1}", **look)
        axes.set_xscale("log")
        style.log_ticks(axes.xaxis)
        axes.set_yticks(list(rows), [_two_lines(line.step) for line in lines], fontsize=7)
        axes.invert_yaxis()
        axes.set_xlabel("held-out torque error [N m]")
        axes.legend(fontsize=7)

    joined = "; joined are the steps of one stage" if several else ""
    caption = f"Held-out torque error with each step of the model{joined}; to the left is better."
    return one_figure("ledger", caption, draw, 1.2 + 0.28 * len(lines))
