"""Read the kinematics of a URDF, and nothing else of it.

    robot = import_urdf("arm.urdf")              limits and link parameters too, the text reduced to the chain's joints
    chain = chain_from_urdf(robot.urdf_text)     the joints' placements, for geometry
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt

from pipelines.errors import Check, InputRejected, UsageError
from pipelines.io.link_consistency import inconsistency
from pipelines.io.robot import Joint, LinkParameters, RobotDescription
from pipelines.io.urdf_tree import (
    Source,
    Tree,
    TreeJoint,
    below,
    number,
    read,
    read_origin,
    rotation_of,
    tree_of,
    way_to,
)

__all__ = ["JointPlacement", "UrdfChain", "chain_from_urdf", "import_urdf"]

Array = npt.NDArray[np.float64]

_GRAVITY = (0.0, 0.0, -9.81)
_OPEN = 1e16  # the limit that URDFs write for none


@dataclass(frozen=True, eq=False)
class JointPlacement:
    """One moving joint: its frame in the frame of the moving joint before it (of the root link for the first)."""

    name: str
    prismatic: bool
    rotation: Array  # (3, 3)
    position: Array  # (3,) [m]
    axis: Array  # (3,) unit vector in the joint's frame


@dataclass(frozen=True, eq=False)
class UrdfChain:
    """The moving joints from root to tip, and the tip link behind the last of them."""

    joints: tuple[JointPlacement, ...]
    tip_link: str
    tip_rotation: Array  # (3, 3)
    tip_position: Array  # (3,) [m]


def import_urdf(path: str | Path, tip_link: str | None = None) -> RobotDescription:
    """The robot of a URDF file: its joints, limits and link parameters; gravity is (0, 0, -9.81) m/s^2.

    Fixed joints are merged into the moving link before them, and so are branches that `tip_link` leaves aside,
    which are taken as held at zero.

    Raises:
        UsageError: no such file, not a URDF, or not a serial arm.
    """
    source = Source(str(path), UsageError)
    tree = tree_of(read(Path(path), source), source)
    way, tip = way_to(tree, tip_link, source)
    moving = [joint for joint in way if joint.moves]
    links = _merged_links(tree, moving, source)
    joints = tuple(Joint(j.name, "prismatic" if j.type == "prismatic" else "revolute", position=j.limits[0],
                         velocity=j.limits[1], torque=j.limits[2], link=link)
                   for j, link in zip(moving, links, strict=True))
    return RobotDescription(tree.name, _GRAVITY, "urdf", joints, urdf_text=_canonical(tree, way), tip_link=tip,
                            checks=_impossible_links(tree, source))


def chain_from_urdf(urdf_text: str, tip_link: str | None = None) -> UrdfChain:
    """The placements of the moving joints of a URDF that came with a log or a description.

    Raises:
        InputRejected: the text is not the URDF of a serial arm.
    """
    source = Source("urdf_text", InputRejected)
    way, tip = way_to(tree_of(urdf_text, source), tip_link, source)
    placed: list[JointPlacement] = []
    rotation, position = np.eye(3), np.zeros(3)
    for joint in way:
        rotation, position = rotation @ joint.rotation, rotation @ joint.position + position
        if joint.moves:
            placed.append(JointPlacement(joint.name, joint.type == "prismatic", rotation, position, joint.axis))
            rotation, position = np.eye(3), np.zeros(3)
    return UrdfChain(tuple(placed), tip, rotation, position)


def _merged_links(tree: Tree, moving: list[TreeJoint], source: Source) -> list[LinkParameters | None]:
    """The parameters of each moving body about its joint's frame, everything fixed to it included."""
    stop = frozenset(joint.name for joint in moving)
    return [_body(tree, joint.child, stop, source) for joint in moving]


def _body(tree: Tree, first: str, stop: frozenset[str], source: Source) -> LinkParameters | None:
    placed = {first: (np.eye(3), np.zeros(3))}
    mass, moment, inertia, known = 0.0, np.zeros(3), np.zeros((3, 3)), False
    for name in below(tree, first, stop):
        if name != first:
            joint = tree.into[name]
            r, p = placed[joint.parent]
            placed[name] = (r @ joint.rotation, r @ joint.position + p)
        element = tree.links[name].find("inertial")
        if element is not None:
            m, h, i = _inertial(element, *placed[name], f"link '{name}'", source)
            mass, moment, inertia, known = mass + m, moment + h, inertia + i, True
    if not known:
        return None
    com = moment / mass if mass else np.zeros(3)
    xx, yy, zz, xy, xz, yz = (inertia[k] for k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    # + 0.0: a zero product must not become -0.0 by the change of sign
    return LinkParameters(float(mass), (float(com[0]), float(com[1]), float(com[2])),
                          (float(xx), float(yy), float(zz), float(-xy + 0.0), float(-xz + 0.0), float(-yz + 0.0)))


def _impossible_links(tree: Tree, source: Source) -> tuple[Check, ...]:
    """S17: a warning for every link whose inertial parameters no rigid body has."""
    found = []
    for name, link in tree.links.items():
        element = link.find("inertial")
        if element is None:
            continue
        mass = number(element.find("mass"), "value", f"link '{name}'", source)
        if words := inconsistency(mass, _tensor(element, f"link '{name}'", source)):
            found.append(Check.of("S17", "warn", f"no rigid body has the inertial parameters of link '{name}': {words}",
                                  where=source.where, remedy="correct them in the URDF: what is known of its links is used"))
    return tuple(found)


def _tensor(element: Element, place: str, source: Source) -> Array:
    """The inertia (3, 3) about the centre of mass, in the axes of <inertial>."""
    xx, yy, zz, xy, xz, yz = (number(element.find("inertia"), k, place, source) for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _inertial(element: Element, r: Array, p: Array, place: str, source: Source) -> tuple[float, Array, Array]:
    """Mass, first moment and inertia tensor about the body's origin: I_o = R I_c Rᵀ + m (|c|² 1 - c cᵀ)."""
    mass = number(element.find("mass"), "value", place, source)
    if mass < 0.0:
        raise source.wrong(f"{place} has negative mass {mass}")
    xyz, rpy = read_origin(element, place, source)
    turn = r @ rotation_of(rpy)
    c = r @ xyz + p
    about_com = turn @ _tensor(element, place, source) @ turn.T
    return mass, mass * c, about_com + mass * (float(c @ c) * np.eye(3) - np.outer(c, c))


def _canonical(tree: Tree, way: list[TreeJoint]) -> str:
    """The shortest URDF with the same chain: link names, joint origins, axes and limits."""
    from xml.sax.saxutils import quoteattr  # brings urllib and ssl along: 25 ms

    lines = [f"<robot name={quoteattr(tree.name)}>", f"  <link name={quoteattr(tree.root)}/>"]
    for joint in way:
        (low, high), velocity, effort = joint.limits
        kind = "continuous" if joint.type == "revolute" and math.isinf(low) and math.isinf(high) else joint.type
        limits = {"velocity": velocity, "effort": effort}
        if math.isfinite(low) or math.isfinite(high):  # a range open at one end has no other form: without it, that end is 0
            limits |= {"lower": max(low, -_OPEN), "upper": min(high, _OPEN)}
        xyz, rpy = (" ".join(map(repr, map(float, v))) for v in joint.origin)
        lines += [f"  <link name={quoteattr(joint.child)}/>", f"  <joint name={quoteattr(joint.name)} type=\"{kind}\">",
                  f"    <origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>",
                  f"    <parent link={quoteattr(joint.parent)}/>", f"    <child link={quoteattr(joint.child)}/>"]
        if joint.moves:
            lines.append(f"    <axis xyz=\"{' '.join(repr(float(v)) for v in joint.axis)}\"/>")
            written = [f"{k}=\"{float(v)!r}\"" for k, v in limits.items() if math.isfinite(v)]
            lines += [f"    <limit {' '.join(written)}/>"] if written else []
        lines.append("  </joint>")
    return "\n".join([*lines, "</robot>", ""])
