"""Write one simulated motion as thirty real exports do, each with its right answer (see
outside_layouts)."""

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.io import savemat

from benchmarks.import_layouts import UR as UR_JOINTS
from benchmarks.outside_layouts import Answer, Arm, Run, Signal, layout

UR = Arm(
    "ur5",
    UR_JOINTS,
    "zyyyzy",
    (150, 150, 150, 28, 28, 28),
)
SIX = Arm("m0609", tuple(f"joint_{j}" for j in range(1, 7)), "zyyxyx", (194, 163, 163, 50, 50, 50))
PANDA = Arm(
    "panda",
    tuple(f"panda_joint{j}" for j in range(1, 8)),
    "zyzyzyz",
    (150,) * 4 + (30,) * 3,
    ("panda_finger_joint1", "panda_finger_joint2"),
)
IIWA = Arm(
    "iiwa7",
    tuple(f"lbr_iiwa_joint_{j}" for j in range(1, 8)),
    "zyzyzyz",
    (176,) * 3 + (110,) * 2 + (40,) * 2,
)
GEN3 = Arm(
    "gen3",
    tuple(f"joint_{j}" for j in range(1, 8)),
    "zyzyzyz",
    (150,) * 4 + (30,) * 3,
    continuous=True,
)
LEFT = Arm(
    "baxter_left",
    tuple(f"left_{j}" for j in ("s0", "s1", "e0", "e1", "w0", "w1", "w2")),
    "zyxyxyx",
    (150,) * 4 + (30,) * 3,
)
THREE = Arm("rrr", ("waist", "shoulder", "elbow"), "zyy", (120, 120, 40))
TWO = Arm("double-pendulum", ("q1", "q2"), "yy", (60, 20))
FOUR = Arm("open_manipulator", ("joint1", "joint2", "joint3", "joint4"), "zyyy", (80, 80, 40, 20))
SCARA = Arm("scara", ("J1", "J2", "J3", "J4"), "zzZz", (90, 60, 200, 20))

DEG = ("deg", "degree", "degrees", "°")
RAD, RADS, NM = ("rad",), ("rad/s",), ("N m", "Nm", "N*m")
DEGS, TURNS = ("deg/s", "°/s"), ("rev", "turn", "turns", "revolutions")


def block(pattern: str, values: np.ndarray, start: int = 1) -> dict[str, np.ndarray]:
    """Return columns named after a pattern with {}, one a joint."""
    return {pattern.format(start + j): column for j, column in enumerate(values.T)}


def names(pattern: str, n: int, start: int = 1) -> tuple[str, ...]:
    return tuple(pattern.format(start + j) for j in range(n))


def csv(path: Path, columns: dict[str, object], head: str = "", **how: object) -> None:
    """Write a table, below `head` as it stands."""
    encoding = str(how.pop("encoding", "utf-8"))
    how = {"index": False, "float_format": "%.6f", **how}
    path.write_bytes((head + pd.DataFrame(columns).to_csv(**how)).encode(encoding))


@layout(UR)
def rostopic_echo(folder: Path, run: Run) -> Answer:
    """ROS 1 `rostopic echo -p /joint_states`: %time in ns, names as text cells, alphabetical order.

    Header after jmscslgroup/catvehicle issue 9; the UR driver publishes elbow, lift, pan, wrists.
    """
    order = [2, 1, 0, 3, 4, 5]
    stamp = (1.6e18 + run.t * 1e9).astype(np.int64)
    table = {
        "%time": stamp,
        "field.header.seq": np.arange(len(stamp)),
        "field.header.stamp": stamp - 1000,
        "field.header.frame_id": "",
    }
    table |= {f"field.name{k}": run.arm.joints[j] for k, j in enumerate(order)}
    for field, values in (("position", run.q), ("velocity", run.dq), ("effort", run.tau)):
        table |= block(f"field.{field}{{}}", values[:, order], 0)
    csv(folder / "joint_states.csv", table, float_format="%.12f")
    right = {
        k: (Signal(tuple(f"field.{f}{order.index(j)}" for j in range(6)), u),)
        for k, f, u in (("q", "position", RAD), ("dq", "velocity", RADS), ("tau", "effort", NM))
    }
    return Answer("joint_states.csv", {"%time": "ns", "field.header.stamp": "ns"}, right=right)


@layout(UR)
def plotjuggler(folder: Path, run: Run) -> Answer:
    """PlotJuggler's CSV of all curves: __time, one column a joint and field, sorted by name; a
    gripper too."""
    table = {"/joint_states/header/stamp": 1.7e9 + run.t - 0.001}
    for j, joint in enumerate(run.arm.joints):
        table |= {
            f"/joint_states/{joint}/{f}": v[:, j]
            for f, v in (("position", run.q), ("velocity", run.dq), ("effort", run.tau))
        }
    table |= {
        f"/joint_states/finger_joint/{f}": np.full(len(run.t), x)
        for f, x in (("position", 0.2), ("velocity", 0.0), ("effort", 0.4))
    }
    csv(folder / "curves.csv", {"__time": 1.7e9 + run.t} | dict(sorted(table.items())))
    right = {
        k: (Signal(tuple(f"/joint_states/{j}/{f}" for j in run.arm.joints), u),)
        for k, f, u in (("q", "position", RAD), ("dq", "velocity", RADS), ("tau", "effort", NM))
    }
    return Answer("curves.csv", {"__time": "s", "/joint_states/header/stamp": "s"}, right=right)


@layout(UR, rate=100.0)
def rosbag_long_table(folder: Path, run: Run) -> Answer:
    """A rosbag flattened to one row per joint: time_s, joint, position, velocity, effort.

    As gianmarco-ferrara/RL2025HW02 plot/db3TOcsv_position.py writes it with rosbags and pandas.
    """
    n, order = run.n, [2, 1, 0, 3, 4, 5]
    table = {
        "time_s": np.repeat(1.7e9 + run.t, n),
        "joint": [run.arm.joints[j] for j in order] * len(run.t),
    }
    table |= {
        f: v[:, order].ravel()
        for f, v in (("position", run.q), ("velocity", run.dq), ("effort", run.tau))
    }
    csv(folder / "joint_states_converted.csv", table)
    right = {"q": (Signal((), RAD),), "dq": (Signal((), RADS),), "tau": (Signal((), NM),)}
    return Answer("joint_states_converted.csv", right=right, texts=False)


@layout(UR)
def ur_own_logger(folder: Path, run: Run) -> Answer:
    """UR5e logger on rtde_receive: tq_ is the *target* q, no torque at all, a TCP force.

    Columns after MingyuTang0728/Universal-Robots-Notts CSV_READER.py.
    """
    zero = np.zeros(len(run.t), int)
    table = {
        "pc_ts": 1.71e9 + run.t,
        "runtime_state": zero + 2,
        "robot_mode": zero + 7,
        "safety_mode": zero + 1,
        "speed_scaling": zero + 1.0,
        "din_bits": zero,
        "dout_bits": zero,
        "ai0": zero + 0.013,
        "ai1": zero + 0.021,
    }
    for name, values in (
        ("q", run.q),
        ("qd", run.dq),
        ("tq", run.q_ref),
        ("tqd", run.dq_ref),
        ("tcp", run.pose),
        ("tcps", 0.3 * run.pose),
        ("tcpf", 5 + run.tau_ext),
    ):
        table |= block(f"{name}_{{}}", values, 0)
    csv(folder / "UR5e_motion_full.csv", table)
    right = {
        "q": (Signal(names("q_{}", 6, 0), RAD),),
        "dq": (Signal(names("qd_{}", 6, 0), RADS),),
        "q_ref": (Signal(names("tq_{}", 6, 0), RAD),),
        "dq_ref": (Signal(names("tqd_{}", 6, 0), RADS),),
    }
    return Answer("UR5e_motion_full.csv", {"pc_ts": "s"}, right=right)


@layout(PANDA, rate=1000.0)
def libfranka_log(folder: Path, run: Run) -> Answer:
    """libfranka's logToCSV (src/log.cpp): time in ms, state.* and cmd.*, blanks after commas; a
    URDF with fingers."""
    table = {"time": (run.t * 1000).astype(int), " success_rate": 1.0}
    zeros = np.zeros_like(run.t)
    for name, v in (
        ("state.q", run.q),
        ("state.q_d", run.q_ref),
        ("state.dq", run.dq),
        ("state.dq_d", run.dq_ref),
        ("state.tau_J", run.tau),
        ("state.tau_ext_hat_filtered", run.tau_ext),
        ("cmd.q_d", run.q * 0),
        ("cmd.dq_d", run.q * 0),
        ("cmd.O_T_EE_d", np.outer(zeros, np.ones(16))),
        ("cmd.O_dP_EE_d", np.outer(zeros, np.ones(6))),
        ("cmd.tau_J_d", run.tau_ref),
    ):
        table |= {f"{' ' if j else ''}{name}[{j}]": c for j, c in enumerate(v.T)}
    csv(folder / "log.csv", table)
    right = {
        k: (Signal(names(f + "[{}]", 7, 0), u),)
        for k, f, u in (
            ("q", "state.q", RAD),
            ("dq", "state.dq", RADS),
            ("tau", "state.tau_J", NM),
            ("q_ref", "state.q_d", RAD),
            ("dq_ref", "state.dq_d", RADS),
        )
    }
    right["tau"] += (Signal(names("cmd.tau_J_d[{}]", 7, 0), NM, run.tau_ref),)
    return Answer("log.csv", {"time": "ms"}, right=right)


@layout(SIX, robot=None, rate=250.0)
def kuka_trace(folder: Path, run: Run) -> Answer:
    """KUKA trace as tab-separated text: degree signs in Latin-1, programmed, real and difference
    values, K and A.

    Signals after the "Robot data from the body shop" data set (NextGenDrive, 4 ms).
    """
    d = np.degrees
    table = {"Time [ms]": np.round(run.t * 1000).astype(int)}
    for name, unit, v in (
        ("Programmed Axis Position", "°", d(run.q_ref)),
        ("Real Axis Position", "°", d(run.q)),
        ("Difference Axis Position", "°", d(run.q_ref - run.q)),
        ("Programmed Axis Velocity", "°/s", d(run.dq_ref)),
        ("Real Axis Velocity", "°/s", d(run.dq)),
        ("Calculated Axis Moment", "Nm", run.tau_model),
        ("Real Axis Moment", "Nm", run.tau),
        ("Difference Axis Moment", "Nm", run.tau - run.tau_model),
        ("Motor Temperature", "K", run.temperature + 273.15),
        ("Axis Current", "A", run.current),
    ):
        table |= block(f"{name} A{{}} [{unit}]", v)
    csv(folder / "trace.txt", table, sep="\t", encoding="latin-1", lineterminator="\r\n")
    right = {
        "q": (Signal(names("Real Axis Position A{} [°]", 6), DEG),),
        "dq": (Signal(names("Real Axis Velocity A{} [°/s]", 6), DEGS),),
        "tau": (Signal(names("Real Axis Moment A{} [Nm]", 6), NM),),
        "q_ref": (Signal(names("Programmed Axis Position A{} [°]", 6), DEG),),
        "dq_ref": (Signal(names("Programmed Axis Velocity A{} [°/s]", 6), DEGS),),
        "current": (Signal(names("Axis Current A{} [A]", 6), ("A",)),),
    }
    return Answer("trace.txt", {"Time [ms]": "ms"}, right=right, torque=("measured",))


@layout(IIWA)
def kuka_sunrise_recorder(folder: Path, run: Run) -> Answer:
    """KUKA Sunrise DataRecorder: German clock in two columns, blanks between, external torque
    first, degrees.

    Header as read by a public replay script (axisQMsr_LBR_iiwa_7_R800_1[0], degrees, '%' comments).
    """
    ns = (1.66e18 + run.t * 1e9).astype(np.int64)
    table = {"ZeitInSec": ns // 10**9, "ZeitInNanoSec": ns % 10**9}
    for name, v in (
        ("axisTauExtMsr", run.tau_ext),
        ("axisTauMsr", run.tau),
        ("axisQMsr", np.degrees(run.q)),
        ("axisQCmd", np.degrees(run.q_ref)),
    ):
        table |= block(f"{name}_LBR_iiwa_7_R800_1[{{}}]", v, 0)
    for k, axis in enumerate("XYZ"):
        table[f"cartForce1_{axis}"], table[f"cartTorque1_Tau{axis}"] = (
            run.tau_ext[:, k],
            0.1 * run.tau_ext[:, k + 3],
        )
    csv(folder / "2024-03-01_10-11-12.log", table, sep=" ")
    name = "_LBR_iiwa_7_R800_1[{}]"
    right = {
        "q": (Signal(names("axisQMsr" + name, 7, 0), DEG),),
        "tau": (Signal(names("axisTauMsr" + name, 7, 0), NM),),
        "q_ref": (Signal(names("axisQCmd" + name, 7, 0), DEG),),
    }
    return Answer(
        "2024-03-01_10-11-12.log",
        {"ZeitInSec+ZeitInNanoSec": "s+ns"},
        right=right,
        torque=("measured",),
    )


@layout(SIX)
def doosan_realtime(folder: Path, run: Run) -> Answer:
    """Doosan real-time data list (manual.doosanrobotics.com): two position sensors, four
    torques; a row of units."""
    d = np.degrees
    parts = (
        ("actual_joint_position", d(run.q), "deg"),
        ("actual_joint_position_abs", d(run.q) + 1e-3, "deg"),
        ("actual_joint_velocity", d(run.dq), "deg/s"),
        ("actual_tcp_position", 300 * run.pose, "mm"),
        ("external_joint_torque", run.tau_ext, "Nm"),
        ("actual_motor_torque", run.tau, "Nm"),
        ("raw_joint_torque", run.tau - 0.0, "Nm"),
        ("target_joint_position", d(run.q_ref), "deg"),
    )
    table, units = {"time_stamp": run.t + 812.4}, ["s"]
    for name, v, unit in parts:
        table |= block(f"{name}_{{}}", v, 0)
        units += [unit] * 6
    csv(
        folder / "rt.csv", table, head=",".join(table) + "\n" + ",".join(units) + "\n", header=False
    )
    right = {
        "q": (
            Signal(names("actual_joint_position_{}", 6, 0), DEG),
            Signal(names("actual_joint_position_abs_{}", 6, 0), DEG),
        ),
        "dq": (Signal(names("actual_joint_velocity_{}", 6, 0), DEGS),),
        "q_ref": (Signal(names("target_joint_position_{}", 6, 0), DEG),),
        "tau": (
            Signal(names("actual_motor_torque_{}", 6, 0), NM),
            Signal(names("raw_joint_torque_{}", 6, 0), NM),
        ),
    }
    return Answer("rt.csv", {"time_stamp": "s"}, right=right)


@layout(THREE, robot=None)
def twincat_scope(folder: Path, run: Run) -> Answer:
    """TwinCAT Scope's CSV export: tabs, decimal commas, a header block a channel, a clock beside
    each channel.

    After infosys.beckhoff.com tcscope2 "Export to CSV"; torque in 0.1 % of the rated torque: no
    unit can be known.
    """
    channels = []
    for j in range(3):
        axis = f"GVL_Axes.axis{j + 1}"
        channels += [
            (f"{axis}.NcToPlc.ActPos", np.degrees(run.q[:, j])),
            (f"{axis}.NcToPlc.ActVelo", np.degrees(run.dq[:, j])),
            (f"{axis}.Drive.nActTorque", np.round(1000 * run.tau[:, j] / run.arm.effort[j])),
        ]
    rows = [
        ("Name", "Scope Project"),
        ("File", "C:\\Scope\\arm.tcscopex"),
        ("StartRecord", "132537830932236900"),
        ("EndRecord", "132537831052236900"),
        (),
    ]
    for key, values in (
        ("Name", [c.rsplit(".", 2)[1] + c.rsplit(".")[-1] for c, _ in channels]),
        ("SymbolName", [c for c, _ in channels]),
        ("NetId", ["5.20.1.6.1.1"] * 9),
        ("Port", ["851"] * 9),
        ("SampleTime[ms]", ["5"] * 9),
        ("Data-Type", ["LREAL"] * 9),
        ("", [""] * 9),
    ):
        rows.append(tuple(cell for v in values for cell in (key, v)))
    for k, t in enumerate(run.t):
        rows.append(
            tuple(
                cell
                for _, v in channels
                for cell in (f"{1000 * t:g}", f"{v[k]:.5f}".replace(".", ","))
            )
        )
    (folder / "scope.csv").write_text("\n".join("\t".join(r) for r in rows) + "\nEOF\n")
    right = {
        "q": (Signal(names("GVL_Axes.axis{}.NcToPlc.ActPos", 3), DEG),),
        "dq": (Signal(names("GVL_Axes.axis{}.NcToPlc.ActVelo", 3), DEGS),),
        "tau": (Signal(names("GVL_Axes.axis{}.Drive.nActTorque", 3)),),
    }
    return Answer("scope.csv", {"SymbolName": "ms"}, right=right, draftable=False)


@layout(THREE, robot="robot.toml")
def labview_lvm(folder: Path, run: Run) -> Answer:
    """LabVIEW measurement file (.lvm, NI specification): header blocks, tabs, decimal commas, an
    empty Comment column."""
    head = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\n"
        "Decimal_Separator\t,\n"
        "Multi_Headings\tNo\nX_Columns\tOne\nTime_Pref\tRelative\nOperator\tlab\nDate\t2023/05/04\n"
        "Time\t14:03:21,5\n***End_of_Header***\t\n\nChannels\t6\t\t\t\t\t\t\n"
        + "Samples"
        + f"\t{len(run.t)}" * 6
        + "\t\n"
        "Y_Unit_Label" + "\tdeg" * 3 + "\tN m" * 3 + "\t\nX_Dimension" + "\tTime" * 6 + "\t\n"
        "X0"
        + "\t0,0E+0" * 6
        + "\t\nDelta_X"
        + "\t0,005" * 6
        + "\t\n***End_of_Header***\t\t\t\t\t\t\t\n"
    )
    table = (
        {"X_Value": run.t}
        | block("Pos_J{}", np.degrees(run.q))
        | block("Torque_J{}", run.tau)
        | {"Comment": ""}
    )
    csv(folder / "run.lvm", table, head=head, sep="\t", decimal=",")
    right = {"q": (Signal(names("Pos_J{}", 3), DEG),), "tau": (Signal(names("Torque_J{}", 3), NM),)}
    return Answer("run.lvm", {"X_Value": "s"}, right=right)


@layout(THREE, robot="robot.toml")
def simulink_structure(folder: Path, run: Run) -> Answer:
    """Simulink To Workspace, "Structure With Time", saved to MAT: q.time, q.signals.values, one
    structure a block."""

    def structure(values: np.ndarray, label: str) -> dict[str, object]:
        signals = {"values": values, "dimensions": 3.0, "label": label}
        return {"time": run.t[:, None], "signals": signals, "blockName": f"model/{label}"}

    savemat(
        folder / "run.mat",
        {
            "q_meas": structure(run.q, "q"),
            "q_des": structure(run.q_ref, "qd"),
            "tau_cmd": structure(run.tau_ref, "tau"),
            "Ts": 0.005,
        },
    )
    right = {
        "q": (Signal((), RAD),),
        "q_ref": (Signal((), RAD),),
        "tau": (Signal((), NM, run.tau_ref),),
    }
    return Answer("run.mat", rate=200.0, right=right, texts=False)


@layout(THREE, robot="robot.toml")
def matlab_transposed(folder: Path, run: Run) -> Answer:
    """MATLAB script results: t (1 x N), q, qd, qdd, tau (n x N), with gains and a name in the
    same MAT file."""
    savemat(
        folder / "results.mat",
        {
            "t": run.t[None],
            "q": run.q.T,
            "qd": run.dq.T,
            "qdd": run.ddq.T,
            "tau": run.tau.T,
            "Kp": np.diag([900.0, 700.0, 300.0]),
            "Kd": np.diag([60.0, 40.0, 9.0]),
            "robot": "rrr",
        },
    )
    right = {
        "q": (Signal((), RAD),),
        "dq": (Signal((), RADS),),
        "tau": (Signal((), NM),),
        "ddq": (Signal((), ("rad/s^2",)),),
    }
    return Answer("results.mat", rate=200.0, right=right, texts=False)
