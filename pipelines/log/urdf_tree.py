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
_LARGEST_NUMBER = 1e9  # squares and products of it stay finite
_MOVING = ("revolute", "continuous", "prismatic")
_TYPES = (*_MOVING, "fixed", "planar", "floating")


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
    builder, parser, depth = TreeBuilder(), expat.ParserCreate(), 0

    def doctype(*_: object) -> None:
        raise source.wrong("has a DOCTYPE or entity declaration, which is never followed", code="X13",
                           remedy="delete the <!DOCTYPE …> from the file")

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if tag.startswith("xacro:"):
            raise _xacro(source)
        if depth > _DEEPEST:
            raise source.wrong(f"elements nested more than {_DEEPEST} deep", code="X13")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = doctype
    parser.StartElementHandler, parser.EndElementHandler = start, end
    try:
        parser.Parse(text, True)
    except (expat.ExpatError, LookupError, ValueError) as problem:
        raise source.wrong(f"is not well-formed XML: {problem}") from None
    return builder.close()


def tree_of(text: bytes | str, source: Source) -> Tree:
    """Links and joints, each child with one parent and all of them under one root."""
    robot = _parse(text, source)
    if robot.tag != "robot":
        raise source.wrong(f"the outermost element is <{robot.tag}>, not <robot>")
    links: dict[str, Element] = {}
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
        raise source.wrong(f"there must be one root link, but {what}", remedy="connect all links into one tree")
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
    way, link = [], tip
    while link in tree.into:
        way.append(tree.into[link])
        link = way[-1].parent
    for joint in way:
        if joint.type in ("planar", "floating") or joint.mimics:
            raise source.wrong(f"joint '{joint.name}' is {'a mimic of another' if joint.mimics else joint.type}",
                               remedy="only independent revolute, continuous and prismatic joints can be described")
    if not any(joint.moves for joint in way):
        raise source.wrong(f"no joint moves between '{tree.root}' and '{tip}'")
    return way[::-1], tip


def _only_tip(tree: Tree, source: Source) -> str:
    """The end of the only chain of moving joints; among several links fixed to it, the link that moves."""
    link = tree.root
    while True:
        body = below(tree, link, frozenset(j.name for js in tree.out.values() for j in js if j.moves))
        onwards = [joint for name in body for joint in tree.out[name] if joint.moves]
        if len(onwards) > 1:
            raise source.wrong(f"joints {', '.join(repr(j.name) for j in onwards)} branch off the same body",
                               remedy="say which arm is meant: tip_link = \"name of its last link\"")
        if not onwards:
            ends = [name for name in body if not tree.out[name]]
            return ends[0] if len(ends) == 1 else link
        link = onwards[0].child


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
    """Position, velocity and effort limits; what is missing or 0 is no limit, as drawing programs write it."""
    limit = element.find("limit")
    low, high, velocity, effort = (number(limit, key, f"joint '{name}'", source)
                                   for key in ("lower", "upper", "velocity", "effort"))
    if velocity < 0.0 or effort < 0.0 or low > high:
        raise source.wrong(f"joint '{name}' has a negative velocity or effort limit, or lower above upper")
    position = (-math.inf, math.inf) if kind == "continuous" or low == high else (low, high)
    return position, velocity or math.inf, effort or math.inf


def _name(element: Element, source: Source) -> str:
    name = element.get("name", "")
    if not name.strip():
        raise source.wrong(f"a <{element.tag}> has no name")
    return name


def number(element: Element | None, key: str, place: str, source: Source, default: float = 0.0) -> float:
    if element is None or element.get(key) is None:
        return default
    return _float(str(element.get(key)), key, place, source)


def _float(word: str, key: str, place: str, source: Source) -> float:
    if "${" in word or "$(" in word:
        raise _xacro(source)
    try:
        value = float(word.replace("_", "?"))  # Python reads 1_0 as 10, no other reader does
    except ValueError:
        raise source.wrong(f"{place}: {key} holds '{word}', which is not a number") from None
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


