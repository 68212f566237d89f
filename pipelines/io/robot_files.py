"""Load a robot from a file, its URDF embedded, from a log, or by the name of a shipped one."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

from pipelines.errors import Check, UsageError
from pipelines.io.files import ENDINGS, open_log
from pipelines.io.robot import Joint, RobotDescription, inconsistency_of_link, parse_robot, shipped
from pipelines.io.sandbox import TomlError, parse_toml, read_small_text

_URDF = (".urdf", ".xacro")


def load_robot(source: str | Path, tip_link: str | None = None) -> RobotDescription:
    """Read a robot from a TOML file, a URDF file or a log, or by the bare name of a shipped one.

    A URDF may be followed by a colon and the link at which the arm ends, "arm.urdf:hand";
    `tip_link` says the same.

    Raises:
        UsageError: no such robot, or the file is not a robot description.
        InputRejected: a log that cannot be read.
    """
    path, tip = _file_and_tip(source)
    tip = tip_link or tip
    if path.suffix.lower() in ENDINGS:
        return open_log(path).log.robot
    is_urdf = path.suffix.lower() in _URDF
    text = "" if is_urdf else read_small_text(path, what="a robot description (TOML) or a URDF")
    if is_urdf or text.lstrip("\ufeff \t\n").startswith("<"):
        robot = _from_urdf(path, tip)
    elif tip:
        words = "the link at which the arm ends is given for a URDF, and this is a description"
        raise UsageError("C02", words, source, f'write tip_link = "{tip}" under [kinematics] in it')
    elif _urdf_in(text) is not None:
        robot = _with_urdf(parse_toml(text), path)
    else:
        robot = parse_robot(text, where=path)
    checks = []
    for joint in robot.joints:
        if joint.link is not None and (words := inconsistency_of_link(joint.link)):
            words = f"no rigid body has the inertial parameters of joint '{joint.name}': {words}"
            remedy = "correct its link: what is known of the links is used"
            checks.append(Check.of("S17", "warn", words, path, remedy))
    return replace(robot, checks=tuple(checks))


def robot_sources(source: str | Path) -> tuple[Path, ...]:
    """Return the files that `load_robot(source)` reads: the description, and its URDF."""
    path, _ = _file_and_tip(source)
    if path.suffix.lower() in (*_URDF, *ENDINGS):
        return (path,)
    urdf = _urdf_in(read_small_text(path))
    return (path,) if urdf is None else (path, _split(path.parent / urdf)[0])


def split_tip(source: str) -> tuple[str, str | None]:
    """Return the file of "arm.urdf:hand" and the link after the colon; None without one."""
    found = re.fullmatch(r"(.+\.\w+):([^/]+)", source)
    return (found[1], found[2]) if found else (source, None)


def robot_at_hand() -> tuple[str, str]:
    """Return a robot where none was named, for `load_robot`, and why it is that one."""
    if Path("robot.toml").is_file():
        return "robot.toml", "none was named: robot.toml here"
    return "rrr", "none was named, and no robot.toml is here: the shipped rrr"


def _split(path: Path) -> tuple[Path, str | None]:
    """Return file and link of a path whose name may end in a link, unless it is there as it is."""
    file, tip = (str(path), None) if os.path.lexists(path) else split_tip(str(path))
    return Path(file), tip


def _file_and_tip(source: str | Path) -> tuple[Path, str | None]:
    if not str(source):
        remedy = "name a description, a URDF, or a shipped robot"
        raise UsageError("C02", "empty", "--robot", remedy)
    path, tip = _split(Path(source))
    if os.path.isdir(path):
        words = "a folder, not the description of a robot"
        raise UsageError("C04", words, path, "name a file, or a shipped robot")
    return (path if os.path.lexists(path) else shipped("robots", str(path))), tip


def _urdf_in(text: str) -> str | None:
    """Return the URDF that the text of a description names; what is no TOML names none."""
    try:
        kinematics = parse_toml(text).get("kinematics")
    except TomlError:
        return None
    named = kinematics.get("urdf") if isinstance(kinematics, dict) else None
    return named if isinstance(named, str) else None


def _with_urdf(table: dict[str, Any], path: Path) -> RobotDescription:
    """Return the robot of a description, its limits and links filled from the URDF it names."""
    import tomli_w

    kinematics = table["kinematics"]
    file, tip = _split(path.parent / kinematics.pop("urdf"))
    given = kinematics.get("tip_link")
    arm = _from_urdf(file, given if isinstance(given, str) else tip)
    kinematics["urdf_text"] = arm.urdf_text
    table.setdefault("joint", [{"name": joint.name, "type": joint.type} for joint in arm.joints])
    described = parse_robot(tomli_w.dumps(table), where=path)
    if described.n_joints != arm.n_joints:
        words = f"{described.n_joints} [[joint]] tables, but the URDF has {arm.n_joints}"
        remedy = "describe each moving joint once, or none"
        raise UsageError("S02", f"{words} moving joints", path, remedy)
    joints, plain = [], Joint("")
    for mine, urdf in zip(described.joints, arm.joints, strict=True):
        filled = {
            key: getattr(urdf, key)
            for key in ("position", "velocity", "torque", "link")
            if getattr(mine, key) == getattr(plain, key)
        }
        joints.append(replace(mine, type=urdf.type, **filled))
    return replace(described, joints=tuple(joints), tip_link=arm.tip_link)


def _from_urdf(path: Path, tip_link: str | None) -> RobotDescription:
    from pipelines.io.urdf import import_urdf  # and with it a parser of XML, for few robots

    return import_urdf(path, tip_link=tip_link)
