"""Write a URDF, and load it again in Pinocchio.

Source   wiki.ros.org/urdf/XML; rotor inertia in Drake's elements, the only ones there are for it

A URDF has one gravity, downwards: where the model's points elsewhere, the base hangs from a fixed
joint that turns it. <inertia> holds the tensor, whose products are negative: ixy = -∫xy dm.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from xml.etree.ElementTree import Element, SubElement, fromstring, indent, tostring

import numpy as np

from pipelines.dynamics.arm import Acting
from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.kinematics import Placement
from pipelines.export.config import EXPORT
from pipelines.export.target import ExportJoint, Held, JointTerms, Loaded, Target, identifier

__all__ = ["URDF", "numbers", "other_gravity", "text_of"]

_LEVEL = 1e-12  # numerics: rounding of gravity
_DRAKE = "{http://drake.mit.edu}"


def _carry(acting: Acting) -> Acting | None:
    return acting if acting.effect.name in ("viscous", "rotor_inertia") else None


def _write(held: Held) -> tuple[dict[str, str], tuple[str, ...]]:
    """Return the text of a URDF, and what it cannot hold of the body."""
    robot, notes, parent = Element("robot", name=held.name), list[str](), held.root
    names = [joint.name for joint in held.joints]
    mount, flange = identifier("mount", names), identifier(f"{held.tip}_fixed", names)
    ground = identifier("ground", [held.root, held.tip, *(joint.link for joint in held.joints)])
    size = float(np.linalg.norm(held.gravity))
    notes += filter(None, [other_gravity(size)])
    if size and held.gravity[2] / size > -1.0 + _LEVEL:
        words = "gravity does not point along -z of the base: the base hangs turned from"
        notes.append(f"{words} the fixed joint '{mount}', so that it does in the world")
        SubElement(robot, "link", name=ground)
        _joined(robot, mount, "fixed", ground, held.root, _upright(-held.gravity / size))
    SubElement(robot, "link", name=held.root)
    for joint, terms in zip(held.joints, held.terms, strict=True):
        _link(robot, joint)
        _joint(robot, joint, terms, parent)
        parent = joint.link
        if not math.isfinite(joint.velocity) or not math.isfinite(joint.torque):
            words = f"'{joint.name}' has no limit of speed or torque: {EXPORT.unlimited:g}"
            notes.append(f"{words} is written, for a URDF must have one")
    SubElement(robot, "link", name=held.tip)
    _joined(robot, flange, "fixed", parent, held.tip, held.tool)
    return {f"{held.name}.urdf": text_of(robot)}, tuple(notes)


def other_gravity(size: float) -> str:
    """Return words about a gravity [m/s^2] that readers of a URDF do not take; else ""."""
    if abs(size - EXPORT.standard_gravity) <= _LEVEL:
        return ""
    words = f"gravity is {size:.6g} m/s^2, which a URDF cannot hold"
    return f"{words}: programs that read it take {EXPORT.standard_gravity:g}"


def text_of(root: Element) -> str:
    """Return the text of an XML tree."""
    indent(root)
    return tostring(root, encoding="unicode") + "\n"


def numbers(values: Array | tuple[float, ...]) -> str:
    """Return numbers with all their digits."""
    return " ".join(repr(float(x) + 0.0) for x in values)


def _rpy(r: Array) -> Array:
    """Return roll, pitch, yaw with R = Rz(yaw) Ry(pitch) Rx(roll).

    Roll is read off R without the yaw, so that near a pitch of ±90°, where both turn
    about one axis, the one makes up for rounding in the other.
    """
    yaw = math.atan2(r[1, 0], r[0, 0])
    c, s = math.cos(yaw), math.sin(yaw)
    left = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ r
    return np.array([math.atan2(-left[1, 2], left[1, 1]), math.atan2(-left[2, 0], left[0, 0]), yaw])


def _upright(up: Array) -> Placement:
    """Return how the base lies in a world whose z is `up`."""
    first = np.cross(np.eye(3)[int(np.argmin(np.abs(up)))], up)
    first /= np.linalg.norm(first)
    return Placement(np.stack([first, np.cross(up, first), up]), np.zeros(3))


def _joined(
    robot: Element, name: str, kind: str, parent: str, child: str, at: Placement
) -> Element:
    joint = SubElement(robot, "joint", name=name, type=kind)
    SubElement(joint, "origin", xyz=numbers(at.position), rpy=numbers(_rpy(at.rotation)))
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    return joint


def _link(robot: Element, joint: ExportJoint) -> None:
    mass, center, tensor = joint.inertial()
    inertial = SubElement(SubElement(robot, "link", name=joint.link), "inertial")
    SubElement(inertial, "origin", xyz=numbers(center), rpy="0 0 0")
    SubElement(inertial, "mass", value=repr(mass))
    pairs = [(i, j) for i in range(3) for j in range(i, 3)]
    moments = {f"i{'xyz'[i]}{'xyz'[j]}": repr(float(tensor[i, j])) for i, j in pairs}
    SubElement(inertial, "inertia", moments)


def _joint(robot: Element, joint: ExportJoint, terms: JointTerms, parent: str) -> None:
    low, high = joint.position
    limits = {"effort": joint.torque, "velocity": joint.velocity}
    free = joint.revolute and math.isinf(low) and math.isinf(high)
    if not free:
        limits |= {"lower": low, "upper": high}
    kind = "continuous" if free else "revolute" if joint.revolute else "prismatic"
    element = _joined(robot, joint.name, kind, parent, joint.link, joint.origin)
    SubElement(element, "axis", xyz=numbers(joint.axis))
    written = {k: float(np.clip(x, -EXPORT.unlimited, EXPORT.unlimited)) for k, x in limits.items()}
    SubElement(element, "limit", {key: repr(value) for key, value in written.items()})
    friction = {"damping": repr(terms.damping[0]), "friction": repr(terms.friction)}
    SubElement(element, "dynamics", friction)
    if terms.rotor:  # at joint side: a gear ratio of 1
        drive = SubElement(robot, "transmission", name=f"{joint.name}_drive")
        SubElement(drive, "type").text = "transmission_interface/SimpleTransmission"
        SubElement(drive, "joint", name=joint.name)
        motor = SubElement(drive, "actuator", name=f"{joint.name}_motor")
        SubElement(motor, f"{_DRAKE}gear_ratio", value="1")
        SubElement(motor, f"{_DRAKE}rotor_inertia", value=repr(terms.rotor))


def _load(texts: Mapping[str, str], held: Held, motion: Motion) -> Loaded | None:
    """Return inverse dynamics by Pinocchio, with friction, damping and rotor inertia of the URDF.

    Pinocchio reads damping and friction, and leaves them to the user; rotor inertia it reads from
    no URDF: it is taken from the file and given to its `armature`.
    """
    try:
        import pinocchio as pin
    except ImportError:
        return None
    (text,) = texts.values()
    model = pin.buildModelFromXML(text)
    model.gravity.linear = np.array([0.0, 0.0, -float(np.linalg.norm(held.gravity))])
    own = [model.joints[model.getJointId(joint.name)] for joint in held.joints]
    places, armature = [joint.idx_v for joint in own], np.zeros(model.nv)
    for drive in fromstring(text).iter("transmission"):
        name = next(str(e.get("name")) for e in drive.iter("joint"))
        rotor = next(float(e.get("value", "nan")) for e in drive.iter(f"{_DRAKE}rotor_inertia"))
        armature[model.joints[model.getJointId(name)].idx_v] = rotor
    model.armature, data, tau = armature, model.createData(), np.zeros(motion.q.shape)
    states = np.zeros((len(tau), 3, model.nv))
    states[:, :, places] = np.stack([motion.q, motion.dq, motion.ddq], axis=1)
    for row, (q, v, a) in enumerate(states):
        at = pin.integrate(model, pin.neutral(model), q)  # without limits: a point on a circle
        tau[row] = pin.rnea(model, data, at, v, a)[places]
    dry = np.asarray(model.upperDryFrictionLimit)[places]
    tau += np.asarray(model.damping)[places] * motion.dq + dry * np.sign(motion.dq)
    return Loaded(f"Pinocchio {pin.__version__}", tau)


URDF = Target(_carry, _write, _load, "pin", columns=2)
