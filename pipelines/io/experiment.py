"""One recorded or simulated experiment, frozen: what every stage reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from pipelines.errors import RrridError
from pipelines.io import schema
from pipelines.io.robot import RobotDescription, parse_robot

__all__ = ["Array", "Controller", "Derived", "ExperimentLog", "Signal"]

Array = npt.NDArray[np.float64]


def frozen(values: npt.ArrayLike) -> Array:
    """`values` as a read-only array of float64."""
    array = np.asarray(values, dtype=np.float64)
    if array.flags.writeable:
        array = array.view()
        array.flags.writeable = False
    return array


@dataclass(frozen=True, eq=False)
class Signal:
    """Samples with their unit and their name in words."""

    values: Array  # (samples,) or (samples, joints)
    units: str
    long_name: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", frozen(self.values))

    def __eq__(self, other: object) -> bool:
        return (isinstance(other, Signal) and (self.units, self.long_name) == (other.units, other.long_name)
                and self.values.shape == other.values.shape and self.values.tobytes() == other.values.tobytes())


@dataclass(frozen=True, eq=False)
class Controller:
    """What followed the reference. `None` means: the log does not say, and nobody guesses."""

    law: str
    kp: Array | None = None  # (n,) [N m/rad]; "computed-torque": [1/s^2]
    kd: Array | None = None  # (n,) [N m s/rad]; "computed-torque": [1/s]
    ki: Array | None = None  # (n,)
    feedforward: tuple[str, ...] | None = None
    velocity: str | None = None
    observer_gain: Array | None = None  # (n, 3), k_i of eq. (20)
    output_limit: Array | None = None  # (n,) [N m]
    torque_resolution: Array | None = None  # (n,) [N m]
    delay: int | None = None  # samples between q[k] and the tau it leads to
    model: str | None = None  # text of the model.json that feed-forward used

    def __post_init__(self) -> None:
        for key in ("kp", "kd", "ki", "observer_gain", "output_limit", "torque_resolution"):
            if (value := getattr(self, key)) is not None:
                object.__setattr__(self, key, frozen(value))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Controller) and all(
            _same(getattr(self, key), getattr(other, key)) for key in self.__dataclass_fields__)


@dataclass(frozen=True)
class Derived:
    """Where the samples of a derived log come from."""

    command: str
    settings: str  # JSON
    source_sha256: str
    created: str  # ISO 8601, UTC


@dataclass(frozen=True, eq=False)
class ExperimentLog:
    """One experiment on one robot (`log-format.md`, version 1), everything in SI.

    `signals` always holds t and, but in planned logs, q and tau. Samples may carry NaN: a recording is shown as it
    is, and `pipelines.quality.checks` says what is wrong with it.
    """

    name: str
    experiment: str
    role: str
    origin: str
    robot_name: str
    sample_time: float  # [s] nominal
    robot_text: str
    signals: Mapping[str, Signal]
    torque: str | None = None
    recorded: str | None = None
    joint: int | None = None  # 1-based
    posture: Array | None = None  # (n,) [rad]
    period: float | None = None  # [s]
    controller: Controller | None = None
    derived: Derived | None = None
    source: str = field(default="", compare=False)  # the file it was read from; not part of the log

    def __post_init__(self) -> None:
        # One order, whatever the order they were given or stored in: equal logs make equal files.
        order = {name: place for place, name in enumerate((*schema.SIGNALS, *schema.DERIVED))}
        ordered = sorted(self.signals.items(), key=lambda item: (order.get(item[0], len(order)), item[0]))
        object.__setattr__(self, "signals", MappingProxyType(dict(ordered)))
        if self.posture is not None:
            object.__setattr__(self, "posture", frozen(self.posture))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ExperimentLog) and all(
            _same(getattr(self, key), getattr(other, key)) for key in self.__dataclass_fields__ if key != "source")

    def __reduce__(self) -> tuple[object, ...]:
        values = {key: getattr(self, key) for key in self.__dataclass_fields__}
        return _rebuild, (values | {"signals": dict(self.signals)},)

    def __getitem__(self, name: str) -> Array:
        """Samples of signal `name`; KeyError where the log has none."""
        return self.signals[name].values

    def __contains__(self, name: object) -> bool:
        return name in self.signals

    @property
    def controlled(self) -> bool:
        """Return whether it says how its controller works."""
        return self.controller is not None and self.controller.law != "unknown"

    @property
    def t(self) -> Array:
        return self["t"]

    @property
    def q(self) -> Array:
        return self["q"]

    @property
    def tau(self) -> Array:
        return self["tau"]

    @property
    def n_samples(self) -> int:
        return int(self.t.shape[0])

    @property
    def n_joints(self) -> int:
        return self.robot.n_joints

    @cached_property
    def robot(self) -> RobotDescription:
        try:
            return _described(self.robot_text)
        except RrridError:  # once more, to say where
            return parse_robot(self.robot_text, where=self.source or self.name, inside_log=True)


@lru_cache(maxsize=16)
def _described(text: str) -> RobotDescription:
    """The logs of a session carry one and the same description, and reading it takes longer than their hashes."""
    return parse_robot(text)


def _rebuild(values: dict[str, object]) -> ExperimentLog:
    return ExperimentLog(**values)  # type: ignore[arg-type]


def _same(a: object, b: object) -> bool:
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(_same(a[key], b[key]) for key in a)
    return type(a) is type(b) and a == b
