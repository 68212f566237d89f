"""What a friction report says of a joint whose simulation has no error that a number could tell."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from pipelines import fit_friction
from pipelines.friction.result import CandidateLaw, Result
from pipelines.io.files import open_log
from pipelines.stage import Inputs


@pytest.fixture(scope="module")
def result(samples: Path) -> Result:
    opened = open_log(samples / "rrr-closed-form/friction-3.h5")
    return fit_friction.compute(Inputs((opened,), label="logs"), fit_friction.Settings(law="coulomb+viscous"))


@pytest.mark.parametrize(("with_", "without", "said"), [
    (None, None, "; the simulation runs away, with friction and without"),
    (None, 2.0, "; the simulation runs away (off by 2 rad/s rms without friction)"),
    (0.1, None, "simulated speed off by 0.1 rad/s rms (without friction it runs away)"),
    (0.1, 2.0, "simulated speed off by 0.1 rad/s rms (2 without friction)")])
def test_a_simulation_that_runs_away_is_said_to(with_: float | None, without: float | None, said: str, result: Result) -> None:
    """An infinite error is no figure: the verdict and the section of the simulation say what happens."""
    (joint,) = result.joints
    judged = replace(joint.validation, velocity_error_with=with_, velocity_error_without=without)
    told = fit_friction.report(replace(result, joints=(replace(joint, validation=judged),)))
    assert said in told.verdict
    words = next(" ".join(section.text) for section in told.sections if section.title.endswith(": simulation"))
    assert ("runs away" in words) == (None in (with_, without))
    assert "no end" not in told.verdict + words


@pytest.mark.slow
def test_more_numbers_are_given_a_reason(samples: Path) -> None:
    """Three sigmoids at the shoulder, which has that law: why not the plainer one; no key of a law."""
    opened = open_log(samples / "rrr-healthy/friction-2-1.h5")
    found = fit_friction.compute(Inputs((opened,), label="logs"), fit_friction.Settings())
    told = fit_friction.report(found)
    words = next(" ".join(section.text) for section in told.sections if section.title.endswith(": choice of the law"))
    assert re.search(r"Three sigmoids, with 7 numbers, and not Stribeck, the best law with fewer \(5\): that leaves [0-9.]+ % more",
                     words)
    assert "_" not in words


def test_how_much_worse_is_told_beside_the_law_that_chance_was_asked_of(result: Result) -> None:
    """A law is refused because it is measurably worse than the best, which need not be the one that was taken."""
    (joint,) = result.joints
    laws = tuple(CandidateLaw(law, size, 0.01, left, alike, chosen, "") for law, size, left, alike, chosen in (
        ("coulomb+viscous", 3, 0.0150, False, False), ("stribeck", 5, 0.0101, True, True),
        ("three_sigmoid", 7, 0.0100, True, False)))
    told = fit_friction.report(replace(result, joints=(replace(joint, candidate_laws=laws, law="stribeck"),)))
    words = next(" ".join(section.text) for section in told.sections if section.title.endswith(": choice of the law"))
    assert "that leaves 50 % more of what was held out (rms) than three sigmoids, the best of all, more than chance" in words
