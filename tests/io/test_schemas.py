"""Schemas hold for what is written, and refuse what is not."""

from __future__ import annotations

import copy
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import jsonschema
import numpy as np
import pyarrow.parquet as pq
import pytest

from pipelines.io.files import open_log, write_log
from pipelines.io.log import Array
from pipelines.io.results import FLAT, NOT_STORED, encode, headed, result_schema
from pipelines.io.schema import log_schema
from tests.io.logs import random_log, small_log


@dataclass(frozen=True)
class Part:
    """A part."""

    x: float
    rms: Array
    kind: Literal["a", "b"] = "a"


@dataclass(frozen=True)
class Beside:
    verdict: str


@dataclass(frozen=True)
class Whole:
    """Everything that a result may hold."""

    parts: tuple[Part, ...]
    pair: tuple[int, str]
    table: dict[str, Part | None]
    none: float | None
    anything: Any
    left_out: object = field(default=None, metadata=NOT_STORED)
    beside: Beside | None = field(default=None, metadata=FLAT)


GOOD = Whole((Part(float("inf"), np.arange(3.0)), Part(1.0, np.zeros((40, 3)))), (1, "x"), {"p": Part(2.0, np.array(1.0)),
             "q": None}, None, [1, {"a": "b"}], beside=Beside("yes"))


def stored(result: Whole) -> dict[str, Any]:
    return headed("try", json.loads(json.dumps(encode(result)[0])))


def test_a_result_of_every_kind_of_field() -> None:
    """What `encode` writes is valid: infinite, long, flat, left out, union, mapping; the schema itself is a schema."""
    schema = result_schema(Whole, "try")
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(stored(GOOD), schema)
    jsonschema.validate({key: value for key, value in stored(GOOD).items() if key != "verdict"}, schema)


@pytest.mark.parametrize("spoil", [
    lambda r: r.pop("pair"), lambda r: r.update(more=1), lambda r: r["parts"][0].update(kind="c"), lambda r: r["pair"].append(1)])
def test_what_is_not_written_is_not_valid(spoil: Any) -> None:
    """A field missing, unknown, or of another kind."""
    wrong = copy.deepcopy(stored(GOOD))
    spoil(wrong)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(wrong, result_schema(Whole, "try"))


def description(path: Path) -> dict[str, Any]:
    """The JSON object of a Parquet log, read by pyarrow alone."""
    about: dict[str, Any] = json.loads(pq.read_schema(path).metadata[b"rrrid"])
    return about


def test_logs_fulfil_their_schema(tmp_path: Path, samples: Path) -> None:
    """Logs with every attribute, random ones, and a sample log."""
    schema = log_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    logs = [small_log(), open_log(samples / "rrr-closed-form/hold-1.h5").log,
            *(random_log(np.random.default_rng(seed)) for seed in range(8))]
    for number, log in enumerate(logs):
        path = tmp_path / f"{number}.parquet"
        write_log(path, log)
        jsonschema.validate(description(path), schema)
        signals = {field.name.rsplit("_", 1)[0] if field.name[-1].isdigit() else field.name:
                   {key.decode(): value.decode() for key, value in field.metadata.items() if key in (b"units", b"long_name")}
                   for field in pq.read_schema(path)}
        jsonschema.validate(signals, {**schema["$defs"]["signals"]})
