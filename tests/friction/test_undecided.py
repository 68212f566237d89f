"""Where two laws are not told apart the result says why one was taken and what the other would change, in words."""

from __future__ import annotations

import re
from functools import lru_cache

import numpy as np
import pytest

from pipelines.estimation.nominal import plain_number
from pipelines.friction.fit import Equations
from pipelines.friction.laws import OneJoint
from pipelines.friction.model_selection import climb, coverage, undecided
from tests.friction.one_joint import JOINT, recorded
from tests.friction.test_model_selection import plateaus

_SPEEDS = (0.2, 1.0, 3.0)


def drag(v: float) -> float:
    return float(1.2 * np.sign(v) + 0.12 * v + 0.03 * v * abs(v))


@lru_cache(maxsize=1)
def told() -> list[str]:
    """Of a joint that was driven at three speeds only: drag or a hump."""
    stretch = plateaus(_SPEEDS, drag, False, 0.02)
    ladder = climb(Equations((stretch,), OneJoint.of(recorded("coulomb+viscous", 1).robot, JOINT)), None)
    covered = coverage((stretch,))
    return [gap.what for gap in undecided(ladder, covered.slowest, covered.fastest)]


def test_the_plainer_law_is_taken_where_nothing_tells_them_apart() -> None:
    assert any("Quadratic drag or Stribeck friction" in words and "no more numbers, 4 numbers against 5" in words for words in told())


def test_laws_that_agree_where_the_joint_was_driven_differ_in_between() -> None:
    """The speed at which they are furthest apart is none of the three, each of which both curves pass through."""
    (words,) = [words for words in told() if "Stribeck" in words]
    found = re.search(r"by at most ([0-9.e-]+) N m, at ([0-9.]+) rad/s", words)
    assert found
    assert float(found[1]) > 0.0
    assert min(abs(float(found[2]) - speed) / speed for speed in _SPEEDS) > 0.1


def test_no_law_is_called_by_its_key() -> None:
    assert told()
    assert not any("_" in words for words in told())


@pytest.mark.parametrize(("value", "said"), [(120.3, "120"), (18.153, "18"), (1234.5, "1200"), (0.000213, "0.00021"), (0.0, "0")])
def test_numbers_in_sentences_have_no_powers_of_ten(value: float, said: str) -> None:
    assert plain_number(value) == said
