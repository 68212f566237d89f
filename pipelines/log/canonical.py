"""The one text form of a log's attributes: what Parquet stores, what the digest covers, what crosses processes.

    {"attributes": {...}, "controller": {...}, "derived": {...}, "robot": "...", "signals": {"q": {"units": ...}}}

Numbers keep their kind: an integer stays an integer, a real number is written so that it reads back to the same bits,
and infinite or undefined reals are written as texts, which strict JSON can carry.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from pipelines.errors import InputRejected, did_you_mean
from pipelines.log import schema
from pipelines.log.experiment import Array, Controller, Derived, ExperimentLog, Signal

__all__ = ["attributes_of", "digest_of", "from_parts", "log_text", "parse_log_text"]

Kind = Callable[[object], Any]

_SPECIAL = {"inf": math.inf, "-inf": -math.inf, "nan": math.nan}


class _WrongKind(ValueError):
    pass


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise _WrongKind("a text")
    return value


def _words(value: object) -> str:
    if not _text(value).strip():
        raise _WrongKind("a text that is not empty")
    return str(value)


def _among(*choices: str) -> Kind:
    def kind(value: object) -> str:
        if value not in choices:
            raise _WrongKind(f"one of {', '.join(choices)}")
        return str(value)

    return kind


def _integer(value: object) -> int:
    # Programs that know only doubles (MATLAB) write 2.0 where 2 is meant.
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value) or value != int(value):
        raise _WrongKind("an integer")
    return int(value)


def _real(value: object) -> float:
    if isinstance(value, str) and value in _SPECIAL:
        return _SPECIAL[value]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise _WrongKind("a real number")
    return float(value)


def _positive(value: object) -> float:
    number = _real(value)
    if not (math.isfinite(number) and number > 0.0):
        raise _WrongKind("a positive number of seconds")
    return number


def _reals(value: object) -> Array:
    if not isinstance(value, list):
        raise _WrongKind("a list of real numbers")
    rows = [[_real(x) for x in row] if isinstance(row, list) else _real(row) for row in value]
    if len({len(row) if isinstance(row, list) else -1 for row in rows}) > 1:
        raise _WrongKind("a list of real numbers, its rows of one length")
    return np.array(rows, dtype=np.float64)


def _texts(value: object) -> tuple[str, ...]:
    if not isinstance(value, list):
        raise _WrongKind("a list of texts")
    return tuple(_among(*schema.FEEDFORWARD)(item) for item in value)


# name -> (kind, required)
_ATTRIBUTES: dict[str, tuple[Kind, bool]] = {
    "name": (_words, True), "experiment": (_among(*schema.EXPERIMENTS), True), "role": (_among(*schema.ROLES), True),
    "origin": (_among(*schema.ORIGINS), True), "robot_name": (_words, True), "sample_time": (_positive, True),
    "torque": (_among(*schema.TORQUE_KINDS), False), "recorded": (_text, False), "joint": (_integer, False),
    "posture": (_reals, False), "period": (_positive, False),
}
_CONTROLLER: dict[str, tuple[Kind, bool]] = {
    "law": (_among(*schema.LAWS), True), "kp": (_reals, False), "kd": (_reals, False), "ki": (_reals, False),
    "feedforward": (_texts, False), "velocity": (_among(*schema.VELOCITIES), False), "observer_gain": (_reals, False),
    "output_limit": (_reals, False), "torque_resolution": (_reals, False), "delay": (_integer, False),
    "model": (_text, False),
}
_DERIVED: dict[str, tuple[Kind, bool]] = {
    "command": (_text, True), "settings": (_text, True), "source_sha256": (_text, True), "created": (_text, True),
}


def attributes_of(log: ExperimentLog) -> dict[str, dict[str, object]]:
    """The attributes that are there, grouped as the HDF5 container groups them, without format and digest."""
    groups: dict[str, dict[str, object]] = {"attributes": _present(log, _ATTRIBUTES)}
    if log.controller is not None:
        groups["controller"] = _present(log.controller, _CONTROLLER)
    if log.derived is not None:
        groups["derived"] = _present(log.derived, _DERIVED)
    return groups


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
            raise InputRejected("S20", "units and long_name are what describes a signal", where=f"{where}, signal {name}")
        signals[name] = Signal(arrays[name], str(described["units"]), str(described["long_name"]))
    return from_parts(whole, signals, where=where)


def from_parts(groups: Mapping[str, object], signals: Mapping[str, Signal], *, where: str) -> ExperimentLog:
    """An `ExperimentLog` from groups of attributes ("attributes", "controller", "derived", "robot") and its signals.

    Raises:
        InputRejected: an attribute is missing (S01), not in the format (S19), or of the wrong kind or value (S20).
    """
    for key in groups:
        if key not in ("attributes", "controller", "derived", "robot"):
            raise InputRejected("S19", f"'{key}' is not in format version {schema.FORMAT_VERSION}", where=where)
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
        raise InputRejected("S01", "the attributes are missing", where=where)
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
        except _WrongKind as wanted:
            raise InputRejected("S20", f"attribute '{name}' is {found[name]!r}, not {wanted}", where=where,
                                remedy="correct it") from None
    return values
