"""The JSON Schema (draft 2020-12) of result.json, made of the dataclass that a stage fills in: what `encode` writes of it.

    result_schema(Result, "frf")
"""

from __future__ import annotations

import dataclasses
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from pipelines.io.field_words import words_of
from pipelines.io.results import SCHEMA_VERSION

__all__ = ["DRAFT", "result_schema"]

DRAFT: Final = "https://json-schema.org/draft/2020-12/schema"
_PLAIN: Final[dict[Any, dict[str, Any]]] = {
    bool: {"type": "boolean"}, int: {"type": "integer"}, str: {"type": "string"}, Path: {"type": "string"},
    float: {"type": ["number", "null"], "description": "null: infinite or undefined"}, type(None): {"type": "null"}}
_SERIES = {"type": "object", "properties": {"$series": {"type": "string", "description": "its place"}}, "required": ["$series"],
           "additionalProperties": False, "description": "the place of a long series in result.h5"}
_ARRAY = {"anyOf": [{"type": ["number", "null"]}, {"type": "array", "items": {"$ref": "#/$defs/numbers"}}]}

_Defs = dict[str, Any]


def result_schema(kind: type[Any], command: str) -> dict[str, Any]:
    """The schema of the result.json of `command`, whose result is a `kind`."""
    defs: _Defs = {"numbers": _ARRAY, "series": _SERIES}
    whole = _object(kind, defs)
    heading = {"command": {"const": command, "description": "the command that has left this"},
               "schema_version": {"const": SCHEMA_VERSION, "description": "version of the names in this file"}}
    whole["properties"] = heading | whole["properties"]
    whole["required"] = [*heading, *whole["required"]]
    title = f"result.json of rrrid {command}"
    return {"$schema": DRAFT, "title": title, **whole, "$defs": {name: defs[name] for name in sorted(defs)}}


def _of(kind: Any, defs: _Defs) -> dict[str, Any]:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if kind in _PLAIN:
        return _PLAIN[kind]
    if origin is typing.Literal:
        return {"enum": list(arguments)}
    if origin in (typing.Union, types.UnionType):
        return {"anyOf": [_of(one, defs) for one in arguments]}
    if origin is np.ndarray or kind is np.ndarray:
        return {"anyOf": [{"$ref": "#/$defs/numbers"}, {"$ref": "#/$defs/series"}]}
    if dataclasses.is_dataclass(kind) and isinstance(kind, type):
        return {"$ref": f"#/$defs/{_named(kind, defs)}"}
    if origin is tuple and not (len(arguments) == 2 and arguments[1] is Ellipsis):
        items = [_of(one, defs) for one in arguments]
        return {"type": "array", "prefixItems": items, "minItems": len(items), "maxItems": len(items)}
    if origin in (tuple, list):
        return {"type": "array", "items": _of(arguments[0], defs)}
    if kind is dict or (isinstance(origin, type) and issubclass(origin, Mapping)):
        return {"type": "object", "additionalProperties": _of(arguments[1], defs) if arguments else {}}
    return {}  # Any: of a run, each stage's own schema


def _told(schema: dict[str, Any], words: str) -> dict[str, Any]:
    """A field's schema with its words before what its type says by itself."""
    return schema | {"description": "; ".join(filter(None, (words, schema.get("description", ""))))} if words else schema


def _named(kind: type[Any], defs: _Defs) -> str:
    """The name of a dataclass among the definitions; two of one name in different modules are told apart."""
    name, place = kind.__name__, f"{kind.__module__}.{kind.__qualname__}"
    if name in defs and defs[name].get("$comment") != place:
        name = place
    if name not in defs:
        defs[name] = {"$comment": place}  # first of all: it may hold itself
        defs[name] |= _object(kind, defs)
    return name


def _object(kind: type[Any], defs: _Defs) -> dict[str, Any]:
    """A dataclass: every stored field is there; the fields of a flat one stand beside the others, where it is there at all."""
    hints, words = typing.get_type_hints(kind), words_of(kind)
    properties: dict[str, Any] = {}
    required = []
    for field in dataclasses.fields(kind):
        if not field.metadata.get("stored", True):
            continue
        if field.metadata.get("flat"):
            inner = next(one for one in typing.get_args(hints[field.name]) or (hints[field.name],) if dataclasses.is_dataclass(one))
            properties = _object(inner, defs)["properties"] | properties  # type: ignore[arg-type]  # a class, by the line above
        else:
            properties[field.name] = _told(_of(hints[field.name], defs), words.get(field.name, ""))
            required.append(field.name)
    about = (kind.__doc__ or "").strip().split("\n\n")[0]
    told = {} if about.startswith(f"{kind.__name__}(") else {"description": " ".join(about.split())}
    return {"type": "object", **told, "properties": properties, "required": required, "additionalProperties": False}
