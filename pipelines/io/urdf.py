"""Read the kinematics and the link parameters of a URDF: no mesh, entity or macro is followed.

robot = import_urdf("arm.urdf")              its text reduced to the joints of the chain
chain = chain_from_urdf(robot.urdf_text)     the placements of the joints, for geometry
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np

from pipelines.errors import Check, InputRejected, UsageError, did_you_mean
from pipelines.io.config import URDF
from pipelines.io.robot import Joint, LinkParameters, RobotDescription, inconsistency
from pipelines.io.schema import Array

_MOVING = ("revolute", "continuous", "prismatic")
_TYPES = (*_MOVING, "fixed", "planar", "floating")
_OTHER_FORMATS = {"mujoco": "an MJCF model (MuJoCo)", "sdf": "an SDF model (Gazebo)"}
_OTHER_FORMATS |= {"mujocoinclude": "a part of an MJCF model (MuJoCo)"}
_SERIAL = "only serial arms can be described"


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

    name: str
    type: str
    parent: str
    child: str
    xyz: Array  # (3,) [m]
    rpy: Array  # (3,) [rad]
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
        """Return whether its one coordinate is its own."""
        return self.type in _MOVING and not self.mimics


@dataclass(frozen=True, eq=False)
class _Tree:
    """The links and joints of a file: each child has one parent, and all are under one root."""

    name: str
    links: dict[str, Element]
    into: dict[str, _Joint]  # by child link
    root: str
    where: str  # the file, or "urdf_text"

    def below(self, link: str, *, fixed: bool = False, stop: tuple[str, ...] = ()) -> list[str]:
        """Return `link` and all links below it, or those `fixed` to it; `stop` names joints."""
        found = [link]
        for name in found:  # grows meanwhile
            for joint in self.into.values():
                if joint.parent == name and joint.name not in stop and not (fixed and joint.moves):
                    found.append(joint.child)
        return found

    def onwards(self, link: str) -> list[_Joint]:
        """Return the moving joints that leave the body of `link`."""
        body = self.below(link, fixed=True)
        return [
            one for name in body for one in self.into.values() if one.parent == name and one.moves
        ]

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
    """
    path = Path(path)
    try:
        tree = _tree_of(_read(path), str(path))
        way, tip = _way_to_tip(tree, tip_link)
        moving = [joint for joint in way if joint.moves]
        stop = tuple(joint.name for joint in moving)
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
        checks = _impossible_links(tree)
    except InputRejected as problem:
        code = problem.code.removeprefix("RRID-")
        raise UsageError(code, problem.message, path, problem.remedy) from None
    gravity, text = (0.0, 0.0, -9.81), _canonical(tree, way)
    return RobotDescription(
        tree.name, gravity, "urdf", joints, urdf_text=text, tip_link=tip, checks=checks
    )


def chain_from_urdf(urdf_text: str, tip_link: str | None = None) -> UrdfChain:
    """Return the placements of the moving joints of a URDF from a log or a description.

    Raises:
        InputRejected: the text is not the URDF of a serial arm.
    """
    way, tip = _way_to_tip(_tree_of(urdf_text, "urdf_text"), tip_link)
    placed: list[JointPlacement] = []
    rotation, position = np.eye(3), np.zeros(3)
    for joint in way:
        rotation, position = _placed(rotation, position, joint.xyz, joint.rpy)
        if joint.moves:
            slides = joint.type == "prismatic"
            placed.append(JointPlacement(joint.name, slides, rotation, position, joint.axis))
            rotation, position = np.eye(3), np.zeros(3)
    return UrdfChain(tuple(placed), tip, rotation, position)


def _placed(rotation: Array, position: Array, xyz: Array, rpy: Array) -> tuple[Array, Array]:
    """Return a frame at `xyz`, `rpy` of another: R = Rz(yaw) Ry(pitch) Rx(roll), fixed axes."""
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


def _xacro() -> InputRejected:
    words = "this is a xacro macro file, which rrrid does not run"
    return _wrong(words, "expand it first: xacro arm.urdf.xacro > arm.urdf", "X13")


def _read(path: Path) -> bytes:
    if path.suffix.lower() == ".xacro":
        raise _xacro()
    try:
        if not path.is_file():  # a pipe or a device would hang
            words = "not a regular file" if path.exists() else "no such file"
            raise _wrong(words, "check the path", "C04")
        with path.open("rb") as file:
            return file.read(URDF.size + 1)
    except (OSError, ValueError) as problem:
        remedy = "check the file and its permissions"
        raise _wrong(f"cannot be read: {problem}", remedy, "C04") from None


def _parse(text: bytes | str) -> Element:
    """Return the XML tree; a document type is refused before an entity could be declared."""
    if len(text) > URDF.size:
        raise _wrong(f"larger than {URDF.size // 1_000_000} MB", code="X13")
    builder, parser, depth, elements = TreeBuilder(), expat.ParserCreate(), 0, 0

    def doctype(*_: object) -> None:
        words = "has a DOCTYPE or entity declaration, which is never followed"
        raise _wrong(words, "delete the <!DOCTYPE …> from the file", "X13")

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, elements
        depth, elements = depth + 1, elements + 1
        if tag.startswith("xacro:"):
            raise _xacro()
        if depth > URDF.depth or elements > URDF.elements:
            words = f"more than {URDF.elements} elements, or {URDF.depth} in each other"
            raise _wrong(words, code="X13")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = doctype
    parser.StartElementHandler, parser.EndElementHandler = start, end
    try:
        parser.Parse(text.lstrip(), True)  # many a file begins with an empty line
    except (expat.ExpatError, LookupError, ValueError) as problem:
        raise _wrong(f"is not well-formed XML: {problem}") from None
    return builder.close()


def _tree_of(text: bytes | str, where: str) -> _Tree:
    robot = _parse(text)
    if robot.tag in _OTHER_FORMATS:
        remedy = "give the URDF that it was made from, or export a URDF of the arm"
        raise _wrong(f"this is {_OTHER_FORMATS[robot.tag]}, not a URDF", remedy)
    if robot.tag != "robot":
        raise _wrong(f"the outermost element is <{robot.tag}>, not <robot>")
    elements, joints = robot.findall("link"), robot.findall("joint")
    if max(len(elements), len(joints)) > URDF.links:
        remedy = "give the URDF of the arm alone"
        raise _wrong(f"more than {URDF.links} links or joints", remedy, "X13")
    links: dict[str, Element] = {}
    for element in elements:
        if links.setdefault(_name(element), element) is not element:
            raise _wrong(f"two links are called '{element.get('name')}'")
    into: dict[str, _Joint] = {}
    for joint in map(_joint, joints):
        for end in (joint.parent, joint.child):
            if end not in links:
                words = f"joint '{joint.name}' connects link '{end}', which is not defined"
                raise _wrong(f"{words}{did_you_mean(end, links)}")
        if any(other.name == joint.name for other in into.values()):
            raise _wrong(f"two joints are called '{joint.name}'")
        if joint.child in into:
            both = f"'{into[joint.child].name}' and '{joint.name}'"
            words = f"link '{joint.child}' hangs on joints {both}: a closed loop"
            raise _wrong(words, _SERIAL)
        into[joint.child] = joint
    tree = _Tree(_text(robot, "name") or "robot", links, into, _root(links, into), where)
    if len(tree.below(tree.root)) != len(links):
        raise _wrong("some joints form a closed loop apart from the root", _SERIAL)
    return tree


def _root(links: Iterable[str], into: dict[str, _Joint]) -> str:
    """Return the only link that hangs on no joint."""
    roots = [name for name in links if name not in into]
    if len(roots) == 1:
        return roots[0]
    words = f"links {', '.join(roots)} hang on nothing" if roots else "every link hangs on another"
    loose = ", ".join(n for n in roots if all(joint.parent != n for joint in into.values()))
    more = f", or delete those without joints: {loose}" if loose else ""
    remedy = f"connect all links into one tree{more}"
    raise _wrong(f"there must be one root link, but {words}", remedy)


def _way_to_tip(tree: _Tree, tip_link: str | None) -> tuple[list[_Joint], str]:
    """Return the joints from the root to the tip, and the tip's name."""
    tip = tip_link or _only_tip(tree)
    if tip not in tree.links:
        words = f"there is no link '{tip}' for tip_link{did_you_mean(tip, tree.links)}"
        raise _wrong(words, code="C02")
    way = tree.way(tip)
    for joint in way:
        if joint.moves and not joint.independent:
            what = "a mimic of another" if joint.mimics else joint.type
            words = f"joint '{joint.name}' is {what}, and an arm has independent revolute, "
            words += "continuous and prismatic joints"
            raise _wrong(words, f'make it type="fixed" in the URDF{_end_there(tree, ", or ")}')
    if not any(joint.moves for joint in way):
        remedy = _end_there(tree) or "give the URDF of an arm whose joints move"
        raise _wrong(f"no joint moves between '{tree.root}' and '{tip}'", remedy)
    return way, tip


def _only_tip(tree: _Tree) -> str:
    """Return the end of the only chain of moving joints; among links fixed to it, the first."""
    link = tree.root
    while onwards := tree.onwards(link):
        if len(onwards) > 1:
            words = f"joints {', '.join(repr(joint.name) for joint in onwards)} branch off"
            remedy = _end_there(tree) or 'make those that are no joint of the arm type="fixed"'
            raise _wrong(f"{words} the same body", remedy)
        link = onwards[0].child
        if not onwards[0].independent:
            return link
    ends = [n for n in tree.below(link) if all(one.parent != n for one in tree.into.values())]
    return ends[0] if len(ends) == 1 else link


def _end_there(tree: _Tree, before: str = "") -> str:
    """Return the remedy that names the last link of the arm, as every place takes it.

    An arm may end where its joints end, branch off or cease to be independent: the longest arms
    first, and before them a body that fingers branch off, not one that arms branch off.
    """
    ends: dict[str, int] = {}
    for link in (tree.root, *(joint.child for joint in tree.into.values() if joint.moves)):
        way = [joint for joint in tree.way(link) if joint.moves]
        onwards = tree.onwards(link)
        goes_on = len(onwards) == 1 and onwards[0].independent
        if way and all(joint.independent for joint in way) and not goes_on:
            end = onwards[0].parent if onwards else tree.below(link, fixed=True)[-1]
            ends[end] = len(way) * (2 if len(onwards) > 1 else 1)
    if not ends:
        return ""
    longest = sorted(ends, key=lambda end: -ends[end])
    named = ", ".join(f"{tree.where.rpartition('/')[2]}:{end}" for end in longest[:4])
    remedy = f"{before}say at which link the arm ends, after a colon: {named}"
    return f'{remedy}; in a description or a recipe also tip_link = "{longest[0]}"'


def _joint(element: Element) -> _Joint:
    name = _name(element)
    kind, place = _text(element, "type"), f"joint '{name}'"
    if kind not in _TYPES:
        raise _wrong(f"{place} has type '{kind}', which must be one of {', '.join(_TYPES)}")
    parts = [element.find(side) for side in ("parent", "child")]
    parent, child = (_text(part, "link") for part in parts)
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
        name,
        kind,
        parent,
        child,
        *_origin(element, place),
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
        raise _xacro()
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
    values = []
    for word in words:
        try:
            values.append(float(word.replace("_", "?")))  # no other reader takes 1_0 for 10
        except ValueError:
            raise _wrong(f"{place}: {key} holds '{word}', which is not a number") from None
        if not abs(values[-1]) <= URDF.number:
            if bounded or math.isnan(values[-1]):
                words_ = f"{key} holds {word}, which is not finite or absurdly large"
                raise _wrong(f"{place}: {words_}")
            values[-1] = math.copysign(math.inf, values[-1])
    return np.array(values)


def _origin(element: Element, place: str) -> tuple[Array, Array]:
    """Return xyz [m] and rpy [rad]."""
    origin = element.find("origin")
    return _numbers(origin, "xyz", "0 0 0", place), _numbers(origin, "rpy", "0 0 0", place)


def _link(tree: _Tree, first: str, stop: tuple[str, ...]) -> LinkParameters | None:
    """Return the parameters of a moving body about its joint's frame, all fixed to it included.

    I_o = Σ R I_c Rᵀ + m (|c|² 1 - c cᵀ)
    """
    placed = {first: (np.eye(3), np.zeros(3))}
    mass, moment, inertia, known = 0.0, np.zeros(3), np.zeros((3, 3)), False
    for name in tree.below(first, stop=stop):
        if name != first:
            joint = tree.into[name]
            placed[name] = _placed(*placed[joint.parent], joint.xyz, joint.rpy)
        if (element := tree.links[name].find("inertial")) is not None:
            m, about_com = _inertial(element, f"link '{name}'")
            turn, c = _placed(*placed[name], *_origin(element, f"link '{name}'"))
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


def _inertial(element: Element, place: str) -> tuple[float, Array]:
    """Return the mass, and the inertia (3, 3) about its centre in the axes of <inertial>."""
    mass = float(_numbers(element.find("mass"), "value", "0", place)[0])
    if mass < 0.0:
        raise _wrong(f"{place} has negative mass {mass}")
    keys, inertia = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), element.find("inertia")
    xx, yy, zz, xy, xz, yz = (float(_numbers(inertia, key, "0", place)[0]) for key in keys)
    return mass, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _impossible_links(tree: _Tree) -> tuple[Check, ...]:
    """Warn of every link whose inertial parameters no rigid body has (S17)."""
    found = []
    for name, link in tree.links.items():
        element, place = link.find("inertial"), f"link '{name}'"
        if element is not None and (words := inconsistency(*_inertial(element, place))):
            words = f"no rigid body has the inertial parameters of {place}: {words}"
            remedy = "correct them in the URDF: what is known of its links is used"
            found.append(Check.of("S17", "warn", words, tree.where, remedy))
    return tuple(found)


def _canonical(tree: _Tree, way: list[_Joint]) -> str:
    """Return the shortest URDF with the same chain: link names, joint origins, axes, limits."""
    from xml.sax.saxutils import quoteattr  # brings urllib and ssl along: 25 ms

    def numbers(vector: Array) -> str:
        return " ".join(map(repr, vector.tolist()))

    lines = [f"<robot name={quoteattr(tree.name)}>", f"  <link name={quoteattr(tree.root)}/>"]
    for joint in way:
        low, high = joint.range
        limits, kind = {"velocity": joint.velocity, "effort": joint.effort}, joint.type
        if math.isfinite(low) or math.isfinite(high):  # an end that is left out would be 0
            limits |= {"lower": max(low, -URDF.no_limit), "upper": min(high, URDF.no_limit)}
        elif kind == "revolute":
            kind = "continuous"
        lines += [
            f"  <link name={quoteattr(joint.child)}/>",
            f'  <joint name={quoteattr(joint.name)} type="{kind}">',
            f'    <origin xyz="{numbers(joint.xyz)}" rpy="{numbers(joint.rpy)}"/>',
            f"    <parent link={quoteattr(joint.parent)}/>",
            f"    <child link={quoteattr(joint.child)}/>",
        ]
        if joint.moves:
            lines.append(f'    <axis xyz="{numbers(joint.axis)}"/>')
            written = [f'{k}="{float(v)!r}"' for k, v in limits.items() if math.isfinite(v)]
            lines += [f"    <limit {' '.join(written)}/>"] if written else []
        lines.append("  </joint>")
    return "\n".join([*lines, "</robot>", ""])
