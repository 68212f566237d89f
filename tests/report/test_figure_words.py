"""What figures are called in reports: causes and their parameters in words, everything else as it is."""

from __future__ import annotations

import re

import pytest

from pipelines.effects import effect_names, find_effect
from pipelines.report.words import figure_in_words


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
