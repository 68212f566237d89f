"""The arm as a thing that moves: rigid body, friction and effects put together.

    moving = Plant.of(arm).prepared(replicas)            with working memory
    ddq, rates = moving.accelerations(t, q, dq, states, command)

Effects enter through their hooks, in the order in which they act.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.dynamics.body import Motion, RigidBody
from pipelines.dynamics.functions import ARRAYS
from pipelines.effects.base import ArmModel, Effect, Hooks, SpeedCurve, Values
from pipelines.errors import InputRejected
from pipelines.io.log import Array
from pipelines.simulation.bodies import Held, bodies_of, gained
from pipelines.simulation.config import SIMULATION

__all__ = ["MovingPlant", "Plant", "refuse_runaway"]


@dataclass(frozen=True, eq=False)
class Plant:
    """An arm in parts, for simulation."""

    body: RigidBody
    p: Array  # (parameters,)
    added: Array  # [kg m^2] (joints, joints) inertia of rotors
    curves: tuple[SpeedCurve, ...]  # friction of each joint that follows from its speed alone
    hooks: tuple[Hooks, ...]  # of all other effects
    needed: Callable[[Motion], Array]  # torque of a motion at the start [N m], for memories
    records: tuple[Callable[[Array, Array], Array], ...] = ()  # between a command and the log

    @classmethod
    def of(cls, arm: Arm) -> Plant:
        """Return `arm` in parts."""
        rigid, acting_on = Arm(arm.name, arm.body, arm.base), cast("ArmModel", arm.nominal)
        curves: list[list[SpeedCurve]] = [[] for _ in range(arm.n_joints)]
        hooks, records, added = [], [], np.zeros((arm.n_joints, arm.n_joints))
        for place, acting in enumerate((*arm.friction, *arm.effects)):
            effect, values = acting.effect, {k: float(x) for k, x in acting.values.items()}
            curve = effect.speed_curve(values)
            if curve is not None and effect.joint is not None:
                curves[effect.joint - 1].append(curve)
                continue
            own = effect.simulate(rigid if place < len(arm.friction) else acting_on, values)
            acting_on = acting_on if own.arm is None else own.arm
            added = added if own.inertia is None else added + own.inertia
            records += [own.record] if own.record else []
            if any((own.load, own.actuator, own.drive, own.sensor, own.settled, own.states)):
                hooks.append(_alone(effect, values, own))
        gathered = tuple(SpeedCurve.total(each, [1.0] * len(each)) for each in curves)
        needed = arm.nominal.torque
        body, p = acting_on.body, acting_on.p
        return cls(body, p, added, gathered, tuple(hooks), needed, tuple(records))

    @property
    def n_joints(self) -> int:
        return self.body.robot.n_joints

    def logged(self, t: Array, tau: Array) -> Array:
        """Return what the log holds of the commands tau (samples, joints)."""
        for record in self.records:
            tau = record(t, tau)
        return tau

    def refuse_unphysical(self, q: Array) -> None:
        """Look at the inertia matrix in the postures q (postures, joints).

        Raises:
            InputRejected: D15, some torque would accelerate the arm against itself, or without
                bound.
        """
        values = np.linalg.eigvalsh(self.body.mass_matrix(q, self.p) + self.added)
        worst = int(np.argmin(values[:, 0] / values[:, -1]))
        if values[worst, 0] <= SIMULATION.singular * values[worst, -1]:
            where = ", ".join(f"{x:.3g}" for x in q[worst])
            words = f"at q = ({where}) the model's inertia matrix is not positive definite, its "
            words += f"smallest eigenvalue {values[worst, 0]:.2g}"
            remedy = "such an arm cannot be simulated: fit it to richer motion, or add the rotors' "
            raise InputRejected("D15", words, remedy=remedy + "inertia")

    def prepared(self, replicas: int) -> MovingPlant:
        return MovingPlant(self, replicas)


def _alone(effect: Effect, values: Values, own: Hooks) -> Hooks:
    """Return the hooks of an effect, its load as a function of its joint where it is one."""
    if own.actuator or own.drive or effect.joint is None:
        return own
    joint, load, memory = effect.joint - 1, effect.own_load(values), effect.own_memory(values)
    if memory is not None:
        return replace(own, load=None, rate=None, remembering=(joint, memory))
    return own if load is None else replace(own, load=None, alone=(joint, load))


def refuse_runaway(state: Array, k: int, sample_time: float) -> None:
    """Refuse a state (2 joints, replicas) that no arm is ever in.

    Raises:
        InputRejected: D17, the simulated arm runs away.
    """
    here = np.abs(state) <= SIMULATION.runaway  # what is not a number is no motion either
    if not here.all():
        joint = int(np.argmax(~here.all(axis=1))) % (len(state) // 2) + 1
        words = f"the simulated arm runs away: joint {joint}, after {k * sample_time:.3g} s"
        remedy = "check the model's inertia and friction, and the gains that the log gives"
        raise InputRejected("D17", words, remedy=remedy)


class MovingPlant:
    """A plant with working memory for a number of replicas. Joints come first, replicas last."""

    def __init__(self, plant: Plant, replicas: int) -> None:
        self.plant, self.replicas = plant, replicas
        self.rigid = bodies_of(plant.body, plant.p, plant.added, replicas)
        self._constant = np.array([curve.constant for curve in plant.curves])[:, None]
        self._viscous = np.array([curve.viscous for curve in plant.curves])[:, None]
        most = max(len(curve.heights) for curve in plant.curves)
        sigmoids = np.zeros((2, most, plant.n_joints, 1))  # a joint with fewer has zeros
        for joint, curve in enumerate(plant.curves):
            sigmoids[:, : len(curve.heights), joint, 0] = curve.heights, curve.sharpnesses
        self._heights, self._sharpnesses = sigmoids
        self.n_states, self._hooked = 0, []
        for hook in plant.hooks:
            own = slice(self.n_states, self.n_states + hook.states)
            self._hooked.append((hook, own))
            self.n_states = own.stop
        self._zeros = np.zeros((replicas, plant.n_joints))

    def _motion(self, t: Array, q: Array, dq: Array, ddq: Array | None = None) -> Motion:
        """Return the state as effects see it, (replicas, joints)."""
        return Motion(t, q.T, dq.T, self._zeros if ddq is None else ddq.T)

    def accelerations(
        self, t: Array, q: Array, dq: Array, states: Array, command: Array, held: Held | None = None
    ) -> tuple[Array, Array]:
        """Return ddq (joints, replicas), and d(states)/dt (replicas, states).

        Args:
            t: (replicas,); states (replicas, states); the rest (joints, replicas).
            held: a rigid body that is taken in place of that of q and dq.
        """
        rates = states
        if self._hooked:
            command, rates = self._through(t, q, dq, states, command)
        left = command - self._viscous * dq - self._constant
        if self._heights.size:  # Σ height tanh(sharpness v)
            bent = self._sharpnesses * dq
            np.tanh(bent, out=bent)
            bent *= self._heights
            left -= np.add.reduce(bent, axis=0)
        inverse, bias = self.rigid.hold(q, dq) if held is None else held
        return gained(inverse, left - bias), rates

    def _through(
        self, t: Array, q: Array, dq: Array, states: Array, command: Array
    ) -> tuple[Array, Array]:
        """Return what comes of `command` at the rigid body, and d(states)/dt.

        Each effect acts around those before it: a command meets the last one first.
        """
        rates, torque = np.zeros_like(states), command.copy()
        motion = self._motion(t, q, dq)
        for hook, own in reversed(self._hooked):
            if hook.rate is not None:
                rates[:, own] = hook.rate(motion, torque.T, states[:, own])
            torque = _driven(hook, own, motion, dq, states, torque)
        for hook, own in self._hooked:
            if hook.alone is not None:
                joint, load = hook.alone
                torque[joint] -= load(q[joint], dq[joint], ARRAYS)
            if hook.remembering is not None:
                joint, memory = hook.remembering
                bent = states[:, own.start]
                rates[:, own.start] = rate = memory.rate(bent, dq[joint], ARRAYS)
                torque[joint] -= memory.load(bent, rate)
            if hook.load is not None:
                torque -= hook.load(motion, states[:, own]).T
        return torque, rates

    def updated(self, t: Array, q: Array, dq: Array, states: Array, command: Array) -> Array:
        """Return the states (replicas, states) after a control sample was taken."""
        if not self.n_states:
            return states
        out, motion, torque = states.copy(), self._motion(t, q, dq), command.copy()
        for hook, own in reversed(self._hooked):
            if hook.update:
                out[:, own] = hook.update(motion, torque.T, states[:, own])
            torque = _driven(hook, own, motion, dq, states, torque)
        return out

    def begin(
        self, t: Array, q: Array, dq: Array, ddq: Array | None = None, since: Array | None = None
    ) -> tuple[Array, Array]:
        """Return the true state (2 joints, replicas) when the encoders first tell q, dq, ddq.

        And the states (replicas, states) then, of memories that count from `since` on, or from t.
        """
        motion = self._motion(t, q, dq, ddq)
        for hook, _ in reversed(self._hooked):
            if hook.settled:
                motion = hook.settled(motion, self.plant.needed(motion))
        state, states = np.vstack([motion.q.T, motion.dq.T]), np.zeros((len(t), self.n_states))
        begun = self._motion(t if since is None else since, motion.q.T, motion.dq.T, ddq)
        for hook, own in self._hooked:
            if hook.start:
                states[:, own] = hook.start(begun, self.plant.needed(begun))
        return np.ascontiguousarray(state), states

    def measured(self, q: Array, states: Array) -> Array:
        """Return what the encoders see of q (joints, replicas), before they count it."""
        seen = q.T
        for hook, own in self._hooked:
            if hook.sensor:
                seen = hook.sensor(seen, states[:, own])
        return seen.T


def _driven(
    hook: Hooks, own: slice, motion: Motion, dq: Array, states: Array, torque: Array
) -> Array:
    """Return what an effect makes of a torque (joints, replicas) on its way to the joints."""
    if hook.drive is not None:
        joint, drive = hook.drive
        torque[joint] = drive(torque, dq, ARRAYS)
    elif hook.actuator is not None:
        torque = np.array(hook.actuator(torque.T, motion, states[:, own]).T)
    return torque
