"""Write one simulated motion as thirty real exports do, each with its right answer (see outside_layouts)."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.io import savemat

from benchmarks.outside_layouts import Answer, Arm, Run, Signal, layout

UR = Arm("ur5", ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint",
                 "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"), "zyyyzy", (150, 150, 150, 28, 28, 28))
SIX = Arm("m0609", tuple(f"joint_{j}" for j in range(1, 7)), "zyyxyx", (194, 163, 163, 50, 50, 50))
PANDA = Arm("panda", tuple(f"panda_joint{j}" for j in range(1, 8)), "zyzyzyz", (150,) * 4 + (30,) * 3,
            ("panda_finger_joint1", "panda_finger_joint2"))
IIWA = Arm("iiwa7", tuple(f"lbr_iiwa_joint_{j}" for j in range(1, 8)), "zyzyzyz", (176,) * 3 + (110,) * 2 + (40,) * 2)
GEN3 = Arm("gen3", tuple(f"joint_{j}" for j in range(1, 8)), "zyzyzyz", (150,) * 4 + (30,) * 3, continuous=True)
LEFT = Arm("baxter_left", tuple(f"left_{j}" for j in ("s0", "s1", "e0", "e1", "w0", "w1", "w2")),
           "zyxyxyx", (150,) * 4 + (30,) * 3)
THREE = Arm("rrr", ("waist", "shoulder", "elbow"), "zyy", (120, 120, 40))
TWO = Arm("double-pendulum", ("q1", "q2"), "yy", (60, 20))
FOUR = Arm("open_manipulator", ("joint1", "joint2", "joint3", "joint4"), "zyyy", (80, 80, 40, 20))
SCARA = Arm("scara", ("J1", "J2", "J3", "J4"), "zzZz", (90, 60, 200, 20))

DEG = ("deg", "degree", "degrees", "°")
RAD, RADS, NM = ("rad",), ("rad/s",), ("N m", "Nm", "N*m")
DEGS, NEWTON = ("deg/s", "°/s"), ("N m", "N m", "N", "N m")


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
    table = {"%time": stamp, "field.header.seq": np.arange(len(stamp)), "field.header.stamp": stamp - 1000,
             "field.header.frame_id": ""}
    table |= {f"field.name{k}": run.arm.joints[j] for k, j in enumerate(order)}
    for field, values in (("position", run.q), ("velocity", run.dq), ("effort", run.tau)):
        table |= block(f"field.{field}{{}}", values[:, order], 0)
    csv(folder / "joint_states.csv", table, float_format="%.12f")
    right = {k: (Signal(tuple(f"field.{f}{order.index(j)}" for j in range(6)), u),)
             for k, f, u in (("q", "position", RAD), ("dq", "velocity", RADS), ("tau", "effort", NM))}
    return Answer("joint_states.csv", {"%time": "ns", "field.header.stamp": "ns"}, right=right)


@layout(UR)
def plotjuggler(folder: Path, run: Run) -> Answer:
    """PlotJuggler's CSV of all curves: __time, one column a joint and field, sorted by name; a gripper too."""
    table = {"/joint_states/header/stamp": 1.7e9 + run.t - 0.001}
    for j, joint in enumerate(run.arm.joints):
        table |= {f"/joint_states/{joint}/{f}": v[:, j]
                  for f, v in (("position", run.q), ("velocity", run.dq), ("effort", run.tau))}
    table |= {f"/joint_states/finger_joint/{f}": np.full(len(run.t), x)
              for f, x in (("position", 0.2), ("velocity", 0.0), ("effort", 0.4))}
    csv(folder / "curves.csv", {"__time": 1.7e9 + run.t} | dict(sorted(table.items())))
    right = {k: (Signal(tuple(f"/joint_states/{j}/{f}" for j in run.arm.joints), u),)
             for k, f, u in (("q", "position", RAD), ("dq", "velocity", RADS), ("tau", "effort", NM))}
    return Answer("curves.csv", {"__time": "s", "/joint_states/header/stamp": "s"}, right=right)


@layout(UR, rate=100.0)
def rosbag_long_table(folder: Path, run: Run) -> Answer:
    """A rosbag flattened to one row per joint: time_s, joint, position, velocity, effort.

    As gianmarco-ferrara/RL2025HW02 plot/db3TOcsv_position.py writes it with rosbags and pandas.
    """
    n, order = run.n, [2, 1, 0, 3, 4, 5]
    table = {"time_s": np.repeat(1.7e9 + run.t, n), "joint": [run.arm.joints[j] for j in order] * len(run.t)}
    table |= {f: v[:, order].ravel() for f, v in (("position", run.q), ("velocity", run.dq), ("effort", run.tau))}
    csv(folder / "joint_states_converted.csv", table)
    return Answer("joint_states_converted.csv", texts=False, draftable=False)


@layout(UR)
def ur_own_logger(folder: Path, run: Run) -> Answer:
    """UR5e logger on rtde_receive: tq_ is the *target* q, no torque at all, a TCP force.

    Columns after MingyuTang0728/Universal-Robots-Notts CSV_READER.py.
    """
    zero = np.zeros(len(run.t), int)
    table = {"pc_ts": 1.71e9 + run.t, "runtime_state": zero + 2, "robot_mode": zero + 7, "safety_mode": zero + 1,
             "speed_scaling": zero + 1.0, "din_bits": zero, "dout_bits": zero, "ai0": zero + 0.013, "ai1": zero + 0.021}
    for name, values in (("q", run.q), ("qd", run.dq), ("tq", run.q_ref), ("tqd", run.dq_ref), ("tcp", run.pose),
                         ("tcps", 0.3 * run.pose), ("tcpf", 5 + run.tau_ext)):
        table |= block(f"{name}_{{}}", values, 0)
    csv(folder / "UR5e_motion_full.csv", table)
    right = {"q": (Signal(names("q_{}", 6, 0), RAD),), "dq": (Signal(names("qd_{}", 6, 0), RADS),),
             "q_ref": (Signal(names("tq_{}", 6, 0), RAD),), "dq_ref": (Signal(names("tqd_{}", 6, 0), RADS),)}
    return Answer("UR5e_motion_full.csv", {"pc_ts": "s"}, right=right)


@layout(PANDA, rate=1000.0)
def libfranka_log(folder: Path, run: Run) -> Answer:
    """libfranka's logToCSV (src/log.cpp): time in ms, state.* and cmd.*, blanks after commas; a URDF with fingers."""
    table = {"time": (run.t * 1000).astype(int), " success_rate": 1.0}
    zeros = np.zeros_like(run.t)
    for name, v in (("state.q", run.q), ("state.q_d", run.q_ref), ("state.dq", run.dq), ("state.dq_d", run.dq_ref),
                    ("state.tau_J", run.tau), ("state.tau_ext_hat_filtered", run.tau_ext), ("cmd.q_d", run.q * 0),
                    ("cmd.dq_d", run.q * 0), ("cmd.O_T_EE_d", np.outer(zeros, np.ones(16))),
                    ("cmd.O_dP_EE_d", np.outer(zeros, np.ones(6))), ("cmd.tau_J_d", run.tau_ref)):
        table |= {f"{' ' if j else ''}{name}[{j}]": c for j, c in enumerate(v.T)}
    csv(folder / "log.csv", table)
    right = {k: (Signal(names(f + "[{}]", 7, 0), u),)
             for k, f, u in (("q", "state.q", RAD), ("dq", "state.dq", RADS), ("tau", "state.tau_J", NM),
                             ("q_ref", "state.q_d", RAD), ("dq_ref", "state.dq_d", RADS))}
    right["tau"] += (Signal(names("cmd.tau_J_d[{}]", 7, 0), NM, run.tau_ref),)
    return Answer("log.csv", {"time": "ms"}, right=right)


@layout(SIX, robot=None, rate=250.0)
def kuka_trace(folder: Path, run: Run) -> Answer:
    """KUKA trace as tab-separated text: degree signs in Latin-1, programmed, real and difference values, K and A.

    Signals after the "Robot data from the body shop" data set (NextGenDrive, 4 ms).
    """
    d = np.degrees
    table = {"Time [ms]": np.round(run.t * 1000).astype(int)}
    for name, unit, v in (("Programmed Axis Position", "°", d(run.q_ref)), ("Real Axis Position", "°", d(run.q)),
                          ("Difference Axis Position", "°", d(run.q_ref - run.q)),
                          ("Programmed Axis Velocity", "°/s", d(run.dq_ref)), ("Real Axis Velocity", "°/s", d(run.dq)),
                          ("Calculated Axis Moment", "Nm", run.tau_model), ("Real Axis Moment", "Nm", run.tau),
                          ("Difference Axis Moment", "Nm", run.tau - run.tau_model),
                          ("Motor Temperature", "K", run.temperature + 273.15), ("Axis Current", "A", run.current)):
        table |= block(f"{name} A{{}} [{unit}]", v)
    csv(folder / "trace.txt", table, sep="\t", encoding="latin-1", lineterminator="\r\n")
    right = {"q": (Signal(names("Real Axis Position A{} [°]", 6), DEG),),
             "dq": (Signal(names("Real Axis Velocity A{} [°/s]", 6), DEGS),),
             "tau": (Signal(names("Real Axis Moment A{} [Nm]", 6), NM),),
             "q_ref": (Signal(names("Programmed Axis Position A{} [°]", 6), DEG),),
             "dq_ref": (Signal(names("Programmed Axis Velocity A{} [°/s]", 6), DEGS),),
             "current": (Signal(names("Axis Current A{} [A]", 6), ("A",)),)}
    return Answer("trace.txt", {"Time [ms]": "ms"}, right=right, torque=("measured",))


@layout(IIWA)
def kuka_sunrise_recorder(folder: Path, run: Run) -> Answer:
    """KUKA Sunrise DataRecorder: German clock in two columns, blanks between, external torque first, degrees.

    Header as read by a public replay script (axisQMsr_LBR_iiwa_7_R800_1[0], degrees, '%' comments).
    """
    ns = (1.66e18 + run.t * 1e9).astype(np.int64)
    table = {"ZeitInSec": ns // 10**9, "ZeitInNanoSec": ns % 10**9}
    for name, v in (("axisTauExtMsr", run.tau_ext), ("axisTauMsr", run.tau), ("axisQMsr", np.degrees(run.q)),
                    ("axisQCmd", np.degrees(run.q_ref))):
        table |= block(f"{name}_LBR_iiwa_7_R800_1[{{}}]", v, 0)
    for k, axis in enumerate("XYZ"):
        table[f"cartForce1_{axis}"], table[f"cartTorque1_Tau{axis}"] = run.tau_ext[:, k], 0.1 * run.tau_ext[:, k + 3]
    csv(folder / "2024-03-01_10-11-12.log", table, sep=" ")
    name = "_LBR_iiwa_7_R800_1[{}]"
    right = {"q": (Signal(names("axisQMsr" + name, 7, 0), DEG),), "tau": (Signal(names("axisTauMsr" + name, 7, 0), NM),),
             "q_ref": (Signal(names("axisQCmd" + name, 7, 0), DEG),)}
    return Answer("2024-03-01_10-11-12.log", {"ZeitInSec+ZeitInNanoSec": "s+ns"}, right=right, torque=("measured",))


@layout(SIX)
def doosan_realtime(folder: Path, run: Run) -> Answer:
    """Doosan real-time data list (manual.doosanrobotics.com): two position sensors, four torques; a row of units."""
    d = np.degrees
    parts = (("actual_joint_position", d(run.q), "deg"), ("actual_joint_position_abs", d(run.q) + 1e-3, "deg"),
             ("actual_joint_velocity", d(run.dq), "deg/s"), ("actual_tcp_position", 300 * run.pose, "mm"),
             ("external_joint_torque", run.tau_ext, "Nm"), ("actual_motor_torque", run.tau, "Nm"),
             ("raw_joint_torque", run.tau - 0.0, "Nm"), ("target_joint_position", d(run.q_ref), "deg"))
    table, units = {"time_stamp": run.t + 812.4}, ["s"]
    for name, v, unit in parts:
        table |= block(f"{name}_{{}}", v, 0)
        units += [unit] * 6
    csv(folder / "rt.csv", table, head=",".join(table) + "\n" + ",".join(units) + "\n", header=False)
    right = {"q": (Signal(names("actual_joint_position_{}", 6, 0), DEG), Signal(names("actual_joint_position_abs_{}", 6, 0), DEG)),
             "dq": (Signal(names("actual_joint_velocity_{}", 6, 0), DEGS),),
             "q_ref": (Signal(names("target_joint_position_{}", 6, 0), DEG),),
             "tau": (Signal(names("actual_motor_torque_{}", 6, 0), NM), Signal(names("raw_joint_torque_{}", 6, 0), NM))}
    return Answer("rt.csv", {"time_stamp": "s"}, right=right)


@layout(THREE, robot=None)
def twincat_scope(folder: Path, run: Run) -> Answer:
    """TwinCAT Scope's CSV export: tabs, decimal commas, a header block a channel, a clock beside each channel.

    After infosys.beckhoff.com tcscope2 "Export to CSV"; torque in 0.1 % of the rated torque: no unit can be known.
    """
    channels = []
    for j in range(3):
        axis = f"GVL_Axes.axis{j + 1}"
        channels += [(f"{axis}.NcToPlc.ActPos", np.degrees(run.q[:, j])), (f"{axis}.NcToPlc.ActVelo", np.degrees(run.dq[:, j])),
                     (f"{axis}.Drive.nActTorque", np.round(1000 * run.tau[:, j] / run.arm.effort[j]))]
    rows = [("Name", "Scope Project"), ("File", "C:\\Scope\\arm.tcscopex"), ("StartRecord", "132537830932236900"),
            ("EndRecord", "132537831052236900"), ()]
    for key, values in (("Name", [c.rsplit(".", 2)[1] + c.rsplit(".")[-1] for c, _ in channels]),
                        ("SymbolName", [c for c, _ in channels]), ("NetId", ["5.20.1.6.1.1"] * 9), ("Port", ["851"] * 9),
                        ("SampleTime[ms]", ["5"] * 9), ("Data-Type", ["LREAL"] * 9), ("", [""] * 9)):
        rows.append(tuple(cell for v in values for cell in (key, v)))
    for k, t in enumerate(run.t):
        rows.append(tuple(cell for _, v in channels for cell in (f"{1000 * t:g}", f"{v[k]:.5f}".replace(".", ","))))
    (folder / "scope.csv").write_text("\n".join("\t".join(r) for r in rows) + "\nEOF\n")
    return Answer("scope.csv", texts=False, draftable=False)


@layout(THREE, robot="robot.toml")
def labview_lvm(folder: Path, run: Run) -> Answer:
    """LabVIEW measurement file (.lvm, NI specification): header blocks, tabs, decimal commas, an empty Comment column."""
    head = ("LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\n"
            "Multi_Headings\tNo\nX_Columns\tOne\nTime_Pref\tRelative\nOperator\tlab\nDate\t2023/05/04\n"
            "Time\t14:03:21,5\n***End_of_Header***\t\n\nChannels\t6\t\t\t\t\t\t\n" + "Samples" + f"\t{len(run.t)}" * 6 + "\t\n"
            "Y_Unit_Label" + "\tdeg" * 3 + "\tN m" * 3 + "\t\nX_Dimension" + "\tTime" * 6 + "\t\n"
            "X0" + "\t0,0E+0" * 6 + "\t\nDelta_X" + "\t0,005" * 6 + "\t\n***End_of_Header***\t\t\t\t\t\t\t\n")
    table = {"X_Value": run.t} | block("Pos_J{}", np.degrees(run.q)) | block("Torque_J{}", run.tau) | {"Comment": ""}
    csv(folder / "run.lvm", table, head=head, sep="\t", decimal=",")
    right = {"q": (Signal(names("Pos_J{}", 3), DEG),), "tau": (Signal(names("Torque_J{}", 3), NM),)}
    return Answer("run.lvm", {"X_Value": "s"}, right=right)


@layout(THREE, robot="robot.toml")
def simulink_structure(folder: Path, run: Run) -> Answer:
    """Simulink To Workspace, "Structure With Time", saved to MAT: q.time, q.signals.values, one structure a block."""
    def structure(values: np.ndarray, label: str) -> dict[str, object]:
        signals = {"values": values, "dimensions": 3.0, "label": label}
        return {"time": run.t[:, None], "signals": signals, "blockName": f"model/{label}"}

    savemat(folder / "run.mat", {"q_meas": structure(run.q, "q"), "q_des": structure(run.q_ref, "qd"),
                                 "tau_cmd": structure(run.tau_ref, "tau"), "Ts": 0.005})
    right = {"q": (Signal((), RAD),), "q_ref": (Signal((), RAD),), "tau": (Signal((), NM, run.tau_ref),)}
    return Answer("run.mat", rate=200.0, right=right, texts=False)


@layout(THREE, robot="robot.toml")
def matlab_transposed(folder: Path, run: Run) -> Answer:
    """MATLAB script results: t (1 x N), q, qd, qdd, tau (n x N), with gains and a name in the same MAT file."""
    savemat(folder / "results.mat", {"t": run.t[None], "q": run.q.T, "qd": run.dq.T, "qdd": run.ddq.T, "tau": run.tau.T,
                                     "Kp": np.diag([900.0, 700.0, 300.0]), "Kd": np.diag([60.0, 40.0, 9.0]), "robot": "rrr"})
    right = {"q": (Signal((), RAD),), "dq": (Signal((), RADS),), "tau": (Signal((), NM),), "ddq": (Signal((), ("rad/s^2",)),)}
    return Answer("results.mat", rate=200.0, right=right, texts=False)


@layout(TWO, robot=None)
def odrive_poll(folder: Path, run: Run) -> Answer:
    """ODrive polled from Python: turns and turns/s (ODrive 0.5 documentation), Iq in A, no unit in any name."""
    table = {"time": run.t}
    for j in range(2):
        axis = f"axis{j}."
        table |= {axis + "encoder.pos_estimate": run.q[:, j] / (2 * np.pi), axis + "encoder.vel_estimate": run.dq[:, j] / (2 * np.pi),
                  axis + "controller.pos_setpoint": run.q_ref[:, j] / (2 * np.pi),
                  axis + "motor.current_control.Iq_measured": run.current[:, j],
                  axis + "motor.current_control.Iq_setpoint": run.current[:, j] * 1.01, axis + "error": 0}
    csv(folder / "odrive.csv", table)
    turns = ("rev", "turn", "turns", "revolutions")
    right = {"q": (Signal(names("axis{}.encoder.pos_estimate", 2, 0), turns),),
             "dq": (Signal(names("axis{}.encoder.vel_estimate", 2, 0), ("rev/s", "turns/s")),),
             "q_ref": (Signal(names("axis{}.controller.pos_setpoint", 2, 0), turns),)}
    right["tau"] = right["current"] = (Signal(names("axis{}.motor.current_control.Iq_measured", 2, 0), ("A",)),)
    return Answer("odrive.csv", {"time": "s"}, right=right, torque=("measured",))


@layout(THREE, robot="robot.toml", rate=100.0)
def moteus_long_table(folder: Path, run: Run) -> Answer:
    """moteus query results appended as they come: one row per servo and cycle; revolutions (moteus reference)."""
    n, length = run.n, len(run.t)
    stamp = np.repeat(1.7e9 + run.t, n) + np.tile(0.0007 * np.arange(n), length)
    table = {"timestamp": stamp, "id": np.tile([1, 2, 3], length), "mode": 10, "position": run.q.ravel() / (2 * np.pi),
             "velocity": run.dq.ravel() / (2 * np.pi), "torque": run.tau.ravel(), "q_current": run.current.ravel(),
             "voltage": 24.1, "temperature": run.temperature.ravel(), "fault": 0}
    csv(folder / "moteus.csv", table)
    return Answer("moteus.csv", texts=False, draftable=False)


@layout(FOUR, rate=100.0)
def dynamixel_registers(folder: Path, run: Run) -> Answer:
    """Dynamixel XM430 registers as read: ticks of 1/4096 turn about 2048, 0.229 rpm, 2.69 mA; wall-clock text."""
    stamp = pd.to_datetime(1.7147e18 + np.round(run.t * 1e9, -3)).strftime("%Y-%m-%d %H:%M:%S.%f")
    table: dict[str, object] = {"Timestamp": stamp}
    ticks = 2048 + np.round(run.q * 4096 / (2 * np.pi)).astype(int)
    for j in range(4):
        table |= {f"ID{j + 1}_Goal_Position": 2048 + np.round(run.q_ref[:, j] * 4096 / (2 * np.pi)).astype(int),
                  f"ID{j + 1}_Present_Position": ticks[:, j], f"ID{j + 1}_Present_Velocity": np.round(run.dq[:, j] / 0.02398).astype(int),
                  f"ID{j + 1}_Present_Current": np.round(run.current[:, j] * 1000 / 2.69).astype(int),
                  f"ID{j + 1}_Present_Temperature": np.round(run.temperature[:, j]).astype(int)}
    csv(folder / "dxl.csv", table)
    current = (Signal(names("ID{}_Present_Current", 4)),)
    right = {"q": (Signal(names("ID{}_Present_Position", 4), ("counts", "count", "ticks")),),
             "q_ref": (Signal(names("ID{}_Goal_Position", 4), ("counts", "count", "ticks")),),
             "dq": (Signal(names("ID{}_Present_Velocity", 4)),), "tau": current, "current": current}
    return Answer("dxl.csv", {"Timestamp": "*"}, rate=100.0, right=right, draftable=False)


@layout(FOUR, rate=50.0)
def lerobot_parquet(folder: Path, run: Run) -> Answer:
    """LeRobot data set, data/chunk-000/episode_000000.parquet: lists in observation.state and action, degrees."""
    rows = {"observation.state": list(np.degrees(run.q).astype(np.float32)), "action": list(np.degrees(run.q_ref).astype(np.float32)),
            "timestamp": run.t.astype(np.float32), "frame_index": np.arange(len(run.t)), "episode_index": 0,
            "index": np.arange(len(run.t)), "task_index": 0}
    pd.DataFrame(rows).to_parquet(folder / "episode_000000.parquet")
    right = {"q": (Signal((), DEG),), "q_ref": (Signal((), DEG),)}
    return Answer("episode_000000.parquet", right=right, texts=False, draftable=False)


@layout(UR)
def json_lines(folder: Path, run: Run) -> Answer:
    """One JSON object a line from a control loop: nested joints, a text mode, Unix time in ms."""
    with (folder / "run.jsonl").open("w") as lines:
        for k, t in enumerate(run.t):
            joints = {"q": run.q[k].tolist(), "dq": run.dq[k].tolist(), "tau": run.tau[k].tolist(), "temp": run.temperature[k].tolist()}
            lines.write(json.dumps({"ts_ms": 1_700_000_000_000 + round(t * 1000), "mode": "servo", "joints": joints}) + "\n")
    right = {"q": (Signal((), RAD),), "dq": (Signal((), RADS),), "tau": (Signal((), NM),)}
    return Answer("run.jsonl", right=right, texts=False)


@layout(UR)
def mujoco_json(folder: Path, run: Run) -> Answer:
    """MuJoCo roll-out dumped as JSON: qpos, qvel, ctrl (position targets), qfrc_actuator; dt in the metadata, no clock."""
    data = {"qpos": run.q, "qvel": run.dq, "ctrl": run.q_ref, "qfrc_actuator": run.tau}
    text = {"meta": {"model": "ur5e.xml", "dt": 0.005, "seed": 3}, "data": {k: v.tolist() for k, v in data.items()}}
    (folder / "rollout.json").write_text(json.dumps(text))
    right = {"q": (Signal((), RAD),), "dq": (Signal((), RADS),), "q_ref": (Signal((), RAD),), "tau": (Signal((), NM),)}
    return Answer("rollout.json", rate=200.0, right=right, texts=False)


@layout(THREE, robot="robot.toml")
def numpy_npz(folder: Path, run: Run) -> Answer:
    """NumPy archive of a Python controller: np.savez_compressed(time, joint_positions, ...), the tip beside."""
    np.savez_compressed(folder / "run.npz", time=run.t, joint_positions=run.q, joint_velocities=run.dq,
                        joint_torques=run.tau, desired_positions=run.q_ref, ee_pos=run.pose[:, :3])
    right = {"q": (Signal((), RAD),), "dq": (Signal((), RADS),), "q_ref": (Signal((), RAD),), "tau": (Signal((), NM),)}
    return Answer("run.npz", rate=200.0, right=right, texts=False)


@layout(GEN3, rate=100.0)
def sarcos_headerless(folder: Path, run: Run) -> Answer:
    """SARCOS inverse-dynamics data as text (gaussianprocess.org): 28 columns without header or clock, in order."""
    csv(folder / "sarcos_inv.csv", {k: v for k, v in enumerate(np.hstack([run.q, run.dq, run.ddq, run.tau]).T)}, header=False)

    def columns(first: int) -> tuple[str, ...]:
        return names("column_{}", 7, first)

    right = {"q": (Signal(columns(1), RAD),), "dq": (Signal(columns(8), RADS),), "ddq": (Signal(columns(15), ("rad/s^2",)),),
             "tau": (Signal(columns(22), NM),)}
    return Answer("sarcos_inv.csv", rate=100.0, right=right)


@layout(LEFT, rate=100.0)
def baxter_recorder(folder: Path, run: Run) -> Answer:
    """Baxter joint_recorder: positions of both arms and grippers (0 to 100); efforts would be in another file."""
    rng = np.random.default_rng(1)
    table = {"time": run.t + 0.0132} | {j: run.q[:, k] for k, j in enumerate(run.arm.joints)}
    table["left_gripper"] = 100.0
    table |= {j.replace("left", "right"): 0.1 * k + 4e-4 * rng.normal(size=len(run.t)) for k, j in enumerate(run.arm.joints)}
    table["right_gripper"] = 3.7
    csv(folder / "positions.csv", table)
    return Answer("positions.csv", {"time": "s"}, right={"q": (Signal(run.arm.joints, RAD),)})


@layout(GEN3, rate=100.0)
def kinova_cyclic(folder: Path, run: Run) -> Answer:
    """Kinova Gen3 BaseCyclic feedback, one actuator after the other from the tip to the base: degrees in 0..360, us."""
    table: dict[str, object] = {"timestamp_us": np.round(run.t * 1e6).astype(np.int64) + 1_234_567, "frame_id": np.arange(len(run.t)) % 65536}
    for j in reversed(range(7)):
        name = f"actuator_{j + 1}."
        table |= {name + "position": np.degrees(run.q[:, j]) % 360, name + "velocity": np.degrees(run.dq[:, j]), name + "torque": run.tau[:, j],
                  name + "current_motor": run.current[:, j], name + "voltage": 23.9, name + "temperature_motor": run.temperature[:, j]}
    csv(folder / "feedback.csv", table)
    right = {"q": (Signal(names("actuator_{}.position", 7), DEG),), "dq": (Signal(names("actuator_{}.velocity", 7), DEGS),),
             "tau": (Signal(names("actuator_{}.torque", 7), NM),), "current": (Signal(names("actuator_{}.current_motor", 7), ("A",)),)}
    return Answer("feedback.csv", {"timestamp_us": "us"}, right=right)


@layout(THREE, robot="robot.toml")
def merged_header(folder: Path, run: Run) -> Answer:
    """A spreadsheet saved as CSV: joint names over merged cells, the same three names below each, units, semicolons."""
    head = ["", "waist", "", "", "shoulder", "", "", "elbow", "", ""]
    rows = [";".join(head), ";".join(["Time"] + ["Angle", "Speed", "Torque"] * 3), ";".join(["[s]"] + ["[deg]", "[deg/s]", "[Nm]"] * 3)]
    values = np.column_stack([run.t] + [c for j in range(3) for c in (np.degrees(run.q[:, j]), np.degrees(run.dq[:, j]), run.tau[:, j])])
    rows += [";".join(f"{x:.5f}".replace(".", ",") for x in row) for row in values]
    (folder / "sheet.csv").write_text("\ufeff" + "\r\n".join(rows) + "\r\n", encoding="utf-8")
    right = {"q": (Signal((), DEG),), "dq": (Signal((), DEGS),), "tau": (Signal((), NM),)}
    return Answer("sheet.csv", right=right, texts=False)


@layout(SIX)
def fanuc_export(folder: Path, run: Run) -> Answer:
    """Teach-pendant diagnosis table: line numbers, actual beside command, disturbance torque and current, commas at the end."""
    d = np.degrees
    table: dict[str, object] = {"Line": np.arange(1, len(run.t) + 1), "Time(ms)": np.round(run.t * 1000).astype(int)}
    table |= block("J{} Cmd(deg)", d(run.q_ref)) | block("J{}(deg)", d(run.q)) | block("J{} Disturb Torque(Nm)", run.tau_ext)
    table |= block("J{} Current(A)", run.current) | block("J{} Temp(C)", run.temperature)
    lines = pd.DataFrame(table).to_csv(index=False, float_format="%.4f").replace("\n", ",\r\n")
    (folder / "diag.csv").write_text("\ufeff" + lines, encoding="utf-8", newline="")
    right = {"q": (Signal(names("J{}(deg)", 6), DEG),), "q_ref": (Signal(names("J{} Cmd(deg)", 6), DEG),)}
    right["tau"] = right["current"] = (Signal(names("J{} Current(A)", 6), ("A",)),)
    return Answer("diag.csv", {"Time(ms)": "ms"}, right=right, torque=("measured",))


@layout(SCARA, robot="robot.toml")
def scara_percent(folder: Path, run: Run) -> Answer:
    """SCARA controller log (Denso, Epson): J3 in mm among degrees, load in percent of the rated torque."""
    scale = np.array([180 / np.pi, 180 / np.pi, 1000.0, 180 / np.pi])
    table: dict[str, object] = {"Elapsed[ms]": np.round(run.t * 1000).astype(int)}
    units = ("deg", "deg", "mm", "deg")
    table |= {f"J{j + 1}[{u}]": run.q[:, j] * scale[j] for j, u in enumerate(units)}
    table |= {f"J{j + 1}Cmd[{u}]": run.q_ref[:, j] * scale[j] for j, u in enumerate(units)}
    table |= block("Load{}[%]", 100 * run.tau / np.array(run.arm.effort)) | {"Override": 50, "Tool": 0}
    csv(folder / "ctrl.csv", table)
    right = {"q": (Signal(tuple(f"J{j + 1}[{u}]" for j, u in enumerate(units)), (",".join(units),)),),
             "q_ref": (Signal(tuple(f"J{j + 1}Cmd[{u}]" for j, u in enumerate(units)), (",".join(units),)),),
             "tau": (Signal(names("Load{}[%]", 4), ("%",)),)}
    return Answer("ctrl.csv", {"Elapsed[ms]": "ms"}, right=right, draftable=False)


@layout(UR, rate=50.0)
def isaac_many_environments(folder: Path, run: Run) -> Answer:
    """Isaac Lab log of four environments in one table: the rows of env_id 0 to 3 follow each other every step."""
    envs = 4
    shift = [np.roll(np.arange(len(run.t)), 37 * e) for e in range(envs)]
    table: dict[str, object] = {"step": np.repeat(np.arange(len(run.t)), envs), "env_id": np.tile(np.arange(envs), len(run.t)),
                                "time": np.repeat(run.t, envs)}
    for name, v in (("joint_pos", run.q), ("joint_vel", run.dq), ("applied_torque", run.tau), ("computed_torque", run.tau_ref)):
        stacked = np.stack([v[s] for s in shift], axis=1).reshape(-1, 6)
        table |= {f"{name}/{joint}": stacked[:, j] for j, joint in enumerate(run.arm.joints)}
    csv(folder / "play.csv", table)
    return Answer("play.csv", texts=False, draftable=False)


@layout(SIX, rate=100.0)
def unitree_low_state(folder: Path, run: Run) -> Answer:
    """Unitree LowState of two arms: motor_state[0..11] with q, dq, ddq (zero), tau_est, temperature; which six, none can say."""
    other = np.roll(run.q, 300, axis=0), np.roll(run.dq, 300, axis=0), np.roll(run.tau, 300, axis=0)
    q, dq, tau = (np.hstack([o, v]) for o, v in zip(other, (run.q, run.dq, run.tau), strict=True))
    table: dict[str, object] = {"tick_ms": np.round(run.t * 1000).astype(int) + 88_000}
    for k in range(12):
        name = f"motor_state[{k}]."
        table |= {name + "mode": 1, name + "q": q[:, k], name + "dq": dq[:, k], name + "ddq": 0.0, name + "tau_est": tau[:, k],
                  name + "temperature": 35 + k, name + "lost": 0}
    csv(folder / "lowstate.csv", table)
    right = {k: (Signal(names(f"motor_state[{{}}].{f}", 6, 6), u),)
             for k, f, u in (("q", "q", RAD), ("dq", "dq", RADS), ("tau", "tau_est", NM))}
    return Answer("lowstate.csv", {"tick_ms": "ms"}, right=right)


@layout(UR)
def ros2_echo_csv(folder: Path, run: Run) -> Answer:
    """ROS 2 `ros2 topic echo --csv /joint_states`: no header; sec, nanosec, frame, then names, positions, velocities, efforts."""
    order = [2, 1, 0, 3, 4, 5]
    ns = (1.69e18 + run.t * 1e9).astype(np.int64)
    cells = [ns // 10**9, ns % 10**9, np.full(len(ns), "base_link")]
    cells += [np.full(len(ns), run.arm.joints[j]) for j in order]
    cells += [v[:, j] for v in (run.q, run.dq, run.tau) for j in order]
    csv(folder / "js.csv", {k: v for k, v in enumerate(cells)}, header=False)
    right = {k: (Signal(tuple(f"column_{first + order.index(j)}" for j in range(6)), u),)
             for k, first, u in (("q", 10, RAD), ("dq", 16, RADS), ("tau", 22, NM))}
    return Answer("js.csv", {"column_1+column_2": "s+ns"}, right=right)


@layout(UR, rate=100.0)
def controller_state(folder: Path, run: Run) -> Answer:
    """ROS 2 joint_trajectory_controller state, flattened: reference, feedback, error, output; two gaps of half a second."""
    kept = np.ones(len(run.t), bool)
    kept[300:350] = kept[800:850] = False
    ns = (1.69e18 + run.t * 1e9).astype(np.int64)
    table: dict[str, object] = {"header.stamp.sec": ns // 10**9, "header.stamp.nanosec": ns % 10**9, "header.frame_id": ""}
    table |= {f"joint_names[{j}]": name for j, name in enumerate(run.arm.joints)}
    for name, v in (("reference.positions", run.q_ref), ("reference.velocities", run.dq_ref), ("feedback.positions", run.q),
                    ("feedback.velocities", run.dq), ("error.positions", run.q_ref - run.q), ("error.velocities", run.dq_ref - run.dq),
                    ("output.effort", run.tau_ref)):
        table |= block(f"{name}[{{}}]", v, 0)
    pd.DataFrame(table)[kept].to_csv(folder / "state.csv", index=False)
    right = {k: (Signal(names(f + "[{}]", 6, 0), u),)
             for k, f, u in (("q", "feedback.positions", RAD), ("dq", "feedback.velocities", RADS),
                             ("q_ref", "reference.positions", RAD), ("dq_ref", "reference.velocities", RADS))}
    right["tau"] = (Signal(names("output.effort[{}]", 6, 0), NM, run.tau_ref),)
    return Answer("state.csv", {"header.stamp.sec+header.stamp.nanosec": "s+ns"}, right=right)


@layout(TWO, robot=None, rate=50.0)
def arduino_bridge(folder: Path, run: Run) -> Answer:
    """Arduino telemetry with two clocks (PC seconds, board milliseconds) and efforts u normalised to -1..1: no unit."""
    rng = np.random.default_rng(2)
    table = {"pc_time_s": 1.7e9 + run.t + 0.004 * rng.random(len(run.t)), "arduino_ms": np.round(run.t * 1000).astype(int) + 512}
    table |= block("q{}", run.q) | block("q{}_ref", run.q_ref) | block("u{}", run.tau / abs(run.tau).max(axis=0))
    csv(folder / "log.csv", table)
    right = {"q": (Signal(("q1", "q2"), RAD),), "q_ref": (Signal(("q1_ref", "q2_ref"), RAD),), "tau": (Signal(("u1", "u2")),)}
    return Answer("log.csv", {"pc_time_s": "s", "arduino_ms": "ms"}, right=right, draftable=False)
