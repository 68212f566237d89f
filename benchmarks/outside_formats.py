"""Write one simulated motion as ROS tools and controllers export it, each with its right answer.

The arms, and what the other sets share: `wide` makes the columns of a table and what is true of
them from one text (see outside_layouts for what an answer is).
"""

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.io import savemat

from benchmarks.import_layouts import UR as UR_JOINTS
from benchmarks.outside_layouts import Answer, Arm, Run, Signal, layout

UR = Arm("ur5", UR_JOINTS, "zyyyzy", (150, 150, 150, 28, 28, 28))
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

UNITS = {"q": RAD, "q_ref": RAD, "dq": RADS, "tau": NM, "current": ("A",), "%": ("%",)}
UNITS |= {"q°": DEG, "q_ref°": DEG, "dq°": DEGS, "counts": ("counts",), "counts/s": ("counts/s",)}
UNITS |= {"dq_ref": RADS, "dq_ref°": DEGS, "ddq": ("rad/s^2",), "tau_ref": NM, "N mm": ("N mm",)}
UNITS |= {"rev": ("turn", "turns", "rev"), "rev/s": ("turn/s", "turns/s", "rev/s"), "?": ()}
UNITS |= {"mrad": ("mrad",), "mNm": ("mN m", "mNm", "N mm"), "0.1 %": ("0.1 %",), "rpm": ("rpm",)}


def block(pattern: str, values: np.ndarray, start: int = 1) -> dict[str, np.ndarray]:
    """Return columns named after a pattern with {}, one a joint."""
    return {pattern.format(start + j): column for j, column in enumerate(values.T)}


def names(pattern: str, n: int, start: int = 1) -> tuple[str, ...]:
    return tuple(pattern.format(start + j) for j in range(n))


def csv(path: Path, columns: dict, head: str = "", **how: object) -> None:
    """Write a table, below `head` as it stands."""
    encoding = str(how.pop("encoding", "utf-8"))
    how = {"index": False, "float_format": "%.6f", **how}
    path.write_bytes((head + pd.DataFrame(columns).to_csv(**how)).encode(encoding))


table = partial(csv, float_format=None)


def current(run: Run) -> np.ndarray:
    """Motor currents, with noise, by torque constants that no file states."""
    dice = np.random.default_rng(abs(int(1e6 * float(np.sum(run.q)))) % 2**32)
    constant = dice.uniform(5, 15, run.q.shape[1])
    return run.tau / constant * (1 + 0.02 * dice.standard_normal(run.q.shape))


def values(run: Run) -> dict[str, np.ndarray]:
    """What a layout may write: the motion, its times, and a tool pose [mm, rad] that follows it."""
    a, b = run.q[:, 0], run.q[:, 1]
    data = {"q": run.q, "dq": run.dq, "tau": run.tau, "q_ref": run.q_ref, "ext": run.tau_ext}
    data |= {"ddq": run.ddq, "dq_ref": run.dq_ref, "tau_ref": run.tau_ref, "amps": run.current}
    data |= {f"{s}°": np.degrees(data[s]) for s in ("q", "dq", "q_ref", "dq_ref")}
    data |= {"current": current(run), "temp": run.temperature, "t": run.t}
    data |= {"count": np.arange(len(run.t)), "us": np.round(run.t * 1e6).astype(np.int64)}
    data |= {"ms": np.round(run.t * 1e3).astype(np.int64), "x": 400 + 200 * np.cos(a)}
    data |= {"y": 300 * np.sin(a), "z": 500 + 100 * np.sin(b), "rx": 3.1 + 0.02 * b}
    return data | {"ry": 0.05 * a, "rz": 0.3 * a + 0.1 * b}


def anywhere(**units: tuple[str, ...]) -> dict:
    """State units alone, of columns whose names are not compared."""
    return {role: (Signal((), unit),) for role, unit in units.items()}


def state(right: dict, form: str, joints, spec: str) -> None:
    """Add a right answer "role" or "role:unit" for the columns of a form. A current (or share of
    a rated torque) is all that is known of torque, so it may stand under either."""
    role, _, unit = spec.partition(":")
    columns = tuple(form.replace("{}", str(j)) for j in joints)
    units = UNITS[unit or role]
    signal = Signal(columns, units) if units else Signal(columns)
    for name in ("current", "tau") if role == "current" else (role.rstrip("°"),):
        right[name] = (signal,)


def wide(run: Run, specs: str, joints=None, joint_wise: bool = False, **more) -> tuple[dict, dict]:
    """Make columns, and the right answer, of "name=value; name{}=value; *name{}=value:role:unit":
    {} is a joint (consecutive specs with it are interleaved if `joint_wise`), * marks what is
    true (its role is the value's name unless given), a value without array is a constant."""
    data, columns, right = values(run) | more, {}, {}
    joints = range(1, run.q.shape[1] + 1) if joints is None else joints
    groups: list[list[tuple[str, str]]] = []
    for spec in specs.split(";"):
        name, _, value = spec.strip().rpartition("=")
        key, _, truth = value.partition(":")
        if name.startswith("*"):
            name = name[1:]
            state(right, name, joints, truth or key)
        if joint_wise and "{}" in name and groups and "{}" in groups[-1][-1][0]:
            groups[-1].append((name, key))
        else:
            groups.append([(name, key)])
    for specs_of_group in groups:
        for k, j in enumerate(joints if "{}" in specs_of_group[0][0] else [""]):
            for name, key in specs_of_group:
                v = data.get(key, key)
                matrix = isinstance(v, np.ndarray) and v.ndim == 2
                columns[name.replace("{}", str(j))] = v[:, k] if matrix else v
    return columns, right


def stamps(run: Run, form: str) -> np.ndarray:
    """Dates of the samples as text."""
    times = pd.Timestamp("2024-05-03 14:02:11.25") + pd.to_timedelta(values(run)["us"], unit="us")
    return times.strftime(form).to_numpy()


def vector(numbers: np.ndarray) -> str:
    """Write numbers between commas."""
    return ", ".join(f"{x:.6f}" for x in numbers)


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
    specs = f"{at}header/stamp=stamp; *{at}{{}}/position=q; *{at}{{}}/velocity=dq; *{at}{{}}/effort=tau; "
    specs += f"{at}finger_joint/position=grip; {at}finger_joint/velocity=still; {at}finger_joint/effort=force"
    still = 0.0 * run.t
    more = {"stamp": 1.7e9 + run.t - 0.001, "grip": still + 0.2, "still": still, "force": still + 0.4}
    columns, right = wide(run, specs, run.arm.joints, **more)
    csv(folder / "curves.csv", {"__time": 1.7e9 + run.t} | dict(sorted(columns.items())))
    return Answer("curves.csv", {"__time": "s", "/joint_states/header/stamp": "s"}, right=right)


@layout(UR, rate=100.0)
def rosbag_long_table(folder: Path, run: Run) -> Answer:
    """A rosbag flattened to one row per joint: time_s, joint, position, velocity, effort.

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
    specs = "pc_ts=stamp; runtime_state=2; robot_mode=7; safety_mode=1; speed_scaling=1.000000; din_bits=0; "
    specs += "dout_bits=0; ai0=0.013000; ai1=0.021000; *q_{}=q; *qd_{}=dq; *tq_{}=q_ref; *tqd_{}=dq_ref; "
    specs += "tcp_{}=pose; tcps_{}=slow; tcpf_{}=force"
    more = {"pose": run.pose, "slow": 0.3 * run.pose, "force": 5 + run.tau_ext}
    columns, right = wide(run, specs, range(6), stamp=1.71e9 + run.t, **more)
    csv(folder / "UR5e_motion_full.csv", columns)
    return Answer("UR5e_motion_full.csv", {"pc_ts": "s"}, right=right)


@layout(PANDA, rate=1000.0)
def libfranka_log(folder: Path, run: Run) -> Answer:
    """libfranka's logToCSV (src/log.cpp): ms, state.*, cmd.*, blanks after commas; fingers."""
    specs = "time=tick; success_rate=1.000000; *state.q[{}]=q; *state.q_d[{}]=q_ref; *state.dq[{}]=dq; "
    specs += "*state.dq_d[{}]=dq_ref; *state.tau_J[{}]=tau; state.tau_ext_hat_filtered[{}]=ext; "
    specs += "cmd.q_d[{}]=zero; cmd.dq_d[{}]=zero"
    tick, zero = (run.t * 1000).astype(int), 0 * run.q
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
    specs = "Time [ms]=ms; *Programmed Axis Position A{} [°]=q_ref°; *Real Axis Position A{} [°]=q°; "
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
    specs += "*actual_joint_velocity_{}=dq°; actual_tcp_position_{}=pose; external_joint_torque_{}=ext; "
    specs += "*actual_motor_torque_{}=tau; raw_joint_torque_{}=tau; *target_joint_position_{}=q_ref°"
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
    columns, right = wide(run, "X_Value=t; *Pos_J{}=q°; *Torque_J{}=tau; Comment=")
    csv(folder / "run.lvm", columns, head=head, sep="\t", decimal=",")
    return Answer("run.lvm", {"X_Value": "s"}, right=right)


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
