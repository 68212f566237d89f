"""What the columns of an estimate are called in a sentence: "viscous friction at joint 2" for "viscous:2:coefficient".

Who computes with them has their names, in results and model files; who reads a verdict has words.
"""

from __future__ import annotations

from collections.abc import Iterable

from pipelines.effects import find_effect
from pipelines.model.words import within

__all__ = ["column_in_words", "columns_in_words"]


def columns_in_words(names: Iterable[str]) -> dict[str, str]:
    """Of each of `names` its words."""
    return {name: column_in_words(name) for name in names}


def column_in_words(name: str) -> str:
    """The base parameters keep their names, "p3"; an effect with several numbers says which: "backlash at joint 2 (gap)"."""
    cause, *rest = name.split(":")
    if not rest:
        return name
    effect = find_effect(cause)
    title = within(effect.words.title)
    words = f"{title} at joint {rest[0]}" if len(rest) > 1 else title
    alone = sum(not q.shape for q in effect.parameters) == 1
    return words if alone else f"{words} ({rest[-1].replace('_', ' ')})"
