"""No field of a file that rrrid writes is without words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from pipelines.io.results import words_of
from rrrid_cli.app import STAGES, schema_of

FILES = ("model", "log", "batch", *STAGES)


def wordless(schema: Any, place: str = "") -> Iterator[str]:
    """Properties without a description, wherever they stand."""
    if isinstance(schema, list):
        for one in schema:
            yield from wordless(one, place)
    elif isinstance(schema, dict):
        for name, own in schema.get("properties", {}).items() if isinstance(schema.get("properties"), dict) else ():
            if len(str(own.get("description", "")).split()) < 1:
                yield f"{place}.{name}"
        for name, own in schema.items():
            yield from wordless(own, f"{place}/{name}")


@pytest.mark.parametrize("what", FILES)
def test_every_field_is_told_in_words(what: str) -> None:
    """Of each stage's result.json, of a model and a log: at every depth."""
    assert list(wordless(schema_of(what))) == []


def test_words_stand_beside_their_field() -> None:
    """A comment on the field's line or right above it, of the class itself or of the one it extends; units stand in it."""
    from pipelines.diagnosis.result import Result
    from pipelines.estimation.motion_result import LogResult

    assert words_of(LogResult)["predicted"].startswith("predicted: samples in which the position of some joint was not measured")
    assert words_of(Result)["rated"].startswith("rated: [N m]")
