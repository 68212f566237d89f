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
from pipelines.importers.evidence import quarter_turns
from pipelines.importers.raw import RawTable
from pipelines.importers.recipe import DriveSpec, Numbers, Recipe, SignalSpec
from pipelines.importers.repair import Recording
from pipelines.io import schema
from pipelines.io.experiment import Array, Signal
from pipelines.io.robot import Drive, RobotDescription
from pipelines.io.units import UNITS, canonical_unit, to_si
from pipelines.quality.subject import many
from pipelines.quality.units import degrees_or_motor

__all__ = ["Converted", "drive_of", "joint_side", "per_joint", "si_of", "unit_declared",
           "units_of_joints"]  # fmt: skip

_LINEAR = frozenset({"m", "cm", "mm", "um", "m/s", "cm/s", "mm/s", "m/s^2", "mm/s^2", "N", "mN",
                     "kN"})  # fmt: skip
_MOTION = ("position", "velocity", "acceleration")
_COUNTS = ("counts", "counts/s")
_TURNS = {"deg": 360.0, "°": 360.0, "rad": 2.0 * math.pi, "mrad": 2000.0 * math.pi, "rev": 1.0,
          "turn": 1.0}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Converted:
    """Signals in SI and what was done to them, in words."""

    signals: Mapping[str, Signal]
    steps: tuple[str, ...]
    altered: tuple[str, ...]  # what goes beyond units and transmission
    checks: tuple[Check, ...]


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
            remedy = (
                "write the gear ratio of each joint, or the whole matrix N of q_motor = N q_joint"
            )
            raise UsageError("C02", message, where=where, remedy=remedy)
        square = np.diag([0.0 if isinstance(row, tuple) else float(row) for row in rows])
        for i, row in enumerate(rows):
            square[i] = row if isinstance(row, tuple) else square[i]
        if abs(np.linalg.det(square)) < 1e-12:
            message, remedy = "drive.transmission cannot be inverted", "each joint needs a motor"
            raise UsageError("C02", message, where=where, remedy=remedy)
        matrix = tuple(map(tuple, square.tolist()))
    if spec.torque_constant is not None:
        numbers = per_joint(spec.torque_constant, n, "drive.torque_constant", where)
        constants = tuple(numbers.tolist())
    return None if matrix is None and constants is None else Drive(matrix, constants)


def per_joint(value: Numbers, n: int, what: str, where: object) -> Array:
    """Return a number of each joint.

    Raises:
        UsageError: C02, there are more or fewer than joints.
    """
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
    """Return the unit of each joint: the recipe's, else the header's.

    Raises:
        InputRejected: S04, neither says it. S05, both differ.
    """
    where = f"{table.source}, signal {name}"
    headers = [table.units.get(column) for column in columns]
    if spec.unit is not None:
        units = units_of_joints(name, spec, robot, where, checks)
        for header, unit in zip(headers, units, strict=True):
            known = _known(header or ""), _known(unit)
            if None not in known and known[0] != known[1]:
                message = f"the header says '{header}', the recipe says '{unit}'"
                raise InputRejected("S05", message, where=where, remedy="correct one of them")
        return units
    given = [header for header in headers if header is not None]
    if given and (len(set(given)) == 1 or len(given) == len(columns)):
        message = f"unit '{', '.join(dict.fromkeys(given))}' taken from the header"
        checks.append(Check.of("S06", "ok", message, where=where))
        return tuple(header or given[0] for header in headers)
    wanted = _own_units(name, robot)
    if not assume:
        words = f'"{wanted[0]}"' if len(set(wanted)) == 1 else json.dumps(wanted)
        message = f"no unit; say what the numbers of {name} are in"
        key = f"add unit = {words} (or what it is) to signals.{name}"
        remedy = f"{key}, or pass --assume-units if they are SI"
        raise InputRejected("S04", message, where=where, remedy=remedy)
    message = f"no unit; taken as {', '.join(dict.fromkeys(wanted))}, as --assume-units says"
    remedy = "write the unit in the recipe"
    checks.append(Check.of("S04", "warn", message, where=where, remedy=remedy))
    return wanted


def units_of_joints(
    name: str, spec: SignalSpec, robot: RobotDescription, where: object, checks: list[Check]
) -> tuple[str, ...]:
    """Return the unit of each joint that the recipe declares.

    One SI unit for an arm of turning and sliding joints is SI for each of them, as in a log: "rad"
    is m where a joint slides.

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
    joints = enumerate(zip(own, robot.joints, strict=True), start=1)
    other = ", ".join(f"{x} for joint {j} '{joint.name}'" for j, (x, joint) in joints if x != unit)
    message = f"'{unit}' declared for turning and sliding joints: taken as SI, {other}"
    remedy = f"write unit = {json.dumps(own)} in signals.{name}"
    checks.append(Check.of("S05", "warn", message, where=where, remedy=remedy))
    return own


def _own_units(name: str, robot: RobotDescription) -> tuple[str, ...]:
    """Return the SI unit of each joint; of an excitation without a law, that of acceleration."""
    if schema.SIGNALS[name][0] == "excitation":
        return (schema.unit_of(name),) * robot.n_joints
    return tuple(schema.joint_unit(name, revolute) for revolute in robot.revolute)


def si_of(units: Sequence[str], spec: SignalSpec) -> float:
    """Return what one recorded number is in SI, on its side of the drive, at most."""
    scale = float(np.max(np.abs(spec.scale)))
    if set(units) & set(_COUNTS) and spec.counts_per_rev is not None:
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
    """Return all signals of a part in SI, joint side.

    Raises:
        InputRejected: S05 unit of another quantity, S07 degrees declared as radians, S10 current
            without constant.
    """
    converter = _Converter(part, recipe, robot, drive)
    signals: dict[str, Signal] = {}
    problems = Gathering()
    for name, raw in part.signals.items():
        with problems.part():
            signals |= converter.signal(name, raw, units[name])
    problems.raise_all()
    checks = converter.checks
    if not trust_units and "q" in signals:
        _refuse_degrees(part, signals["q"].values, units["q"], robot)
    in_degrees = "q" in part.signals and set(units["q"]) <= {"deg", "°"}
    if turns := quarter_turns(part.signals["q"]) if in_degrees else {}:
        starts = f"the numbers start at {', '.join(map(str, turns.values()))} times pi/2"
        declared = f"declared in degrees, but {starts}, digit by digit"
        message, where = f"{declared}: radians of the motor side?", f"{part.where}, signal q"
        remedy = 'if so, declare unit = "rad" and add [drive] transmission = the gear ratios'
        checks.append(Check.of("S07", "warn", message, where=where, remedy=remedy))
    return Converted(signals, tuple(converter.steps), tuple(converter.altered), tuple(checks))


@dataclass(frozen=True)
class _Converter:
    """The conversion of one part's signals; it notes what it does."""

    part: Recording
    recipe: Recipe
    robot: RobotDescription
    drive: Drive | None
    steps: list[str] = field(default_factory=list)
    altered: list[str] = field(default_factory=list)
    checks: list[Check] = field(default_factory=list)

    def signal(self, name: str, raw: Array, units: tuple[str, ...]) -> dict[str, Signal]:
        """Return a signal in SI on the joint side, and the current of a torque recorded as such."""
        spec, found = self.recipe.signals[name], dict[str, Signal]()
        values = self._unwrapped(name, raw, spec, units)
        values = values * self._numbers(name, "scale") * self._numbers(name, "sign")
        values, current = self._in_si(name, values, spec, units)
        if current is not None and "current" not in self.recipe.signals:
            found["current"] = Signal(current, "A", schema.SIGNALS["current"][1])
        values = self._through_drive(name, values)
        self._refuse_wrong_kind(name, units)
        offset = self._numbers(name, "offset")
        if offset.any():
            self.steps.append(f"{name}: offset {', '.join(f'{x:.6g}' for x in offset)} added")
        law = self.recipe.controller.law if self.recipe.controller else None
        unit = schema.unit_of(name, law)
        return found | {name: Signal(values + offset, unit, schema.SIGNALS[name][1])}

    def _numbers(self, name: str, key: str) -> Array:
        value, n = getattr(self.recipe.signals[name], key), self.robot.n_joints
        return per_joint(value, n, f"signals.{name}.{key}", self.recipe.where)

    def _unwrapped(self, name: str, raw: Array, spec: SignalSpec, units: tuple[str, ...]) -> Array:
        """D07: follow a counter that starts again; a jump of more than half its range is one.

        Where the recipe names no range, jumps of a whole turn amid small steps are unwrapped too.
        """
        wrap = spec.wrap
        if wrap is None and len(set(units)) == 1:
            wrap = _whole_turn(name, raw, spec, units[0])
        if wrap is None:
            return raw
        turns = np.round(np.diff(raw, axis=0) / wrap)
        for joint in np.flatnonzero(turns.any(axis=0)):
            rollovers = (
                f"{many(int(np.abs(turns[:, joint]).sum()), 'rollover')} of {wrap:g} unwrapped"
            )
            at = self.part.listed(np.flatnonzero(turns[:, joint]) + 1)
            message, where = f"{rollovers} ({at})", self.part.column(name, int(joint))
            remedy = "let the recorder count turns"
            self.checks.append(Check.of("D07", "warn", message, where=where, remedy=remedy))
            self.altered.append(f"{name} of joint {joint + 1}: {rollovers}")
        if not turns.any():
            return raw
        zero = np.zeros((1, raw.shape[1]))
        return raw - wrap * np.concatenate([zero, np.cumsum(turns, axis=0)])

    def _in_si(
        self, name: str, values: Array, spec: SignalSpec, units: tuple[str, ...]
    ) -> tuple[Array, Array | None]:
        """Return SI values still on their side of the drive, and the current of a torque."""
        where = f"{self.part.where}, signal {name}"
        quantity = schema.SIGNALS[name][0]
        if quantity == "excitation":
            quantity = self._excitation(name, units, where)
        si, current = np.empty_like(values), None
        own = schema.unit_of(name)
        for unit in dict.fromkeys(units):
            at = np.flatnonzero([other == unit for other in units])
            known = UNITS.get(unit)
            if unit in _COUNTS and quantity in ("position", "velocity"):
                if spec.counts_per_rev is None:
                    remedy = f"add counts_per_rev to signals.{name}"
                    message = "counts without counts_per_rev"
                    raise InputRejected("S05", message, where=where, remedy=remedy)
                turn = self._numbers(name, "counts_per_rev")
                rate = f"{spec.counts_per_rev} counts a revolution"
                self.steps.append(f"{name}: {unit} at {rate} to {own}")
                si[:, at] = values[:, at] * (2.0 * math.pi / turn[at])
            elif quantity == "torque" and known is not None and known.quantity == "current":
                constants = self.drive.torque_constant if self.drive else None
                if constants is None:
                    message = f"{name} is recorded in {unit}, motor current instead of torque"
                    remedy = "add [drive] torque_constant = … [N m/A]"
                    raise InputRejected("S10", message, where=where, remedy=remedy)
                listed = ", ".join(f"{constants[j]:g}" for j in at)
                self.steps.append(f"{name}: {unit} times {listed} N m/A")
                si[:, at] = known.factor * values[:, at] * np.array(constants)[at]
                whole = name == "tau" and at.size == self.robot.n_joints
                current = known.factor * values if whole else None
            else:
                to = to_si(unit, quantity, where=where)
                if not to.is_si:
                    self.steps.append(f"{name}: {unit} to {own}")
                si[:, at] = to.factor * values[:, at] + to.offset
        return si, current

    def _excitation(self, name: str, units: tuple[str, ...], where: str) -> str:
        """Return the quantity of an excitation by the controller's law: torque or acceleration."""
        law = self.recipe.controller.law if self.recipe.controller else None
        if law in ("pd", "pd+feedforward"):
            return "torque"
        known = UNITS.get(canonical_unit(units[0]))
        if known is not None and known.quantity == "torque":
            said = f'under [controller] law = "{law}" it is an acceleration'
            said = said if law else "the recipe has no [controller]"
            message = f"'{units[0]}' is a unit of torque, and {said}"
            add = 'add [controller] law = "pd" with its gains kp = [ … ] and kd = [ … ]'
            remedy = f"where {name} was added to the torque of a PD controller, {add}"
            raise InputRejected("S05", message, where=where, remedy=remedy)
        return "acceleration"

    def _motor_side(self, name: str) -> bool:
        motor = self.recipe.drive.transmission is not None
        side = self.recipe.signals[name].side or ("motor" if motor else "joint")
        return schema.SIGNALS[name][0] in (*_MOTION, "torque") and side == "motor"

    def _through_drive(self, name: str, values: Array) -> Array:
        """q_joint = N⁻¹ q_motor, tau_joint = Nᵀ tau_motor."""
        if not self._motor_side(name):
            return values
        if self.drive is None or self.drive.transmission is None:
            message = f"'signals.{name}' is on the motor side, but there is no drive.transmission"
            remedy = "add [drive] transmission = the gear ratios"
            raise UsageError("C02", message, where=self.recipe.where, remedy=remedy)
        matrix = np.array(self.drive.transmission)
        to_joint = f"{name}: motor to joint side by the"
        if schema.SIGNALS[name][0] in _MOTION:
            self.steps.append(f"{to_joint} inverse of the transmission")
            return np.asarray(np.linalg.solve(matrix, values.T).T, dtype=np.float64)
        self.steps.append(f"{to_joint} transposed transmission")
        return np.asarray(values @ matrix, dtype=np.float64)

    def _refuse_wrong_kind(self, name: str, units: tuple[str, ...]) -> None:
        """S05: an angle for a joint that slides, a length for one that turns."""
        if schema.SIGNALS[name][0] not in (*_MOTION, "torque") or self._motor_side(name):
            return
        own = _own_units(name, self.robot)
        for j, (unit, joint) in enumerate(zip(units, self.robot.joints, strict=True)):
            current = unit in UNITS and UNITS[unit].quantity == "current"
            if not current and joint.revolute == (unit in _LINEAR):
                each = f"one a joint: unit = {json.dumps(own)}"
                wanted = f"such as {own[j]}" if len(set(own)) == 1 else each
                message = f"'{unit}' for joint {j + 1} '{joint.name}', which is {joint.type}"
                where, remedy = self.part.column(name, j), f"declare its unit, {wanted}"
                raise InputRejected("S05", message, where=where, remedy=remedy)


def _whole_turn(name: str, raw: Array, spec: SignalSpec, unit: str) -> float | None:
    """Return one turn in the recorded unit, where every large step of a position is just that."""
    one = _TURNS.get(unit)
    if unit == "counts" and isinstance(spec.counts_per_rev, int | float):
        one = float(spec.counts_per_rev)
    if one is None or schema.SIGNALS[name][0] != "position":
        return None
    steps = np.abs(np.diff(raw, axis=0))
    large = steps > 0.5 * one
    if not large.any() or large.all():
        return None
    near = np.abs(steps[large] - one).max() < 0.1 * one
    return one if near and steps[~large].max() < 0.1 * one else None


def _refuse_degrees(
    part: Recording, q: Array, units: tuple[str, ...], robot: RobotDescription
) -> None:
    """S07: refuse declared radians far beyond the joint's range: degrees, or the motor's side."""
    for j, joint in enumerate(robot.joints):
        if units[j] not in ("rad", "m"):
            continue
        low, high = joint.position
        span = float(np.ptp(q[:, j]))
        if not joint.revolute and span > 2.0 * (high - low):
            limits = f"its limits are {low:.4g} to {high:.4g} m"
            message = f"moves over {span:.4g} declared m, {limits}: looks like mm"
            remedy = 'declare unit = "mm" for this joint, one unit a joint'
            raise InputRejected("S07", message, where=part.column("q", j), remedy=remedy)
        bounded = math.isfinite(low) and math.isfinite(high)
        if not joint.revolute or not bounded or span <= 4.0 * math.pi:
            continue
        slack = 0.05 * (high - low)
        angle = np.deg2rad(q[:, j])
        degrees = bool(angle.min() >= low - slack and angle.max() <= high + slack)
        if degrees or span > 2.0 * (high - low):
            turns = quarter_turns(q)
            starts = f"it starts at {', '.join(map(str, turns.values()))} times pi/2"
            motor = f"; {starts}, as motors of such gear ratios do at rest" if turns else ""
            what = f"looks like {'degrees or ' if degrees else ''}the motor side"
            limits = f"its limits are {low:.4g} to {high:.4g} rad"
            message = f"moves over {span:.4g} declared rad, {limits}: {what}{motor}"
            remedy = degrees_or_motor(span, (low, high))
            raise InputRejected("S07", message, where=part.column("q", j), remedy=remedy)
