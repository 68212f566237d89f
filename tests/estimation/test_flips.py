"""Chance gains as much as often as is said, whatever the size of each gain; and what helps everywhere is no chance."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.estimation.bootstrap import by_flips


@pytest.mark.parametrize("blocks", [8, 20])
def test_what_gains_nothing_passes_as_often_as_is_said(blocks: int) -> None:
    """A twentieth of 600 draws of gains whose sizes differ by a hundred times and whose signs are those of a coin."""
    rng = np.random.default_rng(3)
    sizes = 10.0 ** rng.uniform(-1.0, 1.0, (600, blocks))
    likely = np.array([by_flips(size * rng.standard_normal(blocks)) for size in sizes])
    assert 0.025 <= np.mean(likely <= 0.05) <= 0.075
    assert 0.42 <= np.mean(likely <= 0.5) <= 0.58


def test_a_little_everywhere_is_no_chance_and_much_in_one_place_is() -> None:
    rng = np.random.default_rng(4)
    assert by_flips(rng.uniform(0.5, 1.5, 10)) == pytest.approx(2.0**-10)
    alone = np.full(10, -0.1)
    alone[3] = 8.0
    assert by_flips(alone) > 0.4


def test_every_choice_of_signs_and_drawn_ones_agree() -> None:
    """Blocks in which nothing happens change nothing."""
    gains = np.array([2.0, 1.0, 1.5, -0.7, 0.4, 0.9, -0.3, 1.1])
    assert by_flips(np.append(gains, np.zeros(10))) == pytest.approx(by_flips(gains), abs=0.02)


def test_nothing_gained_is_chance() -> None:
    assert by_flips(np.zeros(10)) == by_flips(-np.ones(10)) == 1.0
