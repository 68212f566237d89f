"""Short searches for the tests of `design-excitation`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from pipelines.design_excitation import STAGE, Settings
from pipelines.io.robot import format_robot
from pipelines.io.robot_files import load_robot
from pipelines.stage import Outcome, Request, run_stage

QUICK = replace(Settings(), robot="rrr", evaluations=150, harmonics=(15,), rehearse=False)


def designed(out: Path, settings: Settings = QUICK, paths: tuple[Path, ...] = (), **request: Any) -> Outcome[Any]:
    return run_stage(STAGE, Request(paths, out=out, no_report=True, **request), settings)


def without_links(folder: Path) -> str:
    """A description of the same robot that says nothing of its links."""
    robot = load_robot("rrr")
    text = format_robot(replace(robot, joints=tuple(replace(joint, link=None) for joint in robot.joints)))
    (folder / "robot.toml").write_text(text)
    return str(folder / "robot.toml")
