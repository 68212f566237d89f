"""Turn recorded numbers into SI on the joint side: unwrap, scale, unit, torque constant, transmission, offset.

With q_motor = N q_joint and tau_joint = Nᵀ tau_motor, the power q̇ᵀ tau is the same on both sides, sample by sample.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.errors import Check, Gathering, InputRejected, UsageError
from pipelines.log import schema
from pipelines.log.doctor.checks_motion import degrees_or_motor
from pipelines.log.doctor.checks_subject import many
from pipelines.log.experiment import Array, Signal
from pipelines.log.recording.evidence import quarter_turns
from pipelines.log.recording.raw import RawTable
from pipelines.log.recording.recipe import DriveSpec, Numbers, Recipe, SignalSpec
from pipelines.log.recording.repair import Recording
from pipelines.log.robot import Drive, RobotDescription
from pipelines.log.units import UNITS, canonical_unit, to_si

__all__ = ["Converted", "drive_of", "joint_side", "si_of", "unit_declared", "units_of_joints"]

_LINEAR = frozenset(
    {"m", "cm", "mm", "um", "m/s", "cm/s", "mm/s", "m/s^2", "mm/s^2", "N", "mN", "kN"}
)
_MOTION = ("position", "velocity", "acceleration")


@dataclass(frozen=True, eq=False)
class Converted:
    """Signals in SI and what was done to them, in words."""

    signals: Mapping[str, Signal]
    steps: tuple[str, ...]
    altered: tuple[str, ...]  # what goes beyond units and transmission
    checks: tuple[Check, ...]


def drive_of(spec: DriveSpec, robot: RobotDescription, where: object) -> Drive | None:
    """The drive of the recipe, or of the robot where the recipe says nothing.

    Raises:
        UsageError: C02, it does not fit the number of joints, or cannot be inverted.
    """
    n = robot.n_joints
    own = robot.drive or Drive()
    matrix, constants = own.transmission, own.torque_constant
    if spec.transmission is not None:
        rows = spec.transmission
        if len(rows) != n or any(isinstance(row, tuple) and len(row) != n for row in rows):
            message = f"drive.transmission must hold {n} gear ratios, or {n} rows of {n} numbers"
            remedy = (
                "write the gear ratio of each joint, or the whole matrix N of q_motor = N q_joint"
            )
            raise UsageError("C02", message, where=where, remedy=remedy)
        matrix = tuple(
            row
            if isinstance(row, tuple)
            else tuple(float(row) if i == j else 0.0 for j in range(n))
            for i, row in enumerate(rows)
        )
        if abs(np.linalg.det(np.array(matrix))) < 1e-12:
            message = "drive.transmission cannot be inverted"
            raise UsageError("C02", message, where=where, remedy="each joint needs a motor")
    if spec.torque_constant is not None:
        constants = tuple(
            _per_joint(spec.torque_constant, n, "drive.torque_constant", where).tolist()
        )
    return None if matrix is None and constants is None else Drive(matrix, constants)


def _per_joint(value: Numbers, n: int, what: str, where: object) -> Array:
    if isinstance(value, tuple) and len(value) != n:
        message = f"{what} holds {len(value)} numbers, the robot has {n} joints"
        raise UsageError("C02", message, where=where, remedy="one number, or one a joint")
    return np.broadcast_to(np.asarray(value, dtype=np.float64), (n,)).copy()


def unit_declared(
    name: str,
    spec: SignalSpec,
    table: RawTable,
    columns: tuple[str, ...],
    robot: RobotDescription,
    assume: bool,
    checks: list[Check],
) -> tuple[str, ...]:
    """Return the unit of each joint: the recipe's, else the header's. S04 where neither says, S05 where both differ."""
    where = f"{table.source}, signal {name}"
    headers = [table.units.get(column) for column in columns]
    if spec.unit is not None:
        units = units_of_joints(name, spec, robot, where, checks)
        for header, unit in zip(headers, units, strict=True):
            known = (None if header is None else _known(header), _known(unit))
            if None not in known and known[0] != known[1]:
                message = f"the header says '{header}', the recipe says '{unit}'"
                raise InputRejected("S05", message, where=where, remedy="correct one of them")
        return units
    given = [header for header in headers if header is not None]
    if given and (len(set(given)) == 1 or len(given) == len(columns)):
        words = ", ".join(dict.fromkeys(given))
        checks.append(Check.of("S06", "ok", f"unit '{words}' taken from the header", where=where))
        return tuple(header or given[0] for header in headers)
    wanted = _own_units(name, robot)
    words = f'"{wanted[0]}"' if len(set(wanted)) == 1 else json.dumps(wanted)
    if not assume:
        message = f"no unit; say what the numbers of {name} are in"
        remedy = (
            f"add unit = {words} (or what it is) to signals.{name}, "
            "or pass --assume-units if they are SI"
        )
        raise InputRejected("S04", message, where=where, remedy=remedy)
    taken = ", ".join(dict.fromkeys(wanted))
    message = f"no unit; taken as {taken}, as --assume-units says"
    remedy = "write the unit in the recipe"
    checks.append(Check.of("S04", "warn", message, where=where, remedy=remedy))
    return wanted


def units_of_joints(
    name: str, spec: SignalSpec, robot: RobotDescription, where: object, checks: list[Check]
) -> tuple[str, ...]:
    """Return the unit of each joint that the recipe declares.

    One SI unit for an arm of turning and sliding joints is SI for each of them, as in a log: "rad" is m where a joint slides.

    Raises:
        UsageError: C02, there are more or fewer units than joints.
    """
    n = robot.n_joints
    if isinstance(spec.unit, tuple):
        if len(spec.unit) != n:
            message = f"signals.{name}.unit holds {len(spec.unit)} units, the robot has {n} joints"
            raise UsageError("C02", message, where=where, remedy="one unit, or one a joint")
        return spec.unit
    unit = canonical_unit(spec.unit or "")
    own = _own_units(name, robot)
    if spec.side == "motor" or len(set(own)) == 1 or unit != schema.unit_of(name):
        return (spec.unit or "",) * n
    other = ", ".join(
        f"{own[j]} for joint {j + 1} '{robot.joints[j].name}'" for j in range(n) if own[j] != unit
    )
    message = f"'{unit}' declared for turning and sliding joints: taken as SI, {other}"
    remedy = f"write unit = {json.dumps(own)} in signals.{name}"
    checks.append(Check.of("S05", "warn", message, where=where, remedy=remedy))
    return own


def _own_units(name: str, robot: RobotDescription) -> tuple[str, ...]:
    """Return the SI unit of each joint; that of an injected excitation without a law of control is one of acceleration."""
    if schema.SIGNALS[name][0] == "excitation":
        return (schema.unit_of(name),) * robot.n_joints
    return tuple(schema.joint_unit(name, revolute) for revolute in robot.revolute)


def si_of(units: Sequence[str], spec: SignalSpec) -> float:
    """What one recorded number is in SI, on its side of the drive, at most: enough to tell what is absurd."""
    scale = float(np.max(np.abs(spec.scale)))
    if any(unit in ("counts", "counts/s") for unit in units) and spec.counts_per_rev is not None:
        return scale * 2.0 * math.pi / float(np.min(spec.counts_per_rev))
    return scale * max(UNITS[unit].factor if unit in UNITS else 1.0 for unit in units)


def _known(unit: str) -> object:
    return UNITS.get(canonical_unit(unit))


def joint_side(
    part: Recording,
    recipe: Recipe,
    units: Mapping[str, tuple[str, ...]],
    robot: RobotDescription,
    drive: Drive | None,
    trust_units: bool = False,
) -> Converted:
    """All signals of a part in SI, joint side.

    Raises:
        InputRejected: S05 unit of another quantity, S07 degrees declared as radians, S10 current without constant.
    """
    steps: list[str] = []
    altered: list[str] = []
    checks: list[Check] = []
    signals: dict[str, Signal] = {}
    problems = Gathering()
    for name, raw in part.signals.items():
        with problems.part():
            signals |= _converted(
                part, name, raw, recipe, units[name], robot, drive, steps, altered, checks
            )
    problems.raise_all()
    if not trust_units and "q" in signals:
        _refuse_degrees(part, signals["q"].values, units["q"], robot)
    turns = (
        quarter_turns(part.signals["q"])
        if "q" in part.signals and set(units["q"]) <= {"deg", "°"}
        else {}
    )
    if turns:
        starts = ", ".join(map(str, turns.values()))
        checks.append(
            Check.of(
                "S07",
                "warn",
                f"declared in degrees, but the numbers start at {starts} times "
                "pi/2, digit by digit: radians of the motor side?",
                where=f"{part.where}, signal q",
                remedy='if so, declare unit = "rad" and add [drive] transmission = the gear ratios',
            )
        )
    return Converted(signals, tuple(steps), tuple(altered), tuple(checks))


def _converted(
    part: Recording,
    name: str,
    raw: Array,
    recipe: Recipe,
    units: tuple[str, ...],
    robot: RobotDescription,
    drive: Drive | None,
    steps: list[str],
    altered: list[str],
    checks: list[Check],
) -> dict[str, Signal]:
    """One signal in SI on the joint side; and the current, where the torque was recorded as such."""
    n = robot.n_joints
    found: dict[str, Signal] = {}
    spec = recipe.signals[name]
    values = _unwrapped(part, name, raw, spec, units, altered, checks)
    values = values * _per_joint(spec.scale, n, f"signals.{name}.scale", recipe.where)
    values = values * _per_joint(spec.sign, n, f"signals.{name}.sign", recipe.where)
    values, current = _in_si(part, name, values, spec, units, drive, n, recipe, steps)
    if current is not None and "current" not in recipe.signals:
        found["current"] = Signal(current, "A", schema.SIGNALS["current"][1])
    values = _through_drive(name, values, spec, recipe, drive, steps)
    _refuse_wrong_kind(part, name, units, spec, recipe, robot)
    offset = _per_joint(spec.offset, n, f"signals.{name}.offset", recipe.where)
    if offset.any():
        steps.append(f"{name}: offset {', '.join(f'{x:.6g}' for x in offset)} added")
    law = recipe.controller.law if recipe.controller else None
    found[name] = Signal(values + offset, schema.unit_of(name, law), schema.SIGNALS[name][1])
    return found


def _unwrapped(
    part: Recording,
    name: str,
    raw: Array,
    spec: SignalSpec,
    units: tuple[str, ...],
    altered: list[str],
    checks: list[Check],
) -> Array:
    """D07: a counter that starts again is followed through; a jump of more than half its range is a rollover.

    Where the recipe names no range, jumps of a whole turn amid small steps are unwrapped all the same.
    """
    wrap = (
        spec.wrap
        if spec.wrap is not None
        else _whole_turn(name, raw, spec, units[0])
        if len(set(units)) == 1
        else None
    )
    if wrap is None:
        return raw
    turns = np.round(np.diff(raw, axis=0) / wrap)
    if not turns.any():
        return raw
    for joint in np.flatnonzero(turns.any(axis=0)):
        count = int(np.abs(turns[:, joint]).sum())
        at = part.listed(np.flatnonzero(turns[:, joint]) + 1)
        checks.append(
            Check.of(
                "D07",
                "warn",
                f"{many(count, 'rollover')} of {wrap:g} unwrapped ({at})",
                where=part.column(name, int(joint)),
                remedy="let the recorder count turns",
            )
        )
        altered.append(
            f"{name} of joint {joint + 1}: {many(count, 'rollover')} of {wrap:g} unwrapped"
        )
    return raw - wrap * np.concatenate([np.zeros((1, raw.shape[1])), np.cumsum(turns, axis=0)])


def _whole_turn(name: str, raw: Array, spec: SignalSpec, unit: str) -> float | None:
    """One turn in the recorded unit, where every large step of a position is just that; None where there is no such step."""
    if schema.SIGNALS[name][0] != "position":
        return None
    one = {
        "deg": 360.0,
        "°": 360.0,
        "rad": 2.0 * math.pi,
        "mrad": 2000.0 * math.pi,
        "rev": 1.0,
        "turn": 1.0,
    }.get(unit)
    if unit == "counts" and isinstance(spec.counts_per_rev, int | float):
        one = float(spec.counts_per_rev)
    steps = np.abs(np.diff(raw, axis=0))
    if one is None or not (large := steps > 0.5 * one).any() or large.all():
        return None
    return (
        one
        if np.abs(steps[large] - one).max() < 0.1 * one and steps[~large].max() < 0.1 * one
        else None
    )


def _in_si(
    part: Recording,
    name: str,
    values: Array,
    spec: SignalSpec,
    units: tuple[str, ...],
    drive: Drive | None,
    n: int,
    recipe: Recipe,
    steps: list[str],
) -> tuple[Array, Array | None]:
    """SI values still on their side of the drive; and the current, where torque was recorded as current."""
    where = f"{part.where}, signal {name}"
    quantity = schema.SIGNALS[name][0]
    if quantity == "excitation":
        quantity = _excitation(name, units, recipe, where)
    found, current = np.empty_like(values), None
    for unit in dict.fromkeys(units):
        at = np.flatnonzero([other == unit for other in units])
        if unit in ("counts", "counts/s") and quantity in ("position", "velocity"):
            if spec.counts_per_rev is None:
                message = "counts without counts_per_rev"
                remedy = f"add counts_per_rev to signals.{name}"
                raise InputRejected("S05", message, where=where, remedy=remedy)
            steps.append(
                f"{name}: {unit} at {spec.counts_per_rev} counts a revolution to {schema.unit_of(name)}"
            )
            turn = _per_joint(
                spec.counts_per_rev, n, f"signals.{name}.counts_per_rev", recipe.where
            )
            found[:, at] = values[:, at] * (2.0 * math.pi / turn[at])
            continue
        known = UNITS.get(unit)
        if quantity == "torque" and known is not None and known.quantity == "current":
            constants = drive.torque_constant if drive else None
            if constants is None:
                message = f"{name} is recorded in {unit}, motor current instead of torque"
                remedy = "add [drive] torque_constant = … [N m/A]"
                raise InputRejected("S10", message, where=where, remedy=remedy)
            steps.append(f"{name}: {unit} times {', '.join(f'{constants[j]:g}' for j in at)} N m/A")
            found[:, at] = known.factor * values[:, at] * np.array(constants)[at]
            current = known.factor * values if name == "tau" and at.size == n else None
            continue
        to = to_si(unit, quantity, where=where)
        if not to.is_si:
            steps.append(f"{name}: {unit} to {schema.unit_of(name)}")
        found[:, at] = to.factor * values[:, at] + to.offset
    return found, current


def _excitation(name: str, units: tuple[str, ...], recipe: Recipe, where: str) -> str:
    """Return the quantity of an injected excitation, which the controller's law decides: torque or acceleration.

    Raises:
        InputRejected: S05, its unit is of the other.
    """
    law = recipe.controller.law if recipe.controller else None
    quantity = "torque" if law in ("pd", "pd+feedforward") else "acceleration"
    known = UNITS.get(canonical_unit(units[0]))
    if quantity == "acceleration" and known is not None and known.quantity == "torque":
        said = (
            f'under [controller] law = "{law}" it is an acceleration'
            if law
            else "the recipe has no [controller]"
        )
        message = f"'{units[0]}' is a unit of torque, and {said}"
        remedy = (
            f'where {name} was added to the torque of a PD controller, add [controller] law = "pd" with '
            "its gains kp = [ … ] and kd = [ … ]"
        )
        raise InputRejected("S05", message, where=where, remedy=remedy)
    return quantity


def _motor_side(name: str, spec: SignalSpec, recipe: Recipe) -> bool:
    moved = schema.SIGNALS[name][0] in (*_MOTION, "torque")
    return (
        moved
        and (spec.side or ("motor" if recipe.drive.transmission is not None else "joint"))
        == "motor"
    )


def _through_drive(
    name: str,
    values: Array,
    spec: SignalSpec,
    recipe: Recipe,
    drive: Drive | None,
    steps: list[str],
) -> Array:
    """q_joint = N⁻¹ q_motor, tau_joint = Nᵀ tau_motor."""
    if not _motor_side(name, spec, recipe):
        return values
    if drive is None or drive.transmission is None:
        message = f"'signals.{name}' is on the motor side, but there is no drive.transmission"
        remedy = "add [drive] transmission = the gear ratios"
        raise UsageError("C02", message, where=recipe.where, remedy=remedy)
    matrix = np.array(drive.transmission)
    if schema.SIGNALS[name][0] in _MOTION:
        steps.append(f"{name}: motor to joint side by the inverse of the transmission")
        return np.asarray(np.linalg.solve(matrix, values.T).T, dtype=np.float64)
    steps.append(f"{name}: motor to joint side by the transposed transmission")
    return np.asarray(values @ matrix, dtype=np.float64)


def _refuse_wrong_kind(
    part: Recording,
    name: str,
    units: tuple[str, ...],
    spec: SignalSpec,
    recipe: Recipe,
    robot: RobotDescription,
) -> None:
    """S05: an angle for a joint that slides, a length for one that turns."""
    quantity = schema.SIGNALS[name][0]
    if quantity not in (*_MOTION, "torque") or _motor_side(name, spec, recipe):
        return
    for j, (unit, revolute) in enumerate(zip(units, robot.revolute, strict=True)):
        current = unit in UNITS and UNITS[unit].quantity == "current"
        if not current and revolute == (unit in _LINEAR):
            own = _own_units(name, robot)
            wanted = (
                f"such as {own[j]}"
                if len(set(own)) == 1
                else f"one a joint: unit = {json.dumps(own)}"
            )
            message = f"'{unit}' for joint {j + 1} '{robot.joints[j].name}', which is {robot.joints[j].type}"
            remedy = f"declare its unit, {wanted}"
            raise InputRejected("S05", message, where=part.column(name, j), remedy=remedy)


def _refuse_degrees(
    part: Recording, q: Array, units: tuple[str, ...], robot: RobotDescription
) -> None:
    """S07: declared radians that leave the joint's range by far: degrees, or the motor's. Only a person can tell which."""
    for j, joint in enumerate(robot.joints):
        if units[j] not in ("rad", "m"):
            continue
        low, high = joint.position
        span = float(np.ptp(q[:, j]))
        if not joint.revolute and span > 2.0 * (high - low):
            message = f"moves over {span:.4g} declared m, its limits are {low:.4g} to {high:.4g} m: looks like mm"
            remedy = 'declare unit = "mm" for this joint, one unit a joint'
            raise InputRejected("S07", message, where=part.column("q", j), remedy=remedy)
        if (
            not joint.revolute
            or not (math.isfinite(low) and math.isfinite(high))
            or span <= 4.0 * math.pi
        ):
            continue
        slack = 0.05 * (high - low)
        as_degrees = np.deg2rad(q[:, j])
        degrees = bool(as_degrees.min() >= low - slack and as_degrees.max() <= high + slack)
        if degrees or span > 2.0 * (high - low):
            turns = quarter_turns(q)
            starts = ", ".join(map(str, turns.values()))
            motor = (
                f"; it starts at {starts} times pi/2, as motors of such gear ratios do at rest"
                if turns
                else ""
            )
            what = (
                "looks like degrees or the motor side" if degrees else "looks like the motor side"
            )
            raise InputRejected(
                "S07",
                f"moves over {span:.4g} declared rad, its limits are {low:.4g} to {high:.4g} rad: "
                f"{what}{motor}",
                where=part.column("q", j),
                remedy=degrees_or_motor(span, (low, high)),
            )
