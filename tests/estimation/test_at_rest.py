"""Where a joint stands, dry friction holds it with any torque that it bears: no law tells which, and no cause is to be found in it.

A slide with dry friction of 20 N that goes from point to point and stands there; its motor then gives what it happens to.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.estimation.estimate import Recipe
from pipelines.estimation.preparation import Logs, prepare
from pipelines.io.log import Array, Controller, ExperimentLog, Signal
from tests.diagnosis.asking import answered
from tests.diagnosis.slides import SLIDE

_RATE, _MOVE, _REST, _OFFSET = 500.0, 0.6, 0.4, -3.2  # [Hz], [s], [s], [N]
_PLACES = np.array([0.0, 0.22, 0.02, 0.24, 0.12, 0.18])  # [m]


def _moves(count: int) -> tuple[Array, Array, Array, Array]:
    """Position, speed, acceleration, and the number of the rest (0: none); every move a polynomial of the seventh degree."""
    x = np.arange(0.0, 1.0, 1.0 / (_MOVE * _RATE))
    rise = np.polynomial.Polynomial([0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0])
    parts = []
    for k in range(count):
        start, end = _PLACES[k % len(_PLACES)], _PLACES[(k + 1) % len(_PLACES)]
        still = np.zeros(round(_REST * _RATE))
        parts.append([np.append(start + (end - start) * rise(x), still + end),
                      np.append((end - start) * rise.deriv()(x) / _MOVE, still),
                      np.append((end - start) * rise.deriv(2)(x) / _MOVE**2, still),
                      np.append(np.zeros(len(x)), still + 1.0 + k % len(_PLACES))])
    q, dq, ddq, rest = (np.concatenate(some) for some in zip(*parts, strict=True))
    return q, dq, ddq, rest


def slide(seed: int, role: str, held: float, dry: float = 20.0) -> ExperimentLog:
    """Five rounds of six places; at each the motor gives up to `held` [N] more or less, the same each time it stops there."""
    rng, (q, dq, ddq, rest) = np.random.default_rng([12, seed]), _moves(30)
    stuck = np.random.default_rng(2).uniform(-held, held, len(_PLACES))
    tau = 95.0 * ddq + 200.0 * dq + dry * np.sign(dq) + _OFFSET + rng.standard_normal(len(q))
    tau += np.where(rest > 0.0, stuck[np.maximum(rest, 1.0).astype(int) - 1], 0.0)
    seen = {"t": (np.arange(len(q)) / _RATE, "s"), "q": (np.round(q / 1e-6)[:, None] * 1e-6, "m"), "tau": (tau[:, None], "N")}
    signals = {name: Signal(values, unit, name) for name, (values, unit) in seen.items()}
    return ExperimentLog(f"moves-{seed}", "free", role, "measured", "slide", 1.0 / _RATE, SLIDE, signals, torque="measured")


def _counting(*logs: ExperimentLog) -> float:
    data = prepare(Logs(logs), Recipe()).data
    return float(data.counts.mean())


@pytest.mark.slow
def test_what_friction_holds_at_rest_is_no_cause() -> None:
    """The offset keeps its name, and nothing that the places have in common gets another."""
    found = answered(Logs((slide(1, "identify", 18.0),)))
    assert [one.cause for one in found.findings] == ["torque_offset"]
    told = found.findings[0].parameters["offset"]
    assert told.std is not None
    assert abs(told.value - _OFFSET) < 4.0 * told.std


def test_rests_are_left_out_where_friction_holds_the_joint() -> None:
    """Of a second 0.4 s, and next to it; not where it has no dry friction: what a motor gives at rest tells
    as much then as in motion.
    """
    assert 0.3 < _counting(slide(1, "identify", 18.0)) < 0.6
    assert _counting(slide(1, "identify", 0.0, dry=0.0)) == 1.0


def test_a_controller_of_unknown_law_is_none() -> None:
    assert _counting(replace(slide(1, "identify", 18.0), controller=Controller("unknown"))) < 0.6


def test_rests_count_where_the_controller_is_known() -> None:
    """Where the log describes its controller, rows at rest stay."""
    log = replace(slide(1, "identify", 18.0), controller=Controller("pd", kp=np.array([1e5]), kd=np.array([4e3])))
    assert _counting(log) == 1.0
