"""The arm as a target holds it: frames, links, the terms of each joint, and the fate of each cause.

    held = held_by(target, folded(arm), links, motion)
    held.joints          frames, axes, pseudo-inertias, limits, names
    held.arm             the causes that are carried exactly, as an arm of ours
    held.terms           damping, springs and drives, one a joint

A cause that moves base parameters, geometry or gravity (a payload, a longer link, a base that is
not level) goes into the links themselves. What a target has no term for is fitted by the terms it
has, over a motion; how much torque that costs is measured there.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from pipelines.dynamics.altered import chain_of
from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.kinematics import Placement
from pipelines.effects import find_effect
from pipelines.estimation.consistency import Links, pseudo_inertia
from pipelines.export.config import EXPORT
from pipelines.io.robot import RobotDescription
from pipelines.io.urdf import chain_from_urdf

__all__ = ["Cause", "ExportJoint", "Held", "JointTerms", "Loaded", "Target", "folded", "held_by",
           "identifier", "rms"]  # fmt: skip

_NOWHERE = Placement(np.eye(3), np.zeros(3))
_RESERVED = ("world", "universe")  # of MuJoCo's and Pinocchio's root
_ROUNDING = 1e-15  # numerics: of a rotation


@dataclass(frozen=True, eq=False)
class ExportJoint:
    """A moving joint and its link, whose frame has the link's axes and its origin on the joint."""

    name: str
    link: str
    revolute: bool
    origin: Placement  # in the frame of the link before it, at zero of the log
    axis: Array  # (3,) unit vector in the link's frame
    inertia: Array  # (4, 4) pseudo-inertia about the link's frame
    position: tuple[float, float]  # [rad] range
    velocity: float  # [rad/s]
    torque: float  # [N m]

    def inertial(self) -> tuple[float, Array, Array]:
        """Return mass, centre of mass and inertia about it: tr(Σ_c) 1 - Σ_c, Σ_c = Σ - m c cᵀ."""
        mass = float(self.inertia[3, 3])
        center = self.inertia[:3, 3] / mass
        second = self.inertia[:3, :3] - mass * np.outer(center, center)
        return mass, center, np.trace(second) * np.eye(3) - second


@dataclass(frozen=True)
class JointTerms:
    """The terms of a target at a joint besides the link; zero where there is nothing."""

    rotor: float = 0.0  # [kg m^2]
    damping: tuple[float, ...] = (0.0, 0.0, 0.0)  # of v, v |v|, v^3
    friction: float = 0.0  # [N m] times sign(v)
    stiffness: tuple[float, ...] = (0.0, 0.0, 0.0)  # of x, x^2, x^3, x = q - rest
    rest: float = 0.0  # [rad]
    offset: float = 0.0  # [N m]
    gain: float = 1.0  # torque at the joint = gain * command
    limit: float = np.inf  # [N m] of the command
    lag: float = 0.0  # [s] of the drive


@dataclass(frozen=True)
class Cause:
    """The fate of one cause of the model."""

    place: str  # "cogging:2"
    carried: str  # "exactly", "approximated" or "lost"
    how: str = ""
    cost: Array | None = None  # [N m] (joints,) torque error rms on the motion
    share: float | None = None  # of the largest joint's torque rms


@dataclass(frozen=True, eq=False)
class Loaded:
    """The torque of an exported text in the program that loaded it."""

    program: str  # its name and version
    torque: Array  # (samples, joints)
    says: str = ""  # warnings of the program


@dataclass(frozen=True, eq=False)
class Held:
    """An arm as a target holds it."""

    name: str
    root: str
    joints: tuple[ExportJoint, ...]
    tip: str
    tool: Placement  # of the tip in the last link's frame
    gravity: Array  # (3,) [m/s^2]
    notes: tuple[str, ...]  # what differs from the description
    arm: Arm  # with the causes that are carried exactly
    links: Links
    causes: tuple[Cause, ...]
    terms: tuple[JointTerms, ...]
    fits: Array  # (joints, 4) of sign(v), v, v |v|, v^3, for causes without a term

    def torque(self, motion: Motion, target: Target) -> Array:
        """Return what the exported file should show: carried causes, and those fitted."""
        fitted = np.einsum("skj,jk->sj", _speed_columns(motion.dq), self.fits)
        gains = [term.gain for term in self.terms]
        return np.asarray(target.seen(self.arm).torque(motion) + fitted / gains)


@dataclass(frozen=True)
class Target:
    """A form that a model is exported to."""

    # a cause as the target has it exactly, or None
    carry: Callable[[Acting], Acting | None]
    write: Callable[[Held], tuple[dict[str, str], tuple[str, ...]]]  # file -> text; what it lacks
    # the torque of these texts in the target; None where it is not installed
    load: Callable[[Mapping[str, str], Held, Motion], Loaded | None]
    needs: str  # package that loads it
    consistent: bool = True  # it holds links, which must exist; else base parameters
    columns: int = 0  # how many of sign(v), v, v |v|, v^3 it has for other causes
    forward_only: tuple[str, ...] = ()  # carried in a simulation, not in inverse dynamics
    # positions in windows of a log, where the target simulates
    simulate: Callable[..., Array | None] | None = None
    reader: Callable[[Held], str] = lambda held: ""  # which version of it the file needs
    # written with an error that is measured, and how
    approximated: Mapping[str, str] = field(default_factory=dict)

    def seen(self, arm: Arm) -> Arm:
        """Return the arm without the causes that inverse dynamics of the target does not show."""
        return _chosen(arm, lambda a: None if a.effect.name in self.forward_only else a)

    def exact(self, arm: Arm) -> Arm:
        """Return the arm without the causes that are written with an error."""
        return _chosen(arm, lambda a: None if a.effect.name in self.approximated else a)


def folded(arm: Arm) -> Arm:
    """Return the arm whose body has every cause that moves base parameters, geometry or gravity.

    The outermost cause changes the arm first, as in `Arm.torque`.
    """
    inside, kept = arm.nominal, list[Acting]()
    for acting in reversed(arm.effects):
        changed = acting.effect.simulate(inside, acting.values).arm
        if changed is None:
            kept.insert(0, acting)
            continue
        inside = inside.with_body(changed.body, changed.p)
        values = acting.values
        if values.get("waist_sine") or values.get("waist_cosine"):  # a weight beside the tilt
            kept.insert(0, _weight(values["waist_sine"], values["waist_cosine"]))
    return replace(inside, effects=tuple(kept), extends=None)


def _weight(sine: float, cosine: float) -> Acting:
    """Return S sin q + C cos q on joint 1 as a wave of order 1."""
    effect = find_effect("cogging")(joint=1)
    values = dict.fromkeys((q.name for q in effect.parameters), 0.0)
    wave = {"order": 1.0, "amplitude": math.hypot(sine, cosine), "phase": math.atan2(cosine, sine)}
    return Acting.of(effect, values | wave, origin="assumed")


def held_by(target: Target, arm: Arm, links: Links, course: Motion, motion: Motion) -> Held:
    """Return what a target holds of a folded arm.

    Other causes are fitted over `course`, which has all speeds that the model is valid for, and
    their cost is measured on `motion`.
    """
    kept = dict[Acting, Acting | None]()
    for acting in (*arm.friction, *arm.effects):
        known = {(a.effect.name, a.effect.joint) for a, held in kept.items() if held is not None}
        twice = (acting.effect.name, acting.effect.joint) in known and target.columns > 0
        # a joint of URDF or MJCF has one spring and one lag
        single = acting.effect.name in ("spring", "drive_lag")
        kept[acting] = None if twice and single else target.carry(acting)
    exact = _chosen(arm, kept.get)
    terms = _terms(exact)
    fits = np.zeros((arm.n_joints, 4))
    if target.columns:
        missing = target.seen(arm).torque(course) - target.seen(exact).torque(course)
        fits = _fitted(course, missing * [term.gain for term in terms], target.columns)
        terms = [
            replace(term, friction=dry, damping=tuple(np.add(term.damping, more).tolist()))
            for term, (dry, *more) in zip(terms, fits.tolist(), strict=True)
        ]
    causes = [_cause(target, arm, held, course, motion) for held in kept.items()]
    (root, *links_named, tip), joints_named, axes, notes = _names(arm.robot)
    chain, joints, before = chain_of(arm.body), list[ExportJoint](), _NOWHERE
    for i, described in enumerate(arm.robot.joints):
        turn, at = chain.after[i].rotation, float(chain.offset[i])
        zero = Placement(np.eye(3), np.array([0.0, 0.0, at]))
        if described.revolute:
            c, s = np.cos(at), np.sin(at)
            zero = Placement(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]), np.zeros(3))
        origin = before @ chain.before[i] @ zero @ Placement(turn, np.zeros(3))
        before = Placement(np.eye(3), turn.T @ chain.after[i].position)
        limits = described.position, described.velocity, described.torque
        clean = Placement(_clean(origin.rotation), _clean(origin.position))
        inertia = pseudo_inertia(links.phi[i : i + 1])[0]
        own = joints_named[i], links_named[i], described.revolute
        joints.append(ExportJoint(*own, clean, _clean(turn.T[:, 2]), inertia, *limits))
    tool = before @ Placement(axes, chain.tip)
    body = identifier(arm.name), root, tuple(joints), tip, tool, chain.gravity
    return Held(*body, notes, exact, links, tuple(causes), tuple(terms), fits)


def _chosen(arm: Arm, choose: Callable[[Acting], Acting | None]) -> Arm:
    """Return the arm with its causes as `choose` gives them."""
    friction, effects = (
        tuple(one for one in map(choose, members) if one is not None)
        for members in (arm.friction, arm.effects)
    )
    return replace(arm, friction=friction, effects=effects, extends=None)


def _cause(
    target: Target, arm: Arm, held: tuple[Acting, Acting | None], course: Motion, motion: Motion
) -> Cause:
    """Return the fate of a cause; it costs what the best fit of it alone leaves on the motion."""
    acting, own = held
    if own is acting:
        return Cause(acting.place, "exactly")
    other = _chosen(arm, lambda one: own if one is acting else one)
    lost, rest = (arm.torque(m) - other.torque(m) for m in (course, motion))
    costly, parts = rms(rest), _speed_columns(course.dq)[:, : target.columns]
    left, there = lost.copy(), _speed_columns(motion.dq)[:, : target.columns]
    for j, x in enumerate(lost.T):
        fit = np.linalg.lstsq(parts[..., j], x, rcond=None)[0]
        left[:, j] -= parts[..., j] @ fit
        rest[:, j] -= there[..., j] @ fit
    explained = float(np.sum(left**2)) < (1.0 - EXPORT.explained) * float(np.sum(lost**2))
    cost = rms(rest) if explained else costly
    share = float(cost.max() / max(rms(arm.torque(motion)).max(), 1e-300))
    how = "by friction and damping of the joint" if explained else ""
    how = f"in part, {how}".strip(", ") if own is not None else how
    known = explained or own is not None
    return Cause(acting.place, "approximated" if known else "lost", how, cost, share)


def _speed_columns(v: Array) -> Array:
    """Return sign(v), v, v |v|, v^3 (samples, 4, joints)."""
    return np.stack([np.sign(v), v, v * np.abs(v), v**3], axis=1)


def _fitted(motion: Motion, torque: Array, count: int) -> Array:
    """Return the fit (joints, 4), none negative: friction takes power out of a joint."""
    from scipy.optimize import nnls

    parts, fits = _speed_columns(motion.dq), np.zeros((torque.shape[1], 4))
    for j, column in enumerate(torque.T):
        fits[j, :count] = nnls(parts[:, :count, j], column)[0]
    return fits


def _terms(arm: Arm) -> list[JointTerms]:
    """Return the terms of exactly carried causes; those of the body and of C or JSON have none.

    A cause outside of a torque gain g adds its load to the log: inside it is g times as large,

        τ / g + x = (τ + g x) / g
    """
    terms = [JointTerms()] * arm.n_joints
    for acting in (*arm.friction, *arm.effects):
        x, k = acting.values, (acting.effect.joint or 1) - 1
        old = terms[k]
        a, b, c = old.damping
        match acting.effect.name:
            case "viscous":
                terms[k] = replace(old, damping=(a + old.gain * x["coefficient"], b, c))
            case "quadratic_drag":
                terms[k] = replace(old, damping=(a, b + old.gain * x["coefficient"], c))
            case "rotor_inertia":
                terms[k] = replace(old, rotor=old.rotor + old.gain * x["inertia"])
            case "spring":
                powers = (old.gain * x[key] for key in ("stiffness", "curvature", "hardening"))
                terms[k] = replace(old, stiffness=tuple(powers), rest=x["rest_angle"])
            case "torque_offset":
                terms[k] = replace(old, offset=old.offset + old.gain * x["offset"])
            case "torque_gain":
                gain = 1.0 + x["gain_error"]
                terms[k] = replace(old, gain=old.gain * gain, limit=old.limit / gain)
            case "torque_saturation":
                terms[k] = replace(old, limit=min(old.limit, x["limit"]))
            case "drive_lag":
                terms[k] = replace(old, lag=x["time_constant"])
    return terms


def _names(robot: RobotDescription) -> tuple[list[str], list[str], Array, tuple[str, ...]]:
    """Return names of root, links and tip, and of joints, each safe; the axes of the tip; notes.

    Of a URDF they are its own.
    """
    from xml.etree import ElementTree

    root, tip, rotation = "base", "tip", np.eye(3)
    links = [f"link{i + 1}" for i in range(robot.n_joints)]
    notes = [f"zero of '{j.name}': that of the logs, {j.offset:g} off the description's"
             for j in robot.joints if j.offset]  # fmt: skip
    if robot.convention == "urdf" and robot.urdf_text:
        own = chain_from_urdf(robot.urdf_text, robot.tip_link)  # refuses what no parser should see
        tree = ElementTree.fromstring(robot.urdf_text)
        child = {
            j.get("name"): e.get("link", "") for j in tree.iter("joint") for e in j.iter("child")
        }
        every = [str(link.get("name")) for link in tree.iter("link")]
        links = [child[joint.name] for joint in own.joints]
        root = next(name for name in every if name not in child.values())
        rotation, tip = own.tip_rotation, own.tip_link
        if merged := [name for name in every if name not in (root, tip, *links)]:
            notes.append(f"links fixed to others are merged into them: {', '.join(merged)}")
        tip = f"{tip}_tip" if tip in (root, *links) else tip
    wanted, safe, joints = [root, *links, tip], list[str](), list[str]()
    for name in wanted:
        safe.append(identifier(name, safe))
    for joint in robot.joints:
        joints.append(identifier(joint.name, joints))
    pairs = zip([*wanted, *(j.name for j in robot.joints)], [*safe, *joints], strict=True)
    notes += [f"'{old}' is called '{new}'" for old, new in pairs if old != new]
    return safe, joints, rotation, tuple(notes)


def identifier(name: str, taken: Sequence[str] = ()) -> str:
    """Return a name of letters, digits, "_", "-" and "." that no reader takes for another."""
    safe = re.sub(r"[^A-Za-z0-9_.-]", "_", name.strip()) or "_"
    safe += "_link" if safe.lower() in _RESERVED else ""
    found, number = safe, 1
    while found in taken:
        number += 1
        found = f"{safe}_{number}"
    return found


def _clean(values: Array) -> Array:
    """Return it with zeros in place of the rounding of a cosine of 90 degrees."""
    return np.where(np.abs(values) < _ROUNDING, 0.0, values)


def rms(x: Array) -> Array:
    """Return the root of the mean square (joints,) over samples."""
    return np.asarray(np.sqrt(np.mean(x**2, axis=0)))
