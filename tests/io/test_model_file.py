"""model.json: its schema, its canonical text, and what is refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from pipelines.errors import InputRejected, UsageError
from pipelines.io.model_file import ModelFile, model_schema, model_text, parse_model, read_model
from sample_logs.make_model import example_text


@pytest.fixture(scope="module")
def example(samples: Path) -> Path:
    return samples / "models" / "rrr.json"


def test_the_example_is_what_its_script_makes(example: Path) -> None:
    """models/rrr.json is rebuilt to the same bytes."""
    assert example.read_text(encoding="utf-8") == example_text()


def test_the_example_fits_the_schema(example: Path) -> None:
    """The schema is a valid one, and the example keeps it."""
    schema = model_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(json.loads(example.read_text(encoding="utf-8")), schema)


def test_there_and_back_byte_for_byte(example: Path) -> None:
    """Reading and writing changes nothing."""
    model = read_model(example)
    text = example.read_text(encoding="utf-8")
    assert model_text(model) == text
    assert parse_model(text) == model


def changed(change: Callable[[dict[str, Any]], object]) -> Callable[[str], str]:
    def edit(text: str) -> str:
        table = json.loads(text)
        change(table)
        return json.dumps(table)
    return edit


@pytest.mark.parametrize(("edit", "code", "message"), [
    (lambda text: text[:200], "S18", "JSON is broken"),
    (lambda text: "[" * 100_000, "S18", "not a model file"),
    (lambda text: text.replace("0.2921", "NaN"), "S18", "broken"),
    (lambda text: text.replace('"name": "p1"', '"name": "p1", "name": "p2"'), "S18", "stands twice"),
    (lambda text: text.replace('"value": 0.2921', '"value": 9.0, "value": 0.2921'), "S18", "'value' stands twice"),
    (changed(lambda t: t["validity"]["speed"].insert(0, [1.0, -1.0])), "S18", "validity.speed runs from 1.0 to -1.0"),
    (changed(lambda t: t.update(format_version=2)), "F11", "understands up to 1"),
    (changed(lambda t: t.pop("robot")), "S18", "robot is missing"),
    (changed(lambda t: t.update(efects=[])), "S18", "did you mean 'effects'"),
    (changed(lambda t: t["base_parameters"][2].update(vale=1.0)), "S18", r"base_parameters\[2\].vale .* 'value'"),
    (changed(lambda t: t["base_parameters"][2].update(origin="guessed")), "S18", "origin"),
    (changed(lambda t: t["base_parameters"][2].update(std=-0.1)), "S18", r"base_parameters\[2\].std.*greater than or equal to 0"),
])
def test_what_is_no_model_is_refused(example: Path, edit: Callable[[str], str], code: str, message: str) -> None:
    """Broken, foreign, newer or mistyped: one error that names the place."""
    with pytest.raises(InputRejected, match=message) as caught:
        parse_model(edit(example.read_text(encoding="utf-8")), where="model.json")
    assert caught.value.code == f"RRID-{code}"
    assert caught.value.where == "model.json"


def test_files_that_cannot_be_models(tmp_path: Path) -> None:
    """Missing is wrong usage; bytes that are no text are rejected input."""
    with pytest.raises(UsageError, match="RRID-C04") as caught:
        read_model(tmp_path / "model.json")
    assert caught.value.exit_code == 2
    (tmp_path / "bytes.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputRejected, match="RRID-S18"):
        read_model(tmp_path / "bytes.json")
    with pytest.raises(InputRejected, match="RRID-F12"):
        read_model(tmp_path)


def test_defaults_may_be_left_out() -> None:
    """A model without effects, sources or notes needs no empty lists; format and version always stand."""
    least = {"format": "rrrid-model", "format_version": 1, "name": "a", "robot": "", "base_parameters": []}
    assert parse_model(json.dumps(least)) == ModelFile("a", "", ())
