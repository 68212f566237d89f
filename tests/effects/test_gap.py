"""A link between two flanks, against an integrator of its own and against what must hold at rest."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipelines.dynamics.body import Array
from pipelines.effects.backlash import Gaps, followed

GAPS = Gaps(np.array([5e-4, 1e-3, 3e-3]), np.array([6.0, 3.0, 1.0]), np.array([4e4, 1.5e4, 2.5e4]), np.array([90.0, 40.0, 60.0]))
MASS = np.array([0.4, 0.2, 0.3])


def pulled(t: Array) -> Array:
    """Turns round every quarter of a second, unevenly."""
    return np.asarray(4.0 * np.sin(2 * np.pi * 2.0 * t) + 1.5 * np.sin(2 * np.pi * 0.7 * t + 0.4))


def hovering(t: Array) -> Array:
    """Barely presses: between the flanks nothing forgets where a stretch began."""
    return np.asarray(0.05 * np.sin(2 * np.pi * 0.8 * t))


def motion(gap: int, t: Array, force: Callable[[Array], Array]) -> Array:
    half, film = GAPS.half[gap], GAPS.film[gap]

    def rate(time: float, state: Array) -> list[float]:
        x, v = state
        over = x - np.clip(x, -half, half)
        push = GAPS.stiffness[gap] * over + GAPS.damping[gap] * v
        flank = push if over * push > 0.0 else 0.0
        return [v, (float(force(np.array(time))) - film * v - flank) / MASS[gap]]

    start = half * np.sign(force(t)[0]) + force(t)[0] / GAPS.stiffness[gap]
    return np.asarray(solve_ivp(rate, (t[0], t[-1]), [float(start), 0.0], "LSODA", t, rtol=1e-8, atol=1e-10, max_step=2e-3).y[0])


@pytest.mark.parametrize("force", [pulled, hovering])
@pytest.mark.parametrize("gap", range(3))
def test_a_gap_is_crossed_as_an_integrator_crosses_it(gap: int, force: Callable[[Array], Array]) -> None:
    """Over 1.5 s at 2 kHz, five stretches: within a twentieth of the gap where it meets a flank, mostly far closer."""
    t: Array = np.arange(3000, dtype=np.float64) / 2000.0
    x = followed(t, np.tile(MASS[:, None], len(t)), force(t)[None], GAPS)[gap]
    off = np.abs(x - motion(gap, t, force)) / (2.0 * GAPS.half[gap])
    assert off.max() < 0.05
    assert np.median(off) < 2e-3
