"""Read and write model.json: robot, base parameters, friction, effects, and the range of the logs behind them.

    model = read_model(path)         from a file, or by the bare name of one that is shipped ("rrr"); frozen, checked
    text  = model_text(model)        the canonical text: equal models give equal bytes
    model_schema()                   the JSON Schema, for others

The dataclasses below *are* the schema: pydantic reads their fields. It is imported only when a model is read.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final, Literal, NoReturn

from pipelines.errors import InputRejected, did_you_mean
from pipelines.io.atomic import write_file
from pipelines.io.field_words import words_of

if TYPE_CHECKING:
    from pydantic import TypeAdapter
    from pydantic_core import ErrorDetails

__all__ = ["FORMAT", "FORMAT_VERSION", "ModelFile", "Source", "StoredEffect", "StoredParameter", "StoredValue",
           "Validity", "model_schema", "model_text", "parse_model", "read_model", "write_model"]

FORMAT: Final = "rrrid-model"
FORMAT_VERSION: Final = 1

_LARGEST = 64 * 2**20  # [bytes] a model is some kilobytes; what is larger is not one
_STRICT = {"extra": "forbid", "strict": True, "allow_inf_nan": False}

Origin = Literal["fitted", "known", "assumed"]
Ranges = tuple[tuple[float, float] | None, ...]  # one [low, high] a joint, null where the logs do not say


@dataclass(frozen=True)
class StoredValue:
    """A number of an effect."""

    __pydantic_config__: ClassVar[dict[str, object]] = _STRICT

    value: float
    std: float | None  # one standard deviation; null where unknown
    unit: str
    origin: Origin


@dataclass(frozen=True)
class StoredParameter:
    """A base parameter."""

    __pydantic_config__: ClassVar[dict[str, object]] = _STRICT

    name: str
    value: float
    std: float | None
    unit: str
    visible: bool
    origin: Origin
    combination: str  # of link parameters, readable


@dataclass(frozen=True)
class StoredEffect:
    """A friction law or a further effect at its place."""

    __pydantic_config__: ClassVar[dict[str, object]] = _STRICT

    effect: str  # identifier of causes.md
    joint: int | None  # 1-based; null where it belongs to the whole arm
    parameters: dict[str, StoredValue]


@dataclass(frozen=True)
class Validity:
    """Where the logs behind the model went: beyond it, the model extrapolates."""

    __pydantic_config__: ClassVar[dict[str, object]] = _STRICT

    speed: Ranges | None = None  # [rad/s]
    acceleration: Ranges | None = None  # [rad/s^2]
    posture: Ranges | None = None  # [rad]
    temperature: Ranges | None = None  # [degC]


@dataclass(frozen=True)
class Source:
    """A log behind the model."""

    __pydantic_config__: ClassVar[dict[str, object]] = _STRICT

    name: str
    sha256: str
    experiment: str
    role: str


@dataclass(frozen=True)
class ModelFile:
    """What model.json holds. Numbers are SI; a prismatic joint has m and N where a revolute one has rad and N m."""

    __pydantic_config__: ClassVar[dict[str, object]] = _STRICT

    name: str
    robot: str  # the robot description, TOML text
    base_parameters: tuple[StoredParameter, ...]
    friction: tuple[StoredEffect, ...] = ()
    effects: tuple[StoredEffect, ...] = ()
    validity: Validity | None = None
    sources: tuple[Source, ...] = ()
    notes: tuple[str, ...] = ()
    format: Literal["rrrid-model"] = field(default=FORMAT, kw_only=True)
    format_version: Literal[1] = field(default=FORMAT_VERSION, kw_only=True)


@lru_cache(maxsize=1)
def _adapter() -> TypeAdapter[ModelFile]:
    from pydantic import TypeAdapter

    return TypeAdapter(ModelFile)


def model_schema() -> dict[str, Any]:
    """The JSON Schema of model.json."""
    schema = _adapter().json_schema(mode="validation")
    # A default serves those who build a model; in the file these must stand.
    schema["required"] = ["format", "format_version", *schema["required"]]
    kinds = {kind.__name__: kind for kind in (StoredParameter, StoredValue, StoredEffect, Source, Validity)}
    for kind, told in ((ModelFile, schema), *((kinds[name], told) for name, told in schema["$defs"].items())):
        for name, words in words_of(kind).items():
            told["properties"][name].setdefault("description", words)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def read_model(source: str | Path) -> ModelFile:
    """Read a model file.

    Raises:
        UsageError: there is no such file (C04).
        InputRejected: it is no model file (S18), or one of a later version (F11), or no regular file at all.
        EnvironmentFault: no permission.
    """
    from pipelines.io.files import regular_file
    from pipelines.io.shipped import shipped

    path = Path(source)
    if not path.exists():
        path = shipped("models", str(source))
    if (size := regular_file(path).st_size) > _LARGEST:
        raise InputRejected("S18", f"{size} bytes are too many for a model file", where=path,
                            remedy="give a model.json")
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as problem:
        raise InputRejected("S18", f"the model file cannot be read: {problem}", where=path, remedy="give a model.json") from None
    return parse_model(text, where=path)


def parse_model(text: str, where: object = "") -> ModelFile:
    """Read the text of a model file, as logs carry it too.

    Raises:
        InputRejected: it is no model file (S18), or one of a later version (F11).
    """
    from pydantic import ValidationError

    def wrong(what: str) -> NoReturn:
        raise InputRejected("S18", f"not a model file: {what}", where=where,
                            remedy="write the model again, or correct it by the schema: rrrid schema model")

    def once(pairs: list[tuple[str, object]]) -> dict[str, object]:
        keys = [key for key, _ in pairs]
        if len(set(keys)) < len(keys):
            wrong(f"'{max(keys, key=keys.count)}' stands twice in one object")
        return dict(pairs)

    try:
        table = json.loads(text, object_pairs_hook=once, parse_constant=lambda word: wrong(f"{word} is not JSON"))
    except (ValueError, RecursionError) as problem:
        wrong(f"the JSON is broken: {problem}")
    if not isinstance(table, dict) or table.get("format") != FORMAT:
        wrong(f"its \"format\" is not \"{FORMAT}\"")
    version = table.get("format_version")
    if isinstance(version, int) and not isinstance(version, bool) and version > FORMAT_VERSION:
        raise InputRejected("F11", f"the model file has format version {version}; this program understands up to "
                            f"{FORMAT_VERSION}", where=where, remedy="update rrrid")
    if version != FORMAT_VERSION or isinstance(version, bool):
        wrong(f"its \"format_version\" is {version}, not {FORMAT_VERSION}")
    try:
        model = _adapter().validate_json(text)
    except ValidationError as problem:
        wrong(_first_fault(problem.errors(include_url=False)[0]))
    for fault in _implausible(model):
        wrong(fault)
    return model


def _implausible(model: ModelFile) -> Iterator[str]:
    """What no schema sees: a spread below zero, a range that ends before it begins, a name that stands twice."""
    effects = (*model.friction, *model.effects)
    spreads = [(p.name, p.std) for p in model.base_parameters]
    spreads += [(f"{e.effect}.{name}", value.std) for e in effects for name, value in e.parameters.items()]
    yield from (f"the std of {name} is {std}" for name, std in spreads if std is not None and std < 0)
    names = [p.name for p in model.base_parameters]
    yield from (f"base parameter {name} stands twice" for name in names if names.count(name) > 1)
    for key in ("speed", "acceleration", "posture", "temperature"):
        for one in getattr(model.validity, key, None) or ():
            if one is not None and one[0] > one[1]:
                yield f"validity.{key} runs from {one[0]} to {one[1]}"


def _first_fault(fault: ErrorDetails) -> str:
    place = [part for part in fault["loc"] if isinstance(part, int) or not part.startswith("nullable")]
    words = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in place).lstrip(".")
    if fault["type"] == "unexpected_keyword_argument":
        return f"{words} is not a key of the format{did_you_mean(str(place[-1]), _keys())}"
    if fault["type"] in ("missing", "missing_argument"):
        return f"{words} is missing"
    return f"{words}: {fault['msg'].lower()}"


def _keys() -> set[str]:
    """Every key that the format knows, wherever it stands."""
    return {one.name for kind in (StoredValue, StoredParameter, StoredEffect, Validity, Source, ModelFile)
            for one in fields(kind)}


def model_text(model: ModelFile) -> str:
    """The canonical JSON text: keys sorted, floats by their shortest exact form, null for what is not finite."""
    return json.dumps(_plain(model), sort_keys=True, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def write_model(path: Path, model: ModelFile) -> None:
    """Write `model` to `path`, whole or not at all."""
    text = model_text(model)
    write_file(path, lambda draft: _put(draft, text))


def _put(draft: Path, text: str) -> None:
    draft.write_text(text, encoding="utf-8")


def _plain(value: object) -> object:
    if is_dataclass(value):
        return {one.name: _plain(getattr(value, one.name)) for one in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain(member) for key, member in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(member) for member in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value
