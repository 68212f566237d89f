"""Write one simulated motion as twenty exports of other kinds do: ten made after the first thirty
ran, ten (from dymola_result on) after these were mended."""

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
from benchmarks.outside_layouts import Answer, Arm, Run, Signal, layout

SO100 = Arm(
    "so100",
    ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"),
    "zyyyx",
    (60, 60, 40, 20, 10),
)


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


@layout(THREE, robot="robot.toml")
def dymola_result(folder: Path, run: Run) -> Answer:
    """Modelica result as CSV: quoted paths, phi, w, a and tau of each flange
    (Modelica.Mechanics.Rotational)."""
    table: dict[str, np.ndarray] = {"time": run.t}
    for j in range(3):
        flange = f"robot.axis{j + 1}"
        table |= {f"{flange}.phi": run.q[:, j], f"{flange}.w": run.dq[:, j]}
        table |= {f"{flange}.a": run.ddq[:, j], f"{flange}.flange_a.tau": run.tau[:, j]}
    csv(folder / "result.csv", table, head="", quoting=2)
    right = {
        "q": (Signal(names("robot.axis{}.phi", 3), RAD),),
        "dq": (Signal(names("robot.axis{}.w", 3), RADS),),
        "ddq": (Signal(names("robot.axis{}.a", 3), ("rad/s^2",)),),
        "tau": (Signal(names("robot.axis{}.flange_a.tau", 3), NM),),
    }
    return Answer("result.csv", {"time": "s"}, right=right)


@layout(THREE, robot="robot.toml", rate=500.0)
def controldesk_csv(folder: Path, run: Run) -> Answer:
    """dSPACE ControlDesk CSV: a key in the first column (path, unit, trace_values), semicolons."""
    paths = ["Model Root/Time"] + [
        f"Model Root/Plant/{s}[{j}]" for s in ("q_rad", "qd_rad_s", "tau_Nm") for j in range(3)
    ]
    units = ["s", *["rad"] * 3, *["rad/s"] * 3, *["Nm"] * 3]
    head = "name;Recorder 1\ntimestamp;2024-02-07T10:11:12\n"
    head += ";".join(["path", *paths]) + "\n" + ";".join(["unit", *units]) + "\n"
    body = np.column_stack([run.t, run.q, run.dq, run.tau])
    rows = [";".join(["trace_values", *(f"{x:.6f}" for x in row)]) for row in body]
    (folder / "rec.csv").write_text(head + "\n".join(rows) + "\n")
    right = {
        "q": (Signal(names("Model Root/Plant/q_rad[{}]", 3, 0), RAD),),
        "dq": (Signal(names("Model Root/Plant/qd_rad_s[{}]", 3, 0), RADS),),
        "tau": (Signal(names("Model Root/Plant/tau_Nm[{}]", 3, 0), NM),),
    }
    return Answer("rec.csv", {"Model Root/Time": "s"}, right=right)


@layout(SIX, robot=None, rate=250.0)
def sinamics_trace(folder: Path, run: Run) -> Answer:
    """Siemens drive trace: parameters by number (r482 encoder, r61 speed, r80 torque) a drive,
    motor side."""
    gear = np.array([121.0, 121.0, 101.0, 80.0, 80.0, 51.0])
    table: dict[str, np.ndarray] = {"Time [ms]": run.t * 1000}
    for j in range(6):
        drive = f"Drive_{j + 1}"
        table[f"{drive}.r482[0] Actual encoder value"] = np.round(run.q[:, j] * gear[j] * 1e4)
        table[f"{drive}.r61 Actual speed [rpm]"] = run.dq[:, j] * gear[j] * 30 / np.pi
        table[f"{drive}.r80 Actual torque [Nm]"] = run.tau[:, j] / gear[j]
    csv(folder / "trace.csv", table, sep=";")
    right = {
        "q": (Signal(names("Drive_{}.r482[0] Actual encoder value", 6), ("counts",)),),
        "dq": (Signal(names("Drive_{}.r61 Actual speed [rpm]", 6), ("rpm",)),),
        "tau": (Signal(names("Drive_{}.r80 Actual torque [Nm]", 6), NM),),
    }
    return Answer("trace.csv", {"Time [ms]": "ms"}, right=right, draftable=False)


@layout(UR, rate=125.0)
def webots_sensors(folder: Path, run: Run) -> Answer:
    """Webots controller log: NAME_sensor positions, torque feedback by motor name, gripper
    fingers."""
    table: dict[str, np.ndarray] = {"sim_time": run.t + 0.032}
    for j, joint in enumerate(run.arm.joints):
        table[f"{joint}_sensor"] = run.q[:, j]
        table[f"{joint}_torque_feedback"] = run.tau[:, j]
    for finger in ("finger_1_joint_1", "finger_2_joint_1"):
        table |= {f"{finger}_sensor": 0.05 + 0 * run.t, f"{finger}_torque_feedback": 0 * run.t}
    csv(folder / "webots.csv", table)
    right = {
        "q": (Signal(tuple(f"{j}_sensor" for j in run.arm.joints), RAD),),
        "tau": (Signal(tuple(f"{j}_torque_feedback" for j in run.arm.joints), NM),),
    }
    return Answer("webots.csv", {"sim_time": "s"}, right=right)


@layout(SIX, rate=100.0)
def coppelia_graph(folder: Path, run: Run) -> Answer:
    """CoppeliaSim graph export: "/m0609/joint_1: position (deg)", forces in N*m, time in s."""
    table: dict[str, np.ndarray] = {"Time (s)": run.t}
    for j, joint in enumerate(run.arm.joints):
        table[f"/m0609/{joint}: position (deg)"] = np.degrees(run.q[:, j])
        table[f"/m0609/{joint}: target position (deg)"] = np.degrees(run.q_ref[:, j])
        table[f"/m0609/{joint}: force (N*m)"] = run.tau[:, j]
    csv(folder / "graph.csv", table)
    right = {
        "q": (Signal(tuple(f"/m0609/{j}: position (deg)" for j in run.arm.joints), DEG),),
        "q_ref": (
            Signal(tuple(f"/m0609/{j}: target position (deg)" for j in run.arm.joints), DEG),
        ),
        "tau": (Signal(tuple(f"/m0609/{j}: force (N*m)" for j in run.arm.joints), NM),),
    }
    return Answer("graph.csv", {"Time (s)": "s"}, right=right)


@layout(SIX, rate=500.0)
def dot_by_letter_p(folder: Path, run: Run) -> Answer:
    """A German laboratory's notation: q, qp and qpp for the derivatives ("Punkt"), Q for the
    torque."""
    table: dict[str, np.ndarray] = {"t": run.t}
    for name, v in (("q", run.q), ("qp", run.dq), ("qpp", run.ddq), ("qsoll", run.q_ref)):
        table |= block(f"{name}{{}}", v)
    table |= block("tauM{}", run.tau) | block("tauExt{}", run.tau_ext)
    csv(folder / "versuch.dat", table, sep=" ", float_format="%.8e")
    right = {
        "q": (Signal(names("q{}", 6), RAD),),
        "dq": (Signal(names("qp{}", 6), RADS),),
        "ddq": (Signal(names("qpp{}", 6), ("rad/s^2",)),),
        "q_ref": (Signal(names("qsoll{}", 6), RAD),),
        "tau": (Signal(names("tauM{}", 6), NM),),
    }
    return Answer("versuch.dat", {"t": "s"}, right=right)


@layout(THREE, robot="robot.toml")
def adams_table(folder: Path, run: Run) -> Answer:
    """MSC Adams result table: a title, quoted names, fixed width, Fortran exponents, degrees, N
    mm."""
    head = ["Time", *names(".arm.JOINT_{}_ANGLE.Q", 3), *names(".arm.MOTION_{}.TORQUE.Q", 3)]
    values = np.column_stack([run.t, np.degrees(run.q), 1000 * run.tau])
    rows = ["".join(f"{x:18.8E}".replace("E", "D") for x in row) for row in values]
    text = "Last_Run   Results   2023-11-02\n" + "  ".join(f'"{n}"' for n in head)
    (folder / "adams.tab").write_text(text + "\n" + "\n".join(rows) + "\n")
    right = {
        "q": (Signal(names(".arm.JOINT_{}_ANGLE.Q", 3), DEG),),
        "tau": (Signal(names(".arm.MOTION_{}.TORQUE.Q", 3), ("N mm",)),),
    }
    return Answer("adams.tab", {"Time": "s"}, right=right)


@layout(SIX, rate=100.0)
def two_arms(folder: Path, run: Run) -> Answer:
    """Two arms of one type in a table, left/joint_1 … right/joint_6, beside the description of
    one."""
    left = np.roll(run.q, 200, axis=0), np.roll(run.dq, 200, axis=0), np.roll(run.tau, 200, axis=0)
    table: dict[str, np.ndarray] = {"time": 1.7e9 + run.t}
    for side, (q, dq, tau) in (("left", left), ("right", (run.q, run.dq, run.tau))):
        for j, joint in enumerate(run.arm.joints):
            table |= {f"{side}/{joint}/position": q[:, j], f"{side}/{joint}/velocity": dq[:, j]}
            table[f"{side}/{joint}/effort"] = tau[:, j]
    csv(folder / "bimanual.csv", table)
    return Answer("bimanual.csv", {"time": "s"}, draftable=False)


@layout(THREE, robot="robot.toml")
def greek_names(folder: Path, run: Run) -> Answer:
    """A notebook's data frame with Greek names: φ1 [°], φ̇1 [°/s], τ1 [N·m], written by pandas
    with its index."""
    table: dict[str, np.ndarray] = {"t [s]": run.t}
    table |= block("φ{} [°]", np.degrees(run.q)) | block("φ̇{} [°/s]", np.degrees(run.dq))
    table |= block("τ{} [N·m]", run.tau) | block("ϑ{} [°C]", run.temperature)
    pd.DataFrame(table).to_csv(folder / "greek.csv", float_format="%.6f")
    right = {
        "q": (Signal(names("φ{} [°]", 3), DEG),),
        "dq": (Signal(names("φ̇{} [°/s]", 3), DEGS),),
        "tau": (Signal(names("τ{} [N·m]", 3), NM),),
    }
    return Answer("greek.csv", {"t [s]": "s"}, right=right)


@layout(SO100, rate=30.0)
def so100_normalised(folder: Path, run: Run) -> Answer:
    """LeRobot SO-100 table: positions normalised to -100..100 of the calibrated range; no unit
    of angle."""
    reach = np.array([1.9, 1.7, 1.6, 1.8, 2.8])
    table: dict[str, object] = {"timestamp": run.t, "frame_index": np.arange(len(run.t))}
    table |= {
        f"observation.{j}.pos": 100 * run.q[:, k] / reach[k] for k, j in enumerate(run.arm.joints)
    }
    table["observation.gripper.pos"] = 42.0
    table |= {
        f"action.{j}.pos": 100 * run.q_ref[:, k] / reach[k] for k, j in enumerate(run.arm.joints)
    }
    csv(folder / "episode.csv", table)
    right = {
        "q": (Signal(tuple(f"observation.{j}.pos" for j in run.arm.joints)),),
        "q_ref": (Signal(tuple(f"action.{j}.pos" for j in run.arm.joints)),),
    }
    return Answer("episode.csv", {"timestamp": "s"}, right=right, draftable=False)
