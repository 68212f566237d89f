"""The ledger of a run: what every step of the model brings on held-out logs, from no model at all to every effect."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pipelines.diagnosis.result import Diagnosis, Extension, Finding, Gain
from pipelines.model.estimation.result import Result as Estimate
from pipelines.report import style
from pipelines.report.diagnosis_words import together
from pipelines.report.report import Figure, Section, Table, Tone
from pipelines.report.run_result import Step
from pipelines.report.style import format_number, to_one_place
from pipelines.report.tip_words import span_words

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

__all__ = ["Line", "ledger_lines", "ledger_section"]

_SAME = 0.005  # three digits are shown
_COLOURS = (style.BLUE, style.VERMILLION, style.GREEN)


@dataclass(frozen=True)
class Line:
    """One step of the model: its held-out torque error, joint by joint, and what it was judged beside."""

    step: str
    stage: str  # that computed it
    rms: tuple[float, ...]  # [N m] held-out torque error with this step
    before: tuple[float, ...] | None  # without it, on the same equations; None: there is nothing before it
    sure: bool | None  # whether the gain is beyond its bootstrap interval; None: nobody has drawn one
    tip: tuple[float, float] | None = None  # [m] simulated tip error before and after
    over: str = ""  # how much of which logs that was simulated over, in words

    @property
    def gain(self) -> float | None:
        """[%] of the error of all joints together that it takes away."""
        if self.before is None:
            return None
        before = math.sqrt(sum(x * x for x in self.before))
        return 100.0 * (1.0 - math.sqrt(sum(x * x for x in self.rms)) / before) if before > 0.0 else None


def ledger_lines(stages: Sequence[Step]) -> tuple[Line, ...]:
    """Every step that the stages have judged on held-out logs, in the order in which the model grows."""
    lines = list[Line]()
    for line in (line for step in stages for line in _of(step.result, step.name)):
        if line.before is not None and not any(_alike(above.rms, line.before) for above in lines):
            lines.append(Line(f"the model of {line.stage}, without it", line.stage, line.before, None, None))
        lines.append(line)
    return tuple(lines)


def _of(result: Any, stage: str) -> Iterator[Line]:
    if isinstance(result, Estimate):
        yield from _nominal(result, stage)
    elif isinstance(result, Diagnosis):
        yield from _found(result, stage)
    elif isinstance(result, Extension) and result.gain is not None and result.findings and _whole(result.gain):
        causes = ", ".join(words for _, words in together(result.findings))
        whole = _with(f"the model with {causes}, everything refitted", stage, result.gain)
        # the model that is written, as the key figures have it: a finding's own gain is that of the moment it was found
        now, was = (tuple(map(float, one.validate)) for one in (result.after_rms, result.residual_rms))
        yield replace(whole, rms=now, before=was)


def _found(result: Diagnosis, stage: str) -> Iterator[Line]:
    """Every finding below the line that its gain is counted from, which is told where no line above it is that one.

    Most are counted from the model fitted to these logs, and from one another. A load that the base parameters took in is counted
    from the arm of the reference logs: fitted to these logs, the rigid body holds it already.
    """
    waiting = [one for one in result.findings if _whole(one.gain)]
    nominal: tuple[float, ...] = tuple(map(float, result.residual_rms.validate))
    last: tuple[float, ...] | None = None
    while waiting:
        one = next((one for one in waiting if _alike(_before(one), last or nominal)), waiting[0])
        waiting.remove(one)
        if last is None or not _alike(_before(one), last):
            own = _alike(_before(one), nominal)
            step = "rigid body and friction, as diagnose fits them" if own else f"the model of diagnose, without {_it(one)}"
            yield Line(step, stage, _before(one), None, None)
        yield (line := _with(f"+ {_it(one)}", stage, one.gain))
        last = line.rms


def _it(one: Finding) -> str:
    return together((one,))[0][1]


def _before(one: Finding) -> tuple[float, ...]:
    return tuple(map(float, one.gain.validate_torque_rms.before))


def _alike(x: tuple[float, ...], y: tuple[float, ...]) -> bool:
    """Return whether two lines show the same figures."""
    return bool(np.allclose(x, y, rtol=_SAME))


def _nominal(result: Estimate, stage: str) -> Iterator[Line]:
    """No model, the rigid body alone, with friction."""
    nothing, whole = result.torque_signal_rms["validate"], result.torque_rms["validate"]
    yield Line("no model: the torque itself", stage, nothing, None, None)
    alone = result.rigid_body_alone
    if alone is not None:
        yield Line("rigid body", stage, alone, nothing, None)
    friction = "+ friction, as fit-friction found it" if result.friction == "given" else "+ Coulomb and viscous friction"
    yield Line(friction, stage, whole, alone if alone is not None else nothing, None)


def _with(step: str, stage: str, gain: Gain) -> Line:
    torque, tip = gain.validate_torque_rms, gain.tip_error_rms
    sure = bool(np.any(np.asarray(torque.ci95)[:, 1] < 0.0))
    return Line(step, stage, tuple(map(float, torque.after)), tuple(map(float, torque.before)), sure,
                None if tip is None else (tip.before, tip.after), "" if tip is None else span_words(gain))


def _whole(gain: Gain) -> bool:
    """Return whether the gain is one in torque: what is found by frequency responses alone need not have one."""
    return bool(np.isfinite(gain.validate_torque_rms.after).all() and np.isfinite(gain.validate_torque_rms.before).all())


def ledger_section(lines: Sequence[Line]) -> Section | None:
    """The table and its picture; None where no step was judged."""
    if not lines:
        return None
    joints = len(lines[0].rms)
    rows, tones = [], list[Tone]()
    rounded = iter(to_one_place([error for line in lines for error in line.rms]))
    for line in lines:
        errors = [next(rounded) for _ in line.rms]
        rows.append((line.step, *errors, _rounded(line.gain), _judged(line), _tip(line)))
        tones.append("attention" if line.sure is False else "good" if line.sure else "neutral")
    heads = ("step", *(f"joint {j + 1} [N m]" for j in range(joints)), "gain in rms [%]", "beyond chance", "simulated tip [mm]")
    text = ("Torque error on held-out logs, root mean square, with each step of the model. A gain is the share of that error, "
            "all joints together, that a step takes off the line it builds on. The table of candidate causes gives it in the "
            "square, of the fitted logs: half the error is 50 % here and 75 % there.", _compared(lines), *_simulated(lines))
    return Section("Error by model stage, on held-out logs", text, (Table(heads, tuple(rows), tones=tuple(tones)),),
                   (_picture(lines),))


def _compared(lines: Sequence[Line]) -> str:
    """Which lines may be laid beside each other."""
    stages = list(dict.fromkeys(line.stage for line in lines))
    if len(stages) < 2:
        return f"All of them are {stages[0]}'s."
    return (f"The lines are {', '.join(stages[:-1])}'s and {stages[-1]}'s, in this order. Each stage filters and thins out the "
            "torque in its own way: lines of one stage can be compared with each other, those of two only roughly.")


def _simulated(lines: Sequence[Line]) -> Iterator[str]:
    """What the last column is taken over."""
    over = "; and ".join(dict.fromkeys(line.over for line in lines if line.over))
    if over:
        yield f"The tip is simulated {over}."


def _rounded(x: float | None) -> float | None:
    return None if x is None or not math.isfinite(x) else round(x, 1)


def _judged(line: Line) -> str:
    return "–" if line.sure is None else "yes, 95 %" if line.sure else "no"


def _tip(line: Line) -> str:
    if line.tip is None:
        return "–"
    return f"{format_number(1e3 * line.tip[0], 3)} → {format_number(1e3 * line.tip[1], 3)}"  # as the verdict writes them


def _two_lines(step: str) -> str:
    """A label that leaves room for its picture."""
    return textwrap.fill(textwrap.shorten(step, 68, placeholder=" …"), 36)


def _picture(lines: Sequence[Line]) -> Figure:
    joints = len(lines[0].rms)

    def draw(drawing: Drawing) -> None:
        axes = drawing.subplots()
        places = np.arange(len(lines), dtype=np.float64)
        ends = [k for k in range(1, len(lines)) if lines[k].stage != lines[k - 1].stage]
        for j in range(joints):
            errors = np.array([line.rms[j] for line in lines])
            axes.plot(np.insert(errors, ends, math.nan), np.insert(places, ends, math.nan), marker="o", markersize=4.0,
                      linewidth=1.0, color=_COLOURS[j % len(_COLOURS)], alpha=1.0 if j < len(_COLOURS) else 0.5,
                      label=f"joint {j + 1}")
        axes.set_xscale("log")
        style.log_ticks(axes.xaxis)
        axes.set_yticks(list(places), [_two_lines(line.step) for line in lines], fontsize=7)
        axes.invert_yaxis()
        axes.set_xlabel("held-out torque error [N m]")
        axes.legend(fontsize=7)

    joined = "; joined are the steps of one stage" if len({line.stage for line in lines}) > 1 else ""
    caption = f"Held-out torque error with each step of the model{joined}; to the left is better."
    return Figure("ledger", caption, draw, (6.0, 1.2 + 0.28 * len(lines)))
