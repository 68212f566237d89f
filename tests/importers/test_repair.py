"""What is mended is mended honestly: nothing is filled in, everything done is said, the rest is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.errors import Check, InputRejected
from pipelines.importers.repair import Limits, Recording, repair
from pipelines.io.limits import GAP_LIMIT
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


def test_d01_an_isolated_nan_leaves_a_gap_in_time() -> None:
    """D01: two holes are left out, nothing is put in their place."""
    (part,), checks = repair(changed("q", [100, 700], 1, np.nan), Limits())
    assert levels(checks) == {"D01": "repair"}
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


def test_t02_a_sample_written_twice_is_dropped() -> None:
    good_one = recording()
    twice = good_one.take(np.repeat([True], 1200))
    index = np.insert(np.arange(1200), 300, 299)
    twice = replace(good_one, t=good_one.t[index], places=np.arange(2, 1203),
                    signals={k: v[index] for k, v in good_one.signals.items()})
    (part,), checks = repair(twice, Limits())
    assert levels(checks) == {"T02": "repair"}
    assert np.array_equal(part.t, good_one.t)


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


def test_d03_what_is_absurd_is_absurd_in_si() -> None:
    """A counter of 32 bits goes beyond 1e9 counts and its joint nowhere near 1e9 rad."""
    far = changed("q", slice(None), 0, 3e9)
    with pytest.raises(InputRejected, match="RRID-D03"):
        repair(far, Limits())
    assert not repair(replace(far, si={"q": 2 * np.pi / 2**20}), Limits())[1]
