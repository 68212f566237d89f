"""What is mended is mended honestly: nothing is filled in, everything done is said, the rest is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.errors import Check, InputRejected
from pipelines.importers.repair import Limits, Recording, late_intervals, repair
from pipelines.io.limits import FEWEST, GAP_LIMIT
from tests.importers.good import Array, recording


def changed(signal: str, at: object, joint: int, value: float) -> Recording:
    """The good recording with some samples of one joint set to `value`."""
    good_one = recording()
    values = good_one.signals[signal].copy()
    values[at, joint] = value  # type: ignore[call-overload]
    return replace(good_one, signals={**good_one.signals, signal: values})


def clocked(t: Array) -> Recording:
    return replace(recording(), t=t)


def levels(checks: tuple[Check, ...]) -> dict[str, str]:
    return {check.code.removeprefix("RRID-"): check.level for check in checks}


def test_a_good_recording_is_left_alone() -> None:
    parts, checks = repair(recording(), Limits())
    assert len(parts) == 1
    assert not checks
    assert np.array_equal(parts[0].signals["tau"], recording().signals["tau"])


def test_d01_an_isolated_nan_leaves_a_gap_in_time() -> None:
    """D01: two holes are left out, nothing is put in their place."""
    (part,), checks = repair(changed("q", [100, 700], 1, np.nan), Limits())
    assert levels(checks) == {"D01": "repair", "T03": "warn"}
    assert "lines 102, 702" in checks[0].message
    assert part.t.size == 1198
    assert np.isclose(np.diff(part.t).max(), 0.002)
    assert np.array_equal(part.signals["q"], np.delete(recording().signals["q"], [100, 700], axis=0))


@pytest.mark.parametrize(("where", "words"), [(slice(None), "no number at all"), (slice(300, 800), "42 % of its samples")])
def test_d02_a_channel_of_holes_is_named(where: slice, words: str) -> None:
    with pytest.raises(InputRejected, match=f"RRID-D02.*column 'tau_3'.*{words}"):
        repair(changed("tau", where, 2, np.nan), Limits())


@pytest.mark.parametrize("value", [np.inf, -np.inf, 1e300, 1e10, -999.0, 32767.0])
def test_d03_an_absurd_number_is_refused_unless_it_is_declared_missing(value: float) -> None:
    bad = changed("q", [10, 20], 0, value)
    with pytest.raises(InputRejected, match=r"RRID-D03.*column 'q_1'.*lines 12, 22.*Add|RRID-D03.*lines 12, 22.*missing"):
        repair(bad, Limits())
    (part,), checks = repair(bad, Limits(missing=(value,)))
    assert levels(checks)["D03"] == "repair"
    assert part.t.size == 1198


def test_t01_a_clock_that_was_set_back_splits_the_log() -> None:
    t = recording().t.copy()
    t[500:] -= 0.3
    parts, checks = repair(clocked(t), Limits())
    assert [part.t.size for part in parts] == [500, 700]
    assert all((np.diff(part.t) > 0).all() for part in parts)
    assert levels(checks) == {"T01": "repair"}
    assert "line 502" in checks[0].message
    assert "split into 2 parts" in checks[0].message


def test_t01_a_part_too_short_for_a_log_is_no_part_of_a_split() -> None:
    t = recording().t.copy()
    t[3:] -= 0.3
    parts, checks = repair(clocked(t), Limits())
    assert [part.t.size for part in parts] == [1197]
    assert "one part is kept, 3 samples of short parts left out" in checks[0].message


def test_t01_a_clock_that_runs_wild_is_refused() -> None:
    t = recording().t.copy()
    for k in range(100, 1200, 50):
        t[k:] -= 0.06
    with pytest.raises(InputRejected, match=r"RRID-T01.*runs backwards 22 times \(lines 102"):
        repair(clocked(t), Limits())


def test_t02_a_sample_written_twice_is_dropped() -> None:
    good_one = recording()
    twice = good_one.take(np.repeat([True], 1200))
    index = np.insert(np.arange(1200), 300, 299)
    twice = replace(good_one, t=good_one.t[index], places=np.arange(2, 1203),
                    signals={k: v[index] for k, v in good_one.signals.items()})
    (part,), checks = repair(twice, Limits())
    assert levels(checks) == {"T02": "repair"}
    assert np.array_equal(part.t, good_one.t)


def test_t02_one_stamp_with_two_values_is_refused() -> None:
    t = recording().t.copy()
    t[300] = t[299]
    with pytest.raises(InputRejected, match=r"RRID-T02.*twice with different values \(line 302\).*more digits"):
        repair(clocked(t), Limits())


def test_t03_lost_samples_stay_lost() -> None:
    keep = np.ones(1200, dtype=bool)
    keep[[50, 400, 401, 900]] = False
    (part,), checks = repair(recording().take(keep), Limits())
    assert levels(checks) == {"T03": "warn"}
    assert "4 samples (0.33 %) lost in 3 gaps" in checks[0].message
    assert part.t.size == 1196


def test_t04_nothing_is_interpolated_across_a_long_gap() -> None:
    keep = np.ones(1200, dtype=bool)
    keep[400:600] = False
    for limits in (Limits(), Limits(resampled=True), Limits(longest_gap=1.0)):
        parts, checks = repair(recording().take(keep), limits)
        assert levels(checks) == {"T04": "repair"}
        assert [part.t.size for part in parts] == [400, 600]
    assert len(repair(recording().take(keep), Limits(longest_gap=1.0, resampled=True))[0]) == 1


@pytest.mark.parametrize(("lost", "parts"), [(GAP_LIMIT, 1), (GAP_LIMIT + 1, 2)])
def test_t04_what_an_observer_predicts_through_is_no_gap(lost: int, parts: int) -> None:
    keep = np.ones(1200, dtype=bool)
    keep[400:400 + lost] = False
    assert len(repair(recording().take(keep), Limits())[0]) == parts


def test_t03_late_samples_are_said_once_where_they_are_resampled() -> None:
    """What the resampling bridges stands in its own record, not as a loss."""
    keep = np.ones(1200, dtype=bool)
    keep[[50, 400, 401, 900]] = False
    assert repair(recording().take(keep), Limits(resampled=True))[1] == ()
    assert late_intervals(recording().take(keep)).tolist() == [49, 398, 896]


def test_d03_what_is_absurd_is_absurd_in_si() -> None:
    """A counter of 32 bits goes beyond 1e9 counts and its joint nowhere near 1e9 rad."""
    far = changed("q", slice(None), 0, 3e9)
    with pytest.raises(InputRejected, match="RRID-D03"):
        repair(far, Limits())
    assert not repair(replace(far, si={"q": 2 * np.pi / 2**20}), Limits())[1]


def test_t04_gaps_that_are_most_of_the_recording_are_refused() -> None:
    keep = np.ones(1200, dtype=bool)
    keep[100:1000] = False
    with pytest.raises(InputRejected, match="RRID-T04"):
        repair(recording().take(keep), Limits())


def test_t05_uneven_time_is_said() -> None:
    rng = np.random.default_rng(1)
    assert levels(repair(clocked(recording().t + rng.uniform(0, 0.0004, 1200)), Limits())[1]) == {"T05": "warn"}


@pytest.mark.parametrize("count", [0, 1, 5, FEWEST - 1])
def test_t08_hardly_a_sample_is_no_log(count: int) -> None:
    with pytest.raises(InputRejected, match=f"RRID-T08.*{count} sample"):
        repair(recording().take(slice(0, count)), Limits())


def test_f09_without_a_clock_damage_splits_the_log() -> None:
    """F09: with a fixed rate nobody knows how many samples a torn line stands for."""
    parts, checks = repair(replace(recording(), clocked=False, breaks=(499,)), Limits())
    assert [part.t.size for part in parts] == [499, 701]
    assert levels(checks) == {"F09": "repair"}
