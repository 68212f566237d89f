"""Friction laws as the ladder knows them: one effect, or a few that act together and share the width of their sign.

    law = Law("stribeck", ("coulomb", "viscous", "stribeck"))
    law.columns(motion, arm, θ)           θ: logarithms of the non-linear numbers
    law.starts(motion, arm)               where a search may begin
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipelines.log.robot import Joint, RobotDescription
from pipelines.model.effects import find_effect
from pipelines.model.effects.base import ArmModel, Effect, Quantity
from pipelines.model.effects.fast import shape_slopes
from pipelines.model.friction.one_joint import OneJoint
from pipelines.model.rigid.body import Array, Motion

__all__ = ["LADDER", "Law", "Place", "law_named", "with_further"]

_SHARED = "sharpness"  # one joint changes the sign of its friction over one speed, whatever the law is made of
_SHARP = (10.0, 30.0, 100.0, 300.0)  # [s/rad] where a search for it begins


@dataclass(frozen=True)
class Place:
    """Where one number of θ goes: into these effects, under this name."""

    name: str
    effects: tuple[int, ...]
    quantity: Quantity


@dataclass(frozen=True)
class Law:
    """Effects at one joint that together are its friction."""

    name: str
    members: tuple[str, ...]  # names of effects

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """Each at the only joint of the arm `OneJoint`."""
        return tuple(find_effect(name)(joint=1) for name in self.members)

    @property
    def title(self) -> str:
        """In words; joined by "+" where several causes act."""
        return " + ".join(find_effect(name).words.title for name in self.name.split("+"))

    @cached_property
    def places(self) -> tuple[Place, ...]:
        """The numbers of θ. One that may be zero, such as a damping, stays at its default: it has no logarithm. So does one that a
        model need not say, which only other forms of the law have."""
        found: dict[str, Place] = {}
        for k, effect in enumerate(self.effects):
            for quantity in effect.parameters:
                if not quantity.shape or quantity.low <= 0.0 or quantity.unsaid is not None:
                    continue
                key = quantity.name if quantity.name == _SHARED else f"{effect.name}.{quantity.name}"
                before = found.get(key, Place(quantity.name, (), quantity))
                found[key] = Place(quantity.name, (*before.effects, k), quantity)
        return tuple(found.values())

    @cached_property
    def _counts(self) -> tuple[int, ...]:
        """Columns of every effect."""
        return tuple(sum(not q.shape for q in effect.parameters) for effect in self.effects)

    @property
    def amplitudes(self) -> int:
        """Number of columns."""
        return sum(self._counts)

    @cached_property
    def pointwise(self) -> bool:
        """Return whether its torque at one moment depends on that moment alone: not on what went before, as presliding does."""
        motion, arm = _trial()
        back = Motion(motion.t, motion.q[::-1], motion.dq[::-1], motion.ddq[::-1])
        theta = np.mean(self.bounds, axis=0)
        return bool(np.allclose(self.columns(back, arm, theta)[::-1], self.columns(motion, arm, theta), rtol=1e-9, atol=1e-12))

    @cached_property
    def sees_load(self) -> bool:
        """Return whether it depends on the torque that the joint carries."""
        motion, arm = _trial()
        theta = np.mean(self.bounds, axis=0)
        return not np.array_equal(self.columns(motion, arm, theta), self.columns(motion, arm.carrying(2.0, (1.0, 3.0)), theta))

    @property
    def size(self) -> int:
        """Numbers to be fitted."""
        return self.amplitudes + len(self.places)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Of θ."""
        pairs = np.log([(place.quantity.low, place.quantity.high) for place in self.places]).reshape(-1, 2)
        return pairs[:, 0], pairs[:, 1]

    def shaped(self, theta: Array) -> tuple[Effect, ...]:
        """The effects with their non-linear numbers out of θ."""
        numbers = [dict(fixed) for fixed in self._defaults]
        for place, value in zip(self.places, theta, strict=True):
            for k in place.effects:
                numbers[k][place.name] = math.exp(value)
        return tuple(effect.at(values) if values else effect for effect, values in zip(self.effects, numbers, strict=True))

    @cached_property
    def _defaults(self) -> tuple[dict[str, float], ...]:
        """Non-linear numbers of every effect as they are where θ says nothing of them."""
        return tuple({q.name: getattr(effect, q.name) for q in effect.parameters if q.shape} for effect in self.effects)

    def theta(self, effects: tuple[Effect, ...]) -> Array:
        """The inverse of `shaped`."""
        return np.array([math.log(getattr(effects[place.effects[0]], place.name)) for place in self.places])

    def canonical(self, theta: Array) -> Array:
        """The one of several equal θ that its effects name, such as w1 > w2 > w3."""
        named = []
        for effect, values in zip(self.shaped(theta), self.values(theta, np.ones(self.amplitudes)), strict=True):
            order = getattr(effect, "canonical", None)
            named.append(effect.at(order(values)) if order is not None else effect)
        return self.theta(tuple(named))

    def columns(self, motion: Motion, arm: ArmModel, theta: Array) -> Array:
        """(samples, amplitudes) on the joint's own row."""
        parts = [effect.columns(motion, arm)[:, 0] for effect in self.shaped(theta)]
        return np.hstack(parts) if len(parts) > 1 else parts[0]

    def slopes(self, motion: Motion, theta: Array, amplitudes: Array) -> Array | None:
        """∂τ/∂θ (samples, numbers of θ) on the joint's own row; None where an effect does not say it."""
        total, first = np.zeros((len(self.places), len(motion.dq))), 0
        for k, effect in enumerate(self.shaped(theta)):
            count = self._counts[k]
            own = [i for i, place in enumerate(self.places) if k in place.effects]
            if own:
                part = shape_slopes(effect, motion, amplitudes[first:first + count])
                if part is None:
                    return None
                for i, column in zip(own, part.T, strict=True):
                    total[i] += column
            first += count
        return total.T

    @cached_property
    def sloped(self) -> bool:
        """Return whether every effect with non-linear numbers says its slopes."""
        motion, _ = _trial()
        return self.slopes(motion, np.mean(self.bounds, axis=0), np.ones(self.amplitudes)) is not None

    def starts(self, motion: Motion, arm: ArmModel, sharpness: float | None = None) -> Iterator[Array]:
        """θ over the grids that the effects themselves offer; the shared width near `sharpness` where that is known."""
        grids = [[effect] if {q.name for q in effect.parameters if q.shape} <= {_SHARED} else list(effect.shapes(motion, arm))
                 for effect in self.effects]
        shared = [place for place in self.places if place.name == _SHARED]
        widths = (sharpness,) if sharpness is not None else _SHARP
        for effects in itertools.product(*grids):
            for width in widths if shared else (1.0,):
                yield np.array([math.log(width if place.name == _SHARED else getattr(effects[place.effects[0]], place.name))
                                for place in self.places])

    def values(self, theta: Array, amplitudes: Array) -> tuple[dict[str, float], ...]:
        """Every parameter of every effect, by name."""
        found, first = [], 0
        for effect, count in zip(self.shaped(theta), self._counts, strict=True):
            found.append(effect.values(amplitudes[first:first + count]))
            first += count
        return tuple(found)

    def named(self, theta: Array, amplitudes: Array) -> tuple[list[tuple[Effect, Quantity]], Array]:
        """Every parameter of every effect and its value; the shared width once."""
        names: list[tuple[Effect, Quantity]] = []
        numbers: list[float] = []
        for effect, values in zip(self.effects, self.values(theta, amplitudes), strict=True):
            for quantity in effect.parameters:
                if quantity.name != _SHARED or all(q.name != _SHARED for _, q in names):
                    names.append((effect, quantity))
                    numbers.append(values[quantity.name])
        return names, np.array(numbers)

    def curve(self, speed: Array, arm: ArmModel, theta: Array, amplitudes: Array) -> Array:
        """Torque (samples,) [N m] against speed alone."""
        total = np.zeros(len(speed))
        for effect, values in zip(self.shaped(theta), self.values(theta, amplitudes), strict=True):
            total += effect.curve(speed, arm, values)
        return total


def _trial() -> tuple[Motion, OneJoint]:
    """A motion and a joint to learn by what a law depends on."""
    t = np.linspace(0.0, 1.0, 40)[:, None]
    arm = OneJoint(RobotDescription("trial", (0.0, 0.0, -9.81), "dh", (Joint("joint"),)), 1.0, (2.0, 1.0))
    return Motion(t[:, 0], np.sin(7.0 * t + t**2), 7.0 * np.cos(7.0 * t), -49.0 * np.sin(7.0 * t)), arm


_BASE = ("coulomb", "viscous")

# In the order of their size. Each is Coulomb and viscous friction and one cause more, but the first two and eq. (10).
LADDER = (
    Law("viscous", ("viscous",)),
    Law("coulomb", ("coulomb",)),
    Law("coulomb+viscous", _BASE),
    *(Law(name, (*_BASE, name)) for name in (
        "torque_offset", "quadratic_drag", "load_friction", "presliding", "stribeck", "concave_friction",
        "asymmetric_friction", "position_friction")),
    Law("three_sigmoid", ("three_sigmoid",)),
)


def law_named(name: str) -> Law | None:
    """A law of the ladder, or several joined by "+" beyond the first: "stribeck+asymmetric_friction"."""
    if known := next((law for law in LADDER if law.name == name), None):
        return known
    first, *more = name.split("+")
    law = law_named(first) if more else None
    return None if law is None else with_further(law, *more)


def with_further(law: Law, *causes: str) -> Law:
    """`law` with more causes beside it."""
    return Law("+".join((law.name, *causes)), (*law.members, *causes))
