"""Load a robot from a file, its URDF embedded, or by the name of one that is shipped."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

from pipelines.errors import UsageError
from pipelines.log.robot import Joint, RobotDescription, parse_robot
from pipelines.log.shipped import shipped
from pipelines.log.urdf import import_urdf

__all__ = ["load_robot"]


def load_robot(source: str | Path) -> RobotDescription:
    """Read a robot from a TOML file, a URDF file, or by the bare name of one that is shipped.

    Raises:
        UsageError: no such robot, or the file is not a robot description.
    """
    path = Path(source)
    if not path.exists():
        path = shipped("robots", str(source))
    if path.suffix.lower() in (".urdf", ".xacro"):
        return import_urdf(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as problem:
        raise UsageError("C04", f"cannot be read: {problem}", where=path) from None
    return _embed_urdf(text, path) or parse_robot(text, where=path)


def _embed_urdf(text: str, path: Path) -> RobotDescription | None:
    """`urdf = "arm.urdf"` names a file beside the description: its kinematics become `urdf_text`."""
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return None
    kinematics = table.get("kinematics")
    if not isinstance(kinematics, dict) or not isinstance(kinematics.get("urdf"), str):
        return None
    tip = kinematics.get("tip_link")
    arm = import_urdf(path.parent / str(kinematics.pop("urdf")), tip_link=tip if isinstance(tip, str) else None)
    kinematics["urdf_text"] = arm.urdf_text
    given = table.setdefault("joint", [{"name": j.name, "type": j.type} for j in arm.joints])
    described = _parse_table(table, path)
    if len(given) != arm.n_joints:
        raise UsageError("S02", f"{len(given)} [[joint]] tables, but the URDF has {arm.n_joints} moving joints", where=path)
    merged = tuple(_fill(mine, urdf) for mine, urdf in zip(described.joints, arm.joints, strict=True))
    return replace(described, joints=merged, tip_link=arm.tip_link)


def _parse_table(table: dict[str, object], path: Path) -> RobotDescription:
    import tomli_w

    return parse_robot(tomli_w.dumps(table), where=path)


def _fill(mine: Joint, urdf: Joint) -> Joint:
    """`mine` with every limit it leaves open, and the link, taken from the URDF."""
    plain = Joint(mine.name)
    open_limits = {key: getattr(urdf, key) for key in ("position", "velocity", "torque", "link")
                   if getattr(mine, key) == getattr(plain, key)}
    return replace(mine, type=urdf.type, **open_limits)
