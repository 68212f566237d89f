"""The base parameters of any serial arm: the combinations of link parameters that torque can show.

Which show only in combination is found on random states, by a QR factorisation that takes columns
in a fixed order of preference and passes over those that depend on the ones taken (Gautier 1991,
the pivot by preference, not by size: rounding then cannot change the set).

    Y = [Y_b  Y_b C]    and so    Y φ = Y_b (φ_b + C φ_d) = Y_b p
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pipelines.dynamics import chain as serial
from pipelines.dynamics.body import (
    BaseParameter,
    RigidBody,
    refuse_other_length,
    refuse_other_shapes,
)
from pipelines.dynamics.kinematics import SerialChain, serial_chain, tip_position
from pipelines.io.log import Array
from pipelines.io.robot import RobotDescription

__all__ = ["BaseArm", "BaseSet", "base_set"]

_SEED = 20040509  # numerics: of the random states
# Enough that chance cannot make columns look dependent.
_SPARE = 6  # numerics: rows of torque for each column
# A column whose part outside the span of those before it is smaller than this share of it is
# dependent. Rounding leaves 1e-14; angles written with twelve digits ("1.57079632679") leave 5e-12;
# a link as short as 0.1 mm leaves 1e-5.
_DEPENDENT = 1e-8  # numerics: share of a column, far from either
_NO_COEFFICIENT = 1e-9  # numerics: rounding
# No square or product of round lengths, so that rounding cannot tip it.
_WORTH_WRITING = 3e-8  # numerics: smallest coefficient that is written
_UNITS = ("kg", "kg m", "kg m", "kg m") + 6 * ("kg m^2",)


@dataclass(frozen=True, eq=False)
class BaseSet:
    """The standard parameters that represent the base set, and their combinations."""

    # increasing indices of standard parameters, 10 · link + position in STANDARD
    chosen: tuple[int, ...]
    combine: Array  # (base, 10 · joints): p = combine φ

    @property
    def parameters(self) -> tuple[BaseParameter, ...]:
        return tuple(BaseParameter(_name(k), _UNITS[k % 10], _combination(k, row))
                     for k, row in zip(self.chosen, self.combine, strict=True))


def base_set(chain: SerialChain, rng: np.random.Generator) -> BaseSet:
    """Return the base parameter set of `chain`.

    States fill the whole circle, beyond limits too: torque is analytic in the state.
    """
    n = chain.n_joints
    samples = _SPARE * 10
    turning = np.array(chain.revolute)
    q = rng.uniform(-1.0, 1.0, (samples, n)) * np.where(turning, np.pi, 1.0)
    dq, ddq = rng.uniform(-2.0, 2.0, (samples, n)), rng.uniform(-10.0, 10.0, (samples, n))
    y = serial.regressor(chain, q, dq, ddq).reshape(samples * n, 10 * n)
    scale = np.linalg.norm(y, axis=0)
    seen = scale > _DEPENDENT * scale.max()
    scale = np.where(seen, scale, 1.0)
    y = np.where(seen, y / scale, 0.0)  # equilibrated: a rank test compares like with like
    chosen = np.array(sorted(_independent(y, _preference(chain))), dtype=int)
    combine = np.linalg.lstsq(y[:, chosen], y, rcond=None)[0] * scale / scale[chosen, None]
    combine[np.abs(combine) < _NO_COEFFICIENT] = 0.0
    combine[:, chosen] = np.eye(len(chosen))
    return BaseSet(tuple(int(k) for k in chosen), combine)


def _preference(chain: SerialChain) -> list[int]:
    """Return standard parameters, those that a joint shows first, of the last link first.

    Mass on a revolute joint's axis can be moved to the link before it: the mass, the first moment
    along the axis and one of the moments across it come last (Gautier & Khalil 1990). Behind a
    prismatic joint it is all six moments.
    """
    first: list[int] = []
    last: list[int] = []
    for i in reversed(range(chain.n_joints)):
        if chain.revolute[i]:
            # which axis of the link's frame it is
            along = int(np.argmax(np.abs(chain.after[i].rotation.T[:, 2])))
            x, y = (along + 1) % 3, (along + 2) % 3
            keep = [4 + along, 4 + x, 7, 8, 9, 1 + min(x, y), 1 + max(x, y)]
        else:
            keep = [0, 1, 2, 3]
        first += [10 * i + k for k in keep]
        last += [10 * i + k for k in range(10) if k not in keep]
    return first + last


def _independent(y: Array, order: Sequence[int]) -> list[int]:
    """Return the columns of y (rows, columns) that do not depend on those before them in `order`.
    """
    basis = np.empty(y.shape)
    kept: list[int] = []
    for k in order:
        rest = y[:, k].copy()
        span = basis[:, :len(kept)]
        for _ in range(
                2
        ):  # once more, for orthogonality to rounding: "twice is enough" (Kahan; Parlett 1980)
            rest -= span @ (span.T @ rest)
        size = float(np.linalg.norm(rest))
        if size > _DEPENDENT:
            basis[:, len(kept)] = rest / size
            kept.append(k)
    return kept


def _name(k: int) -> str:
    return f"{serial.STANDARD[k % 10]}{k // 10 + 1}"


def _combination(leading: int, row: Array) -> str:
    """For example "Ixx2 - Iyy2 + 0.0506 m3": the leading parameter first, the others in order."""
    words = [_name(leading)]
    for k in np.flatnonzero(np.abs(row) > _WORTH_WRITING):
        if k != leading:
            # rounded twice: 0.1505² = 0.02265025 would else become …502 or …503 by the luck of the
            # last bit
            size = f"{round(float(abs(row[k])), 10):.6g}"
            words.append(
                f"{'-' if row[k] < 0.0 else '+'} {'' if size == '1' else size + ' '}{_name(int(k))}"
            )
    return " ".join(words)


class BaseArm(RigidBody):
    """Any serial arm in its base parameters; `chain` replaces that of the description."""

    def __init__(self, robot: RobotDescription, chain: SerialChain | None = None) -> None:
        self.robot = robot
        self.chain = chain or serial_chain(robot)
        self.base = base_set(self.chain, np.random.default_rng(_SEED))
        self.parameters = self.base.parameters

    @property
    def combine(self) -> Array:
        return self.base.combine

    @cached_property
    def links_behind(self) -> Array:
        """(10 · joints, parameters): standard parameters with the torques of p, else zero."""
        return np.eye(10 * self.chain.n_joints)[:, list(self.base.chosen)]

    def regressor(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Y (samples, joints, parameters), stored with samples fastest."""
        self._check(q=q, dq=dq, ddq=ddq)
        return serial.regressor(self.chain, q, dq, ddq, self.base.chosen)

    def standard(self, p: Array) -> Array:
        """Return standard parameters (joints * 10,) with the torques of p, else zero."""
        return np.asarray(self.links_behind @ p)

    def torque(self, q: Array, dq: Array, ddq: Array, p: Array) -> Array:
        """τ = Y p (samples, joints) [N m], by the recursion, without forming Y."""
        self._check(p, q=q, dq=dq, ddq=ddq)
        return serial.inverse_dynamics(self.chain, q, dq, ddq, self.standard(p))

    def mass_matrix(self, q: Array, p: Array) -> Array:
        """D(q) (samples, joints, joints) [kg m^2]."""
        self._check(p, q=q)
        return serial.mass_matrix(self.chain, q, self.standard(p))

    def tip(self, q: Array) -> Array:
        """Tip (samples, 3) [m] in the base frame."""
        self._check(q=q)
        return tip_position(self.chain, q)

    def _check(self, p: Array | None = None, **states: Array) -> None:
        refuse_other_shapes(self.chain.n_joints, **states)
        if p is not None:
            refuse_other_length(len(self.parameters), p)
