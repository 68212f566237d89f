"""The one text form of a log's attributes: what Parquet stores, what the digest covers, what crosses processes.

    {"attributes": {...}, "controller": {...}, "derived": {...}, "robot": "...", "signals": {"q": {"units": ...}}}

Numbers keep their kind: an integer stays an integer, a real number is written so that it reads back to the same bits,
and infinite or undefined reals are written as texts, which strict JSON can carry.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from pipelines.errors import InputRejected, did_you_mean
from pipelines.io import kinds, schema
from pipelines.io.experiment import Array, Controller, Derived, ExperimentLog, Signal
from pipelines.io.kinds import Kind, WrongKind, among, printable, reals, seconds, words

__all__ = ["attributes_of", "digest_of", "from_parts", "log_text", "parse_log_text", "refuse_wrong_kinds"]

# name -> (kind, required)
_ATTRIBUTES: dict[str, tuple[Kind, bool]] = {
    "name": (words, True), "experiment": (among(*schema.EXPERIMENTS), True), "role": (among(*schema.ROLES), True),
    "origin": (among(*schema.ORIGINS), True), "robot_name": (words, True), "sample_time": (seconds, True),
    "torque": (among(*schema.TORQUE_KINDS), False), "recorded": (kinds.instant, False), "joint": (kinds.integer, False),
    "posture": (reals, False), "period": (seconds, False),
}
_CONTROLLER: dict[str, tuple[Kind, bool]] = {
    "law": (among(*schema.LAWS), True), "kp": (reals, False), "kd": (reals, False), "ki": (reals, False),
    "feedforward": (kinds.texts(*schema.FEEDFORWARD), False), "velocity": (among(*schema.VELOCITIES), False),
    "observer_gain": (reals, False), "output_limit": (kinds.limits, False), "torque_resolution": (reals, False),
    "delay": (among(0, 1), False), "model": (kinds.text, False),
}
_DERIVED: dict[str, tuple[Kind, bool]] = {
    "command": (words, True), "settings": (kinds.json_words, True), "source_sha256": (words, True),
    "created": (kinds.instant, True),
}


def attributes_of(log: ExperimentLog) -> dict[str, dict[str, object]]:
    """The attributes that are there, grouped as the HDF5 container groups them, without format and digest."""
    groups: dict[str, dict[str, object]] = {"attributes": _present(log, _ATTRIBUTES)}
    if log.controller is not None:
        groups["controller"] = _present(log.controller, _CONTROLLER)
    if log.derived is not None:
        groups["derived"] = _present(log.derived, _DERIVED)
    return groups


def refuse_wrong_kinds(log: ExperimentLog) -> None:
    """Raise InputRejected (S20) where an attribute or a text of `log` is not of the kind the format says."""
    where = log.source or log.name
    known = {"attributes": _ATTRIBUTES, "controller": _CONTROLLER, "derived": _DERIVED}
    for group, attributes in attributes_of(log).items():
        place = where if group == "attributes" else f"{where}, {group}"
        _checked({name: _listed(value) for name, value in attributes.items()}, known[group], place)
    texts = [("robot", log.robot_text), *((f"signal {name}, long_name", s.long_name) for name, s in log.signals.items())]
    for name, text in texts:
        if not isinstance(text, str) or not printable(text):
            raise InputRejected("S20", "not a text in UTF-8 without NUL", where=f"{where}, {name}", remedy="write it as plain text")


def _listed(value: object) -> object:
    return value.tolist() if isinstance(value, np.ndarray) else value


def _present(owner: object, names: Mapping[str, object]) -> dict[str, object]:
    return {name: value for name in names if (value := getattr(owner, name)) is not None}


def log_text(log: ExperimentLog) -> str:
    """Everything but the samples, as canonical JSON: sorted keys, no blanks, ASCII."""
    whole: dict[str, object] = {key: _plain(group) for key, group in attributes_of(log).items()}
    whole["robot"] = log.robot_text
    whole["signals"] = {name: {"long_name": s.long_name, "units": s.units} for name, s in log.signals.items()}
    return json.dumps(whole, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [_plain(item) for item in (value.tolist() if isinstance(value, np.ndarray) else value)]
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    return value


def digest_of(log: ExperimentLog) -> str:
    """SHA-256 over the canonical attributes, the robot text and every sample, in hexadecimal."""
    total = hashlib.sha256(f"{schema.FORMAT}/{schema.FORMAT_VERSION}\n{log_text(log)}\n".encode())
    for name in sorted(log.signals):
        values = np.ascontiguousarray(log.signals[name].values, dtype="<f8")
        total.update(f"{name} {values.shape}\n".encode())
        total.update(values.data if values.size else b"")
    return total.hexdigest()


def parse_log_text(text: str, arrays: Mapping[str, Array], *, where: str) -> ExperimentLog:
    """The log of a canonical text and its samples.

    Raises:
        InputRejected: the text is not JSON, or does not describe a log (S01, S19, S20).
    """
    try:
        whole = json.loads(text)
    except (ValueError, RecursionError) as problem:
        raise InputRejected("F04", f"the attributes are damaged: {problem}", where=where, remedy="copy the file again") from None
    if not isinstance(whole, dict) or not isinstance(whole.get("signals"), dict):
        raise InputRejected("F04", "the attributes are damaged: not a table", where=where, remedy="copy the file again")
    words = whole.pop("signals")
    if set(words) != set(arrays):
        raise InputRejected("S01", f"described are {sorted(words)}, stored are {sorted(arrays)}", where=where,
                            remedy="copy the file again")
    signals = {}
    for name, described in words.items():
        if not isinstance(described, dict) or set(described) != {"long_name", "units"}:
            raise InputRejected("S20", "units and long_name are what describes a signal", where=f"{where}, signal {name}",
                                remedy="copy the file again")
        signals[name] = Signal(arrays[name], str(described["units"]), str(described["long_name"]))
    return from_parts(whole, signals, where=where)


def from_parts(groups: Mapping[str, object], signals: Mapping[str, Signal], *, where: str) -> ExperimentLog:
    """An `ExperimentLog` from groups of attributes ("attributes", "controller", "derived", "robot") and its signals.

    Raises:
        InputRejected: an attribute is missing (S01), not in the format (S19), or of the wrong kind or value (S20).
    """
    for key in groups:
        if key not in ("attributes", "controller", "derived", "robot"):
            raise InputRejected("S19", f"'{key}' is not in format version {schema.FORMAT_VERSION}", where=where,
                                remedy="rename or remove it")
    robot = groups.get("robot")
    if not isinstance(robot, str):
        raise InputRejected("S01", "the robot description is missing", where=where, remedy="a log explains itself: write /robot")
    values = _checked(groups.get("attributes"), _ATTRIBUTES, where)
    controller = Controller(**_checked(groups["controller"], _CONTROLLER,
                                       f"{where}, controller")) if "controller" in groups else None
    derived = Derived(**_checked(groups["derived"], _DERIVED, f"{where}, derived")) if "derived" in groups else None
    return ExperimentLog(**values, robot_text=robot, signals=signals, controller=controller, derived=derived, source=where)


def _checked(found: object, known: Mapping[str, tuple[Kind, bool]], where: str) -> dict[str, Any]:
    if not isinstance(found, Mapping):
        raise InputRejected("S01", "the attributes are missing", where=where, remedy="write them, or import the recording again")
    for name in found:
        if name not in known:
            raise InputRejected("S19", f"attribute '{name}' is not in format version {schema.FORMAT_VERSION}"
                                f"{did_you_mean(str(name), known)}", where=where, remedy="rename or remove it")
    values = {}
    for name, (kind, required) in known.items():
        if name not in found:
            if required:
                raise InputRejected("S01", f"attribute '{name}' is missing", where=where,
                                    remedy="write it, or import the recording again")
            continue
        try:
            values[name] = kind(found[name])
        except WrongKind as wanted:
            raise InputRejected("S20", f"attribute '{name}' is {_short(found[name])}, not {wanted}", where=where,
                                remedy="correct it") from None
    return values


def _short(value: object) -> str:
    """`value` in a message; Python refuses to spell out integers of thousands of digits."""
    try:
        return repr(value)[:60]
    except ValueError:
        return "a number of thousands of digits"
