"""Which samples a stage may use."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.quality.segments import SHORTEST, usable
from tests.fault_table import FAULTS
from tests.faulty import drifting
from tests.healthy import changed, good_log, healthy_logs, make_log, rows, with_signal

MAKE = {fault.row: fault.make for fault in FAULTS}


def test_a_good_log_is_usable_from_end_to_end() -> None:
    good = usable(good_log())
    assert good.runs == (slice(0, 6000),)
    assert good.fit.all()
    np.testing.assert_array_equal(good.log.q, good_log().q)


@pytest.mark.parametrize("log", healthy_logs(range(3)), ids=lambda log: log.name)
def test_no_healthy_sample_is_lost(log) -> None:  # type: ignore[no-untyped-def]
    assert usable(log).fit.all()


def test_the_recording_is_not_changed() -> None:
    log = MAKE["D07 counter"](good_log())
    before = log.q.copy()
    assert not np.array_equal(usable(log).log.q, before)
    np.testing.assert_array_equal(log.q, before)


@pytest.mark.parametrize("row", ["S08 ms", "S08 us", "S08 ns"])
def test_time_runs_in_seconds(row: str) -> None:
    good = usable(MAKE[row](good_log()))
    np.testing.assert_allclose(good.log.t, good_log().t, rtol=1e-12, atol=1e-12)
    assert good.runs == (slice(0, 6000),)


def test_a_clock_set_back_splits_the_log() -> None:
    assert usable(MAKE["T01"](good_log())).runs == (slice(0, 3000), slice(3000, 6000))


def test_repeated_samples_are_dropped() -> None:
    good = usable(MAKE["T02"](good_log()))
    np.testing.assert_array_equal(good.log.q, good_log().q)
    assert good.kept[3000] == 3000
    assert good.kept[3001] == 3002


def test_dropped_samples_do_not_split_and_gaps_do() -> None:
    """Ten missing samples are predicted through, eleven are not."""
    for hole, runs in ((10, 1), (11, 2)):
        keep = np.ones(6000, dtype=bool)
        keep[2000:2000 + hole] = False
        assert len(usable(rows(good_log(), keep)).runs) == runs


def test_missing_blocks_split_and_single_ones_are_masked() -> None:
    log = changed(changed(good_log(), "tau", (slice(2000, 2400), 0), np.nan), "q", (100, 1), np.nan)
    good = usable(log)
    assert good.runs == (slice(0, 2000), slice(2400, 6000))
    assert not good.fit[100]
    assert good.missing[100].tolist() == [False, True, False]


def test_fillers_and_infinities_become_missing() -> None:
    """Nothing that is left is not finite, and nothing is a filler."""
    for row in ("D03 inf", "D03 huge", "D03 filler"):
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


def test_lost_counts_split_the_log() -> None:
    assert usable(MAKE["D07 lost"](good_log())).runs == (slice(0, 2501), slice(2501, 6000))


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


@pytest.mark.parametrize("samples", [0, 1, 2, 19, SHORTEST - 1, SHORTEST])
def test_short_logs_have_no_run(samples: int) -> None:
    good = usable(rows(good_log(), slice(0, samples)))
    assert len(good.runs) == (samples >= SHORTEST)


def test_every_fault_leaves_finite_samples_only() -> None:
    """Whatever the fault, what `fit` lets through is finite and its time runs forward."""
    for fault in FAULTS:
        good = usable(fault.make(good_log()))
        for run in good.runs:
            assert (np.diff(good.log.t[run]) > 0).all(), fault.row
            assert np.isfinite(good.log.q[run][good.fit[run]]).all(), fault.row
            assert np.isfinite(good.log.tau[run][good.fit[run]]).all(), fault.row


def test_a_slow_sine_with_rests_is_left_alone() -> None:
    """A motion of 0.05 Hz, quantised: long stretches hold one encoder count."""
    def slow(t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        w = 2 * np.pi * 0.05
        one = np.ones((1, 3)) * 0.01
        return np.sin(w * t)[:, None] * one, w * np.cos(w * t)[:, None] * one, -w**2 * np.sin(w * t)[:, None] * one

    assert usable(make_log(slow, "free", duration=20.0)).fit.all()


def test_a_drifting_clock_is_not_a_matter_of_segments() -> None:
    assert usable(drifting(good_log(), 3.0)).runs == (slice(0, 6000),)
