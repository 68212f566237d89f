"""Describe the experiment log as data: its attributes, signals, units and shapes (log-format.md).

The dataclasses below hold the attributes of a file. Their descriptions are the JSON Schema and the
words of the errors; pydantic reads them when the first log is opened.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, get_args

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
Velocity = Literal["observer", "backward-difference"]
Feedforward = Literal["friction", "inertia", "coriolis", "gravity"]

EXPERIMENTS: tuple[str, ...] = get_args(Experiment)
ROLES: tuple[str, ...] = get_args(Role)
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
_INSTANT = "ISO 8601 in UTC, like 2004-05-17T09:30:00Z"
_SECONDS = "a positive number of seconds, a real number that a float can hold"
_IN_UTC = (
    r"^\d{4}-(0[1-9]|1[0-2])-(0[1-9]|[12]\d|3[01])T([01]\d|2[0-3])(:[0-5]\d){2}"
    r"(\.\d+)?(Z|\+00:00)$"
)


def described(words: str, default: Any = dataclasses.MISSING, **constraints: Any) -> Any:
    """Return a dataclass field with a description and constraints for pydantic."""
    about = {"description": words, **constraints}
    return dataclasses.field(default=default, metadata=about)


def _words(words: str) -> Any:
    return described(f"a text in UTF-8 without NUL, not empty: {words}", pattern=_WORDS)


def optional(words: str, **constraints: Any) -> Any:
    """Return the same of a field that may be missing, which is given by its name alone."""
    about = {"description": words, **constraints}
    return dataclasses.field(default=None, kw_only=True, metadata=about)


class Strict:
    """A dataclass in a file: without unknown keys, other types, infinite or undefined numbers."""

    __pydantic_config__: ClassVar[dict[str, object]] = {
        "extra": "forbid",
        "strict": True,
        "allow_inf_nan": False,
    }


def frozen(values: npt.ArrayLike) -> Array:
    """Return `values` as a read-only array of float64."""
    array = np.asarray(values, dtype=np.float64)
    if array.flags.writeable:
        array = array.view()
        array.flags.writeable = False
    return array


class Bitwise:
    """A dataclass whose arrays are read-only and equal bit for bit, as far as it is compared."""

    def __post_init__(self) -> None:
        for name in _ARRAYS:
            if (value := getattr(self, name, None)) is not None:
                object.__setattr__(self, name, frozen(value))

    def __eq__(self, other: object) -> bool:
        fields = self.__dataclass_fields__  # type: ignore[attr-defined]
        names = [name for name, one in fields.items() if one.compare]
        return type(self) is type(other) and all(
            _same(getattr(self, name), getattr(other, name)) for name in names
        )

    __hash__ = None  # type: ignore[assignment]


def _same(a: object, b: object) -> bool:
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(_same(a[key], b[key]) for key in a)
    return type(a) is type(b) and a == b


@dataclass(frozen=True)
class _ReadAs:
    """Let pydantic read and describe a value as `kind`: an array as a list, a text as a choice."""

    kind: Any

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        return handler.generate_schema(self.kind)


Numbers = Annotated[Array, _ReadAs(list[float])]
Rows = Annotated[Array, _ReadAs(list[list[float]])]
Limits = Annotated[Array, _ReadAs(list[float | Literal["inf"]])]
Names = Annotated[tuple[str, ...], _ReadAs(list[Feedforward])]
PER_JOINT = ("kp", "kd", "ki", "observer_gain", "output_limit", "torque_resolution")
_ARRAYS = (*PER_JOINT, "posture", "values")
_LIST = "a list of finite numbers: "


@dataclass(frozen=True, eq=False)
class LogAttributes(Strict, Bitwise):
    """The attributes of a log."""

    name: str = _words("name, as results and reports have it")
    experiment: Annotated[str, _ReadAs(Experiment)] = described("what was done")
    role: Annotated[str, _ReadAs(Role)] = described("what it serves for")
    origin: Annotated[str, _ReadAs(Origin)] = described("measured, simulated or planned")
    robot_name: str = _words("name of the robot")
    sample_time: float = described(f"{_SECONDS}: nominal sampling period", ge=1e-12, le=1e12)
    torque: Annotated[str, _ReadAs(TorqueKind)] | None = optional(
        "held-command, as commanded and held; or measured"
    )
    recorded: str | None = optional(f"{_INSTANT}: when it began", pattern=_IN_UTC)
    joint: int | None = optional("an integer: the one joint that moves, from 1", ge=1, le=1000)
    posture: Numbers | None = optional(f"{_LIST}[rad, m] where the joints rest")
    period: float | None = optional(f"{_SECONDS}: period of the motion", ge=1e-12, le=1e12)


@dataclass(frozen=True, eq=False)
class Controller(Strict, Bitwise):
    """The controller of a log. `None`: the log does not say, and it is not guessed."""

    law: Annotated[str, _ReadAs(Law)] = described("control law")
    kp: Numbers | None = described(f"{_LIST}(n,) [N m/rad] or [1/s^2] gain of position", None)
    kd: Numbers | None = described(f"{_LIST}(n,) [N m s/rad] or [1/s] gain of speed", None)
    ki: Numbers | None = described(
        f"{_LIST}(n,) [N m/(rad s)] or [1/s^3] gain of the integral", None
    )
    feedforward: Names | None = described("what is fed forward", None)
    velocity: Annotated[str, _ReadAs(Velocity)] | None = described(
        "what the derivative term uses", None
    )
    observer_gain: Rows | None = described(f"{_LIST}(n, 3) gains of the observer", None)
    output_limit: Limits | None = described(
        "a list of limits above 0: (n,) [N m] largest torque commanded", None
    )
    torque_resolution: Numbers | None = described(f"{_LIST}(n,) [N m] step of the torque", None)
    delay: Annotated[int, _ReadAs(Literal[0, 1])] | None = described(
        "samples between q[k] and the tau it leads to", None
    )
    model: str | None = described(
        "a text in UTF-8 without NUL: of the model.json that was fed forward", None, pattern=_TEXT
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.feedforward is not None:
            object.__setattr__(self, "feedforward", tuple(self.feedforward))


@dataclass(frozen=True)
class Derived(Strict):
    """Where the samples of a derived log come from."""

    command: str = _words("the command that has made it")
    settings: str = described("a JSON text: the settings of that command", pattern=_TEXT)
    source_sha256: str = _words("SHA-256 of the recording it was made of")
    created: str = described(f"{_INSTANT}: when it was made", pattern=_IN_UTC)


GROUPS: dict[str, Any] = {"attributes": LogAttributes, "controller": Controller, "derived": Derived}


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


def checked(group: str, found: object, where: str) -> Any:
    """Return a group of attributes as the dataclass of its name in `GROUPS`.

    Raises:
        InputRejected: an attribute is missing (S01), unknown (S19), or not what it should be (S20).
    """
    from pydantic import ValidationError

    if not isinstance(found, Mapping):
        remedy = "write them, or import the recording again"
        raise InputRejected("S01", "the attributes are missing", where, remedy)
    table = plain(found)
    for name, value in table.items():
        # programs that know only doubles (MATLAB) write 2.0
        if name in ("joint", "delay") and isinstance(value, float) and value.is_integer():
            table[name] = int(value)
        if isinstance(value, str) and any("\ud800" <= sign <= "\udfff" for sign in value):
            table[name] = "\0"  # no UTF-8: refused as that
    try:
        values = adapter(GROUPS[group]).validate_json(json.dumps(table))
        if group == "derived":
            json.loads(values.settings)
        return values
    except ValidationError as problem:
        faults = problem.errors(include_url=False)
        raise _first_fault(faults, GROUPS[group], where) from None
    except (ValueError, RecursionError):
        words = "attribute 'settings' is not a JSON text"
        raise InputRejected("S20", words, where, "correct it") from None


def _first_fault(faults: list[ErrorDetails], kind: type[Any], where: str) -> InputRejected:
    fields = {field.name: field for field in dataclasses.fields(kind)}
    order = ("unexpected_keyword_argument", "missing", "missing_argument")
    fault = min(faults, key=lambda one: one["type"] not in order)
    name = str(fault["loc"][0])
    if fault["type"] == order[0]:
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
    signals = {
        name: {
            "type": "object",
            "description": f"{words}; SI: {_REVOLUTE.get(quantity, 'N m or rad/s^2')}",
            "properties": {"units": text, "long_name": text},
            "required": ["units", "long_name"],
            "additionalProperties": False,
        }
        for name, (quantity, words) in (SIGNALS | DERIVED).items()
    }
    described = {"type": "object", "additionalProperties": False, "properties": signals}
    title = f"{FORMAT}, version {FORMAT_VERSION}"
    return {"$schema": DRAFT, **whole, "title": title, "$defs": {"signals": described}}
