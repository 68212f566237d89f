"""What a law with more numbers than is named can take of a finding made after it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.model.effects.cogging import Cogging
from pipelines.model.effects.spring import Spring
from tests.model.estimation.experiments import arm, motion_of


@pytest.mark.parametrize(("waves", "rest"), [(1.5, True), (2.0, True), (5.0, False), (8.0, False)])
def test_few_waves_beside_a_spring_are_its_curve_and_many_are_not(waves: float, rest: bool) -> None:
    """Of what the spring that is named leaves of a wave, the looser one takes nearly all of two waves in the range and little of
    five: a polynomial of degree n follows about n/π of them (Boyd 2001, ch. 2.13)."""
    motion = motion_of(1)(np.arange(0.0, 10.0, 0.01))
    q = motion.q[:, 1]
    travel = float(np.ptp(q))
    y = np.sin(2.0 * np.pi * waves * q / travel + 0.4)

    def left(spring: Spring) -> float:
        columns = np.polynomial.chebyshev.chebvander((q - q.min()) / travel * 2.0 - 1.0, spring.degree)
        assert spring.columns(motion, arm())[:, 1].shape[1] == columns.shape[1]
        return float(np.sum(np.square(y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0])))

    named = Spring(joint=2)
    taken = 1.0 - left(named.looser()) / left(named)
    assert taken > 0.5 if rest else taken < 0.5


def test_columns_of_a_spring_are_powers_and_beyond_their_range_tangents() -> None:
    """x^n and, where it was not seen, x0^n + n x0^(n-1) (x - x0): NumPy's polynomials say so."""
    motion = motion_of(1)(np.arange(0.0, 10.0, 0.01))
    q = motion.q[:, 1]
    low, high = np.quantile(q, [0.2, 0.9]).tolist()
    columns = Spring(joint=2, seen_from=low, seen_to=high, degree=7).columns(motion, arm())[:, 1]
    near = np.clip(q, low, high)
    for column, degree in zip(columns.T, [1, 0, *range(2, 8)], strict=True):
        power = np.polynomial.Polynomial.basis(degree)
        assert np.allclose(column, power(near) + power.deriv()(near) * (q - near), rtol=1e-12, atol=1e-12)


def test_half_a_wave_in_the_travel_is_no_cogging() -> None:
    """With fewer waves than one and a quarter a wave with harmonics is any curve, a spring's too."""
    motion = motion_of(1)(np.arange(0.0, 10.0, 0.01))
    travel = float(np.ptp(motion.q[:, 1]))
    shapes = list(Cogging(joint=2).shapes(motion, arm()))
    assert len(shapes) > 10
    for waves, possible in ((0.5, False), (1.1, False), (1.4, True), (7.0, True)):
        one = replace(shapes[0].full(), whole=False, apart=0.0, order=waves * 2.0 * np.pi / travel)
        assert one.possible(one.values(np.ones(6))) is possible
    assert all(one.possible(one.values(np.ones(2))) for one in shapes)
