"""Estimate what the logged torque is: sign, gravity, friction, and order of the joints.

    boundary = torque_boundary([log, …])        None where no log moves the arm enough to tell

Gravity along another axis, a torque without gravity and one with a share of it are one question:
which gravity vector explains the torque of all joints by one set of links (`gravity_fit`)? The
description is rejected only where another gravity, or order, is decisively more likely after the
residual's correlation is counted, and leaves less than half of the residual power.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.estimation.checks.channel_order import ColumnOrder, search_orders
from pipelines.estimation.checks.config import BoundaryConfig
from pipelines.estimation.checks.gravity_fit import GravityFit, GravityModel
from pipelines.estimation.checks.spread import effective_moments, gravity_spread, jackknife
from pipelines.estimation.checks.torque_rows import (
    CLUSTERS,
    Array,
    GenericArm,
    Order,
    TorqueRows,
    generic_arm,
    torque_rows,
)
from pipelines.estimation.checks.torque_sign import touches_of_zero
from pipelines.log.doctor.checks_subject import Subject
from pipelines.log.experiment import ExperimentLog
from pipelines.log.robot import RobotDescription
from pipelines.log.schema import joint_unit
from pipelines.model.rigid.chain import standard_parameters
from pipelines.model.row_fit import Sampled, sample_motion

__all__ = [
    "Boundary",
    "Direction",
    "JointOrder",
    "NotIdentifiable",
    "Share",
    "Unit",
    "torque_boundary",
]

STANDARD_GRAVITY = 9.80665  # [m/s^2]
_MOVING = ("excitation", "free", "writing")
_AXES = np.concatenate([np.eye(3), -np.eye(3)])
_STEPS = np.radians([1.0, 2.0, 5.0, 10.0, 20.0, 40.0])
_TWO = 2.0  # log likelihood that two standard deviations cost
_HELD = 0.02  # of the travel of the joint that moves most: a joint that moves less is held


@dataclass(frozen=True)
class Share:
    """Share of a part of the torque; of gravity 1 is all of it, of friction the share of the
    torque's RMS.
    """

    share: float | None  # of all joints; null: not identifiable
    std: float | None  # standard deviation of `share`
    joint_share: tuple[float | None, ...] = ()  # the same, joint by joint
    joint_std: tuple[float | None, ...] = ()  # standard deviation of each joint's share
    present: bool | None = None  # whether the torque holds that part; null: not identifiable
    upper: float | None = None  # largest share that the log allows, two standard deviations above
    reason: str = ""  # why a value is not identifiable; else empty


@dataclass(frozen=True)
class Direction:
    """The gravity vector in the axes of the base."""

    vector: tuple[float, ...] | None  # [m/s^2] as the torque has it; null: not identifiable
    std: float | None  # [rad] standard deviation of its direction
    described: tuple[float, ...]  # [m/s^2] as the robot's description has it
    angle: float | None  # [rad] between the two
    best: tuple[
        float, ...
    ] = ()  # [m/s^2] the vector that fits best, however little the log tells others from it
    reason: str = ""  # why a value is not identifiable; else empty


@dataclass(frozen=True)
class JointOrder:
    """Order of the joints' columns in the log."""

    columns: (
        tuple[int, ...] | None
    )  # column of the log, from 1, that each joint has; null: not identifiable
    # signals whose columns are out of order: "q and tau", "q" or "tau"; empty where none is
    signal: str
    before: float | None = None  # residual over the torque with the columns as logged
    after: float | None = None  # residual over the torque with the columns in order
    reason: str = ""  # why a value is not identifiable; else empty


@dataclass(frozen=True)
class Unit:
    """The unit of the torque."""

    units: tuple[str, ...]  # of each joint's torque
    scale: float | None  # torque over that of the described links; null: not identifiable
    std: float | None  # standard deviation of `scale`
    reason: str = ""  # why a value is not identifiable; else empty


@dataclass(frozen=True)
class NotIdentifiable:
    """Quantity that no log of this kind determines."""

    what: str  # quantity
    reason: str  # what it is confused with, and what would tell


@dataclass(frozen=True)
class Boundary:
    """Torque boundary: sign, parts, direction of gravity, order and unit of the logged torque."""

    side: (
        str | None
    )  # "joint": without the friction of the drive; "motor": with it; null: not identifiable
    sign: str | None  # "signed" or "magnitude"; null: not identifiable
    gravity: Share  # share of the gravity torque
    friction: Share  # share of friction
    direction: Direction  # of gravity
    order: JointOrder  # of the joints' columns
    unit: Unit  # of the torque
    not_identifiable: tuple[NotIdentifiable, ...]  # what no log of this kind tells
    evidence: tuple[str, ...]  # what the answers rest on
    fitted: tuple[str, ...]  # logs that were looked at
    without_gravity: bool = False  # whether the torque lacks the gravity that the description has
    turned: bool = False  # whether gravity points elsewhere than the description has it


def torque_boundary(
    logs: Sequence[ExperimentLog], config: BoundaryConfig | None = None
) -> Boundary | None:
    """Return what the torque of `logs`, of one robot, is; None where none of them moves the arm."""
    config = config or BoundaryConfig()
    subjects = [Subject(log) for log in _telling(logs)]
    good = [
        subject.good
        for subject in subjects
        if subject.sampled and subject.good.time.known and subject.good.runs
    ]
    if (
        not good
        or not np.isfinite(
            np.concatenate([one.log.tau[run] for one in good for run in one.runs])
        ).any()
    ):
        return None
    robot = good[0].log.robot
    touches = touches_of_zero(good, config)
    motions = [motion for one in good if (motion := sample_motion(one)) is not None]
    names = tuple(one.log.name for one in good)
    if all(count is not None for count in touches):
        sure = max(count or 0 for count in touches) >= config.touches
        return (
            _magnitude(robot, tuple(count or 0 for count in touches), names)
            if sure
            else _unread(robot, None, names)
        )
    arm = generic_arm(robot)
    if sum(len(motion.t) for motion in motions) < 4 * (len(arm.columns) + 6):
        return None
    return _estimated(robot, arm, motions, touches, names, config)


def _telling(logs: Sequence[ExperimentLog]) -> list[ExperimentLog]:
    """Logs in which all joints move; those of role "identify" where there are any."""
    moving = [log for log in logs if log.origin != "planned" and log.experiment in _MOVING]
    for role in ("identify", "validate", "reference"):
        if own := [log for log in moving if log.role == role]:
            return own[:4]
    return moving[:4]


def _thinned(motions: Sequence[Sampled], moments: int) -> list[Sampled]:
    step = max(1, -(-sum(len(motion.t) for motion in motions) // moments))
    return [
        replace(
            motion,
            **{
                name: getattr(motion, name)[::step]
                for name in ("t", "q", "dq", "ddq", "coulomb", "at")
            },
        )
        for motion in motions
    ]


def _joined(parts: Sequence[Sampled]) -> Sampled:
    """The moments of all logs as those of one."""
    t, q, dq, ddq, coulomb, tau = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("t", "q", "dq", "ddq", "coulomb", "tau")
    )
    return replace(
        parts[0], t=t, q=q, dq=dq, ddq=ddq, coulomb=coulomb, torque=tau, at=np.arange(len(t))
    )


@dataclass(frozen=True, eq=False)
class _Fits:
    """The fits of one order of columns."""

    model: GravityModel
    described: GravityFit
    none: GravityFit
    best: GravityFit  # any vector
    turned: tuple[GravityFit, ...]  # vectors of 9.8 m/s^2, the best of each region first

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.best.residual**2)))


def _fits(
    arm: GenericArm,
    motions: Sequence[Sampled],
    described: Array,
    config: BoundaryConfig,
    q_order: Order | None = None,
    tau_order: Order | None = None,
    effective: Array | None = None,
) -> _Fits:
    """Fit the gravity from the described one, from none and from every axis."""
    rows = torque_rows(arm, motions, q_order, tau_order)
    model = GravityModel(rows, config.model_error, effective)
    groups = _whole(rows.n_joints)
    here = [described] if np.any(described) else []
    starts = [*here, *(STANDARD_GRAVITY * _AXES)]
    if effective is None:
        first = max(
            (model.fit(start) for start in (np.zeros(3), *starts)), key=lambda fit: fit.score
        )
        model.effective = effective_moments(
            model.residuals(model.search(first.gravity, groups)), rows.start
        )
    turned: list[GravityFit] = []
    for fit in sorted(
        (model.search_direction(start, STANDARD_GRAVITY) for start in starts),
        key=lambda fit: -fit.score,
    ):
        if all(_angle(fit.gravity[0], other.gravity[0]) > config.tilt for other in turned):
            turned.append(fit)
    turned.sort(key=lambda fit: (-fit.score, not _possible(model, fit)))
    none = model.fit(np.zeros(3))
    free = [model.search(fit.gravity, groups) for fit in (none, *turned[:2])]
    best = max([*free, none, *turned], key=lambda fit: fit.score)
    return _Fits(model, model.fit(described), none, best, tuple(turned))


def _angle(one: Array, other: Array) -> float:
    """Angle [rad] between two vectors; π/2 where one is zero."""
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    return float(np.arccos(np.clip(one @ other / size, -1.0, 1.0))) if size > 0.0 else 0.5 * np.pi


def _possible(model: GravityModel, fit: GravityFit) -> bool:
    """Return whether the links alone have no negative inertia about any joint."""
    return bool((model.rows.own_inertia @ fit.parameters >= 0.0).all())


def _whole(n: int) -> Array:
    """(3, n, 3): changes of the gravity that all joints share."""
    return np.stack([np.tile(axis, (n, 1)) for axis in np.eye(3)])


def _estimated(
    robot: RobotDescription,
    arm: GenericArm,
    motions: Sequence[Sampled],
    touches: Sequence[int | None],
    names: tuple[str, ...],
    config: BoundaryConfig,
) -> Boundary:
    described = np.array(robot.gravity)
    rows = motions
    fits = _fits(arm, rows, described, config)
    signed = [str(j + 1) for j, count in enumerate(touches) if count is None]
    evidence = [f"the torque of joint {', '.join(signed)} changes its sign"]
    order, fits = _ordered(arm, motions, rows, fits, described, config)
    if order.signal:
        evidence.append(
            f"residual over the torque: {order.before:.2g} with the columns as logged, "
            f"{order.after:.2g} in another order"
        )
    gravity, direction, removed, turned = _gravity(fits, described, config)
    friction = _friction(fits, config)
    evidence += _in_words(fits, gravity, friction)
    side = None if friction.present is None else "motor" if friction.present else "joint"
    if order.signal:
        removed = turned = False  # the order first: it is what the rest rests on
    return Boundary(
        side,
        "signed",
        gravity,
        friction,
        direction,
        order,
        _unit(robot, arm, rows, fits),
        _never(robot),
        tuple(evidence),
        names,
        removed,
        turned,
    )


def _ordered(
    arm: GenericArm,
    motions: Sequence[Sampled],
    rows: Sequence[Sampled],
    fits: _Fits,
    described: Array,
    config: BoundaryConfig,
) -> tuple[JointOrder, _Fits]:
    """The order of the columns, and the fits under it."""
    n = fits.model.rows.n_joints
    same = JointOrder(tuple(range(1, n + 1)), "")
    if n == 1 or fits.best.residual.max() < config.suspect:
        return same, fits
    one = _joined(_thinned(motions, config.order_rows))
    travel = np.ptp(one.q, axis=0)
    moving = np.flatnonzero(travel > _HELD * travel.max()).tolist()
    tried = search_orders(
        arm,
        one,
        described,
        moving,
        config.model_error,
        (config.orders, config.order_rows_many, fits.rms > config.lost),
    )
    part = motions
    gains = [
        _gain(fits, *_under(torque_rows(arm, part, *_applied(c)), described, config), c)
        for c in tried
    ]
    if not tried or max(gains) < config.decisive:
        return same, fits
    top = int(np.argmax(gains))
    chosen, found = tried[top], _fits(arm, rows, described, config, *_applied(tried[top]))
    if found.rms**2 > config.explained * fits.rms**2:
        return same, fits
    alike = [c for c, gain in zip(tried, gains, strict=True) if gain > gains[top] - config.decisive]
    if len(alike) > 1:
        told = "; ".join(f"{c.signal} {','.join(str(k + 1) for k in c.order)}" for c in alike)
        return JointOrder(
            None, chosen.signal, fits.rms, found.rms, f"several orders fit alike: {told}"
        ), found
    return JointOrder(tuple(k + 1 for k in chosen.order), chosen.signal, fits.rms, found.rms), found


def _applied(column: ColumnOrder) -> tuple[Order | None, Order | None]:
    """The order of the positions and that of the torques; None as logged."""
    return (
        column.order if "q" in column.signal else None,
        column.order if "tau" in column.signal else None,
    )


def _under(rows: TorqueRows, described: Array, config: BoundaryConfig) -> tuple[GravityFit, Array]:
    """The best fit from the described gravity, and the independent moments of each joint."""
    model = GravityModel(rows, config.model_error)
    found = model.search(np.tile(described, (rows.n_joints, 1)), _whole(rows.n_joints))
    return found, effective_moments(model.residuals(found), rows.start)


def _gain(logged: _Fits, other: GravityFit, effective: Array, column: ColumnOrder) -> float:
    """Log likelihood of the other order beyond that of the logged one, by each torque's number of
    independent moments.
    """
    taken = list(column.order) if "tau" in column.signal else list(range(len(column.order)))
    moments = np.minimum(logged.model.effective[taken], effective)
    return 0.5 * float(moments @ np.log(logged.best.variance[taken] / other.variance))


def _gravity(
    fits: _Fits, described: Array, config: BoundaryConfig
) -> tuple[Share, Direction, bool, bool]:
    """Return share and direction of the gravity, whether it is absent, and whether it is turned
    from the described one.
    """
    model, best = fits.model, fits.best
    top, none = fits.turned[0], fits.none
    covariance, _, _ = gravity_spread(model, best, _whole(len(best.gravity)))
    along = _unit_vector(described if _absent(fits, config) and np.any(described) else top.gravity[0])
    # along the vector, and as the size of a vector that is uncertain across it
    std = float(np.sqrt(max(along @ covariance @ along, 0.0))) / STANDARD_GRAVITY
    across = (
        float(np.sqrt(max(np.trace(covariance) - along @ covariance @ along, 0.0)))
        / STANDARD_GRAVITY
    )
    share = float(best.gravity[0] @ along) / STANDARD_GRAVITY
    known = std < config.undetermined and across < config.wide
    present = _present(top, none, (share, std) if known else None, config)
    known = known and present is not None
    removed = (
        present is False
        and bool(np.any(described))
        and none.score > fits.described.score + config.decisive
    )
    found = Share(
        share if known else None,
        std if known else None,
        present=present,
        reason="" if known else "not identifiable: this motion does not tell the size of gravity",
    )
    if present and known:
        joints = _each_joint(model, best, config)
        found = replace(found, joint_share=joints[0], joint_std=joints[1])
    if present is False:
        return (
            found,
            Direction(
                None, None, tuple(described.tolist()), None, reason="the torque holds no gravity"
            ),
            removed,
            False,
        )
    half = float(np.sum(top.residual**2)) < config.explained * float(
        np.sum(fits.described.residual**2)
    )
    # a gravity upside down is hardly seen where links of negative inertia take its place
    turned = (
        not removed
        and (half or (_possible(model, top) and not _possible(model, fits.described)))
        and _angle(top.gravity[0], described) > config.tilt
        and top.score > _around(fits, described, config) + config.decisive
    )
    spread, why = _direction_spread(fits, config)
    if (
        across >= config.wide
    ):  # only its size, which is known, would tell the part along the joints' axes
        spread, why = None, "not identifiable: the part along the joints' axes acts on no joint"
    told = spread is not None and spread < config.direction_std
    pointing = top.gravity[0]
    if not told and not why:
        why = "not identifiable: the direction is known to some degrees only"
    return (
        found,
        Direction(
            tuple(map(float, pointing)) if told else None,
            spread if told else None,
            tuple(described.tolist()),
            _angle(pointing, described) if told else None,
            tuple(map(float, pointing)),
            why,
        ),
        removed,
        turned,
    )


def _absent(fits: _Fits, config: BoundaryConfig) -> bool:
    """Return whether no gravity fits better than all of it, in any direction."""
    return fits.none.score > fits.turned[0].score


def _unit_vector(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


def _present(
    top: GravityFit, none: GravityFit, share: tuple[float, float] | None, config: BoundaryConfig
) -> bool | None:
    """Return whether the torque holds gravity: by its share, and by the fits of gravity of its
    whole size and of zero gravity.
    """
    half = float(np.sum(top.residual**2)) < config.explained * float(np.sum(none.residual**2))
    if share is None:
        return True if half and top.score > none.score + config.decisive else None
    low, high = share[0] - 2.0 * share[1], share[0] + 2.0 * share[1]
    if high < config.absent:
        return (
            False if none.score > top.score + config.decisive else None
        )  # balanced links have no gravity either
    return True if low > config.absent else None


def _around(fits: _Fits, described: Array, config: BoundaryConfig) -> float:
    """The best score of all gravities that a tilted mounting leaves of the described one."""
    if not np.any(described):
        return fits.described.score
    near = [fit.score for fit in fits.turned if _angle(fit.gravity[0], described) < config.tilt]
    along = described / np.linalg.norm(described)
    cone = [along, *_cone(along, 0.5 * config.tilt), *_cone(along, config.tilt)]
    return max(*near, *(fits.model.fit(STANDARD_GRAVITY * vector).score for vector in cone))


def _cone(along: Array, tilt: float) -> list[Array]:
    """Eight unit vectors at the angle `tilt` from `along`."""
    across = np.linalg.svd(along[None])[2][1:]
    turns = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
    return [
        np.cos(tilt) * along + np.sin(tilt) * (np.cos(turn) * across[0] + np.sin(turn) * across[1])
        for turn in turns
    ]


def _each_joint(
    model: GravityModel, best: GravityFit, config: BoundaryConfig
) -> tuple[tuple[float | None, ...], ...]:
    """Share of each joint's gravity, where its torque tells it, and its standard deviation."""
    n = len(best.gravity)
    groups = np.einsum("jk,jx->kjx", np.eye(n), best.gravity)
    apart = model.search(best.gravity, groups)
    std = np.sqrt(np.maximum(np.diag(gravity_spread(model, apart, groups)[0]), 0.0))
    share = apart.gravity @ _unit_vector(best.gravity[0]) / STANDARD_GRAVITY
    p = model.rows.inertial.shape[2]
    m = len(model.rows.heavy)
    pulled = np.einsum(
        "jnkm,jk,m->jn",
        model.projected[:, :, p : p + 3 * m].reshape(n, -1, 3, m),
        best.gravity,
        best.parameters[model.rows.heavy],
    )
    known = (std * np.linalg.norm(best.gravity[0]) / STANDARD_GRAVITY < config.undetermined) & (
        np.sqrt(np.mean(pulled**2, axis=1)) > config.weighs
    )
    return (
        tuple(float(v) if k else None for v, k in zip(share, known, strict=True)),
        tuple(float(v) if k else None for v, k in zip(std, known, strict=True)),
    )


def _direction_spread(fits: _Fits, config: BoundaryConfig) -> tuple[float | None, str]:
    """Standard deviation [rad] by the profile of the likelihood, in the least certain direction; or
    the reason why it is not identifiable.
    """
    top, model = fits.turned[0], fits.model
    possible = _possible(model, top)
    if any(
        fit.score > top.score - _TWO and (_possible(model, fit) or not possible)
        for fit in fits.turned[1:]
    ):
        return None, "not identifiable: gravity in another direction explains the torque as well"
    along = top.gravity[0] / STANDARD_GRAVITY
    worst = 0.0
    for around in np.transpose([_cone(along, step) for step in _STEPS], (1, 0, 2)):
        for step, vector in zip(_STEPS, around, strict=True):
            drop = top.score - model.fit(STANDARD_GRAVITY * vector).score
            if drop > _TWO:
                worst = max(worst, float(step / np.sqrt(2.0 * drop)))
                break
        else:
            return None, "not identifiable: turned gravity explains the torque as well"
    return worst, ""


def _friction(fits: _Fits, config: BoundaryConfig) -> Share:
    """The share of friction: of each joint the power that it takes, over the RMS of torque and
    speed.

    s_j = <τ_f v> / (rms τ · rms v)        linear, signed, for any friction law
    """
    model = fits.model
    rows = model.rows
    _, coefficients, covariance = gravity_spread(model, fits.best, _whole(rows.n_joints))
    n, c = coefficients.shape
    weights = np.zeros((n, n * c))
    moves = np.any(rows.dissipated != 0.0, axis=1)  # a joint that is held has none to tell
    for j in range(n):
        weights[j, j * c : (j + 1) * c] = rows.dissipated[j]
    each = weights @ coefficients.ravel()
    std = np.sqrt(np.maximum(np.einsum("jk,kl,jl->j", weights, covariance, weights), 0.0))
    sure = moves / (
        std**2 + (0.25 * config.friction_absent) ** 2
    )  # a joint whose friction no motion tells has no say
    mean = sure @ weights / max(float(sure.sum()), 1e-300)
    share, own = (
        float(mean @ coefficients.ravel()),
        float(np.sqrt(max(mean @ covariance @ mean, 0.0))),
    )
    upper = share + 2.0 * own
    present: bool | None = None
    reason = ""
    read = moves & (std < config.friction_absent)
    if (each - 3.0 * std > config.friction_absent).any():
        present = True
    elif (
        read.any()
        and upper < config.friction_absent
        and (each + 2.0 * std < 2.0 * config.friction_absent)[read].all()
    ):
        present = False
        reason = (
            "compensated friction and a torque measured beyond the gear are one answer here: "
            "they differ by the rotor inertia alone"
        )
    else:
        reason = "not identifiable: the motion does not tell friction from none"
    told = [
        tuple(float(v) if m else None for v, m in zip(values, moves, strict=True))
        for values in (each, std)
    ]
    return Share(share, own, told[0], told[1], present, upper, reason)


def _in_words(fits: _Fits, gravity: Share, friction: Share) -> list[str]:
    rms = (
        float(np.sqrt(np.mean(fits.described.residual**2))),
        float(np.sqrt(np.mean(fits.none.residual**2))),
        fits.rms,
    )
    said = [
        f"relative residual, joints weighted alike: {rms[0]:.2g} with gravity as described, "
        f"{rms[1]:.2g} with none, {rms[2]:.2g} with the best-fitting vector"
    ]
    if gravity.share is not None and gravity.std is not None:
        said.append(
            f"gravity: {gravity.share:.2f} ± {gravity.std:.2f} of {STANDARD_GRAVITY:.2f} m/s²"
        )
    if friction.share is not None and friction.upper is not None:
        said.append(
            f"friction dissipates {100 * friction.share:.1f} % of rms torque times rms speed, "
            f"at most {100 * friction.upper:.1f} %"
        )
    return said


def _unit(
    robot: RobotDescription, arm: GenericArm, motions: Sequence[Sampled], fits: _Fits
) -> Unit:
    """The unit, and the rigid part of the torque over that of the described links."""
    units = _units(robot)
    links = [joint.link for joint in robot.joints if joint.link is not None]
    if len(links) < robot.n_joints:
        return Unit(units, None, None, "the description has no masses and inertias to compare with")
    rows, size = fits.model.rows, fits.model.size
    standard = standard_parameters(links)
    phi = arm.combine @ np.ravel(standard)
    pulled = np.einsum("jnkm,k,m->jn", rows.gravity, fits.best.gravity[0], phi[rows.heavy])
    expected = (rows.inertial @ phi + pulled) / size[:, None]
    xx, xy = np.zeros(CLUSTERS), np.zeros(CLUSTERS)
    yy = 0.0
    for j in range(robot.n_joints):
        basis, _ = np.linalg.qr(rows.own[j])
        x, y = (v - basis @ (basis.T @ v) for v in (expected[j], rows.tau[j] / size[j]))
        xx += np.bincount(rows.cluster, x * x, CLUSTERS)
        xy += np.bincount(rows.cluster, x * y, CLUSTERS)
        yy += float(y @ y)
    if xx.sum() <= 0.0 or xy.sum() ** 2 < 0.8 * xx.sum() * yy:
        return Unit(units, None, None, "the described links do not explain the torque")
    scale, covariance = jackknife(xx[:, None, None], xy[:, None])
    return Unit(units, float(scale[0]), float(np.sqrt(covariance[0, 0])))


def _units(robot: RobotDescription) -> tuple[str, ...]:
    return tuple(joint_unit("tau", joint.revolute) for joint in robot.joints)


def _never(robot: RobotDescription) -> tuple[NotIdentifiable, ...]:
    return (
        NotIdentifiable(
            "compensated payload",
            "a payload that the controller subtracts is absorbed by the last links' masses: "
            "it needs a reference log, or links described within 5 %",
        ),
        NotIdentifiable(
            "joint zero", "a joint zero that is off is absorbed by the links' centres of mass"
        ),
    )


def _unread(
    robot: RobotDescription, sign: str | None, names: tuple[str, ...], *evidence: str
) -> Boundary:
    """A boundary of which nothing but the sign is known."""
    why = (
        "not identifiable from magnitudes"
        if sign == "magnitude"
        else "not identifiable: no torque changes its sign"
    )
    nothing = Share(None, None, reason=why)
    return Boundary(
        None,
        sign,
        nothing,
        nothing,
        Direction(None, None, robot.gravity, None, reason=why),
        JointOrder(None, "", reason=why),
        Unit(_units(robot), None, None, why),
        _never(robot),
        evidence,
        names,
    )


def _magnitude(
    robot: RobotDescription, touches: tuple[int, ...], names: tuple[str, ...]
) -> Boundary:
    return _unread(
        robot,
        "magnitude",
        names,
        "no torque is ever negative, though they come down to zero "
        f"{', '.join(map(str, touches))} times while the joints move",
    )
