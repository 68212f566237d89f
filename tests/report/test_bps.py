"""The report of an estimate says what the estimate says, and no number where there is none."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines import estimate_bps
from pipelines.estimation.comparison import Beside
from pipelines.estimation.result import Result
from pipelines.report.bps_report import bps_report
from pipelines.report.render import render_report
from pipelines.stage import Request, run_stage


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    log = Path(__file__).resolve().parents[2] / "sample_logs/rrr-closed-form/excitation-1.h5"
    request = Request((log,), out=tmp_path_factory.mktemp("bps") / "out", no_report=True)
    return run_stage(estimate_bps.STAGE, request, estimate_bps.Settings(compare=False)).result


def page(result: Result) -> str:
    html = render_report(bps_report(result), {})["report.html"]
    return html if isinstance(html, str) else html.decode()


def test_a_good_estimate_is_called_good(result: Result) -> None:
    report = bps_report(result)
    assert report.tone == "good"
    clear = [p for p in result.parameters if p.visible and p.value is not None and p.std is not None and abs(p.value) > 3.0 * p.std]
    small = sum(p.visible for p in result.parameters) - len(clear)
    assert f"{len(clear)} of {len(result.parameters)} parameters are clearly visible, {small} known to be small" in report.verdict
    assert "for none has role validate" in report.verdict  # blocks were held out, and that is said
    assert "gives the same parameters" in page(result)


def test_a_residual_far_above_the_noise_is_not_called_good(result: Result) -> None:
    """44 times what the noise between periods leaves: the torque error is as small as before, and the model lacks something."""
    n = np.ones(len(result.joints))
    log = Beside("a", "identify", 3, True, "", (), n, n, n, n, n, 44.0 * n, 44.0 * n)
    report = bps_report(replace(result, noise_floor=(log,)))
    assert report.tone == "attention"
    assert "44 times what the noise between periods leaves" in report.verdict


def test_what_is_not_determined_has_no_number(result: Result) -> None:
    lost = replace(result.parameters[0], value=None, std=None, visible=False)
    unsure = replace(result, parameters=(lost, *result.parameters[1:]), unresolved="no sample shows p1", physically_consistent=None)
    report = bps_report(unsure)
    assert report.tone == "bad"
    assert "no sample shows p1" in report.verdict
    row = next(row for section in report.sections for table in section.tables for row in table.rows if row[0] == "p1")
    assert row[1] == "not determined"
    assert "cannot be said" in page(unsure)


def test_impossible_links_and_a_balance_that_differs_are_said(result: Result) -> None:
    assert result.balance is not None
    apart = tuple(np.full(len(result.balance.apart), 7.0))
    wrong = replace(result, physically_consistent=False, balance=replace(result.balance, agree=False, apart=apart))
    assert bps_report(wrong).tone == "bad"
    assert bps_report(wrong).verdict.startswith("No links that could exist")  # before an error that may be small
    unconfirmed = bps_report(replace(wrong, physically_consistent=True))
    assert unconfirmed.tone == "attention"
    assert unconfirmed.verdict.startswith("The balance of power does not confirm the parameters")
    assert f"below {result.filter_hz:.2g} Hz with an error" in unconfirmed.verdict
    assert "does not confirm the parameters" in page(wrong)
    assert "or the model lacks an effect" in page(wrong)
    late = replace(wrong, balance=replace(result.balance, agree=False, delay=2e-3, delay_std=1e-5))
    assert "ms behind the position: a drive or a filter delays one of them" in page(late)
    lagging = replace(wrong, balance=replace(result.balance, agree=False, closure=0.031))
    said = " ".join(text for section in bps_report(lagging).sections for text in section.text)
    assert "contradicts itself by 3.1 % of the energy" in said


def test_names_from_logs_are_inert(result: Result) -> None:
    """X08, X09: joints may be called anything."""
    hostile = "<script>alert(1)</script> $a_{ [/x]"
    named = replace(result, joints=(hostile, *result.joints[1:]),
                    courses=tuple(replace(c, name=hostile) for c in result.courses))
    assert "<script>" not in page(named)


def test_estimates_that_do_not_settle_are_said(result: Result) -> None:
    """A change that noise makes, and the same for a parameter five standard deviations away at half of the samples."""
    def said(one: Result) -> str:
        return " ".join(text for section in bps_report(one).sections for text in section.text)

    assert "may be chance" in said(result)
    half = len(result.convergence) // 2
    spread = np.sqrt(np.square(result.convergence_std[half, 2]) - np.square(result.convergence_std[-1, 2]))
    moving = result.convergence.copy()
    moving[half, 2] = moving[-1, 2] + 5.0 * spread
    contradicted = replace(result, convergence=moving)
    assert f"moves {result.parameters[2].name} most, by 5.0 standard deviations: more than noise" in said(contradicted)
    assert bps_report(contradicted).tone == "attention"
    assert "two halves of the samples contradict each other" in bps_report(contradicted).verdict


def test_the_torque_that_is_drawn_is_the_torque_that_was_fitted(result: Result) -> None:
    """After the low-pass: what is left in the figure has the root mean square of the table, and nothing is aliased."""
    (course,) = result.courses
    fitted = (course.t > 0.1) & (course.t < course.t[-1] - 0.1)  # the ends, known badly, are not fitted
    inside = course.left[fitted & ~((course.t > 3.7) & (course.t < 5.4))]  # nor joint 1 while dry friction holds it
    np.testing.assert_allclose(np.sqrt(np.nanmean(np.square(inside), axis=0)), result.torque_rms["identify"], rtol=0.1)
    np.testing.assert_allclose(course.left, course.measured - course.model, atol=1e-9)


def test_a_model_that_explains_nothing_is_called_bad(result: Result) -> None:
    """Nine tenths of the torque left over: no good figure is made of it, and every joint that stands out is named."""
    poor = bps_report(replace(result, relative_error={"identify": 0.9, "validate": 0.94}))
    assert poor.tone == "bad"
    assert "does not explain these logs" in poor.verdict
    assert "with an error of 94 % (rms)" in poor.verdict
    uneven = replace(result, relative_error={"identify": 0.05, "validate": 0.14},
                     torque_rms={**result.torque_rms, "validate": (1.0, 39.0, 62.0)},
                     torque_signal_rms={**result.torque_signal_rms, "validate": (100.0, 100.0, 100.0)})
    assert f"{result.joints[2]} 62 %, {result.joints[1]} 39 %" in bps_report(uneven).verdict


def test_a_motion_that_contradicts_itself_alone_does_not_contradict_the_parameters(result: Result) -> None:
    """All parameters alike, and an energy that does not close: said as what it is."""
    assert result.balance is not None
    open_ = replace(result.balance, agree=False, closure=0.0041, apart=tuple(np.full(len(result.balance.apart), 0.3)),
                    delay=0.0, delay_std=1e-5, deviate=0.5)
    words = " ".join(text for section in bps_report(replace(result, balance=open_)).sections for text in section.text)
    assert "finds the same parameters but cannot confirm them" in words
    assert "does not confirm" not in words


@pytest.mark.slow
def test_described_links_that_differ_are_named(result: Result) -> None:
    """One described value ten standard deviations from its estimate, the others equal to theirs."""
    equal = tuple(replace(p, known=p.value) for p in result.parameters)
    first = equal[0]
    assert first.value is not None
    assert first.std is not None
    off = replace(result, parameters=(replace(first, known=first.value + 10.0 * first.std), *equal[1:]))
    assert f"1 of {len(equal)} values of the described links" in page(off)
    assert f"All {len(equal)} values of the described links" in page(replace(result, parameters=equal))


def test_nothing_is_told_by_its_key(result: Result) -> None:
    """Parameters by their cause in words, powers and comparisons as they are written by hand."""
    page = bps_report(result)
    cells = [str(cell) for section in page.sections for table in section.tables for row in table.rows for cell in row]
    told = [*cells, *(text for section in page.sections for text in section.text)]
    assert "Coulomb friction at joint 1, level" in cells
    assert not [text for text in told if re.search(r"[a-z]:\d|\d:[a-z]|\w\^\d|sqrt|>=|\de[+-]\d", text)]
