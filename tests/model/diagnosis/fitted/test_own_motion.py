"""What a model leaves follows from a joint's own motion where a fault is in it, whatever its shape; of noise it does by chance."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.nominal import Fit, fit_columns, fit_nominal
from pipelines.model.diagnosis.fitted.own_motion import following, lasting, put_right, standing_out
from pipelines.model.rigid.body import Motion
from tests.model.diagnosis.arms import hidden

_REPLICAS = 40


def stiffening(motion: Motion) -> np.ndarray:
    """Joint 2 is damped by 0.05 N m s/rad more on one side than on the other: no effect of the library is like that."""
    out = np.zeros_like(motion.q)
    out[:, 1] = 0.05 * np.cos(motion.q[:, 1]) * motion.dq[:, 1]
    return out


@pytest.fixture(scope="module")
def healthy() -> Fit:
    prepared = prepare(Logs((hidden(1), hidden(2))), DiagnosisSettings())
    return fit_nominal(prepared.data, prepared.columns)[1]


def drawn(fit: Fit) -> np.ndarray:
    """(replicas, rows) white noise as the fit leaves it."""
    x = np.random.default_rng(7).standard_normal((_REPLICAS, fit.data.rows))
    return x - (x @ fit.basis.T) @ fit.basis


def test_of_white_noise_the_share_is_that_of_chance(healthy: Fit) -> None:
    """Twelve columns, some of which the model imitates, take 12/n of n rows at most: F is one (Seber & Lee 2003, 4.9)."""
    rows = healthy.data.rows / healthy.data.n_joints
    share = following(healthy, drawn(healthy)).mean(axis=1)
    assert ((share > 4.0 / rows) & (share < 1.3 * 12.0 / rows)).all()


def test_the_size_of_the_noise_does_not_matter(healthy: Fit) -> None:
    some = drawn(healthy)
    assert following(healthy, 3.0 * some) == pytest.approx(following(healthy, some))


def test_a_fault_without_a_name_stands_out_at_its_joint(healthy: Fit) -> None:
    usual = following(healthy, drawn(healthy)).max(axis=1)
    prepared = prepare(Logs((hidden(1, stiffening), hidden(2, stiffening))), DiagnosisSettings())
    fit = fit_nominal(prepared.data, prepared.columns)[1]
    assert standing_out(following(fit, fit.residual[None])[:, 0], usual) == [1]
    assert standing_out(following(healthy, healthy.residual[None])[:, 0], usual) == []


def slow(fit: Fit, seed: int) -> np.ndarray:
    """(rows,) noise of about a quarter of a hertz, as the fit leaves it."""
    x = np.random.default_rng(seed).standard_normal(fit.data.rows)
    x = np.concatenate([lfilter([1.0], [1.0, -0.96], row) for part in fit.data.split(x) for row in part])
    return x - (x @ fit.basis.T) @ fit.basis


def test_slow_noise_follows_some_motion_but_not_again(healthy: Fit) -> None:
    """By the measure of white noise it stands out at most joints; in time that its numbers were not fitted to, at hardly any.
    What a fault does it does again."""
    usual = following(healthy, drawn(healthy)).max(axis=1)
    first = {seed: standing_out(following(healthy, slow(healthy, seed)[None])[:, 0], usual) for seed in range(20)}
    again = {seed: lasting(healthy, slow(healthy, seed), joints) for seed, joints in first.items()}
    assert sum(map(len, first.values())) > 30
    assert sum(map(len, again.values())) <= 6
    prepared = prepare(Logs((hidden(1, stiffening), hidden(2, stiffening))), DiagnosisSettings())
    fit = fit_nominal(prepared.data, prepared.columns)[1]
    assert lasting(fit, fit.residual, [1]) == [1]


def test_what_explains_it_puts_it_right(healthy: Fit) -> None:
    usual = following(healthy, drawn(healthy)).max(axis=1)
    prepared = prepare(Logs((hidden(1, stiffening), hidden(2, stiffening))), DiagnosisSettings())
    fit = fit_nominal(prepared.data, prepared.columns)[1]
    own, other = (fit_columns(fit.data, np.concatenate([fit.table, fit.data.lay(torque)[None]]))
                  for torque in (stiffening, lambda motion: np.roll(stiffening(motion), 1, axis=1)))
    assert put_right(fit, own, usual)
    assert not put_right(fit, other, usual)
    assert not put_right(healthy, own, usual)
