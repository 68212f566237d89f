"""Hold a log against its format: which signals, of what shape, in what unit, and which attributes go together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.errors import Check, InputRejected, clean, did_you_mean
from pipelines.io import schema
from pipelines.io.canonical import refuse_wrong_kinds
from pipelines.io.experiment import ExperimentLog, Signal
from pipelines.io.units import to_si

__all__ = ["conform", "refuse_bad_urdf", "refuse_unlike_format"]


def conform(log: ExperimentLog, *, assume_units: bool = False) -> tuple[ExperimentLog, tuple[Check, ...]]:
    """`log` in SI and in the format's orientation, with a check for everything that had to be changed for it.

    Raises:
        InputRejected: the log is not what the format says and cannot be read in one way only (S01, S02, S04, S05,
            S11, S19, S20).
    """
    _required_signals(log)
    checks: list[Check] = []
    signals: dict[str, Signal] = {}
    law = log.controller.law if log.controller else None
    for name, signal in log.signals.items():
        turned = _orient(log, name, signal, checks)
        signals[name] = _in_si(log, name, turned, law, assume_units, checks)
    done = replace(log, signals=signals) if any(signals[name] is not log.signals[name] for name in signals) else log
    refuse_unlike_format(done)
    return done, tuple(checks)


def refuse_bad_urdf(log: ExperimentLog, path: object) -> None:
    """S17, X13: the URDF inside a description is looked at here, where the file is known, not where it is first used."""
    if "urdf_text" not in log.robot_text or log.robot.urdf_text is None:
        return
    from pipelines.io.urdf import chain_from_urdf

    try:
        chain_from_urdf(log.robot.urdf_text, log.robot.tip_link)
    except InputRejected as problem:
        problem.where = clean(f"{path}, /robot, {problem.where}")
        raise


def refuse_unlike_format(log: ExperimentLog) -> None:
    """Raise InputRejected unless `log` is exactly what `log-format.md` says: what a writer may put on disk."""
    refuse_wrong_kinds(log)
    _required_signals(log)
    _units(log)
    n, where, samples = log.n_joints, log.source or log.name, log.signals["t"].values.shape
    if len(samples) != 1:
        raise InputRejected("S20", f"t has shape {samples}, not (samples,)", where=where, remedy="store t as a vector")
    for name, signal in log.signals.items():
        shape = samples if name == "t" else (samples[0], n)
        if signal.values.shape != shape:
            _wrong_shape(name, signal.values.shape, samples[0], n, where)
    if (log.joint is not None) != (log.experiment in schema.ONE_JOINT):
        says = "needs" if log.joint is None else "does not have"
        raise InputRejected("S20", f"a {log.experiment} log {says} the attribute joint", where=where,
                            remedy=f"joint belongs to the experiments {', '.join(schema.ONE_JOINT)}")
    if log.joint is not None and not 1 <= log.joint <= n:
        raise InputRejected("S20", f"joint is {log.joint}, outside 1 … {n}", where=where, remedy="joints count from 1")
    if log.posture is not None and log.posture.shape != (n,):
        raise InputRejected("S20", f"posture has {log.posture.size} values for {n} joints", where=where,
                            remedy="give one angle a joint")
    _controller_shapes(log, n, where)


def _controller_shapes(log: ExperimentLog, n: int, where: str) -> None:
    if log.controller is None:
        return
    shapes = dict.fromkeys(("kp", "kd", "ki", "output_limit", "torque_resolution"), (n,)) | {"observer_gain": (n, 3)}
    for key, shape in shapes.items():
        value = getattr(log.controller, key)
        if value is not None and value.shape != shape:
            raise InputRejected("S20", f"controller: {key} has shape {value.shape}, not {shape}", where=where,
                                remedy="give one value a joint")
    if log.controller.law in ("pd", "pd+feedforward",
                              "computed-torque") and (log.controller.kp is None or log.controller.kd is None):
        raise InputRejected("S20", f"controller: law {log.controller.law} without kp and kd", where=where,
                            remedy="write the gains, or law 'unknown'")


def _units(log: ExperimentLog) -> None:
    law = log.controller.law if log.controller else None
    for name, signal in log.signals.items():
        if signal.units != (wanted := schema.unit_of(name, law)):
            raise InputRejected("S05", f"units are '{signal.units}', the format wants '{wanted}'",
                                where=f"{log.source or log.name}, signal {name}", remedy="convert the samples to SI")


def _required_signals(log: ExperimentLog) -> None:
    where = log.source or log.name
    known = schema.SIGNALS | (schema.DERIVED if log.derived is not None else {})
    required = ("t", "q_ref") if log.origin == "planned" else ("t", "q", "tau")
    missing = [name for name in required if name not in log.signals]
    if missing:
        hints = "".join(did_you_mean(name, set(log.signals) - set(known)) for name in missing)
        raise InputRejected("S01",
                            f"signal {', '.join(missing)} missing{hints}; there are {', '.join(sorted(log.signals)) or 'none'}",
                            where=where, remedy="rename it, or import the recording with --map")
    if log.origin == "planned" and (measured := [name for name in ("q", "tau") if name in log.signals]):
        raise InputRejected("S20", f"a planned log has references only, but there is {', '.join(measured)}", where=where,
                            remedy="remove them, or say where they come from: origin 'measured' or 'simulated'")
    for name in log.signals:
        if name not in known:
            more = " without a /derived group" if name in schema.DERIVED else did_you_mean(name, known)
            raise InputRejected("S19", f"signal '{name}' is not in format version {schema.FORMAT_VERSION}{more}", where=where,
                                remedy="rename or remove it")


def _orient(log: ExperimentLog, name: str, signal: Signal, checks: list[Check]) -> Signal:
    """S11: an array stored as (joints, samples) is turned where only one reading is possible."""
    values, n, samples = signal.values, log.n_joints, log.signals["t"].values.size
    where = f"{log.source or log.name}, signal {name}"
    if name == "t" and values.ndim == 2 and 1 in values.shape:
        checks.append(Check.of("S11", "warn", f"t was stored as {values.shape}, read as a vector", where=where,
                               remedy="store t as a vector"))
        return replace(signal, values=values.reshape(-1))
    if name != "t" and values.ndim == 1 and n == 1 and values.shape == (samples,):
        return replace(signal, values=values[:, None])
    if name != "t" and values.shape == (n, samples) and n != samples:
        checks.append(Check.of("S11", "warn", f"stored as {values.shape}, read as {(samples, n)}", where=where,
                               remedy="store (samples, joints)"))
        return replace(signal, values=np.ascontiguousarray(values.T))
    return signal


def _in_si(log: ExperimentLog, name: str, signal: Signal, law: str | None, assume: bool, checks: list[Check]) -> Signal:
    """S04-S06: declared units are converted to the format's, undeclared ones refused unless the user vouches for them."""
    where, wanted = f"{log.source or log.name}, signal {name}", schema.unit_of(name, law)
    if not signal.units.strip():
        if not assume:
            raise InputRejected("S04", f"no units; {wanted} is what the format wants", where=where,
                                remedy="declare them, or pass --assume-units if they are SI")
        checks.append(Check.of("S04", "warn", f"no units; taken as {wanted}, as --assume-units says", where=where,
                               remedy="write the attribute units"))
        return replace(signal, units=wanted)
    if signal.units == wanted:
        return signal
    quantity = (schema.SIGNALS | schema.DERIVED)[name][0]
    if quantity == "excitation":
        quantity = "torque" if wanted == "N m" else "acceleration"
    unit = to_si(signal.units, quantity, where=where)
    if not unit.is_si:
        checks.append(Check.of("S06", "warn", f"declared in {signal.units}, converted to {wanted}", where=where,
                               remedy="store SI units, if results should not list the conversion"))
    return replace(signal, values=unit.factor * signal.values + unit.offset, units=wanted)


def _wrong_shape(name: str, shape: tuple[int, ...], samples: int, n: int, where: str) -> None:
    place = f"{where}, signal {name}"
    if len(shape) == 2 and shape[0] == samples:
        raise InputRejected("S02", f"{shape[1]} columns for a robot of {n} joints", where=place,
                            remedy="give the description of this robot, or choose the columns with --joints")
    raise InputRejected("S11", f"shape {shape}, neither ({samples}, {n}) nor ({n}, {samples})", where=place,
                        remedy="store (samples, joints)")
