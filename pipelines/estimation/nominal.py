"""Describe the nominal model of an arm: its columns, and the arm that an estimate gives."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.body import Motion, RigidBody
from pipelines.dynamics.parameter import Parameter, Uncertainty
from pipelines.dynamics.rrr import rigid_body
from pipelines.effects import find_effect
from pipelines.effects.base import Effect, FrictionLaw, everywhere
from pipelines.errors import UsageError
from pipelines.estimation.estimate import Estimate
from pipelines.estimation.regression import Columns
from pipelines.io.log import Array
from pipelines.io.robot import RobotDescription

_SEED, _STATES = 20040509, 400  # numerics
_ABSORBED = 1e-6  # numerics: share of a column outside the rigid body: below it, rounding
_PERSONS = ("Coulomb", "Stribeck")
_SYMMETRIC = ("p4", "p15")  # zero with mirror symmetric links (Kostić et al. 2004, Sec. IV.C.5)


def nominal_columns(
    robot: RobotDescription,
    *,
    friction: bool = True,
    offset: bool = True,
    rotor_inertia: bool | None = None,
    symmetric: bool = False,
) -> Columns:
    """Return base parameters, and at every joint Coulomb and viscous friction, an offset, and a
    geared rotor's inertia.

    Rotor inertia that the rigid body shows already (the first joints' of most arms) has no column.

    Args:
        rotor_inertia: None: where a drive with a gear is described.

    Raises:
        UsageError: C02, symmetric links of an arm whose parameters are not those of the paper.
    """
    body = rigid_body(robot)
    if symmetric and not {p.name for p in body.parameters}.issuperset(_SYMMETRIC):
        raise UsageError("C02", "only the RRR arm has p4 and p15", "--symmetric", "leave it out")
    names = ["coulomb", "viscous"] if friction else []
    names += ["torque_offset"] if offset else []
    laws = [law for name in names for law in everywhere(find_effect(name), robot.revolute)]
    symmetry = _SYMMETRIC if symmetric else ()
    kept = tuple(i for i, p in enumerate(body.parameters) if p.name not in symmetry)
    base = (Parameter(p.name, 0.0, None, p.unit, origin="assumed") for p in body.parameters)
    arm = Arm(robot.name, body, tuple(base))
    if rotor_inertia is None:
        matrix = robot.drive.transmission if robot.drive else None
        rotor_inertia = matrix is not None and np.abs(np.diag(np.array(matrix))).max() > 1.5
    if rotor_inertia:
        laws += _outside(body, everywhere(find_effect("rotor_inertia"), robot.revolute), arm)
    order = {name: k for k, name in enumerate(names)}
    laws.sort(key=lambda law: (law.joint or 0, order.get(law.name, 9)))
    return Columns(body, kept, tuple(laws), arm)


def _outside(body: RigidBody, effects: Sequence[Effect], arm: Arm) -> list[Effect]:
    """Return the effects whose columns the rigid body's do not contain, on random states."""
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


def with_offsets(columns: Columns) -> Columns:
    """Return the columns with a torque offset at every joint."""
    offsets = everywhere(find_effect("torque_offset"), columns.body.robot.revolute)
    laws = {(law.name, law.joint): law for law in (*columns.laws, *offsets)}
    return replace(columns, laws=tuple(laws.values()))


def arm_of(
    columns: Columns,
    beta: Array,
    name: str = "nominal",
    std: Sequence[float | None] | None = None,
    visible: Sequence[bool] | None = None,
    friction: Sequence[Acting] = (),
) -> Arm:
    """Return the arm of numbers `beta`: friction laws as friction, the rest of the laws as effects.

    Args:
        std, visible: of each number; None: not known, and all visible.
        friction: of a given model, beside the laws of the columns.
    """
    body, revolute = columns.body, columns.body.robot.revolute
    std = [None] * len(beta) if std is None else std
    visible = [True] * len(beta) if visible is None else visible
    place = {i: k for k, i in enumerate(columns.kept)}
    base = []
    for i, p in enumerate(body.parameters):
        if (k := place.get(i)) is None:
            base.append(Parameter(p.name, 0.0, None, p.unit, origin="assumed"))
        else:
            value, seen = float(beta[k]), bool(visible[k])
            base.append(Parameter(p.name, value, std[k], p.unit, origin="fitted", visible=seen))
    laws, effects = list(friction), list[Acting]()
    for law, part in zip(columns.laws, columns.parts, strict=True):
        amplitudes = (q.name for q in law.parameters if not q.shape)
        known = {n: s for n, s in zip(amplitudes, std[part], strict=True) if s is not None}
        turns = law.joint is None or revolute[law.joint - 1]
        acting = Acting.of(law, law.values(beta[part]), known, revolute=turns)
        (laws if isinstance(law, FrictionLaw) else effects).append(acting)
    return Arm(name, body, tuple(base), tuple(laws), tuple(effects))


def fitted_arm(found: Estimate, name: str, friction: Sequence[Acting] = ()) -> Arm:
    """Return the arm of an estimate, with the covariance of its numbers.

    What the logs do not determine has no standard deviation; its value is the smallest that
    explains them, and predicts the torque of motions like theirs.

    Args:
        friction: of a given model, where the fit took it as known.
    """
    columns = found.columns
    pairs = zip(found.std.tolist(), found.trusted, strict=True)
    std = [s if sure else None for s, sure in pairs]
    arm = arm_of(columns, found.beta, name, std, found.visible.tolist(), friction)
    names = tuple(column.name for column in columns.names)
    return replace(arm, uncertainty=Uncertainty(names, found.robust.covariance))


def plain_number(value: float, digits: int = 2) -> str:
    """Return `value` with so many significant digits and no power of ten: 120, 0.00021."""
    rounded = float(f"{value:.{digits - 1}e}")
    return np.format_float_positional(rounded, trim="-")


def within(words: str) -> str:
    """Return a title or a sentence as a part of another, without capital and full stop."""
    lowered = words if words.startswith(_PERSONS) else words[:1].lower() + words[1:]
    return lowered.rstrip(".")


def column_in_words(name: str) -> str:
    """Return "viscous friction at joint 2" for "viscous:2:coefficient"; "p3" stays.

    An effect with several numbers says which: "backlash at joint 2 (gap)".
    """
    cause, *rest = name.split(":")
    if not rest:
        return name
    effect = find_effect(cause)
    title = within(effect.words.title)
    words = f"{title} at joint {rest[0]}" if len(rest) > 1 else title
    alone = sum(not q.shape for q in effect.parameters) == 1
    return words if alone else f"{words} ({rest[-1].replace('_', ' ')})"


def columns_in_words(names: Iterable[str]) -> dict[str, str]:
    """Return the words of each of `names`."""
    return {name: column_in_words(name) for name in names}
