"""What figures are called in reports: causes and their parameters in words, everything else as it is."""

from __future__ import annotations

import re

import pytest

from pipelines.effects import effect_names, find_effect
from pipelines.report.words import figure_in_words


@pytest.mark.parametrize(("name", "words"), [
    ("coulomb:3:level", "Coulomb friction at joint 3, level"),
    ("viscous:1:coefficient_2", "Viscous friction at joint 1, second coefficient"),
    ("estimate-bps torque_offset:2:offset", "estimate-bps: torque offset at joint 2, offset"),
    ("diagnose cogging joint 2 amplitude 3", "diagnose: cogging at joint 2, third amplitude"),
    ("extend model viscous joint 1 coefficient", "extend model: viscous friction at joint 1, coefficient"),
    ("fit-friction waist stribeck joint 1 varpro coulomb.level", "fit-friction waist: Coulomb friction at joint 1, level"),
    ("fit-friction waist stribeck joint 1 varpro gravity sine", "fit-friction waist: joint 1, gravity sine"),
    ("fit-friction waist three_sigmoid joint 1 varpro f1", "fit-friction waist: friction of three sigmoids at joint 1, f1"),
    ("fit-friction waist stribeck joint 1 varpro stribeck.speed", "fit-friction waist: Stribeck friction at joint 1, speed"),
    ("fit-friction waist three_sigmoid joint 1 varpro three sigmoid.f1",
     "fit-friction waist: friction of three sigmoids at joint 1, f1"),
    ("payload mass", "Payload at the tip, mass"),
    ("diagnose cogging joint 2 torque rms", "diagnose: cogging at joint 2, torque rms"),
    ("estimate-bps p3", "estimate-bps p3"), ("torque rms validate joint 2", "torque rms validate joint 2"), ("", "")])
def test_causes_are_told_in_words(name: str, words: str) -> None:
    assert figure_in_words(name) == words


@pytest.mark.parametrize("effect", effect_names())
def test_no_key_of_any_effect_is_left(effect: str) -> None:
    """However a result spells it: every effect, every parameter."""
    kind = find_effect(effect)
    at = "" if kind.scope == "arm" else "2"
    for q in kind.parameters:
        for name in (f"estimate-bps {effect}:{at and at + ':'}{q.name}",
                     f"extend model {effect}{at and ' joint ' + at} {q.name.replace('_', ' ')}"):
            said = figure_in_words(name)
            assert kind.words.title.lower() in said.lower()
            assert not re.search(r"\w[_:]\w", said), said
