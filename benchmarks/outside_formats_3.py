"""Write one simulated motion as ten exports of other kinds do, made after the first thirty ran."""

from pathlib import Path

import h5py
import numpy as np
import pandas as pd

from benchmarks.outside_formats import (
    DEG,
    DEGS,
    IIWA,
    NM,
    PANDA,
    RAD,
    RADS,
    SIX,
    THREE,
    UR,
    block,
    csv,
    names,
)
from benchmarks.outside_layouts import Answer, Run, Signal, layout


@layout(SIX, robot=None, rate=500.0)
def abb_test_signals(folder: Path, run: Run) -> Answer:
    """ABB Test Signal Viewer: signals by number (1718 position, 1717 speed, 4947 torque), motor
    side.

    No name says a quantity, and no unit is given: an arm's angle in rad these numbers are not.
    """
    gear = np.array([100.0, -120.0, 110.0, 80.0, 90.0, 60.0])
    table: dict[str, np.ndarray] = {"Time": run.t}
    for signal, v in (("1718", run.q * gear), ("1717", run.dq * gear), ("4947", run.tau / gear)):
        table |= block(f"{signal} ROB_1 axis {{}}", v)
    csv(folder / "signals.log", table, sep=";")
    right = {
        "q": (Signal(names("1718 ROB_1 axis {}", 6)),),
        "dq": (Signal(names("1717 ROB_1 axis {}", 6)),),
        "tau": (Signal(names("4947 ROB_1 axis {}", 6)),),
    }
    return Answer("signals.log", {"Time": "s"}, right=right, draftable=False)


@layout(SIX, rate=100.0)
def xarm_report(folder: Path, run: Run) -> Answer:
    """xArm SDK report saved by a script: angles in deg without a unit, currents, no torque,
    state."""
    table: dict[str, object] = {"stamp": 1.7e9 + run.t, "state": 1, "mode": 0, "cmdnum": 3}
    table |= block("angle_j{}", np.degrees(run.q)) | block("speed_j{}", np.degrees(run.dq))
    table |= block("current_j{}", run.current) | block("voltage_j{}", 24 + 0 * run.q)
    table |= block("temp_j{}", run.temperature) | {"err": "OK"}
    csv(folder / "report.csv", table)
    right = {
        "q": (Signal(names("angle_j{}", 6), DEG),),
        "dq": (Signal(names("speed_j{}", 6), DEGS),),
    }
    right["tau"] = right["current"] = (Signal(names("current_j{}", 6), ("A",)),)
    return Answer("report.csv", {"stamp": "s"}, right=right)


@layout(THREE, robot="robot.toml")
def matlab_timetable(folder: Path, run: Run) -> Answer:
    """MATLAB writetimetable: the time is a duration, written as text "0.005 sec"."""
    table = {"Time": [f"{t:g} sec" for t in run.t]}
    table |= block("q{}", run.q) | block("qd{}", run.dq) | block("tau{}", run.tau)
    csv(folder / "timetable.csv", table)
    right = {
        "q": (Signal(names("q{}", 3), RAD),),
        "dq": (Signal(names("qd{}", 3), RADS),),
        "tau": (Signal(names("tau{}", 3), NM),),
    }
    return Answer("timetable.csv", {"Time": "s"}, rate=200.0, right=right)


@layout(THREE, robot="robot.toml")
def excel_quoted(folder: Path, run: Run) -> Answer:
    """Excel-minded logger: a line "sep=;", every number in quotes with a decimal comma, German
    names."""
    table = {"Zeit [s]": run.t} | block("Istwinkel {} [°]", np.degrees(run.q))
    table |= block("Sollwinkel {} [°]", np.degrees(run.q_ref)) | block(
        "Drehmoment {} [Nm]", run.tau
    )
    csv(folder / "messung.csv", table, head="sep=;\r\n", sep=";", decimal=",", quoting=1)
    right = {
        "q": (Signal(names("Istwinkel {} [°]", 3), DEG),),
        "q_ref": (Signal(names("Sollwinkel {} [°]", 3), DEG),),
        "tau": (Signal(names("Drehmoment {} [Nm]", 3), NM),),
    }
    return Answer("messung.csv", {"Zeit [s]": "s"}, right=right)


@layout(UR)
def one_file_an_axis(folder: Path, run: Run) -> Answer:
    """A folder with a file for each of six axes: axis1.csv holds one joint of the six-joint
    robot."""
    for j in range(6):
        table = {"time": run.t, "pos": run.q[:, j], "vel": run.dq[:, j], "torque": run.tau[:, j]}
        csv(folder / f"axis{j + 1}.csv", table)
    return Answer("axis1.csv", {"time": "s"}, draftable=False)


@layout(THREE, robot="arm.urdf", rate=240.0)
def pybullet_states(folder: Path, run: Run) -> Answer:
    """PyBullet getJointState per step: position, velocity, six reaction forces, applied torque."""
    table: dict[str, object] = {"step": np.arange(len(run.t))}
    for j in range(3):
        table |= {f"joint{j}_position": run.q[:, j], f"joint{j}_velocity": run.dq[:, j]}
        for k, axis in enumerate(("Fx", "Fy", "Fz", "Mx", "My", "Mz")):
            table[f"joint{j}_reaction_{axis}"] = run.tau_model[:, j] * np.cos(k) + k
        table[f"joint{j}_appliedJointMotorTorque"] = run.tau[:, j]
    csv(folder / "states.csv", table)
    right = {
        "q": (Signal(names("joint{}_position", 3, 0), RAD),),
        "dq": (Signal(names("joint{}_velocity", 3, 0), RADS),),
        "tau": (Signal(names("joint{}_appliedJointMotorTorque", 3, 0), NM),),
    }
    return Answer("states.csv", {"step": "sample"}, rate=240.0, right=right)


@layout(IIWA)
def reversed_joints(folder: Path, run: Run) -> Answer:
    """A C++ logger that writes from the flange to the base: a7 … a1, time in us since power-on."""
    table: dict[str, object] = {"t_us": np.round(run.t * 1e6).astype(np.int64) + 9_000_000}
    for j in reversed(range(7)):
        table |= {f"a{j + 1}_pos_msr": run.q[:, j], f"a{j + 1}_pos_cmd": run.q_ref[:, j]}
        table |= {f"a{j + 1}_trq_msr": run.tau[:, j], f"a{j + 1}_trq_ext": run.tau_ext[:, j]}
    csv(folder / "log.txt", table, sep="\t")
    right = {
        "q": (Signal(names("a{}_pos_msr", 7), RAD),),
        "q_ref": (Signal(names("a{}_pos_cmd", 7), RAD),),
        "tau": (Signal(names("a{}_trq_msr", 7), NM),),
    }
    return Answer("log.txt", {"t_us": "us"}, right=right, torque=("measured",))


@layout(THREE, robot=None, rate=500.0)
def canopen_objects(folder: Path, run: Run) -> Answer:
    """CiA 402 objects off the bus: 6064h increments, 606Ch increments/s, 6077h per mille of
    rated torque."""
    counts = 2**20 / (2 * np.pi)
    table: dict[str, object] = {"timestamp_ns": np.round(run.t * 1e9).astype(np.int64)}
    for j in range(3):
        table |= {
            f"Axis{j + 1}_0x607A": np.round(run.q_ref[:, j] * counts).astype(int),
            f"Axis{j + 1}_0x6064": np.round(run.q[:, j] * counts).astype(int),
            f"Axis{j + 1}_0x606C": np.round(run.dq[:, j] * counts).astype(int),
            f"Axis{j + 1}_0x6077": np.round(run.tau[:, j] / run.arm.effort[j] * 1000).astype(int),
            f"Axis{j + 1}_0x6041": 0x1237,
        }
    csv(folder / "bus.csv", table)
    right = {
        "q": (Signal(names("Axis{}_0x6064", 3), ("counts",)),),
        "q_ref": (Signal(names("Axis{}_0x607A", 3), ("counts",)),),
        "dq": (Signal(names("Axis{}_0x606C", 3), ("counts/s",)),),
        "tau": (Signal(names("Axis{}_0x6077", 3)),),
    }
    return Answer("bus.csv", {"timestamp_ns": "ns"}, right=right, draftable=False)


@layout(PANDA, rate=20.0)
def robomimic_hdf5(folder: Path, run: Run) -> Answer:
    """robomimic demonstrations in HDF5: data/demo_0/obs/robot0_joint_pos, actions of the tip, no
    clock."""
    with h5py.File(folder / "demo.hdf5", "w") as file:
        obs = file.create_group("data/demo_0/obs")
        obs["robot0_joint_pos"], obs["robot0_joint_vel"] = run.q, run.dq
        obs["robot0_eef_pos"] = run.pose[:, :3]
        obs["robot0_gripper_qpos"] = np.full((len(run.t), 2), 0.02)
        file["data/demo_0/actions"] = np.tanh(run.pose[:, [0, 1, 2, 3, 4, 5, 0]])
        file["data/demo_0/rewards"] = np.zeros(len(run.t))
    right = {"q": (Signal((), RAD),), "dq": (Signal((), RADS),)}
    return Answer("demo.hdf5", rate=20.0, right=right, texts=False)


@layout(UR, rate=100.0)
def long_table_with_holes(folder: Path, run: Run) -> Answer:
    """A database query result: one row a joint, some rows lost, ISO stamps; no two joints in one
    row."""
    n, order = run.n, [5, 3, 4, 0, 1, 2]
    stamp = pd.to_datetime(1.71e18 + np.round(np.repeat(run.t, n) * 1e9, -3))
    table = pd.DataFrame(
        {
            "ts": stamp.strftime("%Y-%m-%dT%H:%M:%S.%fZ"),
            "joint_name": [run.arm.joints[j] for j in order] * len(run.t),
            "position_rad": run.q[:, order].ravel(),
            "effort_nm": run.tau[:, order].ravel(),
        }
    )
    lost = np.random.default_rng(3).choice(len(table), 60, replace=False)
    table.drop(index=lost).to_csv(folder / "query.csv", index=False, float_format="%.6f")
    return Answer("query.csv", {"ts": "*"}, texts=False, draftable=False)
