"""Describe the nominal model of an arm, and fit it to rows: rigid body and friction.

    columns = nominal_columns(robot)                rigid body, friction laws at every joint
    columns, fit = fit_nominal(data, columns)       shapes of the friction laws included
    fit.residual, fit.project(columns)              the residual, and that of other columns

Kostić et al. 2004, eq. (12)-(15), joints weighted by their residual.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.body import Motion, RigidBody
from pipelines.dynamics.parameter import Parameter, Uncertainty
from pipelines.dynamics.rrr import rigid_body
from pipelines.effects import find_effect
from pipelines.effects.base import ArmModel, Effect, FrictionLaw, everywhere, plainer
from pipelines.errors import UsageError
from pipelines.estimation.estimate import Estimate
from pipelines.estimation.regression import Columns
from pipelines.io.log import Array
from pipelines.io.robot import RobotDescription

if TYPE_CHECKING:
    from pipelines.estimation.rows import Data

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


_RANK = 1e-12  # numerics: of the largest eigenvalue of the Gram matrix of unit columns
_ROUNDS = 6  # numerics: of weights
_SETTLED = 1e-3  # numerics: of a weight
_STEPS = 6  # numerics: of Gauss-Newton
_FINE = 1e-3  # numerics: of ln shape, where it ends
_FARTHEST = 0.3  # numerics: of the same, in a step
_STEP = 0.01  # numerics: of a difference


@dataclass(frozen=True, eq=False)
class Fit:
    """Columns fitted to torque, joints weighted by their residual."""

    data: Data
    table: Array  # (k, rows) columns, unweighted
    y: Array  # (rows,) torque
    weight: Array  # (joints,) [1/(N m)]
    beta: Array  # (k,)

    @cached_property
    def weights(self) -> Array:
        """(rows,) of every row."""
        return np.asarray(self.weight[self.data.joint])

    @cached_property
    def basis(self) -> Array:
        """(rank, rows) orthonormal rows that span the weighted columns."""
        return _orthonormal(self.table * self.weights)

    @cached_property
    def residual(self) -> Array:
        """(rows,) weighted."""
        return self.project(self.y)

    @cached_property
    def left(self) -> Array:
        """(rows,) [N m] unweighted."""
        return np.asarray(self.residual / self.weights)

    @property
    def rms(self) -> Array:
        """(joints,) [N m]."""
        return self.data.rms(self.left)

    def project(self, columns: Array) -> Array:
        """Return columns (…, rows), weighted, less what the fit can imitate of them."""
        weighted = columns * self.weights
        return np.asarray(weighted - (weighted @ self.basis.T) @ self.basis)


def _orthonormal(table: Array) -> Array:
    """Return orthonormal rows (rank, n) that span those of `table`: by the Gram matrix, twice."""
    norm = np.linalg.norm(table, axis=1)
    basis: Array = table[norm > 0.0] / norm[norm > 0.0, None]
    for rank in (_RANK, 0.0):
        if len(basis):
            values, vectors = np.linalg.eigh(basis @ basis.T)
            keep = values > rank * values[-1]
            basis = (vectors[:, keep] / np.sqrt(values[keep])).T @ basis
    return basis


def fit_columns(data: Data, table: Array) -> Fit:
    """Solve least squares with joints weighted by their own residual, found in turns."""
    y, joints = data.y, [data.joint == j for j in range(data.n_joints)]
    scale = np.linalg.norm(table, axis=1)
    scale = np.where(scale > 0.0, scale, 1.0)
    unit = table / scale[:, None]
    grams = np.array([unit[:, own] @ unit[:, own].T for own in joints])
    moments = np.array([unit[:, own] @ y[own] for own in joints])
    powers = np.array([y[own] @ y[own] for own in joints])
    counts = np.maximum(np.bincount(data.joint[data.counts], minlength=data.n_joints), 1)
    weight, before = np.ones(data.n_joints), np.full(data.n_joints, np.inf)
    for left in reversed(range(_ROUNDS + 1)):
        gram = np.tensordot(weight**2, grams, 1)
        size = np.sqrt(np.diag(gram))
        size = np.where(size > 0.0, size, np.inf)  # a column of zeros has the number 0
        values, vectors = np.linalg.eigh(gram / size / size[:, None])
        keep = values > _RANK * values[-1]
        projected = vectors[:, keep].T @ (weight**2 @ moments / size)
        beta = (vectors[:, keep] / values[keep]) @ projected / size
        if not left or np.abs(weight / before - 1.0).max() < _SETTLED:
            break
        rss = powers - 2.0 * moments @ beta + grams @ beta @ beta
        sigma = np.sqrt(np.maximum(rss, 1e-12 * powers) / counts)
        before, weight = weight, 1.0 / np.maximum(sigma, 1e-12 * (sigma.max() or 1.0))
    return Fit(data, table, y, weight, np.asarray(beta / scale))


def rows_of(data: Data, columns: Columns) -> Array:
    """(k, rows) of the rigid body and every law."""
    laws = (effect_rows(data, law, columns.arm) for law in columns.laws)
    return np.concatenate([rigid_rows(data, columns), *laws])


def rigid_rows(data: Data, columns: Columns, times: Array | None = None) -> Array:
    """(k, rows), or (rows,) [N m] with the numbers `times`."""
    body, kept = columns.body, list(columns.kept)
    key = (body, columns.kept)
    return data.lay_kept(key, lambda m: body.regressor(m.q, m.dq, m.ddq)[:, :, kept], times)


def effect_rows(data: Data, effect: Effect, arm: ArmModel, times: Array | None = None) -> Array:
    """(k, rows) columns of an effect in one shape, or (rows,) [N m] with amplitudes `times`."""
    if effect.from_motion:
        return data.lay_kept(effect, lambda motion: effect.columns(motion, arm), times)
    columns = data.lay(lambda motion: effect.columns(motion, arm))
    return columns if times is None else np.asarray(times @ columns)


def several_rows(data: Data, shapes: Sequence[Effect], arm: ArmModel) -> list[Array]:
    """Return the columns (k, rows) of several shapes of an effect."""
    if not shapes or shapes[0].from_motion:
        return [effect_rows(data, shape, arm) for shape in shapes]
    several = shapes[0].several
    laid = data.lay(lambda motion: np.concatenate(several(shapes, motion, arm), axis=2))
    return np.split(laid, len(shapes))


def fit_nominal(data: Data, columns: Columns) -> tuple[Columns, Fit]:
    """Return the nominal model with the shapes of its laws found, and its fit.

    The last columns of the fit are the slopes of its torque by those shapes: a torque orthogonal
    to the fit cannot be imitated by moving them a little, and a law a hundredth too blunt would
    look like a second one at low speed. Shapes by Gauss-Newton, Golub & Pereyra 2003: each step
    solves for shapes and amplitudes together.
    """
    rigid, laws = rigid_rows(data, columns), list(columns.laws)
    tables = [effect_rows(data, law, columns.arm) for law in laws]
    fit = fit_columns(data, np.concatenate([rigid, *tables]))
    for place, law in enumerate(laws):
        if _free(law):
            others = (t for k, t in enumerate(tables) if k != place)
            rest = replace(fit, table=np.concatenate([rigid, *others]))
            laws[place], tables[place] = _best_of_grid(data, law, columns, rest)
    fit = fit_columns(data, np.concatenate([rigid, *tables]))
    columns = replace(columns, laws=tuple(laws))
    for _ in range(_STEPS):
        slopes, names = law_slopes(data, columns, fit.beta)
        fit = fit_columns(data, np.concatenate([rows_of(data, columns), *slopes]))
        shift = np.clip(fit.beta[len(columns.names) :], -_FARTHEST, _FARTHEST)
        if not len(shift) or np.abs(shift).max() < _FINE:
            break
        laws = list(columns.laws)
        for (place, name), by in zip(names, shift, strict=True):
            laws[place] = _times(laws[place], name, float(np.exp(by)))
        columns = replace(columns, laws=tuple(laws))
    return columns, fit


def _free(law: Effect) -> list[str]:
    return [q.name for q in law.parameters if q.name in law.free and q.low > 0.0]


def with_shape(effect: Effect, name: str, value: float) -> Effect:
    """Return the effect with one shape changed, as far as its range allows."""
    shape: dict[str, Any] = {name: effect.within(name, value)}
    return replace(effect, **shape)


def _times(law: Effect, name: str, factor: float) -> Effect:
    return with_shape(law, name, factor * float(getattr(law, name)))


def law_slopes(
    data: Data, columns: Columns, beta: Array
) -> tuple[list[Array], list[tuple[int, str]]]:
    """Return the slope (1, rows) of the torque by the logarithm of each free shape, and which.

    Of a law that takes no torque none, for it has no shape.
    """
    slopes, shapes = list[Array](), list[tuple[int, str]]()
    for place, (law, part) in enumerate(zip(columns.laws, columns.parts, strict=True)):
        for name in _free(law) if beta[part].any() else ():
            moved = (_times(law, name, factor) for factor in (1.0 + _STEP, 1.0 - _STEP))
            up, down = (effect_rows(data, one, columns.arm) for one in moved)
            slopes.append((beta[part] @ (up - down))[None] / (2.0 * _STEP))
            shapes.append((place, name))
    return slopes, shapes


def _best_of_grid(data: Data, law: Effect, columns: Columns, rest: Fit) -> tuple[Effect, Array]:
    """Return the shape of `law` in its grid that leaves least with the columns of `rest`.

    Of a law of several terms its own shape counts as well, for between the coarse points of so wide
    a grid many a search ends where two of them merge.
    """

    def gain(table: Array) -> float:
        c = rest.project(table)
        moment = c @ rest.residual
        return float(np.linalg.lstsq(c @ c.T, moment, rcond=1e-10)[0] @ moment)

    grid = law.shapes(data.logs[0].motion, columns.arm)
    shapes = (law, *grid) if plainer(law) else grid
    laid = [(shape, effect_rows(data, shape, columns.arm)) for shape in shapes]
    return max(laid, key=lambda one: gain(one[1]))
