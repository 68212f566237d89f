"""Load a robot from a file, its URDF embedded, from a log, or by the name of one that is shipped."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

from pipelines.errors import Check, UsageError
from pipelines.io.files import ENDINGS, open_log
from pipelines.io.robot import Joint, RobotDescription, parse_robot
from pipelines.io.shipped import shipped
from pipelines.io.text import read_small_text
from pipelines.io.toml_text import TomlError, parse_toml

__all__ = ["load_robot", "robot_at_hand", "robot_sources", "split_tip"]

_URDF = (".urdf", ".xacro")
_HERE, _SHIPPED = "robot.toml", "rrr"  # where none is named


def load_robot(source: str | Path, tip_link: str | None = None) -> RobotDescription:
    """Read a robot from a TOML file, a URDF file, or a log, which has that of its arm; or by the bare name of one that is shipped.

    A URDF may be followed by a colon and the link at which the arm ends, "arm.urdf:hand"; `tip_link` says the same.

    Raises:
        UsageError: no such robot, or the file is not a robot description.
        InputRejected: a log that cannot be read.
    """
    path, tip = _file_and_tip(source)
    if path.suffix.lower() in ENDINGS:
        return open_log(path).log.robot
    text = "" if path.suffix.lower() in _URDF else read_small_text(path, what="a robot description (TOML) or a URDF")
    if path.suffix.lower() in _URDF or _is_xml(text):
        return _from_urdf(path, tip_link or tip)
    if tip_link or tip:
        raise UsageError("C02", "the link at which the arm ends is given for a URDF, and this is a description", where=source,
                         remedy=f"write tip_link = \"{tip_link or tip}\" under [kinematics] in it")
    _refuse_recipe(text, path)
    robot = _embed_urdf(text, path) or parse_robot(text, where=path)
    return replace(robot, checks=(*robot.checks, *_impossible_links(robot, path)))


def robot_sources(source: str | Path) -> tuple[Path, ...]:
    """The files that `load_robot(source)` reads: the description, and the URDF it names."""
    path, _ = _file_and_tip(source)
    if path.suffix.lower() in (*_URDF, *ENDINGS):
        return (path,)
    urdf = _urdf_named(_table_of(read_small_text(path)))
    if urdf is None:
        return (path,)
    whole = path.parent / urdf
    return path, whole if os.path.lexists(whole) else Path(split_tip(str(whole))[0])


def split_tip(source: str) -> tuple[str, str | None]:
    """Return the file of "arm.urdf:hand" and the link after the colon; None where there is none."""
    found = re.fullmatch(r"(.+\.\w+):([^/]+)", source)
    return (found[1], found[2]) if found else (source, None)


def robot_at_hand() -> tuple[str, str]:
    """A robot where none was named, for `load_robot`, and why it is that one."""
    if Path(_HERE).is_file():
        return _HERE, f"none was named: {_HERE} here"
    return _SHIPPED, f"none was named, and no {_HERE} is here: the shipped {_SHIPPED}"


def _file_and_tip(source: str | Path) -> tuple[Path, str | None]:
    if os.path.lexists(source):
        return _file_of(source), None
    file, tip = split_tip(str(source))
    return _file_of(file), tip


def _is_xml(text: str) -> bool:
    return text.lstrip("\ufeff \t\n").startswith("<")


def _refuse_recipe(text: str, path: Path) -> None:
    """C02: a recipe of `rrrid import` where the robot is wanted."""
    table = _table_of(text)
    if "kinematics" in table or not {"log", "file", "time", "signals"} & set(table):
        return
    robot = table.get("robot")
    use, tip = (robot.get(key) if isinstance(robot, dict) else None for key in ("use", "tip_link"))
    if isinstance(use, str):
        use = str(path.parent / use) if os.path.lexists(path.parent / use) else use
        use = f"{use}:{tip}" if tip else use
    raise UsageError("C02", "this is a recipe of rrrid import, not a robot description", where=path,
                     remedy=f"give the robot that it names: {use}" if isinstance(use, str)
                     else "give a robot description (TOML), a URDF or a shipped robot")


def _impossible_links(robot: RobotDescription, path: Path) -> tuple[Check, ...]:
    """S20: a warning for every link of a description that no rigid body can be; `import_urdf` warns of those of a URDF itself."""
    if robot.urdf_text is not None:
        return ()
    from pipelines.io.link_consistency import of_link

    return tuple(Check.of("S20", "warn", f"no rigid body has the inertial parameters of joint '{joint.name}': {words}", where=path,
                          remedy="correct its link: what is known of the links is used")
                 for joint in robot.joints if joint.link is not None and (words := of_link(joint.link)))


def _file_of(source: str | Path) -> Path:
    path = Path(source)
    if not str(source):
        raise UsageError("C02", "empty", where="--robot", remedy="name a description, a URDF, or a shipped robot")
    if os.path.lexists(path) and not os.path.isdir(path):
        return path
    try:
        return shipped("robots", str(source))
    except UsageError as problem:
        if not os.path.isdir(path):  # unlike Path.is_dir, it answers for a path that is none
            raise
        raise UsageError("C04", "a folder, not the description of a robot", where=source, remedy=problem.remedy) from None


def _table_of(text: str) -> dict[str, Any]:
    """The table of a TOML text; empty where it is none, which `parse_robot` says better."""
    try:
        return parse_toml(text)
    except TomlError:
        return {}


def _urdf_named(table: dict[str, Any]) -> str | None:
    kinematics = table.get("kinematics")
    named = kinematics.get("urdf") if isinstance(kinematics, dict) else None
    return named if isinstance(named, str) else None


def _embed_urdf(text: str, path: Path) -> RobotDescription | None:
    """`urdf = "arm.urdf"` names a file beside the description: its kinematics become `urdf_text`."""
    table = _table_of(text)
    named, kinematics = _urdf_named(table), table.get("kinematics")
    if named is None or not isinstance(kinematics, dict):
        return None
    tip = kinematics.get("tip_link")
    whole = str(path.parent / named)
    file, after_colon = (whole, None) if os.path.lexists(whole) else split_tip(whole)
    arm = _from_urdf(Path(file), tip_link=tip if isinstance(tip, str) else after_colon)
    kinematics.pop("urdf")
    kinematics["urdf_text"] = arm.urdf_text
    given = table.setdefault("joint", [{"name": j.name, "type": j.type} for j in arm.joints])
    described = _parse_table(table, path)
    if len(given) != arm.n_joints:
        raise UsageError("S02", f"{len(given)} [[joint]] tables, but the URDF has {arm.n_joints} moving joints", where=path,
                         remedy="describe each moving joint once, or none")
    merged = tuple(_fill(mine, urdf) for mine, urdf in zip(described.joints, arm.joints, strict=True))
    return replace(described, joints=merged, tip_link=arm.tip_link, checks=arm.checks)


def _from_urdf(path: Path, tip_link: str | None = None) -> RobotDescription:
    from pipelines.io.urdf import (
        import_urdf,  # and with it a parser of XML, for the few robots that need one
    )

    return import_urdf(path, tip_link=tip_link)


def _parse_table(table: dict[str, object], path: Path) -> RobotDescription:
    import tomli_w

    return parse_robot(tomli_w.dumps(table), where=path)


def _fill(mine: Joint, urdf: Joint) -> Joint:
    """`mine` with every limit it leaves open, and the link, taken from the URDF."""
    plain = Joint(mine.name)
    open_limits = {key: getattr(urdf, key) for key in ("position", "velocity", "torque", "link")
                   if getattr(mine, key) == getattr(plain, key)}
    return replace(mine, type=urdf.type, **open_limits)
