"""A limit that a rehearsal does not keep is said, with a code, and is a gate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.design_excitation import STAGE
from pipelines.excitation.result import Result, doubts
from pipelines.io.results import decode, encode
from pipelines.report.excitation_report import excitation_report
from tests.design_excitation.short import QUICK, designed


@pytest.fixture(scope="module")
def safe(tmp_path_factory: pytest.TempPathFactory) -> Result:
    result = designed(tmp_path_factory.mktemp("safe") / "out", replace(QUICK, rehearse=True, cond_max=20.0)).result
    assert isinstance(result, Result)
    return result


def test_a_plan_that_is_followed_within_its_limits_raises_no_doubt(safe: Result) -> None:
    assert doubts(safe) == ()
    assert STAGE.exit_code(safe, True) == 0


def test_each_joint_beyond_a_limit_is_named(safe: Result) -> None:
    """104 % of the waist's speed and a drive that saturates: a warning, a gate, and the verdict's own words."""
    assert safe.rehearsal is not None
    speed = np.array(safe.rehearsal.speed_peak)
    speed[0] = 1.04 * safe.rehearsal.speed_limit[0]
    bad = replace(safe, rehearsal=replace(safe.rehearsal, speed_peak=tuple(speed.tolist()), saturated=(0.0, 0.0, 0.25)))
    (check,) = doubts(bad)
    assert (check.code, check.level, check.gate) == ("RRID-D12", "warn", True)
    for words in (f"{safe.joints[0]} reaches 104 % of its speed limit", f"the drive of {safe.joints[2]} saturates in 25 %"):
        assert words in check.message
        assert words in excitation_report(bad).verdict
    assert STAGE.exit_code(bad, True) == 1
    assert STAGE.exit_code(bad, False) == 0


@pytest.mark.slow
def test_noise_that_saturates_the_drives_is_not_silent(tmp_path: Path) -> None:
    """Torque noise of half the limits saturates the drives; the motion stays as it was searched."""
    outcome = designed(tmp_path / "out", replace(QUICK, rehearse=True, noise=(30.0, 30.0, 10.0), cond_max=20.0))
    assert outcome.result.rehearsal is not None
    assert max(outcome.result.rehearsal.saturated) > 0.0
    assert [check.code for check in outcome.checks if "saturates" in check.message] == ["RRID-D12"]
    alone = designed(tmp_path / "alone", replace(QUICK, noise=(30.0, 30.0, 10.0), cond_max=20.0))
    assert outcome.result.shrunk == alone.result.shrunk
    assert outcome.json["limits"] == alone.json["limits"]


def test_a_joint_beyond_its_range_is_named_with_the_distance(safe: Result) -> None:
    assert safe.rehearsal is not None
    far = replace(safe.rehearsal, position_beyond=(-1.0, 0.012, float("nan")), position_units=("rad", "m", "rad"))
    (check,) = doubts(replace(safe, rehearsal=far))
    assert f"{safe.joints[1]} goes 0.012 m beyond its range" in check.message
    assert "--home" in check.remedy
    assert "speed_share" not in check.remedy


def test_a_result_from_before_ranges_were_rehearsed_is_still_reported(safe: Result) -> None:
    """What it does not say is not known; where one limit has two figures, the one that the plan kept is named so."""
    text, series = encode(safe)
    for name in ("position_nearest", "position_beyond", "position_units"):
        del text["rehearsal"][name]
    old = decode(Result, text, series)
    assert doubts(old) == ()
    report = excitation_report(old)
    assert "How near the joints came to the ends of their ranges is not known." in report.sections[0].text
    assert report.sections[0].tables[0].rows[0][-2] is None
    (limits,) = [section for section in report.sections if section.title == "Limits"]
    assert "limit used" in limits.tables[0].columns
