"""Presliding by laws of several authors, simulated here by their own equations: what is fitted to one motion holds on another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import least_squares

from pipelines.dynamics.body import Array, Motion
from pipelines.effects.presliding import Presliding
from sample_logs.make_model import synthetic_arm

H = 1e-4  # [s] of the laws' own steps
EVERY = 20  # of them a sample
AMPLITUDE, DISTANCE = 1.3, 0.02
Law = Callable[[Array], Array]


def moving(seed: int) -> tuple[Array, Motion]:
    """Speed in the laws' own steps, and the motion in samples: long strokes, with short ones in them."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 4.0, H)
    v = sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in zip(
        (0.4, 0.3, 0.25, 0.15), (0.31, 0.83, 1.7, 3.1), rng.uniform(0, 2 * np.pi, 4), strict=True))
    q = cumulative_trapezoid(v, dx=H, initial=0.0)
    rows = slice(0, None, EVERY)
    motion = Motion(t[rows], *(np.stack([np.zeros_like(x), x, np.zeros_like(x)], axis=1) for x in (
        q[rows], v[rows], np.gradient(v, H)[rows])))
    return v, motion


def integrated(slope: Callable[[float, float], float], damping: float = 0.0) -> Law:
    """F z + damping dz/dt with dz/dt = v slope(z, sign v), z of largest bending 1, by the midpoint rule."""

    def law(v: Array) -> Array:
        z, out = 0.0, np.empty(len(v))
        for k, speed in enumerate(v.tolist()):
            s = 1.0 if speed >= 0.0 else -1.0
            rate = speed * slope(z, s)
            out[k] = AMPLITUDE * (z + damping * rate)
            z = max(-1.0, min(1.0, z + H * speed * slope(z + 0.5 * H * rate, s)))
        return out

    return law


def breaking_away(v: Array) -> Array:
    """LuGre with half as much friction again at standstill, over 0.1 rad/s (Canudas de Wit et al. 1995, eq. (1)-(4))."""
    z, out = 0.0, np.empty(len(v))
    for k, speed in enumerate(v.tolist()):
        rate = (speed - abs(speed) * z / (1.0 + 0.5 * np.exp(-(speed / 0.1) ** 2))) / DISTANCE
        out[k] = AMPLITUDE * (z + 0.003 * rate)
        z += H * rate
    return out


def maxwell_slip(v: Array) -> Array:
    """Six springs of one stiffness, each with a block that slips at its own force (Lampaert, Swevers & Al-Bender 2003)."""
    limit = np.arange(1.0, 7.0)
    step, f, out = 1.4 * H * v / DISTANCE * limit.mean(), np.zeros(6), np.empty(len(v))
    for k in range(len(v)):
        out[k] = AMPLITUDE * f.sum() / limit.sum()
        f = np.clip(f + step[k], -limit, limit)
    return out


def fitted(law: Law) -> tuple[Presliding, float]:
    """The form that leaves less of the law along one motion, with its numbers, and its amplitude."""
    v, motion = moving(1)
    wanted, arm = law(v)[::EVERY], synthetic_arm()
    best: tuple[float, Presliding, float] | None = None
    for form in Presliding(2).forms()[0].forms():

        def at(x: Array, form: Presliding = form) -> Presliding:
            return replace(form, distance=float(np.exp(x[0])), elastic=float(x[1]), damping_time=float(x[2]),
                           exponent=1.0 if form.exponent == 1.0 else float(x[4]),
                           breakaway=float(x[5]) if form.breakaway else 0.0, breakaway_speed=float(np.exp(x[6])))

        def left(x: Array) -> Array:
            return np.asarray(x[3] * at(x).columns(motion, arm)[:, 1, 0] - wanted)

        start = [np.log(0.01), max(form.elastic, -0.99), 1e-3, 1.0, form.exponent, form.breakaway, np.log(0.2)]
        found = least_squares(left, start, bounds=([-12.0, -1.0, 0.0, 0.0, 0.0, -0.1, -7.0], [-1.6, 0.9, 0.1, 50.0, 3.0, 5.0, 1.6]),
                              diff_step=1e-4, x_scale=(1.0, 1.0, 1e-2, 1.0, 1.0, 1.0, 1.0))
        if best is None or found.cost < best[0]:
            best = found.cost, at(found.x), float(found.x[3])
    assert best is not None
    return best[1], best[2]


@pytest.mark.slow
@pytest.mark.parametrize(("law", "inner", "numbers", "share"), [
    (integrated(lambda z, s: (1.0 - s * z) / DISTANCE), 0.0, {"distance": DISTANCE}, 0.01),
    (integrated(lambda z, s: (1.0 - s * z) / DISTANCE, damping=0.005), 0.0, {"distance": DISTANCE}, 0.01),
    (maxwell_slip, 1.0, {}, 0.03),
    (breaking_away, 0.0, {"distance": DISTANCE, "breakaway": 0.5, "breakaway_speed": 0.1}, 0.02),
], ids=["dahl", "lugre", "maxwell slip", "lugre with breakaway"])
def test_a_law_fitted_to_one_motion_holds_on_another(law: Law, inner: float, numbers: dict[str, float], share: float) -> None:
    """Torque within `share` of the amplitude (rms), the amplitude within 3 %, the law's other numbers within 5 %, and
    inner loops close where elements slip one after the other."""
    effect, amplitude = fitted(law)
    assert effect.inner_loops == inner
    assert amplitude == pytest.approx(AMPLITUDE, rel=0.03)
    assert {name: getattr(effect, name) for name in numbers} == pytest.approx(numbers, rel=0.05)
    for seed in (2, 3):
        v, motion = moving(seed)
        missed = amplitude * effect.columns(motion, synthetic_arm())[:, 1, 0] - law(v)[::EVERY]
        assert np.sqrt(np.mean(np.square(missed))) < share * AMPLITUDE
