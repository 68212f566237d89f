"""The report of an estimate says what the estimate says, and no number where there is none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines import estimate_bps
from pipelines.estimation.mean_period import PeriodicLog
from pipelines.estimation.result import Result
from pipelines.report.bps_report import bps_report
from pipelines.report.render import render_report
from pipelines.stage import Request, run_stage


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    log = Path(__file__).resolve().parents[2] / "sample_logs/rrr-closed-form/excitation-1.h5"
    request = Request((log,), out=tmp_path_factory.mktemp("bps") / "out", no_report=True)
    return run_stage(estimate_bps.STAGE, request, estimate_bps.Settings()).result


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
    log = PeriodicLog("a", "identify", 3, True, "", (), n, n, n, n, n, 44.0 * n, 44.0 * n)
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
