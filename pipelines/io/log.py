"""Hold one recorded or simulated experiment, frozen and in SI: what every stage reads."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np

from pipelines.errors import InputRejected, UsageError, did_you_mean
from pipelines.io import schema
from pipelines.io.robot import RobotDescription, format_robot, parse_robot
from pipelines.io.sandbox import Answer
from pipelines.io.schema import PER_JOINT, Array, Bitwise, Controller, Derived, LogAttributes

__all__ = ["Array", "Controller", "Derived", "ExperimentLog", "Signal"]

_DERIVING = ("reconstruct", "estimate-bps", "validate-writing", "diagnose", "extend")


@dataclass(frozen=True, eq=False)
class Signal(Bitwise):
    """Samples with their unit and their name in words."""

    values: Array  # (samples,) or (samples, joints)
    units: str
    long_name: str


@dataclass(frozen=True, eq=False)
class ExperimentLog(LogAttributes):
    """One experiment on one robot (log-format.md), everything in SI.

    `signals` always holds t and, but in planned logs, q and tau. Samples may be NaN: a recording
    is shown as it is, and `pipelines.quality.checks` says what is wrong with it.
    """

    robot_text: str  # type: ignore[misc]  # what may be missing is given by name
    signals: Mapping[str, Signal]  # type: ignore[misc]
    controller: Controller | None = None
    derived: Derived | None = None
    source: str = field(default="", compare=False)  # the file it was read from; no part of the log

    def __post_init__(self) -> None:
        super().__post_init__()
        # one order: equal logs make equal files
        order = [*schema.SIGNALS, *schema.DERIVED, *sorted(self.signals)]
        signals = {name: self.signals[name] for name in sorted(self.signals, key=order.index)}
        object.__setattr__(self, "signals", MappingProxyType(signals))

    def __reduce__(self) -> tuple[object, ...]:
        return _rebuild, ({**vars(self), "signals": dict(self.signals)},)

    def __getitem__(self, name: str) -> Array:
        """Return the samples of signal `name`; KeyError where the log has none."""
        return self.signals[name].values

    def __contains__(self, name: object) -> bool:
        return name in self.signals

    @property
    def controlled(self) -> bool:
        """Return whether it says how its controller works."""
        return self.controller is not None and self.controller.law != "unknown"

    @property
    def t(self) -> Array:
        """Return the time stamps (samples,) [s]."""
        return self["t"]

    @property
    def q(self) -> Array:
        """Return the joint positions (samples, n) [rad]."""
        return self["q"]

    @property
    def tau(self) -> Array:
        """Return the joint torques (samples, n) [N m]."""
        return self["tau"]

    @property
    def n_samples(self) -> int:
        """Return the number of samples."""
        return int(self.t.shape[0])

    @property
    def n_joints(self) -> int:
        """Return the number of joints of the robot."""
        return self.robot.n_joints

    @cached_property
    def robot(self) -> RobotDescription:
        """Return the description of the robot."""
        return parse_robot(self.robot_text, where=self.source or self.name, inside_log=True)


def _rebuild(values: dict[str, Any]) -> ExperimentLog:
    return ExperimentLog(**{one.name: values[one.name] for one in fields(ExperimentLog)})


def attributes_of(log: ExperimentLog) -> dict[str, dict[str, Any]]:
    """Return the attributes that are there, grouped as in HDF5, without format and digest."""
    owners = {"attributes": log, "controller": log.controller, "derived": log.derived}
    groups = {}
    for group, owner in owners.items():
        names = [one.name for one in fields(schema.GROUPS[group])]
        if owner is not None:
            values = {name: getattr(owner, name) for name in names}
            groups[group] = {name: value for name, value in values.items() if value is not None}
    return groups


def _words_of(log: ExperimentLog) -> dict[str, dict[str, str]]:
    return {k: {"units": s.units, "long_name": s.long_name} for k, s in log.signals.items()}


def digest_of(log: ExperimentLog) -> str:
    """Return the SHA-256 over the canonical attributes, the robot text and every sample."""
    about: dict[str, Any] = schema.plain(attributes_of(log))
    about |= {"robot": log.robot_text, "signals": _words_of(log)}
    text = json.dumps(about, sort_keys=True, separators=(",", ":"), allow_nan=False)
    head = f"{schema.FORMAT}/{schema.FORMAT_VERSION}\n{text}\n"
    total = hashlib.sha256(head.encode())
    for name in sorted(log.signals):
        values = np.ascontiguousarray(log.signals[name].values, dtype="<f8")
        total.update(f"{name} {values.shape}\n".encode())
        total.update(values.data if values.size else b"")
    return total.hexdigest()


def parts_of(log: ExperimentLog) -> Answer:
    """Return what a container holds of a log: groups of attributes, digest, signals."""
    groups = {**attributes_of(log), "robot": log.robot_text}
    about = {"groups": groups, "digest": digest_of(log), "signals": _words_of(log)}
    return Answer(about, {name: signal.values for name, signal in log.signals.items()})


def assembled(parts: Answer, where: str) -> ExperimentLog:
    """Return the log of what a container holds.

    Raises:
        InputRejected: something is missing (S01), not in the format (S19), or wrong (S20).
    """
    groups = dict(parts.about["groups"])
    values = vars(schema.checked("attributes", groups.pop("attributes"), where))
    robot = groups.pop("robot", None)
    if not isinstance(robot, str):
        words = "the robot description is missing"
        raise InputRejected("S01", words, where, "a log explains itself: write /robot")
    for name in ("controller", "derived"):
        if name in groups:
            values |= {name: schema.checked(name, groups.pop(name), f"{where}, {name}")}
    if groups:
        words = f"{sorted(groups)} are not in format version {schema.FORMAT_VERSION}"
        raise InputRejected("S19", words, where, "remove them")
    signals = {}
    for name, samples in parts.arrays.items():
        words_of = dict(parts.about["signals"][name])
        units, long_name = str(words_of.pop("units", "")), str(words_of.pop("long_name", ""))
        if words_of:
            words = f"attributes {sorted(words_of)} are not in the format"
            raise InputRejected("S19", words, f"{where}, signal {name}", "remove them")
        signals[name] = Signal(samples, units, long_name)
    return ExperimentLog(**values, robot_text=robot, signals=signals, source=where)


def created(recorded: str | None = None) -> str:
    """Return the time stamp of a derived log: equal inputs give equal logs.

    It is the time of the recording, or the one that reproducible builds agree on.
    """
    if recorded is not None:
        return recorded
    seconds = int(os.environ.get("SOURCE_DATE_EPOCH", "0"))
    return time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(seconds))


def derive(
    log: ExperimentLog, command: str, settings: Mapping[str, Any], signals: Mapping[str, Array]
) -> ExperimentLog:
    """Return `log` with further `signals` that `command` derived with `settings`.

    `source_sha256` is the digest of the recording, not of its file: a derived log fits its
    recording in either container. What the recording says under /derived is kept in the settings.
    """
    bare = recording(log)
    kept = {name: signal for name, signal in bare.signals.items() if name not in signals}
    bare = replace(bare, signals=kept)
    steps = {name: done for name, done in _steps(log).items() if name != command}
    record = {
        "steps": steps | {command: dict(settings)},
        "recording": asdict(bare.derived) if bare.derived else None,
        "own": [name for name in bare.signals if name in schema.DERIVED],
    }
    new = {
        name: Signal(values, schema.unit_of(name), schema.DERIVED[name][1])
        for name, values in signals.items()
    }
    text = json.dumps(record, sort_keys=True)
    about = Derived(command, text, digest_of(bare), created(log.recorded))
    return replace(log, signals={**log.signals, **new}, derived=about)


def derived_by(log: ExperimentLog, command: str, settings: Mapping[str, Any]) -> bool:
    """Return whether `log` holds what `command` with `settings` derives from its recording."""
    done = _steps(log).get(command)
    if done is None or done != json.loads(json.dumps(dict(settings))) or log.derived is None:
        return False
    return log.derived.source_sha256 == digest_of(recording(log))


def recording(log: ExperimentLog) -> ExperimentLog:
    """Return `log` without what rrrid derived from it."""
    if log.derived is None or log.derived.command not in _DERIVING:
        return log
    record = _record(log)
    before, own = record.get("recording"), record.get("own")
    names = own if isinstance(own, list) else []
    kept = {k: s for k, s in log.signals.items() if k not in schema.DERIVED or k in names}
    derived = Derived(**before) if isinstance(before, dict) else None
    return replace(log, signals=kept, derived=derived)


def _steps(log: ExperimentLog) -> dict[str, Any]:
    """Return every command that derived something, with its settings."""
    steps = _record(log).get("steps")
    return steps if isinstance(steps, dict) else {}


def _record(log: ExperimentLog) -> dict[str, Any]:
    """Return the settings under /derived; those of another program need not be ours."""
    if log.derived is None or log.derived.command not in _DERIVING:
        return {}
    try:
        found = json.loads(log.derived.settings)
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def columns_in(log: ExperimentLog) -> int:
    """Return how many joints the samples have, not the description; 0 for none."""
    samples = log.t.size if "t" in log else -1
    shapes = [s.values.shape for k, s in log.signals.items() if s.values.ndim > 1 and k != "t"]
    wide = [shape for shape in shapes if 1 not in shape] or shapes
    return max((n if count == samples else count for count, n, *_ in wide), default=0)


def with_robot(log: ExperimentLog, robot: RobotDescription) -> ExperimentLog:
    """Return `log` with another description of its robot; S02 where that has other joints."""
    columns = columns_in(log)
    if columns not in (0, robot.n_joints):
        words = f"log has {columns} joints, model {robot.n_joints}"
        remedy = "give the description of this robot, or choose the columns with --joints"
        raise InputRejected("S02", words, log.source or log.name, remedy)
    return replace(log, robot_text=format_robot(robot))


def select_joints(
    log: ExperimentLog, joints: tuple[int, ...], robot: RobotDescription | None = None
) -> ExperimentLog:
    """Return `log` with the columns of `joints` (1-based) alone, in that order.

    A serial arm cannot lose a joint from its description: where the log's own robot has another
    number of joints than are chosen, `robot` must describe the arm that is left.

    Raises:
        UsageError: C02, a joint the log does not have, or twice; or no description fits.
        InputRejected: S02, the log is about a joint that is not chosen.
    """
    columns, where = columns_in(log), log.source or log.name
    absent = [str(joint) for joint in joints if not 1 <= joint <= columns]
    if absent or len(set(joints)) != len(joints):
        words = f"'{','.join(map(str, joints))}' names a joint twice"
        if absent:
            words = f"a log with {columns} joints has no joint {' or '.join(absent)}"
        raise UsageError("C02", words, where, "give each of --joints once, counted from 1")
    if robot is None and log.n_joints != len(joints):
        words = f"{len(joints)} joint{' is' if len(joints) == 1 else 's are'} chosen"
        words = f"{words}, but the log describes a robot of {log.n_joints}"
        raise UsageError("C02", words, where, "describe the arm that is left with --robot")
    if log.joint is not None and log.joint not in joints:
        words = f"the log moves joint {log.joint}, which --joints leaves out"
        raise InputRejected("S02", words, where, "choose it too, or leave this log out")
    chosen = np.array(joints) - 1
    samples = log.t.size if "t" in log else -1

    def taken(values: Array) -> Array:
        """Take the joints of (samples, joints), of the same turned round (S11), or of (joints,)."""
        if values.shape == (samples, columns):
            return np.ascontiguousarray(values[:, chosen])
        return values[chosen] if len(values) == columns else values

    signals = {
        name: signal if name == "t" else replace(signal, values=taken(signal.values))
        for name, signal in log.signals.items()
    }
    controller = log.controller
    if controller is not None:
        given = {key: getattr(controller, key) for key in PER_JOINT}
        changes: dict[str, Any] = {k: taken(own) for k, own in given.items() if own is not None}
        controller = replace(controller, **changes)
    joint = None if log.joint is None else joints.index(log.joint) + 1
    posture = None if log.posture is None else taken(log.posture)
    return replace(log, signals=signals, joint=joint, posture=posture, controller=controller)


def refuse_unlike_format(log: ExperimentLog) -> None:
    """Refuse a log that is not exactly what the format says: what a writer may put on disk."""
    where = log.source or log.name
    for group, found in attributes_of(log).items():
        schema.checked(group, found, where if group == "attributes" else f"{where}, {group}")
    texts = {f"signal {name}, long_name": signal.long_name for name, signal in log.signals.items()}
    for place, text in (texts | {"robot": log.robot_text}).items():
        try:
            bad = b"\0" in text.encode("utf-8")
        except (UnicodeEncodeError, AttributeError):
            bad = True
        if bad:
            words, remedy = "not a text in UTF-8 without NUL", "write it as plain text"
            raise InputRejected("S20", words, f"{where}, {place}", remedy)
    refuse_bad_signals(log)
    _refuse_shapes(log, where)


def refuse_bad_signals(log: ExperimentLog) -> None:
    """Refuse a log that lacks a signal (S01), or has one that it cannot have (S19, S20)."""
    where = log.source or log.name
    known = schema.SIGNALS | (schema.DERIVED if log.derived is not None else {})
    planned = log.origin == "planned"
    required = ("t", "q_ref") if planned else ("t", "q", "tau")
    missing = [name for name in required if name not in log.signals]
    if missing:
        unknown = set(log.signals) - set(known)
        hints = "".join(did_you_mean(name, unknown) for name in missing)
        there = ", ".join(sorted(log.signals)) or "none"
        words = f"signal {', '.join(missing)} missing{hints}; there are {there}"
        raise InputRejected("S01", words, where, "rename it, or import the recording with --map")
    measured = [name for name in ("q", "tau") if name in log.signals]
    if planned and measured:
        words = f"a planned log has references only, but there is {', '.join(measured)}"
        remedy = "remove them, or say where they come from: origin 'measured' or 'simulated'"
        raise InputRejected("S20", words, where, remedy)
    for name in log.signals:
        if name not in known:
            hint = did_you_mean(name, known)
            more = " without a /derived group" if name in schema.DERIVED else hint
            words = f"signal '{name}' is not in format version {schema.FORMAT_VERSION}{more}"
            raise InputRejected("S19", words, where, "rename or remove it")


def _refuse_shapes(log: ExperimentLog, where: str) -> None:
    """Refuse wrong units (S05), shapes (S02, S11) and attributes that do not go together (S20)."""
    n, samples = log.n_joints, log.signals["t"].values.shape
    law = log.controller.law if log.controller else None
    for name, signal in log.signals.items():
        place, shape, wanted = f"{where}, signal {name}", signal.values.shape, (*samples, n)
        if signal.units != (unit := schema.unit_of(name, law)):
            words = f"units are '{signal.units}', the format wants '{unit}'"
            raise InputRejected("S05", words, place, "convert the samples to SI")
        if (name == "t" and len(shape) == 1) or (name != "t" and shape == wanted):
            continue
        if name != "t" and shape[:-1] == samples:
            words = f"{shape[1]} columns for a robot of {n} joints"
            remedy = "give the description of this robot, or choose the columns with --joints"
            raise InputRejected("S02", words, place, remedy)
        words = f"shape {shape}, neither ({samples[0]}, {n}) nor ({n}, {samples[0]})"
        raise InputRejected("S11", words, place, "store (samples, joints), and t as a vector")
    for words in _contradictions(log, n):
        remedy = "write one value a joint, joints counted from 1; gains, or law 'unknown'"
        raise InputRejected("S20", words, where, remedy)


def _contradictions(log: ExperimentLog, n: int) -> Iterator[str]:
    """Yield which attributes do not fit each other, or `n` joints."""
    moves_one = log.experiment in schema.ONE_JOINT
    if (log.joint is not None) != moves_one:
        verb = "needs" if moves_one else "does not have"
        yield f"a {log.experiment} log {verb} the attribute joint"
    if not 1 <= (log.joint or 1) <= n:
        yield f"joint is {log.joint}, outside 1 … {n}"
    if log.posture is not None and log.posture.shape != (n,):
        yield f"posture has {log.posture.size} values for {n} joints"
    controller = log.controller
    if controller is None:
        return
    for key in PER_JOINT:
        value, shape = getattr(controller, key), (n, 3) if key == "observer_gain" else (n,)
        if value is not None and value.shape != shape:
            yield f"controller: {key} has shape {value.shape}, not {shape}"
    if controller.output_limit is not None and not (controller.output_limit > 0.0).all():
        yield "controller: output_limit is not a list of limits above 0"
    without_gains = controller.kp is None or controller.kd is None
    if without_gains and controller.law in ("pd", "pd+feedforward", "computed-torque"):
        yield f"controller: law {controller.law} without kp and kd"
