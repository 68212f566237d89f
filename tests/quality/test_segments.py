"""Which samples a stage may use."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.quality.segments import usable
from tests.fault_table import FAULTS
from tests.healthy import good_log, healthy_logs, rows, with_signal

MAKE = {fault.row: fault.make for fault in FAULTS}


def test_a_good_log_is_usable_from_end_to_end() -> None:
    good = usable(good_log())
    assert good.runs == (slice(0, 6000),)
    assert good.fit.all()
    np.testing.assert_array_equal(good.log.q, good_log().q)


@pytest.mark.parametrize("log", healthy_logs(range(3)), ids=lambda log: log.name)
def test_no_healthy_sample_is_lost(log) -> None:  # type: ignore[no-untyped-def]
    assert usable(log).fit.all()


def test_a_clock_set_back_splits_the_log() -> None:
    assert usable(MAKE["T01"](good_log())).runs == (slice(0, 3000), slice(3000, 6000))


def test_dropped_samples_do_not_split_and_gaps_do() -> None:
    """Ten missing samples are predicted through, eleven are not."""
    for hole, runs in ((10, 1), (11, 2)):
        keep = np.ones(6000, dtype=bool)
        keep[2000:2000 + hole] = False
        assert len(usable(rows(good_log(), keep)).runs) == runs


def test_fillers_and_infinities_become_missing() -> None:
    """Nothing that is left is not finite, and nothing is a filler."""
    for row in ("D03 inf", "D03 filler"):
        good = usable(MAKE[row](good_log()))
        assert np.isfinite(good.log.q[good.fit]).all()
        assert np.isfinite(good.log.tau[good.fit]).all()
        assert np.abs(good.log.q[good.fit]).max() < 10
        assert int((~good.fit).sum()) in (1, 2, 3)


def test_wraps_are_undone_exactly() -> None:
    """The unwrapped position is the original, up to whole turns."""
    good = usable(MAKE["D07 turn"](good_log()))
    jumps = np.abs(np.diff(good.log.q, axis=0))
    assert jumps.max() < 0.02
    assert good.runs == (slice(0, 6000),)


def test_glitches_are_masked_where_they_were_planted() -> None:
    log = MAKE["D06 q"](good_log())
    planted = np.abs(log.q - good_log().q).max(axis=1) > 0.01
    np.testing.assert_array_equal(~usable(log).fit, planted)


def test_saturated_samples_are_masked() -> None:
    log = with_signal(good_log(), tau=np.clip(good_log().tau, -8.0, 8.0))
    expected = (np.abs(log.tau) == 8.0).any(axis=1)
    assert np.mean(usable(log).fit == ~expected) > 0.99


def test_nothing_after_an_emergency_stop_is_used() -> None:
    assert usable(MAKE["D11 power"](good_log())).runs == (slice(0, 4000),)


def test_every_fault_leaves_finite_samples_only() -> None:
    """Whatever the fault, what `fit` lets through is finite and its time runs forward."""
    for fault in FAULTS:
        good = usable(fault.make(good_log()))
        for run in good.runs:
            assert (np.diff(good.log.t[run]) > 0).all(), fault.row
            assert np.isfinite(good.log.q[run][good.fit[run]]).all(), fault.row
            assert np.isfinite(good.log.tau[run][good.fit[run]]).all(), fault.row
