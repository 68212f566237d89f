"""Every reader of rrrid, the good files it is tried on, and what is done with what it has read.

`work(path)` reads a file and uses it as a command would; it raises what the command would end with.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from pipelines import import_log, inspect, reconstruct, simulate
from pipelines.dynamics.arm import Arm
from pipelines.dynamics.named_cause import acting_cause
from pipelines.dynamics.rrr import rigid_body
from pipelines.effects.base import Motion
from pipelines.io.files import open_log, write_log
from pipelines.io.model_file import model_text, read_model
from pipelines.io.robot_files import load_robot
from pipelines.stage import Request, Stage
from rrrid_cli.options import make_settings
from tests.healthy import fourier, make_log
from tests.importers.good import RECIPE, good, text
from tests.importers.test_matlab import mat73, signals
from tests.io.logs import small_log

__all__ = ["READERS", "Reader"]

SAMPLES = Path(__file__).parents[2] / "sample_logs"
_DEEP = 16  # one in so many that were read goes through a whole stage as well
URDF = """<?xml version="1.0"?>
<robot name="arm">
  <link name="base"/>
  {links}
  {joints}
</robot>
"""


@dataclass(frozen=True)
class Reader:
    """What is read, from which good files, and how a command may end on a damaged one."""

    name: str
    ending: str
    exits: frozenset[int]
    seeds: Callable[[Path], list[bytes]]
    work: Callable[[Path], None]


@lru_cache
def _motion() -> Motion:
    rng = np.random.default_rng(0)
    return Motion(1e-3 * np.arange(5), *rng.uniform(-1, 1, (3, 5, 3)), 1e-3)


def _through(stage: Stage[Any, Any], request: Request, settings: Any) -> None:
    """Read, compute, report: a command but for its writing."""
    stage.report(stage.compute(stage.read(request, settings), settings))


def _log_bytes(ending: str) -> Callable[[Path], list[bytes]]:
    def make(folder: Path) -> list[bytes]:
        write_log(folder / f"a{ending}", _checksummed())
        return [(folder / f"a{ending}").read_bytes()]

    return make


@lru_cache
def _checksummed() -> Any:
    return small_log(samples=40)


def _same_log(path: Path) -> None:
    found = open_log(path).log
    assert found == _checksummed(), "a checksummed log was read with other numbers"


def _short_log(path: Path) -> Path:
    """A log beside the damaged file, to use that on; written once."""
    log = path.parent / "log.h5"
    if not log.exists():
        write_log(log, make_log(fourier(np.random.default_rng(1)), duration=1.0, sample_time=0.004))
    return log


def _deep(path: Path) -> bool:
    return sum(path.read_bytes()) % _DEEP == 0


def _imported(recipe: Path, source: Path) -> None:
    settings = import_log.Settings(recipe=str(recipe), source=source)
    result = import_log.STAGE.compute(import_log.STAGE.read(Request(()), settings), settings)
    import_log.STAGE.report(result)
    for item in result.logs[:2]:
        write_log(source.parent / "written.h5", item.log)


def _recording(path: Path) -> None:
    """One recorded file by a good recipe."""
    recipe = path.parent.parent / "recipe.toml"
    names = {".npy": ('"tau_{j}"', "[5, 6, 7]", '"q_{j}"', "[2, 3, 4]", '"t"', "1")}.get(path.suffix, ())
    said = RECIPE.replace('"*.csv"', f'"*{path.suffix}"')
    for old, new in zip(names[::2], names[1::2], strict=True):
        said = said.replace(old, new)
    recipe.write_text(said)
    _imported(recipe, path.parent)


def _recipe(path: Path) -> None:
    source = path.parent / "source"
    if not source.exists():
        source.mkdir()
        (source / "run.csv").write_text(_few_lines())
    _imported(path, source)


@lru_cache
def _few_lines() -> str:
    return "\n".join(text(good()).splitlines()[:121]) + "\n"


def _npy(folder: Path) -> list[bytes]:
    columns = np.column_stack(list(good().values()))[:60]
    found = []
    for array in (columns, np.asfortranarray(columns), columns.astype(np.float32)):
        buffer = io.BytesIO()
        np.save(buffer, array)
        found.append(buffer.getvalue())
    return found


def _mat(folder: Path) -> list[bytes]:
    import scipy.io

    brief = {name: values[:40] for name, values in signals().items()}
    found = []
    for version in ("5", "5z", "4"):
        scipy.io.savemat(folder / "a.mat", brief, do_compression=version == "5z", format="4" if version == "4" else "5")
        found.append((folder / "a.mat").read_bytes())
    return [*found, mat73(folder / "a.mat").read_bytes()]


def _csv(folder: Path) -> list[bytes]:
    brief = _few_lines()
    return [brief.encode(), brief.replace(",", ";").replace(".", ",").encode(), b"\xef\xbb\xbf" + brief.encode(),
            brief.encode("utf-16"), brief.replace(",", "\t").replace("\n", "\r\n").encode()]


def _recipes(folder: Path) -> list[bytes]:
    full = RECIPE.replace('unit = "s"', 'unit = "s"\nrate = 1000\nlongest_gap = 0.1') + (
        '[drive]\ntransmission = [1.0, 2.0, 0.5]\n[missing]\nvalues = [-999]\n[resample]\nrate = 500\n'
        '[controller]\nlaw = "pd"\nkp = [100.0, 50.0, 10.0]\nkd = [1.0, 1.0, 0.5]\n[format]\ndelimiter = ","\n'
        '[[file]]\nmatch = "run_{n}.csv"\nname = "b"\nrole = "validate"\n')
    written_out = RECIPE.replace('use = "rrr"', 'name = "r"\ngravity = [0.0, 0.0, -9.81]\n[robot.kinematics]\nconvention = "dh"\n'
                                 + 3 * ('[[robot.joint]]\nname = "j"\ntype = "revolute"\na = 0.1\nalpha = 0.0\nd = 0.0\n'
                                        'offset = 0.0\nposition = [-2.0, 2.0]\nencoder_resolution = 1e-5\n'))
    return [RECIPE.encode(), full.encode(), written_out.encode()]


def _robots(folder: Path) -> list[bytes]:
    rrr = (SAMPLES / "robots/rrr.toml").read_text()
    drive = "\n[drive]\ntransmission = [[100.0, 0.0, 0.0], [0.0, 80.0, 0.0], [0.0, 0.0, 50.0]]\n"
    drive += "torque_constant = [0.1, 0.1, 0.05]\n"
    return [rrr.encode(), (rrr + drive).replace('"dh"', '"mdh"').encode()]


def _robot(path: Path) -> None:
    robot = load_robot(path)
    body = rigid_body(robot)
    p = body.known_parameters()
    motion = _motion()
    if p is not None and robot.n_joints == 3:
        body.torque(motion.q, motion.dq, motion.ddq, p)
    if _deep(path):
        _through(inspect.STAGE, Request((_short_log(path),), robot=str(path)), inspect.Settings())


def _urdfs(folder: Path) -> list[bytes]:
    inertial = ('<inertial><origin xyz="0.1 0 0" rpy="0 0.1 0"/><mass value="2.0"/>'
                '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0.0" ixz="0" iyz="0"/></inertial>')
    links = "\n  ".join(f'<link name="l{j}">{inertial}</link>' for j in (1, 2, 3))
    joints = "\n  ".join(
        f'<joint name="j{j}" type="revolute"><origin xyz="0.2 0 0.1" rpy="{r} 0 0"/><parent link="{parent}"/><child link="l{j}"/>'
        f'<axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="50" velocity="6"/></joint>'
        for j, parent, r in ((1, "base", 0), (2, "l1", 1.57), (3, "l2", 0)))
    return [URDF.format(links=links, joints=joints).encode()]


def _models(folder: Path) -> list[bytes]:
    from tests.controlled import (
        controlled_log,  # and with it MuJoCo: every fork of this process would be dearer
    )

    write_log(folder / "data/waving.h5", controlled_log(400))
    plain = read_model(SAMPLES / "models/rrr.json")
    arm = Arm.from_model(plain)
    said = ("encoder_crosstalk:1:coefficient=0.1,from_joint=3", "cogging:2:amplitude=0.2,order=18")
    acting = [acting_cause(text, arm.robot.revolute) for text in said]
    return [model_text(plain).encode(), *(model_text(arm.extended(one).to_model()).encode() for one in acting)]


def _model(path: Path) -> None:
    arm = Arm.from_model(read_model(path), path)
    motion = _motion()
    if arm.n_joints == 3:
        arm.torque(motion)
    if _deep(path):
        _through(simulate.STAGE, Request((path.parent / "waving.h5",)), replace(simulate.Settings(), model=str(path)))


def _configs(folder: Path) -> list[bytes]:
    return [b'[reconstruct]\nbandwidth = [20.0, 20.0, 30.0]\norder = 3\n[convert]\nto = "csv"\n'
            b'[inspect]\ntrust_units = true\nallow_overlap = false\n'
            b'[estimate-bps]\ncutoff_hz = 20.0\ndecimate = 2\nblocks = 3\n[fit-friction]\nwindow = 0.02\n']


def _config(path: Path) -> None:
    for stage in ("reconstruct", "inspect"):
        settings = make_settings(stage, path, (), {})
        if stage == "reconstruct" and _deep(path):
            _through(reconstruct.STAGE, Request((_short_log(path),)), settings)


_LOG, _DESCRIPTION = frozenset({0, 3}), frozenset({0, 2, 3})
READERS = {reader.name: reader for reader in (
    Reader("hdf5", ".h5", _LOG, _log_bytes(".h5"), _same_log),
    Reader("parquet", ".parquet", _LOG, _log_bytes(".parquet"), _same_log),
    Reader("csv", ".csv", _LOG, _csv, _recording),
    Reader("mat", ".mat", _LOG, _mat, _recording),
    Reader("npy", ".npy", _LOG, _npy, _recording),
    Reader("robot", ".toml", _DESCRIPTION, _robots, _robot),
    Reader("recipe", ".toml", _DESCRIPTION | {5}, _recipes, _recipe),
    Reader("urdf", ".urdf", _DESCRIPTION, _urdfs, _robot),
    Reader("model", ".json", _LOG, _models, _model),
    Reader("config", ".toml", _DESCRIPTION, _configs, _config))}
