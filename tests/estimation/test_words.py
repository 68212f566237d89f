"""Columns of an estimate as sentences name them."""

from __future__ import annotations

import pytest

from pipelines.estimation.nominal import column_in_words


@pytest.mark.parametrize(("name", "words"), [
    ("p12", "p12"), ("coulomb:1:level", "Coulomb friction at joint 1"), ("viscous:2:coefficient", "viscous friction at joint 2"),
    ("torque_offset:3:offset", "torque offset at joint 3"), ("rotor_inertia:2:inertia", "rotor inertia at joint 2")])
def test_a_key_is_told_in_words(name: str, words: str) -> None:
    """The one number of an effect needs no name of its own."""
    assert column_in_words(name) == words


def test_of_several_numbers_each_has_its_name() -> None:
    found = {column_in_words(f"asymmetric_friction:2:{name}") for name in ("coulomb_difference", "viscous_difference")}
    assert len(found) == 2
    assert all(words.endswith(" difference)") for words in found)
