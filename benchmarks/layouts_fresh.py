"""Write one simulated motion as thirty recordings, all written down before any of them ran (see
import_layouts).

After the public documentation of the loggers named; the importer was developed on the other sets.
"""

import json
from pathlib import Path

import h5py
import numpy as np
import pandas as pd

from benchmarks.import_layouts import (
    NM,
    RAD,
    UNITS,
    Answer,
    Signal,
    current,
    layout,
    names,
    recorded,
    si,
    table,
    values,
    wide,
)
from benchmarks.recorded_arm import FOUR, GEN3, IIWA, SCARA, SEVEN, SIX, THREE, TWO, UR, Run

ALPHABETICAL = [2, 1, 0, 3, 4, 5]  # of the joints of a UR


@layout(UR, rate=125.0)
def bagpy_joint_states(folder: Path, run: Run) -> Answer:
    """bagpy's CSV of /joint_states: Time, header.*, name_0 …, position_0 …, velocity_0 …, effort_0
    …
    """
    us = values(run)["us"] + 1_699_000_000_000_000
    columns = {
        "Time": us / 1e6,
        "header.seq": values(run)["count"],
        "header.stamp.secs": us // 10**6,
    }
    columns |= {"header.stamp.nsecs": us % 10**6 * 1000, "header.frame_id": ""}
    columns |= {f"name_{k}": run.arm.joints[j] for k, j in enumerate(ALPHABETICAL)}
    for part, v in (("position", run.q), ("velocity", run.dq), ("effort", run.tau)):
        columns |= {f"{part}_{k}": v[:, j] for k, j in enumerate(ALPHABETICAL)}
    table(folder / "joint_states.csv", columns)
    right = {
        role: (Signal(tuple(f"{part}_{ALPHABETICAL.index(j)}" for j in range(6)), UNITS[role]),)
        for role, part in (("q", "position"), ("dq", "velocity"), ("tau", "effort"))
    }
    time = {"Time": "s", "header.stamp.secs+header.stamp.nsecs": "s+ns"}
    return Answer("joint_states.csv", time, right=right)


@layout(IIWA, rate=50.0)
def foxglove_arrays(folder: Path, run: Run) -> Answer:
    """Foxglove's CSV of a JointState topic: JSON lists in the cells, receive time in ns."""
    ns = values(run)["us"] * 1000 + 1_705_000_000_000_000_000
    columns: dict = {"receiveTime": ns, "topic": "/joint_states"}
    columns["name"] = [json.dumps(run.arm.joints)] * len(run.t)
    for part, v in (("position", run.q), ("velocity", run.dq), ("effort", run.tau)):
        columns[part] = [json.dumps(row) for row in v.tolist()]
    table(folder / "foxglove.csv", columns)
    roles = (("q", "position"), ("dq", "velocity"), ("tau", "effort"))
    right = {role: (Signal(names(part + "[{}]", 7, 0), UNITS[role]),) for role, part in roles}
    return Answer("foxglove.csv", {"receiveTime": "ns"}, right=right)


@layout(UR, rate=500.0)
def ur_rtde_record_file(folder: Path, run: Run) -> Answer:
    """ur_rtde's startFileRecording: timestamp, actual_q_0 …, actual_current_as_torque_0 …"""
    specs = (
        "timestamp=now; *actual_q_{}=q; *actual_qd_{}=dq; *target_q_{}=q_ref; "
        "actual_TCP_force_{}=ext; "
    )
    specs += "*actual_current_as_torque_{}=tau; robot_mode=7; safety_mode=1"
    more = {"now": 90211.4 + run.t}
    return recorded(folder, run, "record.csv", {"timestamp": "s"}, specs, range(6), data=more)


@layout(SIX, rate=250.0, how="points")
def kuka_trace_french(folder: Path, run: Run) -> Answer:
    """KUKA oscilloscope of a French panel: semicolons, decimal commas, cp1252."""
    specs = "Temps [s]=t; *Position de consigne A{} [°]=q_ref°; *Position réelle A{} [°]=q°; "
    specs += "*Couple réel A{} [Nm]=tau; Erreur de poursuite A{} [°]=lag"
    more = {"lag": np.degrees(run.q_ref - run.q)}
    how = {"sep": ";", "decimal": ",", "encoding": "cp1252", "float_format": "%.5f"}
    return recorded(folder, run, "trace.csv", {"Temps [s]": "s"}, specs, data=more, **how)


@layout(SEVEN, rate=200.0, how="turns")
def fri_log(folder: Path, run: Run) -> Answer:
    """Write a KUKA FRI client's log: sec and nsec, measured, commanded and external values by
    index.
    """
    us = values(run)["us"] + 1_690_000_000_000_000
    more = {"s": us // 10**6, "ns": us % 10**6 * 1000}
    specs = (
        "sec=s; nsec=ns; *msr_jnt_pos[{}]=q; *cmd_jnt_pos[{}]=q_ref; *msr_jnt_trq[{}]=tau; "
        "est_ext_jnt_trq[{}]=ext"
    )
    return recorded(
        folder, run, "fri.txt", {"sec+nsec": "s+ns"}, specs, range(7), data=more, sep="\t"
    )


@layout(SIX, rate=100.0, how="points")
def abb_signal_analyzer(folder: Path, run: Run) -> Answer:
    """RobotStudio's Signal Analyzer: time in s, joints in deg, a pose, motor power; no torque."""
    specs = (
        "Time (s)=t; *Joint J{} (deg)=q°; TCP X (mm)=x; TCP Y (mm)=y; TCP Z (mm)=z; Speed "
        "(mm/s)=250; Total power (W)=640"
    )
    return recorded(folder, run, "signals.csv", {"Time (s)": "s"}, specs)


@layout(SIX, rate=125.0)
def fanuc_disturbance_japanese(folder: Path, run: Run) -> Answer:
    """Write a Japanese FANUC log in Shift-JIS: 現在位置 and 指令位置 in deg.

    Of the torque it has the disturbance alone, in %.
    """
    specs = "時間[ms]=ms; *指令位置J{}[deg]=q_ref°; *現在位置J{}[deg]=q°; 外乱トルクJ{}[%]=load"
    more = {"load": np.round(5 + 2 * np.sin(run.t[:, None] + np.arange(6)), 2)}
    how = {"encoding": "shift_jis", "float_format": "%.4f"}
    return recorded(
        folder, run, "SERVO.CSV", {"時間[ms]": "ms"}, specs, data=more, known=False, **how
    )


@layout(SIX, rate=250.0, how="turns")
def staubli_val3_french(folder: Path, run: Run) -> Answer:
    """Write a VAL3 program's log: French names, semicolons; units in a line of their own."""
    columns, right = wide(
        run, "Temps=t; *Angle J{}=q°; *Vitesse J{}=dq°; *Couple J{}=tau; Température J{}=temp"
    )
    units = ["s", *["deg"] * 6, *["deg/s"] * 6, *["Nm"] * 6, *["°C"] * 6]
    head = ";".join(columns) + "\n" + ";".join(units) + "\n"
    table(folder / "journal.csv", columns, head, sep=";", header=False, float_format="%.5f")
    return Answer("journal.csv", {"Temps": "s"}, right=right)


@layout(SEVEN, rate=100.0)
def franka_state_topic(folder: Path, run: Run) -> Answer:
    """franka_ros' FrankaState through a bag converter: rosbagTimestamp, q_0 …, tau_J_0 …, dtau_J,
    K_F_ext.
    """
    specs = (
        "rosbagTimestamp=now; cartesian_collision_{}=0; *q_{}=q; *q_d_{}=q_ref; *dq_{}=dq; "
        "theta_{}=theta; "
    )
    specs += (
        "*tau_J_{}=tau; dtau_J_{}=rate; tau_J_d_{}=zero; tau_ext_hat_filtered_{}=ext; "
        "control_command_success_rate=0.99"
    )
    more = {
        "now": values(run)["us"] * 1000 + 1_660_000_000_000_000_000,
        "theta": run.q + run.tau / 9000,
    }
    more |= {"rate": 50 * run.tau_ext, "zero": 0 * run.q}
    return recorded(folder, run, "state.csv", {"rosbagTimestamp": "ns"}, specs, range(7), data=more)


@layout(SIX, rate=100.0, how="points")
def kinova_gen2_driver(folder: Path, run: Run) -> Answer:
    """Kinova's Jaco driver by PlotJuggler: joint angles in deg without a unit, torques in N m."""
    at = "/j2n6s300_driver/out/"
    specs = (
        f"__time=now; *{at}joint_angles/joint{{}}=q°; *{at}joint_torques/joint{{}}=tau; "
        f"{at}tool_pose/pose/position/x=x"
    )
    more = {"now": 1.69e9 + run.t}
    return recorded(folder, run, "jaco.csv", {"__time": "s"}, specs, data=more)


@layout(SIX, rate=100.0)
def xarm_studio(folder: Path, run: Run) -> Answer:
    """xArm's trajectory record: J1(°) …, current1(A) …, TCP in mm and °."""
    specs = (
        "time(s)=t; *J{}(°)=q°; x(mm)=x; y(mm)=y; z(mm)=z; roll(°)=tilt; pitch(°)=tilt; "
        "yaw(°)=turn; *current{}(A)=current"
    )
    more = {"tilt": 3 * np.sin(run.q[:, 1]), "turn": 20 * np.sin(run.q[:, 0])}
    return recorded(folder, run, "xarm.csv", {"time(s)": "s"}, specs, data=more, known=False)


@layout(FOUR, rate=50.0, how="turns")
def dynamixel_spanish(folder: Path, run: Run) -> Answer:
    """Write a student's Dynamixel logger: Spanish names with units, currents in mA, UTF-8 with
    mark.
    """
    specs = "Tiempo [ms]=ms; *Posición objetivo {} [°]=q_ref°; *Posición actual {} [°]=q°; "
    specs += "*Corriente {} [mA]=mA:current:mA; Temperatura {} [°C]=temp"
    more = {"mA": np.round(1000 * current(run))}
    how = {"encoding": "utf-8-sig", "float_format": "%.3f"}
    return recorded(
        folder, run, "registro.csv", {"Tiempo [ms]": "ms"}, specs, data=more, known=False, **how
    )


@layout(TWO, rate=200.0)
def odrive_turns(folder: Path, run: Run) -> Answer:
    """ODrive 0.6's CAN log: pos_estimate and vel_estimate in turns, torque_estimate in N m, all
    named.
    """
    more = {"rev": run.q / (2 * np.pi), "rev/s": run.dq / (2 * np.pi)}
    specs = (
        "time [s]=t; *axis{}.pos_estimate [rev]=rev:q:rev; *axis{}.vel_estimate "
        "[rev/s]=rev/s:dq:rev/s; "
    )
    specs += "*axis{}.torque_estimate [Nm]=tau; axis{}.bus_voltage [V]=24.1"
    return recorded(folder, run, "odrive.csv", {"time [s]": "s"}, specs, range(2), True, data=more)


@layout(THREE, robot="robot.toml", rate=500.0)
def twincat_one_clock(folder: Path, run: Run) -> Answer:
    """TwinCAT Scope with one clock, German: Istposition in °, Istmoment in 0.1 % of the rated
    torque.
    """
    load = np.round(1000 * run.tau / np.array(run.arm.effort))
    specs = (
        "Zeit [ms]=ms; *Axis {}.NcToPlc.ActPos [°]=q°; *Axis {}.NcToPlc.ActVelo [°/s]=dq°; *Axis "
        "{}.Drive.ActTorque=load:tau:?"
    )
    how = {"sep": ";", "decimal": ",", "float_format": "%.5f"}
    return recorded(
        folder,
        run,
        "scope.csv",
        {"Zeit [ms]": "ms"},
        specs,
        data={"load": load},
        known=False,
        **how,
    )


@layout(SIX, robot=None, rate=400.0, how="points")
def acopos_trace(folder: Path, run: Run) -> Answer:
    """B&R ACOPOS trace by ParID: PCTRL_S_ACT in thousandths of a degree, SCTRL_SPEED_ACT,
    TORQUE_ACT of the motor.
    """
    more = {
        "mdeg": np.round(1000 * np.degrees(run.q)),
        "speed": np.degrees(run.dq) * 1000,
        "load": run.tau / 81,
    }
    specs = (
        "Time [us]=us; *gAx{}: PCTRL_S_ACT=mdeg:q:?; *gAx{}: PCTRL_V_ACT=speed:dq:?; *gAx{}: "
        "TORQUE_ACT=load:tau:?"
    )
    return recorded(
        folder,
        run,
        "trace.csv",
        {"Time [us]": "us"},
        specs,
        None,
        True,
        known=False,
        data=more,
        sep=";",
    )


@layout(THREE, robot="robot.toml", rate=1000.0)
def simulink_logsout(folder: Path, run: Run) -> Answer:
    """Simulink's logsout by writetable: q_meas(1) …, q_ref(1) …, tau_meas(1) …, SI by the model's
    units.
    """
    specs = "time=t; *q_meas({})=q; *q_ref({})=q_ref; *dq_meas({})=dq; *tau_meas({})=tau"
    return recorded(folder, run, "logsout.csv", {"time": "s"}, specs)


@layout(THREE, robot="robot.toml", rate=200.0, how="turns")
def labview_italian(folder: Path, run: Run) -> Answer:
    """Write a LabVIEW program's text file, Italian: tabs, decimal commas, gradi and N·m."""
    specs = (
        "Tempo [s]=t; *Posizione misurata giunto {} [gradi]=q°; *Posizione di riferimento giunto "
        "{} [gradi]=q_ref°; "
    )
    specs += "*Coppia misurata giunto {} [N·m]=tau"
    return recorded(
        folder,
        run,
        "prova.txt",
        {"Tempo [s]": "s"},
        specs,
        sep="\t",
        decimal=",",
        float_format="%.6f",
    )


@layout(SIX, rate=100.0)
def parquet_lists_with_units(folder: Path, run: Run) -> Answer:
    """Write a fleet recorder's Parquet: timestamp_us and lists joint_pos_deg, joint_torque_nm."""
    frame = pd.DataFrame({"timestamp_us": values(run)["us"] + 1_700_000_000_000_000})
    frame["joint_pos_deg"], frame["joint_torque_nm"] = list(np.degrees(run.q)), list(run.tau)
    frame.to_parquet(folder / "part-0.parquet")
    right = {"q": (si("joint_pos_deg_{}", 6, "q°"),), "tau": (si("joint_torque_nm_{}", 6, "tau"),)}
    return Answer("part-0.parquet", {"timestamp_us": "us"}, right=right)


@layout(SIX, rate=500.0)
def hdf5_records(folder: Path, run: Run) -> Answer:
    """Write a C++ logger's HDF5 table of records: stamp_ns, state code, pos[6], vel[6], eff[6]."""
    parts = [("pos", "f4", (6,)), ("vel", "f4", (6,)), ("eff", "f4", (6,))]
    records = np.zeros(len(run.t), np.dtype([("stamp_ns", "u8"), ("code", "u2"), *parts]))
    records["stamp_ns"] = values(run)["us"] * 1000 + 1_700_000_000_000_000_000
    records["pos"], records["vel"], records["eff"] = run.q, run.dq, run.tau
    with h5py.File(folder / "run.h5", "w") as file:
        file["session_004/samples"] = records
    at = "session_004.samples."
    right = {
        r: (si(f"{at}{p}_{{}}", 6, r),) for r, p in (("q", "pos"), ("dq", "vel"), ("tau", "eff"))
    }
    return Answer("run.h5", {at + "stamp_ns": "ns"}, right=right)


@layout(SIX, rate=50.0)
def aloha_two_arms(folder: Path, run: Run) -> Answer:
    """Write an ALOHA episode in HDF5: qpos, qvel, effort of 14 = two arms of six with grippers; one
    URDF of six.
    """
    grip = 0.5 + 0.5 * np.sin(run.t[:, None])
    with h5py.File(folder / "episode_3.hdf5", "w") as file:
        for name, v in (("qpos", run.q), ("qvel", run.dq), ("effort", run.tau)):
            file[f"observations/{name}"] = np.hstack([v, grip, v[::-1], grip])
        file["action"] = np.hstack([run.q_ref, grip, run.q_ref[::-1], grip])
    return Answer("episode_3.hdf5", rate=50.0, draftable=False)


@layout(SIX, robot=None, rate=250.0)
def yaskawa_japanese(folder: Path, run: Run) -> Answer:
    """Write a MotoPlus logger in Shift-JIS: 指令パルス and 帰還パルス of each axis.

    トルク is in % of the rated one.
    """
    scale = np.array([1.34, 1.2, 1.0, 0.8, 0.8, 0.52]) * 1e6
    more = {"goal": np.round(run.q_ref * scale), "pls": np.round(run.q * scale)}
    more["share"] = np.round(100 * run.tau / np.array([350.0, 400.0, 200.0, 30.0, 30.0, 18.0]), 1)
    specs = "経過時間[ms]=ms; {}軸指令パルス=goal; *{}軸帰還パルス=pls:q:counts; "
    specs += "*{}軸トルク[%]=share:tau:%"
    how = {"encoding": "shift_jis", "float_format": "%.1f"}
    return recorded(
        folder,
        run,
        "LOG.CSV",
        {"経過時間[ms]": "ms"},
        specs,
        "SLURBT",
        known=False,
        data=more,
        **how,
    )


@layout(SIX, rate=100.0, how="points")
def techman_listen_node(folder: Path, run: Run) -> Answer:
    """Techman's Ethernet slave: Joint_Angle in deg and Joint_Torque in mN m, neither named."""
    more = {"milli": np.round(1000 * run.tau)}
    specs = "Timestamp=us; *Joint_Angle_{}=q°; *Joint_Speed_{}=dq°; *Joint_Torque_{}=milli:tau:?"
    return recorded(folder, run, "svr.csv", {"Timestamp": "us"}, specs, data=more, known=False)


@layout(SIX, rate=200.0, how="turns")
def aubo_chinese(folder: Path, run: Run) -> Answer:
    """Write a Chinese controller's log in GBK: 关节1实际角度 in rad, 关节1电流 in mA."""
    more = {"mA": np.round(1000 * current(run), 1)}
    specs = (
        "时间戳(ms)=ms; *关节{}目标角度(弧度)=q_ref; *关节{}实际角度(弧度)=q; "
        "*关节{}电流(mA)=mA:current:mA; 关节{}温度(℃)=temp"
    )
    how = {"encoding": "gbk", "float_format": "%.6f"}
    return recorded(
        folder, run, "log.csv", {"时间戳(ms)": "ms"}, specs, known=False, data=more, **how
    )


@layout(SIX, rate=125.0)
def jaka_json(folder: Path, run: Run) -> Answer:
    """JAKA's status port as JSON lines: joint_actual_position in deg, monitor_data with torques,
    ms.
    """
    lines = []
    for k, ms in enumerate(values(run)["ms"].tolist()):
        line = {"len": 1024, "timestamp_ms": 1_700_000_000_000 + ms}
        line |= {"joint_actual_position": np.degrees(run.q[k]).tolist()}
        line |= {
            "joint_position": np.degrees(run.q_ref[k]).tolist(),
            "inst_joint_torque": run.tau[k].tolist(),
        }
        lines.append(json.dumps(line | {"errcode": "0x0", "inpos": False}))
    (folder / "status.jsonl").write_text("\n".join(lines) + "\n")
    right = {
        "q": (si("joint_actual_position[{}]", 6, "q°", 0),),
        "tau": (si("inst_joint_torque[{}]", 6, "tau", 0),),
    }
    return Answer("status.jsonl", {"timestamp_ms": "ms"}, right=right)


@layout(FOUR, robot=None, rate=500.0)
def barrett_wam(folder: Path, run: Run) -> Answer:
    """libbarrett's bt-log-export: CSV without a header: time, four positions, four torques."""
    data = np.column_stack([run.t, run.q, run.tau])
    np.savetxt(folder / "wam.csv", data, delimiter=",")
    right = {"q": (si("column_{}", 4, "q", 2),), "tau": (si("column_{}", 4, "tau", 6),)}
    return Answer("wam.csv", {"column_1": "s"}, right=right, draftable=False)


@layout(SCARA, rate=250.0)
def scara_portuguese(folder: Path, run: Run) -> Answer:
    """Write a SCARA cell's log, Portuguese: units in a second row, the third joint in mm and N."""
    q = np.degrees(run.q)
    q[:, 2] = 1000 * run.q[:, 2]
    columns, right = wide(run, "Tempo=t; *Posição junta {}=mixed:q; *Torque junta {}=tau", mixed=q)
    units = ["s", "graus", "graus", "mm", "graus", "Nm", "Nm", "N", "Nm"]
    head = ",".join(columns) + "\n" + ",".join(units) + "\n"
    table(folder / "dados.csv", columns, head, header=False, float_format="%.5f")
    right["q"] = (Signal(right["q"][0].columns, ("deg,deg,mm,deg", "graus,graus,mm,graus")),)
    right["tau"] = (Signal(right["tau"][0].columns, ("N m,N m,N,N m", "Nm,Nm,N,Nm")),)
    return Answer("dados.csv", {"Tempo": "s"}, right=right)


@layout(THREE, robot="robot.toml", rate=200.0)
def dutch_two_headers(folder: Path, run: Run) -> Answer:
    """Write a Dutch spreadsheet: the joints' names above, "Hoek [°]", "Koppel [Nm]" below each,
    semicolons.
    """
    columns: dict = {"Tijd [s]": run.t}
    for j, joint in enumerate(run.arm.joints):
        columns |= {
            f"{joint}/Hoek [°]": np.degrees(run.q[:, j]),
            f"{joint}/Koppel [Nm]": run.tau[:, j],
        }
    above = ";".join(["", *(cell for joint in run.arm.joints for cell in (joint, ""))])
    head = above + "\n" + ";".join(name.rpartition("/")[2] for name in columns) + "\n"
    table(
        folder / "meting.csv",
        columns,
        head,
        sep=";",
        decimal=",",
        header=False,
        float_format="%.5f",
    )
    right = {"q": (Signal(tuple(f"{j} Hoek [°]" for j in run.arm.joints), UNITS["q°"]),)}
    right["tau"] = (Signal(tuple(f"{j} Koppel [Nm]" for j in run.arm.joints), NM),)
    return Answer("meting.csv", {"Tijd [s]": "s"}, right=right, texts=False)


@layout(GEN3, rate=200.0)
def like_neighbours_exchanged(folder: Path, run: Run) -> Answer:
    """Write a bus log by node number, nodes 5 and 6 wired the other way round: only the motion
    itself tells.
    """
    order = [0, 1, 2, 3, 5, 4, 6]
    more = {"angle": run.q[:, order], "load": run.tau[:, order]}
    specs = "t_s=t; *node{}_pos_rad=angle:q; *node{}_trq_Nm=load:tau"
    columns, right = wide(run, specs, **more)
    table(folder / "bus.csv", columns)
    right = {
        r: (Signal(tuple(s[0].columns[k] for k in order), s[0].units),) for r, s in right.items()
    }
    return Answer("bus.csv", {"t_s": "s"}, right=right, draftable=False)


@layout(SIX, rate=100.0, how="points", size=0.05)
def small_motion_in_degrees(folder: Path, run: Run) -> Answer:
    """Write a calibration run of a few degrees: positions in deg without a unit and without
    velocities.
    """
    specs = "time_s=t; *axis{}_position=q°; *axis{}_torque_Nm=tau"
    return recorded(folder, run, "calibration.csv", {"time_s": "s"}, specs, known=False)


@layout(SIX, rate=250.0, how="turns")
def russian_units_after_comma(folder: Path, run: Run) -> Answer:
    """Write a Russian test rig in cp1251: "Угол оси 1, град", "Момент оси 1, Н·м", semicolons,
    decimal commas.
    """
    specs = (
        "Время, с=t; *Заданный угол оси {}, град=q_ref°; *Угол оси {}, град=q°; *Момент оси {}, "
        "Н·м=tau"
    )
    columns, right = wide(run, specs)
    columns = {name.replace("·", "*"): v for name, v in columns.items()}
    right["tau"] = (Signal(names("Момент оси {}, Н*м", 6), NM),)
    table(
        folder / "opyt.csv", columns, sep=";", decimal=",", encoding="cp1251", float_format="%.5f"
    )
    return Answer("opyt.csv", {"Время, с": "s"}, right=right)


@layout(UR, rate=100.0)
def positions_in_unknown_order(folder: Path, run: Run) -> Answer:
    """position0 … and effort0 … of a JointState whose names were thrown away: alphabetical, which
    nothing says.
    """
    columns: dict = {"time": 1.7e9 + run.t}
    for part, v in (("position", run.q), ("effort", run.tau)):
        columns |= {f"field.{part}{k}": v[:, j] for k, j in enumerate(ALPHABETICAL)}
    table(folder / "states.csv", columns)
    order = [ALPHABETICAL.index(j) for j in range(6)]
    right = {"q": (Signal(tuple(f"field.position{k}" for k in order), RAD),)}
    right["tau"] = (Signal(tuple(f"field.effort{k}" for k in order), NM),)
    return Answer("states.csv", {"time": "s"}, right=right, draftable=False)
