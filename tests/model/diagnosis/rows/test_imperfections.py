"""What any drive in order has is of the size of drives of its kind."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.model.diagnosis.rows.imperfections import drive_waves, ripple_orders, small_loads
from pipelines.model.rigid.body import Motion


@pytest.mark.parametrize(("rated", "most"), [
    ((2000.0, 60.0, 5.0), (2000.0, 60.0, 60.0)), ((np.inf, np.inf, np.inf), (7.0, 7.0, 7.0))])
def test_the_cogging_of_a_wrist_is_none_of_a_slide(rated: tuple[float, ...], most: tuple[float, ...]) -> None:
    """Joint 1 slides at up to 2 kN, joints 2 and 3 turn: 2e-5 of the largest rated torque of their own kind, not of a force. Where
    none is rated, of the largest that there was."""
    t = np.linspace(0.0, 1.0, 2001)
    q = np.stack([0.5 * t, 7.0 * t, 7.0 * t], axis=1)  # no torque, so that the ripple of its constant is none
    tau = np.zeros_like(q)
    if not np.isfinite(rated).any():
        tau[-1] = 7.0
    arm: Any = SimpleNamespace(torque=lambda motion: tau, robot=SimpleNamespace(
        joints=[SimpleNamespace(torque=one) for one in rated], revolute=(False, True, True)))
    drives, = drive_waves((False, True, True), [3])
    still = Motion(t, q, np.zeros_like(q), np.zeros_like(q))
    found = small_loads(still, arm, np.zeros(3), 5e-4, drives, np.random.default_rng(3))[:-1]
    np.testing.assert_allclose(np.abs(found).max(axis=0), 2e-5 * np.array(most), rtol=0.02)


@pytest.mark.parametrize("first", range(6))
def test_drives_of_ten_replicas_have_all_orders_between_them(first: int) -> None:
    """6 to 39 waves a turn: in each tenth of that range one replica has its ripple, at every joint, and none beyond."""
    waves = drive_waves((True, True, True), range(first, first + 10))
    orders = np.array([one.order for one in waves])
    assert (orders == np.round(orders)).all()
    for place in np.ndindex(2, 3):
        spread = np.sort(orders[:, *place])
        assert 6 <= spread[0] <= 9
        assert 36 <= spread[-1] <= 39
        assert np.diff(spread).max() <= 7  # two tenths
    assert len({tuple(one.tolist()) for one in orders.reshape(10, -1).T}) == 6  # not the same at every joint


def test_drives_are_drawn_alike_for_the_same_replicas() -> None:
    one, other = (drive_waves((True, False), range(4, 8)) for _ in range(2))
    assert all(np.array_equal(a.order, b.order) and np.array_equal(a.phase, b.phase) for a, b in zip(one, other, strict=True))


def test_magnets_along_a_slide_are_centimetres_apart() -> None:
    pitch = np.array([2.0 * np.pi / one.order[:, 0] for one in drive_waves((False, True), range(10))])  # [m]
    assert 0.01 < pitch.min() < 0.02
    assert 0.07 < pitch.max() < 0.11
    for turns in (True, False):  # what numbers are weighed with knows the same orders
        known = set(ripple_orders(turns).tolist())
        assert known >= {float(one.order[0, 0]) for one in drive_waves((turns,), range(10))}
        assert (min(known), max(known)) == ((6.0, 39.0) if turns else (60.0, 390.0))
