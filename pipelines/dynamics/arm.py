"""The model of an arm: a rigid body with its base parameters, friction, and every further effect.

    arm = Arm.from_model(read_model("model.json"))
    tau = arm.torque(motion)                          what a log of this motion should show
    parts = arm.torque_parts(motion)                  the same, split
    arm.parameters["cogging:2:amplitude"].value       every number with its uncertainty
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from pipelines.dynamics.body import Array, Motion, RigidBody
from pipelines.dynamics.parameter import Origin, Parameter, Uncertainty
from pipelines.dynamics.rrr import rigid_body
from pipelines.effects import effect_names, find_effect
from pipelines.effects.base import ArmModel, Effect, SpeedCurve, joints_of
from pipelines.errors import InputRejected, UsageError, did_you_mean
from pipelines.io.model_file import (
    ModelFile,
    Source,
    StoredEffect,
    StoredParameter,
    StoredValue,
    Validity,
)
from pipelines.io.robot import RobotDescription, format_robot, parse_robot

__all__ = ["Acting", "Arm", "ArmTorque"]

# of `Effect.acts_on`, from the innermost to the outermost
_ORDER = ("load", "encoder", "drive", "record")


@dataclass(frozen=True)
class Acting:
    """An effect with the numbers it acts with."""

    effect: Effect
    parameters: tuple[Parameter, ...]

    @classmethod
    def of(cls, effect: Effect, values: Mapping[str, float], std: Mapping[str, float] | None = None,
           origin: Origin = "fitted", revolute: bool = True) -> Acting:
        """Return `effect` with `values`, units and bounds its own; `revolute` tells its joint's
        kind."""
        known, sure = effect.parameters.complete(values), std or {}
        parameters = tuple(Parameter(q.name, known[q.name], sure.get(q.name), q.unit_at(revolute),
                                     (q.low, q.high), origin) for q in effect.parameters)
        return cls(effect.at(known), parameters)

    @property
    def values(self) -> dict[str, float]:
        return {parameter.name: parameter.value for parameter in self.parameters}

    @property
    def place(self) -> str:
        """As causes are written on the command line: "cogging:2", "gravity_tilt"."""
        name, joint = self.effect.name, self.effect.joint
        return name if joint is None else f"{name}:{joint}"


@dataclass(frozen=True)
class ArmTorque:
    """The torque of the model, split. Each (samples, joints) [N m]."""

    inertia: Array
    coriolis: Array
    gravity: Array
    friction: Array
    effects: Array  # what the accepted effects add, exactly: torque with them minus torque without

    @property
    def total(self) -> Array:
        return self.inertia + self.coriolis + self.gravity + self.friction + self.effects


@dataclass(frozen=True)
class Arm:
    """A model of an arm: rigid body, base parameters, friction and further effects."""

    name: str
    body: RigidBody
    base: tuple[Parameter, ...]  # in the order of body.parameters
    friction: tuple[Acting, ...] = ()
    # in the order they were accepted: each acts around those before it
    effects: tuple[Acting, ...] = ()
    # of a fit, by the names of `parameters`; no model file holds it
    uncertainty: Uncertainty | None = field(default=None, compare=False, repr=False)
    # without its effects, as it was before `extended`
    extends: Arm | None = field(default=None, compare=False, repr=False)

    @property
    def robot(self) -> RobotDescription:
        return self.body.robot

    @property
    def n_joints(self) -> int:
        return self.body.robot.n_joints

    @cached_property
    def p(self) -> Array:
        return np.array([parameter.value for parameter in self.base])

    @property
    def parameters(self) -> dict[str, Parameter]:
        """Every number: base parameters by name, the rest as "viscous:3:coefficient"."""
        placed = {f"{acting.place}:{parameter.name}": parameter
                  for acting in (*self.friction, *self.effects) for parameter in acting.parameters}
        return {parameter.name: parameter for parameter in self.base} | placed

    @property
    def nominal(self) -> Arm:
        """The arm without its further effects: rigid body and friction."""
        if not self.effects:
            return self
        names = ("body", "base", "friction")
        if all(getattr(self, name) is getattr(self.extends, name, None) for name in names):
            assert self.extends is not None
            return self.extends  # one object: what is kept with a motion is found again
        return replace(self, effects=(), extends=None)

    def with_body(self, body: RigidBody, p: Array) -> Arm:
        """Return the same arm with another rigid body; its base parameters then are assumed."""
        return replace(self, body=body, base=_base(body, p, "assumed"), uncertainty=None)

    def extended(self, *more: Acting) -> Arm:
        """Return the arm with more effects, each around those before it.

        What misreads an angle is around loads, drives around that, and what changes the record
        outermost.
        """
        outer = sorted((*self.effects, *more),
                       key=lambda acting: _ORDER.index(acting.effect.acts_on))
        return replace(self, effects=tuple(outer), extends=self.nominal)

    def torque(self, motion: Motion,
               inside: Callable[[Motion, ArmModel], Array] | None = None) -> Array:
        """Torque (samples, joints) [N m] that a log of this motion should show.

        Args:
            inside: the torque that effects act on, in place of that of rigid body and friction.
        """
        def predict(motion: Motion, arm: ArmModel, acting: tuple[Acting, ...]) -> Array:
            if not acting:
                return arm.torque(motion) if inside is None else inside(motion, arm)
            *inner, last = acting
            return last.effect.apply(motion, arm, last.values,
                                     lambda m, a: predict(m, a, tuple(inner)))

        def nominal() -> Array:
            rigid = self.body.torque(motion.q, motion.dq, motion.ddq, self.p)
            return rigid + self.friction_torque(motion) if self.friction else rigid

        if self.effects or inside is not None:
            return predict(motion, self.nominal, self.effects)
        return motion.kept(self._key("torque"), nominal).copy()

    def friction_torque(self, motion: Motion) -> Array:
        """Torque (samples, joints) [N m] of the friction laws alone. To be read only."""
        return motion.kept(self._key("friction"), lambda: self._friction_torque(motion))

    def _key(self, kind: str) -> tuple[object, ...]:
        """Return what a torque follows from that is kept with a motion."""
        return kind, self.body, self.base, self.friction

    def _friction_torque(self, motion: Motion) -> Array:
        rigid = replace(self, friction=(), effects=())
        torque = np.zeros_like(motion.q)
        for law in self.friction:
            curve = law.effect.speed_curve(law.values)
            if curve is not None and law.effect.joint is not None:
                torque[:, law.effect.joint - 1] += curve.torque(motion.dq[:, law.effect.joint - 1])
            else:
                torque += law.effect.torque(motion, rigid, law.values)
        return torque

    def friction_curves(self, joint: int) -> tuple[SpeedCurve, ...] | None:
        """Return the laws at a joint (1-based) as curves of its speed; None where one is more."""
        curves = [law.effect.speed_curve(law.values) for law in self.friction
                  if law.effect.joint in (joint, None)]
        known = tuple(curve for curve in curves if curve is not None)
        return known if len(known) == len(curves) else None

    def torque_parts(self, motion: Motion) -> ArmTorque:
        """Return the torque of the model, split into what it is made of."""
        rigid = self.body.torque_parts(motion.q, motion.dq, motion.ddq, self.p)
        friction = self.friction_torque(motion)
        without = rigid.inertia + rigid.coriolis + rigid.gravity + friction
        effects = self.torque(motion) - without if self.effects else np.zeros_like(without)
        return ArmTorque(rigid.inertia, rigid.coriolis, rigid.gravity, friction, effects)

    @classmethod
    def from_links(cls, robot: RobotDescription) -> Arm:
        """Return the rigid arm whose links the description knows, without friction.

        Raises:
            UsageError: the description does not know every link.
        """
        body = rigid_body(robot)
        p = body.known_parameters()
        if p is None:
            missing = ", ".join(joint.name for joint in robot.joints if joint.link is None)
            raise UsageError(
                "C02", f"the links of {missing} are not described", where=robot.name,
                remedy="give each joint a [joint.link] with mass, com and inertia, or fit a model "
                "to logs")
        return cls(robot.name, body, _base(body, p, "known"))

    @classmethod
    def from_model(cls, model: ModelFile, where: object = "") -> Arm:
        """Return the arm that a model file describes.

        Raises:
            InputRejected: its parameters do not fit its robot or its effects (S18).
        """
        robot = parse_robot(model.robot, where=where, inside_log=True)
        body = rigid_body(robot)
        stored = {parameter.name: parameter for parameter in model.base_parameters}
        _same_names(stored, [known.name for known in body.parameters], "base_parameters", where)
        base = tuple(Parameter(s.name, s.value, s.std, s.unit, origin=s.origin, visible=s.visible)
                     for s in (stored[known.name] for known in body.parameters))
        friction, effects = (
            tuple(_acting(one, robot.revolute, kind, where) for one in getattr(model, kind))
            for kind in ("friction", "effects"))
        return cls(model.name, body, base, friction, effects)

    def to_model(self, *, validity: Validity | None = None, sources: Iterable[Source] = (),
                 notes: Iterable[str] = ()) -> ModelFile:
        """Return what a model file keeps of this arm."""
        base = tuple(
            StoredParameter(p.name, p.value, p.std, p.unit, p.visible, p.origin, known.combination)
            for p, known in zip(self.base, self.body.parameters, strict=True))
        return ModelFile(self.name, format_robot(self.robot), base,
                         tuple(map(_stored, self.friction)), tuple(map(_stored, self.effects)),
                         validity, tuple(sources), tuple(notes))


def _base(body: RigidBody, p: Array, origin: Origin) -> tuple[Parameter, ...]:
    return tuple(Parameter(known.name, float(value), None, known.unit, origin=origin)
                 for known, value in zip(body.parameters, p, strict=True))


def _stored(acting: Acting) -> StoredEffect:
    values = {q.name: StoredValue(q.value, q.std, q.unit, q.origin) for q in acting.parameters}
    return StoredEffect(acting.effect.name, acting.effect.joint, values)


def _acting(stored: StoredEffect, revolute: tuple[bool, ...], kind: str, where: object) -> Acting:
    """Return a stored effect; S18 where it does not fit its law or the robot."""
    def refused(words: str, remedy: str) -> InputRejected:
        return InputRejected("S18", f"{kind}{words}", where=where, remedy=remedy)

    name, joint, joints = stored.effect, stored.joint, len(revolute)
    if name not in effect_names():
        near = did_you_mean(name, effect_names())
        raise refused(f": '{name}' is not an effect that this version knows{near}",
                      "update rrrid, or correct the name")
    effect = find_effect(name)
    own = effect.scope == "joint"
    if joint not in (joints_of(effect, revolute) if own else (None,)):
        turning = " that turns" if own and not joints_of(effect, (False,)) else ""
        raise refused(f": {name} cannot be at joint {joint}",
                      f"it belongs to one {effect.scope}{turning}, and the arm has {joints} joints")
    turns = joint is None or revolute[joint - 1]
    unsaid = {q.name: StoredValue(q.unsaid, None, q.unit_at(turns), "assumed")
              for q in effect.parameters if q.unsaid is not None}
    said = unsaid | dict(stored.parameters)
    _same_names(said, [q.name for q in effect.parameters], f"{kind}, {name}", where)
    wrong: list[str] = []
    unfit: list[str] = []
    parameters: list[Parameter] = []
    for q in effect.parameters:
        v, unit = said[q.name], q.unit_at(turns)
        wrong += [f"{q.name} in {v.unit}, not {unit}"] if v.unit != unit else []
        unfit += filter(None, [q.unfit(v.value, joint, joints)])
        parameters.append(Parameter(q.name, v.value, v.std, v.unit, (q.low, q.high), v.origin))
    if wrong:
        raise refused(f", {name}: {'; '.join(wrong)}", "write the values in those units")
    if unfit:
        raise refused(f", {name}: {'; '.join(unfit)}", "write another number")
    at = effect(joint=joint).at({q.name: q.value for q in parameters})
    return Acting(at, tuple(parameters))


def _same_names(given: Iterable[str], wanted: list[str], what: str, where: object) -> None:
    names = list(given)
    if strange := next((name for name in names if name not in wanted), None):
        words = f"{what}: no parameter is called '{strange}'{did_you_mean(strange, wanted)}"
        raise InputRejected("S18", words, where=where, remedy="rename or remove it")
    if missing := [name for name in wanted if name not in names]:
        words = f"{what}: {', '.join(missing)} missing"
        raise InputRejected("S18", words, where=where, remedy="write them")
