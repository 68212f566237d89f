"""The arm as a thing that moves: rigid body, friction and effects put together for many replicas.

    plant = Plant.of(arm)
    motion = plant.prepared(replicas)            with working memory
    motion.accelerations(t, q, dq, states, command, out)

Effects enter through their hooks, in the order in which they act; what is friction of one joint's speed alone is gathered.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from pipelines.errors import InputRejected
from pipelines.model.arm import Acting, Arm
from pipelines.model.effects.base import ArmModel, Hooks, OwnLoad, OwnMemory, PlainDrive
from pipelines.model.effects.fast import own_load, own_memory, speed_curve
from pipelines.model.rigid.base import BaseArm
from pipelines.model.rigid.body import Array, Motion, RigidBody
from pipelines.model.rigid.rrr import RRR
from pipelines.model.simulation.chain import ManyChains
from pipelines.model.simulation.friction import ManyCurves, stacked
from pipelines.model.simulation.rrr import ManyRRR

__all__ = ["MovingPlant", "Plant"]

_SINGULAR = 1e-10  # smallest over largest eigenvalue of an inertia matrix


@dataclass(frozen=True, eq=False)
class Plant:
    """What moves, in parts."""

    body: RigidBody
    p: Array  # (parameters,), or (replicas, parameters)
    added: Array  # [kg m^2] (joints, joints) inertia of rotors
    curves: ManyCurves
    hooks: tuple[Hooks, ...]  # of all other effects
    needed: Callable[[Motion], Array]  # torque that a motion at the start needs [N m], for memories that are not empty
    records: tuple[Callable[[Array, Array], Array], ...] = ()  # what comes between a command and the log

    @classmethod
    def of(cls, arm: Arm, p: Array | None = None) -> Plant:
        """`arm`, with its own base parameters or with `p` (replicas, parameters).

        Raises:
            ValueError: p has another shape.
        """
        if p is not None and (p.ndim != 2 or p.shape[1] != len(arm.p)):
            raise ValueError(f"p has the shape {p.shape}, wanted is (replicas, {len(arm.p)})")
        rigid, acting_on = Arm(arm.name, arm.body, arm.base), cast("ArmModel", arm.nominal)
        curves, hooks, records, added = [], [], [], np.zeros((arm.n_joints, arm.n_joints))
        laws = [(law, True) for law in arm.friction]
        for acting, friction in (*laws, *((effect, False) for effect in arm.effects)):
            curve = speed_curve(acting.effect, acting.values)
            if curve is not None and acting.effect.joint is not None:
                curves.append((acting.effect.joint - 1, curve))
                continue
            own = acting.effect.simulate(rigid if friction else acting_on, acting.values)
            acting_on = acting_on if own.arm is None else own.arm
            added = added if own.inertia is None else added + own.inertia
            records += [own.record] if own.record else []
            if any((own.load, own.actuator, own.sensor, own.settled, own.states)):
                values = {name: float(value) for name, value in acting.values.items()}  # which are written as numbers of Python
                load = None if own.actuator or own.states else own_load(acting.effect, values)
                alone = None if load is None or acting.effect.joint is None else (acting.effect.joint - 1, load)
                hooks.append(replace(own, alone=alone, remembering=_remembering(acting, own)))
        parameters = acting_on.p if p is None else _changed(p, arm.p, acting_on.p)
        return cls(acting_on.body, parameters, added, stacked(curves, arm.n_joints), tuple(hooks), arm.nominal.torque,
                   tuple(records))

    @property
    def n_joints(self) -> int:
        return self.body.robot.n_joints

    def logged(self, t: Array, tau: Array) -> Array:
        """What the log holds of the commands tau (samples, joints)."""
        for record in self.records:
            tau = record(t, tau)
        return tau

    @property
    def plain(self) -> bool:
        """Whether nothing moves it but rigid body, friction, loads and drives in plain numbers: no array is needed on the way."""
        return all(_in_numbers(hook) for hook in self.hooks)

    @property
    def own_loads(self) -> tuple[tuple[int, OwnLoad], ...]:
        """Loads that follow from angle and speed of one joint (0-based) alone."""
        return tuple(hook.alone for hook in self.hooks if hook.alone is not None)

    @property
    def drives(self) -> tuple[PlainDrive, ...]:
        """What a command passes on its way to the joints, one after the other."""
        return tuple(hook.drive for hook in reversed(self.hooks) if hook.drive is not None)

    @property
    def own_memories(self) -> tuple[tuple[int, OwnMemory], ...]:
        """The same of loads that remember one number, in the order of the states."""
        return tuple(hook.remembering for hook in self.hooks if hook.remembering is not None)

    def refuse_unphysical(self, q: Array) -> None:
        """Look at the inertia matrix in the postures q (postures, joints).

        Raises:
            InputRejected: D15, some torque would accelerate the arm against itself, or without bound.
        """
        p = np.atleast_2d(self.p)[0]
        values = np.linalg.eigvalsh(self.body.mass_matrix(q, p) + self.added)
        worst = int(np.argmin(values[:, 0] / values[:, -1]))
        if values[worst, 0] <= _SINGULAR * values[worst, -1]:
            where = ", ".join(f"{x:.3g}" for x in q[worst])
            raise InputRejected("D15", f"at q = ({where}) the model's inertia matrix is not positive definite, its smallest "
                                f"eigenvalue {values[worst, 0]:.2g}", remedy="such an arm cannot be simulated: fit it to richer "
                                "motion, or add the rotors' inertia")

    def prepared(self, replicas: int) -> MovingPlant:
        return MovingPlant(self, replicas)


def _in_numbers(hook: Hooks) -> bool:
    """Return whether all that it does to torque is known in plain numbers."""
    driven = hook.actuator is None or (hook.drive is not None and not hook.states)
    return driven and bool(hook.alone or hook.remembering or not (hook.load or hook.states))


def _remembering(acting: Acting, own: Hooks) -> tuple[int, OwnMemory] | None:
    """What `acting` remembers in plain numbers, if its hooks are a load and the rate of one state."""
    if own.states != 1 or any((own.actuator, own.sensor, own.settled, own.start, own.update)) or acting.effect.joint is None:
        return None
    memory = own_memory(acting.effect, acting.values)
    return None if memory is None else (acting.effect.joint - 1, memory)


def _changed(p: Array, nominal: Array, true: Array) -> Array:
    """Each replica's own parameters with the change that effects made to the nominal ones."""
    if true.shape != nominal.shape:
        raise ValueError("an effect changes the set of base parameters: replicas cannot have parameters of their own")
    return np.asarray(p + (true - nominal))


class MovingPlant:
    """A plant with working memory for a number of replicas. Joints come first, replicas last."""

    def __init__(self, plant: Plant, replicas: int) -> None:
        self.plant, self.replicas = plant, replicas
        self.rigid = _many(plant.body, plant.p, plant.added, replicas)
        self.friction = plant.curves.prepared(replicas)
        ends = np.cumsum([0, *(hook.states for hook in plant.hooks)]).tolist()
        self.n_states = ends[-1]
        self._hooked = [(hook, slice(a, b)) for hook, a, b in zip(plant.hooks, ends, ends[1:], strict=False)]
        # One robot's loads of single joints are plain numbers: arrays of one cost twenty times the arithmetic.
        self._alone = plant.own_loads if replicas == 1 else ()
        self._loaded = [(hook.load, own) for hook, own in self._hooked if hook.load and not (hook.alone and self._alone)]
        # each effect acts around those before it: a command meets the last one first, a position reaches it last
        self._driven = [(hook.actuator, own) for hook, own in reversed(self._hooked) if hook.actuator]
        self._changing = [(hook, own) for hook, own in reversed(self._hooked) if hook.actuator or hook.rate]
        self._shared = [(hook.load, own) for hook, own in self._hooked if hook.load and hook.alone is None]
        self._left = np.empty((plant.n_joints, replicas))
        self._zeros = np.zeros((replicas, plant.n_joints))

    def motion(self, t: Array, q: Array, dq: Array) -> Motion:
        return Motion(t, q.T, dq.T, self._zeros)

    def accelerations(self, t: Array, q: Array, dq: Array, states: Array, command: Array, out: Array,
                      held: ManyChains | None = None) -> None:
        """ddq (joints, replicas) into `out`. t (replicas,), states (replicas, states), the rest (joints, replicas).

        Args:
            held: a rigid body that is taken as it was last held.
        """
        if self._loaded or self._driven:
            command = self._through_effects(self.motion(t, q, dq), states, command)
        if self._alone:
            command = self._less_alone(q, dq, command)
        self.friction.take_off(command, dq, self._left)
        if held is None:
            self.rigid.acceleration(q, dq, self._left, out)
        else:
            held.held_acceleration(self._left, out)

    def _through_effects(self, motion: Motion, states: Array, command: Array) -> Array:
        torque = command.T
        for actuator, own in self._driven:
            torque = actuator(torque, motion, states[:, own])
        for load, own in self._loaded:
            torque = torque - load(motion, states[:, own])
        return np.ascontiguousarray(torque.T)

    def _less_alone(self, q: Array, dq: Array, command: Array) -> Array:
        left = command.copy()
        try:
            for joint, load in self._alone:
                left[joint, 0] -= load(q[joint, 0].item(), dq[joint, 0].item())
        except (ValueError, OverflowError):  # of an infinite number there is no sine
            left[:] = np.nan
        return left

    def through(self, motion: Motion, states: Array, command: Array) -> tuple[Array, Array | float]:
        """What comes of `command` (replicas, joints) to the rigid body, with the loads but those of single joints taken off, and
        d(states)/dt (replicas, states)."""
        rates: Array | float = np.zeros_like(states) if self._changing else 0.0
        torque = command
        for hook, own in self._changing:
            if hook.rate and not isinstance(rates, float):
                rates[:, own] = hook.rate(motion, torque, states[:, own])
            torque = hook.actuator(torque, motion, states[:, own]) if hook.actuator else torque
        for load, own in self._shared:
            torque = torque - load(motion, states[:, own])
        return torque, rates

    def rates(self, t: Array, q: Array, dq: Array, states: Array, command: Array) -> Array:
        """d(states)/dt (replicas, states)."""
        out, motion = np.zeros_like(states), self.motion(t, q, dq)
        for hook, own, torque in self._on_its_way(motion, states, command):
            if hook.rate:
                out[:, own] = hook.rate(motion, torque, states[:, own])
        return out

    def updated(self, t: Array, q: Array, dq: Array, states: Array, command: Array) -> Array:
        """The states after a control sample was taken (replicas, states)."""
        out, motion = states.copy(), self.motion(t, q, dq)
        for hook, own, torque in self._on_its_way(motion, states, command):
            if hook.update:
                out[:, own] = hook.update(motion, torque, states[:, own])
        return out

    def _on_its_way(self, motion: Motion, states: Array, command: Array) -> Iterator[tuple[Hooks, slice, Array]]:
        """Every hook with its memories and the torque (replicas, joints) that reaches it."""
        torque = command.T
        for hook, own in reversed(self._hooked):
            yield hook, own, torque
            torque = hook.actuator(torque, motion, states[:, own]) if hook.actuator else torque

    def settled(self, t: Array, q: Array, dq: Array, ddq: Array | None = None) -> Array:
        """True position and speed (2 joints, replicas) when the encoders first tell q, dq and ddq, each (joints, replicas)."""
        motion = Motion(t, q.T, dq.T, self._zeros if ddq is None else ddq.T)
        for hook, _ in reversed(self._hooked):
            if hook.settled:
                motion = hook.settled(motion, self.plant.needed(motion))
        return np.concatenate([motion.q.T, motion.dq.T])

    def at_start(self, t: Array, q: Array, dq: Array, ddq: Array | None = None) -> Array:
        """The states (replicas, states) before the first sample."""
        states = np.zeros((self.replicas, self.n_states))
        motion = Motion(t, q.T, dq.T, self._zeros if ddq is None else ddq.T)
        for hook, own in self._hooked:
            if hook.start:
                states[:, own] = hook.start(motion, self.plant.needed(motion))
        return states

    def measured(self, q: Array, states: Array) -> Array:
        """What the encoders see of q (joints, replicas), before they count it."""
        seen = q.T
        for hook, own in self._hooked:
            if hook.sensor:
                seen = hook.sensor(seen, states[:, own])
        return seen.T


def _many(body: RigidBody, p: Array, added: Array, replicas: int) -> ManyRRR | ManyChains:
    if isinstance(body, RRR):
        return ManyRRR(body, p, added, replicas)
    if isinstance(body, BaseArm):
        return ManyChains(body, p, added, replicas)
    raise TypeError(f"no forward dynamics is known of a {type(body).__name__}")
