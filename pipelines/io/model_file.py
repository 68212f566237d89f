"""Read and write model.json: robot, base parameters, friction, effects, range of the logs.

model = read_model(path)         from a file, or by the bare name of a shipped one ("rrr")
text  = model_text(model)        the canonical text: equal models give equal bytes
model_schema()                   the JSON Schema, for others

The dataclasses below are the schema: pydantic, imported when a model is read, reads their fields.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pipelines.errors import InputRejected, UsageError
from pipelines.io.config import FORMAT as LIMITS
from pipelines.io.output import write_text
from pipelines.io.results import encode, json_text
from pipelines.io.robot import shipped
from pipelines.io.sandbox import read_small_text, regular_file
from pipelines.io.schema import DRAFT, Array, Strict, adapter, described, fault_in_words

FORMAT = "rrrid-model"
FORMAT_VERSION = 1  # numerics

Origin = Literal["fitted", "known", "assumed"]
# what the files say of their own null
UNKNOWN = {"null": "not told by the logs: not zero, and not known exactly"}
# one [low, high] a joint, null where the logs do not say
Ranges = tuple[tuple[float, float] | None, ...]


@dataclass(frozen=True)
class StoredValue(Strict):
    """A number of an effect."""

    value: float = described("the number, in its unit")
    std: float | None = described("one standard deviation; null where unknown", ge=0.0)
    unit: str = described("unit of the number; 1: a pure number")
    origin: Origin = described("where it comes from")


@dataclass(frozen=True)
class StoredParameter(Strict):
    """A base parameter."""

    name: str = described("name, as logs and reports have it")
    value: float = described("the number, in its unit")
    std: float | None = described("one standard deviation; null where unknown", ge=0.0)
    unit: str = described("unit of the number")
    visible: bool = described("whether the logs show it clearly")
    origin: Origin = described("where it comes from")
    combination: str = described("of link parameters, readable")


@dataclass(frozen=True)
class StoredEffect(Strict):
    """A friction law or a further effect at its place."""

    effect: str = described("identifier of causes.md")
    joint: int | None = described("number of the joint, from 1; null: the whole arm")
    parameters: dict[str, StoredValue] = described("the parameters by their names")


@dataclass(frozen=True)
class Validity(Strict):
    """The range of the logs behind the model: beyond it, the model extrapolates."""

    speed: Ranges | None = described("[rad/s] lowest and highest of each joint", None)
    acceleration: Ranges | None = described("[rad/s^2] the same", None)
    posture: Ranges | None = described("[rad] the same", None)
    temperature: Ranges | None = described("[degC] the same", None)


@dataclass(frozen=True)
class Source(Strict):
    """A log behind the model."""

    name: str = described("name of the log")
    sha256: str = described("SHA-256 of the file's bytes, hexadecimal")
    experiment: str = described("friction, excitation, writing, frf, hold or free")
    role: str = described("identify, validate or reference")


@dataclass(frozen=True)
class ModelFile(Strict):
    """A model. Numbers are SI; a prismatic joint has m and N instead of rad and N m."""

    name: str = described("name of the model")
    robot: str = described("the robot description, TOML text")
    base_parameters: tuple[StoredParameter, ...] = described("what the rigid body has")
    friction: tuple[StoredEffect, ...] = described("friction laws", ())
    effects: tuple[StoredEffect, ...] = described("accepted further effects", ())
    validity: Validity | None = described("range of the logs behind it", None)
    sources: tuple[Source, ...] = described("the logs behind it", ())
    notes: tuple[str, ...] = described("what else is to be known", ())
    _: dataclasses.KW_ONLY
    format: Literal["rrrid-model"] = described("what kind of file this is", "rrrid-model")
    format_version: Literal[1] = described("version of the format", 1)


def model_schema() -> dict[str, Any]:
    """Return the JSON Schema of model.json."""
    schema = adapter(ModelFile).json_schema(mode="validation")
    # defaults are for those who build a model; in the file these must be there
    schema["required"] = ["format", "format_version", *schema["required"]]
    return {"$schema": DRAFT, **schema}


def read_model(source: str | Path) -> ModelFile:
    """Read a model file.

    Raises:
        UsageError: there is no such file (C04).
        InputRejected: it is no model file (S18), of a later version (F11), or no regular file.
        EnvironmentFault: no permission.
    """
    path = Path(source)
    if not path.exists():
        path = shipped("models", str(source))
    size = regular_file(path, what="a model.json").st_size
    if size > LIMITS.model:
        raise _wrong(f"{size} bytes are too many", path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as problem:
        raise _wrong(f"it cannot be read: {problem}", path) from None
    return parse_model(text, where=path)


def model_in(folder: Path) -> Path:
    """Return the model.json of a folder of results; of `run` that of extend, else estimate-bps.

    Raises:
        UsageError: C04, there is none.
    """
    for name in ("model.json", "extend/model.json", "estimate-bps/model.json"):
        if (folder / name).is_file():
            return folder / name
    remedy = "give a model.json, or a folder that estimate-bps, extend or run has left"
    raise UsageError("C04", "a model is wanted, and this folder has no model.json", folder, remedy)


def _wrong(words: str, where: object) -> InputRejected:
    remedy = "write the model again, or correct it by the schema: rrrid schema model"
    return InputRejected("S18", f"not a model file: {words}", where, remedy)


def parse_model(text: str, where: object = "") -> ModelFile:
    """Read the text of a model file, as logs carry it too.

    Raises:
        InputRejected: it is no model file (S18), or one of a later version (F11).
    """
    from pydantic import ValidationError

    def once(pairs: list[tuple[str, object]]) -> dict[str, object]:
        names = [name for name, _ in pairs]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise _wrong(f"'{twice[0]}' stands twice in one object", where)
        return dict(pairs)

    try:
        table = json.loads(text, object_pairs_hook=once)
    except (ValueError, RecursionError) as problem:
        raise _wrong(f"the JSON is broken: {problem}", where) from None
    if not isinstance(table, dict) or table.get("format") != FORMAT:
        raise _wrong(f'its "format" is not "{FORMAT}"', where)
    version = table.get("format_version")
    if type(version) is int and version > FORMAT_VERSION:
        words = f"the model file has format version {version}"
        words = f"{words}; this program understands up to {FORMAT_VERSION}"
        raise InputRejected("F11", words, where, "update rrrid")
    if type(version) is not int or version != FORMAT_VERSION:
        raise _wrong(f'its "format_version" is {version}, not {FORMAT_VERSION}', where)
    try:
        model: ModelFile = adapter(ModelFile).validate_json(text)
    except ValidationError as problem:
        kinds = (StoredValue, StoredParameter, StoredEffect, Validity, Source, ModelFile)
        raise _wrong(fault_in_words(problem, *kinds)[1], where) from None
    names = [parameter.name for parameter in model.base_parameters]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise _wrong(f"base parameter {twice[0]} stands twice", where)
    for key in ("speed", "acceleration", "posture", "temperature"):
        for limits in getattr(model.validity, key, None) or ():
            if limits is not None and limits[0] > limits[1]:
                raise _wrong(f"validity.{key} runs from {limits[0]} to {limits[1]}", where)
    return model


def model_text(model: ModelFile) -> str:
    """Return the canonical JSON text: sorted keys, exact floats, null for what is not finite."""
    table = encode(model)[0]
    return json.dumps(table, sort_keys=True, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def write_model(path: Path, model: ModelFile) -> None:
    """Write `model` to `path`, whole or not at all."""
    write_text(path, model_text(model))


def write_covariance(path: Path, names: Sequence[str], covariance: Array) -> None:
    """Write the covariance (k, k) of the numbers `names` of a model, atomically."""
    table = {**UNKNOWN, "names": list(names), "covariance": encode(covariance.tolist())[0]}
    write_text(path, json_text(table))


def read_covariance(path: Path) -> tuple[tuple[str, ...], Array]:
    """Return what `write_covariance` wrote; NaN where a number is not determined.

    Raises:
        InputRejected: S18, it is not of that form.
    """
    text = read_small_text(path, what="a covariance (JSON)")
    try:
        table = json.loads(text)
        names = tuple(map(str, table["names"]))
        rows = [[np.nan if x is None else float(x) for x in row] for row in table["covariance"]]
        return names, np.array(rows, dtype=np.float64).reshape(len(names), len(names))
    except (ValueError, TypeError, KeyError, RecursionError, OverflowError) as problem:
        words = "not the covariance of a model's parameters"
        remedy = "run estimate-bps again, or take the file away"
        words = f"{words}: {type(problem).__name__}: {problem}"
        raise InputRejected("S18", words, path, remedy) from None
