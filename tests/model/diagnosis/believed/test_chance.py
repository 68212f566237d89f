"""Whether a gain on held-out time is chance, asked of all time where a few seconds of held-out logs leave it open."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.fit.flips import by_flips
from pipelines.model.diagnosis.believed import chance
from pipelines.model.diagnosis.result import TorqueGain

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


def seen_at(*share: float) -> Any:
    """A model that leaves so much of an effect at each joint when it has imitated what it can."""
    return SimpleNamespace(fit=SimpleNamespace(project=lambda torque: np.sqrt(share)))


@pytest.mark.parametrize(("joint", "seen", "lucky"), [
    (1, (1.0, 0.0, 0.0), False), (3, (0.0, 0.0, 1.0), True), (3, (0.4, 0.0, 0.6), True), (3, (0.9, 0.0, 0.1), False)])
def test_what_falls_where_a_cause_neither_acts_nor_is_seen_is_no_argument_for_it(
        joint: int, seen: tuple[float, ...], lucky: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Held-out time shows less at joint 1 alone: a cause at joint 3 has no part in that, whatever the fit made of other numbers;
    but where the model can imitate it at joint 3, and not what that does to joint 1, it is seen there."""
    acts = np.where(np.arange(1, 4) == joint, 1.0, 1e-15)  # rounding elsewhere: without it the torque is worked out otherwise
    model = SimpleNamespace(torque=lambda data: acts,
                            without=lambda place: SimpleNamespace(torque=lambda data: np.zeros(3)))
    after: Any = SimpleNamespace(model=model, data=SimpleNamespace(rms=np.abs, joint=np.arange(3)))
    less = TorqueGain(np.array([0.5, 0.1, 0.1]), np.array([0.2, 0.1, 0.1]), np.array([[-0.4, -0.2], [-0.1, 0.1], [-0.1, 0.1]]))
    monkeypatch.setattr(chance, "torque_gain", lambda *_: less)
    assert chance.by_chance(seen_at(*seen), after, 0, None, 10) is lucky


@pytest.mark.parametrize(("rest", "high", "gain", "whole", "lucky"), [
    (0.093, -0.001, 1.5, False, False),
    (0.097, -0.001, 1.5, True, True), (0.097, -0.001, 3.0, False, False),  # 3 %, beyond doubt
    (0.097, 0.001, 3.0, False, True), (0.097, 0.001, 3.0, True, False)])
def test_what_is_sure_and_little_is_no_name(rest: float, high: float, gain: float, whole: bool, lucky: bool,
                                            monkeypatch: pytest.MonkeyPatch) -> None:
    """An arm in order has 3 % of the held-out error in its ripple: it takes a gain far beyond any replica's to be told by less.
    What one joint does not bear out, all together may."""
    model = SimpleNamespace(torque=lambda data: np.ones(1), without=lambda place: SimpleNamespace(torque=lambda data: np.zeros(1)))
    after: Any = SimpleNamespace(model=model, data=SimpleNamespace(rms=np.abs, joint=np.arange(1)))
    little = TorqueGain(np.array([0.1]), np.array([rest]), np.array([[-0.01, high]]))
    monkeypatch.setattr(chance, "torque_gain", lambda *_: little)
    monkeypatch.setattr(chance, "surely_less", lambda *_: whole)
    step: Any = SimpleNamespace(trials=(SimpleNamespace(accepted=True, gain=gain, threshold=1.0),))
    assert chance.no_name(step, seen_at(1.0), after, 0, None, 10) is lucky
