"""The links and joints of a URDF as a checked tree: no mesh, no entity and no macro is ever followed.

The XML is given to expat with handlers that refuse a document type before any entity could be declared.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np
import numpy.typing as npt

from pipelines.errors import RrridError, did_you_mean

__all__ = ["Source", "Tree", "TreeJoint", "below", "number", "read", "read_origin", "rotation_of", "tree_of", "way_to"]

Array = npt.NDArray[np.float64]

_LARGEST = 16_000_000  # [bytes] a URDF is text about a few dozen links
_DEEPEST = 100  # nested elements
_MOST_ELEMENTS = 100_000
_MOST_LINKS = 1000  # a humanoid with hands has a tenth of it
_LARGEST_NUMBER = 1e9  # squares and products of it stay finite; a limit of that size is none
_NAMED_ENDS = 4  # links that a remedy names
_MOVING = ("revolute", "continuous", "prismatic")
_TYPES = (*_MOVING, "fixed", "planar", "floating")
_OTHER_FORMATS = {"mujoco": "an MJCF model (MuJoCo)", "mujocoinclude": "a part of an MJCF model (MuJoCo)",
                  "sdf": "an SDF model (Gazebo)", "gazebo": "an SDF model (Gazebo)"}


@dataclass(frozen=True)
class Source:
    """Whose fault a fault is, and where."""

    where: str
    kind: type[RrridError]

    def wrong(self, message: str, remedy: str = "correct the URDF there, or export it again", code: str = "S17") -> RrridError:
        return self.kind(code, f"URDF: {message}", where=self.where, remedy=remedy)


@dataclass(frozen=True, eq=False)
class TreeJoint:
    name: str
    type: str
    parent: str
    child: str
    rotation: Array
    position: Array
    origin: tuple[Array, Array]  # xyz, rpy as written
    axis: Array
    limits: tuple[tuple[float, float], float, float]  # position, velocity, effort
    mimics: bool

    @property
    def moves(self) -> bool:
        return self.type != "fixed"

    @property
    def independent(self) -> bool:
        """Return whether its one coordinate is its own."""
        return self.type in _MOVING and not self.mimics


@dataclass(frozen=True, eq=False)
class Tree:
    name: str
    links: dict[str, Element]
    into: dict[str, TreeJoint]  # by child link
    out: dict[str, list[TreeJoint]]  # by parent link
    root: str


def read(path: Path, source: Source) -> bytes:
    if path.suffix.lower() == ".xacro":
        raise _xacro(source)
    try:
        if not path.is_file():  # a pipe or device would hang
            raise source.wrong("no such file" if not path.exists() else "not a regular file", "check the path", code="C04")
        with path.open("rb") as file:
            text = file.read(_LARGEST + 1)
    except (OSError, ValueError) as problem:
        raise source.wrong(f"cannot be read: {problem}", "check the file and its permissions", code="C04") from None
    return text


def _xacro(source: Source) -> RrridError:
    return source.wrong("this is a xacro macro file, which rrrid does not run", code="X13",
                        remedy="expand it first: xacro arm.urdf.xacro > arm.urdf")


def _parse(text: bytes | str, source: Source) -> Element:
    """The XML tree, refusing every document type, and so every entity, before it takes effect."""
    if len(text) > _LARGEST:
        raise source.wrong(f"larger than {_LARGEST // 1_000_000} MB", code="X13")
    builder, parser, depth, elements = TreeBuilder(), expat.ParserCreate(), 0, 0

    def doctype(*_: object) -> None:
        raise source.wrong("has a DOCTYPE or entity declaration, which is never followed", code="X13",
                           remedy="delete the <!DOCTYPE …> from the file")

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, elements
        depth, elements = depth + 1, elements + 1
        if tag.startswith("xacro:"):
            raise _xacro(source)
        if depth > _DEEPEST:
            raise source.wrong(f"elements nested more than {_DEEPEST} deep", code="X13")
        if elements > _MOST_ELEMENTS:
            raise source.wrong(f"more than {_MOST_ELEMENTS} elements", code="X13")
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
        raise source.wrong(f"is not well-formed XML: {problem}") from None
    return builder.close()


def tree_of(text: bytes | str, source: Source) -> Tree:
    """Links and joints, each child with one parent and all of them under one root."""
    robot = _parse(text, source)
    if robot.tag in _OTHER_FORMATS:
        raise source.wrong(f"this is {_OTHER_FORMATS[robot.tag]}, not a URDF",
                           remedy="give the URDF that it was made from, or export a URDF of the arm")
    if robot.tag != "robot":
        raise source.wrong(f"the outermost element is <{robot.tag}>, not <robot>")
    links: dict[str, Element] = {}
    if len(robot.findall("link")) > _MOST_LINKS or len(robot.findall("joint")) > _MOST_LINKS:
        raise source.wrong(f"more than {_MOST_LINKS} links or joints", "give the URDF of the arm alone", code="X13")
    for element in robot.findall("link"):
        if links.setdefault(_name(element, source), element) is not element:
            raise source.wrong(f"two links are called '{element.get('name')}'")
    into: dict[str, TreeJoint] = {}
    out: dict[str, list[TreeJoint]] = {name: [] for name in links}
    names: set[str] = set()
    for element in robot.findall("joint"):
        joint = _joint(element, source)
        for end in (joint.parent, joint.child):
            if end not in links:
                raise source.wrong(f"joint '{joint.name}' connects link '{end}', which is not defined"
                                   f"{did_you_mean(end, links)}")
        if joint.name in names:
            raise source.wrong(f"two joints are called '{joint.name}'")
        if into.setdefault(joint.child, joint) is not joint:
            raise source.wrong(f"link '{joint.child}' hangs on joints '{into[joint.child].name}' and '{joint.name}': a "
                               "closed loop", remedy="only serial arms can be described")
        names.add(joint.name)
        out[joint.parent].append(joint)
    roots = [name for name in links if name not in into]
    if len(roots) != 1:
        what = f"links {', '.join(roots)} hang on nothing" if roots else "every link hangs on another"
        loose = [name for name in roots if not out[name]]
        raise source.wrong(f"there must be one root link, but {what}", remedy="connect all links into one tree"
                           + (f", or delete those without joints: {', '.join(loose)}" if loose else ""))
    tree = Tree(robot.get("name") or "robot", links, into, out, roots[0])
    if len(below(tree, tree.root)) != len(links):
        raise source.wrong("some joints form a closed loop apart from the root",
                           remedy="only serial arms can be described")
    return tree


def below(tree: Tree, link: str, stop: frozenset[str] = frozenset()) -> list[str]:
    """`link` and all links under it, not going through the joints named in `stop`."""
    found = [link]
    for name in found:  # grows while it is walked
        found += [joint.child for joint in tree.out[name] if joint.name not in stop]
    return found


def way_to(tree: Tree, tip_link: str | None, source: Source) -> tuple[list[TreeJoint], str]:
    """The joints from the root to the tip, and the tip's name."""
    tip = tip_link or _only_tip(tree, source)
    if tip not in tree.links:
        raise source.wrong(f"there is no link '{tip}' for tip_link{did_you_mean(tip, tree.links)}", code="C02")
    way = _way(tree, tip)
    for joint in way:
        if joint.moves and not joint.independent:
            raise source.wrong(f"joint '{joint.name}' is {'a mimic of another' if joint.mimics else joint.type}, and an arm has "
                               "independent revolute, continuous and prismatic joints",
                               remedy="make it type=\"fixed\" in the URDF" + _end_there(tree, source, ", or "))
    if not any(joint.moves for joint in way):
        raise source.wrong(f"no joint moves between '{tree.root}' and '{tip}'",
                           remedy=_end_there(tree, source) or "give the URDF of an arm whose joints move")
    return way, tip


def _way(tree: Tree, link: str) -> list[TreeJoint]:
    """The joints from the root to `link`."""
    way: list[TreeJoint] = []
    while link in tree.into:
        way.append(tree.into[link])
        link = way[-1].parent
    return way[::-1]


def _only_tip(tree: Tree, source: Source) -> str:
    """The end of the only chain of moving joints; among several links fixed to it, the link that moves."""
    link = tree.root
    while True:
        body = below(tree, link, frozenset(j.name for js in tree.out.values() for j in js if j.moves))
        onwards = [joint for name in body for joint in tree.out[name] if joint.moves]
        if len(onwards) > 1:
            raise source.wrong(f"joints {', '.join(repr(j.name) for j in onwards)} branch off the same body",
                               remedy=_end_there(tree, source) or "make those that are no joint of the arm type=\"fixed\"")
        if not onwards:
            ends = [name for name in body if not tree.out[name]]
            return ends[0] if len(ends) == 1 else link
        if not onwards[0].independent:
            return onwards[0].child
        link = onwards[0].child


def _ends(tree: Tree) -> list[str]:
    """The links that an arm may end at: where its joints end, branch off or cease to be independent.

    The longest arms first; before them a body that fingers branch off, not one that arms branch off.
    """
    moving = [joint.name for joints in tree.out.values() for joint in joints if joint.moves]
    ends: dict[str, int] = {}
    for end in dict.fromkeys((tree.root, *(joint.child for joint in tree.into.values() if joint.moves))):
        way = [joint for joint in _way(tree, end) if joint.moves]
        body = below(tree, end, frozenset(moving))
        onwards = [joint for name in body for joint in tree.out[name] if joint.moves]
        if way and all(joint.independent for joint in way) and (len(onwards) != 1 or not onwards[0].independent):
            ends[onwards[0].parent if onwards else body[-1]] = len(way) * (2 if len(onwards) > 1 else 1)
    return sorted(ends, key=lambda end: -ends[end])


def _end_there(tree: Tree, source: Source, before: str = "") -> str:
    """The remedy that names the last link of the arm, in the words of every place that takes one."""
    ends = _ends(tree)
    if not ends:
        return ""
    file = source.where.rpartition("/")[2]
    named = ", ".join(f"{file}:{end}" for end in ends[:_NAMED_ENDS])
    return (f"{before}say at which link the arm ends, after a colon: {named}; "
            f"in a description or a recipe also tip_link = \"{ends[0]}\"")


def _joint(element: Element, source: Source) -> TreeJoint:
    name = _name(element, source)
    kind = element.get("type", "")
    if kind not in _TYPES:
        raise source.wrong(f"joint '{name}' has type '{kind}', which must be one of {', '.join(_TYPES)}")
    ends = [part.get("link", "") if (part := element.find(side)) is not None else "" for side in ("parent", "child")]
    if not all(ends):
        raise source.wrong(f"joint '{name}' lacks its parent or child link")
    placed = read_origin(element, f"joint '{name}'", source)
    axis = _vector(element.find("axis"), "xyz", (1.0, 0.0, 0.0), f"joint '{name}'", source)
    length = float(np.linalg.norm(axis))
    if kind in _MOVING and length < 1e-9:
        raise source.wrong(f"joint '{name}' has an axis without direction")
    return TreeJoint(name, kind, ends[0], ends[1], rotation_of(placed[1]), placed[0], placed,
                  axis / length if length else axis, _limits(element, name, kind, source),
                  element.find("mimic") is not None)


def _limits(element: Element, name: str, kind: str, source: Source) -> tuple[tuple[float, float], float, float]:
    """Position, velocity and effort limits. No limit is what is missing, 0 as drawing programs write it, infinite, or as large as
    1e16; and any range of a continuous joint.
    """
    limit = element.find("limit")
    low, high, velocity, effort = (
        0.0 if kind == "continuous" and key in ("lower", "upper") else _limit(limit, key, f"joint '{name}'", source)
        for key in ("lower", "upper", "velocity", "effort"))
    if velocity < 0.0 or effort < 0.0 or low > high:
        raise source.wrong(f"joint '{name}' has a negative velocity or effort limit, or lower above upper")
    position = (-math.inf, math.inf) if low == high else (low, high)
    return position, velocity or math.inf, effort or math.inf


def _limit(element: Element | None, key: str, place: str, source: Source) -> float:
    """The number of a limit, infinite where it is too large to be one."""
    if element is None or element.get(key) is None:
        return 0.0
    value = _number_in(str(element.get(key)), key, place, source)
    if math.isnan(value):
        raise source.wrong(f"{place}: {key} is not a number")
    return value if abs(value) < _LARGEST_NUMBER else math.copysign(math.inf, value)


def _name(element: Element, source: Source) -> str:
    name = element.get("name", "")
    if not name.strip():
        raise source.wrong(f"a <{element.tag}> has no name")
    return name


def number(element: Element | None, key: str, place: str, source: Source, default: float = 0.0) -> float:
    if element is None or element.get(key) is None:
        return default
    return _float(str(element.get(key)), key, place, source)


def _number_in(word: str, key: str, place: str, source: Source) -> float:
    if "${" in word or "$(" in word:
        raise _xacro(source)
    try:
        return float(word.replace("_", "?"))  # Python reads 1_0 as 10, no other reader does
    except ValueError:
        raise source.wrong(f"{place}: {key} holds '{word}', which is not a number") from None


def _float(word: str, key: str, place: str, source: Source) -> float:
    value = _number_in(word, key, place, source)
    if not abs(value) <= _LARGEST_NUMBER:
        raise source.wrong(f"{place}: {key} holds {word}, which is not finite or absurdly large")
    return value


def _vector(element: Element | None, key: str, default: tuple[float, ...], place: str, source: Source) -> Array:
    if element is None or element.get(key) is None:
        return np.array(default)
    text = str(element.get(key))
    words = text.split()
    if "$" not in text and len(words) != 3:
        raise source.wrong(f"{place}: {key} must hold three numbers, not {len(words)}")
    return np.array([_float(word, key, place, source) for word in words])


def read_origin(element: Element, place: str, source: Source) -> tuple[Array, Array]:
    origin = element.find("origin")
    zero = (0.0, 0.0, 0.0)
    return _vector(origin, "xyz", zero, place, source), _vector(origin, "rpy", zero, place, source)


def rotation_of(rpy: Array) -> Array:
    """R = Rz(yaw) Ry(pitch) Rx(roll): turns about fixed axes, in the order roll, pitch, yaw."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array([[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                     [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                     [-sp, cp * sr, cp * cr]])


