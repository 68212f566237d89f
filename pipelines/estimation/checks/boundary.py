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

from pipelines.dynamics.body import standard_parameters
from pipelines.estimation.checks.channel_order import SIGNALS, ColumnOrder, search_orders
from pipelines.estimation.checks.config import BoundaryConfig
from pipelines.estimation.checks.gravity_fit import LOOSE, GravityFit, GravityModel
from pipelines.estimation.checks.joint_rows import Sampled, sample_motion
from pipelines.estimation.checks.payload import (
    NOT_TOLD,
    CompensatedPayload,
    payload_by_links,
    payload_by_reference,
)
from pipelines.estimation.checks.spread import effective_moments, gravity_spread, jackknife
from pipelines.estimation.checks.torque_rows import (
    CLUSTERS,
    Array,
    GenericArm,
    Order,
    generic_arm,
    torque_rows,
)
from pipelines.estimation.checks.torque_sign import touches_of_zero
from pipelines.io.log import ExperimentLog
from pipelines.io.robot import RobotDescription
from pipelines.io.schema import joint_unit
from pipelines.quality.segments import Usable
from pipelines.quality.subject import Subject

__all__ = [
    "STANDARD_GRAVITY",
    "Boundary",
    "Direction",
    "JointOrder",
    "NotIdentifiable",
    "Share",
    "Unit",
    "torque_boundary",
]

STANDARD_GRAVITY = 9.80665  # numerics: [m/s^2]
_MOVING = ("excitation", "free", "writing")
_AXES = np.concatenate([np.eye(3), -np.eye(3)])
_ANGLES = np.radians(np.r_[0.1:2.0:0.1, 2.0:20.0:0.5, 20.0:92.0:2.0])
_FOUR = 4.0  # numerics: two standard deviations, squared


@dataclass(frozen=True)
class Share:
    """Share of a part of the torque; of gravity 1 is all of the gravity, of friction the share is
    that of the torque: mean power over RMS torque times RMS speed, 1 where all of it is friction.
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
    after: float | None = None  # residual over the torque in the best other order that was tried
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
    payload: CompensatedPayload = NOT_TOLD  # that the controller subtracts


def _never(payload: CompensatedPayload) -> tuple[NotIdentifiable, ...]:
    """Return what the logs do not tell, `payload` among it where it is not identifiable."""
    zero = NotIdentifiable(
        "joint zero", "a joint zero that is off is absorbed by the links' centres of mass"
    )
    if payload.present is not None:
        return (zero,)
    return NotIdentifiable("compensated payload", payload.reason), zero


def torque_boundary(
    logs: Sequence[ExperimentLog], config: BoundaryConfig | None = None
) -> Boundary | None:
    """Return what the torque of `logs`, of one robot, is; None where none of them moves the arm.

    A check that fails numerically leaves what it tells not identifiable, and its reason names it.
    """
    config = config or BoundaryConfig()
    usable = _usable(_informative(logs))
    if not any(np.isfinite(one.log.tau[run]).any() for one in usable for run in one.runs):
        return None
    robot = usable[0].log.robot
    names = tuple(one.log.name for one in usable)
    check, sign, evidence = "test of the sign", None, "the sign of the torque is not identifiable"
    try:
        sign, evidence = _sign(touches_of_zero(usable, config), config)
        if sign == "magnitude":
            return _unread(robot, sign, names, "not identifiable from magnitudes", evidence)
        check = "fit"
        arm = generic_arm(robot)
        motions, enough = _sampled(usable), 4 * (len(arm.columns) + 6)
        if sum(len(motion.t) for motion in motions) < enough:
            return None
        before = _sampled(_usable([log for log in _moving(logs) if log.role == "reference"][:4]))
        if usable[0].log.role == "reference" or sum(len(one.t) for one in before) < enough:
            before = []
        return _Estimate(robot, arm, motions, before, config).boundary(names, sign, evidence)
    except (ArithmeticError, np.linalg.LinAlgError, ValueError) as error:
        reason = f"not identifiable: the {check} failed: {error}"
        return _unread(robot, sign, names, reason, evidence)


def _sign(touches: Sequence[int | None], config: BoundaryConfig) -> tuple[str | None, str]:
    """Return whether the torque is signed or a magnitude, and what that rests on."""
    counts = [count for count in touches if count is not None]
    if len(counts) < len(touches):
        signed = ", ".join(str(j) for j, count in enumerate(touches, 1) if count is None)
        return "signed", f"the torque of joint {signed} changes its sign"
    if max(counts) >= config.touches:
        return "magnitude", (
            "no torque is ever negative, though they come down to zero "
            f"{', '.join(map(str, counts))} times while the joints move"
        )
    if any(counts):  # a load on one side: the same as its magnitude
        return None, "no torque changes its sign"
    return "signed", "no torque changes its sign, or comes near zero"


def _moving(logs: Sequence[ExperimentLog]) -> list[ExperimentLog]:
    return [log for log in logs if log.origin != "planned" and log.experiment in _MOVING]


def _usable(logs: Sequence[ExperimentLog]) -> list[Usable]:
    """Return the samples of `logs` that can be used."""
    subjects = [Subject(log) for log in logs]
    return [one.good for one in subjects if one.sampled and one.good.time.known and one.good.runs]


def _sampled(usable: Sequence[Usable]) -> list[Sampled]:
    return [motion for one in usable if (motion := sample_motion(one)) and len(motion.t) > 1]


def _informative(logs: Sequence[ExperimentLog]) -> list[ExperimentLog]:
    """Return logs in which all joints move; those of role "identify" where there are any."""
    moving = _moving(logs)
    for role in ("identify", "validate", "reference"):
        if of_role := [log for log in moving if log.role == role]:
            return of_role[:4]
    return moving[:4]


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
        return _rms(self.best)


class _Estimate:
    """The torque boundary of one robot's logs."""

    def __init__(
        self,
        robot: RobotDescription,
        arm: GenericArm,
        motions: Sequence[Sampled],
        reference: Sequence[Sampled],
        config: BoundaryConfig,
    ) -> None:
        self.robot, self.arm, self.motions, self.config = robot, arm, motions, config
        self.reference = reference
        self.described = np.array(robot.gravity)

    def boundary(self, names: tuple[str, ...], sign: str | None, evidence: str) -> Boundary:
        order, fits = self.ordered(self.fits())
        covariance, coefficients, spread = gravity_spread(fits.model, fits.best, fits.model.whole)
        gravity, direction, removed, turned = self.gravity(fits, covariance)
        friction = self.friction(fits.model.rows.dissipated, coefficients, spread)
        little = friction.upper is not None and friction.upper < self.config.friction_absent
        as_described = not (order.signal or order.reason or removed or turned)
        payload = NOT_TOLD
        if as_described and gravity.present is not False:
            payload = self.payload(fits.model)
        sides = {True: None if little else "motor", False: "joint", None: None}
        acting = fits.turned[0].gravity[0] if turned else self.described
        if gravity.present is False:
            acting = np.zeros(3)
        elif gravity.share and gravity.std and abs(gravity.share - 1.0) > 3.0 * gravity.std:
            acting = fits.best.gravity[0]  # partly compensated
        unit = self.unit(fits, acting)
        if order.signal:
            removed = turned = False  # the order first: it is what the rest rests on
        return Boundary(
            sides[friction.present],
            sign,
            gravity,
            friction,
            direction,
            order,
            unit,
            _never(payload),
            (evidence, *_in_words(fits, order)),
            names,
            removed,
            turned,
            payload,
        )

    def payload(self, model: GravityModel) -> CompensatedPayload:
        """Return the payload that the torque lacks, by reference logs or else by the links."""
        if self.reference:
            rows = torque_rows(self.arm, self.reference)
            before = GravityModel(rows, self.config.model_error)
            residuals = before.residuals(before.fit(self.described))
            before.effective = effective_moments(residuals, rows.start)
            found = payload_by_reference(self.arm, model, before, self.described, self.config)
            if found.present is not None:
                return found
        links = [joint.link for joint in self.robot.joints if joint.link is not None]
        if len(links) < self.robot.n_joints:
            return found if self.reference else NOT_TOLD
        return payload_by_links(self.arm, model, links, self.described, self.config)

    def fits(self, order: ColumnOrder | None = None) -> _Fits:
        """Fit the gravity from the described one, from none and from every axis."""
        q_order, tau_order = (order.q, order.tau) if order else (None, None)
        rows = torque_rows(self.arm, self.motions, q_order, tau_order)
        model = GravityModel(rows, self.config.model_error)
        here = [self.described] if np.any(self.described) else []
        starts = [*here, *(STANDARD_GRAVITY * _AXES)]
        first = max(map(model.fit, (np.zeros(3), *starts)), key=lambda fit: fit.score)
        residuals = model.residuals(model.search(first.gravity, model.whole))
        model.effective = effective_moments(residuals, rows.start)
        turned: list[GravityFit] = []
        tried = [model.search_direction(start, STANDARD_GRAVITY) for start in starts]
        for fit in sorted(tried, key=lambda fit: -fit.score):
            apart = (_angle(fit.gravity[0], other.gravity[0]) for other in turned)
            if all(angle > self.config.tilt for angle in apart):
                turned.append(fit)
        none = model.fit(np.zeros(3))
        free = [model.search(fit.gravity, model.whole) for fit in (none, *turned[:2])]
        best = max([*free, none, *turned], key=lambda fit: fit.score)
        return _Fits(model, model.fit(self.described), none, best, tuple(turned))

    def ordered(self, fits: _Fits) -> tuple[JointOrder, _Fits]:
        """Return the order of the columns, and the fits under it."""
        config, n = self.config, fits.model.rows.n_joints
        same = JointOrder(tuple(range(1, n + 1)), "")
        mistaken = fits.best.score > fits.described.score + config.decisive
        explained = fits.best.residual.max() < config.suspect
        if n == 1:
            return same, fits
        travel = np.ptp(np.concatenate([motion.q for motion in self.motions]), axis=0)
        tried = search_orders(
            self.arm,
            self.motions[:1],
            self.described,
            np.flatnonzero(travel > config.held * travel.max()).tolist(),
            config.model_error,
            (config.order_rows, config.orders),
            True if fits.rms > config.lost else False if explained else None,
            -0.5 * float(np.sum(np.log(fits.best.variance))) - n,  # hopeless below
            SIGNALS[:1] if explained else SIGNALS,
        )
        if not tried:
            return same, fits
        # all orders by one number of independent moments, that of the order that leaves the least
        variances, moments = map(np.stack, zip(*map(self.by_column, tried), strict=True))
        gains = np.log(fits.best.variance / variances)
        likelihoods = 0.5 * gains @ moments[np.argmin(np.log(variances).sum(axis=1))]
        top = int(np.argmax(likelihoods))
        least = np.minimum(fits.model.effective, moments[top])
        rows = fits.model.rows  # moments that the parameters take up are no evidence
        free = 1.0 - (rows.inertial.shape[2] + n * rows.own.shape[2]) / float(least.sum())
        gain = 0.5 * max(free, 0.0) * float(gains[top] @ least)
        if gain < -(config.decisive if mistaken else config.alike):
            return same, fits
        near = np.flatnonzero(likelihoods > likelihoods[top] - config.alike)
        alike = [tried[k] for k in near]
        return self.chosen(fits, tried[top], alike, gain > config.decisive, mistaken)

    def chosen(
        self,
        fits: _Fits,
        chosen: ColumnOrder,
        alike: Sequence[ColumnOrder],
        decisive: bool,
        mistaken: bool,
    ) -> tuple[JointOrder, _Fits]:
        """Return what the best other order shows, and the fits under the order that holds."""
        config, other = self.config, self.fits(chosen)
        same = JointOrder(tuple(range(1, fits.model.rows.n_joints + 1)), "")
        if decisive and _power(other.best) < config.explained * _power(fits.best):
            columns = tuple(k + 1 for k in chosen.order)
            order = JointOrder(columns, chosen.signal, fits.rms, other.rms)
            if len(alike) > 1:
                orders = "; ".join(f"{one.signal} {_listed(one.order)}" for one in alike)
                order = replace(order, columns=None, reason=f"several orders fit alike: {orders}")
            return order, other
        swapped = f"{chosen.signal} are in the order {_listed(chosen.order)}"
        if not mistaken:
            reason = f"not identifiable: the torque is explained as well if {swapped}"
            return replace(same, before=fits.rms, after=other.rms, reason=reason), fits
        if _power(other.described) < config.explained * _power(fits.described):
            reason = f"either gravity is not as described, or {swapped}: both explain the torque"
            return JointOrder(None, chosen.signal, _rms(fits.described), other.rms, reason), fits
        return replace(same, before=fits.rms, after=other.rms), fits

    def by_column(self, order: ColumnOrder) -> tuple[Array, Array]:
        """Return the relative residual variance and the number of independent moments (n,) of each
        column of the torque in another order.
        """
        rows = torque_rows(self.arm, self.motions, order.q, order.tau)
        model = GravityModel(rows, self.config.model_error)
        fit = model.search(np.tile(self.described, (rows.n_joints, 1)), model.whole)
        joint = np.argsort(order.tau or range(rows.n_joints))
        return fit.variance[joint], effective_moments(model.residuals(fit), rows.start)[joint]

    def gravity(self, fits: _Fits, covariance: Array) -> tuple[Share, Direction, bool, bool]:
        """Return share and direction of the gravity, whether it is absent, and whether it is
        turned from the described one.
        """
        config, described = self.config, self.described
        model, best, none, top = fits.model, fits.best, fits.none, fits.turned[0]
        absent = none.score > top.score and bool(np.any(described))
        along = described if absent else top.gravity[0]
        along = along / np.linalg.norm(along)
        share = float(best.gravity[0] @ along) / STANDARD_GRAVITY
        variance = max(float(along @ covariance @ along), 0.0)
        std = float(np.sqrt(variance)) / STANDARD_GRAVITY
        drop = 2.0 * max(best.score - top.score, 1e-3)
        if abs(share - 1.0) > 3.0 * std and drop < 2.0 * config.alike:
            std = abs(share - 1.0) / float(np.sqrt(drop))  # the whole size explains the torque too
        across = np.sqrt(max(float(np.trace(covariance)) - variance, 0.0)) / STANDARD_GRAVITY
        known = std < config.undetermined and across < config.wide
        present = _present(top, none, (share, std) if known else None, config)
        if not known or present is None:
            reason = "not identifiable: this motion does not tell the size of gravity"
            found = Share(None, None, present=present, reason=reason)
        else:
            found = Share(share, std, present=present)
        told = tuple(described.tolist())
        if present is False:
            removed = (
                bool(np.any(described)) and none.score > fits.described.score + config.decisive
            )
            return (
                found,
                Direction(None, None, told, None, (), "the torque holds no gravity"),
                removed,
                False,
            )
        half = _power(top) < config.explained * _power(fits.described)
        turned = (
            half
            and _angle(top.gravity[0], described) > config.tilt
            and top.score > self.tilted(fits) + config.decisive
        )
        spread, reason = self.direction_spread(fits)
        pointing = tuple(map(float, top.gravity[0]))
        if found.share is not None and present:
            acting = top.gravity[0] if turned else described
            joint_share, joint_std = _each_joint(model, best, acting, config)
            found = replace(found, joint_share=joint_share, joint_std=joint_std)
        if reason:
            return found, Direction(None, None, told, None, pointing, reason), False, turned
        angle = _angle(top.gravity[0], described)
        return found, Direction(pointing, spread, told, angle, pointing), False, turned

    def tilted(self, fits: _Fits) -> float:
        """Return the best score of all gravities that a tilted mounting leaves of the described."""
        if not np.any(self.described):
            return fits.described.score
        tilt = self.config.tilt
        near = [fit.score for fit in fits.turned if _angle(fit.gravity[0], self.described) < tilt]
        along = self.described / np.linalg.norm(self.described)
        cones = np.concatenate([along[None], _cone(along, 0.5 * tilt, 8), _cone(along, tilt, 8)])
        return max(*near, *(fits.model.fit(STANDARD_GRAVITY * vector).score for vector in cones))

    def direction_spread(self, fits: _Fits) -> tuple[float | None, str]:
        """Return the standard deviation [rad] of gravity's direction, or why there is none.

        The set of directions u of which (g u - a)ᵀ C⁻¹ (g u - a) is within 4 of the least, a the
        free vector and C its covariance; half the angle to the farthest is the deviation.
        """
        top, model = fits.turned[0], fits.model
        if any(fit.score > top.score - self.config.alike for fit in fits.turned[1:]):
            return (
                None,
                "not identifiable: gravity in another direction explains the torque as well",
            )
        along = top.gravity[0] / STANDARD_GRAVITY
        covariance = gravity_spread(model, top, model.whole)[0]
        values, vectors = np.linalg.eigh(covariance)
        inverse = vectors / np.maximum(values, 1e-12 * LOOSE**2) @ vectors.T
        across = np.linalg.svd(along[None])[2][1:]
        across = np.linalg.eigh(across @ covariance @ across.T)[1].T @ across  # along its valleys
        angles = np.repeat(_ANGLES, 8)
        away = np.concatenate([_cone(along, angle, 8, across) for angle in _ANGLES]) - along
        apart = STANDARD_GRAVITY**2 * np.einsum("ij,jk,ik->i", away, inverse, away)
        spread = 0.5 * float(angles[apart < _FOUR].max(initial=_ANGLES[0]))
        if spread < self.config.direction_std:
            return spread, ""
        if spread < 0.5 * _ANGLES[-1]:
            return None, f"not identifiable to better than {np.degrees(2 * spread):.0f} degrees"
        return None, "not identifiable: turned gravity explains the torque as well"

    def friction(self, dissipated: Array, coefficients: Array, covariance: Array) -> Share:
        """Return the share of friction: of each joint the power that it takes, over the RMS of
        torque and speed.

        s_j = <τ_f v> / (rms τ · rms v)        linear, signed, for any friction law
        """
        config = self.config
        n, c = coefficients.shape
        weights = np.zeros((n, n * c))
        for j in range(n):
            weights[j, j * c : (j + 1) * c] = dissipated[j]
        moves = np.any(dissipated != 0.0, axis=1)  # a joint that is held has none to tell
        each = weights @ coefficients.ravel()
        std = np.sqrt(np.maximum(np.einsum("jk,kl,jl->j", weights, covariance, weights), 0.0))
        # by the balance of energy a cycle dissipates no more than the torque's power
        told = moves & (std < config.undetermined) & (np.abs(each - 0.5) < 0.5 + 2.0 * std)
        floor = 0.1 * config.friction_absent
        sure = told / (std**2 + floor**2)  # a joint whose friction no motion tells has no say
        mean = sure @ weights / max(float(sure.sum()), 1e-300)
        share = float(mean @ coefficients.ravel())
        own = float(np.sqrt(max(mean @ covariance @ mean, 0.0)))
        upper = share + 2.0 * own
        read = told & (std < config.friction_absent)
        present: bool | None = None
        reason = "not identifiable: the motion does not tell friction from none"
        if (each - 3.0 * std > config.friction_absent)[told].any() or share > 3.0 * np.hypot(
            own, floor
        ):
            present, reason = True, ""
            if upper < config.friction_absent:
                reason = "so little that it may be a direct drive, or what compensation leaves"
        elif 3.0 * own < share < config.friction_absent:
            reason = "so little that it may be what compensation leaves"
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
        joints = [
            tuple(float(v) if k else None for v, k in zip(values, told, strict=True))
            for values in (each, std)
        ]
        if not told.any():
            return Share(None, None, joints[0], joints[1], reason=reason)
        return Share(share, own, joints[0], joints[1], present, upper, reason)

    def unit(self, fits: _Fits, acting: Array) -> Unit:
        """Return the unit, and the rigid part of the torque over that of the described links under
        the gravity `acting` (3,): a gravity fitted with other links would take the scale's place.
        """
        config = self.config
        units = _units(self.robot)
        links = [joint.link for joint in self.robot.joints if joint.link is not None]
        if len(links) < self.robot.n_joints:
            reason = "the description has no masses and inertias to compare with"
            return Unit(units, None, None, reason)
        rows, size = fits.model.rows, fits.model.size
        phi = self.arm.combine @ np.ravel(standard_parameters(links))
        pulled = np.einsum("jnkm,k,m->jn", rows.gravity, acting, phi[rows.heavy])
        expected = (rows.inertial @ phi + pulled) / size[:, None]
        xx, xy, yy = np.zeros(CLUSTERS), np.zeros(CLUSTERS), 0.0
        for j in range(len(size)):
            basis = np.linalg.qr(rows.own[j])[0]
            x, y = (v - basis @ (basis.T @ v) for v in (expected[j], rows.tau[j] / size[j]))
            xx += np.bincount(rows.cluster, x * x, CLUSTERS)
            xy += np.bincount(rows.cluster, x * y, CLUSTERS)
            yy += float(y @ y)
        if xx.sum() <= 0.0 or xy.sum() ** 2 < 0.8 * xx.sum() * yy:
            return Unit(units, None, None, "the described links do not explain the torque")
        scale, covariance = jackknife(xx[:, None, None], xy[:, None], np.zeros((1, 1)))
        # the error that any model has may be in phase with the torque of the links
        floor = config.model_error**2 * len(rows.cluster) / float(xx.sum())
        return Unit(units, float(scale[0]), float(np.sqrt(covariance[0, 0] + floor)))


def _angle(one: Array, other: Array) -> float:
    """Return the angle [rad] between two vectors; π/2 where one is zero."""
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    return float(np.arccos(np.clip(one @ other / size, -1.0, 1.0))) if size > 0.0 else 0.5 * np.pi


def _cone(along: Array, angle: float, count: int, across: Array | None = None) -> Array:
    """Return (count, 3) unit vectors at `angle` from the unit vector `along`, the first towards
    the first of `across` (2, 3).
    """
    across = np.linalg.svd(along[None])[2][1:] if across is None else across
    turns = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    side = np.stack([np.cos(turns), np.sin(turns)], axis=1) @ across
    return np.asarray(np.cos(angle) * along + np.sin(angle) * side)


def _power(fit: GravityFit) -> float:
    return float(np.sum(fit.residual**2))


def _rms(fit: GravityFit) -> float:
    return float(np.sqrt(np.mean(fit.residual**2)))


def _listed(order: Order) -> str:
    return ",".join(str(k + 1) for k in order)


def _present(
    top: GravityFit, none: GravityFit, share: tuple[float, float] | None, config: BoundaryConfig
) -> bool | None:
    """Return whether the torque holds gravity: by its share, and by the fits of gravity of its
    whole size and of zero gravity; None where both fit alike within the error of any model.
    """
    apart = none.residual**2 - top.residual**2  # of each joint's torque
    if np.abs(apart).max() < config.suspect**2:
        return None
    if share is None:
        half = _power(top) < config.explained * _power(none)
        return True if half and top.score > none.score + config.alike else None
    low, high = share[0] - 2.0 * share[1], share[0] + 2.0 * share[1]
    if high < config.absent:  # balanced links have no gravity either
        return False if none.score > top.score + config.alike else None
    return True if low > config.absent else None


def _each_joint(
    model: GravityModel, best: GravityFit, acting: Array, config: BoundaryConfig
) -> tuple[tuple[float | None, ...], ...]:
    """Return the share of each joint's gravity, where the gravity that is `acting` (3,) weighs on
    it and its torque tells it, and its deviation.
    """
    n = len(best.gravity)
    size = float(np.linalg.norm(best.gravity[0]))
    groups = np.einsum("jk,jx->kjx", np.eye(n), best.gravity)
    apart = model.search(best.gravity, groups)
    std = np.sqrt(np.maximum(np.diag(gravity_spread(model, apart, groups)[0]), 0.0))
    std = std * size / STANDARD_GRAVITY
    share = apart.gravity @ best.gravity[0] / size / STANDARD_GRAVITY
    pulled = model.pulls(best) @ acting
    weighs = np.sqrt(np.mean(pulled**2, axis=1)) > config.weighs
    known = (std < config.undetermined) & weighs
    return tuple(
        tuple(float(v) if k else None for v, k in zip(values, known, strict=True))
        for values in (share, std)
    )


def _in_words(fits: _Fits, order: JointOrder) -> list[str]:
    described, none = _rms(fits.described), _rms(fits.none)
    said = [
        f"the model leaves {_percent(described)} of a joint's torque with gravity as described, "
        f"{_percent(none)} without gravity, "
        f"{_percent(fits.rms)} with the gravity vector that fits best"
    ]
    if order.signal and order.before is not None and order.after is not None:
        said.append(
            f"it leaves {_percent(order.before)} with the columns as logged, "
            f"{_percent(order.after)} in the other order"
        )
    return said


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %"


def _units(robot: RobotDescription) -> tuple[str, ...]:
    return tuple(joint_unit("tau", joint.revolute) for joint in robot.joints)


def _unread(
    robot: RobotDescription, sign: str | None, names: tuple[str, ...], why: str, *evidence: str
) -> Boundary:
    """Return a boundary of which nothing but the sign is known."""
    nothing = Share(None, None, reason=why)
    return Boundary(
        None,
        sign,
        nothing,
        nothing,
        Direction(None, None, robot.gravity, None, reason=why),
        JointOrder(None, "", reason=why),
        Unit(_units(robot), None, None, why),
        _never(NOT_TOLD),
        evidence,
        names,
    )
