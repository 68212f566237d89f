"""The friction laws against numbers computed elsewhere."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipelines.dynamics.body import Array, Motion
from pipelines.effects.friction import ThreeSigmoid
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


def sweep() -> Array:
    return np.concatenate([sign * np.geomspace(1e-3, 8.0, 300) for sign in (-1, 1)])
