"""Which friction laws the figures of a stage rest on is said where its verdict stands."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from pipelines.estimation.preparation import FewerTerms
from pipelines.report.words import fewer_words, laws_words, threshold_words

MERGED = "w1 = 124 ± 6e+04 s/rad and w2 = 124 ± 9e+04 s/rad may be one"


def test_a_law_whose_terms_are_not_told_apart_is_said_with_its_joints_and_numbers() -> None:
    """One sentence for all joints that have the same instead, in plain words."""
    law, one = "three_sigmoid", ("coulomb", "viscous")
    words = laws_words("rrr", fewer=(FewerTerms(1, law, one, MERGED), FewerTerms(2, law, ("two_sigmoid",), "no"),
                                     FewerTerms(3, law, one, "fewer do as well")))
    assert words.startswith("Friction laws: those of rrr, as asked for; their numbers are fitted here. The terms of")
    assert f"joint 1 ({MERGED}), joint 3 (fewer do as well); fitted there instead: Coulomb friction, Viscous friction." in words
    assert "joint 2 (no); fitted there instead: Friction of two sigmoids." in words


def test_laws_that_stand_need_no_words() -> None:
    assert fewer_words(()) == ()
    assert laws_words("rrr") == "Friction laws: those of rrr, as asked for; their numbers are fitted here."


@pytest.mark.parametrize(
    ("origins", "said"),
    [
        (("parts of the reference logs",), "the difference between parts of the reference logs;"),
        ((), "Thresholds: none, no cause was looked for."),
    ],
)
def test_what_a_cause_has_to_exceed_is_told(origins: tuple[str, ...], said: str) -> None:
    result: Any = SimpleNamespace(thresholds=[SimpleNamespace(origin=one) for one in origins])
    assert said in threshold_words(result)
