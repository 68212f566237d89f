"""The complete model for one sample, in plain numbers: what a controller computes while the arm moves.

    model = OnlineModel(arm)
    friction, inertia, coriolis, gravity = model.parts(q, dq, ddq)      lists of `n` floats
    tau = model.torque(q, dq, ddq)                                      with what the accepted effects add
    tau = model.inertia_times(q, r)                                     D(q) r, for computed torque, eq. (25)

Kostić et al. 2004, eq. (8), (10), Section IV.C.5: the model reconstructs the torque as the experiment is in progress. `Arm` is
made for many samples at once and takes a hundred times as long for one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import tanh
from typing import NamedTuple, Protocol

import numpy as np

from pipelines.model.arm import Acting, Arm
from pipelines.model.effects.base import Effect, Hooks, SpeedCurve
from pipelines.model.effects.fast import speed_curve
from pipelines.model.rigid.base import BaseArm
from pipelines.model.rigid.body import Array, Motion, RigidBody
from pipelines.model.rigid.chain_online import ChainOnline
from pipelines.model.rigid.rrr import RRR
from pipelines.model.rigid.rrr_online import RRROnline

__all__ = ["OnlineModel", "OnlineTorque"]

Numbers = list[float]
_Curve = Callable[[float], float]  # speed of a joint [rad/s] -> its torque [N m]


class OnlineTorque(NamedTuple):
    """The torque of the model for one sample, split. Each (joints,) [N m]."""

    friction: Numbers
    inertia: Numbers
    coriolis: Numbers
    gravity: Numbers


class _Rigid(Protocol):
    def parts(self, q: Sequence[float], dq: Sequence[float], ddq: Sequence[float]) -> tuple[Numbers, Numbers, Numbers]: ...

    def inertia_times(self, q: Sequence[float], r: Sequence[float]) -> Numbers: ...


class OnlineModel:
    """An arm's model, one sample at a time.

    What depends on speed alone (`speed_curve`) or adds to D(q) (`Hooks.inertia`) is computed in plain numbers; for
    anything else the arm itself is asked with one row. An effect that needs more than the moment, a delay or a state, then
    sees a motion of one sample.
    """

    def __init__(self, arm: Arm) -> None:
        self.n_joints = arm.n_joints
        self._rigid = _rigid(arm.body, arm.p)
        self._friction = _Sum(arm.friction, arm)
        additive = all(type(acting.effect).apply is Effect.apply for acting in arm.effects)
        self._effects = _Sum(arm.effects if additive else (), arm)
        self._arm = None if additive else arm  # an effect acts around those before it: one that is not additive takes all along

    def parts(self, q: Sequence[float], dq: Sequence[float], ddq: Sequence[float]) -> OnlineTorque:
        """Friction, inertial, Coriolis and gravity torque of one sample; accepted effects are apart (`effects`)."""
        return OnlineTorque(self._friction(q, dq, ddq), *self._rigid.parts(q, dq, ddq))

    def effects(self, q: Sequence[float], dq: Sequence[float], ddq: Sequence[float]) -> Numbers:
        """What the accepted effects add (joints,) [N m]."""
        if self._arm is None:
            return self._effects(q, dq, ddq)
        added: Numbers = self._arm.torque_parts(_one_row(q, dq, ddq)).effects[0].tolist()
        return added

    def torque(self, q: Sequence[float], dq: Sequence[float], ddq: Sequence[float]) -> Numbers:
        """The torque of the complete model (joints,) [N m]."""
        return [sum(one) for one in zip(*self.parts(q, dq, ddq), self.effects(q, dq, ddq), strict=True)]

    def inertia_times(self, q: Sequence[float], r: Sequence[float]) -> Numbers:
        """D(q) r (joints,) [N m] for r [rad/s^2], with what the effects add to D(q)."""
        product = self._rigid.inertia_times(q, r)
        return [a + b for a, b in zip(product, self._effects.inertia_times(r), strict=True)] if self._effects.added else product


class _Sum:
    """Effects whose torques add up, one sample at a time."""

    def __init__(self, acting: Sequence[Acting], arm: Arm) -> None:
        self._zero = [0.0] * arm.n_joints
        self._curves: list[tuple[int, _Curve]] = []  # with their joints, counted from 0
        added = np.zeros((arm.n_joints, arm.n_joints))
        rest = []
        for one in acting:
            effect = one.effect.at(one.values)
            if effect.joint is not None and (curve := speed_curve(effect, one.values)) is not None:
                self._curves.append((effect.joint - 1, _curve(curve)))
            elif (inertia := _only_inertia(effect.simulate(arm, one.values))) is not None:
                added += inertia
            else:
                rest.append(one)
        self.added: list[list[float]] = added.tolist() if added.any() else []
        # A sum is what the friction of an arm is, so that it stands in for what has no plain numbers.
        self._rest = Arm(arm.name, arm.body, arm.base, tuple(rest)) if rest else None

    def __call__(self, q: Sequence[float], dq: Sequence[float], ddq: Sequence[float]) -> Numbers:
        torque = self.inertia_times(ddq) if self.added else self._zero.copy()
        for j, curve in self._curves:
            torque[j] += curve(dq[j])
        if self._rest is None:
            return torque
        return [a + b for a, b in zip(torque, self._rest.friction_torque(_one_row(q, dq, ddq))[0].tolist(), strict=True)]

    def inertia_times(self, r: Sequence[float]) -> Numbers:
        return [sum(map(float.__mul__, row, r)) for row in self.added]


def _curve(form: SpeedCurve) -> _Curve:
    """τ(v) = constant + viscous v + Σ height tanh(sharpness v), without a loop where there are one or three of them."""
    constant, viscous = form.constant, form.viscous
    pairs = tuple((float(f), float(w)) for f, w in zip(form.heights, form.sharpnesses, strict=True))
    if len(pairs) == 3:
        (f1, w1), (f2, w2), (f3, w3) = pairs
        return lambda v: constant + viscous * v + f1 * tanh(w1 * v) + f2 * tanh(w2 * v) + f3 * tanh(w3 * v)
    if len(pairs) == 1:
        (f, w), = pairs
        return lambda v: constant + viscous * v + f * tanh(w * v)
    return lambda v: constant + viscous * v + sum([f * tanh(w * v) for f, w in pairs])


def _only_inertia(hooks: Hooks) -> Array | None:
    """What is added to D(q) (joints, joints), where an effect does nothing else."""
    others = (hooks.load, hooks.actuator, hooks.sensor, hooks.arm, hooks.rate, hooks.update)
    return hooks.inertia if all(hook is None for hook in others) else None


def _rigid(body: RigidBody, p: Array) -> _Rigid:
    if isinstance(body, RRR):
        return RRROnline(body, p)
    if isinstance(body, BaseArm):
        return ChainOnline(body.chain, body.standard(p))
    return _RowByRow(body, p)


class _RowByRow:
    """Any other rigid body: its own equations on one row."""

    def __init__(self, body: RigidBody, p: Array) -> None:
        self._body, self._p = body, p

    def parts(self, q: Sequence[float], dq: Sequence[float], ddq: Sequence[float]) -> tuple[Numbers, Numbers, Numbers]:
        row = _one_row(q, dq, ddq)
        parts = self._body.torque_parts(row.q, row.dq, row.ddq, self._p)
        return parts.inertia[0].tolist(), parts.coriolis[0].tolist(), parts.gravity[0].tolist()

    def inertia_times(self, q: Sequence[float], r: Sequence[float]) -> Numbers:
        product: Numbers = (self._body.mass_matrix(np.array([q]), self._p)[0] @ np.array(r)).tolist()
        return product


def _one_row(q: Sequence[float], dq: Sequence[float], ddq: Sequence[float]) -> Motion:
    return Motion(np.zeros(1), np.array([q], dtype=float), np.array([dq], dtype=float), np.array([ddq], dtype=float))
