"""A drawn model has the covariance of the fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.dynamics.draw import drawn
from pipelines.dynamics.parameter import Uncertainty
from sample_logs.make_model import synthetic_arm


def test_draws_have_the_covariance_of_the_fit() -> None:
    """Two base parameters that go against each other and the viscous friction of joint 2; what is not determined stays."""
    arm = synthetic_arm()
    names = ("p1", "p3", f"{arm.friction[1].place}:b", "p7")
    covariance = np.array([[4.0, -5.4, 0.0, 0.0], [-5.4, 9.0, 0.6, 0.0], [0.0, 0.6, 1.0, 0.0], [0.0, 0.0, 0.0, np.inf]]) * 1e-4
    uncertain = replace(arm, uncertainty=Uncertainty(names, covariance))
    rng = np.random.default_rng(3)
    draws = [drawn(uncertain, rng).parameters for _ in range(600)]
    off = np.array([[one[name].value - arm.parameters[name].value for name in names] for one in draws])
    np.testing.assert_allclose(np.cov(off[:, :3].T), covariance[:3, :3], atol=4.0 * 9e-4 * np.sqrt(2.0 / 600))
    assert (off[:, 3] == 0.0).all()
    assert all(one[name].value == arm.parameters[name].value for one in draws[:9] for name in one if name not in names)


def test_a_drawn_law_acts_with_its_numbers() -> None:
    """Torque follows the drawn viscous friction: Δb times the speed."""
    from pipelines.dynamics.body import Motion

    arm = synthetic_arm()
    uncertain = replace(arm, uncertainty=Uncertainty((f"{arm.friction[1].place}:b",), np.array([[0.01]])))
    other = drawn(uncertain, np.random.default_rng(1))
    off = other.parameters[f"{arm.friction[1].place}:b"].value - arm.parameters[f"{arm.friction[1].place}:b"].value
    dq = np.array([[0.5, 2.0, -1.0]])
    motion = Motion(np.zeros(1), np.zeros((1, 3)), dq, np.zeros((1, 3)))
    np.testing.assert_allclose(other.torque(motion) - arm.torque(motion), [[0.0, 2.0 * off, 0.0]], atol=1e-12)
    assert abs(off) > 0.01
