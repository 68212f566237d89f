"""The JSON Schema (draft 2020-12) of a log's description: all of a log but its samples.

It is the JSON object under the key `rrrid` of a Parquet log's metadata; an HDF5 log has the same as attributes of `/`,
`/controller` and `/derived`. Samples are columns NAME or NAME_1 … NAME_n in Parquet, `/signals/NAME`, (N,) or (N, n), in HDF5;
each carries the attributes that `$defs/signals` lists by its name.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

from pipelines.io import schema
from pipelines.io.result_schema import DRAFT

__all__ = ["log_schema"]

_WORDS: Final = {"type": "string", "minLength": 1}
_REAL: Final = {"anyOf": [{"type": "number"}, {"enum": ["inf", "-inf", "nan"]}]}
_REALS: Final = {"type": "array", "items": _REAL}
_ATTRIBUTES: Final[dict[str, Any]] = {
    "name": _WORDS, "experiment": {"enum": list(schema.EXPERIMENTS)}, "role": {"enum": list(schema.ROLES)},
    "origin": {"enum": list(schema.ORIGINS)}, "robot_name": _WORDS, "sample_time": {"type": "number", "exclusiveMinimum": 0},
    "torque": {"enum": list(schema.TORQUE_KINDS)}, "recorded": {"type": "string", "description": "ISO 8601, UTC"},
    "joint": {"type": "integer", "minimum": 1}, "posture": _REALS, "period": {"type": "number", "exclusiveMinimum": 0}}
_REQUIRED: Final = ("name", "experiment", "role", "origin", "robot_name", "sample_time")
_ABOUT: Final = {
    "format": "what kind of file this is", "format_version": "version of the format",
    "digest": "SHA-256 over all samples and attributes: a flipped byte is noticed",
    "controller": "the controller that was in charge", "derived": "of a log that a command has made of another",
    "name": "name, as results and reports have it",
    "experiment": "what was done", "role": "what it serves for", "origin": "measured, simulated or planned",
    "robot_name": "name of the robot", "sample_time": "[s] between samples",
    "torque": "held-command, what was commanded and held; or measured",
    "joint": "number of the one joint that moves, from 1", "posture": "[rad, m] where the joints stand",
    "period": "[s] of the motion",
    "law": "control law", "kp": "[N m/rad] or [1/s^2] gain of position, joint by joint", "kd": "[N m s/rad] or [1/s] gain of speed",
    "ki": "[N m/(rad s)] or [1/s^3] gain of the integral", "feedforward": "what is fed forward",
    "velocity": "where its speed comes from",
    "observer_gain": "gains of the observer, one row a joint", "output_limit": "[N m] largest torque commanded, joint by joint",
    "torque_resolution": "[N m] step of the commanded torque", "delay": "samples from measurement to command",
    "command": "the command that has made it", "source_sha256": "SHA-256 of the file it was made of", "created": "ISO 8601, UTC"}
_MATRIX: Final = {"type": "array", "items": {"anyOf": [_REAL, _REALS]}}


def log_schema() -> dict[str, Any]:
    """The schema of version `FORMAT_VERSION`."""
    controller = _object({
        "law": {"enum": list(schema.LAWS)}, "kp": _REALS, "kd": _REALS, "ki": _REALS,
        "feedforward": {"type": "array", "items": {"enum": list(schema.FEEDFORWARD)}},
        "velocity": {"enum": list(schema.VELOCITIES)},
        "observer_gain": _MATRIX, "output_limit": _REALS, "torque_resolution": _REALS, "delay": {"enum": [0, 1]},
        "model": {"type": "string", "description": "the text of a model.json"}}, ("law",))
    derived = _object({"command": _WORDS, "settings": {"type": "string", "description": "JSON"}, "source_sha256": _WORDS,
                       "created": _WORDS}, ("command", "settings", "source_sha256", "created"))
    signals = {"type": "object", "additionalProperties": False, "properties": {
        name: _object({"units": {"type": "string", "description": "unit of the samples"},
                       "long_name": {"type": "string", "description": "what it is, in words"}}, ("units", "long_name"),
                      f"{words}; SI: {_unit(name)}") for name, (_, words) in (schema.SIGNALS | schema.DERIVED).items()}}
    whole = _object({
        "format": {"const": schema.FORMAT}, "format_version": {"const": schema.FORMAT_VERSION},
        "digest": {"type": "string", "pattern": "^[0-9a-f]{64}$"}, "controller": controller, "derived": derived,
        "robot": {"type": "string", "description": "the robot description, TOML"}, **_ATTRIBUTES},
        ("format", "format_version", "robot", *_REQUIRED))
    return {"$schema": DRAFT, "title": f"{schema.FORMAT}, version {schema.FORMAT_VERSION}", **whole, "$defs": {"signals": signals}}


def _unit(name: str) -> str:
    if (schema.SIGNALS | schema.DERIVED)[name][0] == "excitation":
        return "N m under a PD law, rad/s^2 under computed torque"
    return schema.unit_of(name)


def _object(properties: dict[str, Any], required: Iterable[str], about: str = "") -> dict[str, Any]:
    told = {"description": about} if about else {}
    properties = {name: {"description": _ABOUT[name]} | own if name in _ABOUT else own for name, own in properties.items()}
    return {"type": "object", **told, "properties": properties, "required": list(required), "additionalProperties": False}
