"""Orders of a joint that goes to and fro over a part of its turn."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.estimation.residual_analysis import amplitudes, least_order

ORDERS = np.arange(0.5, 80.25, 0.25)
T = np.linspace(0.0, 20.0, 2000)
TO_AND_FRO = 1.5 * np.sin(T) + 0.8 * np.sin(2.3 * T + 1.0)  # [rad] longer at some angles than at others


@pytest.mark.parametrize("order", [12.0, 18.0, 36.5])
def test_a_wave_is_one_peak(order: float) -> None:
    """Of its amplitude, and no others beside: beyond two waves of the range at most 4 % of it. The mean of x e^(-jkq) had 17 %."""
    wave = 0.3 * np.sin(order * TO_AND_FRO + 0.4)
    found = amplitudes(TO_AND_FRO, wave, ORDERS)
    most = int(np.argmax(found))
    assert ORDERS[most] == pytest.approx(order, abs=0.25)
    assert found[most] == pytest.approx(0.3, rel=0.03)
    beside = (np.abs(ORDERS - order) > least_order(TO_AND_FRO)) & (least_order(TO_AND_FRO) <= ORDERS)
    assert found[beside].max() < 0.04 * 0.3


def test_what_does_not_come_again_has_no_orders_all_over() -> None:
    """A constant torque has none, and one that grows along the range none beyond the lowest that are told."""
    told = least_order(TO_AND_FRO) <= ORDERS
    assert amplitudes(TO_AND_FRO, np.ones(len(T)), ORDERS)[told].max() < 1e-9
    grown = amplitudes(TO_AND_FRO, TO_AND_FRO / np.ptp(TO_AND_FRO), ORDERS)
    assert grown[2.0 * least_order(TO_AND_FRO) < ORDERS].max() < 0.02


def test_no_order_is_told_of_a_joint_that_stands() -> None:
    """Two waves have to fit in the range."""
    assert least_order(np.linspace(0.0, 2.0 * np.pi, 50)) == pytest.approx(2.0)
    assert least_order(np.zeros(50)) == np.inf
    assert not amplitudes(np.zeros(50), np.ones(50), ORDERS).any()
