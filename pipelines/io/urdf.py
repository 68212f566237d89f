"""Read the kinematics and the link parameters of a URDF: no mesh, entity or macro is followed.

robot = import_urdf("arm.urdf")              its text reduced to the joints of the chain
chain = chain_from_urdf(robot.urdf_text)     the placements of the joints, for geometry
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn
from xml.etree.ElementTree import (
    Element,
    ParseError,
    SubElement,
    TreeBuilder,
    XMLParser,
    indent,
    tostring,
)

import numpy as np

from pipelines.errors import InputRejected, UsageError, did_you_mean
from pipelines.io.config import URDF
from pipelines.io.robot import Joint, LinkParameters, RobotDescription
from pipelines.io.sandbox import regular_file
from pipelines.io.schema import Array

_MOVING = ("revolute", "continuous", "prismatic")
_TYPES = (*_MOVING, "fixed", "planar", "floating")
_KEPT = ("origin", "parent", "child", "axis", "limit")
_OTHER_FORMATS = {"mujoco": "an MJCF model (MuJoCo)", "sdf": "an SDF model (Gazebo)"}


@dataclass(frozen=True, eq=False)
class JointPlacement:
    """One moving joint: its frame in that of the moving joint before it, or of the root link."""

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


@dataclass(frozen=True, eq=False)
class _Joint:
    """A joint of the file, moving or fixed."""

    element: Element
    name: str
    type: str
    parent: str
    child: str
    origin: tuple[Array, Array]  # xyz [m], rpy [rad]
    axis: Array  # (3,) unit vector
    range: tuple[float, float]
    velocity: float
    effort: float
    mimics: bool

    @property
    def moves(self) -> bool:
        return self.type != "fixed"

    @property
    def independent(self) -> bool:
        """Return whether it is fixed, or its one coordinate is its own."""
        return not self.moves or (self.type in _MOVING and not self.mimics)


@dataclass(frozen=True, eq=False)
class _Tree:
    """The links and joints of a file: each child has one parent, and all are under one root."""

    name: str
    links: dict[str, Element]
    into: dict[str, _Joint]  # by child link
    root: str
    out_of: dict[str, list[_Joint]] = field(default_factory=dict)  # by parent link

    def body(self, link: str, stop: frozenset[str] | None = None) -> list[str]:
        """Return `link` and the links fixed to it; or all below it but behind joints in `stop`."""
        found = [link]
        for name in found:  # grows meanwhile
            for joint in self.out_of.get(name, ()):
                if joint.name not in stop if stop is not None else not joint.moves:
                    found.append(joint.child)
        return found

    def way(self, link: str) -> list[_Joint]:
        """Return the joints from the root to `link`."""
        way: list[_Joint] = []
        while link in self.into:
            way.append(self.into[link])
            link = way[-1].parent
        return way[::-1]


def import_urdf(path: str | Path, tip_link: str | None = None) -> RobotDescription:
    """Return the robot of a URDF file: joints, limits, link parameters, standard gravity.

    Fixed joints are merged into the moving link before them, and so are branches that `tip_link`
    leaves aside, which are taken as held at zero.

    Raises:
        UsageError: no such file, not a URDF, or not a serial arm.
        InputRejected: F12, not a regular file.
    """
    path = Path(path)
    if path.suffix.lower() == ".xacro":
        _refuse_xacro(path, UsageError)
    if regular_file(path, what="a URDF", empty=True).st_size > URDF.size:
        raise UsageError("X13", f"larger than {URDF.size // 1_000_000} MB", path, "give a URDF")
    try:
        tree = _tree(path.read_bytes())
        way, tip = _way_to_tip(tree, tip_link, path.name)
        moving = [joint for joint in way if joint.moves]
        stop = frozenset(joint.name for joint in moving)
        joints = tuple(
            Joint(
                joint.name,
                "prismatic" if joint.type == "prismatic" else "revolute",
                position=joint.range,
                velocity=joint.velocity,
                torque=joint.effort,
                link=_link(tree, joint.child, stop),
            )
            for joint in moving
        )
    except InputRejected as problem:
        code = problem.code.removeprefix("RRID-")
        raise UsageError(code, problem.message, path, problem.remedy) from None
    text, gravity = _canonical(tree, way), (0.0, 0.0, -9.81)
    return RobotDescription(tree.name, gravity, "urdf", joints, urdf_text=text, tip_link=tip)


def chain_from_urdf(urdf_text: str, tip_link: str | None = None) -> UrdfChain:
    """Return the placements of the moving joints of a URDF from a log or a description.

    Raises:
        InputRejected: the text is not the URDF of a serial arm.
    """
    way, tip = _way_to_tip(_tree(urdf_text), tip_link)
    placed: list[JointPlacement] = []
    rotation, position = np.eye(3), np.zeros(3)
    for joint in way:
        rotation, position = _placed(rotation, position, joint.origin)
        if joint.moves:
            slides = joint.type == "prismatic"
            placed.append(JointPlacement(joint.name, slides, rotation, position, joint.axis))
            rotation, position = np.eye(3), np.zeros(3)
    return UrdfChain(tuple(placed), tip, rotation, position)


def _placed(rotation: Array, position: Array, origin: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return a frame at xyz, rpy of another: R = Rz(yaw) Ry(pitch) Rx(roll), fixed axes."""
    xyz, rpy = origin
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    turn = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return rotation @ np.array(turn), rotation @ xyz + position


def _wrong(
    words: str, remedy: str = "correct the URDF there, or export it again", code: str = "S17"
) -> InputRejected:
    return InputRejected(code, f"URDF: {words}", "urdf_text", remedy)


def _refuse_xacro(
    where: object = "urdf_text", kind: type[InputRejected] | type[UsageError] = InputRejected
) -> NoReturn:
    words = "URDF: this is a xacro macro file, which rrrid does not run"
    raise kind("X13", words, where, "expand it first: xacro arm.urdf.xacro > arm.urdf")


class _Builder(TreeBuilder):
    """A tree without document type, whose entities could be followed, and without macros."""

    depth = 0

    def doctype(self, *_: object) -> None:
        words = "has a DOCTYPE or entity declaration, which is never followed"
        raise _wrong(words, "delete the <!DOCTYPE …> from the file", "X13")

    def start(self, tag: str, attrs: dict[str, str], /) -> Element:
        self.depth += 1
        if "xacro" in tag:
            _refuse_xacro()
        if self.depth > URDF.depth:
            raise _wrong(f"more than {URDF.depth} elements in each other", code="X13")
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> Element:
        self.depth -= 1
        return super().end(tag)


def _parse(text: bytes | str) -> Element:
    """Return the <robot> of a URDF."""
    if len(text) > URDF.size:
        raise _wrong(f"larger than {URDF.size // 1_000_000} MB", code="X13")
    parser = XMLParser(target=_Builder())
    try:
        parser.feed(text.lstrip())  # many a file begins with an empty line
        robot: Element = parser.close()
    except (ParseError, LookupError, ValueError) as problem:
        raise _wrong(f"is not well-formed XML: {problem}") from None
    if robot.tag != "robot":
        words = f"the outermost element is <{robot.tag}>, not <robot>"
        if robot.tag in _OTHER_FORMATS:
            words = f"this is {_OTHER_FORMATS[robot.tag]}, not a URDF"
        raise _wrong(words, "export a URDF of the arm, or give the one it was made from")
    return robot


def _tree(text: bytes | str) -> _Tree:
    """Return the tree of a URDF: every child link has one parent, and there is one root."""
    robot = _parse(text)
    elements, joints = robot.findall("link"), list(map(_joint, robot.findall("joint")))
    links = {_name(element): element for element in elements}
    names = {"links": map(_name, elements), "joints": (joint.name for joint in joints)}
    for kind, own in names.items():
        name, count = max(Counter(own).items(), key=lambda one: one[1], default=("", 0))
        if count > 1:
            raise _wrong(f"two {kind} are called '{name}'")
    tree = _Tree(_text(robot, "name") or "robot", links, {}, "")
    for joint in joints:
        for end in (joint.parent, joint.child):
            if end not in links:
                words = f"joint '{joint.name}' connects link '{end}', which is not defined"
                raise _wrong(f"{words}{did_you_mean(end, links)}")
        if joint.child in tree.into:
            both = f"'{tree.into[joint.child].name}' and '{joint.name}'"
            raise _wrong(f"link '{joint.child}' hangs on joints {both}: a closed loop")
        tree.into[joint.child] = joint
        tree.out_of.setdefault(joint.parent, []).append(joint)
    roots = [name for name in links if name not in tree.into]
    if len(roots) != 1:
        words = (
            f"links {', '.join(roots)} hang on nothing" if roots else "every link hangs on another"
        )
        loose = ", ".join(name for name in roots if name not in tree.out_of)
        remedy = "connect all links into one tree"
        remedy += f", or delete those without joints: {loose}" if loose else ""
        raise _wrong(f"there must be one root link, but {words}", remedy)
    if len(tree.body(roots[0], frozenset())) != len(links):
        raise _wrong("some joints form a closed loop apart from the root")
    return _Tree(tree.name, links, tree.into, roots[0], tree.out_of)


def _way_to_tip(
    tree: _Tree, tip_link: str | None, file: str = "arm.urdf"
) -> tuple[list[_Joint], str]:
    """Return the joints from the root to the tip, and the tip's name."""
    tip = tip_link or _only_tip(tree, file)
    if tip not in tree.links:
        words = f"there is no link '{tip}' for tip_link{did_you_mean(tip, tree.links)}"
        raise _wrong(words, code="C02")
    way = tree.way(tip)
    for joint in way:
        if not joint.independent:
            what = "a mimic of another" if joint.mimics else joint.type
            words = f"joint '{joint.name}' is {what}, and an arm has independent revolute, "
            words += "continuous and prismatic joints"
            remedy = 'make it type="fixed" in the URDF'
            if any(before.moves for before in tree.way(joint.parent)):
                remedy += f"; or {_to_end(tree, joint.parent, file)}"
            raise _wrong(words, remedy)
    if not any(joint.moves for joint in way):
        raise _wrong(f"no joint moves between '{tree.root}' and '{tip}'", "give the URDF of an arm")
    return way, tip


def _to_end(tree: _Tree, link: str, file: str) -> str:
    """Return the remedy that ends the arm at `link`, or at the deepest one where none moves it."""
    if not any(joint.moves for joint in tree.way(link)):
        ways = {name: tree.way(name) for name in tree.links}
        serial = [name for name, way in ways.items() if all(joint.independent for joint in way)]
        link = max(serial, key=lambda name: sum(joint.moves for joint in ways[name]))
    words = f"say at which link the arm ends, after a colon: {file}:{link}"
    return f'{words}; in a description or a recipe also tip_link = "{link}"'


def _only_tip(tree: _Tree, file: str) -> str:
    """Return the end of the only chain of moving joints; among links fixed to it, the first."""
    link = tree.root
    while True:
        body = tree.body(link)
        onwards = [joint for name in body for joint in tree.out_of.get(name, ()) if joint.moves]
        if not onwards:
            ends = [name for name in body if name not in tree.out_of]
            return ends[0] if len(ends) == 1 else link
        if len(onwards) > 1:
            names = ", ".join(f"'{joint.name}'" for joint in onwards)
            remedy = _to_end(tree, onwards[0].parent, file)
            raise _wrong(f"joints {names} branch off the same body", remedy)
        link = onwards[0].child
        if not onwards[0].independent:
            return link


def _joint(element: Element) -> _Joint:
    name = _name(element)
    kind, place = _text(element, "type"), f"joint '{name}'"
    if kind not in _TYPES:
        raise _wrong(f"{place} has type '{kind}', which must be one of {', '.join(_TYPES)}")
    parent, child = (_text(element.find(side), "link") for side in ("parent", "child"))
    if not parent or not child:
        raise _wrong(f"{place} lacks its parent or child link")
    axis = _numbers(element.find("axis"), "xyz", "1 0 0", place)
    length = float(np.linalg.norm(axis))
    if kind in _MOVING and length < URDF.short:
        raise _wrong(f"{place} has an axis without direction")
    limit = element.find("limit")
    low, high, velocity, effort = (
        float(_numbers(limit, key, "0", place, bounded=False)[0])
        for key in ("lower", "upper", "velocity", "effort")
    )
    if kind == "continuous":
        low = high = 0.0
    if velocity < 0.0 or effort < 0.0 or low > high:
        raise _wrong(f"{place} has a negative velocity or effort limit, or lower above upper")
    return _Joint(
        element,
        name,
        kind,
        parent,
        child,
        _origin(element, place),
        axis=axis / (length or 1.0),
        range=(-math.inf, math.inf) if low == high else (low, high),
        velocity=velocity or math.inf,
        effort=effort or math.inf,
        mimics=element.find("mimic") is not None,
    )


def _text(element: Element | None, key: str, default: str = "") -> str:
    """Return an attribute, or its default; a macro in one that nobody reads does no harm (X13)."""
    text = default if element is None else element.get(key, default)
    if "${" in text or "$(" in text:
        _refuse_xacro()
    return text


def _name(element: Element) -> str:
    name = _text(element, "name")
    if not name.strip():
        raise _wrong(f"a <{element.tag}> has no name")
    return name


def _numbers(
    element: Element | None, key: str, default: str, place: str, *, bounded: bool = True
) -> Array:
    """Return as many numbers of an attribute as its default has.

    Args:
        bounded: refuse numbers that are too large; else they are infinite, which means no limit.
    """
    words = _text(element, key, default).split()
    if len(words) != len(default.split()):
        count = "three numbers" if " " in default else "one number"
        raise _wrong(f"{place}: {key} must hold {count}, not {len(words)}")
    try:
        values = np.array([float(word.replace("_", "?")) for word in words])  # 1_0 is not 10
    except ValueError:
        raise _wrong(f"{place}: {key} holds '{' '.join(words)}', which is not a number") from None
    large = ~(np.abs(values) <= URDF.number)
    if np.isnan(values).any() or (bounded and large.any()):
        raise _wrong(f"{place}: {key} holds a number that is not finite or absurdly large")
    return np.where(large, np.copysign(np.inf, values), values)


def _origin(element: Element, place: str) -> tuple[Array, Array]:
    """Return xyz [m] and rpy [rad]."""
    origin = element.find("origin")
    return _numbers(origin, "xyz", "0 0 0", place), _numbers(origin, "rpy", "0 0 0", place)


def _link(tree: _Tree, first: str, stop: frozenset[str]) -> LinkParameters | None:
    """Return the parameters of a moving body about its joint's frame, all fixed to it included.

    I_o = Σ R I_c Rᵀ + m (|c|² 1 - c cᵀ)
    """
    placed = {first: (np.eye(3), np.zeros(3))}
    mass, moment, inertia, known = 0.0, np.zeros(3), np.zeros((3, 3)), False
    for name in tree.body(first, stop):
        if name != first:
            joint = tree.into[name]
            placed[name] = _placed(*placed[joint.parent], joint.origin)
        element, place = tree.links[name].find("inertial"), f"link '{name}'"
        if element is None:
            continue
        m = float(_numbers(element.find("mass"), "value", "0", place)[0])
        if m < 0.0:
            raise _wrong(f"{place} has negative mass {m}")
        keys, own = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), element.find("inertia")
        xx, yy, zz, xy, xz, yz = (float(_numbers(own, key, "0", place)[0]) for key in keys)
        about_com = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        turn, c = _placed(*placed[name], _origin(element, place))
        parallel = m * (float(c @ c) * np.eye(3) - np.outer(c, c))
        mass, moment, known = mass + m, moment + m * c, True
        inertia = inertia + turn @ about_com @ turn.T + parallel
    if not known:
        return None
    x, y, z = (moment / mass if mass else np.zeros(3)).tolist()
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia.tolist()
    # + 0.0: a zero product must not become -0.0 by the change of sign
    six = (xx, yy, zz, -xy + 0.0, -xz + 0.0, -yz + 0.0)
    return LinkParameters(float(mass), (x, y, z), six)


def _canonical(tree: _Tree, way: list[_Joint]) -> str:
    """Return the shortest URDF with the same chain: link names, joint origins, axes, limits."""
    robot = Element("robot", name=tree.name)
    SubElement(robot, "link", name=tree.root)
    for joint in way:
        SubElement(robot, "link", name=joint.child)
        own = SubElement(robot, "joint", joint.element.attrib)
        own.extend(part for part in joint.element if part.tag in _KEPT)
    indent(robot)
    return tostring(robot, encoding="unicode")
