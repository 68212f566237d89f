"""The low-pass that a motion asks for is that of the motion, whatever is missing of the log."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.dynamics.body import Motion
from pipelines.estimation.regression import wanted_cutoff

RATE = 500.0  # [Hz]
FASTEST = 5.0  # [Hz]


def motion(gap: float, missing: str) -> Motion:
    """Ten seconds of three joints that move at one to five hertz; in the middle `gap` [s] is cut out, or is no number."""
    t = np.arange(0.0, 10.0, 1.0 / RATE)
    dq = np.stack([np.sin(2.0 * np.pi * f * t + phase) for f, phase in ((1.0, 0.3), (2.0, 1.1), (FASTEST, 2.0))], axis=1)
    lost = np.abs(t - 5.03) < 0.5 * gap
    if missing == "samples":
        t, dq = t[~lost], dq[~lost]
    else:
        dq[lost] = np.nan
    return Motion(t, np.zeros_like(dq), dq, np.zeros_like(dq))


@pytest.mark.parametrize("every", [20, 50, 100])
def test_neither_are_samples_that_were_lost_here_and_there(every: int) -> None:
    """Cut at each of them, stretches would be too short to tell a frequency."""
    whole = motion(0.0, "samples")
    keep = np.arange(len(whole.t)) % every != every - 1
    holed = Motion(*(x[keep] for x in (whole.t, whole.q, whole.dq, whole.ddq)))
    assert wanted_cutoff(holed, RATE) == pytest.approx(wanted_cutoff(whole, RATE), rel=0.05)


@pytest.mark.parametrize("missing", ["samples", "numbers"])
@pytest.mark.parametrize("gap", [0.0, 0.1, 0.4, 0.8])
def test_a_gap_is_no_fast_motion(gap: float, missing: str) -> None:
    """Laid end to end, a gap of 0.4 s would jump, and ask for a low-pass of six times the frequency."""
    whole = wanted_cutoff(motion(0.0, missing), RATE)
    assert whole == pytest.approx(5.0 * FASTEST, rel=0.05)
    assert wanted_cutoff(motion(gap, missing), RATE) == pytest.approx(whole, rel=0.15)


def slow(f: float) -> Motion:
    """Forty seconds of two joints that turn to and fro at `f` [Hz], and one that is held."""
    t = np.arange(0.0, 40.0, 1.0 / RATE)
    x = 2.0 * np.pi * f * t
    dq = np.stack([np.sin(x), np.cos(x), np.zeros_like(t)], axis=1)
    return Motion(t, np.zeros_like(dq), dq, np.zeros_like(dq))


@pytest.mark.parametrize("f", [0.1, 0.2])
def test_a_slow_motion_keeps_the_harmonics_of_friction_that_changes_sign(f: float) -> None:
    """Five harmonics of a square wave lack a twelfth of its power, forty a hundredth."""
    assert 25.0 * f < wanted_cutoff(slow(f), RATE) < 45.0 * f


def test_the_harmonics_of_friction_end_where_arms_may_bend() -> None:
    """At 1 Hz the fortieth would be far above the first mode of many arms."""
    assert wanted_cutoff(slow(1.0), RATE) == 10.0


def test_how_fast_a_joint_moves_does_not_change_the_cut_off() -> None:
    """Friction changes its sign as often, however far the joint goes."""
    fast = slow(0.2)
    assert wanted_cutoff(replace(fast, dq=5.0 * fast.dq), RATE) == wanted_cutoff(fast, RATE)
