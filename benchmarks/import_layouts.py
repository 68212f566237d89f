"""Draft a recipe for recordings in the layouts that people have, fill its blanks, and import them.

    python -m benchmarks.import_layouts [NAME…]

Each layout is a small recording, written after the documentation of a recorder or a public report,
with what is true. A draft is "right" where the imported log equals the truth without an answer,
"asks" where it does so once the blanks are filled as a person would fill them, or where the file
is refused with a reason; "wrong" where the import succeeds and the log differs: no layout may be wrong.
"failed" is a draft that no answer makes usable.
"""

from __future__ import annotations

import io
import json
import sys
import tempfile
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import tomli_w

from pipelines.errors import RrridError
from pipelines.import_log import STAGE, Settings
from pipelines.log.files import open_log
from pipelines.log.recording.guess import guess_recipe
from pipelines.stage import Request, run_stage

Array = npt.NDArray[Any]

SAMPLES = 700
Columns = dict[str, Any]  # name -> (samples,) or (samples, n) numbers, or texts
UR = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
PANDA = tuple(f"panda_joint{j}" for j in range(1, 8))
BLANK = "FILL IN"


@dataclass(frozen=True)
class Layout:
    """Files of one recording, and what is true of them.

    `answers` holds what a person would fill in, by place: "time.rate", "signals.tau.unit", …
    """

    files: Mapping[str, bytes]
    t: Array  # (samples,) [s]
    q: Array  # (samples, joints) [rad] or [m]
    tau: Array  # (samples, joints) [N m] or [N]
    answers: Mapping[str, Any] = field(default_factory=dict)
    recording: str = "run.csv"


@dataclass(frozen=True)
class Verdict:
    """Outcome of one layout: "right", "asks", "wrong" or "failed", and why."""

    outcome: str
    why: str


@dataclass(frozen=True)
class Motion:
    """A smooth motion with inertia, gravity and friction: q, dq, tau (samples, joints) in SI."""

    t: Array
    q: Array
    dq: Array
    tau: Array


def motion(
    n: int, step: float = 0.004, seed: int = 1, samples: int = SAMPLES, slides: Sequence[int] = ()
) -> Motion:
    """Return a Fourier motion of `n` joints with torques of a plain arm; joints in `slides` move 0.1 m."""
    rng = np.random.default_rng(seed)
    t = np.arange(samples) * step
    base = 2.0 * np.pi / (samples * step)
    q, dq, ddq = (np.zeros((samples, n)) for _ in range(3))
    for k in range(1, 6):
        a, b = rng.normal(size=(2, n)) / k
        s, c = np.sin(k * base * t)[:, None], np.cos(k * base * t)[:, None]
        w = k * base
        q += a * s + b * c
        dq += w * (a * c - b * s)
        ddq -= w * w * (a * s + b * c)
    size = np.where(np.isin(np.arange(n), slides), 0.1, 1.0) * np.minimum(
        1.3 / np.abs(q).max(axis=0), 120.0 / np.abs(ddq).max(axis=0)
    )
    q, dq, ddq = (x * size for x in (q, dq, ddq))
    q += rng.uniform(-0.5, 0.5, n) * np.where(np.isin(np.arange(n), slides), 0.05, 1.0)
    inertia = 2.0 / (1.0 + np.arange(n))
    tau = (
        inertia * ddq
        + 8.0 * inertia * np.sin(q + 0.3)
        + 3.0 * np.tanh(20.0 * dq)
        + 1.5 * dq
        + 0.05 * rng.normal(size=q.shape)
    )
    return Motion(t, q, dq, tau)


def urdf(
    names: Sequence[str],
    slides: Sequence[int] = (),
    reach: float = 6.3,
    effort: float = 150.0,
    fingers: bool = False,
) -> bytes:
    """Return the URDF of a serial arm; with `fingers`, two sliding joints branch off its last link."""
    parts = ['<?xml version="1.0"?><robot name="arm"><link name="base"/>']
    ends = ["base", *(f"link_{j}" for j in range(1, len(names) + 1))]
    body = (
        '<inertial><mass value="2"/><origin xyz="0 0 0.1"/><inertia ixx="0.02" iyy="0.02" izz="0.02" '
        'ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    for j, name in enumerate(names):
        kind, far = ("prismatic", 0.4) if j in slides else ("revolute", reach)
        axis = "0 0 1" if j % 2 == 0 else "0 1 0"
        parts.append(
            f'<link name="{ends[j + 1]}">{body}</link><joint name="{name}" type="{kind}">'
            f'<parent link="{ends[j]}"/><child link="{ends[j + 1]}"/><origin xyz="0 0 0.3"/>'
            f'<axis xyz="{axis}"/><limit lower="{-far}" upper="{far}" effort="{effort}" velocity="10"/></joint>'
        )
    for side in (1, 2) if fingers else ():
        parts.append(
            f'<link name="finger_{side}"/><joint name="panda_finger_joint{side}" type="prismatic">'
            f'<parent link="{ends[-1]}"/><child link="finger_{side}"/><axis xyz="0 1 0"/>'
            '<limit lower="0" upper="0.04" effort="20" velocity="0.2"/></joint>'
        )
    return ("\n".join(parts) + "</robot>\n").encode()


def cells(values: Array) -> list[list[str]]:
    """Return the numbers of (samples, columns) as texts; whole ones without a point."""
    return [[f"{x:.12g}" if abs(x) < 1e15 else str(int(x)) for x in row] for row in values.tolist()]


def table(
    columns: Columns,
    delimiter: str = ",",
    header: bool = True,
    decimal: str = ".",
    encoding: str = "utf-8",
) -> bytes:
    """Return a text table; a matrix under one name is written as name0, name1, … where it has "#": its number."""
    names: list[str] = []
    texts: list[list[str]] = []
    for name, values in columns.items():
        if isinstance(values, np.ndarray):
            block = values if values.ndim == 2 else values[:, None]
            start = 1 if "#1" in name else 0
            names += [
                name.replace("#1", "#").replace("#", str(j + start)) for j in range(block.shape[1])
            ]
            texts += [list(column) for column in zip(*cells(block), strict=True)]
        else:
            names.append(name)
            texts.append(list(values))
    rows = [[cell.replace(".", decimal) for cell in row] for row in zip(*texts, strict=True)]
    lines = [delimiter.join(names)] * header + [delimiter.join(row) for row in rows]
    return ("\n".join(lines) + "\n").encode(encoding)


def by_joint(
    names: Sequence[str], pattern: str, values: Array, order: Sequence[int]
) -> dict[str, Array]:
    """Return one column a joint, called by `pattern` with {} for its name, in the given order."""
    return {pattern.format(names[j]): values[:, j] for j in order}


LAYOUTS: dict[str, Callable[[], Layout]] = {}


def layout(function: Callable[[], Layout]) -> Callable[[], Layout]:
    """Register a layout under its name."""
    LAYOUTS[function.__name__.removeprefix("layout_")] = function
    return function


ALPHABETICAL = sorted(range(6), key=lambda j: UR[j])
ARM = {"arm.urdf": urdf(UR)}


def _tau_unit(unit: str = "N m") -> dict[str, Any]:
    return {"signals.tau.unit": unit}


@layout
def layout_ur_rtde() -> Layout:
    """RTDE_Python_Client_Library record.py: blanks between, target and actual of everything."""
    m = motion(6, 0.008)
    columns: Columns = {
        "timestamp": 3211.5 + m.t,
        "target_q_#": m.q + 1e-3,
        "target_qd_#": m.dq,
        "target_current_#": m.tau / 11.0 + 0.2,
        "target_moment_#": m.tau - 2.0,
        "actual_q_#": m.q,
        "actual_qd_#": m.dq,
        "actual_current_#": m.tau / 10.0,
        "joint_control_output_#": m.tau / 10.0 + 0.1,
        "actual_TCP_pose_#": m.q[:, :6] * 0.2,
        "joint_temperatures_#": 30.0 + 0.01 * m.q,
        "robot_mode": np.full(SAMPLES, 7.0),
    }
    return Layout(
        ARM | {"run.csv": table(columns, " ")},
        m.t,
        m.q,
        m.tau,
        {"drive.torque_constant": 10.0, "signals.tau.unit": "A"},
    )


@layout
def layout_ur_currents_only() -> Layout:
    """A UR log of positions and currents, without a robot in the folder."""
    m = motion(6, 0.008)
    data = table({"timestamp": 3211.5 + m.t, "actual_q_#": m.q, "actual_current_#": m.tau / 10.0})
    return Layout(
        {"run.csv": data, "robot/arm.urdf": urdf(UR)},
        m.t,
        m.q,
        m.tau,
        {
            "drive.torque_constant": 10.0,
            "signals.tau.unit": "A",
            "robot.use": "robot/arm.urdf",
        },
    )


@layout
def layout_panda_py() -> Layout:
    """panda_py's log through pandas: an index column without a name, stamps in ms."""
    m = motion(7, 0.001, samples=2000)
    columns: Columns = {
        "": np.arange(len(m.t)),
        "time": 88000.0 + np.round(m.t * 1e3),
        "q_#": m.q,
        "dq_#": m.dq,
        "tau_#": m.tau,
    }
    return Layout({"panda.urdf": urdf(PANDA), "run.csv": table(columns)}, m.t, m.q, m.tau)


@layout
def layout_panda_with_fingers() -> Layout:
    """Joint states of an arm and its gripper beside a URDF with both."""
    m = motion(7, 0.01)
    names = [*PANDA, "panda_finger_joint1", "panda_finger_joint2"]
    grip = np.full((SAMPLES, 2), 0.02)
    columns = by_joint(names, "{}_position", np.hstack([m.q, grip]), range(9)) | by_joint(
        names, "{}_effort", np.hstack([m.tau, grip]), range(9)
    )
    answers = {
        "robot.tip_link": "link_7",
        "signals.q.columns": [f"{name}_position" for name in PANDA],
        "signals.q.unit": "rad",
        "signals.tau.columns": [f"{name}_effort" for name in PANDA],
    }
    return Layout(
        {"panda.urdf": urdf(PANDA, fingers=True), "run.csv": table({"t": m.t, **columns})},
        m.t,
        m.q,
        m.tau,
        answers,
    )


@layout
def layout_kuka_rsi() -> Layout:
    """KUKA RSI: degrees, IPOC as the clock, Cartesian beside axis positions, motor currents in A."""
    m = motion(6, 0.004)
    deg = np.rad2deg(m.q)
    columns: Columns = {"IPOC": 4208163.0 + np.round(m.t * 1e3)}
    columns |= {f"RIst.{c}": 500.0 + 10.0 * m.q[:, k] for k, c in enumerate("XYZABC")}
    columns |= {f"AIPos.A{j + 1}": deg[:, j] for j in range(6)} | {
        f"ASPos.A{j + 1}": deg[:, j] + 0.01 for j in range(6)
    }
    columns |= {f"MACur.A{j + 1}": m.tau[:, j] / 20.0 for j in range(6)}
    answers = {
        "time.rate": 1000.0,
        "time.unit": "ms",
        "drive.torque_constant": 20.0,
        "signals.tau.unit": "A",
    }
    names = tuple(f"joint_a{j}" for j in range(1, 7))
    return Layout(
        {"kr.urdf": urdf(names), "run.csv": table(columns, ";")}, m.t, m.q, m.tau, answers
    )


@layout
def layout_matlab_writematrix() -> Layout:
    """writematrix([t q dq tau]): no header."""
    m = motion(6, 0.002)
    data = table({"a": m.t, "q#": m.q, "d#": m.dq, "t#": m.tau}, header=False)
    return Layout(ARM | {"run.txt": data}, m.t, m.q, m.tau, _tau_unit(), "run.txt")


@layout
def layout_matlab_struct() -> Layout:
    """A MAT file with a structure of N x 6 arrays."""
    from scipy.io import savemat

    m = motion(6, 0.002)
    file = io.BytesIO()
    savemat(
        file, {"data": {"t": m.t[:, None], "q": m.q, "qd": m.dq, "tau": m.tau, "q_ref": m.q + 1e-3}}
    )
    return Layout(ARM | {"run.mat": file.getvalue()}, m.t, m.q, m.tau, recording="run.mat")


@layout
def layout_json_frames() -> Layout:
    """A data set of robot learning: a list of frames with observation.state and action."""
    m = motion(6, 1 / 30)
    frames = [
        {
            "timestamp": float(t),
            "frame_index": k,
            "observation.state": q.tolist(),
            "observation.effort": tau.tolist(),
            "action": (q + 0.01).tolist(),
        }
        for k, (t, q, tau) in enumerate(zip(m.t, m.q, m.tau, strict=True))
    ]
    return Layout(
        ARM | {"run.json": json.dumps(frames).encode()}, m.t, m.q, m.tau, recording="run.json"
    )


@layout
def layout_json_arrays() -> Layout:
    """Arrays by name under a key."""
    m = motion(6, 0.01)
    body = {
        "meta": {"robot": "ur5"},
        "data": {
            "time": m.t.tolist(),
            "q": m.q.tolist(),
            "dq": m.dq.tolist(),
            "tau": m.tau.tolist(),
        },
    }
    return Layout(
        ARM | {"run.json": json.dumps(body).encode()}, m.t, m.q, m.tau, recording="run.json"
    )


@layout
def layout_json_lines_by_name() -> Layout:
    """One object a line, joints by name."""
    m = motion(6, 0.01)
    lines = [
        json.dumps(
            {
                "stamp": {"sec": 1_700_000_000 + int(t), "nanosec": round((t % 1.0) * 1e9)},
                "joints": {
                    UR[j]: {"pos": m.q[k, j], "vel": m.dq[k, j], "eff": m.tau[k, j]}
                    for j in ALPHABETICAL
                },
            }
        )
        for k, t in enumerate(m.t.tolist())
    ]
    return Layout(
        ARM | {"run.jsonl": ("\n".join(lines) + "\n").encode()},
        m.t,
        m.q,
        m.tau,
        recording="run.jsonl",
    )


@layout
def layout_r_write_table() -> Layout:
    """R's write.table: the rows' numbers have no name."""
    m = motion(3, 0.01)
    rows = (
        table({"x": 1.0 + np.arange(SAMPLES), "t": m.t, "q#1": m.q, "tau#1": m.tau}, " ")
        .decode()
        .split("\n")
    )
    rows[0] = " ".join(f'"{name}"' for name in rows[0].split()[1:])
    return Layout(
        {"run.txt": "\n".join(rows).encode()},
        m.t,
        m.q,
        m.tau,
        {"robot.use": "rrr"} | _tau_unit(),
        "run.txt",
    )


@layout
def layout_savetxt_header() -> Layout:
    """numpy.savetxt with header="t, q1, …": commas in a comment above blanks."""
    m = motion(6, 0.01)
    body = table({"t": m.t, "q#1": m.q, "dq#1": m.dq, "tau#1": m.tau}, " ").decode().split("\n")
    body[0] = "# " + body[0].replace(" ", ", ")
    return Layout(ARM | {"run.txt": "\n".join(body).encode()}, m.t, m.q, m.tau, recording="run.txt")


@layout
def layout_percent_header_units() -> Layout:
    """Names and units in two comments."""
    m = motion(6, 0.01)
    body = table({"t": m.t, "q#1": np.rad2deg(m.q), "M#1": m.tau}, " ").decode().split("\n")
    body[0] = (
        "% recorded on Monday by hand\n% "
        + body[0]
        + "\n% "
        + " ".join(["s", *["deg"] * 6, *["Nm"] * 6])
    )
    return Layout(ARM | {"run.txt": "\n".join(body).encode()}, m.t, m.q, m.tau, recording="run.txt")


@layout
def layout_transposed_named() -> Layout:
    """One line a signal, its name before the numbers."""
    m = motion(6, 0.01)
    names = ["t", *(f"q{j}" for j in range(1, 7)), *(f"tau{j}" for j in range(1, 7))]
    rows = np.column_stack([m.t, m.q, m.tau]).T
    lines = [",".join([name, *row]) for name, row in zip(names, cells(rows), strict=True)]
    return Layout(ARM | {"run.csv": ("\n".join(lines) + "\n").encode()}, m.t, m.q, m.tau)


@layout
def layout_transposed_bare() -> Layout:
    """writematrix of 19 x N."""
    m = motion(6, 0.01)
    lines = [",".join(row) for row in cells(np.column_stack([m.t, m.q, m.dq, m.tau]).T)]
    return Layout(
        ARM | {"run.csv": ("\n".join(lines) + "\n").encode()}, m.t, m.q, m.tau, _tau_unit()
    )


@layout
def layout_headerless_without_velocity() -> Layout:
    """t, q, tau without names: only a person knows which block is which."""
    m = motion(6, 0.01)
    data = table({"t": m.t, "q#": m.q, "u#": m.tau}, header=False)
    answers = {
        "signals.q.columns": [f"column_{j}" for j in range(2, 8)],
        "signals.q.unit": "rad",
        "signals.tau.columns": [f"column_{j}" for j in range(8, 14)],
    }
    return Layout(ARM | {"run.csv": data}, m.t, m.q, m.tau, answers)


@layout
def layout_headerless_interleaved() -> Layout:
    """q1 dq1 tau1 q2 dq2 tau2 …, no clock, no robot."""
    m = motion(3, 0.002)
    data = table(
        {"x#": np.stack([m.q, m.dq, m.tau], axis=2).reshape(SAMPLES, 9)}, " ", header=False
    )
    return Layout(
        {"run.txt": data},
        m.t,
        m.q,
        m.tau,
        {"robot.use": "rrr", "time.rate": 500.0} | _tau_unit(),
        "run.txt",
    )


@layout
def layout_headerless_two_references() -> Layout:
    """q, q_ref, dq, tau without names: measured and reference look alike."""
    m = motion(6, 0.01)
    data = table({"t": m.t, "r#": m.q + 1e-3, "q#": m.q, "d#": m.dq, "u#": m.tau}, header=False)
    answers = {
        "signals.q.columns": [f"column_{j}" for j in range(8, 14)],
        "signals.q.unit": "rad",
        "signals.tau.columns": [f"column_{j}" for j in range(20, 26)],
    }
    return Layout(ARM | {"run.csv": data}, m.t, m.q, m.tau, answers)


@layout
def layout_time_sec_nsec() -> Layout:
    """time_sec and time_nsec, torques called effort, references beside."""
    m = motion(6, 0.01)
    columns: Columns = {
        "time_sec": 100.0 + np.floor(m.t),
        "time_nsec": np.round((m.t % 1.0) * 1e9),
        "pos_des_#1": m.q + 1e-3,
        "pos_#1": m.q,
        "vel_#1": m.dq,
        "eff_#1": m.tau,
        "eff_des_#1": m.tau - 1.0,
    }
    return Layout(ARM | {"run.csv": table(columns)}, m.t, m.q, m.tau)


@layout
def layout_microseconds() -> Layout:
    """A microcontroller: micros() as "us", currents in mA, a status text."""
    m = motion(3, 0.002)
    columns: Columns = {
        "us": 5e6 + np.round(m.t * 1e6),
        "state": ["RUN"] * SAMPLES,
        "pos_rad_#1": m.q,
        "current_mA_#1": m.tau * 50.0,
    }
    return Layout(
        {"run.csv": table(columns)},
        m.t,
        m.q,
        m.tau,
        {"robot.use": "rrr", "drive.torque_constant": 20.0},
    )


@layout
def layout_sample_index() -> Layout:
    """A counter instead of a clock."""
    m = motion(6, 0.002)
    columns: Columns = {"sample": np.arange(SAMPLES), "q#1": m.q, "tau#1": m.tau}
    return Layout(ARM | {"run.csv": table(columns)}, m.t, m.q, m.tau, {"time.rate": 500.0})


@layout
def layout_time_that_counts() -> Layout:
    """A column t that counts 0, 1, 2 at 500 Hz: ms and samples look alike."""
    m = motion(6, 0.002)
    return Layout(
        ARM | {"run.csv": table({"t": np.arange(SAMPLES), "q#1": m.q, "tau#1": m.tau})},
        m.t,
        m.q,
        m.tau,
        {"time.unit": "sample", "time.rate": 500.0},
    )


@layout
def layout_clock_times() -> Layout:
    """Date and time as text, over midnight."""
    m = motion(6, 0.01)
    ticks = np.round((86396.0 + m.t) * 1e3).astype(int)
    stamps = [
        f"2024-05-{17 + x // 86_400_000} {x // 3_600_000 % 24:02d}:{x // 60_000 % 60:02d}:{x // 1000 % 60:02d}.{x % 1000:03d}"
        for x in ticks.tolist()
    ]
    return Layout(
        ARM | {"run.csv": table({"timestamp": stamps, "q#1": m.q, "tau#1": m.tau})}, m.t, m.q, m.tau
    )


@layout
def layout_names_in_front() -> Layout:
    """pos_elbow, pos_shoulder_lift, …: the robot's names without "joint", in another order."""
    m = motion(6, 0.01)
    short = [name.removesuffix("_joint") for name in UR]
    columns = by_joint(short, "pos_{}", m.q, ALPHABETICAL) | by_joint(
        short, "torque_{}", m.tau, ALPHABETICAL
    )
    return Layout(ARM | {"run.csv": table({"time_s": m.t, **columns})}, m.t, m.q, m.tau)


@layout
def layout_names_without_robot() -> Layout:
    """The same names with no robot beside: the order is a person's to know."""
    m = motion(6, 0.01)
    columns = by_joint(UR, "{}.pos", m.q, ALPHABETICAL) | by_joint(
        UR, "{}.torque", m.tau, ALPHABETICAL
    )
    answers = {
        "robot.use": "robot/arm.urdf",
        "signals.q.columns": [f"{name}.pos" for name in UR],
        "signals.q.unit": "rad",
        "signals.tau.columns": [f"{name}.torque" for name in UR],
    }
    return Layout(
        {"robot/arm.urdf": urdf(UR), "run.csv": table({"t": m.t, **columns})},
        m.t,
        m.q,
        m.tau,
        answers,
    )


@layout
def layout_lift_and_arm() -> Layout:
    """An arm on a lift: the first joint slides, its columns in mm and N."""
    m = motion(4, 0.01, slides=(0,))
    names = ("lift_joint", "joint_1", "joint_2", "joint_3")
    q = m.q * np.array([1e3, 1.0, 1.0, 1.0])
    columns: Columns = (
        {"t [s]": m.t, "lift_joint_pos [mm]": q[:, 0]}
        | {f"joint_{j}_pos [rad]": q[:, j] for j in (1, 2, 3)}
        | {"lift_joint_force [N]": m.tau[:, 0]}
        | {f"joint_{j}_torque [Nm]": m.tau[:, j] for j in (1, 2, 3)}
    )
    answers = {
        "signals.tau.columns": ["lift_joint_force", *(f"joint_{j}_torque" for j in (1, 2, 3))],
        "signals.tau.unit": ["N", "N m", "N m", "N m"],
    }
    return Layout(
        {"lift.urdf": urdf(names, slides=(0,)), "run.csv": table(columns)}, m.t, m.q, m.tau, answers
    )


@layout
def layout_two_robots_beside() -> Layout:
    """Two URDFs in the folder: which one is a person's to say."""
    m = motion(6, 0.01)
    data = table({"t": m.t, "q#1": m.q, "tau#1": m.tau})
    return Layout(
        {"a.urdf": urdf(UR), "b.urdf": urdf(UR), "run.csv": data},
        m.t,
        m.q,
        m.tau,
        {"robot.use": "a.urdf"} | _tau_unit(),
    )


@layout
def layout_two_files() -> Layout:
    """Positions in one file, torques in another, joints as columns."""
    m = motion(6, 0.002)
    return Layout(
        ARM
        | {
            "joint_positions.csv": table({"joint_#1": m.q}),
            "joint_torques.csv": table({"joint_#1": m.tau}),
        },
        m.t,
        m.q,
        m.tau,
        {"time.rate": 500.0} | _tau_unit(),
        "joint_positions.csv",
    )


@layout
def layout_command_only() -> Layout:
    """Only the commanded torque was recorded."""
    m = motion(6, 0.002)
    columns: Columns = {
        "time": m.t,
        "joint_positions_#": m.q,
        "joint_velocities_#": m.dq,
        "commanded_torques_#": m.tau,
    }
    return Layout(ARM | {"run.csv": table(columns)}, m.t, m.q, m.tau)


@layout
def layout_trailing_comma() -> Layout:
    """Rows end in a comma that the header lacks; joints count past 9 as texts would sort."""
    m = motion(11, 0.002)
    rows = table({"t": m.t, "q#1": m.q, "tau#1": m.tau}).decode().split("\n")
    rows[1:] = [row + "," for row in rows[1:] if row]
    names = tuple(f"joint_{j}" for j in range(1, 12))
    return Layout(
        {"arm.urdf": urdf(names), "run.csv": ("\n".join(rows) + "\n").encode()}, m.t, m.q, m.tau
    )


def filled(draft: str, answers: Mapping[str, Any]) -> dict[str, Any]:
    """Return the recipe with every blank replaced by the answer for its place."""
    recipe = tomllib.loads(draft)
    for section, body in recipe.items():
        for key, value in body.items() if isinstance(body, dict) else ():
            if isinstance(value, dict):
                for inner, item in list(value.items()):
                    if BLANK in str(item):
                        value[inner] = answers[
                            f"{section}.{key}.{inner.replace('columns', 'column')}".replace(
                                "column", "columns"
                            )
                        ]
                        if f"{section}.{key}.scale" in answers:
                            value["scale"] = answers[f"{section}.{key}.scale"]
            elif BLANK in str(value):
                body[key] = answers[f"{section}.{key}"]
    if recipe["signals"]["tau"].get("unit") in ("A", "mA") and "drive.torque_constant" in answers:
        recipe.setdefault("drive", {})["torque_constant"] = answers["drive.torque_constant"]
    if recipe["time"].get("unit") == "sample":
        recipe["time"]["rate"] = answers["time.rate"]
    return recipe


def verdict(made: Layout, folder: Path) -> Verdict:
    """Draft, fill in, import, compare."""
    out, folder = folder / "out", folder / "data"
    for name, content in made.files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    try:
        draft = guess_recipe(folder / made.recording)
    except RrridError as problem:
        return Verdict("asks", f"refused: {problem}")
    try:
        recipe = filled(draft.text, {"signals.tau.unit": "N m", **made.answers})
    except KeyError as place:
        return Verdict("failed", f"asks for {place}, which has no answer")
    path = folder / "recipe.toml"
    path.write_text(tomli_w.dumps(recipe), encoding="utf-8")
    try:
        outcome = run_stage(
            STAGE, Request((), out, no_report=True), Settings(recipe=str(path), source=folder)
        )
    except RrridError as problem:
        return Verdict("failed", str(problem))
    log = open_log(next((outcome.folder / "logs").glob("*.h5"))).log
    differs = [
        name
        for name, true, found in (
            ("t", made.t - made.t[0], log.t - log.t[0]),
            ("q", made.q, log.q),
            ("tau", made.tau, log.tau),
        )
        if true.shape != found.shape or not np.allclose(true, found, rtol=1e-6, atol=1e-6)
    ]
    if differs:
        return Verdict("wrong", f"{', '.join(differs)} differ; blanks {draft.blanks}")
    return Verdict("asks", ", ".join(draft.blanks)) if draft.blanks else Verdict("right", "")


def main(names: Sequence[str]) -> int:
    """Print the verdict of every layout."""
    counts: dict[str, int] = {}
    for name in names or LAYOUTS:
        with tempfile.TemporaryDirectory() as folder:
            found = verdict(LAYOUTS[name](), Path(folder))
        counts[found.outcome] = counts.get(found.outcome, 0) + 1
        sys.stdout.write(f"{name:32} {found.outcome:7} {found.why[:300]}\n")
    sys.stdout.write(
        ", ".join(f"{key} {value}" for key, value in sorted(counts.items()))
        + f" of {sum(counts.values())}\n"
    )
    return int(bool(counts.get("wrong") or counts.get("failed")))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
