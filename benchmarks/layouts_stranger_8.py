"""Write motions as thirty recordings, each with its answer: fifteen ordinary ones, ten of
laboratory practice, five hard ones.

The eighth stranger's: written down, with their answers, before any of them ran, by one who had not
read the importer or the layouts of the other sets.
"""

import json
from itertools import product
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pyarrow
import pyarrow.parquet
from scipy.io import savemat

from benchmarks.import_layouts import (
    DEG,
    DEGS,
    NM,
    RAD,
    RADS,
    Answer,
    Signal,
    anywhere,
    layout,
    recorded,
    stamps,
    table,
    wide,
)
from benchmarks.recorded_arm import (
    FOUR,
    GEN3,
    LEG,
    LIFT,
    PANDA,
    SEVEN,
    SIX,
    THREE,
    TWO,
    UR,
    Arm,
    Run,
)

DOG = Arm("go1_leg", ("FR_hip_joint", "FR_thigh_joint", "FR_calf_joint"), "xyy", (24, 24, 36))
NED = Arm("ned", ("base", "shoulder", "elbow", "forearm", "wrist"), "zyyxy", (60, 60, 40, 20, 20))
EPOCH = 1714744931.25  # [s]
AMPS, MILLIAMPS, CELSIUS = ("A",), ("mA",), ("degC", "°C")
COUNTS, RPM, PERMILLE = ("counts",), ("rpm",), ("0.1 %",)


def also(right: dict, role: str, form: str, joints, units: tuple[str, ...], v=None) -> None:
    """Accept the columns of a form as well; `v` is what they hold (SI)."""
    columns = tuple(form.replace("{}", str(j)) for j in joints)
    right[role] = (*right.get(role, ()), Signal(columns, units, v))


def counts(angles: np.ndarray, a_turn: float) -> np.ndarray:
    return np.round(angles * a_turn / (2 * np.pi)).astype(np.int64)


def share(run: Run) -> np.ndarray:
    """Return the torque as a share [%] of what each motor is rated for."""
    return 100 * run.tau / (1.7 * abs(run.tau).max(axis=0))


# ---- ordinary ones


@layout(DOG, rate=100.0)
def actuator_net_raw(folder: Path, run: Run) -> Answer:
    """actuator_net (sunzhon), raw actuator_data.csv: motorStatePos_0, motorAction_0; no clock."""
    specs = "*motorStatePos_{}=q; *motorStateVel_{}=dq; *motorAction_{}=q_ref; "
    specs += "*motorStateCur_{}=amps:current"
    return recorded(folder, run, "actuator_data.csv", {}, specs, range(3), joint_wise=True)


@layout(NED, rate=500.0)
def mujoco_angle_and_force(folder: Path, run: Run) -> Answer:
    """Write a MuJoCo script with two loggers: <joint>_cmd, <joint>_act in one file, forces in
    another.
    """
    specs = "time=t; *{}_cmd=q_ref; *{}_act=q"
    joints = run.arm.joints
    table(folder / "forces.csv", wide(run, "time=t; {}_force=tau", joints)[0])
    return recorded(folder, run, "angles.csv", {"time": "s"}, specs, joints, joint_wise=True)


@layout(TWO, rate=500.0)
def browser_recorder(folder: Path, run: Run) -> Answer:
    """Write a MuJoCo page's exportToCsv: time, j1_pos, …, j1_pos_desired, …, j1_torque_cmd,
    %.6f.
    """
    specs = "time=t; *j{}_pos=q; *j{}_vel=dq; *j{}_torque=tau; *j{}_pos_desired=q_ref; "
    specs += "*j{}_vel_desired=dq_ref; j{}_torque_cmd=tau_ref"
    how = {"float_format": "%.6f"}
    answer = recorded(folder, run, "session.csv", {"time": "s"}, specs, **how)
    also(answer.right, "tau", "j{}_torque_cmd", (1, 2), NM, run.tau_ref)
    return answer


@layout(UR, rate=125.0)
def joint_states_sorted(folder: Path, run: Run) -> Answer:
    """Write a UR10e's /joint_states by pandas: columns sorted by name, efforts and efforts_lp."""
    specs = "time=epoch; *{}_position=q; *{}_velocity=dq; {}_acceleration=ddq; *{}_effort=tau; "
    specs += "{}_effort_lp=low"
    low = pd.DataFrame(run.tau).ewm(alpha=0.3).mean().to_numpy()
    columns, right = wide(run, specs, run.arm.joints, low=low, epoch=EPOCH + run.t)
    also(right, "tau", "{}_effort_lp", run.arm.joints, NM, low)
    table(folder / "ur10e_run3.csv", {name: columns[name] for name in sorted(columns)})
    return Answer("ur10e_run3.csv", {"time": "s"}, right=right)


@layout(SIX, rate=50.0)
def doosan_snapshots(folder: Path, run: Run) -> Answer:
    """Write a cell's data base of a Doosan arm, robot_snapshots as CSV: degrees, the date comes
    last.
    """
    specs = "id=number; station_id=2; task_id=4711; *j{}_angle=q°:q°; *j{}_torque=tau; tcp_x=x; "
    specs += "tcp_y=y; tcp_z=z; tcp_a=rx; tcp_b=ry; tcp_c=rz; robot_mode=1; dart_connected=1; "
    specs += "timestamp=date"
    dates = [date[:-3] for date in stamps(run, "%Y-%m-%d %H:%M:%S.%f")]
    data = {"number": 88213 + np.arange(len(run.t)), "date": np.array(dates)}
    return recorded(folder, run, "snapshots.csv", {"timestamp": "*"}, specs, data=data)


@layout(FOUR, rate=100.0, how="points")
def rockwell_trend(folder: Path, run: Run) -> Answer:
    """Studio 5000 trend, exported: rows start with "Data:", times are 14:02:11;250; torque [%]."""
    specs = "*Axis_J{}.ActualPosition=q°; *Axis_J{}.CommandPosition=q_ref°; "
    specs += "*Axis_J{}.ActualVelocity=dq°; *Axis_J{}.TorqueReference=share:current:?"
    columns, right = wide(run, specs, share=share(run))
    head = ['"Controller Name:","Cell7"', '"Trend Name:","Arm"', f'"Trend Tags:",{len(columns)}']
    head += ['"Sample Period:",10 ms', '"Description:"," "']
    head += ['"Start Time:","5/3/2024;14:02:11;250"', '"Stop Time:","5/3/2024;14:02:23;240"']
    head += [",".join(f'"{name}"' for name in ("Header:", "Date", "Time", *columns))]
    times = [f'"{d[:-7]};{d[-6:-3]}"' for d in stamps(run, "%H:%M:%S.%f")]
    numbers = np.column_stack(list(columns.values()))
    rows = [
        f'"Data:","5/3/2024",{time},' + ",".join(f"{x:.5f}" for x in row)
        for time, row in zip(times, numbers, strict=True)
    ]
    (folder / "trend_arm.csv").write_text("\n".join([*head, *rows]) + "\n")
    return Answer("trend_arm.csv", {"Date+Time": "*", "Time": "*"}, 100.0, right)


@layout(THREE, rate=200.0)
def matlab_timetable(folder: Path, run: Run) -> Answer:
    """MATLAB's writetimetable: the row times are durations, "0.005 sec"; variables q_1, qd_1."""
    specs = "Time=seconds; *q_{}=q; *qd_{}=dq; *tau_{}=tau; *q_des_{}=q_ref"
    data = {"seconds": np.array([f"{t:.15g} sec" for t in run.t])}
    return recorded(folder, run, "experiment_03.csv", {"Time": "s"}, specs, data=data)


@layout(THREE, rate=200.0)
def labview_without_x(folder: Path, run: Run) -> Answer:
    """LabVIEW measurement file, X_Columns No, decimal comma: the step is Delta_X of the header."""
    groups = (("Pos", np.degrees(run.q), "deg"), ("Vel", np.degrees(run.dq), "deg/s"))
    groups += (("Torque", run.tau, "Nm"),)
    names = [f"{name} J{j}" for name, _, _ in groups for j in (1, 2, 3)]
    numbers = np.hstack([v for _, v, _ in groups])
    head = ["LabVIEW Measurement\t", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab"]
    head += ["Decimal_Separator\t,", "Multi_Headings\tNo", "X_Columns\tNo", "Time_Pref\tAbsolute"]
    head += ["Operator\tlab", "Date\t2024/05/03", "Time\t14:02:11,2500000"]
    head += ["***End_of_Header***\t", "\t", "Channels\t9" + "\t" * 9]

    def line(key: str, values) -> str:
        return "\t".join([key, *map(str, values), ""])

    head += [line("Samples", [len(run.t)] * 9), line("Date", ["2024/05/03"] * 9)]
    head += [line("Time", ["14:02:11,2500000"] * 9)]
    head += [line("Y_Unit_Label", [unit for _, _, unit in groups for _ in range(3)])]
    head += [line("X_Dimension", ["Time"] * 9), line("X0", ["0,0000000000000000E+0"] * 9)]
    head += [line("Delta_X", ["5,000000E-3"] * 9), "***End_of_Header***" + "\t" * 10]
    head += ["\t".join(["X_Value", *names, "Comment"])]
    rows = ["\t" + "\t".join(f"{x:.6f}".replace(".", ",") for x in row) for row in numbers]
    (folder / "messung_12.lvm").write_text("\r\n".join([*head, *rows]) + "\r\n")
    units = {"q": ("Pos", DEG), "dq": ("Vel", DEGS), "tau": ("Torque", NM)}
    right: dict = {}
    for role, (name, unit) in units.items():
        also(right, role, f"{name} J{{}}", (1, 2, 3), unit)
    return Answer("messung_12.lvm", {}, 200.0, right)


@layout(PANDA, rate=1000.0)
def panda_py_log(folder: Path, run: Run) -> Answer:
    """panda-py, get_log() by np.savez: fields of franka::RobotState, time in ms since the start."""
    own = run.tau_ref - run.tau_model  # what libfranka calls tau_J_d has no gravity in it
    pose = np.tile(np.eye(4).ravel(), (len(run.t), 1))
    pose[:, 12:15] = run.pose[:, :3]
    ms = np.round(1000 * run.t).astype(np.uint64)
    np.savez(
        folder / "panda_log.npz",
        time=ms,
        q=run.q,
        q_d=run.q_ref,
        dq=run.dq,
        dq_d=run.dq_ref,
        tau_J=run.tau,
        tau_J_d=own,
        tau_ext_hat_filtered=run.tau_ext,
        O_T_EE=pose,
    )
    right = anywhere(q=RAD, q_ref=RAD, dq=RADS, dq_ref=RADS, tau=NM)
    return Answer("panda_log.npz", {"time": "ms"}, right=right, texts=False)


@layout(FOUR, rate=1000.0)
def acs_scope(folder: Path, run: Run) -> Answer:
    """ACS SPiiPlus scope: FPOS(0), RPOS(0), FVEL(0), RVEL(0), DCOM(0); angles in user units."""
    specs = "Time[msec]=ms; *FPOS({})=q°; *RPOS({})=q_ref°; *FVEL({})=dq°; *RVEL({})=dq_ref°; "
    specs += "*DCOM({})=share:current:?; PE({})=error"
    data = {"share": share(run), "error": np.degrees(run.q_ref - run.q)}
    return recorded(folder, run, "scope1.csv", {"Time[msec]": "ms"}, specs, range(4), data=data)


@layout(SEVEN, rate=100.0)
def sarcos_of_openml(folder: Path, run: Run) -> Answer:
    """OpenML 44976, SARCOS: V1 … V7 angles, V8 velocities, V15 accelerations, V22 torques."""
    numbers = np.hstack([run.q, run.dq, run.ddq, run.tau])
    table(folder / "sarcos.csv", {f"V{k + 1}": column for k, column in enumerate(numbers.T)})
    right: dict = {}
    for role, first, units in (("q", 1, RAD), ("dq", 8, RADS), ("tau", 22, NM)):
        also(right, role, "V{}", range(first, first + 7), units)
    return Answer("sarcos.csv", {}, right=right)


@layout(LIFT, rate=100.0)
def french_spreadsheet(folder: Path, run: Run) -> Answer:
    """Write a spreadsheet of a French lab, saved as CSV: a sliding axis first, in mm and N."""
    metres = np.array([1000.0, *[180 / np.pi] * 3])
    columns: dict = {"Temps (s)": run.t}
    for j in range(4):
        length, torque = ("mm", "N") if j == 0 else ("°", "N.m")
        columns[f"Axe {j + 1} position ({length})"] = run.q[:, j] * metres[j]
        columns[f"Axe {j + 1} vitesse ({length}/s)"] = run.dq[:, j] * metres[j]
        columns[f"Axe {j + 1} effort ({torque})"] = run.tau[:, j]
    how = {"sep": ";", "decimal": ",", "encoding": "cp1252", "lineterminator": "\r\n"}
    table(folder / "essai_2.csv", columns, float_format="%.5f", **how)
    right: dict = {}
    for role, name, first, others in (
        ("q", "position", "mm", DEG),
        ("dq", "vitesse", "mm/s", DEGS),
        ("tau", "effort", "N", (*NM, "N.m")),
    ):
        units = tuple(f"{a},{b},{b},{b}" for a, b in product((first,), others))
        also(right, role, f"Axe {{}} {name}", range(1, 5), units)
    return Answer("essai_2.csv", {"Temps (s)": "s"}, right=right)


@layout(SIX, rate=125.0)
def japanese_controller(folder: Path, run: Run) -> Answer:
    """Write a Japanese controller's log, Shift JIS: commanded and actual position, current in %
    rated.
    """
    specs = "時刻[ms]=ms; *J{}指令位置[deg]=q_ref°; *J{}現在位置[deg]=q°; "
    specs += "J{}電流指令[%]=want; *J{}電流FB[%]=share:current:%"
    data = {"share": share(run), "want": share(run) * 1.001}
    how = {"encoding": "cp932", "float_format": "%.4f"}
    return recorded(folder, run, "LOG0001.csv", {"時刻[ms]": "ms"}, specs, data=data, **how)


@layout(LEG, rate=250.0)
def moteus_registers(folder: Path, run: Run) -> Answer:
    """moteus by pandas, servo1.POSITION [rev], servo1.VELOCITY [rev/s], servo1.TORQUE [N m]."""
    specs = "timestamp=epoch; servo{}.MODE=10; *servo{}.POSITION=turns:q:rev; "
    specs += "*servo{}.VELOCITY=turns_s:dq:rev/s; *servo{}.TORQUE=tau; servo{}.VOLTAGE=24.0; "
    specs += "servo{}.FAULT=0"
    data = {"epoch": EPOCH + run.t, "turns": run.q / (2 * np.pi), "turns_s": run.dq / (2 * np.pi)}
    time = {"timestamp": "s"}
    return recorded(folder, run, "leg.csv", time, specs, data=data, joint_wise=True)


@layout(GEN3, rate=1000.0)
def kortex_feedback(folder: Path, run: Run) -> Answer:
    """Kinova's kortex_api, BaseCyclic.Feedback to CSV: angles of 0 to 360 degrees; frame_id."""
    specs = "frame_id=frame; *position_{}=wrapped:q°; *velocity_{}=dq°; *torque_{}=tau; "
    specs += "*current_motor_{}=amps:current; voltage_{}=24; temperature_motor_{}=temp"
    data = {"wrapped": np.degrees(np.mod(run.q, 2 * np.pi)), "frame": 100 + np.arange(len(run.t))}
    columns, right = wide(run, specs, range(7), **data)
    right["tau"] = ()  # no currents
    also(right, "tau", "torque_{}", range(7), NM)
    also(right, "temperature", "temperature_motor_{}", range(7), CELSIUS)
    table(folder / "feedback.csv", columns, float_format="%.6f")
    return Answer("feedback.csv", {"frame_id": "sample"}, right=right)


# ---- laboratory practice


@layout(THREE, rate=200.0)
def pandas_two_headers(folder: Path, run: Run) -> Answer:
    """DataFrame.to_csv with columns of two levels, signal and joint, and a named index."""
    names = pd.MultiIndex.from_product(
        [["q", "dq", "tau", "q_des"], run.arm.joints], names=["signal", "joint"]
    )
    numbers = np.hstack([run.q, run.dq, run.tau, run.q_ref])
    frame = pd.DataFrame(numbers, columns=names, index=pd.Index(run.t, name="time"))
    frame.to_csv(folder / "run_2.csv")
    right = anywhere(q=RAD, dq=RADS, tau=NM, q_ref=RAD)
    return Answer("run_2.csv", {"time": "s"}, right=right, texts=False)


@layout(THREE, rate=500.0)
def motor_side(folder: Path, run: Run) -> Answer:
    """Motor angles, speeds and currents of a test bench; ratios and constants in comments above."""
    ratio, constant = np.array([100.0, 120.0, 80.0]), np.array([0.08, 0.08, 0.05])
    amps = run.tau / (ratio * constant)
    specs = "t[s]=t; theta_m{}[rad]=theta; n_m{}[rpm]=speed; i_m{}[A]=amps"
    data = {"theta": run.q * ratio, "speed": run.dq * ratio * 30 / np.pi, "amps": amps}
    head = "# excitation, run 7; all values motor side, theta_m = N * q\n"
    head += "# gear ratios N: 100, 120, 80\n# torque constants Kt [Nm/A]: 0.08, 0.08, 0.05\n"
    table(folder / "bench_07.txt", wide(run, specs, **data)[0], head, sep=";")
    right: dict = {}
    also(right, "q", "theta_m{}[rad]", (1, 2, 3), RAD)
    also(right, "dq", "n_m{}[rpm]", (1, 2, 3), RPM)
    also(right, "current", "i_m{}[A]", (1, 2, 3), AMPS, amps)
    also(right, "tau", "i_m{}[A]", (1, 2, 3), AMPS)
    return Answer("bench_07.txt", {"t[s]": "s"}, right=right)


@layout(THREE, rate=1000.0)
def encoder_counts(folder: Path, run: Run) -> Answer:
    """Write a microcontroller's log: encoder counts, with the counts of a joint's turn above."""
    specs = "time_us=us; *enc{}=counts:q:counts; *i{}_mA=milli:current:mA; pwm{}=pwm"
    head = "% encoder 1024 lines x4, gearbox 1:100 -> 409600 counts per joint revolution\n"
    data = {"counts": counts(run.q, 409600), "milli": 1000 * run.current}
    data["pwm"] = np.round(2.0 * share(run)).astype(int)
    time = {"time_us": "us"}
    return recorded(folder, run, "teensy_log_4.csv", time, specs, head=head, data=data)


@layout(FOUR, rate=50.0)
def set_point_and_process_value(folder: Path, run: Run) -> Answer:
    """Write a PID's trend: set point, process value and output of each loop; Excel's serial
    date.
    """
    specs = "DateTime=serial; *J{}_SP_deg=q_ref°; *J{}_PV_deg=q°; *J{}_OUT=share:current:?"
    serial = [f"{45415.5848524306 + t / 86400:.10f}" for t in run.t]
    data = {"serial": np.array(serial), "share": share(run)}
    time = {"DateTime": "d"}
    return recorded(folder, run, "pid_trend.csv", time, specs, data=data, joint_wise=True)


@layout(SIX, rate=250.0)
def file_for_each_joint(folder: Path, run: Run) -> Answer:
    """Write a file for each joint, joint1.csv … joint6.csv, all with t, pos, vel, torque."""
    for j in range(6):
        columns = {"t": run.t, "pos": run.q[:, j], "vel": run.dq[:, j], "torque": run.tau[:, j]}
        table(folder / f"joint{j + 1}.csv", columns)
    return Answer("joint1.csv", {"t": "s"}, right=anywhere(q=RAD, dq=RADS, tau=NM), texts=False)


@layout(FOUR, rate=200.0)
def hdf5_group_a_joint(folder: Path, run: Run) -> Answer:
    """h5py, a group for each joint, units as attributes; the clock in ms stands beside them."""
    with h5py.File(folder / "trial.h5", "w") as file:
        file.attrs["operator"] = "lab"
        time = file.create_dataset("time", data=1000 * run.t)
        time.attrs["units"] = "ms"
        for j, name in enumerate(run.arm.joints):
            group = file.create_group(name)
            for key, v, unit in (
                ("position", np.degrees(run.q), "deg"),
                ("velocity", np.degrees(run.dq), "deg/s"),
                ("torque", run.tau, "N*m"),
            ):
                group.create_dataset(key, data=v[:, j]).attrs["units"] = unit
    right = anywhere(q=DEG, dq=DEGS, tau=NM)
    return Answer("trial.h5", {"time": "ms"}, right=right, texts=False)


@layout(SIX, rate=250.0)
def parquet_of_lists(folder: Path, run: Run) -> Answer:
    """pyarrow, a list of joints in each cell, q_meas, tau_cmd, tau_meas; stamps in UTC."""
    start = pd.Timestamp("2024-05-03 14:02:11.25", tz="UTC")
    stamp = start + pd.to_timedelta(np.round(1e9 * run.t).astype(np.int64), unit="ns")
    lists = {"q_meas": run.q, "qd_meas": run.dq, "q_cmd": run.q_ref, "tau_cmd": run.tau_ref}
    lists |= {"tau_meas": run.tau}
    columns = {"stamp": pyarrow.array(stamp)} | {k: v.tolist() for k, v in lists.items()}
    pyarrow.parquet.write_table(pyarrow.table(columns), folder / "run_0007.parquet")
    right = anywhere(q=RAD, dq=RADS, q_ref=RAD, tau=NM)
    right["tau"] += (Signal((), NM, run.tau_ref),)
    return Answer("run_0007.parquet", {"stamp": "*"}, right=right, texts=False)


@layout(THREE, rate=250.0)
def json_joint_by_joint(folder: Path, run: Run) -> Answer:
    """Write a script's json.dump: meta with sample rate and units, then lists of each joint."""
    meta = {"robot": "rrr", "operator": "lab", "sample_rate_hz": 250, "payload_kg": 0.0}
    meta["units"] = {"q": "rad", "dq": "rad/s", "tau": "Nm"}
    data = {
        name: {"q": list(run.q[:, j]), "dq": list(run.dq[:, j]), "tau": list(run.tau[:, j])}
        for j, name in enumerate(run.arm.joints)
    }
    (folder / "trial_5.json").write_text(json.dumps({"meta": meta, "data": data}))
    right = anywhere(q=RAD, dq=RADS, tau=NM)
    return Answer("trial_5.json", {}, 250.0, right, texts=False)


@layout(LEG, rate=500.0)
def struct_array_of_joints(folder: Path, run: Run) -> Answer:
    """MATLAB, rec.t and rec.joint(j).pos, .vel, .trq: a struct array with an element a joint."""
    fields = [(name, object) for name in ("name", "pos", "vel", "trq")]
    joints = np.empty((1, run.n), dtype=fields)
    for j, name in enumerate(run.arm.joints):
        joints[0, j] = (name, run.q[:, [j]], run.dq[:, [j]], run.tau[:, [j]])
    savemat(folder / "rec.mat", {"rec": {"t": run.t[:, None], "joint": joints}})
    right = anywhere(q=RAD, dq=RADS, tau=NM)
    return Answer("rec.mat", {"t": "s"}, right=right, texts=False)


@layout(SIX, rate=500.0)
def ethercat_objects(folder: Path, run: Run) -> Answer:
    """Write an EtherCAT master's log of CiA 402 objects: 6064h, 606Ch, 6077h; counts of nothing
    told.
    """
    specs = "cycle=count; time_ns=ns; J{}.6041h=4663; *J{}.6064h=counts:q:counts; "
    specs += "*J{}.606Ch=speed:dq:counts/s; *J{}.6077h=share:current:0.1 %; "
    specs += "*J{}.607Ah=want:q_ref:counts"
    data = {"counts": counts(run.q, 524288), "speed": counts(run.dq, 524288)}
    data |= {"want": counts(run.q_ref, 524288), "share": np.round(10 * share(run)).astype(int)}
    data["ns"] = 767973731250000000 + np.round(1e9 * run.t).astype(np.int64)
    how = {"joint_wise": True, "known": False, "sep": "\t"}
    time = {"time_ns": "ns", "cycle": "sample"}
    return recorded(folder, run, "ecat.log", time, specs, data=data, **how)


# ---- hard ones


@layout(SIX, rate=100.0)
def mcap_dynamic_joint_states(folder: Path, run: Run) -> Answer:
    """`mcap cat --json` of /dynamic_joint_states: interface_values hold names and values."""
    lines = []
    interfaces = ["position", "velocity", "effort"]
    for k, t in enumerate(run.t):
        seconds, nanoseconds = divmod(round(1e9 * t) + 1714744931250000000, 10**9)
        stamp = {"sec": seconds, "nanosec": nanoseconds}
        held = [
            {"interface_names": interfaces, "values": [run.q[k, j], run.dq[k, j], run.tau[k, j]]}
            for j in range(6)
        ]
        message = {"header": {"stamp": stamp, "frame_id": ""}}
        message |= {"joint_names": list(run.arm.joints), "interface_values": held}
        lines.append(
            f'{{"topic":"/dynamic_joint_states","sequence":{k},'
            f'"log_time":{seconds}.{nanoseconds:09d},"publish_time":{seconds}.{nanoseconds:09d},'
            f'"data":{json.dumps(message)}}}\n'
        )
    (folder / "states.jsonl").write_text("".join(lines))
    right = anywhere(q=RAD, dq=RADS, tau=NM)
    return Answer("states.jsonl", {"log_time": "s"}, right=right, texts=False)


@layout(FOUR, rate=200.0)
def polled_in_turn(folder: Path, run: Run) -> Answer:
    """Write a long table of motors on one bus that are polled in turn: each row has a time of its
    own.
    """
    late = 0.0004 * np.arange(4)
    times = run.t[:, None] + late

    def at(v: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(run.t + late[j], run.t, v[:, j]) for j in range(4)])

    columns = {"time": np.round(times.ravel(), 6), "motor_id": np.tile(np.arange(1, 5), len(run.t))}
    columns |= {"pos_rad": at(run.q).ravel(), "vel_rad_s": at(run.dq).ravel()}
    columns |= {"torque_nm": at(run.tau).ravel(), "temp_c": np.round(at(run.temperature)).ravel()}
    table(folder / "can_bus.csv", columns)
    right = anywhere(q=RAD, dq=RADS, tau=NM, temperature=CELSIUS)
    return Answer("can_bus.csv", {"time": "s"}, right=right, texts=False)


@layout(SIX, rate=125.0)
def arrays_as_cells(folder: Path, run: Run) -> Answer:
    """Write a Dobot's feedback by pandas, numpy arrays as cells: no commas, and lines break in a
    cell.
    """
    arrays = {"QTarget": np.degrees(run.q_ref), "QActual": np.degrees(run.q)}
    arrays |= {"QDActual": np.degrees(run.dq), "IActual": 1000 * run.current}
    columns: dict = {"TimeStamp": 1714744931250 + np.round(1000 * run.t).astype(np.int64)}
    columns |= {k: [str(row) for row in v] for k, v in arrays.items()}
    table(folder / "feedback.csv", columns)
    right = anywhere(q=DEG, q_ref=DEG, dq=DEGS, current=MILLIAMPS, tau=MILLIAMPS)
    return Answer("feedback.csv", {"TimeStamp": "ms"}, right=right, texts=False)


@layout(THREE, rate=200.0)
def appended_pieces(folder: Path, run: Run) -> Answer:
    """to_csv(mode="a") after every 500 rows: the header comes back, the index starts at 0 again."""
    specs = "t=t; *pos_{}=q; *vel_{}=dq; *eff_{}=tau"
    columns, right = wide(run, specs, run.arm.joints)
    frame = pd.DataFrame(columns)
    pieces = [frame[k : k + 500].reset_index(drop=True) for k in range(0, len(frame), 500)]
    (folder / "log.csv").write_text("".join(piece.to_csv() for piece in pieces))
    return Answer("log.csv", {"t": "s"}, right=right)


@layout(SIX, rate=100.0)
def one_letter_names(folder: Path, run: Run) -> Answer:
    """Write a vendor's service log, one letter a signal: p, v, c and t, which is a temperature."""
    specs = "time_ms=ms; *p{}=q°; *v{}=dq°; *c{}=amps:current:?; t{}=temp"
    columns, right = wide(run, specs)
    also(right, "temperature", "t{}", range(1, 7), CELSIUS)
    table(folder / "service.csv", columns, float_format="%.3f")
    return Answer("service.csv", {"time_ms": "ms"}, right=right)
