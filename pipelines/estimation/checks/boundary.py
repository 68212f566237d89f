"""Estimate what the logged torque is: sign, gravity, friction, and order of the joints.

    boundary = torque_boundary([log, …])        None where no log moves the arm enough to tell
    boundary_findings(boundary, where)          the gates that it closes

Gravity along another axis, a torque without gravity and one with a share of it are one question:
which gravity vector explains the torque of all joints by one set of links (`gravity_fit`)? The
description is rejected only where another gravity, or order, is decisively more likely after the
residual's correlation is counted, and leaves less than half of the residual power.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.errors import Check
from pipelines.estimation.checks.gravity_fit import (
    ColumnOrder,
    GravityFit,
    GravityModel,
    search_orders,
)
from pipelines.estimation.checks.rows import (
    GenericArm,
    Sampled,
    generic_arm,
    sample_motion,
    torque_rows,
)
from pipelines.estimation.config import BoundaryConfig
from pipelines.io.log import Array, ExperimentLog
from pipelines.quality.segments import Usable
from pipelines.quality.subject import Subject

_STANDARD_GRAVITY = 9.80665  # numerics: [m/s^2]
_MOVING = ("excitation", "free", "writing")
_AXES = np.concatenate([np.eye(3), -np.eye(3)])
_SHORT = 8  # numerics: samples: a shorter run tells neither noise nor motion
# other codes that a boundary finding brings about, on the same logs: they are left out
_FOLLOWERS = ("RRID-S14", "RRID-S15", "RRID-D09", "RRID-D05")


@dataclass(frozen=True)
class Share:
    """Share of a part of the torque; of gravity 1 is all of the gravity, of friction the share is
    that of the torque: mean power over RMS torque times RMS speed, 1 where all of it is friction.
    """

    share: float | None  # of all joints; null: not identifiable
    std: float | None  # standard deviation of `share`
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
    best: tuple[float, ...] = ()  # [m/s^2] the vector that fits best, well known or not
    reason: str = ""  # why a value is not identifiable; else empty


@dataclass(frozen=True)
class JointOrder:
    """Order of the joints' columns in the log."""

    # column of the log, from 1, that each joint has; null: not identifiable
    columns: tuple[int, ...] | None
    # signals whose columns are out of order: "q and tau", "q" or "tau"; empty where none is
    signal: str
    before: float | None = None  # residual over the torque with the columns as logged
    after: float | None = None  # residual over the torque in the best other order that was tried
    reason: str = ""  # why a value is not identifiable; else empty


@dataclass(frozen=True)
class NotIdentifiable:
    """Quantity that no log of this kind determines."""

    what: str  # quantity
    reason: str  # what it is confused with, and what would tell


_NEVER = (
    NotIdentifiable(
        "compensated payload",
        "a payload that the controller subtracts is absorbed by the last links' masses: diagnose "
        "against reference logs",
    ),
    NotIdentifiable(
        "joint zero", "a joint zero that is off is absorbed by the links' centres of mass"
    ),
)


@dataclass(frozen=True)
class Boundary:
    """Torque boundary: sign, parts, direction of gravity and order of the logged torque."""

    # "joint": without the friction of the drive; "motor": with it; null: not identifiable
    side: str | None
    sign: str | None  # "signed" or "magnitude"; null: not identifiable
    gravity: Share  # share of the gravity torque
    friction: Share  # share of friction
    direction: Direction  # of gravity
    order: JointOrder  # of the joints' columns
    evidence: tuple[str, ...]  # what the answers rest on
    fitted: tuple[str, ...]  # logs that were looked at
    without_gravity: bool = False  # whether the torque lacks the gravity that the description has
    turned: bool = False  # whether gravity points elsewhere than the description has it
    not_identifiable: tuple[NotIdentifiable, ...] = _NEVER  # what no log of this kind tells


def torque_boundary(
    logs: Sequence[ExperimentLog], config: BoundaryConfig | None = None
) -> Boundary | None:
    """Return what the torque of `logs`, of one robot, is; None where none of them moves the arm.

    A fit that fails numerically leaves what it tells not identifiable, and the reason says so.
    """
    config = config or BoundaryConfig()
    moving = [log for log in logs if log.origin != "planned" and log.experiment in _MOVING]
    roles = ("identify", "validate", "reference")
    of_roles = [[log for log in moving if log.role == role][:4] for role in roles]
    subjects = map(Subject, next(filter(None, of_roles), moving[:4]))
    usable = [s.good for s in subjects if s.sampled and s.good.time.known and s.good.runs]
    if not any(np.isfinite(one.log.tau[run]).any() for one in usable for run in one.runs):
        return None
    robot, names = usable[0].log.robot, tuple(one.log.name for one in usable)
    sign, evidence = _sign(usable, config)
    reason = "not identifiable from magnitudes"
    if sign != "magnitude":
        try:
            arm = generic_arm(robot)
            motions = [m for one in usable if (m := sample_motion(one)) and len(m.t) > 1]
            if sum(len(motion.t) for motion in motions) < 4 * (len(arm.columns) + 6):
                return None
            estimate = _Estimate(np.array(robot.gravity), arm, motions, config)
            return estimate.boundary(names, sign, evidence)
        except (ArithmeticError, np.linalg.LinAlgError, ValueError) as error:
            reason = f"not identifiable: the fit failed: {error}"
    nothing, order = Share(None, None, reason=reason), JointOrder(None, "", reason=reason)
    direction = Direction(None, None, robot.gravity, None, reason=reason)
    return Boundary(None, sign, nothing, nothing, direction, order, (evidence,), names)


def _sign(logs: Sequence[Usable], config: BoundaryConfig) -> tuple[str | None, str]:
    """Return whether the torque is signed or a magnitude, and what that rests on.

    One genuine negative value proves a sign. A torque that comes down to zero again and again and
    never crosses it is a magnitude: of a smooth signal, zero is crossed where it is reached, except
    by chance.
    """
    touches = []
    for j in range(logs[0].log.n_joints):
        parts = [(one.log.tau[run, j], one.log.q[run, j]) for one in logs for run in one.runs]
        touches.append(touches_of_zero(parts, config))
    counts = [count for count in touches if count is not None]
    if len(counts) < len(touches):
        signed = ", ".join(str(j) for j, count in enumerate(touches, 1) if count is None)
        return "signed", f"the torque of joint {signed} changes its sign"
    if max(counts) >= config.touches:
        times = ", ".join(map(str, counts))
        words = f"no torque is ever negative, though they come down to zero {times} times while "
        return "magnitude", f"{words}the joints move"
    if any(counts):  # a load on one side: the same as its magnitude
        return None, "no torque changes its sign"
    return "signed", "no torque changes its sign, or comes near zero"


def touches_of_zero(parts: Sequence[tuple[Array, Array]], config: BoundaryConfig) -> int | None:
    """Return how often a joint's torque comes down to zero from above, of stretches (torque, q).

    None where it is negative as well, or its noise hides whether it is.
    """
    size = np.sqrt(np.nanmean(np.concatenate([tau for tau, _ in parts]) ** 2)) if parts else 0.0
    count = 0
    for tau, q in parts:
        if tau.size < _SHORT:
            continue
        speed = np.abs(np.gradient(q))
        moving = speed > config.standing * np.sqrt(np.nanmean(speed**2))
        # of white noise the second difference has six times the variance
        bends = np.abs(np.diff(tau, 2))
        bends = bends[np.isfinite(bends)]
        noise = 1.4826 * float(np.median(bends)) / np.sqrt(6.0) if bends.size else 0.0
        level = config.no_negative * noise
        if level > config.far * size and np.nanmin(tau) < 0.0:  # such noise would hide a sign
            return None
        if np.nansum(tau < -max(level, 1e-6 * size)) > max(2.0, 1e-3 * tau.size):
            return None
        # a magnitude is reflected at zero: it arrives there within one step of its own
        step = np.minimum(np.abs(np.diff(tau, prepend=tau[:1])), config.near * size)
        near, there = (tau < np.maximum(step, least) for least in (level, noise))
        if near.any() and np.mean(tau[near] < 0.0) > config.below:
            return None
        state = np.where(there & moving, 1, np.where(tau > config.far * size, -1, 0))
        state = state[state != 0]
        count += int(np.sum((state[1:] == 1) & (state[:-1] == -1)))
    return count


@dataclass(frozen=True, eq=False)
class _Fits:
    """The fits of one order of columns."""

    model: GravityModel
    described: GravityFit
    none: GravityFit
    best: GravityFit  # any vector
    turned: tuple[GravityFit, ...]  # vectors of 9.8 m/s^2, the best of each region first


@dataclass(frozen=True, eq=False)
class _Estimate:
    """The torque boundary of one robot's logs."""

    described: Array  # (3,) gravity
    arm: GenericArm
    motions: Sequence[Sampled]
    config: BoundaryConfig

    def boundary(self, names: tuple[str, ...], sign: str | None, evidence: str) -> Boundary:
        order, fits = self.ordered(self.fits())
        covariance, own, spread = fits.model.spread(fits.best)
        gravity, direction, removed, turned = self.gravity(fits, covariance)
        friction = self.friction(fits.model.rows.dissipated, own, spread)
        little = friction.upper is not None and friction.upper < self.config.friction_absent
        sides = {True: None if little else "motor", False: "joint", None: None}
        if order.signal:
            removed = turned = False  # the order first: it is what the rest rests on
        percent = [f"{100.0 * fit.rms:.2g} %" for fit in (fits.described, fits.none, fits.best)]
        told = f"the model leaves {percent[0]} of a joint's torque with gravity as described, "
        told += f"{percent[1]} without gravity, {percent[2]} with the gravity vector that fits best"
        parts = (gravity, friction, direction, order, (evidence, told))
        return Boundary(sides[friction.present], sign, *parts, names, removed, turned)

    def fits(self, order: ColumnOrder | None = None) -> _Fits:
        """Fit the gravity from the described one, from none and from every axis."""
        orders = (None, None) if order is None else (order.q, order.tau)
        rows = torque_rows(self.arm, self.motions, *orders)
        model = GravityModel(rows, self.config.model_error)
        here = [self.described] if np.any(self.described) else []
        starts = [*here, *(_STANDARD_GRAVITY * _AXES)]
        first = max(map(model.fit, (np.zeros(3), *starts)), key=lambda fit: fit.score)
        model.count_independent(model.search(first.gravity))
        turned: list[GravityFit] = []
        tried = [model.search(start, _STANDARD_GRAVITY) for start in starts]
        for fit in sorted(tried, key=lambda fit: -fit.score):
            apart = (_angle(fit.gravity, other.gravity) for other in turned)
            if all(angle > self.config.tilt for angle in apart):
                turned.append(fit)
        none = model.fit(np.zeros(3))
        free = [model.search(fit.gravity) for fit in (none, *turned[:2])]
        best = max([*free, none, *turned], key=lambda fit: fit.score)
        return _Fits(model, model.fit(self.described), none, best, tuple(turned))

    def ordered(self, fits: _Fits) -> tuple[JointOrder, _Fits]:
        """Return the order of the columns, and the fits under it."""
        config, rows, best = self.config, fits.model.rows, fits.best
        n = len(rows.tau)
        same = JointOrder(tuple(range(1, n + 1)), "")
        travel = np.ptp(np.concatenate([motion.q for motion in self.motions]), axis=0)
        moving = np.flatnonzero(travel > config.held * travel.max()).tolist()
        tried = search_orders(self.arm, self.motions[0], self.described, moving, best, config)
        if not tried:
            return same, fits
        # all orders by one number of independent moments, that of the order that leaves the least
        variances, moments = map(np.stack, zip(*map(self.by_column, tried), strict=True))
        gains = np.log(best.variance / variances)
        likelihoods = 0.5 * gains @ moments[np.argmin(np.log(variances).sum(axis=1))]
        top = int(np.argmax(likelihoods))
        least = np.minimum(fits.model.effective, moments[top])
        # moments that the parameters take up are no evidence
        free = 1.0 - (rows.inertial.shape[2] + n * rows.own.shape[2]) / float(least.sum())
        gain = 0.5 * max(free, 0.0) * float(gains[top] @ least)
        mistaken = best.score > fits.described.score + config.decisive
        if gain < (config.decisive if mistaken else -config.alike):
            return same, fits
        chosen, other = tried[top], self.fits(tried[top])
        same = replace(same, before=best.rms, after=other.best.rms)
        if gain > config.decisive and other.best.power < config.explained * best.power:
            near = np.flatnonzero(likelihoods > likelihoods[top] - config.alike)
            columns = tuple(k + 1 for k in chosen.order)
            order = replace(same, columns=columns, signal=chosen.signal)
            if len(near) > 1:
                orders = "; ".join(f"{tried[k].signal} {tried[k].listed}" for k in near)
                order = replace(order, columns=None, reason=f"several orders fit alike: {orders}")
            return order, other
        if mistaken:
            return same, fits
        reason = "not identifiable: the torque is explained as well if "
        reason += f"{chosen.signal} are in the order {chosen.listed}"
        return replace(same, reason=reason), fits

    def by_column(self, order: ColumnOrder) -> tuple[Array, Array]:
        """Return the relative residual variance and the number of independent moments (n,) of each
        column of the torque in another order.
        """
        rows = torque_rows(self.arm, self.motions, order.q, order.tau)
        model = GravityModel(rows, self.config.model_error)
        fit = model.search(self.described)
        model.count_independent(fit)
        joint = np.argsort(order.tau)
        return fit.variance[joint], model.effective[joint]

    def gravity(self, fits: _Fits, covariance: Array) -> tuple[Share, Direction, bool, bool]:
        """Return share and direction of the gravity, whether it is absent, and whether it is
        turned from the described one.
        """
        config, described = self.config, self.described
        best, none, top = fits.best, fits.none, fits.turned[0]
        absent = none.score > top.score and bool(np.any(described))
        along = described if absent else top.gravity
        along = along / np.linalg.norm(along)
        share = float(best.gravity @ along) / _STANDARD_GRAVITY
        variance = max(float(along @ covariance @ along), 0.0)
        std = float(np.sqrt(variance)) / _STANDARD_GRAVITY
        drop = 2.0 * max(best.score - top.score, 1e-3)
        if abs(share - 1.0) > 3.0 * std and drop < 2.0 * config.alike:
            std = abs(share - 1.0) / float(np.sqrt(drop))  # the whole size explains the torque too
        across = np.sqrt(max(float(np.trace(covariance)) - variance, 0.0)) / _STANDARD_GRAVITY
        known = std < config.undetermined and across < config.wide
        present = _present(top, none, (share, std) if known else None, config)
        found = Share(share, std, present=present)
        if not known or present is None:
            reason = "not identifiable: this motion does not tell the size of gravity"
            found = Share(None, None, present=present, reason=reason)
        told = tuple(described.tolist())
        if present is False:
            lacks = none.score > fits.described.score + config.decisive
            nowhere = Direction(None, None, told, None, (), "the torque holds no gravity")
            return found, nowhere, bool(np.any(described)) and lacks, False
        angle, pointing = _angle(top.gravity, described), tuple(map(float, top.gravity))
        turned = top.power < config.explained * fits.described.power and angle > config.tilt
        turned = turned and top.score > self.tilted(fits) + config.decisive
        sideways = np.linalg.svd(along[None])[2][1:]
        spread = float(np.linalg.eigvalsh(sideways @ covariance @ sideways.T)[-1])
        spread = float(np.arctan(np.sqrt(max(spread, 0.0)) / _STANDARD_GRAVITY))
        reason = ""
        if any(fit.score > top.score - config.alike for fit in fits.turned[1:]):
            reason = "not identifiable: gravity in another direction explains the torque as well"
        elif spread > config.direction_std:
            reason = f"not identifiable to better than {np.degrees(2.0 * spread):.0f} degrees"
        if reason:
            return found, Direction(None, None, told, None, pointing, reason), False, turned
        return found, Direction(pointing, spread, told, angle, pointing), False, turned

    def tilted(self, fits: _Fits) -> float:
        """Return the best score of all gravities that a tilted mounting leaves of the described."""
        if not np.any(self.described):
            return fits.described.score
        tilt = self.config.tilt
        near = [fit.score for fit in fits.turned if _angle(fit.gravity, self.described) < tilt]
        along = self.described / np.linalg.norm(self.described)
        turns = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
        side = np.stack([np.cos(turns), np.sin(turns)], axis=1) @ np.linalg.svd(along[None])[2][1:]
        vectors = [along]
        for angle in (0.5 * tilt, tilt):
            vectors += list(np.cos(angle) * along + np.sin(angle) * side)
        return max(*near, *(fits.model.fit(_STANDARD_GRAVITY * v).score for v in vectors))

    def friction(self, dissipated: Array, own: Array, covariance: Array) -> Share:
        """Return the share of friction: of each joint the power that it takes, over the RMS of
        torque and speed.

        s_j = <τ_f v> / (rms τ · rms v)        linear, signed, for any friction law
        """
        config, (n, c) = self.config, own.shape
        weights = (np.eye(n)[:, :, None] * dissipated).reshape(n, n * c)
        moves = np.any(dissipated != 0.0, axis=1)  # a joint that is held has none to tell
        each = weights @ own.ravel()
        std = np.sqrt(np.maximum(np.einsum("jk,kl,jl->j", weights, covariance, weights), 0.0))
        # by the balance of energy a cycle dissipates no more than the torque's power
        told = moves & (std < config.undetermined) & (np.abs(each - 0.5) < 0.5 + 2.0 * std)
        unknown = "not identifiable: the motion does not tell friction from none"
        if not told.any():
            return Share(None, None, reason=unknown)
        absent, floor = config.friction_absent, 0.1 * config.friction_absent
        sure = told / (std**2 + floor**2)  # a joint whose friction no motion tells has no say
        mean = sure @ weights / float(sure.sum())
        share = float(mean @ own.ravel())
        deviation = float(np.sqrt(max(mean @ covariance @ mean, 0.0)))
        upper = share + 2.0 * deviation
        read, present = told & (std < absent), None
        some = bool((each - 3.0 * std > absent)[told].any())
        reason = unknown
        if some or share > 3.0 * np.hypot(deviation, floor):
            present, reason = True, ""
        elif (
            read.any()
            and upper < absent
            and share <= 3.0 * deviation
            and (each + 2.0 * std < 2.0 * absent)[read].all()
        ):
            present = False
            reason = "compensated friction and a torque measured beyond the gear are one "
            reason += "answer here: they differ by the rotor inertia alone"
        if 3.0 * deviation < share < upper < absent and present is not False:
            reason = "so little that it may be a direct drive, or what compensation leaves"
        return Share(share, deviation, present, upper, reason)


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
        half = top.power < config.explained * none.power
        return True if half and top.score > none.score + config.alike else None
    low, high = share[0] - 2.0 * share[1], share[0] + 2.0 * share[1]
    if high < config.absent:  # balanced links have no gravity either
        return False if none.score > top.score + config.alike else None
    return True if low > config.absent else None


def _angle(one: Array, other: Array) -> float:
    """Return the angle [rad] between two vectors; π/2 where one is zero."""
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    return float(np.arccos(np.clip(one @ other / size, -1.0, 1.0))) if size > 0.0 else 0.5 * np.pi


def boundary_findings(boundary: Boundary | None, where: str) -> tuple[Check, ...]:
    """Return the gate that `boundary` closes: S13, S23, S24 or S25.

    Args:
        where: the log or the folder that it is of.
    """
    if boundary is None:
        return ()
    order, direction = boundary.order, boundary.direction
    if boundary.sign == "magnitude":
        code, words = "S25", f"tau has no sign: {boundary.evidence[0]}"
        remedy = "log the signed torque or current; magnitudes fit no model of the arm"
    elif order.signal:
        code, where, words = "S13", f"{where}, signal {order.signal}", order.reason
        if order.columns is not None:
            moved = [k for k, column in enumerate(order.columns, 1) if column != k]
            how = f"in the order {','.join(str(order.columns[k - 1]) for k in moved)}"
            how = "swapped" if len(moved) == 2 else how
            words = f"columns {','.join(map(str, moved))} fit {how}"
        words = f"{order.signal}: {words}, residual {order.before:.2f} -> {order.after:.2f}"
        remedy = "put the columns in the order of the robot's joints: correct the column map of "
        remedy += "the import"
    elif boundary.without_gravity:
        code, words = "S23", "torque holds no gravity: compensated? Its share is "
        words += f"{boundary.gravity.share:.2f} ± {boundary.gravity.std:.2f}"
        remedy = "log the torque with the gravity compensation in it, or write "
        remedy += "gravity = [0, 0, 0] in the robot's description"
    elif boundary.turned:
        vector = np.array(direction.best) * _STANDARD_GRAVITY / np.linalg.norm(direction.best)
        told = f"[{', '.join(f'{x:.2f}' for x in np.round(vector, 2) + 0.0)}]"
        known = ", one of several directions that fit alike" if direction.vector is None else ""
        code, words = "S24", f"gravity points elsewhere: the torque has gravity = {told}{known}, "
        words += f"the description [{', '.join(f'{x:.2f}' for x in direction.described)}]"
        remedy = f"write gravity = {told} in the robot's description (for a URDF under [robot] in "
        remedy += "the recipe of the import), or correct its base frame"
    else:
        return ()
    return (Check.of(code, "warn", words, where=where, gate=True, remedy=remedy),)


def without_followers(checks: Iterable[Check], findings: Sequence[Check]) -> tuple[Check, ...]:
    """Return `checks` without those that a boundary finding brings about."""
    if not findings:
        return tuple(checks)
    return tuple(check for check in checks if check.code not in _FOLLOWERS or not check.gate)
