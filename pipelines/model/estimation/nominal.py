"""The nominal model of an arm: which columns its equations have before anything is suspected of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.body import Motion, RigidBody
from pipelines.dynamics.parameter import Parameter, Uncertainty
from pipelines.dynamics.rrr import rigid_body
from pipelines.effects import find_effect
from pipelines.effects.base import Effect, FrictionLaw, everywhere
from pipelines.errors import UsageError
from pipelines.io.robot import RobotDescription
from pipelines.model.estimation.estimate import Estimate
from pipelines.model.estimation.regression import Columns

__all__ = ["fitted_arm", "geared", "nominal_columns", "with_offsets"]

_SEED = 20040509
_STATES = 400
_ABSORBED = 1e-6  # share of a column that the rigid body leaves: below it, rounding
_SYMMETRIC = ("p4", "p15")  # zero where the arm's links are mirror symmetric (Kostić et al. 2004, Section IV.C.5)


def geared(robot: RobotDescription) -> bool:
    """Return whether a drive with a gear is described: its rotor's inertia then shows at the joint."""
    matrix = robot.drive.transmission if robot.drive else None
    return matrix is not None and bool(np.abs(np.diag(np.array(matrix))).max() > 1.5)


def nominal_columns(robot: RobotDescription, *, friction: bool = True, offset: bool = True, rotor_inertia: bool | None = None,
                    symmetric: bool = False) -> Columns:
    """Base parameters, and at every joint Coulomb and viscous friction, an offset, and a geared rotor's inertia.

    Rotor inertia that the rigid body shows already (the first joints' of most arms) has no column of its own.

    Raises:
        UsageError: C02, symmetric links of an arm whose parameters are not those of the paper.
    """
    body = rigid_body(robot)
    if symmetric and not {p.name for p in body.parameters}.issuperset(_SYMMETRIC):
        raise UsageError("C02", "only the RRR arm has p4 and p15", where="--symmetric", remedy="leave it out")
    names = [name for name, wanted in (("coulomb", friction), ("viscous", friction), ("torque_offset", offset)) if wanted]
    laws = [effect for name in names for effect in everywhere(find_effect(name), robot.revolute)]
    kept = tuple(i for i, p in enumerate(body.parameters) if not (symmetric and p.name in _SYMMETRIC))
    arm = Arm(robot.name, body, tuple(Parameter(p.name, 0.0, None, p.unit, origin="assumed") for p in body.parameters))
    if geared(robot) if rotor_inertia is None else rotor_inertia:
        laws += _seen_beside(body, everywhere(find_effect("rotor_inertia"), robot.revolute), arm)
    return Columns(body, kept, tuple(sorted(laws, key=lambda law: (law.joint or 0,
                                                                   names.index(law.name) if law.name in names else 9))),
                   arm)


def _seen_beside(body: RigidBody, effects: Sequence[Effect], arm: Arm) -> list[Effect]:
    """Those of `effects` whose columns the rigid body's do not contain, on random states."""
    rng, n = np.random.default_rng(_SEED), body.robot.n_joints
    q, dq, ddq = (rng.uniform(-scale, scale, (_STATES, n)) for scale in (np.pi, 2.0, 10.0))
    rigid = body.regressor(q, dq, ddq).reshape(_STATES * n, -1)
    basis, _ = np.linalg.qr(rigid / np.linalg.norm(rigid, axis=0))
    motion = Motion(np.asarray(np.linspace(0.0, 1.0, _STATES), dtype=np.float64), q, dq, ddq)
    seen: list[Effect] = []
    for effect in effects:
        column = effect.columns(motion, arm).reshape(_STATES * n)
        rest = column - basis @ (basis.T @ column)
        if np.linalg.norm(rest) > _ABSORBED * np.linalg.norm(column):
            seen.append(effect)
    return seen


def fitted_arm(found: Estimate, name: str, friction: Sequence[Acting] = ()) -> Arm:
    """The arm that an estimate describes: friction laws as friction, the rest of the laws as effects.

    What the logs do not determine has no standard deviation; its value is the smallest that explains them, and predicts the
    torque of motions like theirs.

    Args:
        friction: of a given model, where the fit took it as known.
    """
    columns, beta, visible = found.columns, found.beta, found.visible
    std = [float(s) if sure else None for s, sure in zip(found.std, found.trusted, strict=True)]
    body, base = columns.body, []
    place = {i: k for k, i in enumerate(columns.kept)}
    for i, known in enumerate(body.parameters):
        k = place.get(i)
        base.append(Parameter(known.name, 0.0, None, known.unit, origin="assumed") if k is None else
                    Parameter(known.name, float(beta[k]), std[k], known.unit, origin="fitted", visible=bool(visible[k])))
    laws: list[Acting] = list(friction)
    effects: list[Acting] = []
    first = len(columns.kept)
    turning = body.robot.revolute
    for law in columns.laws:
        amplitudes = [q for q in law.parameters if not q.shape]
        part = slice(first, first + len(amplitudes))
        first += len(amplitudes)
        known_std = {q.name: s for q, s in zip(amplitudes, std[part], strict=True) if s is not None}
        acting = Acting.of(law, law.values(beta[part]), known_std, revolute=law.joint is None or turning[law.joint - 1])
        (laws if isinstance(law, FrictionLaw) else effects).append(acting)
    together = Uncertainty(tuple(column.name for column in columns.names), found.robust.covariance)
    return Arm(name, body, tuple(base), tuple(laws), tuple(effects), together)


def with_offsets(columns: Columns) -> Columns:
    """Return the columns with a torque offset at every joint."""
    offsets = everywhere(find_effect("torque_offset"), columns.body.robot.revolute)
    laws = {(law.name, law.joint): law for law in (*columns.laws, *offsets)}
    return replace(columns, laws=tuple(laws.values()))
