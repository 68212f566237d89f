"""What results call a parameter leads back to the quantity that the effect declares."""

from __future__ import annotations

import math

import pytest

from pipelines.dynamics.parameter_names import quantity_of
from pipelines.effects import effect_names, find_effect


@pytest.mark.parametrize("effect", effect_names())
def test_every_quantity_is_found_again(effect: str) -> None:
    """However a result spells it: of every effect every parameter, and in a model that has the effect twice at a joint."""
    kind = find_effect(effect)
    at, joint = (":", "") if kind.scope == "arm" else (":2:", " joint 2")
    for q in kind.parameters:
        words = f"{effect}{joint} {q.name.replace('_', ' ')}"
        for name in (f"{effect}{at}{q.name}", f"estimate-bps {effect}{at}{q.name}", words, f"extend model {words}", f"{words} (2)"):
            assert quantity_of(name) is q


def test_numbers_of_further_waves_are_those_of_the_first() -> None:
    """A finding counts the numbers of several waves on; a friction fit names the effect that its law is made of."""
    assert [quantity_of(f"diagnose cogging joint 1 {name}").name for name in ("phase 5", "order 7", "amplitude 9")] == [  # type: ignore[union-attr]
        "phase_2", "order", "amplitude_3"]
    law = "fit-friction waist stribeck joint 1 varpro "
    assert quantity_of(f"{law}coulomb.level") is next(q for q in find_effect("coulomb").parameters if q.name == "level")
    for name in (f"{law}inertia", "estimate-bps p3", "Izz1", "", "cogging joint 1", "cogging joint 1 torque rms"):
        assert quantity_of(name) is None


def test_every_angle_on_a_circle_says_so() -> None:
    """What runs once around, from -π to π, is the same again after a turn, and nothing else is: a gap or a rest angle is not."""
    for effect in effect_names():
        for q in find_effect(effect).parameters:
            around = q.unit == "rad" and (q.low, q.high) == (-math.pi, math.pi)
            assert q.period == (2.0 * math.pi if around else None), f"{effect}.{q.name}"
