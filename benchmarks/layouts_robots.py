"""Write one simulated motion as ROS tools, controllers and common recorders export it (see
import_layouts).
"""

import json
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.io import savemat

from benchmarks.import_layouts import (
    DEG,
    NM,
    RAD,
    RADS,
    UNITS,
    Answer,
    Signal,
    anywhere,
    block,
    csv,
    current,
    layout,
    names,
    recorded,
    values,
    wide,
)
from benchmarks.recorded_arm import ELEVEN, IIWA, LIFT, PANDA, SIX, THREE, UR, Run


@layout(UR)
def rostopic_echo(folder: Path, run: Run) -> Answer:
    """ROS 1 `rostopic echo -p /joint_states`: %time in ns, names as text cells, alphabetical order.

    Header after jmscslgroup/catvehicle issue 9; the UR driver publishes elbow, lift, pan, wrists.
    """
    order = [2, 1, 0, 3, 4, 5]
    stamp = (1.6e18 + run.t * 1e9).astype(np.int64)
    head = {"%time": stamp, "field.header.seq": np.arange(len(stamp))}
    head |= {"field.header.stamp": stamp - 1000, "field.header.frame_id": ""}
    head |= {f"field.name{k}": run.arm.joints[j] for k, j in enumerate(order)}
    specs = "*field.position{}=q; *field.velocity{}=dq; *field.effort{}=tau"
    columns, right = wide(run, specs, [order.index(j) for j in range(6)])
    parts = [f"field.{f}{k}" for f in ("position", "velocity", "effort") for k in range(6)]
    table = head | {name: columns[name] for name in parts}
    csv(folder / "joint_states.csv", table, float_format="%.12f")
    return Answer("joint_states.csv", {"%time": "ns", "field.header.stamp": "ns"}, right=right)


@layout(UR)
def plotjuggler(folder: Path, run: Run) -> Answer:
    """PlotJuggler's CSV of all curves: __time, one column a joint and field, sorted; a gripper."""
    at = "/joint_states/"
    specs = (
        f"{at}header/stamp=stamp; *{at}{{}}/position=q; *{at}{{}}/velocity=dq; "
        f"*{at}{{}}/effort=tau; "
    )
    specs += (
        f"{at}finger_joint/position=grip; {at}finger_joint/velocity=still; "
        f"{at}finger_joint/effort=force"
    )
    still = 0.0 * run.t
    more = {
        "stamp": 1.7e9 + run.t - 0.001,
        "grip": still + 0.2,
        "still": still,
        "force": still + 0.4,
    }
    columns, right = wide(run, specs, run.arm.joints, **more)
    csv(folder / "curves.csv", {"__time": 1.7e9 + run.t} | dict(sorted(columns.items())))
    return Answer("curves.csv", {"__time": "s", "/joint_states/header/stamp": "s"}, right=right)


@layout(UR, rate=100.0)
def rosbag_long_table(folder: Path, run: Run) -> Answer:
    """Write a rosbag flattened to one row per joint: time_s, joint, position, velocity, effort.

    As gianmarco-ferrara/RL2025HW02 plot/db3TOcsv_position.py writes it with rosbags and pandas.
    """
    order = [2, 1, 0, 3, 4, 5]
    table = {"time_s": np.repeat(1.7e9 + run.t, run.n)}
    table |= {"joint": [run.arm.joints[j] for j in order] * len(run.t)}
    for field, v in (("position", run.q), ("velocity", run.dq), ("effort", run.tau)):
        table[field] = v[:, order].ravel()
    csv(folder / "joint_states_converted.csv", table)
    right = anywhere(q=RAD, dq=RADS, tau=NM)
    return Answer("joint_states_converted.csv", right=right, texts=False)


@layout(UR)
def ur_own_logger(folder: Path, run: Run) -> Answer:
    """UR5e logger on rtde_receive: tq_ is the *target* q, no torque at all, a TCP force.

    Columns after MingyuTang0728/Universal-Robots-Notts CSV_READER.py.
    """
    specs = (
        "pc_ts=stamp; runtime_state=2; robot_mode=7; safety_mode=1; speed_scaling=1.000000; "
        "din_bits=0; "
    )
    specs += (
        "dout_bits=0; ai0=0.013000; ai1=0.021000; *q_{}=q; *qd_{}=dq; *tq_{}=q_ref; *tqd_{}=dq_ref;"
        " "
    )
    specs += "tcp_{}=pose; tcps_{}=slow; tcpf_{}=force"
    more = {"pose": run.pose, "slow": 0.3 * run.pose, "force": 5 + run.tau_ext}
    return recorded(
        folder,
        run,
        "UR5e_motion_full.csv",
        {"pc_ts": "s"},
        specs,
        range(6),
        data={"stamp": 1.71e9 + run.t, **more},
    )


@layout(PANDA, rate=1000.0)
def libfranka_log(folder: Path, run: Run) -> Answer:
    """libfranka's logToCSV (src/log.cpp): ms, state.*, cmd.*, blanks after commas; fingers."""
    specs = (
        "time=tick; success_rate=1.000000; *state.q[{}]=q; *state.q_d[{}]=q_ref; *state.dq[{}]=dq; "
    )
    specs += "*state.dq_d[{}]=dq_ref; *state.tau_J[{}]=tau; state.tau_ext_hat_filtered[{}]=ext; "
    specs += "cmd.q_d[{}]=zero; cmd.dq_d[{}]=zero"
    tick, zero = np.round(run.t * 1000).astype(int), 0 * run.q
    columns, right = wide(run, specs, range(7), tick=tick, zero=zero)
    columns |= block("cmd.O_T_EE_d[{}]", np.zeros((len(run.t), 16)), 0)
    columns |= block("cmd.O_dP_EE_d[{}]", np.zeros((len(run.t), 6)), 0)
    columns |= block("cmd.tau_J_d[{}]", run.tau_ref, 0)
    first = ("time", "[0]")  # a blank follows each comma within a block
    csv(folder / "log.csv", {n if n.endswith(first) else f" {n}": v for n, v in columns.items()})
    right["tau"] += (Signal(names("cmd.tau_J_d[{}]", 7, 0), NM, run.tau_ref),)
    return Answer("log.csv", {"time": "ms"}, right=right)


@layout(SIX, robot=None, rate=250.0)
def kuka_trace(folder: Path, run: Run) -> Answer:
    """KUKA trace as tab-separated Latin-1 text: programmed, real and difference values, K and A.

    Signals after the "Robot data from the body shop" data set (NextGenDrive, 4 ms).
    """
    specs = (
        "Time [ms]=ms; *Programmed Axis Position A{} [°]=q_ref°; *Real Axis Position A{} [°]=q°; "
    )
    specs += "Difference Axis Position A{} [°]=lag; *Programmed Axis Velocity A{} [°/s]=dq_ref°; "
    specs += "*Real Axis Velocity A{} [°/s]=dq°; Calculated Axis Moment A{} [Nm]=model; "
    specs += "*Real Axis Moment A{} [Nm]=tau; Difference Axis Moment A{} [Nm]=rest; "
    specs += "Motor Temperature A{} [K]=kelvin; Axis Current A{} [A]=amps"
    more = {"lag": np.degrees(run.q_ref - run.q), "model": run.tau_model}
    more |= {"rest": run.tau - run.tau_model, "kelvin": run.temperature + 273.15}
    columns, right = wide(run, specs, **more)
    csv(folder / "trace.txt", columns, sep="\t", encoding="latin-1", lineterminator="\r\n")
    right["current"] = (Signal(names("Axis Current A{} [A]", 6), ("A",)),)
    return Answer("trace.txt", {"Time [ms]": "ms"}, right=right, torque=("measured",))


@layout(IIWA)
def kuka_sunrise_recorder(folder: Path, run: Run) -> Answer:
    """KUKA Sunrise DataRecorder: clock in two columns, blanks, external torque first, degrees.

    Header as read by a public replay script (axisQMsr_LBR_iiwa_7_R800_1[0], degrees, '%' comments).
    """
    ns = (1.66e18 + run.t * 1e9).astype(np.int64)
    of = "_LBR_iiwa_7_R800_1[{}]"
    specs = f"ZeitInSec=s; ZeitInNanoSec=ns; axisTauExtMsr{of}=ext; *axisTauMsr{of}=tau; "
    specs += f"*axisQMsr{of}=q°; *axisQCmd{of}=q_ref°"
    columns, right = wide(run, specs, range(7), s=ns // 10**9, ns=ns % 10**9)
    for k, axis in enumerate("XYZ"):
        columns[f"cartForce1_{axis}"] = run.tau_ext[:, k]
        columns[f"cartTorque1_Tau{axis}"] = 0.1 * run.tau_ext[:, k + 3]
    file = "2024-03-01_10-11-12.log"
    csv(folder / file, columns, sep=" ")
    clock = {"ZeitInSec+ZeitInNanoSec": "s+ns"}
    return Answer(file, clock, right=right, torque=("measured",))


@layout(SIX)
def doosan_realtime(folder: Path, run: Run) -> Answer:
    """Doosan real-time data list (manual.doosanrobotics.com): two encoders, units in a row."""
    specs = "time_stamp=stamp; *actual_joint_position_{}=q°; actual_joint_position_abs_{}=second; "
    specs += (
        "*actual_joint_velocity_{}=dq°; actual_tcp_position_{}=pose; external_joint_torque_{}=ext; "
    )
    specs += (
        "*actual_motor_torque_{}=tau; raw_joint_torque_{}=tau; *target_joint_position_{}=q_ref°"
    )
    more = {"second": np.degrees(run.q) + 1e-3, "pose": 300 * run.pose, "stamp": run.t + 812.4}
    columns, right = wide(run, specs, range(6), **more)
    units = ["s"]
    for unit in ("deg", "deg", "deg/s", "mm", "Nm", "Nm", "Nm", "deg"):
        units += [unit] * 6
    csv(folder / "rt.csv", columns, ",".join(columns) + "\n" + ",".join(units) + "\n", header=False)
    right["q"] += (Signal(names("actual_joint_position_abs_{}", 6, 0), DEG),)
    right["tau"] += (Signal(names("raw_joint_torque_{}", 6, 0), NM),)
    return Answer("rt.csv", {"time_stamp": "s"}, right=right)


@layout(THREE, robot=None)
def twincat_scope(folder: Path, run: Run) -> Answer:
    """TwinCAT Scope's CSV export: tabs, decimal commas, a header and a clock for each channel.

    After infosys.beckhoff.com tcscope2 "Export to CSV"; torque in 0.1 % of the rated torque: no
    unit can be known.
    """
    specs = "*GVL_Axes.axis{}.NcToPlc.ActPos=q°; *GVL_Axes.axis{}.NcToPlc.ActVelo=dq°; "
    specs += "*GVL_Axes.axis{}.Drive.nActTorque=load:tau:?"
    load = np.round(1000 * run.tau / np.array(run.arm.effort))
    channels, right = wide(run, specs, joint_wise=True, load=load)
    rows = [("Name", "Scope Project"), ("File", "C:\\Scope\\arm.tcscopex")]
    rows += [("StartRecord", "132537830932236900"), ("EndRecord", "132537831052236900"), ()]
    head = {"Name": [c.rsplit(".", 2)[1] + c.rsplit(".")[-1] for c in channels]}
    head |= {"SymbolName": list(channels), "NetId": ["5.20.1.6.1.1"] * 9, "Port": ["851"] * 9}
    head |= {"SampleTime[ms]": ["5"] * 9, "Data-Type": ["LREAL"] * 9, "": [""] * 9}
    rows += [tuple(cell for v in values for cell in (key, v)) for key, values in head.items()]
    for t, numbers in zip(run.t, zip(*channels.values(), strict=True), strict=True):
        texts = (f"{x:.5f}".replace(".", ",") for x in numbers)
        rows.append(tuple(cell for x in texts for cell in (f"{1000 * t:g}", x)))
    (folder / "scope.csv").write_text("\n".join("\t".join(r) for r in rows) + "\nEOF\n")
    return Answer("scope.csv", {"SymbolName": "ms"}, right=right, draftable=False)


@layout(THREE, robot="robot.toml")
def labview_lvm(folder: Path, run: Run) -> Answer:
    """LabVIEW measurement file (.lvm, NI specification): header blocks, tabs, decimal commas."""
    end = "***End_of_Header***\t"
    head = "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\n"
    head += "Decimal_Separator\t,\nMulti_Headings\tNo\nX_Columns\tOne\nTime_Pref\tRelative\n"
    head += f"Operator\tlab\nDate\t2023/05/04\nTime\t14:03:21,5\n{end}\n\nChannels\t6\t\t\t\t\t\t\n"
    head += "Samples" + f"\t{len(run.t)}" * 6 + "\t\nY_Unit_Label" + "\tdeg" * 3 + "\tN m" * 3
    head += "\t\nX_Dimension" + "\tTime" * 6 + "\t\nX0" + "\t0,0E+0" * 6
    head += "\t\nDelta_X" + "\t0,005" * 6 + f"\t\n{end}\t\t\t\t\t\t\n"
    return recorded(
        folder,
        run,
        "run.lvm",
        {"X_Value": "s"},
        "X_Value=t; *Pos_J{}=q°; *Torque_J{}=tau; Comment=",
        head=head,
        sep="\t",
        decimal=",",
    )


@layout(THREE, robot="robot.toml")
def simulink_structure(folder: Path, run: Run) -> Answer:
    """Simulink To Workspace, "Structure With Time", saved to MAT: one structure a block."""

    def structure(values: np.ndarray, label: str) -> dict[str, object]:
        signals = {"values": values, "dimensions": 3.0, "label": label}
        return {"time": run.t[:, None], "signals": signals, "blockName": f"model/{label}"}

    blocks: dict = {"q_meas": structure(run.q, "q"), "q_des": structure(run.q_ref, "qd")}
    savemat(folder / "run.mat", blocks | {"tau_cmd": structure(run.tau_ref, "tau"), "Ts": 0.005})
    right = anywhere(q=RAD, q_ref=RAD) | {"tau": (Signal((), NM, run.tau_ref),)}
    return Answer("run.mat", rate=200.0, right=right, texts=False)


@layout(THREE, robot="robot.toml")
def matlab_transposed(folder: Path, run: Run) -> Answer:
    """MATLAB script results: t (1 x N), q, qd, qdd, tau (n x N), with gains and a name."""
    data = {"t": run.t[None], "q": run.q.T, "qd": run.dq.T, "qdd": run.ddq.T, "tau": run.tau.T}
    gains = {"Kp": np.diag([900.0, 700.0, 300.0]), "Kd": np.diag([60.0, 40.0, 9.0])}
    savemat(folder / "results.mat", data | gains | {"robot": "rrr"})
    right = anywhere(q=RAD, dq=RADS, tau=NM, ddq=UNITS["ddq"])
    return Answer("results.mat", rate=200.0, right=right, texts=False)


STATE = "t=t; *q{}=q; *tau{}=tau"


def numbered(roles: dict[str, int], n: int, form: str = "column_{}", step: int = 1) -> dict:
    """State columns that have numbers for names: role -> the first one's number."""
    return {
        role: (Signal(tuple(form.format(first + step * j) for j in range(n)), UNITS[role]),)
        for role, first in roles.items()
    }


@layout(UR, rate=125.0)
def ur_rtde(folder: Path, run: Run) -> Answer:
    """RTDE_Python_Client_Library record.py: blanks between, target and actual of everything."""
    specs = "timestamp=now; *target_q_{}=q_ref; *target_qd_{}=dq_ref; target_current_{}=goal; "
    specs += (
        "target_moment_{}=model; *actual_q_{}=q; *actual_qd_{}=dq; *actual_current_{}=current; "
    )
    specs += (
        "joint_control_output_{}=goal; actual_TCP_pose_{}=pose; joint_temperatures_{}=temp; "
        "robot_mode=7"
    )
    more = {
        "now": 3211.5 + run.t,
        "goal": 1.02 * current(run),
        "model": run.tau_model,
        "pose": run.pose,
    }
    return recorded(
        folder, run, "run.csv", {"timestamp": "s"}, specs, range(6), data=more, known=False, sep=" "
    )


@layout(UR, robot=None, rate=125.0)
def ur_currents_only(folder: Path, run: Run) -> Answer:
    """Write a UR log of positions and currents, without a robot in the folder."""
    specs = "timestamp=now; *actual_q_{}=q; *actual_current_{}=current"
    more = {"now": 3211.5 + run.t}
    return recorded(
        folder, run, "run.csv", {"timestamp": "s"}, specs, range(6), data=more, known=False
    )


@layout(IIWA, rate=1000.0)
def panda_py(folder: Path, run: Run) -> Answer:
    """panda_py's log through pandas: an index column without a name, stamps in ms."""
    more = {"now": 88000 + values(run)["ms"]}
    specs = "=count; time=now; *q_{}=q; *dq_{}=dq; *tau_{}=tau"
    return recorded(folder, run, "run.csv", {"time": "ms"}, specs, range(7), data=more)


@layout(PANDA, rate=100.0)
def panda_with_fingers(folder: Path, run: Run) -> Answer:
    """Joint states of an arm and its gripper beside a URDF with both."""
    specs = "t=t; *{}_position=q; *{}_effort=tau; panda_finger_joint1_position=0.02; "
    specs += (
        "panda_finger_joint2_position=0.02; panda_finger_joint1_effort=0; "
        "panda_finger_joint2_effort=0"
    )
    return recorded(folder, run, "run.csv", {"t": "s"}, specs, run.arm.joints)


@layout(SIX, rate=250.0)
def kuka_rsi(folder: Path, run: Run) -> Answer:
    """KUKA RSI: degrees, IPOC as the clock, Cartesian beside axis positions, motor currents in
    A.
    """
    specs = "IPOC=now; RIst.X=x; RIst.Y=y; RIst.Z=z; RIst.A=rx; RIst.B=ry; RIst.C=rz; "
    specs += "*AIPos.A{}=q°; *ASPos.A{}=q_ref°; *MACur.A{}=current"
    more = {"now": 4208163 + values(run)["ms"]}
    return recorded(folder, run, "run.csv", {"IPOC": "ms"}, specs, data=more, known=False, sep=";")


@layout(UR, rate=500.0)
def matlab_writematrix(folder: Path, run: Run) -> Answer:
    """writematrix([t q dq tau]): no header."""
    np.savetxt(folder / "run.txt", np.column_stack([run.t, run.q, run.dq, run.tau]), delimiter=",")
    right = numbered({"q": 2, "dq": 8, "tau": 14}, 6)
    return Answer("run.txt", {"column_1": "s"}, right=right)


@layout(UR, rate=500.0)
def matlab_struct(folder: Path, run: Run) -> Answer:
    """Write a MAT file with a structure of N x 6 arrays."""
    data = {"t": run.t[:, None], "q": run.q, "qd": run.dq, "tau": run.tau, "q_ref": run.q_ref}
    savemat(folder / "run.mat", {"data": data})
    right = numbered({"q": 1, "q_ref": 1, "tau": 1}, 6)
    right = {k: (Signal(tuple(f"data.{k}_{j}" for j in range(1, 7)), UNITS[k]),) for k in right}
    right["dq"] = (Signal(names("data.qd_{}", 6), UNITS["dq"]),)
    return Answer("run.mat", {"data.t": "s"}, right=right)


@layout(UR, rate=30.0)
def json_frames(folder: Path, run: Run) -> Answer:
    """Write a data set of robot learning: a list of frames with observation.state and action."""
    parts = {"observation.state": run.q, "observation.effort": run.tau, "action": run.q_ref}
    frames = [
        {"timestamp": float(t), "frame_index": k}
        | {name: v[k].tolist() for name, v in parts.items()}
        for k, t in enumerate(run.t)
    ]
    (folder / "run.json").write_text(json.dumps(frames))
    roles = (("q", "observation.state"), ("tau", "observation.effort"), ("q_ref", "action"))
    right = {role: (Signal(names(name + "[{}]", 6, 0), UNITS[role]),) for role, name in roles}
    return Answer("run.json", {"timestamp": "s"}, right=right)


@layout(UR, rate=100.0)
def json_arrays(folder: Path, run: Run) -> Answer:
    """Arrays by name under a key."""
    data = {"time": run.t, "q": run.q, "dq": run.dq, "tau": run.tau}
    body = {"meta": {"robot": "ur5"}, "data": {name: v.tolist() for name, v in data.items()}}
    (folder / "run.json").write_text(json.dumps(body))
    return Answer("run.json", right=anywhere(q=RAD, dq=RADS, tau=NM), texts=False)


@layout(UR, rate=100.0)
def json_lines_by_name(folder: Path, run: Run) -> Answer:
    """One object a line, joints by name, in alphabetical order."""
    lines = []
    for k, t in enumerate(run.t.tolist()):
        stamp = {"sec": 1_700_000_000 + int(t), "nanosec": round((t % 1.0) * 1e9)}
        parts = (("pos", run.q), ("vel", run.dq), ("eff", run.tau))
        joints = {
            name: {part: v[k, run.arm.joints.index(name)] for part, v in parts}
            for name in sorted(run.arm.joints)
        }
        lines.append(json.dumps({"stamp": stamp, "joints": joints}))
    (folder / "run.jsonl").write_text("\n".join(lines) + "\n")
    roles = (("q", "pos"), ("dq", "vel"), ("tau", "eff"))
    right = {
        r: (Signal(tuple(f"joints.{j}.{p}" for j in run.arm.joints), UNITS[r]),) for r, p in roles
    }
    return Answer("run.jsonl", {"stamp.sec+stamp.nanosec": "s+ns"}, right=right)


@layout(THREE, robot=None, rate=100.0)
def r_write_table(folder: Path, run: Run) -> Answer:
    """R's write.table: the rows' numbers have no name."""
    columns, right = wide(run, STATE)
    rows = pd.DataFrame(columns, index=np.arange(len(run.t)) + 1)
    text = " ".join(f'"{name}"' for name in columns) + "\n"
    (folder / "run.txt").write_text(text + rows.to_csv(sep=" ", header=False))
    return Answer("run.txt", {"t": "s"}, right=right)


@layout(UR, rate=100.0)
def savetxt_header(folder: Path, run: Run) -> Answer:
    """numpy.savetxt with header="t, q1, …": commas in a comment above blanks."""
    columns, right = wide(run, "t=t; *q{}=q; *dq{}=dq; *tau{}=tau")
    np.savetxt(
        folder / "run.txt", np.column_stack(list(columns.values())), header=", ".join(columns)
    )
    return Answer("run.txt", {"t": "s"}, right=right)


@layout(UR, rate=100.0)
def percent_header_units(folder: Path, run: Run) -> Answer:
    """Names and units in two comments."""
    columns, right = wide(run, "t=t; *q{}=q°; *M{}=tau")
    units = " ".join(["s", *["deg"] * 6, *["Nm"] * 6])
    header = f"recorded on Monday by hand\n{' '.join(columns)}\n{units}"
    data = np.column_stack(list(columns.values()))
    np.savetxt(folder / "run.txt", data, header=header, comments="% ")
    return Answer("run.txt", {"t": "s"}, right=right)


@layout(UR, rate=100.0)
def transposed_named(folder: Path, run: Run) -> Answer:
    """One line a signal, its name before the numbers."""
    columns, right = wide(run, STATE)
    pd.DataFrame(columns).T.to_csv(folder / "run.csv", header=False)
    return Answer("run.csv", {"t": "s"}, right=right)


@layout(UR, rate=100.0)
def transposed_bare(folder: Path, run: Run) -> Answer:
    """writematrix of 19 x N."""
    np.savetxt(
        folder / "run.csv", np.column_stack([run.t, run.q, run.dq, run.tau]).T, delimiter=","
    )
    right = numbered({"q": 2, "dq": 8, "tau": 14}, 6)
    return Answer("run.csv", {"column_1": "s"}, right=right, texts=False)


@layout(UR, rate=100.0)
def headerless_without_velocity(folder: Path, run: Run) -> Answer:
    """t, q, tau without names: only a person knows which block is which."""
    np.savetxt(folder / "run.csv", np.column_stack([run.t, run.q, run.tau]), delimiter=",")
    right = numbered({"q": 2, "tau": 8}, 6)
    return Answer("run.csv", {"column_1": "s"}, right=right, draftable=False)


@layout(THREE, robot=None, rate=500.0)
def headerless_interleaved(folder: Path, run: Run) -> Answer:
    """q1 dq1 tau1 q2 dq2 tau2 …, no clock, no robot."""
    data = np.stack([run.q, run.dq, run.tau], axis=2).reshape(len(run.t), 9)
    np.savetxt(folder / "run.txt", data)
    right = numbered({"q": 1, "dq": 2, "tau": 3}, 3, step=3)
    return Answer("run.txt", rate=500.0, right=right, draftable=False)


@layout(UR, rate=100.0)
def headerless_two_references(folder: Path, run: Run) -> Answer:
    """q, q_ref, dq, tau without names: measured and reference look alike."""
    data = np.column_stack([run.t, run.q_ref, run.q, run.dq, run.tau])
    np.savetxt(folder / "run.csv", data, delimiter=",")
    right = numbered({"q": 8, "dq": 14, "tau": 20}, 6)
    return Answer("run.csv", {"column_1": "s"}, right=right, draftable=False)


@layout(UR, rate=100.0)
def time_sec_nsec(folder: Path, run: Run) -> Answer:
    """time_sec and time_nsec, torques called effort, references beside."""
    us = values(run)["us"]
    more = {"s": 100 + us // 10**6, "ns": us % 10**6 * 1000}
    specs = (
        "time_sec=s; time_nsec=ns; *pos_des_{}=q_ref; *pos_{}=q; *vel_{}=dq; *eff_{}=tau; "
        "eff_des_{}=tau_ref"
    )
    return recorded(folder, run, "run.csv", {"time_sec+time_nsec": "s+ns"}, specs, data=more)


@layout(THREE, robot=None, rate=500.0)
def microseconds(folder: Path, run: Run) -> Answer:
    """Write a microcontroller: micros() as "us", currents in mA, a status text."""
    more = {"now": 5_000_000 + values(run)["us"], "mA": 1000 * current(run)}
    specs = "us=now; state=RUN; *pos_rad_{}=q; *current_mA_{}=mA:current:mA"
    return recorded(folder, run, "run.csv", {"us": "us"}, specs, data=more, known=False)


@layout(UR, rate=500.0)
def sample_index(folder: Path, run: Run) -> Answer:
    """Write a counter instead of a clock."""
    return recorded(
        folder, run, "run.csv", {"sample": "sample"}, STATE.replace("t=t", "sample=count", 1)
    )


@layout(UR, rate=500.0)
def time_that_counts(folder: Path, run: Run) -> Answer:
    """Write a column t that counts 0, 1, 2 at 500 Hz: ms and samples look alike."""
    return recorded(folder, run, "run.csv", {"t": "sample"}, STATE.replace("t=t", "t=count", 1))


@layout(UR, rate=100.0)
def clock_times(folder: Path, run: Run) -> Answer:
    """Date and time as text, over midnight."""
    times = pd.Timestamp("2024-05-17 23:59:56") + pd.to_timedelta(values(run)["ms"], unit="ms")
    more = {"now": times.strftime("%Y-%m-%d %H:%M:%S.%f").str[:-3].to_numpy()}
    return recorded(
        folder,
        run,
        "run.csv",
        {"timestamp": "*"},
        STATE.replace("t=t", "timestamp=now", 1),
        data=more,
    )


@layout(UR, rate=100.0)
def names_in_front(folder: Path, run: Run) -> Answer:
    """pos_elbow, pos_shoulder_lift, …: the robot's names without "joint", in another order."""
    short = [name.removesuffix("_joint") for name in run.arm.joints]
    columns, right = wide(run, "*pos_{}=q; *torque_{}=tau", short)
    csv(folder / "run.csv", {"time_s": run.t} | dict(sorted(columns.items())))
    return Answer("run.csv", {"time_s": "s"}, right=right)


@layout(UR, robot=None, rate=100.0)
def names_without_robot(folder: Path, run: Run) -> Answer:
    """Joints by name in alphabetical order with no robot beside: the order is a person's to
    know.
    """
    columns, right = wide(run, "*{}.pos=q; *{}.torque=tau", run.arm.joints)
    csv(folder / "run.csv", {"t": run.t} | dict(sorted(columns.items())))
    return Answer("run.csv", {"t": "s"}, right=right, draftable=False)


@layout(LIFT, rate=100.0)
def lift_and_arm(folder: Path, run: Run) -> Answer:
    """Write an arm on a lift: the first joint slides, its columns in mm and N."""
    heads = ["lift_joint_pos [mm]", *(f"joint_{j}_pos [rad]" for j in (1, 2, 3))]
    loads = ["lift_joint_force [N]", *(f"joint_{j}_torque [Nm]" for j in (1, 2, 3))]
    columns = {"t [s]": run.t} | dict(zip(heads, (run.q * [1000, 1, 1, 1]).T, strict=True))
    csv(folder / "run.csv", columns | dict(zip(loads, run.tau.T, strict=True)))
    right = {"q": (Signal(tuple(heads), ("mm,rad,rad,rad",)),)}
    right["tau"] = (Signal(tuple(loads), ("N,N m,N m,N m",)),)
    return Answer("run.csv", {"t [s]": "s"}, right=right)


@layout(UR, robot=None, rate=100.0)
def two_robots_beside(folder: Path, run: Run) -> Answer:
    """Two URDFs in the folder: which one is a person's to say."""
    for name in ("a", "b"):
        (folder / f"{name}.urdf").write_text(run.arm.urdf())
    return recorded(folder, run, "run.csv", {"t": "s"}, STATE, known=False)


@layout(UR, rate=500.0)
def two_files(folder: Path, run: Run) -> Answer:
    """Positions in one file, torques in another, joints as columns."""
    for part, v in (("positions", run.q), ("torques", run.tau)):
        csv(folder / f"joint_{part}.csv", block("joint_{}", v))
    right = {r: (Signal(names("joint_{}", 6), UNITS[r]),) for r in ("q", "tau")}
    return Answer("joint_positions.csv", rate=500.0, right=right, draftable=False)


@layout(UR, rate=500.0)
def command_only(folder: Path, run: Run) -> Answer:
    """Only the commanded torque was recorded."""
    specs = "time=t; *joint_positions_{}=q; *joint_velocities_{}=dq; *commanded_torques_{}=tau"
    return recorded(folder, run, "run.csv", {"time": "s"}, specs, range(6))


@layout(ELEVEN, rate=500.0)
def trailing_comma(folder: Path, run: Run) -> Answer:
    """Rows end in a comma that the header lacks; joints count past 9 as texts would sort."""
    columns, right = wide(run, STATE)
    text = (
        ",".join(columns)
        + "\n"
        + pd.DataFrame(columns).to_csv(header=False, index=False).replace("\n", ",\n")
    )
    (folder / "run.csv").write_text(text)
    return Answer("run.csv", {"t": "s"}, right=right)
