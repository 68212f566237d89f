"""How far the simulated tip is off, in words: of one finding or of all, how it was simulated, and over how much of which logs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pipelines.diagnosis.result import Finding, Gain, TipError
from pipelines.report.style import format_number

__all__ = ["all_together", "span_words", "tip_change", "tip_worth"]

_SIMULATED = {"closed-loop": "simulated in closed loop, with the controller of the logs",
              "windowed": "simulated over short windows from smoothed states, for the logs do not know their controller",
              "none": "not simulated"}
_NO_TIP = 1e-9  # [m] no tip: nothing that is simulated and measured comes so near


def tip_change(gain: Gain) -> str:
    """"the simulated tip is 1.17 mm off the measured one instead of 1.22 mm, over the first 5 s of writing-1"; empty where no digit
    moves."""
    before, after = _tip(gain)
    tip = "the tip, simulated over short windows," if gain.simulation == "windowed" else "the simulated tip"
    return "" if before == after else f"{tip} is {after} mm off the measured one instead of {before} mm{_over(gain)}"


def tip_worth(gain: Gain) -> str:
    """The same as a sentence for the section of a finding, with how the tip was simulated, whether it moves or not."""
    before, after = _tip(gain)
    if not before:
        return ""
    off = f"{before} mm off without it and {after} mm with it" if before != after else f"{before} mm off without it as with it"
    return f" The simulated tip is {off}{_over(gain)}, {_SIMULATED[gain.simulation]}."


def span_words(gain: Gain) -> str:
    """Over how much of which logs an arm was simulated: "over the first 5 s of writing-1 and writing-2"; empty where nobody has
    noted it, or nothing was simulated."""
    first = "" if gain.simulation == "windowed" else "the first "
    logs = dict[str, list[str]]()
    for one in gain.simulated_span:
        logs.setdefault(f"{first}{format_number(one.seconds, 3)} s of ", []).append(one.log)
    each = " and ".join(f"{seconds}{' and '.join(names)}" for seconds, names in logs.items())
    return f"over {each}" if each else ""


def all_together(findings: Sequence[Finding]) -> Gain:
    """The gain of the first, with the simulated tip before any of them and after all; as it is where they do not follow each other.
    """
    first, tips = findings[0].gain, [one.gain.tip_error_rms for one in findings]
    if len(findings) == 1:
        return first
    known = [tip for tip in tips if tip is not None]
    before = {tip.before for tip in known} - {tip.after for tip in known}
    after = {tip.after for tip in known} - {tip.before for tip in known}
    ways = {(one.gain.simulation, one.gain.simulated_span) for one in findings}
    if len(known) < len(tips) or len(before) != 1 or len(after) != 1 or len(ways) > 1:
        return first
    return replace(first, tip_error_rms=TipError(before.pop(), after.pop()))


def _over(gain: Gain) -> str:
    """The span behind a figure; the words end as before where nobody has noted it."""
    words = span_words(gain)
    return f", {words}" if words else ""


def _tip(gain: Gain) -> tuple[str, str]:
    """[mm] before and after, as printed; empty where nothing was simulated or no arm is on the motor, so that no tip can be off."""
    tip = gain.tip_error_rms
    if tip is None or max(tip.before, tip.after) < _NO_TIP:
        return "", ""
    return format_number(1e3 * tip.before, 3), format_number(1e3 * tip.after, 3)
