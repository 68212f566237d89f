"""Describe a robot: kinematics, limits, known links and drive, as TOML text that travels inside every log.

    robot = parse_robot(text)      from the text of a log
    text  = format_robot(robot)    the canonical text

Files, which may name a URDF, are read by `pipelines.io.robot_files`.

The validator is written out here rather than left to pydantic: it runs for every log that is opened, and importing
pydantic alone costs more than reading a ten-second log.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import NoReturn

from pipelines.errors import Check, InputRejected, RrridError, UsageError, did_you_mean
from pipelines.io.toml_text import TomlError, parse_toml

__all__ = ["Drive", "Joint", "LinkParameters", "RobotDescription", "format_robot", "parse_robot"]

Vector = tuple[float, float, float]

_ROBOT_KEYS = ("name", "gravity", "kinematics", "joint", "drive")
_KINEMATICS_KEYS = ("convention", "urdf", "urdf_text", "tip_link", "tool")
_JOINT_KEYS = ("name", "type", "a", "alpha", "d", "offset", "position", "velocity", "acceleration", "torque",
               "encoder_resolution", "link")
_GEOMETRY = ("a", "alpha", "d", "offset")
_LEAST = 'write at least: [[joint]] name = "elbow", type = "revolute", a = 0.4, alpha = 0.0, d = 0.0, offset = 0.0, a line each'
_LEAST_URDF = 'write at least: [[joint]] name = "elbow", type = "revolute", a line each'
_LONGEST = 100.0  # [m] no arm has such a link
_LINK_KEYS = ("mass", "com", "inertia")
_DRIVE_KEYS = ("transmission", "torque_constant")
_CONVENTIONS = ("dh", "mdh", "urdf")


@dataclass(frozen=True)
class LinkParameters:
    """What is known of one link, in the link's own frame (DH: the distal frame; modified DH and URDF: the joint's).

    `inertia` holds Ixx Iyy Izz Ixy Ixz Iyz about the frame's *origin*, products with positive sign, Ixy = +∫xy dm:
    the convention of Kostić et al. 2004, eq. (7), and of `verified.md`, section 0.
    """

    mass: float  # [kg]
    com: Vector  # [m]
    inertia: tuple[float, float, float, float, float, float]  # [kg m^2]


@dataclass(frozen=True)
class Joint:
    """One moving joint. Prismatic joints use m, m/s, m/s^2 and N where revolute ones use rad, rad/s, rad/s^2, N m."""

    name: str
    type: str = "revolute"  # or "prismatic"
    a: float = 0.0  # [m]
    alpha: float = 0.0  # [rad]
    d: float = 0.0  # [m]
    offset: float = 0.0  # [rad] q_model = q_log + offset
    position: tuple[float, float] = (-math.inf, math.inf)  # [rad]
    velocity: float = math.inf  # [rad/s]
    acceleration: float = math.inf  # [rad/s^2]
    torque: float = math.inf  # [N m]
    encoder_resolution: float | None = None  # [rad]
    link: LinkParameters | None = None

    @property
    def revolute(self) -> bool:
        return self.type == "revolute"


@dataclass(frozen=True)
class Drive:
    """The motor side, kept for effects that live there; never applied on reading, for a log is joint side already.

    q_motor = N q_joint, tau_joint = Nᵀ tau_motor with N = `transmission`.
    """

    transmission: tuple[tuple[float, ...], ...] | None = None  # (n, n)
    torque_constant: tuple[float, ...] | None = None  # (n,) [N m/A], motor side


@dataclass(frozen=True)
class RobotDescription:
    """A robot as a log describes it. Frozen and hashable, so that geometry made from it can be cached."""

    name: str
    gravity: Vector  # [m/s^2] in the base frame
    convention: str  # "dh" | "mdh" | "urdf"
    joints: tuple[Joint, ...]
    tool: Vector = (0.0, 0.0, 0.0)  # [m] tip in the last frame
    urdf_text: str | None = None  # kinematics of a URDF, meshes left out
    tip_link: str | None = None  # last link, where a URDF branches
    drive: Drive | None = None
    checks: tuple[Check, ...] = field(default=(), compare=False)  # what its file was warned of; no part of the robot

    @property
    def n_joints(self) -> int:
        return len(self.joints)

    @property
    def revolute(self) -> tuple[bool, ...]:
        return tuple(joint.revolute for joint in self.joints)


class _Reader:
    """Take typed values out of a TOML table; every complaint names its place."""

    def __init__(self, table: object, path: str, fail: type[RrridError], where: str) -> None:
        self.path, self.fail, self.where = path, fail, where
        if not isinstance(table, Mapping):
            self.wrong(path or "the robot description", "must be a table")
        self.table: Mapping[str, object] = table

    def wrong(self, key: str, what: str, code: str = "C02", remedy: str = "correct the robot description") -> NoReturn:
        place = f"{self.path}.{key}" if self.path and key != self.path else key
        raise self.fail(code, f"robot description, {place}: {what}", where=self.where, remedy=remedy)

    def only(self, known: Iterable[str]) -> None:
        for key in self.table:
            if key not in known:
                self.wrong(key, f"is not a key of the format{did_you_mean(key, known)}", code="C01")

    def text(self, key: str, default: str | None = None, among: tuple[str, ...] | None = None) -> str:
        value = self.table.get(key, default)
        if not isinstance(value, str) or not value.strip():
            self.wrong(key, "must be a text that is not empty" if key in self.table else "is missing")
        if "\0" in str(value):
            self.wrong(key, "holds a NUL character")
        if among is not None and value not in among:
            self.wrong(key, f"is '{value}', must be one of {', '.join(among)}")
        return str(value)

    def number(self, key: str, default: float | None = None, low: float = -math.inf, infinite: bool = False) -> float:
        if key not in self.table and default is not None:
            return default
        value = self.table.get(key)
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.wrong(key, "must be a number" if key in self.table else "is missing")
        try:
            number = float(value)
        except OverflowError:  # an integer of hundreds of digits
            number = math.inf
            infinite = False
        if math.isnan(number) or (math.isinf(number) and not infinite) or number < low:
            self.wrong(key, f"is {number}, must be {'' if infinite else 'finite and '}at least {low}")
        return number

    def numbers(self, key: str, size: int, infinite: bool = False) -> tuple[float, ...]:
        value = self.table.get(key)
        entries: list[object] = value if isinstance(value, list) else []
        if len(entries) != size:
            self.wrong(key, f"must be a list of {size} numbers")
        inner = _Reader({f"{key}[{i}]": entry for i, entry in enumerate(entries)}, self.path, self.fail, self.where)
        return tuple(inner.number(k, infinite=infinite) for k in inner.table)

    def vector(self, key: str) -> Vector:
        x, y, z = self.numbers(key, 3)
        return x, y, z


def parse_robot(text: str, *, where: object = "", inside_log: bool = False) -> RobotDescription:
    """Read the TOML text of a robot.

    Raises:
        UsageError: the text is not a robot description (exit 2).
        InputRejected: the same, where the text came out of a log (`inside_log`, exit 3).
    """
    fail: type[RrridError] = InputRejected if inside_log else UsageError
    try:
        table = parse_toml(text)
    except TomlError as problem:
        raise fail("C01", f"the robot description is not valid TOML: {problem}", where=where,
                   remedy="correct it at that place") from None
    top = _Reader(table, "", fail, str(where))
    top.only(_ROBOT_KEYS)
    kinematics = _Reader(table.get("kinematics"), "kinematics", fail, str(where))
    kinematics.only(_KINEMATICS_KEYS)
    convention = kinematics.text("convention", among=_CONVENTIONS)
    if "urdf" in kinematics.table:
        kinematics.wrong("urdf", "names a file, which a text on its own cannot reach",
                         remedy="load the description from its file, so that the URDF can be embedded")
    if convention == "urdf" and "urdf_text" not in kinematics.table:
        kinematics.wrong("urdf_text", "is missing with convention 'urdf'")
    joints = table.get("joint")
    if not isinstance(joints, list) or not joints:
        top.wrong("joint", "there must be at least one [[joint]]")
    return RobotDescription(
        name=top.text("name"),
        gravity=top.vector("gravity"),
        convention=convention,
        joints=tuple(_joint(_Reader(j, f"joint[{i + 1}]", fail, str(where)), convention)
                     for i, j in enumerate(joints)),
        tool=kinematics.vector("tool") if "tool" in kinematics.table else (0.0, 0.0, 0.0),
        urdf_text=kinematics.text("urdf_text") if convention == "urdf" else None,
        tip_link=kinematics.text("tip_link") if "tip_link" in kinematics.table else None,
        drive=_drive(table.get("drive"), len(joints), fail, str(where)),
    )


def _joint(read: _Reader, convention: str) -> Joint:
    read.only(_JOINT_KEYS)
    geometric = _geometric(read, convention)
    low, high = read.numbers("position", 2, infinite=True) if "position" in read.table else (-math.inf, math.inf)
    if low >= high:
        read.wrong("position", f"its lower end {low} is not below its upper end {high}")
    limits = {key: read.number(key, default=math.inf, low=0.0, infinite=True)
              for key in ("velocity", "acceleration", "torque")}
    for key, value in limits.items():
        if value == 0.0:
            read.wrong(key, "is 0: the joint could never move")
    resolution = read.number("encoder_resolution", low=0.0) if "encoder_resolution" in read.table else None
    link = _link(_Reader(read.table["link"], f"{read.path}.link", read.fail, read.where)) if "link" in read.table else None
    return Joint(read.text("name"), read.text("type", among=("revolute", "prismatic")), position=(low, high),
                 encoder_resolution=resolution, link=link, **geometric, **limits)


def _geometric(read: _Reader, convention: str) -> dict[str, float]:
    """The numbers that place the joint; what is missing is named at once, and what cannot be in rad or m."""
    wanted = () if convention == "urdf" else _GEOMETRY
    missing = [key for key in ("name", "type", *wanted) if key not in read.table]
    if missing:
        read.wrong(read.path, f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing",
                   remedy=_LEAST if wanted else _LEAST_URDF)
    found = {key: read.number(key) for key in _GEOMETRY if key in wanted or (key == "offset" and key in read.table)}
    if abs(found.get("alpha", 0.0)) > 2 * math.pi:
        read.wrong("alpha", f"is {found['alpha']:g} rad: looks like degrees", remedy="write it in rad")
    for key in ("a", "d"):
        if abs(found.get(key, 0.0)) > _LONGEST:
            read.wrong(key, f"is {found[key]:g} m: looks like mm", remedy="write it in m")
    return found


def _link(read: _Reader) -> LinkParameters:
    read.only(_LINK_KEYS)
    xx, yy, zz, xy, xz, yz = read.numbers("inertia", 6)
    return LinkParameters(read.number("mass", low=0.0), read.vector("com"), (xx, yy, zz, xy, xz, yz))


def _drive(table: object, n: int, fail: type[RrridError], where: str) -> Drive | None:
    if table is None:
        return None
    read = _Reader(table, "drive", fail, where)
    read.only(_DRIVE_KEYS)
    matrix = None
    if "transmission" in read.table:
        value = read.table["transmission"]
        rows: list[object] = value if isinstance(value, list) else []
        if len(rows) != n:
            read.wrong("transmission", f"must hold {n} rows of {n} numbers")
        inner = _Reader({f"transmission[{i}]": row for i, row in enumerate(rows)}, "drive", fail, where)
        matrix = tuple(inner.numbers(key, n) for key in inner.table)
    constants = read.numbers("torque_constant", n) if "torque_constant" in read.table else None
    return Drive(matrix, constants)


def format_robot(robot: RobotDescription) -> str:
    """The canonical TOML text of `robot`: `parse_robot` gives back an equal description."""
    import tomli_w

    kinematics: dict[str, object] = {"convention": robot.convention, "tool": list(robot.tool)}
    if robot.tip_link is not None:
        kinematics["tip_link"] = robot.tip_link
    if robot.urdf_text is not None:
        kinematics["urdf_text"] = robot.urdf_text
    table: dict[str, object] = {"name": robot.name, "gravity": list(robot.gravity), "kinematics": kinematics,
                                "joint": [_joint_table(j, robot.convention) for j in robot.joints]}
    if robot.drive is not None:
        drive: dict[str, object] = {}
        if robot.drive.transmission is not None:
            drive["transmission"] = [list(row) for row in robot.drive.transmission]
        if robot.drive.torque_constant is not None:
            drive["torque_constant"] = list(robot.drive.torque_constant)
        table["drive"] = drive
    return tomli_w.dumps(table, multiline_strings=True)


def _joint_table(joint: Joint, convention: str) -> dict[str, object]:
    table: dict[str, object] = {"name": joint.name, "type": joint.type}
    if convention != "urdf":
        table |= {"a": joint.a, "alpha": joint.alpha, "d": joint.d}
    if convention != "urdf" or joint.offset:
        table["offset"] = joint.offset
    table["position"] = list(joint.position)
    table |= {key: getattr(joint, key) for key in ("velocity", "acceleration", "torque")
              if math.isfinite(getattr(joint, key))}
    if joint.encoder_resolution is not None:
        table["encoder_resolution"] = joint.encoder_resolution
    if joint.link is not None:
        table["link"] = {"mass": joint.link.mass, "com": list(joint.link.com), "inertia": list(joint.link.inertia)}
    return table
