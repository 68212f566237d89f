"""Describe the experiment log as data: its attributes, signals, units and shapes (log-format.md).

The dataclasses below hold the attributes of a file, as JSON has them. Their descriptions are the
JSON Schema and the words of the errors; pydantic reads them when the first log is opened.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar, Literal, get_args

import numpy as np
import numpy.typing as npt

from pipelines.errors import InputRejected, did_you_mean

if TYPE_CHECKING:
    from pydantic import TypeAdapter, ValidationError
    from pydantic_core import ErrorDetails

Array = npt.NDArray[np.float64]

FORMAT = "rrrid-log"
FORMAT_VERSION = 1  # numerics
DRAFT = "https://json-schema.org/draft/2020-12/schema"

Experiment = Literal["friction", "excitation", "writing", "frf", "hold", "free"]
Role = Literal["identify", "validate", "reference"]
Origin = Literal["measured", "simulated", "planned"]
TorqueKind = Literal["held-command", "measured"]
Law = Literal["open-loop", "pd", "pd+feedforward", "computed-torque", "unknown"]
Feedforward = Literal["friction", "inertia", "coriolis", "gravity"]

EXPERIMENTS: tuple[str, ...] = get_args(Experiment)
ROLES: tuple[str, ...] = get_args(Role)
ORIGINS: tuple[str, ...] = get_args(Origin)
TORQUE_KINDS: tuple[str, ...] = get_args(TorqueKind)
LAWS: tuple[str, ...] = get_args(Law)
FEEDFORWARD: tuple[str, ...] = get_args(Feedforward)
ONE_JOINT = ("friction", "frf")  # experiments that move one joint, and say which

# name -> (quantity, words); the quantity becomes a unit by the joint's type
SIGNALS: dict[str, tuple[str, str]] = {
    "t": ("time", "time stamp"),
    "q": ("position", "measured joint position"),
    "tau": ("torque", "commanded joint torque"),
    "q_ref": ("position", "reference position"),
    "dq_ref": ("velocity", "reference velocity"),
    "ddq_ref": ("acceleration", "reference acceleration"),
    "dq": ("velocity", "measured joint velocity"),
    "v": ("excitation", "injected excitation"),
    "r": ("acceleration", "input of the feedback-linearised plant"),
    "q_obs": ("position", "position observed by the controller"),
    "dq_obs": ("velocity", "velocity observed by the controller"),
    "ddq_obs": ("acceleration", "acceleration observed by the controller"),
    "tau_friction": ("torque", "friction torque computed by the controller"),
    "tau_feedforward": ("torque", "feed-forward torque computed by the controller"),
    "current": ("current", "motor current"),
    "temperature": ("temperature", "motor or joint temperature"),
}
# what stages derive; allowed only in a log that has a /derived group
DERIVED: dict[str, tuple[str, str]] = {
    "q_hat": ("position", "reconstructed position"),
    "dq_hat": ("velocity", "reconstructed velocity"),
    "ddq_hat": ("acceleration", "reconstructed acceleration"),
    "q_hat_std": ("position", "standard deviation of the reconstructed position"),
    "dq_hat_std": ("velocity", "standard deviation of the reconstructed velocity"),
    "ddq_hat_std": ("acceleration", "standard deviation of the reconstructed acceleration"),
    "tau_model": ("torque", "torque of the model"),
    "tau_inertia": ("torque", "inertial torque of the model"),
    "tau_coriolis": ("torque", "Coriolis and centripetal torque of the model"),
    "tau_gravity": ("torque", "gravity torque of the model"),
    "tau_friction_model": ("torque", "friction torque of the model"),
    "tau_effects": ("torque", "torque of the further effects of the model"),
    "tau_residual": ("torque", "measured minus modelled torque"),
}
_REVOLUTE = {
    "time": "s",
    "position": "rad",
    "velocity": "rad/s",
    "acceleration": "rad/s^2",
    "torque": "N m",
    "current": "A",
    "temperature": "degC",
}
_SLIDES = {"position": "m", "velocity": "m/s", "acceleration": "m/s^2", "torque": "N"}
_TEXT = r"^[^\x00]*$"
_WORDS = r"^[^\x00]*[^\x00\s][^\x00]*$"
_INSTANT = (
    r"^\d{4}-(0[1-9]|1[0-2])-(0[1-9]|[12]\d|3[01])T([01]\d|2[0-3])(:[0-5]\d){2}"
    r"(\.\d+)?(Z|\+00:00)$"
)


def described(words: str, default: Any = dataclasses.MISSING, **constraints: Any) -> Any:
    """Return a dataclass field with a description and constraints for pydantic."""
    about = {"description": words, **constraints}
    return dataclasses.field(default=default, metadata=about)


def _instant(words: str, default: Any = dataclasses.MISSING) -> Any:
    words = f"ISO 8601 in UTC, like 2004-05-17T09:30:00Z: {words}"
    return described(words, default, pattern=_INSTANT)


def _seconds(words: str, default: Any = dataclasses.MISSING) -> Any:
    words = f"a positive number of seconds, a real number that a float can hold: {words}"
    return described(words, default, ge=1e-12, le=1e12)


def _words(words: str) -> Any:
    return described(f"a text in UTF-8 without NUL, not empty: {words}", pattern=_WORDS)


class Strict:
    """A dataclass in a file: without unknown keys, other types, infinite or undefined numbers."""

    __pydantic_config__: ClassVar[dict[str, object]] = {
        "extra": "forbid",
        "strict": True,
        "allow_inf_nan": False,
    }


@dataclass(frozen=True)
class LogAttributes(Strict):
    """The attributes of a log."""

    name: str = _words("name, as results and reports have it")
    experiment: Experiment = described("what was done")
    role: Role = described("what it serves for")
    origin: Origin = described("measured, simulated or planned")
    robot_name: str = _words("name of the robot")
    sample_time: float = _seconds("nominal sampling period")
    torque: TorqueKind | None = described("held-command, as commanded and held; or measured", None)
    recorded: str | None = _instant("when it began", None)
    joint: int | None = described(
        "an integer: the one joint that moves, from 1", None, ge=1, le=1000
    )
    posture: list[float] | None = described(
        "a list of finite numbers: [rad, m] where the joints rest", None
    )
    period: float | None = _seconds("period of the motion", None)


@dataclass(frozen=True)
class ControllerAttributes(Strict):
    """The controller that was in charge."""

    law: Law = described("control law")
    kp: list[float] | None = described(
        "a list of finite numbers: [N m/rad] or [1/s^2] gain of position, joint by joint", None
    )
    kd: list[float] | None = described(
        "a list of finite numbers: [N m s/rad] or [1/s] gain of speed, joint by joint", None
    )
    ki: list[float] | None = described(
        "a list of finite numbers: [N m/(rad s)] or [1/s^3] gain of the integral", None
    )
    feedforward: list[Feedforward] | None = described("what is fed forward", None)
    velocity: Literal["observer", "backward-difference"] | None = described(
        "what the derivative term uses", None
    )
    observer_gain: list[list[float]] | None = described(
        "a list of finite numbers: gains of the observer, one row a joint", None
    )
    output_limit: list[float | Literal["inf"]] | None = described(
        "a list of limits above 0: [N m] largest torque commanded, joint by joint", None
    )
    torque_resolution: list[float] | None = described(
        "a list of finite numbers: [N m] step of the commanded torque", None
    )
    delay: Literal[0, 1] | None = described("samples from measurement to command", None)
    model: str | None = described(
        "a text in UTF-8 without NUL: of the model.json that was fed forward", None, pattern=_TEXT
    )


@dataclass(frozen=True)
class DerivedAttributes(Strict):
    """Where the samples of a derived log come from."""

    command: str = _words("the command that has made it")
    settings: str = described("a JSON text: the settings of that command", pattern=_TEXT)
    source_sha256: str = _words("SHA-256 of the recording it was made of")
    created: str = _instant("when it was made")


GROUPS: dict[str, Any] = {
    "attributes": LogAttributes,
    "controller": ControllerAttributes,
    "derived": DerivedAttributes,
}


@cache
def adapter(kind: Any) -> TypeAdapter[Any]:
    """Return pydantic's validator of a dataclass."""
    from pydantic import TypeAdapter

    return TypeAdapter(kind)


def fault_in_words(problem: ValidationError, *kinds: Any, first: int = 0) -> tuple[str, str]:
    """Return the first fault that pydantic found: "unknown", "missing" or "wrong", and its words.

    Args:
        kinds: the dataclasses whose fields are known.
        first: number of the first item of a list: 0 in JSON, 1 in texts of people.
    """
    fault = problem.errors(include_url=False)[0]
    path = [x for x in fault["loc"] if isinstance(x, int) or not x.startswith("nullable")]
    place = "".join(f"[{x + first}]" if isinstance(x, int) else f".{x}" for x in path).lstrip(".")
    if fault["type"] == "unexpected_keyword_argument":
        known = {one.name for kind in kinds for one in dataclasses.fields(kind)}
        hint = did_you_mean(str(path[-1]), known)
        return "unknown", f"{place} is not a key of the format{hint}"
    if fault["type"] in ("missing", "missing_argument"):
        return "missing", f"{place} is missing"
    words = "must be a table" if fault["type"] == "dataclass_type" else fault["msg"].lower()
    return "wrong", f"{place}: {words}"


def plain(value: object) -> Any:
    """Return `value` as strict JSON can hold it: lists, and texts for what is not finite."""
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    return value


def checked(group: str, found: object, where: str) -> dict[str, Any]:
    """Return the values of a group of attributes, by their names.

    Raises:
        InputRejected: an attribute is missing (S01), unknown (S19), or not what it should be (S20).
    """
    from pydantic import ValidationError

    if not isinstance(found, Mapping):
        words = "the attributes are missing"
        raise InputRejected("S01", words, where, "write them, or import the recording again")
    table = plain(found)
    for name in ("joint", "delay"):  # programs that know only doubles (MATLAB) write 2.0
        if isinstance(table.get(name), float) and table[name].is_integer():
            table[name] = int(table[name])
    for name, value in table.items():
        if isinstance(value, str) and any("\ud800" <= sign <= "\udfff" for sign in value):
            table[name] = "\0"  # no UTF-8: refused as that
    try:
        values = adapter(GROUPS[group]).validate_json(json.dumps(table))
        if group == "derived":
            json.loads(values.settings)
    except ValidationError as problem:
        faults = problem.errors(include_url=False)
        raise _first_fault(faults, GROUPS[group], where) from None
    except (ValueError, RecursionError):
        words = "attribute 'settings' is not a JSON text"
        raise InputRejected("S20", words, where, "correct it") from None
    names = (field.name for field in dataclasses.fields(values))
    return {name: value for name in names if (value := getattr(values, name)) is not None}


def _first_fault(faults: list[ErrorDetails], kind: type[Any], where: str) -> InputRejected:
    fields = {field.name: field for field in dataclasses.fields(kind)}
    order = ("unexpected_keyword_argument", "missing", "missing_argument")
    fault = min(faults, key=lambda one: one["type"] not in order)
    name = str(fault["loc"][0])
    if fault["type"] == "unexpected_keyword_argument":
        words = f"attribute '{name}' is not in format version {FORMAT_VERSION}"
        hint = did_you_mean(name, fields)
        return InputRejected("S19", f"{words}{hint}", where, "rename or remove it")
    if fault["type"] in order:
        remedy = "write it, or import the recording again"
        return InputRejected("S01", f"attribute '{name}' is missing", where, remedy)
    wanted = fields[name].metadata["description"]
    if fault["type"] == "literal_error":
        expected = str(fault["ctx"]["expected"]).replace("'", "").replace(" or ", ", ")
        wanted = f"one of {expected}"
    try:
        value = repr(fault["input"])[:60]
    except ValueError:
        value = "a number of thousands of digits"
    return InputRejected("S20", f"attribute '{name}' is {value}, not {wanted}", where, "correct it")


def quantity_of(name: str, law: str | None = None) -> str:
    """Return what signal `name` measures; under a PD law an injected excitation is a torque."""
    quantity = (SIGNALS | DERIVED)[name][0]
    if quantity == "excitation":  # eq. (27)
        return "torque" if law in ("pd", "pd+feedforward") else "acceleration"
    return quantity


def unit_of(name: str, law: str | None = None) -> str:
    """Return the `units` attribute of signal `name`: the unit of a revolute joint."""
    return _REVOLUTE[quantity_of(name, law)]


def joint_unit(name: str, revolute: bool) -> str:
    """Return the SI unit of signal `name` on one joint, for labels and messages."""
    quantity = quantity_of(name)
    return _REVOLUTE[quantity] if revolute else _SLIDES.get(quantity, _REVOLUTE[quantity])


def log_schema() -> dict[str, Any]:
    """Return the JSON Schema of a log's description: all of a log but its samples.

    It is the JSON object under the key `rrrid` of a Parquet log's metadata; an HDF5 log has the
    same as attributes of `/`, `/controller` and `/derived`. `$defs/signals` lists the signals.
    """
    groups = {name: adapter(kind).json_schema() for name, kind in GROUPS.items()}
    whole = groups.pop("attributes")
    text = {"type": "string"}
    whole["properties"] |= groups | {
        "format": {"const": FORMAT, "description": "what kind of file this is"},
        "format_version": {"const": FORMAT_VERSION, "description": "version of the format"},
        "digest": text | {"pattern": "^[0-9a-f]{64}$", "description": "SHA-256 over all samples"},
        "robot": text | {"description": "the robot description, TOML"},
    }
    whole["required"] += ["format", "format_version", "robot"]
    units = text | {"description": "unit of the samples"}
    long_name = text | {"description": "what it is, in words"}
    signals: dict[str, Any] = {}
    for name, (quantity, words) in (SIGNALS | DERIVED).items():
        signals[name] = {
            "type": "object",
            "description": f"{words}; SI: {_REVOLUTE.get(quantity, 'N m or rad/s^2')}",
            "properties": {"units": units, "long_name": long_name},
            "required": ["units", "long_name"],
            "additionalProperties": False,
        }
    signals = {"type": "object", "additionalProperties": False, "properties": signals}
    title = f"{FORMAT}, version {FORMAT_VERSION}"
    return {"$schema": DRAFT, **whole, "title": title, "$defs": {"signals": signals}}
