"""What is said of the simulated tip is true of its numbers, and says over how much of which logs they were taken."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pipelines.diagnosis.result import BeforeAfter, Finding, TipError
from pipelines.report.diagnosis_finding import all_together, gain_table, tip_change, tip_worth
from pipelines.report.run_report import Line, stages_section
from pipelines.simulation.comparison import SimulatedSpan
from tests.report.test_diagnosis_finding import finding

BOTH = (SimulatedSpan("writing-1", 5.0), SimulatedSpan("writing-2", 5.0))


@pytest.mark.parametrize(("before", "after", "said"), [
    (1.2238e-3, 1.1691e-3, "the simulated tip is 1.17 mm off the measured one instead of 1.22 mm"),
    (1.2238e-3, 1.2237e-3, ""), (0.0, 0.0, "")])
def test_a_cause_is_not_blamed_for_all_that_the_tip_is_off(before: float, after: float, said: str) -> None:
    """What it takes away is told; nothing where no printed digit moves, or where a motor carries no arm."""
    gain = replace(finding().gain, tip_error_rms=TipError(before, after))
    assert tip_change(gain) == said
    assert ("tip" in tip_worth(gain)) == (before > 0.0)
    assert ("as with it" in tip_worth(gain)) == (before > 0.0 and not said)


def following(*tips: float) -> list[Finding]:
    """Findings each of which takes the tip from one error to the next [m]."""
    return [replace(one, gain=replace(one.gain, tip_error_rms=TipError(before, after)))
            for one, before, after in zip([finding()] * (len(tips) - 1), tips, tips[1:], strict=False)]


def test_the_tip_is_told_of_all_findings_together() -> None:
    """Whatever their order; where they do not follow each other, or over another span, the first alone is told."""
    some = following(1e-3, 0.9e-3, 0.2e-3)
    for order in (some, some[::-1]):
        tip = all_together(order).tip_error_rms
        assert tip is not None
        assert (tip.before, tip.after) == (1e-3, 0.2e-3)
    apart = [*following(1e-3, 0.9e-3), *following(0.5e-3, 0.4e-3)]
    assert all_together(apart) is apart[0].gain
    assert all_together(some[:1]) is some[0].gain
    shorter = [some[0], replace(some[1], gain=replace(some[1].gain, simulated_span=BOTH[:1]))]
    assert all_together(shorter) is some[0].gain


@pytest.mark.parametrize(("how", "span", "said"), [
    ("closed-loop", BOTH, "over the first 5 s of writing-1 and writing-2"),
    ("closed-loop", (SimulatedSpan("a", 4.998), SimulatedSpan("b", 0.6)), "over the first 5 s of a and the first 0.6 s of b"),
    ("windowed", (SimulatedSpan("a", 57.9),), "over 57.9 s of a"), ("closed-loop", (), "")])
def test_the_span_stands_wherever_millimetres_do(how: Any, span: tuple[SimulatedSpan, ...], said: str) -> None:
    """In the verdict, in the section of a finding, under its table, and above the ledger of a run; a stored result that does not
    know it is told without."""
    gain = replace(finding().gain, simulation=how, tip_error_rms=TipError(2e-3, 1e-3), simulated_span=span,
                   simulated_position_rms=BeforeAfter(np.full(3, 1e-3), np.full(3, 1e-4)))
    line = Line("+ cogging", "diagnose", (0.1,), (0.2,), True, (2e-3, 1e-3), said)
    (ledger,) = stages_section([line])
    for text in (tip_change(gain), tip_worth(gain), gain_table(gain, "Gain.").caption, " ".join(ledger.text)):
        assert said in text
        assert (" s of " in text) == bool(said)
