"""Say which recorded files become which logs: the recipe of `rrrid import`, a TOML file.

The shortest recipe, one log a file, everything SI:

    [robot]
    use = "robot.toml"                      # a description, a URDF, or a shipped name; beside the data or the recipe

    [log]
    match = "run_{number}.csv"              # {…} takes any text and can be used in name; * and ? as in a shell
    experiment = "excitation"               # friction | excitation | writing | frf | hold | free
    role = "identify"                       # identify | validate | reference

    [time]
    column = "t"                            # or rate = 1000 [Hz], or sample_time = 0.001 [s], where no column is
    unit = "s"                              # two columns are added: column = ["sec", "nanosec"], unit = ["s", "ns"]

    [signals]
    q   = { columns = "q_{j}", unit = "rad" }
    tau = { columns = ["m1", "m2", "m3"], unit = "N m" }

Everything else is written only where it differs: `[[file]]` cases, `[drive]`, `[resample]`, `[missing]`, `[format]`,
`[controller]` and `[[table]]`. The fields of the dataclasses below are the keys, their comments the meaning. Samples
go through: missing values -> repairs of time -> unwrap -> scale, sign, unit -> torque constant -> transmission ->
offset -> resampling.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

__all__ = [
    "ColumnSpec",
    "ControllerSpec",
    "DriveSpec",
    "FileSpec",
    "LogSpec",
    "MissingSpec",
    "Numbers",
    "Recipe",
    "ResampleSpec",
    "SignalSpec",
    "TableSpec",
    "TextFormat",
    "TimeSpec",
]

Numbers = float | tuple[float, ...]  # one for all joints, or one a joint
Columns = str | int | tuple[str | int, ...]
Texts = str | tuple[str, ...]
Experiment = Literal["friction", "excitation", "writing", "frf", "hold", "free"]
Role = Literal["identify", "validate", "reference"]
_STRICT = {"extra": "forbid"}


@dataclass(frozen=True)
class FileSpec:
    """A case of `[[file]]`: files of this pattern differ from `[log]` in what is given here. The first match counts."""

    __pydantic_config__ = _STRICT
    match: Texts
    name: str | None = None
    experiment: Experiment | None = None
    role: Role | None = None
    joint: int | None = None
    period: float | None = None
    recorded: str | None = None
    posture: tuple[float, ...] | None = None
    begin: float | None = None  # [s] samples before are left out: an approach, a homing run
    skip: bool = False  # files of this pattern are no logs


@dataclass(frozen=True)
class LogSpec:
    """`[log]`: what holds for every log. {groups} of the pattern and {stem} may stand in `name`."""

    __pydantic_config__ = _STRICT
    match: Texts = ()
    name: str = "{stem}"
    experiment: Experiment = (
        "free"  # a group {experiment} of the pattern comes first; likewise role and joint
    )
    role: Role = "identify"
    origin: Literal["measured", "simulated"] = "measured"
    torque: Literal["held-command", "measured"] = "held-command"
    joint: int | None = None  # 1-based, of friction and frf logs
    period: float | None = None  # [s]
    recorded: str | None = (
        None  # ISO 8601 with its offset from UTC, or a date and time of TOML with it
    )
    posture: tuple[float, ...] | None = None  # [rad]
    begin: float | None = (
        None  # [s] after its first sample, that a log begins at: what comes before is left out
    )


@dataclass(frozen=True)
class TimeSpec:
    """`[time]`: a column and its unit, or a rate. Both: the rate checks the column, or finds its unit.

    Two columns, such as ["sec", "nanosec"], are added, each in its own unit: ["s", "ns"].
    """

    __pydantic_config__ = _STRICT
    column: str | int | tuple[str | int, ...] | None = None
    unit: Texts | None = None  # s, ms, us, ns, 100 ns, min, d, or "sample" (needs rate)

    @property
    def parts(self) -> tuple[tuple[str | int, str | None], ...]:
        """The columns that are added, each with its unit."""
        columns = (
            self.column
            if isinstance(self.column, tuple)
            else ()
            if self.column is None
            else (self.column,)
        )
        units = self.unit if isinstance(self.unit, tuple) else (self.unit,) * len(columns)
        return tuple(zip(columns, units, strict=True))

    rate: float | None = None  # [Hz]
    sample_time: float | None = None  # [s]
    longest_gap: float | None = (
        None  # [s] default 10 samples; a longer one ends a log. Resampling alone bridges more
    )


@dataclass(frozen=True)
class SignalSpec:
    """A line of `[signals]`: where a signal stands and what its numbers mean."""

    __pydantic_config__ = _STRICT
    columns: Columns | None = (
        None  # a list, a pattern such as "Joint_{j}", a 1-based number, or the name of a matrix
    )
    column: Columns | None = None  # the same, for one joint
    unit: Texts | None = (
        None  # required: of the numbers as recorded, one or one a joint; "counts" needs counts_per_rev
    )
    file: str | None = (
        None  # in another file of the same recording: a name with {groups} and {stem}
    )
    counts_per_rev: Numbers | None = None
    wrap: float | None = (
        None  # the counter starts again after so much, in the recorded unit: unwrapped
    )
    scale: Numbers = (
        1.0  # times this before the unit: per mille of the rated torque, a current probe
    )
    sign: Numbers = 1.0  # 1 or -1, motor side
    offset: Numbers = 0.0  # SI, added after the transmission, joint side
    side: Literal["motor", "joint"] | None = None  # default: motor where [drive] has a transmission

    @property
    def where(self) -> Columns | None:
        return self.columns if self.columns is not None else self.column


@dataclass(frozen=True)
class DriveSpec:
    """`[drive]`: what lies between motor and joint: q_motor = N q_joint, tau_joint = Nᵀ tau_motor."""

    __pydantic_config__ = _STRICT
    transmission: tuple[Numbers, ...] | None = None  # N as rows, or the gear ratios alone
    torque_constant: Numbers | None = (
        None  # [N m/A] motor side; needed where torque is recorded as current
    )


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
    decimal: str | None = None  # "." or ","
    header: bool | None = None  # false: the first line is data already
    encoding: str | None = None
    comment: str | None = None  # lines that start so are left out


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
class ColumnSpec:
    """A column of a `[[table]]`."""

    __pydantic_config__ = _STRICT
    column: str | int
    unit: str | None = None
    counts_per_rev: float | None = None
    scale: float = 1.0


@dataclass(frozen=True)
class TableSpec:
    """`[[table]]`: files without a clock (maps, calibrations), kept as Parquet tables beside the logs."""

    __pydantic_config__ = _STRICT
    match: Texts
    columns: dict[str, ColumnSpec]
    name: str = "{stem}"


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
    table: tuple[TableSpec, ...] = ()
    where: str = field(default="", compare=False)
