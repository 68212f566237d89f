"""Convert recorded numbers into SI on the joint side.

unwrap -> scale, sign -> unit -> torque constant -> transmission -> offset. With q_motor = N q_joint
and tau_joint = Nᵀ tau_motor, the power q̇ᵀ tau is the same on both sides, sample by sample.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pipelines.errors import Check, Gathering, InputRejected, UsageError
from pipelines.importers.config import RECIPE
from pipelines.importers.names import MOTION, quantity_of
from pipelines.importers.raw import RawTable
from pipelines.importers.recipe import DriveSpec, Numbers, Recipe, SignalSpec
from pipelines.importers.repair import Recording
from pipelines.io import schema
from pipelines.io.log import Array, Signal
from pipelines.io.robot import Drive, RobotDescription
from pipelines.io.units import UNITS, canonical_unit, to_si
from pipelines.quality.subject import many

_LINEAR = frozenset({"m", "cm", "mm", "um", "m/s", "cm/s", "mm/s", "m/s^2", "mm/s^2", "N", "mN",
                     "kN"})  # fmt: skip


@dataclass(frozen=True, eq=False)
class Converted:
    """Signals in SI and what was done to them, in words."""

    steps: list[str] = field(default_factory=list)  # units, signs, transmission
    altered: list[str] = field(default_factory=list)  # more than that: what makes a derived log
    signals: dict[str, Signal] = field(default_factory=dict)
    checks: list[Check] = field(default_factory=list)


def drive_of(spec: DriveSpec, robot: RobotDescription, where: object) -> Drive | None:
    """Return the drive of the recipe, or of the robot where the recipe says nothing.

    Raises:
        UsageError: C02, it does not fit the number of joints, or cannot be inverted.
    """
    n, rows = robot.n_joints, spec.transmission
    own = robot.drive or Drive()
    matrix, constants = own.transmission, own.torque_constant
    if rows is not None:
        if len(rows) != n or any(isinstance(row, tuple) and len(row) != n for row in rows):
            message = f"drive.transmission must hold {n} gear ratios, or {n} rows of {n} numbers"
            remedy = "write the gear ratio of each joint, or the matrix N of q_motor = N q_joint"
            raise UsageError("C02", message, where, remedy)
        pairs = zip(rows, np.eye(n), strict=True)
        square = np.array([row if isinstance(row, tuple) else row * e for row, e in pairs])
        if abs(np.linalg.det(square)) < RECIPE.singular:
            message, remedy = "drive.transmission cannot be inverted", "each joint needs a motor"
            raise UsageError("C02", message, where, remedy)
        matrix = tuple(map(tuple, square.tolist()))
    if spec.torque_constant is not None:
        each = _per_joint(spec.torque_constant, n, "drive.torque_constant", where)
        constants = tuple(each.tolist())
    return None if matrix is None and constants is None else Drive(matrix, constants)


def _per_joint(value: Numbers, n: int, what: str, where: object) -> Array:
    """Return a number of each joint; C02 where there are more or fewer."""
    if isinstance(value, tuple) and len(value) != n:
        message = f"{what} holds {len(value)} numbers, the robot has {n} joints"
        raise UsageError("C02", message, where, "one number, or one a joint")
    return np.broadcast_to(np.asarray(value, dtype=np.float64), (n,)).copy()


def own_units(name: str, robot: RobotDescription) -> tuple[str, ...]:
    """Return the SI unit of each joint; of an excitation without a law, that of acceleration."""
    if schema.SIGNALS[name][0] == "excitation":
        return (schema.unit_of(name),) * robot.n_joints
    return tuple(schema.joint_unit(name, revolute) for revolute in robot.revolute)


def units_of(
    name: str,
    spec: SignalSpec,
    robot: RobotDescription,
    table: RawTable,
    columns: tuple[str, ...],
    assume: bool,
) -> tuple[tuple[str, ...], list[Check]]:
    """Return the unit of each joint: the recipe's, else the header's.

    Raises:
        InputRejected: S04, neither says it. S05, both differ. UsageError: C02, not one a joint.
    """
    where, n = f"{table.source}, signal {name}", robot.n_joints
    headers, own = [table.units.get(column) for column in columns], own_units(name, robot)
    given = [header for header in headers if header is not None]
    if spec.unit is not None:
        units, checks = declared_units(name, spec, robot, where)
        for header, unit in zip(headers, units, strict=True):
            known = UNITS.get(canonical_unit(header or "")), UNITS.get(canonical_unit(unit))
            if None not in known and known[0] != known[1]:
                message = f"the header says '{header}', the recipe says '{unit}'"
                raise InputRejected("S05", message, where, "correct one of them")
        return units, checks
    if given and len({*given}) in (1, n):
        message = f"unit '{', '.join(dict.fromkeys(given))}' taken from the header"
        units = tuple(header or given[0] for header in headers)
        return units, [Check.of("S06", "ok", message, where)]
    if not assume:
        words = f'"{own[0]}"' if len({*own}) == 1 else json.dumps(own)
        message = f"no unit; say what the numbers of {name} are in"
        remedy = f"add unit = {words} (or what it is) to signals.{name}"
        remedy += ", or pass --assume-units if they are SI"
        raise InputRejected("S04", message, where, remedy)
    message = f"no unit; taken as {', '.join(dict.fromkeys(own))}, as --assume-units says"
    return own, [Check.of("S04", "warn", message, where, "write the unit in the recipe")]


def declared_units(
    name: str, spec: SignalSpec, robot: RobotDescription, where: object
) -> tuple[tuple[str, ...], list[Check]]:
    """Return the unit of each joint that the recipe declares.

    One SI unit for an arm of turning and sliding joints is SI for each of them, as in a log: "rad"
    is m where a joint slides.
    """
    unit, own, n = spec.unit or "", own_units(name, robot), robot.n_joints
    if isinstance(unit, tuple):
        if len(unit) != n:
            message = f"signals.{name}.unit holds {len(unit)} units, the robot has {n} joints"
            raise UsageError("C02", message, where, "one unit, or one a joint")
        return unit, []
    unit_si = canonical_unit(unit) == schema.unit_of(name) and spec.side != "motor"
    if not unit_si or len({*own}) == 1:
        return (unit,) * n, []
    joints = zip(own, robot.joints, strict=True)
    said = [f"{x} for joint {j} '{joint.name}'" for j, (x, joint) in enumerate(joints, 1)
            if x != canonical_unit(unit)]  # fmt: skip
    message = f"'{unit}' declared for turning and sliding joints: taken as SI, {', '.join(said)}"
    remedy = f"write unit = {json.dumps(own)} in signals.{name}"
    return own, [Check.of("S05", "warn", message, where, remedy)]


def si_of(units: Sequence[str], spec: SignalSpec) -> float:
    """Return what one recorded number is in SI, on its side of the drive, at most."""
    scale = float(np.max(np.abs(spec.scale)))
    if set(units) & {"counts", "counts/s"} and spec.counts_per_rev is not None:
        return scale * 2.0 * math.pi / float(np.min(spec.counts_per_rev))
    return scale * max(UNITS[unit].factor if unit in UNITS else 1.0 for unit in units)


def joint_side(
    part: Recording,
    recipe: Recipe,
    units: Mapping[str, tuple[str, ...]],
    robot: RobotDescription,
    drive: Drive | None,
    trust_units: bool = False,
) -> Converted:
    """Return all signals of a part in SI, joint side.

    Raises:
        InputRejected: S05 unit of another quantity, S07 mm declared as m, S10 current without
            constant.
    """
    done, problems = Converted(), Gathering()
    n, where, law = (
        robot.n_joints,
        recipe.where,
        recipe.controller.law if recipe.controller else None,
    )
    for name, raw in part.signals.items():
        with problems.part():
            spec, each = recipe.signals[name], units[name]
            offset = _per_joint(spec.offset, n, f"signals.{name}.offset", where)
            factor = _per_joint(spec.scale, n, f"signals.{name}.scale", where)
            factor *= _per_joint(spec.sign, n, f"signals.{name}.sign", where)
            values = _unwrapped(part, name, raw, spec, each, done) * factor
            values = _in_si(part, name, values, recipe, each, drive, done)
            if schema.SIGNALS[name][0] in (*MOTION, "torque"):
                default = "joint" if recipe.drive.transmission is None else "motor"
                if (spec.side or default) == "motor":
                    values = _through_drive(name, values, drive, where, done)
                else:
                    _refuse_wrong_kind(part, name, each, robot)
            if offset.any():
                done.steps.append(f"{name}: offset {', '.join(f'{x:.6g}' for x in offset)} added")
            signal = Signal(values + offset, schema.unit_of(name, law), schema.SIGNALS[name][1])
            done.signals[name] = signal
    problems.raise_all()
    for j, joint in enumerate(() if trust_units or "q" not in done.signals else robot.joints):
        low, high = joint.position
        span = float(np.ptp(done.signals["q"].values[:, j]))
        if not joint.revolute and span > RECIPE.beyond * (high - low):
            message = f"moves over {span:.4g} m, its limits are {low:.4g} to {high:.4g} m: looks "
            remedy = 'declare unit = "mm" for this joint, one unit a joint'
            raise InputRejected("S07", f"{message}like mm", part.column("q", j), remedy)
    return done


def _unwrapped(
    part: Recording,
    name: str,
    raw: Array,
    spec: SignalSpec,
    units: tuple[str, ...],
    done: Converted,
) -> Array:
    """D07: follow a counter that starts again; a jump of more than half its range is one.

    Where the recipe names no range, and every large step of a position is a whole turn amid small
    ones, these are unwrapped too.
    """
    wrap, steps = spec.wrap, np.diff(raw, axis=0)
    if wrap is None and len({*units}) == 1 and schema.SIGNALS[name][0] == "position":
        unit = canonical_unit(units[0])
        turn = math.inf
        if unit in UNITS and unit not in _LINEAR:
            turn = 2.0 * math.pi / UNITS[unit].factor
        elif isinstance(spec.counts_per_rev, int | float):
            turn = float(spec.counts_per_rev)
        large, near = np.abs(steps) > 0.5 * turn, RECIPE.turn_ratio * turn
        if large.any() and not large.all() and np.abs(np.abs(steps[large]) - turn).max() < near:
            wrap = turn if np.abs(steps[~large]).max() < near else None
    turns = np.round(steps / (wrap or math.inf))
    if not turns.any():
        return raw
    for joint in np.flatnonzero(turns.any(axis=0)).tolist():
        count = many(int(np.abs(turns[:, joint]).sum()), "rollover")
        rollovers = f"{count} of {wrap:g} unwrapped"
        message = f"{rollovers} ({part.listed(np.flatnonzero(turns[:, joint]) + 1)})"
        remedy, where = "let the recorder count turns", part.column(name, joint)
        done.checks.append(Check.of("D07", "warn", message, where, remedy))
        done.altered.append(f"{name} of joint {joint + 1}: {rollovers}")
    return raw - (wrap or 0.0) * np.cumsum(np.pad(turns, ((1, 0), (0, 0))), axis=0)


def _in_si(
    part: Recording,
    name: str,
    values: Array,
    recipe: Recipe,
    units: tuple[str, ...],
    drive: Drive | None,
    done: Converted,
) -> Array:
    """Return SI values still on their side of the drive; a torque's current is a signal too."""
    where, spec = f"{part.where}, signal {name}", recipe.signals[name]
    quantity, own = schema.SIGNALS[name][0], schema.unit_of(name)
    if quantity == "excitation":
        quantity = _excitation(name, recipe, units, where)
    si = np.empty_like(values)
    for unit in dict.fromkeys(units):
        at = np.flatnonzero([other == unit for other in units])
        if unit in ("counts", "counts/s") and quantity in ("position", "velocity"):
            if spec.counts_per_rev is None:
                remedy = f"add counts_per_rev to signals.{name}"
                raise InputRejected("S05", "counts without counts_per_rev", where, remedy)
            what = f"signals.{name}.counts_per_rev"
            turn = _per_joint(spec.counts_per_rev, len(units), what, recipe.where)
            rate = f"{spec.counts_per_rev} counts a revolution"
            done.steps.append(f"{name}: {unit} at {rate} to {own}")
            si[:, at] = values[:, at] * (2.0 * math.pi / turn[at])
        elif quantity == "torque" and quantity_of(unit) == "current":
            constants = drive.torque_constant if drive else None
            if constants is None:
                message = f"{name} is recorded in {unit}, motor current instead of torque"
                remedy = "add [drive] torque_constant = … [N m/A]"
                raise InputRejected("S10", message, where, remedy)
            listed = ", ".join(f"{constants[j]:g}" for j in at)
            done.steps.append(f"{name}: {unit} times {listed} N m/A")
            amperes = UNITS[canonical_unit(unit)].factor * values
            si[:, at] = amperes[:, at] * np.array(constants)[at]
            if name == "tau" and at.size == len(units) and "current" not in recipe.signals:
                done.signals["current"] = Signal(amperes, "A", schema.SIGNALS["current"][1])
        else:
            to = to_si(unit, quantity, where=where)
            if not to.is_si:
                done.steps.append(f"{name}: {unit} to {own}")
            si[:, at] = to.factor * values[:, at] + to.offset
    return si


def _excitation(name: str, recipe: Recipe, units: tuple[str, ...], where: str) -> str:
    """Return the quantity of an excitation by the controller's law: torque or acceleration."""
    law = recipe.controller.law if recipe.controller else None
    if law in ("pd", "pd+feedforward"):
        return "torque"
    if quantity_of(units[0]) != "torque":
        return "acceleration"
    said = f'under [controller] law = "{law}" it is an acceleration'
    message = f"'{units[0]}' is a unit of torque, and "
    message += said if law else "the recipe has no [controller]"
    add = 'add [controller] law = "pd" with its gains kp = [ … ] and kd = [ … ]'
    remedy = f"where {name} was added to the torque of a PD controller, {add}"
    raise InputRejected("S05", message, where, remedy)


def _through_drive(
    name: str, values: Array, drive: Drive | None, where: str, done: Converted
) -> Array:
    """q_joint = N⁻¹ q_motor, tau_joint = Nᵀ tau_motor."""
    if drive is None or drive.transmission is None:
        message = f"'signals.{name}' is on the motor side, but there is no drive.transmission"
        raise UsageError("C02", message, where, "add [drive] transmission = the gear ratios")
    matrix = np.array(drive.transmission)
    to_joint = f"{name}: motor to joint side by the"
    if schema.SIGNALS[name][0] in MOTION:
        done.steps.append(f"{to_joint} inverse of the transmission")
        return np.asarray(np.linalg.solve(matrix, values.T).T, dtype=np.float64)
    done.steps.append(f"{to_joint} transposed transmission")
    return np.asarray(values @ matrix, dtype=np.float64)


def _refuse_wrong_kind(
    part: Recording, name: str, units: tuple[str, ...], robot: RobotDescription
) -> None:
    """S05: an angle for a joint that slides, a length for one that turns."""
    own = own_units(name, robot)
    for j, (unit, joint) in enumerate(zip(units, robot.joints, strict=True)):
        if quantity_of(unit) != "current" and joint.revolute == (unit in _LINEAR):
            message = f"'{unit}' for joint {j + 1} '{joint.name}', which is {joint.type}"
            remedy = f"declare its unit, one a joint: unit = {json.dumps(own)}"
            raise InputRejected("S05", message, part.column(name, j), remedy)
