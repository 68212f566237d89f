"""A cause of a joint is reported once, however many waves it has."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.model.diagnosis.named.findings import _told
from pipelines.model.diagnosis.named.joined import once_each
from pipelines.model.diagnosis.result import Finding, Gain, Rival, TorqueGain, Value


def finding(cause: str, joint: int, orders: tuple[float, ...], explained: float, rms: float) -> Finding:
    names = ["order", *(f"order_{k}" for k in range(2, len(orders) + 1))]
    gain = Gain(TorqueGain(np.ones(1), np.ones(1), np.zeros((1, 2))), None, "none", None)
    return Finding(cause, joint, cause, {name: Value(order, None, "1/rev") for name, order in zip(names, orders, strict=True)},
                   explained, 1.0, (Rival("cogging", 1, 0.9), Rival("spring", 1, 0.8)), None, gain, "residual", rms, np.nan, None)


def test_waves_of_one_joint_are_one_finding_and_counted_on() -> None:
    first, other = finding("cogging", 1, (7.0, 14.0, 21.0), 0.5, 3e-3), finding("cogging", 1, (12.0, 24.0), 0.2, 4e-3)
    elsewhere = finding("cogging", 2, (5.0,), 0.1, 1e-3)
    one, two = once_each((first, other, elsewhere))
    assert [value.value for value in one.parameters.values()] == [7.0, 14.0, 21.0, 12.0, 24.0]
    assert list(one.parameters) == ["order", "order_2", "order_3", "order_4", "order_5"]
    assert (one.explained, one.torque_rms) == pytest.approx((0.7, 5e-3))
    assert [rival.cause for rival in one.rivals] == ["spring"]
    assert two is elsewhere


def test_waves_of_one_joint_are_told_together_in_the_place_of_their_sum() -> None:
    """The lag takes more than any wave, and the two waves together more than the lag."""
    causes = [("torque_lag", 1), ("cogging", 1), ("spring", 2), ("cogging", 1), ("cogging", 2)]
    assert _told(causes, [0.3, 0.2, 0.1, 0.25, 0.05]) == [[3, 1], [0], [2], [4]]
