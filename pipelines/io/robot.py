"""Describe a robot: kinematics, limits, known links and drive, as TOML text inside every log.

robot = parse_robot(text)      from the text of a log
text  = format_robot(robot)    the canonical text

Files, which may name a URDF, are read by `pipelines.io.robot_files`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from pipelines.errors import Check, InputRejected, RrridError, UsageError, did_you_mean
from pipelines.io.config import URDF
from pipelines.io.sandbox import TomlError, parse_toml
from pipelines.io.schema import Strict, adapter, described, fault_in_words

Vector = tuple[float, float, float]
Six = tuple[float, float, float, float, float, float]

_TEXT = r"^[^\x00]*[^\x00\s][^\x00]*$"

# In a wheel the files lie inside the package; in a checkout in sample_logs/.
_PACKAGE = Path(__file__).resolve().parents[1]
_ROOTS = (_PACKAGE / "shipped", _PACKAGE.parent / "sample_logs")
_ENDINGS = {"robots": ".toml", "recipes": ".toml", "models": ".json"}


@dataclass(frozen=True)
class LinkParameters(Strict):
    """Known parameters of one link, in its own frame (DH: the distal one; MDH, URDF: the joint's).

    `inertia` holds Ixx Iyy Izz Ixy Ixz Iyz about the frame's *origin*, products with positive
    sign, Ixy = +∫xy dm: the convention of Kostić et al. 2004, eq. (7).
    """

    mass: float = described("[kg]", ge=0.0)
    com: Vector = described("[m] centre of mass")
    inertia: Six = described("[kg m^2] Ixx Iyy Izz Ixy Ixz Iyz")


@dataclass(frozen=True)
class Joint:
    """One moving joint. Prismatic joints use m and N instead of rad and N m."""

    __pydantic_config__: ClassVar[dict[str, object]] = {"extra": "forbid", "strict": True}

    name: str = described("name of the joint", pattern=_TEXT)
    type: Literal["revolute", "prismatic"] = described("kind of joint", "revolute")
    a: float = described("[m]", 0.0, allow_inf_nan=False)
    alpha: float = described("[rad]", 0.0, allow_inf_nan=False)
    d: float = described("[m]", 0.0, allow_inf_nan=False)
    offset: float = described("[rad] q_model = q_log + offset", 0.0, allow_inf_nan=False)
    position: tuple[float, float] = described("[rad] range", (-math.inf, math.inf))
    velocity: float = described("[rad/s] limit", math.inf, gt=0.0)
    acceleration: float = described("[rad/s^2] limit", math.inf, gt=0.0)
    torque: float = described("[N m] limit", math.inf, gt=0.0)
    encoder_resolution: float | None = described("[rad]", None, ge=0.0, allow_inf_nan=False)
    link: LinkParameters | None = described("what is known of the link", None)

    @property
    def revolute(self) -> bool:
        """Return whether the joint turns."""
        return self.type == "revolute"


@dataclass(frozen=True)
class Drive(Strict):
    """The motor side, kept for effects that live there; never applied on reading.

    q_motor = N q_joint, tau_joint = Nᵀ tau_motor with N = `transmission`.
    """

    transmission: tuple[tuple[float, ...], ...] | None = described("(n, n)", None)
    torque_constant: tuple[float, ...] | None = described("(n,) [N m/A], motor side", None)


@dataclass(frozen=True)
class RobotDescription:
    """A robot as a log describes it. Hashable, so that geometry made from it can be kept."""

    name: str
    gravity: Vector  # [m/s^2] in the base frame
    convention: str  # "dh" | "mdh" | "urdf"
    joints: tuple[Joint, ...]
    tool: Vector = (0.0, 0.0, 0.0)  # [m] tip in the last frame
    urdf_text: str | None = None  # kinematics of a URDF, meshes left out
    tip_link: str | None = None  # last link, where a URDF branches
    drive: Drive | None = None
    # what its file was warned of; no part of the robot
    checks: tuple[Check, ...] = field(default=(), compare=False)

    @property
    def n_joints(self) -> int:
        """Return the number of joints."""
        return len(self.joints)

    @property
    def revolute(self) -> tuple[bool, ...]:
        """Return of each joint whether it turns."""
        return tuple(joint.revolute for joint in self.joints)


@dataclass(frozen=True)
class _Kinematics(Strict):
    """The table [kinematics]."""

    convention: Literal["dh", "mdh", "urdf"] = described("meaning of the joints' numbers")
    tool: Vector = described("[m] tip in the last frame", (0.0, 0.0, 0.0))
    urdf_text: str | None = described("kinematics of a URDF", None, pattern=_TEXT)
    tip_link: str | None = described("last link of the arm", None, pattern=_TEXT)


@dataclass(frozen=True)
class _Table(Strict):
    """The TOML text of a robot."""

    name: str = described("name of the robot", pattern=_TEXT)
    gravity: Vector = described("[m/s^2] in the base frame")
    kinematics: _Kinematics = described("how the joints follow each other")
    joint: tuple[Joint, ...] = described("the moving joints", min_length=1)
    drive: Drive | None = described("the motor side", None)


def parse_robot(text: str, *, where: object = "", inside_log: bool = False) -> RobotDescription:
    """Read the TOML text of a robot.

    Raises:
        UsageError: the text is not a robot description (exit 2).
        InputRejected: the same, where the text came out of a log (`inside_log`, exit 3).
    """
    from pydantic import ValidationError

    fail: type[RrridError] = InputRejected if inside_log else UsageError
    remedy = "correct the robot description"
    try:
        table = parse_toml(text)
        words = _missing(table)
        found: _Table | None = None
        if not words:
            found = adapter(_Table).validate_json(json.dumps(table, default=str))  # of dates
            words = _impossible(found)
    except TomlError as problem:
        words = f"the robot description is not valid TOML: {problem}"
        raise fail("C01", words, where, "correct it at that place") from None
    except ValidationError as problem:
        kinds = (_Table, _Kinematics, Joint, LinkParameters, Drive)
        kind, words = fault_in_words(problem, *kinds, first=1)
        code = "C01" if kind == "unknown" else "C02"
        raise fail(code, f"robot description, {words}", where, remedy) from None
    if words or found is None:
        raise fail("C02", f"robot description, {words}", where, remedy)
    own = found.kinematics
    return RobotDescription(
        found.name,
        found.gravity,
        own.convention,
        found.joint,
        own.tool,
        own.urdf_text if own.convention == "urdf" else None,
        own.tip_link,
        found.drive,
    )


def _missing(table: Mapping[str, Any]) -> str:
    """Return all that a joint lacks, and of a URDF what only its file can give; "" for nothing."""
    kinematics, joints = table.get("kinematics"), table.get("joint")
    if not isinstance(kinematics, dict) or not isinstance(joints, list):
        return ""
    if "urdf" in kinematics:
        return "kinematics.urdf: names a file; load the description from its own file"
    wanted = ["name", "type", "a", "alpha", "d", "offset"]
    if kinematics.get("convention") == "urdf":
        wanted = wanted[:2]
        if "urdf_text" not in kinematics:
            return "kinematics.urdf_text: is missing with convention 'urdf'"
    for index, joint in enumerate(joints, 1):
        missing = [key for key in wanted if isinstance(joint, dict) and key not in joint]
        if missing:
            verb = "is" if len(missing) == 1 else "are"
            return f"joint[{index}]: {', '.join(missing)} {verb} missing"
    return ""


def _impossible(table: _Table) -> str:
    """Return what has another unit, an empty range, or another number of joints; "" for nothing."""
    for index, joint in enumerate(table.joint, 1):
        place = f"joint[{index}]"
        if abs(joint.alpha) > 2 * math.pi:
            return f"{place}.alpha: is {joint.alpha:g} rad: looks like degrees"
        for key, length in (("a", joint.a), ("d", joint.d)):
            if abs(length) > URDF.longest:
                return f"{place}.{key}: is {length:g} m: looks like mm"
        low, high = joint.position
        if not low < high:
            return f"{place}.position: its lower end {low} is not below its upper end {high}"
    n, drive = len(table.joint), table.drive or Drive()
    matrix = drive.transmission or ()
    rows = (drive.transmission, drive.torque_constant, *matrix)
    lengths = {len(row) for row in rows if row is not None}
    return f"drive: a row of {max(lengths - {n})} for {n} joints" if lengths - {n} else ""


def format_robot(robot: RobotDescription) -> str:
    """Return the canonical TOML text of `robot`: `parse_robot` gives back an equal description."""
    import tomli_w

    own: dict[str, Any] = {"convention": robot.convention, "tool": robot.tool}
    own |= {"tip_link": robot.tip_link, "urdf_text": robot.urdf_text}
    table: dict[str, Any] = {"name": robot.name, "gravity": robot.gravity, "kinematics": own}
    table["joint"] = [asdict(joint) for joint in robot.joints]
    for joint in table["joint"]:
        for key in ("velocity", "acceleration", "torque"):
            joint[key] = joint[key] if math.isfinite(joint[key]) else None
        if robot.convention == "urdf":
            joint |= {"a": None, "alpha": None, "d": None, "offset": joint["offset"] or None}
    table["drive"] = robot.drive and asdict(robot.drive)
    return tomli_w.dumps(_without_none(table), multiline_strings=True)


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return [_without_none(item) for item in value] if isinstance(value, list) else value


def inconsistency_of_link(link: LinkParameters) -> str:
    """Return why no rigid body has the parameters of a link; "" where one has.

    With I_c = I_o - m (|c|² 1 - c cᵀ), a body exists where m > 0 and the second moment of its
    density, Σ = ½ tr(I_c) 1 - I_c, has no negative eigenvalue (Wensing, Kim and Slotine 2018,
    pseudo-inertia): with the principal moments A ≤ B ≤ C, that is A ≥ 0 and C ≤ A + B.
    """
    xx, yy, zz, xy, xz, yz = link.inertia
    about_origin = np.array([[xx, -xy, -xz], [-xy, yy, -yz], [-xz, -yz, zz]])
    com = np.array(link.com)
    shift = link.mass * (com @ com * np.eye(3) - np.outer(com, com))
    smallest, middle, largest = np.linalg.eigvalsh(about_origin - shift)
    allowed = URDF.rounding * float(np.abs([smallest, middle, largest]).sum())
    if link.mass <= 0.0 and largest > 0.0:
        return "an inertia without mass"
    if smallest < -allowed:
        return f"a negative moment of inertia, {smallest:.3g} kg m^2"
    if largest > smallest + middle + allowed:
        others = f"above the sum of the two others, {smallest + middle:.3g}"
        return f"a moment of inertia, {largest:.3g} kg m^2, {others}"
    return ""


def shipped_names(kind: str) -> list[str]:
    """Return the names of the shipped "robots", "recipes" or "models", sorted."""
    return sorted(
        {path.stem for root in _ROOTS for path in (root / kind).glob(f"*{_ENDINGS[kind]}")}
    )


def shipped(kind: str, name: str) -> Path:
    """Return the file of the shipped robot, recipe or model `name`.

    Raises:
        UsageError: C04, nothing of that name is shipped.
    """
    known = shipped_names(kind)
    for root in _ROOTS:
        path = root / kind / f"{name}{_ENDINGS[kind]}"
        if name in known and path.is_file():
            return path
    words = f"no such file, and no shipped {kind[:-1]} of that name{did_you_mean(name, known)}"
    raise UsageError("C04", words, name, f"shipped {kind}: {', '.join(known) or 'none'}")
