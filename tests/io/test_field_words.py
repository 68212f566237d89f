"""No field of a file that rrrid writes is without words, and no words are for a field that there is not."""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Iterator
from importlib import import_module
from typing import Any

import pytest

from pipelines.io.field_words import words_of
from pipelines.io.result_words import WORDS
from pipelines.stage import result_type
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


def kinds(one: Any, seen: set[type[Any]]) -> None:
    """Every dataclass that a result consists of."""
    for part in typing.get_args(one):
        kinds(part, seen)
    if dataclasses.is_dataclass(one) and isinstance(one, type) and one not in seen:
        seen.add(one)
        for hint in typing.get_type_hints(one).values():
            kinds(hint, seen)


def test_no_words_are_left_over() -> None:
    """A field that was taken away, or has a comment that says all by now, leaves no words behind."""
    from pipelines.batch.result import Result as Batch
    from pipelines.io.model_file import ModelFile

    seen: set[type[Any]] = set()
    modules = ("import_log" if name == "import" else name.replace("-", "_") for name in STAGES)
    for one in (*(result_type(import_module(f"pipelines.{name}").STAGE) for name in modules), Batch, ModelFile):
        kinds(one, seen)
    told = "\n".join(words for kind in seen for words in words_of(kind).values())
    assert [name for name, words in WORDS.items() if words not in told] == []


def test_words_stand_beside_their_field() -> None:
    """A comment on the field's line or right above it, of the class itself or of the one it extends; units stand in it."""
    from pipelines.diagnosis.result import Result
    from pipelines.model.motion_result import LogResult

    assert words_of(LogResult)["predicted"].startswith("predicted: samples in which the position of some joint was not measured")
    assert words_of(Result)["rated"].startswith("rated: [N m]")
    assert words_of(Result)["after_rms"].startswith("[N m] torque error of the extended model: ")
    assert words_of(LogResult)["peak_speed"].startswith("[rad/s]")
