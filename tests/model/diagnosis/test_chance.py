"""Whether a gain on held-out time is chance, asked of all time where a few seconds of held-out logs leave it open."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.fit.flips import by_flips
from pipelines.model.diagnosis import chance

ROWS, FITTED = 2000, 8000  # 12 s of held-out logs beside 40 s of fitted ones, say
DRAWS = 100


class Time:
    """Rows of one joint."""

    def __init__(self, rows: int) -> None:
        self.joint, self.counts, self.n_joints, self.ripple = np.zeros(rows, dtype=int), np.ones(rows, dtype=bool), 1, None

    def blocks(self, count: int) -> Any:
        return np.arange(len(self.joint)) * count // len(self.joint)

    def rms(self, torque: Any) -> Any:
        return np.sqrt([np.mean(np.square(torque))])


HELD: Any = Time(ROWS)
OWN: Any = Time(FITTED)


def left(held: Any, fitted: Any) -> Any:
    """A model that leaves so much of the held-out logs, and of the fitted ones block by block."""
    model = SimpleNamespace(torque=lambda data: np.ones(len(data.joint)),
                            without=lambda place: SimpleNamespace(torque=lambda data: np.zeros(len(data.joint))))
    return SimpleNamespace(held=held, fitted=fitted, data=OWN, weight=np.ones(1), model=model,
                           fit=SimpleNamespace(project=lambda torque: torque))


@pytest.fixture(autouse=True)
def known(monkeypatch: pytest.MonkeyPatch) -> None:
    def some(done: Any, judge: Any, blocks: int) -> Any:
        return done.fitted if judge is None else done.held
    monkeypatch.setattr(chance, "held_out_left", some)


def noise(rng: np.random.Generator, rows: int, size: float = 1.0) -> Any:
    return size * rng.standard_normal(rows)


def test_all_time_tells_what_a_few_seconds_leave_open() -> None:
    """A cause of a tenth of the noise: nearly always told by all time, in less than half of the draws by the held-out logs alone;
    two models that are equally wrong are told apart in one of a hundred draws at most."""
    rng = np.random.default_rng(9)
    told = alone = false = 0
    for _ in range(DRAWS):
        held, fitted = noise(rng, ROWS), noise(rng, FITTED)
        cause = [noise(rng, rows, 0.1) for rows in (ROWS, FITTED)]
        moved = [noise(rng, rows, 0.1) for rows in (ROWS, FITTED)]
        before, after = left(held + cause[0], fitted + cause[1]), left(held, fitted)
        told += chance.by_all_time(before, after, 0, HELD, 10)
        alone += by_flips(chance._gains(before, after, np.ones(1, dtype=bool), HELD, 10)) <= chance._RARE
        false += chance.by_all_time(before, left(held + moved[0], fitted + moved[1]), 0, HELD, 10)
    assert told > 0.9 * DRAWS
    assert alone < 0.5 * DRAWS
    assert false <= 1


def test_held_out_logs_have_to_gain_at_all() -> None:
    """However much the fitted time gains: what makes held-out logs worse is a shape of the fitted ones."""
    rng = np.random.default_rng(10)
    held, fitted = noise(rng, ROWS), noise(rng, FITTED)
    cause = noise(rng, FITTED)
    assert chance.by_all_time(left(1.001 * held, fitted + cause), left(held, fitted), 0, HELD, 10)
    assert not chance.by_all_time(left(0.999 * held, fitted + cause), left(held, fitted), 0, HELD, 10)


@pytest.mark.parametrize(("times", "refused"), [(1.5, True), (2.5, True), (3.5, False)])
def test_all_time_is_asked_only_of_what_stands_far_above_an_arm_in_order(times: float, refused: bool,
                                                                        monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a cause that held-out logs leave open: the fitted logs chose it, and near its threshold it may be their shape."""
    rng = np.random.default_rng(11)
    held, fitted = noise(rng, ROWS), noise(rng, FITTED)
    before, after = left(1.001 * held, fitted + noise(rng, FITTED)), left(held, fitted)
    monkeypatch.setattr(chance, "by_chance", lambda *_: True)
    monkeypatch.setattr(chance, "surely_less", lambda *_: False)
    step: Any = SimpleNamespace(trials=(SimpleNamespace(accepted=True, gain=times, threshold=1.0),))
    assert chance.no_name(step, before, after, 0, HELD, 10) is refused


@pytest.mark.parametrize("white", [False, True])
@pytest.mark.parametrize(("lone", "held_out", "refused"), [(False, 1.001, True), (True, 1.001, False), (True, 0.999, True)])
def test_what_stands_alone_is_asked_of_all_time_near_its_threshold_too(lone: bool, held_out: float, refused: bool, white: bool,
                                                                      monkeypatch: pytest.MonkeyPatch) -> None:
    """It is the rest of no other cause; what makes held-out logs worse is refused all the same."""
    rng = np.random.default_rng(13)
    held, fitted = noise(rng, ROWS), noise(rng, FITTED)
    before, after = left(held_out * held, fitted + noise(rng, FITTED)), left(held, fitted)
    monkeypatch.setattr(chance, "by_flips", lambda gains: 0.01)  # between the two bounds
    monkeypatch.setattr(chance, "by_chance", lambda *_: True)
    step: Any = SimpleNamespace(trials=(SimpleNamespace(accepted=True, gain=1.2, threshold=1.0),))
    assert chance.no_name(step, before, after, 0, HELD, 10, white, lone) is refused


def test_two_models_that_are_equally_wrong_are_seldom_told_apart_alone() -> None:
    rng = np.random.default_rng(14)
    false = 0
    for _ in range(DRAWS):
        held, fitted = noise(rng, ROWS), noise(rng, FITTED)
        one, other = ([noise(rng, rows, 0.1) for rows in (ROWS, FITTED)] for _ in range(2))
        false += chance.by_all_time(left(held + one[0], fitted + one[1]), left(held + other[0], fitted + other[1]), 0, HELD, 10,
                                    chance._SELDOM)
    assert false <= 5
