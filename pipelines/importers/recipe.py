"""Read a recipe of `rrrid import`: which recorded files become which logs, in TOML.

The shortest recipe, one log a file, everything SI:

    [robot]
    use = "robot.toml"            # a description or a URDF by the data or recipe, or a shipped name

    [log]
    match = "run_{number}.csv"    # {…} is any text, to be used in name; * and ? as in a shell
    experiment = "excitation"     # friction | excitation | writing | frf | hold | free
    role = "identify"             # identify | validate | reference

    [time]
    column = "t"                  # without a column: rate = 1000 [Hz], or sample_time = 0.001 [s]
    unit = "s"                    # two are added: column = ["sec", "nanosec"], unit = ["s", "ns"]

    [signals]
    q   = { columns = "q_{j}", unit = "rad" }
    tau = { columns = ["m1", "m2", "m3"], unit = "N m" }

Everything else is written only where it differs: `[[file]]` cases, `[drive]`, `[resample]`,
`[missing]`, `[format]` and `[controller]`. The fields of the dataclasses below are the
keys, their comments the meaning. Samples go through: missing values -> repairs of time -> unwrap ->
scale, sign, unit -> torque constant -> transmission -> offset -> resampling.
"""

from __future__ import annotations

import datetime
import itertools
import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Literal

from pipelines.errors import Gathering, InputRejected, UsageError, did_you_mean
from pipelines.importers.config import RECIPE
from pipelines.io import schema
from pipelines.io.robot import shipped
from pipelines.io.sandbox import parse_toml

Numbers = float | tuple[float, ...]  # one for all joints, or one a joint
Columns = str | int | tuple[str | int, ...]  # names, or numbers that count from 1
Texts = str | tuple[str, ...]
Experiment = Literal["friction", "excitation", "writing", "frf", "hold", "free"]
Role = Literal["identify", "validate", "reference"]
BLANK = "FILL IN"  # in a drafted recipe where nothing in the recording could tell
_STRICT = {"extra": "forbid"}


@dataclass(frozen=True)
class AboutSpec:
    """The keys that `[log]` has for every log, and `[[file]]` for the files of a pattern."""

    name: str | None = None  # may hold {groups} of the pattern, and {stem}
    experiment: Experiment | None = None  # a group {experiment}, {role} or {joint} comes first
    role: Role | None = None
    joint: int | None = None  # 1-based, of friction and frf logs
    period: float | None = None  # [s]
    recorded: str | None = None  # ISO 8601 or a date of TOML, with its offset from UTC
    posture: tuple[float, ...] | None = None  # [rad]
    begin: float | None = None  # [s] left out of the beginning: an approach, homing


@dataclass(frozen=True, kw_only=True)
class FileSpec(AboutSpec):
    """`[[file]]`: where files of this pattern differ from `[log]`. The first match counts."""

    __pydantic_config__ = _STRICT
    match: Texts
    skip: bool = False  # files of this pattern are no logs


@dataclass(frozen=True)
class LogSpec(AboutSpec):
    """`[log]`: of every log."""

    __pydantic_config__ = _STRICT
    match: Texts = ()
    name: str = "{stem}"
    experiment: Experiment = "free"
    role: Role = "identify"
    origin: Literal["measured", "simulated"] = "measured"
    torque: Literal["held-command", "measured"] = "held-command"


@dataclass(frozen=True)
class TimeSpec:
    """`[time]`: a column and its unit, or a rate. Of both, the rate checks the column or its unit.

    Two columns, such as ["sec", "nanosec"], are added, each in its own unit: ["s", "ns"].
    """

    __pydantic_config__ = _STRICT
    column: Columns | None = None
    unit: Texts | None = None  # s, ms, us, ns, 100 ns, min, d, or "sample" (needs rate)
    rate: float | None = None  # [Hz]
    sample_time: float | None = None  # [s]
    longest_gap: float | None = None  # [s] ends a log, default 10 samples; resampling: more

    @property
    def parts(self) -> tuple[tuple[str | int, str | None], ...]:
        """Return the columns that are added, each with its unit."""
        if self.column is None:
            return ()
        columns = self.column if isinstance(self.column, tuple) else (self.column,)
        units = self.unit if isinstance(self.unit, tuple) else (self.unit,) * len(columns)
        return tuple(zip(columns, units, strict=True))


@dataclass(frozen=True)
class SignalSpec:
    """A line of `[signals]`: the columns of a signal and the meaning of their numbers."""

    __pydantic_config__ = _STRICT
    columns: Columns | None = None  # a list, pattern "Joint_{j}", 1-based number, or matrix
    column: Columns | None = None  # the same, for one joint
    unit: Texts | None = None  # required, one or one a joint; "counts" needs counts_per_rev
    file: str | None = None  # another file of the recording: a name with {groups} and {stem}
    counts_per_rev: Numbers | None = None
    wrap: float | None = None  # range after which the counter starts again: unwrapped
    scale: Numbers = 1.0  # factor before the unit: per mille of the rated torque, a probe
    sign: Numbers = 1.0  # 1 or -1, motor side
    offset: Numbers = 0.0  # SI, added after the transmission, joint side
    side: Literal["motor", "joint"] | None = None  # default: motor where [drive] has a transmission

    @property
    def where(self) -> Columns | None:
        return self.columns if self.columns is not None else self.column


@dataclass(frozen=True)
class DriveSpec:
    """`[drive]` between motor and joint: q_motor = N q_joint, tau_joint = Nᵀ tau_motor."""

    __pydantic_config__ = _STRICT
    transmission: tuple[Numbers, ...] | None = None  # N as rows, or the gear ratios alone
    torque_constant: Numbers | None = None  # [N m/A] motor side, where torque is a current


@dataclass(frozen=True)
class ResampleSpec:
    """`[resample]`: put unevenly sampled signals on an even grid."""

    __pydantic_config__ = _STRICT
    rate: float  # [Hz]
    method: Literal["spline", "linear"] = "spline"


@dataclass(frozen=True)
class MissingSpec:
    """`[missing]`: numbers that mean "no sample", such as -999 or inf."""

    __pydantic_config__ = _STRICT
    values: tuple[float, ...] = ()


@dataclass(frozen=True)
class TextFormat:
    """The format of a text file as a recipe states it; the rest is detected."""

    __pydantic_config__ = _STRICT
    delimiter: str | None = None
    decimal: Literal[".", ","] | None = None
    header: bool | None = None  # false: the first line is data already
    encoding: str | None = None
    comment: str | None = None  # begins a comment


@dataclass(frozen=True)
class ControllerSpec:
    """`[controller]`: what followed the reference, as the log format has it."""

    __pydantic_config__ = _STRICT
    law: Literal["open-loop", "pd", "pd+feedforward", "computed-torque", "unknown"]
    kp: tuple[float, ...] | None = None
    kd: tuple[float, ...] | None = None
    ki: tuple[float, ...] | None = None
    feedforward: tuple[Literal["friction", "inertia", "coriolis", "gravity"], ...] | None = None
    velocity: Literal["observer", "backward-difference"] | None = None
    output_limit: tuple[float, ...] | None = None
    torque_resolution: tuple[float, ...] | None = None
    delay: Literal[0, 1] | None = None


@dataclass(frozen=True)
class Recipe:
    """A whole recipe, checked."""

    __pydantic_config__ = _STRICT
    robot: dict[str, Any]
    signals: dict[str, SignalSpec] = field(default_factory=dict)
    time: TimeSpec = TimeSpec()
    log: LogSpec = LogSpec()
    file: tuple[FileSpec, ...] = ()
    drive: DriveSpec = DriveSpec()
    resample: ResampleSpec | None = None
    missing: MissingSpec = MissingSpec()
    format: TextFormat = field(default_factory=TextFormat)
    controller: ControllerSpec | None = None
    where: str = field(default="", compare=False)


_SECTIONS: dict[str, type] = {
    "log": LogSpec, "file": FileSpec, "time": TimeSpec, "signals": SignalSpec, "drive": DriveSpec,
    "resample": ResampleSpec, "missing": MissingSpec, "format": TextFormat,
    "controller": ControllerSpec,
}  # fmt: skip
_DRAFT = "rrrid import --guess FILE drafts a recipe"
_POSITIVE = ("rate", "sample_time", "longest_gap", "counts_per_rev", "wrap", "period",
             "torque_constant")  # fmt: skip
Problems = Iterator[tuple[str, str, str]]  # code, message, remedy; the first one is raised


def find_recipe(source: str | Path) -> Path:
    """Return the recipe file of that path, or the shipped recipe of that bare name."""
    path = Path(source)
    return path if path.exists() else shipped("recipes", str(source))


def parse_recipe(text: str, where: object = "") -> Recipe:
    """Read and check a recipe.

    Raises:
        UsageError: C01 unknown key or not TOML, C02 a value out of its bounds.
        InputRejected: S04 a signal without unit, S09 a rate that is a period, S10 current without
            torque constant.
    """
    from pydantic import TypeAdapter, ValidationError

    try:
        table = parse_toml(text)
    except ValueError as problem:
        message = f"the recipe is not valid TOML: {problem}"
        remedy = "correct that line; strings need quotes, tables [ ]"
        raise UsageError("C01", message, where, remedy) from None
    if blanks := blanks_of(table):
        more = f" and at {', '.join(blanks[1:6])}" if len(blanks) > 1 else ""
        remedy = f"replace the blank marked {BLANK} at {blanks[0]}{more}; the draft says what"
        message = f"'{blanks[0]}' is still marked {BLANK}"
        raise UsageError("C02", message, where, f"{remedy} belongs there")
    if "where" in table:
        raise UsageError("C01", "'where' is not a key of a recipe", where, "remove it")
    table = {key: _sound(value, key, key, where) for key, value in table.items()}
    try:
        # TOML's own dates become text, for the type check to complain of.
        recipe = TypeAdapter(Recipe).validate_json(json.dumps(table, default=str), strict=True)
    except ValidationError as problem:
        found = Gathering()
        # A value of several possible types has a complaint for each type: the first will do.
        places = {str(_place(error)): error for error in reversed(problem.errors())}
        found.found += [_explain(error, where) for error in reversed(places.values())]
        found.raise_all()
        raise  # never reached: there is an error at least
    for code, message, remedy in itertools.chain(_format(recipe), _signals(recipe), _times(recipe)):
        kind = UsageError if code.startswith("C") else InputRejected
        raise kind(code, message, where, remedy)
    return recipe


def blanks_of(value: object, path: str = "") -> list[str]:
    """Return the places of what --guess could not know and is not yet filled in."""
    inner: Iterable[tuple[str, object]] = ()
    if isinstance(value, dict):
        inner = ((f"{path}.{name}".lstrip("."), x) for name, x in value.items())
    elif isinstance(value, list):
        inner = ((f"{path}[{i}]", x) for i, x in enumerate(value, start=1))
    elif isinstance(value, str) and BLANK in value.upper():
        return [path]
    return [place for name, x in inner for place in blanks_of(x, name)]


def _sound(value: Any, path: str, key: str, where: object) -> Any:
    """Return a value of TOML, dates as UTC in text; C02 where a number is out of its bounds."""
    if isinstance(value, dict):
        return {name: _sound(x, f"{path}.{name}", name, where) for name, x in value.items()}
    if isinstance(value, list):
        return [_sound(x, f"{path}[{i}]", key, where) for i, x in enumerate(value, start=1)]
    if key == "recorded":
        return _utc(value, path, where)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not number or path.startswith(("robot.", "missing.")):
        return value
    try:
        x = float(value)
    except OverflowError:  # an integer of hundreds of digits
        x = math.inf
    said = ""
    if not math.isfinite(x):
        said, remedy = "must be a finite number", "correct the number"
    elif abs(x) > RECIPE.largest:
        said, remedy = f"must lie within ±{RECIPE.largest:g}", "correct it, or its unit"
    elif key in _POSITIVE and x <= 0.0:
        said, remedy = "must be above 0", "correct the number"
    elif key == "sign" and abs(x) != 1.0:
        said, remedy = "must be 1 or -1", "use scale for other factors"
    elif key in ("joint", "column", "columns") and (x < 1 or x != int(x)):
        said, remedy = "must be 1 or more", "joints and columns count from 1"
    if said:
        raise UsageError("C02", f"'{path}' is {x}, {said}", where, remedy)
    return value


def _utc(value: object, path: str, where: object) -> str:
    """Return a date and time in UTC; C02 without its offset, which is not the same everywhere."""
    try:
        time = datetime.datetime.fromisoformat(str(value))
    except ValueError:
        time = datetime.datetime.min
    if time.tzinfo is None:
        message = f"'{path}' is '{value}', no date and time with its offset from UTC"
        remedy = "write 2024-05-17T11:30:00+02:00, or with Z; or leave it out"
        raise UsageError("C02", message, where, remedy)
    return time.astimezone(datetime.UTC).isoformat().replace("+00:00", "Z")


def _place(error: Any) -> list[Any]:
    """Return the keys that lead to the value of a complaint, without the types pydantic tried."""
    tried = ("str", "int", "float")
    return [x for x in error["loc"] if not (isinstance(x, str) and ("[" in x or x in tried))]


def _explain(error: Any, where: object) -> UsageError:
    """Return a complaint of pydantic in our words, with the key it is about."""
    path = _place(error)
    parts = (f"[{part + 1}]" if isinstance(part, int) else str(part) for part in path)
    place = ".".join(parts).replace(".[", "[")
    if error["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        kind = _SECTIONS.get(str(path[0]), Recipe)
        known = [f.name for f in fields(Recipe if len(path) == 1 else kind) if f.name != "where"]
        message = f"'{place}' is not a key of a recipe{did_you_mean(str(path[-1]), known)}"
        return UsageError("C01", message, where, f"known here: {', '.join(known)}")
    if error["type"] in ("missing", "missing_argument"):
        return UsageError("C02", f"'{place}' is missing", where, _DRAFT)
    message = f"'{place}': {error['msg']}, not {error['input']!r}"
    remedy = "correct the value; the module recipe.py lists the keys"
    return UsageError("C02", message, where, remedy)


def _format(recipe: Recipe) -> Problems:
    """C02: delimiter, encoding and comment are such that a text can have."""
    delimiter, encoding = recipe.format.delimiter or ",", recipe.format.encoding
    comment = recipe.format.comment
    if len(delimiter) != 1 or delimiter in "\0\r\n.\"'" or delimiter.isalnum():
        yield "C02", f"'format.delimiter' is {delimiter!r}", "give one character: , ; tab or blank"
    try:
        "0".encode("utf-8" if encoding is None else encoding)
    except (LookupError, ValueError, TypeError):
        yield "C02", f"'format.encoding' is {encoding!r}", "give for example utf-8 or latin-1"
    if comment is not None and (not comment or any(c in comment for c in "\0\r\n")):
        yield "C02", f"'format.comment' is {comment!r}", "give what begins a comment"


def _signals(recipe: Recipe) -> Problems:
    """C01, C02, S01: signals are known and have columns and a unit."""
    known = [name for name in schema.SIGNALS if name != "t"]
    for name, spec in recipe.signals.items():
        if name not in known:
            remedy = f"signals: {', '.join(known)}; time has its own table [time]"
            yield "C01", f"'signals.{name}' is not a signal{did_you_mean(name, known)}", remedy
        if (spec.columns is None) == (spec.column is None):
            message = f"'signals.{name}' needs columns (a list, a pattern or a name), once"
            yield "C02", message, 'write columns = "q_{j}", or columns = ["a", "b", "c"]'
        units = spec.unit if isinstance(spec.unit, tuple) else (spec.unit,)
        if "counts" in units and spec.counts_per_rev is None:
            message = f"'signals.{name}' is in counts: counts_per_rev is missing"
            yield "C02", message, "add counts_per_rev"
    references = [name for name in ("q_ref", "dq_ref", "ddq_ref") if name in recipe.signals]
    if len(references) in (1, 2):
        message = f"{', '.join(references)} alone: q_ref, dq_ref and ddq_ref come together"
        yield "C02", message, "map all three, or none"
    for name in ("q", "tau"):
        if name not in recipe.signals:
            remedy = f"add {name} = {{ columns = …, unit = … }} to [signals]"
            yield "S01", f"the recipe maps no signal '{name}'", remedy


def _times(recipe: Recipe) -> Problems:
    """C02, S09: rates are rates, columns of time have units, and there are logs."""
    time = recipe.time
    resampled = recipe.resample.rate if recipe.resample else None
    for place, rate in (("time.rate", time.rate), ("resample.rate", resampled)):
        if rate is not None and rate < 1.0:
            remedy = f"a period of {rate:g} s is a rate of {1 / rate:g} Hz"
            yield "S09", f"{place} is {rate:g} Hz: a period?", remedy
    if time.sample_time is not None and time.sample_time > 1.0:
        remedy = f"write rate = {time.sample_time:g}"
        yield "S09", f"time.sample_time is {time.sample_time:g} s: a rate?", remedy
    parts = time.column if isinstance(time.column, tuple) else ()
    if isinstance(time.unit, tuple) and len(time.unit) != len(parts):
        message = f"'time.unit' holds {len(time.unit)} units for {max(1, len(parts))} columns"
        example = 'column = ["sec", "nanosec"], unit = ["s", "ns"]'
        yield "C02", message, f"give one unit a column: {example}"
    if time.rate is not None and time.sample_time is not None:
        yield "C02", "'time' has both rate and sample_time", "give one of them"
    if time.column is None and time.rate is None and time.sample_time is None:
        remedy = "give the column of the time stamps, or the sampling rate [Hz]"
        yield "C02", "'time' has neither column nor rate", remedy
    for k, case in enumerate(recipe.file, start=1):
        if not case.match:
            yield "C02", f"'file[{k}].match' is empty", 'write match = "*.csv", or remove the case'
    if not recipe.log.match and all(case.skip for case in recipe.file):
        yield "C02", "the recipe matches no files", 'write match = "*.csv" in [log], or [[file]]'
