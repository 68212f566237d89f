"""Describe one joint, and the friction laws that can be fitted to it.

With the other joints locked, Kostić et al. 2004, eq. (11), reads

    J ddq + c sin q + c' cos q + τ_f = τ

The printed equation has c sin q with q from the hanging position; c' cos q lets the equilibrium lie
anywhere. A prismatic joint has its weight along the axis instead, a constant. τ_f is a law: one
effect, or several that act together and share the speed over which they change sign.

    law = Law("stribeck", ("coulomb", "viscous", "stribeck"))
    law.columns(motion, joint, θ) @ amplitudes      θ: logarithms of the non-linear numbers
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NoReturn

import numpy as np

from pipelines.dynamics.body import Array, Motion, RigidBody
from pipelines.dynamics.chain import regressor
from pipelines.dynamics.kinematics import serial_chain
from pipelines.effects import find_effect
from pipelines.effects.base import ArmModel, Effect, Quantity, SpeedCurve
from pipelines.io.robot import Joint, RobotDescription

__all__ = ["LADDER", "Law", "OneJoint", "gravity_acts", "gravity_columns", "gravity_names"]
__all__ += ["law_named"]

POSITIONS = 8  # numerics: of the driven joint, at which gravity is computed
PARALLEL = 1e-6  # numerics: [rad] between axis and gravity: rounding of a description
_SHARED = "sharpness"  # every law of a joint changes its sign over the same speed
SHARP = (10.0, 30.0, 100.0, 300.0)  # numerics: [s/rad] where a search for it begins


@dataclass(frozen=True)
class OneJoint:
    """An arm of one joint: the `ArmModel` that a friction law acts on."""

    robot: RobotDescription  # of this joint alone
    inertia: float  # J [kg m^2]
    gravity: tuple[float, ...]  # c, c' [N m]; prismatic: the weight along the axis [N]

    @classmethod
    def of(
        cls,
        whole: RobotDescription,
        joint: int,
        inertia: float = 0.0,
        gravity: tuple[float, ...] = (),
    ) -> OneJoint:
        """Return joint `joint`, counted from 1, of a robot."""
        own = whole.joints[joint - 1]
        alone = RobotDescription(whole.name, whole.gravity, "dh", (Joint(own.name, own.type),))
        return cls(alone, inertia, gravity or (0.0,) * len(gravity_names(own.revolute)))

    n_joints = 1

    @property
    def revolute(self) -> bool:
        return self.robot.joints[0].revolute

    @property
    def units(self) -> tuple[str, str, str]:
        """Return the units of torque, speed and inertia."""
        return ("N m", "rad/s", "kg m^2") if self.revolute else ("N", "m/s", "kg")

    @property
    def body(self) -> RigidBody:
        raise TypeError("a joint on its own has no links")

    @property
    def p(self) -> Array:
        return np.array([self.inertia, *self.gravity])

    def torque(self, motion: Motion) -> Array:
        """Return J ddq + c sin q + c' cos q, (samples, 1) [N m]."""
        weight = gravity_columns(motion.q[:, 0], self.revolute) @ self.p[1:]
        return np.asarray(self.inertia * motion.ddq + weight[:, None])

    def friction_torque(self, motion: Motion) -> Array:
        """Return zeros: its law of friction is what is fitted."""
        return np.zeros_like(motion.dq)

    def friction_curves(self, joint: int) -> tuple[SpeedCurve, ...]:
        return ()

    def with_body(self, body: RigidBody, p: Array) -> NoReturn:
        raise TypeError("a joint on its own has no links")

    def carrying(self, rigid: Array) -> OneJoint:
        """Return it with J, c, c' (3, …) [kg m^2], [N m]; prismatic: mass and weight (2, …)."""
        inertia, *gravity = map(float, rigid[: 1 + len(self.gravity)])
        return replace(self, inertia=inertia, gravity=tuple(gravity))


def gravity_columns(q: Array, revolute: bool) -> Array:
    """Return sin q, cos q (samples, 2); of a prismatic joint ones (samples, 1)."""
    return np.stack([np.sin(q), np.cos(q)]).T if revolute else np.ones((len(q), 1))


def gravity_names(revolute: bool) -> tuple[str, ...]:
    return ("sine", "cosine") if revolute else ("constant",)


def gravity_acts(robot: RobotDescription, joint: int, others: Sequence[float]) -> bool:
    """Return whether gravity has a moment about joint `joint`, or a part along one that slides.

    Args:
        joint: counted from 1.
        others: (joints - 1,) positions of the other joints [rad].
    """
    q = np.tile(np.asarray(others, dtype=np.float64), (POSITIONS, 1))
    q = np.insert(q, joint - 1, np.linspace(-3.0, 3.0, POSITIONS), axis=1)
    row = regressor(serial_chain(robot), q, 0.0 * q, 0.0 * q)[:, joint - 1]
    least = PARALLEL * float(np.linalg.norm(robot.gravity))
    return bool(np.abs(row).max(initial=0.0) > least)


@dataclass(frozen=True)
class Law:
    """Effects at one joint that together are its friction."""

    name: str
    members: tuple[str, ...]  # names of effects

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """Return each at the only joint of `OneJoint`."""
        return tuple(find_effect(name)(joint=1) for name in self.members)

    @property
    def title(self) -> str:
        """Return it in words, joined by "+" where several causes act."""
        return " + ".join(find_effect(name).words.title for name in self.name.split("+"))

    @cached_property
    def nonlinear(self) -> tuple[tuple[Quantity, tuple[int, ...]], ...]:
        """Return the numbers of θ, each with the effects that have it.

        One that may be zero, such as a damping, stays at its default: it has no logarithm. So does
        one that a model need not give, which only other forms of the law have.
        """
        numbers: dict[str, tuple[Quantity, tuple[int, ...]]] = {}
        for k, effect in enumerate(self.effects):
            for q in effect.parameters:
                if q.shape and q.low > 0.0 and q.unsaid is None:
                    key = q.name if q.name == _SHARED else f"{effect.name}.{q.name}"
                    first, before = numbers.get(key, (q, ()))
                    numbers[key] = first, (*before, k)
        return tuple(numbers.values())

    @cached_property
    def _counts(self) -> tuple[int, ...]:
        """Return the number of columns of every effect."""
        return tuple(sum(not q.shape for q in effect.parameters) for effect in self.effects)

    def _split(self, amplitudes: Array) -> list[Array]:
        """Return the amplitudes of every effect."""
        return np.split(amplitudes, np.cumsum(self._counts)[:-1])

    @property
    def amplitudes(self) -> int:
        """Return the number of columns."""
        return sum(self._counts)

    @property
    def size(self) -> int:
        """Return how many numbers are fitted."""
        return self.amplitudes + len(self.nonlinear)

    @cached_property
    def pointwise(self) -> bool:
        """Return whether its torque at a moment depends on that moment alone, unlike presliding."""
        pairs = zip(self.effects, self._counts, strict=True)
        return all(one.own_memory(one.values(np.ones(count))) is None for one, count in pairs)

    @cached_property
    def sees_load(self) -> bool:
        """Return whether it depends on the torque that the joint carries."""
        return not all(effect.from_motion for effect in self.effects)

    @cached_property
    def sloped(self) -> bool:
        """Return whether `slopes` is known: of every effect that has a number of θ."""
        curved = {k for _, effects in self.nonlinear for k in effects}
        kinds = [type(self.effects[k]) for k in curved]
        return all(kind.shape_slopes is not Effect.shape_slopes for kind in kinds)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Return the lower and the upper bounds of θ."""
        low, high = np.log([(q.low, q.high) for q, _ in self.nonlinear]).reshape(-1, 2).T
        return low, high

    def shaped(self, theta: Array) -> tuple[Effect, ...]:
        """Return the effects with their non-linear numbers out of θ."""
        values: list[dict[str, Any]] = [{} for _ in self.effects]
        for (quantity, effects), logarithm in zip(self.nonlinear, theta, strict=True):
            for k in effects:
                values[k][quantity.name] = math.exp(logarithm)
        pairs = zip(self.effects, values, strict=True)
        return tuple(replace(effect, **own) if own else effect for effect, own in pairs)

    def theta(self, effects: Sequence[Effect]) -> Array:
        """Return θ of effects; the inverse of `shaped`."""
        return np.array([math.log(getattr(effects[k], q.name)) for q, (k, *_) in self.nonlinear])

    def canonical(self, theta: Array) -> Array:
        """Return, of several equal θ, that in the order of its effects, such as w1 > w2 > w3."""
        ordered = []
        values = self.values(theta, np.ones(self.amplitudes))
        for effect, own in zip(self.shaped(theta), values, strict=True):
            order = getattr(effect, "canonical", None)
            ordered.append(effect.at(order(own)) if order is not None else effect)
        return self.theta(ordered)

    def columns(self, motion: Motion, arm: ArmModel, theta: Array) -> Array:
        """Return the torque per unit of each amplitude (samples, amplitudes)."""
        parts = [effect.columns(motion, arm)[:, 0] for effect in self.shaped(theta)]
        return np.hstack(parts) if len(parts) > 1 else parts[0]

    def slopes(self, motion: Motion, theta: Array, amplitudes: Array) -> Array:
        """Return ∂τ/∂θ (samples, numbers of θ) of a law that is `sloped`."""
        total = np.zeros((len(self.nonlinear), len(motion.dq)))
        for k, (effect, part) in enumerate(
            zip(self.shaped(theta), self._split(amplitudes), strict=True)
        ):
            own = [i for i, (_, effects) in enumerate(self.nonlinear) if k in effects]
            slopes = effect.shape_slopes(motion, part) if own else None
            if slopes is not None:
                total[own] += slopes.T
        return total.T

    def starts(
        self, motion: Motion, arm: ArmModel, sharpness: float | None = None
    ) -> Iterator[Array]:
        """Return θ over the grids of its effects.

        Args:
            sharpness: the shared one [s/rad], where it is known.
        """
        grids = [
            [effect]
            if {q.name for q in effect.parameters if q.shape} <= {_SHARED}
            else list(effect.shapes(motion, arm))
            for effect in self.effects
        ]
        shared = np.array([q.name == _SHARED for q, _ in self.nonlinear], dtype=bool)
        widths = (sharpness,) if sharpness is not None else SHARP
        for effects in itertools.product(*grids):
            for width in widths if shared.any() else (1.0,):
                yield np.where(shared, math.log(width), self.theta(effects))

    def values(self, theta: Array, amplitudes: Array) -> tuple[dict[str, float], ...]:
        """Return the parameters of every effect, by name."""
        pairs = zip(self.shaped(theta), self._split(amplitudes), strict=True)
        return tuple(effect.values(own) for effect, own in pairs)

    def numbers(self, theta: Array, amplitudes: Array) -> dict[tuple[Effect, Quantity], float]:
        """Return the parameters of all effects; the shared sharpness once."""
        numbers: dict[tuple[Effect, Quantity], float] = {}
        for effect, own in zip(self.effects, self.values(theta, amplitudes), strict=True):
            for q in effect.parameters:
                if q.name != _SHARED or all(known.name != _SHARED for _, known in numbers):
                    numbers[effect, q] = own[q.name]
        return numbers

    def curve(self, speed: Array, arm: ArmModel, theta: Array, amplitudes: Array) -> Array:
        """Return the torque against speed alone (samples,) [N m]."""
        total = np.zeros(len(speed))
        for effect, own in zip(self.shaped(theta), self.values(theta, amplitudes), strict=True):
            total += effect.curve(speed, arm, own)
        return total


# In the order of their size. Each is Coulomb and viscous friction and one cause more, but the first
# two and eq. (10); the last follows any curve, odd or not.
LADDER = (
    Law("viscous", ("viscous",)),
    Law("coulomb", ("coulomb",)),
    Law("coulomb+viscous", ("coulomb", "viscous")),
    *(
        Law(name, ("coulomb", "viscous", name))
        for name in (
            "torque_offset",
            "quadratic_drag",
            "load_friction",
            "presliding",
            "stribeck",
            "concave_friction",
            "asymmetric_friction",
            "position_friction",
        )
    ),
    Law("three_sigmoid", ("three_sigmoid",)),
    Law("three_sigmoid+asymmetric_friction", ("three_sigmoid", "asymmetric_friction")),
)


def law_named(name: str) -> Law:
    """Return a law of the ladder, or one with further causes: "stribeck+asymmetric_friction".

    Raises:
        KeyError: no law of the ladder has that name, or its part before the first "+".
    """
    laws = {law.name: law for law in LADDER}
    if name in laws:
        return laws[name]
    first, *further = name.split("+")
    return Law(name, (*laws[first].members, *further))
