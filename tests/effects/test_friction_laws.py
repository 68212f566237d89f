"""The friction laws against numbers computed elsewhere."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipelines.dynamics.body import Array, Motion
from pipelines.effects.friction import Coulomb, ThreeSigmoid, TwoSigmoid
from sample_logs.make_model import FRICTION, synthetic_arm


def named(f: list[float], w: list[float], b: float) -> dict[str, float]:
    return ({f"f{k}": value for k, value in enumerate(f, start=1)}
            | {f"w{k}": value for k, value in enumerate(w, start=1)} | {"b": b})


def test_three_sigmoids_against_the_reference(vectors: dict[str, Any]) -> None:
    """Eq. (10) as sums of tanh equals the reference, far beyond where its exponential overflows."""
    form = vectors["friction_form"]
    values = named(form["f"], form["w"], form["b"])
    curve = ThreeSigmoid(1).curve(np.array(form["dq"], dtype=float), synthetic_arm(), values)
    np.testing.assert_allclose(curve, form["tau"], rtol=1e-14, atol=1e-15)


def test_three_sigmoids_equal_the_printed_form() -> None:
    """1 - 2/(exp(2 w v) + 1) = tanh(w v)."""
    v = np.linspace(-2, 2, 401)
    sigmoids = [f * (1 - 2 / (np.exp(2 * w * v) + 1)) for f, w in zip((3, -1, 0.5), (90, 20, 2), strict=True)]
    printed = sum(sigmoids) + 0.1 * v
    ours = ThreeSigmoid(3).curve(v, synthetic_arm(), named([3, -1, 0.5], [90, 20, 2], 0.1))
    np.testing.assert_allclose(ours, printed, rtol=1e-12, atol=1e-12)


def test_the_synthetic_friction_is_that_of_the_reference(vectors: dict[str, Any]) -> None:
    """The sample model carries the synthetic friction, in canonical order."""
    for given, (f, w, b) in zip(vectors["synthetic_friction"], FRICTION, strict=True):
        canonical = ThreeSigmoid.canonical(named(given["f"], given["w"], given["b"]))
        assert canonical == named(list(f), list(w), b)


@pytest.mark.parametrize("seed", range(5))
def test_forty_eight_sets_are_one(seed: int) -> None:
    """Whatever order and signs a fit returns, the canonical set is the same and so is the curve."""
    rng = np.random.default_rng(seed)
    f, w = rng.normal(size=3), np.sort(rng.uniform(1, 200, 3))[::-1]
    order, sign = rng.permutation(3), rng.choice([-1.0, 1.0], 3)
    shuffled = named((f[order] * sign).tolist(), (w[order] * sign).tolist(), 0.3)
    assert ThreeSigmoid.canonical(shuffled) == named(f.tolist(), w.tolist(), 0.3)
    v, arm = np.linspace(-3, 3, 50), synthetic_arm()
    np.testing.assert_allclose(ThreeSigmoid(1).curve(v, arm, shuffled),
                               ThreeSigmoid(1).curve(v, arm, ThreeSigmoid.canonical(shuffled)), rtol=1e-12)


def test_the_grid_is_ordered_and_finds_a_known_curve() -> None:
    """Every shape has w1 > w2 > w3 > 0, and the best of them leaves 1 % of the synthetic friction curve."""
    arm, v = synthetic_arm(), sweep()
    still = np.zeros((len(v), 3))
    motion = Motion(np.linspace(0.0, 0.599, len(v)), still, np.stack([v, v, v], axis=1), still)
    f, w, b = FRICTION[1]
    truth = ThreeSigmoid(2).curve(v, arm, named(list(f), list(w), b))
    left = []
    for law in ThreeSigmoid(2).shapes(motion, arm):
        assert law.w1 > law.w2 > law.w3 > 0
        X = law.columns(motion, arm)[:, 1]
        left.append(np.linalg.norm(truth - X @ np.linalg.lstsq(X, truth, rcond=None)[0]) / np.linalg.norm(truth))
    assert len(left) == 56
    assert min(left) < 0.01


def test_two_sigmoids_are_three_of_which_one_has_no_height() -> None:
    """Curve and simulated curve; and their grid has every pair of eight sharpnesses once, the sharper first."""
    v, arm = np.linspace(-2, 2, 401), synthetic_arm()
    two = TwoSigmoid(1)
    values = named([3.0, -1.0], [90.0, 12.0], 0.1)
    three = ThreeSigmoid(1).curve(v, arm, named([3.0, -1.0, 0.0], [90.0, 12.0, 1.0], 0.1))
    np.testing.assert_allclose(two.curve(v, arm, values), three, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(two.speed_curve(values).torque(v), three, rtol=1e-12, atol=1e-12)
    motion = Motion(np.arange(10.0), np.zeros((10, 3)), np.linspace(-1.0, 1.0, 30).reshape(10, 3), np.zeros((10, 3)))
    pairs = [(law.w1, law.w2) for law in two.shapes(motion, arm)]
    assert len(set(pairs)) == 28
    assert all(sharper > blunter > 0.0 for sharper, blunter in pairs)


def test_a_joint_at_rest_still_has_shapes() -> None:
    """A motion without motion gives a grid all the same."""
    still = np.zeros((10, 3))
    assert len(list(ThreeSigmoid(1).shapes(Motion(np.arange(10.0), still, still, still), synthetic_arm()))) == 56


def test_coulomb_saturates() -> None:
    """Ten times the width away from zero, Coulomb friction is its level."""
    curve = Coulomb(1).curve(np.array([-0.1, 0.1]), synthetic_arm(), {"level": 4.8, "sharpness": 100.0})
    np.testing.assert_allclose(curve, [-4.8, 4.8], rtol=1e-8)


def sweep() -> Array:
    return np.concatenate([sign * np.geomspace(1e-3, 8.0, 300) for sign in (-1, 1)])
