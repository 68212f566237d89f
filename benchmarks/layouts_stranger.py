"""Write one simulated motion as thirty-seven recordings, by an engineer who has not seen the
importer.

Only the form of a layout was known to him, not how files are read or how
columns of nested files are addressed. Addresses are therefore neutral: the column's heading in a
table, "path[k]" (from 0) for column k of an array at a path, "field[id]" in a long table. `known`
is False where the file leaves something open (motor side without gear, counts, % of a rated value,
no time, no unit), so that asking is right.
"""

import json
import re
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
from scipy.io import savemat

from benchmarks.import_layouts import (
    Answer,
    current,
    layout,
    recorded,
    stamps,
    state,
    table,
    values,
    vector,
    wide,
)
from benchmarks.recorded_arm import LEG, SEVEN, SIX, THREE, UR, Run

DATE = "*"  # time of day and date as text: it has no unit


def answer(file: str, time: dict, form: str, joints, specs: str, known: bool = True) -> Answer:
    """State what is true of nested files by "part=role:unit; …": form with @ for the part."""
    right: dict = {}
    for spec in specs.split("; "):
        part, _, role = spec.rpartition("=")
        state(right, form.replace("@", part), joints, role)
    if Path(file).suffix in (".npz", ".mat", ".h5", ".hdf5"):
        time = {address(name): unit for name, unit in time.items()}
        right = {
            role: tuple(replace(s, columns=tuple(map(address, s.columns))) for s in signals)
            for role, signals in right.items()
        }
    return Answer(file, time, right=right, draftable=known)


def address(name: str) -> str:
    """Return what the importer calls column k (from 0) of an array: "a/b[k]" is "a.b_<k + 1>"."""
    return re.sub(r"\[(\d+)\]$", lambda m: f"_{int(m[1]) + 1}", name.replace("/", "."))


@layout(SIX, rate=250.0)
def kuka_rsi_xml(folder: Path, run: Run) -> Answer:
    """KUKA RSI: one XML telegram a line as the server received it; deg, time IPOC in ms."""
    data, lines = values(run), []
    for k in range(len(run.t)):
        text = '<Rob Type="KUKA"><RIst '
        text += " ".join(f'{n}="{data[s][k]:.4f}"' for n, s in zip("XYZ", "xyz", strict=True))
        for tag, key in (("AIPos", "q°"), ("ASPos", "q_ref°"), ("MACur", "current")):
            axes = (f'A{j}="{x:.4f}"' for j, x in enumerate(data[key][k], 1))
            text += f"/><{tag} " + " ".join(axes)
        lines.append(f'{text}/><Delay D="0"/><IPOC>{4208163634 + data["ms"][k]}</IPOC></Rob>\n')
    (folder / "rsi.log").write_text("".join(lines))
    specs = "AIPos=q°; ASPos=q_ref°; MACur=current:?"
    return answer("rsi.log", {"IPOC": "ms"}, "@.A{}", range(1, 7), specs, known=False)


@layout(SIX, rate=250.0)
def kuka_trace_de(folder: Path, run: Run) -> Answer:
    """KUKA oscilloscope by a German panel: cp1252, semicolons, decimal commas, K of the motors."""
    specs = "Zeit [s]=t; *Sollposition A{} [°]=q_ref°; *Istposition A{} [°]=q°;"
    specs += "*Istgeschwindigkeit A{} [°/s]=dq°; *Istmoment A{} [Nm]=tau; Strom A{} [A]=current;"
    specs += "Motortemperatur A{} [K]=kelvin"
    head = "KRC Trace;V8.6.9\nDatei;TRACE_DEF_Übung.r64\nDatum;12.03.2024 09:41\n\n"
    how = {"sep": ";", "decimal": ",", "float_format": "%.5f"}
    return recorded(
        folder,
        run,
        "Trace.csv",
        {"Zeit [s]": "s"},
        specs,
        data={"kelvin": run.temperature + 273},
        head=head,
        encoding="cp1252",
        **how,
    )


@layout(SEVEN, rate=100.0)
def sunrise_data_recorder(folder: Path, run: Run) -> Answer:
    """KUKA Sunrise DataRecorder of an iiwa: blanks, s and ns apart, external torque first."""
    ticks = values(run)["ms"] + 1699871234250
    specs = "ZeitInSec=s; ZeitInNanoSec=ns; axisTauExtMsr_LBR_iiwa_14_R820_1_A{}=ext;"
    specs += "*axisTauMsr_LBR_iiwa_14_R820_1_A{}=tau; *axisQCmd_LBR_iiwa_14_R820_1_A{}=q_ref;"
    specs += "*axisQMsr_LBR_iiwa_14_R820_1_A{}=q; cartPosMsr_X=x; cartPosMsr_Y=y; cartPosMsr_Z=z"
    return recorded(
        folder,
        run,
        "Recording_3.log",
        {"ZeitInSec+ZeitInNanoSec": "s+ns"},
        specs,
        data={"s": ticks // 1000, "ns": ticks % 1000 * 1_000_000},
        sep=" ",
        float_format="%.9f",
    )


@layout(SEVEN, robot=None, rate=200.0)
def spdlog_controller(folder: Path, run: Run) -> Answer:
    """Write an own controller's spdlog file: start-up lines, bracketed vectors, warnings
    between.
    """
    lines = ["[2024-05-03 14:02:10.981] [main] [info] EtherCAT master: 7 slaves in OP, dc 5 ms"]
    lines.append("[2024-05-03 14:02:11.002] [main] [warning] slave 6: torque sensor offset -0.03")
    for k, when in enumerate(stamps(run, "%Y-%m-%d %H:%M:%S.%f")):
        text = f"[{when[:-3]}] [rt] [debug] q=[{vector(run.q[k])}] dq=[{vector(run.dq[k])}]"
        lines.append(f"{text} tau_m=[{vector(run.tau[k])}] tau_c=[{vector(run.tau_ext[k])}]")
        if k % 731 == 730:
            lines.append(f"[{when[:-3]}] [rt] [warning] cycle overrun by {k % 37} us")
    (folder / "controller.log").write_text("\n".join(lines) + "\n")
    specs = "q=q; dq=dq; tau_m=tau"
    return answer("controller.log", {"timestamp": DATE}, "@[{}]", range(7), specs)


@layout(SIX, rate=250.0)
def abb_egm(folder: Path, run: Run) -> Answer:
    """ABB EGM messages flattened by a Python script: deg, s and us apart, no torque."""
    ticks = values(run)["ms"] + 1706700000500
    specs = "header.seqno=count; header.mtype=MSGTYPE_DATA; *feedBack.joints.joints[{}]=q°;"
    specs += "feedBack.cartesian.pos.x=x; feedBack.cartesian.pos.y=y; feedBack.cartesian.pos.z=z;"
    specs += "feedBack.time.sec=s; feedBack.time.usec=us; *planned.joints.joints[{}]=q_ref°;"
    specs += "motorState.state=MOTORS_ON; mciConvergenceMet=False; utilizationRate=31.5"
    columns, right = wide(run, specs, range(6), s=ticks // 1000, us=ticks % 1000 * 1000)
    table(folder / "egm_log.csv", columns)
    time = {"feedBack.time.sec+feedBack.time.usec": "s+us"}
    return Answer("egm_log.csv", time, right=right)


@layout(THREE, robot=None, rate=250.0)
def abb_motor_signals(folder: Path, run: Run) -> Answer:
    """ABB test signals by number, a motor each: resolver angle, speed, torque of the motor side."""
    gear = np.array([101.0, -120.5, 89.0])
    more = {"angle": run.q * gear, "set": run.dq * gear * 1.001, "speed": run.dq * gear}
    specs = "Time=t; *ROB_1 axis {} (1) resolver_angle=angle:q; ROB_1 axis {} (4) speed_ref=set;"
    specs += "*ROB_1 axis {} (6) speed=speed:dq; *ROB_1 axis {} (9) torque_ref=torque:tau"
    head = "Test Signal Viewer 1.5\t2023-11-20 08:13\nController\tIRB4600_cell3\n"
    return recorded(
        folder,
        run,
        "signals.txt",
        {"Time": "s"},
        specs,
        joint_wise=True,
        known=False,
        data={"torque": run.tau / gear, **more},
        head=head,
        sep="\t",
        float_format="%.6g",
    )


@layout(SIX, rate=125.0)
def fanuc_j519(folder: Path, run: Run) -> Answer:
    """FANUC stream motion status packets: pose before joints, nine axes of which six are used."""
    specs = "packet_type=0; version=1; seq=count; status=15; io_value=0; timestamp_ms=tick; X=x;"
    specs += "Y=y; Z=z; W=rx; P=ry; R=rz; *J{}=q°; J7=0; J8=0; J9=0; *I{}=current; I7=0; I8=0; I9=0"
    return recorded(
        folder,
        run,
        "j519.csv",
        {"timestamp_ms": "ms"},
        specs,
        known=False,
        data={"tick": values(run)["ms"] + 883120},
        float_format="%.4f",
    )


@layout(SIX, robot=None, rate=125.0)
def fanuc_data_monitor(folder: Path, run: Run) -> Answer:
    """FANUC data monitor listing: fixed width, "%" of the torque limit, ticks since start in ms."""
    load = 100 * run.tau / np.array([420.0, 560.0, 310.0, 45.0, 45.0, 28.0])
    specs = "Tick(ms)=ms; *J{}Pos(deg)=q°; *J{}Trq(%)=load:tau:%; J{}DTrq(%)=rest"
    columns, right = wide(run, specs, load=load, rest=0.1 * load)
    text = "DATA MONITOR REPORT  R-30iB Plus  V9.10P/22\nSCHEDULE 1 : AXIS CHECK\nPROG: PICK_A\n\n"
    text += "".join(f"{name:>12}" for name in columns) + "\n" + "-" * 12 * len(columns) + "\n"
    for row in np.column_stack(list(columns.values())):
        text += "".join(f"{x:12.3f}" for x in row) + "\n"
    (folder / "SAMPLE01.DT").write_text(text + "[EOF]\n")
    return Answer("SAMPLE01.DT", {"Tick(ms)": "ms"}, right=right, draftable=False)


@layout(UR, rate=125.0)
def ur_rtde_record(folder: Path, run: Run) -> Answer:
    """UR RTDE client's record.py: blanks; currents measured, moments only of the model."""
    specs = "timestamp=clock; *target_q_{}=q_ref; target_moment_{}=model; *actual_q_{}=q;"
    specs += "*actual_qd_{}=dq; *actual_current_{}=current; joint_temperatures_{}=temp;"
    specs += "actual_TCP_pose_0=x; actual_TCP_pose_1=y; actual_TCP_pose_2=z; robot_mode=7"
    more = {"clock": 51234.008 + run.t, "model": 0.93 * run.tau + 0.4}
    return recorded(
        folder,
        run,
        "robot_data.csv",
        {"timestamp": "s"},
        specs,
        range(6),
        known=False,
        data=more,
        sep=" ",
    )


@layout(SEVEN, rate=200.0)
def franka_state_jsonl(folder: Path, run: Run) -> Answer:
    """echo_robot_state of libfranka into a file: a JSON object a line, time in ms since boot."""
    lines, zeros, data = [], [0.0] * 7, values(run)
    for k in range(len(run.t)):
        place = [data["x"][k] / 1000, data["y"][k] / 1000, data["z"][k] / 1000, 1]
        state_ = {"O_T_EE": [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, *place], "elbow": [0.01, -1]}
        state_ |= {"tau_J": run.tau[k].tolist(), "tau_J_d": zeros, "dtau_J": zeros}
        state_ |= {"q": run.q[k].tolist(), "q_d": run.q_ref[k].tolist(), "dq": run.dq[k].tolist()}
        state_ |= {"joint_contact": zeros, "tau_ext_hat_filtered": run.tau_ext[k].tolist()}
        state_ |= {"current_errors": [], "robot_mode": "Move", "time": 7716251 + int(data["ms"][k])}
        lines.append(json.dumps(state_) + "\n")
    (folder / "states.jsonl").write_text("".join(lines))
    specs = "q=q; dq=dq; tau_J=tau; q_d=q_ref"
    return answer("states.jsonl", {"time": "ms"}, "@[{}]", range(7), specs)


@layout(SEVEN, rate=100.0)
def kortex_json(folder: Path, run: Run) -> Answer:
    """Kinova Kortex feedback: one JSON, a list of actuators a frame; deg from 0 to 360, deg/s."""
    frames, data = [], values(run)
    for k in range(len(run.t)):
        motors = []
        for j in range(7):
            motor = {"command_id": k % 65536, "status_flags": 67125504, "jitter_comm": 4}
            motor |= {"position": data["q°"][k, j] % 360, "velocity": data["dq°"][k, j]}
            motor |= {"torque": run.tau[k, j], "current_motor": data["current"][k, j]}
            motors.append(motor | {"voltage": 24.1, "temperature_motor": run.temperature[k, j]})
        frame = {"frame_id": k % 65536, "host_time": 1702911111.5 + run.t[k], "actuators": motors}
        frames.append(frame | {"base": {"active_state": 12, "tool_pose_x": data["x"][k] / 1000}})
    (folder / "feedback.json").write_text(json.dumps({"arm": "GEN3 7DoF", "frames": frames}))
    specs = "position=q°; velocity=dq°; torque=tau"
    return answer("feedback.json", {"host_time": "s"}, "actuators[{}].@", range(7), specs)


@layout(SIX, rate=100.0)
def xarm_sdk(folder: Path, run: Run) -> Answer:
    """xArm SDK's lists by csv.writer: seven angles of which the last is 0, gaps, ISO dates."""
    lost = np.random.default_rng(len(run.t)).random(len(run.t)) < 0.01
    specs = "ts=date; mode=1; state=1; position_0=x; position_1=y; position_2=z; *angles_{}=q°;"
    specs += "angles_6=0.0; *realtime_joint_speeds_{}=dq°; realtime_joint_speeds_6=0.0;"
    specs += "*joints_torque_{}=torque:tau; joints_torque_6=0.0; error_code=0; cmd_num=3"
    more = {"torque": np.where(lost[:, None], np.nan, run.tau)}
    return recorded(
        folder,
        run,
        "xarm6_run.csv",
        {"ts": DATE},
        specs,
        range(6),
        data={"date": stamps(run, "%Y-%m-%dT%H:%M:%S.%f"), **more},
        float_format="%.5f",
    )


@layout(SIX, rate=125.0)
def denso_control_log(folder: Path, run: Run) -> Answer:
    """Denso WINCAPS control log: Shift-JIS title, commanded and encoder values, % of current."""
    load = 100 * run.tau / np.array([300.0, 300.0, 180.0, 40.0, 40.0, 20.0])
    specs = "Time[ms]=ms; Program=PRO1; Line=14; *J{} Command[deg]=q_ref°; *J{} Encoder[deg]=q°;"
    specs += "*J{} Current[%]=load:current:%; J{} Load[%]=heat"
    how = {"quoting": 2, "float_format": "%.4f", "encoding": "shift_jis"}
    return recorded(
        folder,
        run,
        "ControlLog.csv",
        {"Time[ms]": "ms"},
        specs,
        joint_wise=True,
        known=False,
        data={"load": load, "heat": 0.8 * np.abs(load)},
        head='"制御ログ","VS-060A4","RC8"\n"8ms"\n',
        **how,
    )


@layout(SIX, robot=None, rate=250.0)
def yaskawa_pulses(folder: Path, run: Run) -> Answer:
    """Yaskawa controller polled: pulses of S, L, U, R, B, T; speed in pulses/s, torque in %."""
    scale = np.array([134000.0, 120000.0, 100000.0, 80000.0, 80000.0, 52000.0]) * 10
    load = 100 * run.tau / np.array([350.0, 400.0, 200.0, 30.0, 30.0, 18.0])
    more = {"pls": np.round(run.q * scale).astype(int), "spd": np.round(run.dq * scale).astype(int)}
    more |= {"trq": np.round(load, 1), "clock": stamps(run, "%H:%M:%S")}
    specs = "No.=count; Date=2023/09/14; Time=clock; Elapsed(ms)=ms; JOB=TEST-01; LINE=7;"
    specs += "*PLS_{}=pls:q:counts; *SPD_{}=spd:dq:counts/s; *TRQ_{}=trq:tau:%"
    return recorded(
        folder,
        run,
        "YRC1000_0914.CSV",
        {"Elapsed(ms)": "ms"},
        specs,
        "SLURBT",
        known=False,
        data=more,
    )


def dynamixel(run: Run) -> dict[str, np.ndarray]:
    """Register values of X-series servos: 4096 a turn about 2048, 0.229 rpm, 2.69 mA."""
    raw = {"pos": 2048 + run.q * 2048 / np.pi, "goal": 2048 + run.q_ref * 2048 / np.pi}
    raw |= {"vel": run.dq * 30 / np.pi / 0.229, "cur": current(run) / 0.00269}
    return {name: np.round(v).astype(int) for name, v in raw.items()}


@layout(LEG, robot=None, rate=100.0)
def dynamixel_lines(folder: Path, run: Run) -> Answer:
    """Dynamixel read_write output with epoch times: a line a servo, ticks of 4096 and 2.69 mA."""
    raw = dynamixel(run)
    lines = ["Succeeded to open the port", "Succeeded to change the baudrate"]
    lines += [f"Dynamixel#{i} has been successfully connected" for i in (11, 12)]
    for k, j in np.ndindex(len(run.t), 2):
        text = f"{1709374332.2 + run.t[k]:.4f} [ID:{11 + j:03d}] GoalPos:{raw['goal'][k, j]:05d}  "
        text += f"PresPos:{raw['pos'][k, j]:05d} PresVel:{raw['vel'][k, j]} "
        lines.append(f"{text}PresCur:{raw['cur'][k, j]}")
    (folder / "servo_out.txt").write_text("\n".join(lines) + "\n")
    specs = "PresPos=q:counts; PresVel=dq:?; PresCur=current:?; GoalPos=q_ref:counts"
    return answer("servo_out.txt", {"column_1": "s"}, "@[{}]", (11, 12), specs, known=False)


@layout(THREE, robot="robot.toml", rate=100.0)
def dynamixel_long(folder: Path, run: Run) -> Answer:
    """Dynamixel table in long form: a row a servo, raw register values under the manual's names."""
    raw, n = dynamixel(run), len(run.t)
    columns = {"time_ms": np.repeat(values(run)["ms"], 3), "ID": np.tile([1, 2, 5], n)}
    columns |= {"Torque Enable": 1, "Present Position": raw["pos"].ravel()}
    columns |= {"Present Velocity": raw["vel"].ravel(), "Present Current": raw["cur"].ravel()}
    columns |= {
        "Present Temperature": np.round(run.temperature).astype(int).ravel(),
        "Input Voltage": 120,
    }
    table(folder / "dxl.tsv", columns, sep="\t")
    specs = "Position=q:counts; Velocity=dq:?; Current=current:?"
    return answer("dxl.tsv", {"time_ms": "ms"}, "Present @[{}]", (1, 2, 5), specs, known=False)


@layout(THREE, rate=250.0)
def moteus_registers(folder: Path, run: Run) -> Answer:
    """moteus registers of three servos: revolutions, rev/s and N m of the output; nan commands."""
    more = {"rev": run.q / (2 * np.pi), "speed": run.dq / (2 * np.pi), "stamp": 1.68e9 + run.t}
    specs = "timestamp=stamp; servo{}.MODE=10; *servo{}.POSITION=rev:q:rev;"
    specs += "*servo{}.VELOCITY=speed:dq:rev/s; *servo{}.TORQUE=tau; servo{}.Q_CURRENT=current;"
    specs += "servo{}.COMMAND_POSITION=nan; servo{}.TEMPERATURE=temp; servo{}.FAULT=0"
    return recorded(
        folder,
        run,
        "moteus.csv",
        {"timestamp": "s"},
        specs,
        (11, 12, 13),
        joint_wise=True,
        known=False,
        data=more,
    )


@layout(LEG, rate=500.0)
def elmo_recorder(folder: Path, run: Run) -> Answer:
    """Elmo Application Studio recording: signals grouped by quantity, counts, active current."""
    counts = np.array([1048576, 524288]) / (2 * np.pi)
    more = {"pos": np.round(run.q * counts), "vel": np.round(run.dq * counts)}
    specs = "Time [sec]=t; *Position [cnt] (a0{})=pos:q:counts;"
    specs += "*Velocity [cnt/sec] (a0{})=vel:dq:counts/s; *Active Current [A] (a0{})=current;"
    specs += "Position Error [cnt] (a0{})=lag"
    head = "Recording Name,Rec_17\nSampling Time [usec],2000\nTrigger,Immediate\n\n"
    return recorded(
        folder,
        run,
        "Rec_17.csv",
        {"Time [sec]": "s"},
        specs,
        known=False,
        data={"lag": np.round((run.q_ref - run.q) * counts), **more},
        head=head,
        float_format="%.6f",
    )


@layout(THREE, robot="robot.toml", rate=500.0)
def twincat_scope_pairs(folder: Path, run: Run) -> Answer:
    """TwinCAT Scope text: a time column [ms] before every channel, axis in deg, torque 0.1 %."""
    load = np.round(1000 * run.tau / np.array([90.0, 70.0, 30.0]))
    specs = "*GVL.Axis{}.ActPos=q°; *GVL.Axis{}.ActVelo=dq°; *GVL.Axis{}.ActTorque=load:tau:0.1 %"
    columns, right = wide(run, specs, joint_wise=True, load=load)
    text = "Name\tScope Project 4\nFile\tC:\\TwinCAT\\Scope\\run.svdx\n"
    text += "Starttime of export\t133543218451230000\t12:44:05,123\nEndtime of export\t0\n\n"
    for key, cell in (("Name", ""), ("SampleTime[ms]", "2"), ("SymbolName", ""), ("Port", "851")):
        text += "\t".join(f"{key}\t{cell or name}" for name in columns) + "\n"
    pairs = np.column_stack([x for v in columns.values() for x in (1000 * run.t, v)])
    rows = ["\t".join(f"{x:.7g}".replace(".", ",") for x in row) for row in pairs]
    (folder / "scope.txt").write_text(text + "\n" + "\n".join(rows) + "\n")
    return Answer("scope.txt", {"Name": "ms", "SymbolName": "ms"}, right=right, draftable=False)


@layout(LEG, rate=1000.0)
def dspace_mat(folder: Path, run: Run) -> Answer:
    """dSPACE ControlDesk MAT: struct with X (time) and Y, signals named by the block's output."""
    kind = [(key, object) for key in ("Name", "Path", "Unit", "XIndex", "Data")]
    rows = []
    for name, unit, v in (("q", "rad", run.q), ("qd", "rad/s", run.dq), ("T", "Nm", run.tau)):
        for j, part in enumerate(("hip", "knee")):
            path = f"Model Root/Leg/{name}_{part}/Out1"
            rows.append((f"{name}_{part}", path, unit, 1.0, v[None, :, j]))
    axis = {"Name": "HostService", "Unit": "s", "Data": run.t[None]}
    record = {"X": axis, "Y": np.array(rows, dtype=kind)[None], "Capture": {"SamplingPeriod": 1e-3}}
    savemat(folder / "rec_012.mat", {"rec_012": record})
    specs = "q=q; qd=dq; T=tau"
    return answer("rec_012.mat", {"HostService": "s"}, "@_{}", LEG.joints, specs)


@layout(SIX, rate=500.0)
def simulink_to_file(folder: Path, run: Run) -> Answer:
    """Simulink To File (array, v7.3): one unnamed matrix, time first; nothing says what is what."""
    path, right = folder / "log.mat", {}
    with h5py.File(path, "w", userblock_size=512) as file:
        file["ans"] = np.column_stack([run.t, run.q, run.dq, run.tau, run.temperature])
        file["ans"].attrs["MATLAB_class"] = np.bytes_("double")
    title = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon Mar 11 10:22:01 2024 HDF5"
    with path.open("r+b") as file:
        file.write(title.ljust(124) + b"\x00\x02IM")
    for role, first in (("q", 1), ("dq", 7), ("tau", 13)):
        state(right, "ans_{}", range(first + 1, first + 7), role)
    return Answer("log.mat", {"ans_1": "s"}, right=right, draftable=False)


@layout(THREE, robot="robot.toml", rate=200.0)
def labview_lvm_german(folder: Path, run: Run) -> Answer:
    """LabVIEW measurement file: two headers, decimal commas, unit row, empty comment column."""
    columns, right = wide(run, "X_Value=t; *Winkel {}=q°; *Drehmoment {}=tau; Temp {}=temp")
    text = "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\n"
    text += "Decimal_Separator\t,\nMulti_Headings\tNo\nX_Columns\tOne\nTime_Pref\tRelative\n"
    text += "Operator\tLabor\nDate\t2024/02/19\nTime\t15:20:31,4123\n***End_of_Header***\t\n\t\n"
    rows = [["Channels", "9"], ["Samples", *[str(len(run.t))] * 9]]
    rows += [["Y_Unit_Label", *["deg"] * 3, *["N.m"] * 3, *["degC"] * 3]]
    rows += [["X_Dimension", *["Time"] * 9], ["X0", *["0,0000000000000000E+0"] * 9]]
    rows += [["Delta_X", *["0,005000"] * 9], ["***End_of_Header***"], [*columns, "Comment"]]
    for row in np.column_stack(list(columns.values())):
        rows.append([f"{x:.6f}".replace(".", ",") for x in row])
    (folder / "messung.lvm").write_text(text + "".join("\t".join(r) + "\t\n" for r in rows))
    return Answer("messung.lvm", {"X_Value": "s"}, right=right)


@layout(LEG, rate=200.0)
def excel_unicode_text(folder: Path, run: Run) -> Answer:
    """Excel's "Unicode text": UTF-16, tabs, decimal commas, German words, a title above."""
    specs = "Zeit in ms=time; *{} Soll in Grad=q_ref°; *{} Winkel in Grad=q°; *{} Moment in Nm=tau"
    how = {"sep": "\t", "decimal": ",", "float_format": "%.5f", "encoding": "utf-16"}
    return recorded(
        folder,
        run,
        "Versuch 3.txt",
        {"Zeit in ms": "ms"},
        specs,
        ("Hüfte", "Knie"),
        joint_wise=True,
        data={"time": 1000 * run.t},
        head="Prüfstand Bein\t\t\t\t\t\t\n\t\t\t\t\t\t\n",
        **how,
    )


@layout(UR, rate=125.0)
def plotjuggler_merged(folder: Path, run: Run) -> Answer:
    """PlotJuggler CSV of two topics: rows of one topic are blank in the other's columns."""
    specs = "__time=now; /joint_states/header/stamp=stamp; *{}/effort=tau; *{}/position=q;"
    joints = [f"/joint_states/{joint}" for joint in run.arm.joints]
    more = {"now": 1.712e9 + run.t, "stamp": 1.712e9 + run.t - 2e-4}
    columns, right = wide(run, specs + "*{}/velocity=dq", joints, **more)
    order = sorted(columns, key=lambda name: (name != "__time", name))
    other = {"__time": 1.712e9 + run.t[::2] + 0.0031}
    other |= {f"/wrench/wrench/force/{x}": run.tau_ext[::2, 0] for x in "xyz"}
    frame = pd.concat([pd.DataFrame(columns)[order], pd.DataFrame(other)])
    frame.sort_values("__time").to_csv(folder / "pj.csv", index=False, float_format="%.9f")
    return Answer("pj.csv", {"__time": "s", "/joint_states/header/stamp": "s"}, right=right)


@layout(SEVEN, rate=50.0)
def ros2_echo_yaml(folder: Path, run: Run) -> Answer:
    """ros2 topic echo /joint_states > file: YAML documents, two fingers after the arm."""
    names, parts = [*run.arm.joints, "finger_joint1", "finger_joint2"], []
    blocks = (("position", run.q, 0.04), ("velocity", run.dq, 0.0), ("effort", run.tau, 0.0))
    for k, us in enumerate(values(run)["us"]):
        text = f"header:\n  stamp:\n    sec: {1712000000 + us // 1_000_000}\n"
        text += f"    nanosec: {us % 1_000_000 * 1000}\n  frame_id: ''\nname:\n"
        text += "".join(f"- {name}\n" for name in names)
        for key, v, finger in blocks:
            text += f"{key}:\n" + "".join(f"- {x!r}\n" for x in [*v[k].tolist(), finger, finger])
        parts.append(text + "---\n")
    (folder / "joint_states.yaml").write_text("".join(parts))
    time = {"header.stamp.sec+header.stamp.nanosec": "s+ns"}
    specs = "position=q; velocity=dq; effort=tau"
    return answer("joint_states.yaml", time, "@[{}]", range(7), specs)


@layout(SIX, rate=100.0)
def ros2_echo_no_header(folder: Path, run: Run) -> Answer:
    """ros2 topic echo --csv /joint_states: no header; s, ns, frame, six names, then the values."""
    us, right = values(run)["us"], {}
    rows = [1712000000 + us // 1_000_000, us % 1_000_000 * 1000, np.full(len(us), "base_link")]
    rows += [np.full(len(us), name) for name in run.arm.joints]
    rows += [*run.q.T, *run.dq.T, *run.tau.T]
    table(folder / "js.csv", dict(enumerate(rows)), header=False)
    for role, first in (("q", 9), ("dq", 15), ("tau", 21)):
        state(right, "column_{}", range(first + 1, first + 7), role)
    return Answer("js.csv", {"column_1+column_2": "s+ns"}, right=right, draftable=False)


@layout(SEVEN, rate=500.0)
def mujoco_npz(folder: Path, run: Run) -> Answer:
    """MuJoCo roll-out: qpos (7 joints, free body 7), qvel (7 + 6), ctrl of position servos."""
    n, still = len(run.t), np.tile([0.5, 0.1, 0.4, 1.0, 0, 0, 0], (len(run.t), 1))
    data = {"time": run.t, "qpos": np.hstack([run.q, still]), "timestep": 0.002, "ctrl": run.q_ref}
    data |= {"qvel": np.hstack([run.dq, np.zeros((n, 6))]), "ncon": np.full(n, 4)}
    data |= {"qfrc_actuator": np.hstack([run.tau, np.zeros((n, 6))])}
    np.savez_compressed(folder / "rollout_0003.npz", **data)
    specs = "qpos=q; qvel=dq; qfrc_actuator=tau; ctrl=q_ref"
    return answer("rollout_0003.npz", {"time": "s"}, "@[{}]", range(7), specs)


@layout(SEVEN, rate=50.0)
def isaaclab_hdf5(folder: Path, run: Run) -> Answer:
    """Isaac Lab demonstration: obs relative to the rest pose, states absolute, dt in JSON only."""
    settings = {"env_name": "Isaac-Lift-v0", "sim_args": {"dt": 0.01, "decimation": 2}}
    base = "data/demo_0/states/articulation/robot/"
    arrays = (("obs/joint_pos", run.q - 0.3, 0.0), ("obs/joint_vel", run.dq, 0.0))
    arrays = (("actions", run.q_ref - run.q_ref[0], 0.0), *arrays)
    with h5py.File(folder / "dataset.hdf5", "w") as file:
        file.create_group("data").attrs["env_args"] = json.dumps(settings)
        file.create_group("data/demo_0").attrs.update({"num_samples": len(run.t), "success": True})
        arrays = [(f"data/demo_0/{name}", v, finger) for name, v, finger in arrays]
        arrays += [(base + "joint_position", run.q, 0.04), (base + "joint_velocity", run.dq, 0.0)]
        for name, v, finger in [*arrays, (base + "applied_torque", run.tau, 0.0)]:
            file[name] = np.hstack([v, np.full((len(run.t), 2), finger)]).astype("f4")
    specs = "joint_position=q; joint_velocity=dq; applied_torque=tau"
    right = answer("dataset.hdf5", {}, base + "@[{}]", range(7), specs, known=False)
    return replace(right, rate=50.0)


@layout(SIX, rate=50.0)
def pandas_array_cells(folder: Path, run: Run) -> Answer:
    """pandas with an array in every cell, as str(array) gives it: blanks, line breaks, brackets."""
    arrays = {"observation.qpos": run.q, "observation.qvel": run.dq, "observation.effort": run.tau}
    columns = {"episode": 0, "timestamp": np.float32(run.t)}
    columns |= {name: [str(r) for r in v] for name, v in (arrays | {"action": run.q_ref}).items()}
    pd.DataFrame(columns | {"next.done": False}).to_csv(folder / "episode_000000.csv")
    specs = "observation.qpos=q; observation.qvel=dq; observation.effort=tau; action=q_ref"
    return answer("episode_000000.csv", {"timestamp": "s"}, "@[{}]", range(6), specs)


@layout(THREE, robot="robot.toml", rate=250.0)
def pandas_two_headers(folder: Path, run: Run) -> Answer:
    """pandas with two levels of columns and a timedelta index: "0 days 00:00:00.004000"."""
    specs = "*angle_deg/J{}=q°; *rate_dps/J{}=dq°; *torque_Nm/J{}=tau; temp_C/J{}=temp"
    columns, right = wide(run, specs)
    right = {
        k: tuple(replace(s, columns=tuple(c.replace("/", " ") for c in s.columns)) for s in v)
        for k, v in right.items()
    }
    index = pd.to_timedelta(values(run)["us"], unit="us").rename("elapsed")
    frame = pd.DataFrame({tuple(name.split("/")): v for name, v in columns.items()})
    frame = frame.set_index(index).rename_axis(columns=["signal", "joint"])
    frame.to_csv(folder / "frame.csv")
    return Answer("frame.csv", {"elapsed": DATE}, right=right)


@layout(SIX, rate=500.0)
def numpy_savetxt(folder: Path, run: Run) -> Answer:
    """np.savetxt with notes behind "#": joint by joint q, dq and tau; the last note names them."""
    columns, right = wide(run, "t=t; *tau{}=tau; *q{}=q; *dq{}=dq", joint_wise=True)
    notes = "excitation trajectory 4 of 10, payload none\ngit 3f9c1ab-dirty, host rt-pc2\n"
    notes += "units: s, Nm, rad, rad/s\n" + " ".join(columns)
    np.savetxt(folder / "exc_04.txt", np.column_stack(list(columns.values())), header=notes)
    return Answer("exc_04.txt", {"t": "s"}, right=right)


@layout(THREE, rate=250.0)
def matlab_timetable_sec(folder: Path, run: Run) -> Answer:
    """MATLAB writetimetable: times "0.004 sec", matrices split into _1 … _3, units nowhere."""
    specs = "Time=time; *Theta_{}=q°; *ThetaDes_{}=q_ref°; *Omega_{}=dq°; *Torque_{}=tau; Enabled=1"
    time = np.array([f"{t:.5g} sec" for t in run.t])
    return recorded(
        folder,
        run,
        "TT.txt",
        {"Time": "s"},
        specs + "; Phase=ident",
        known=False,
        data={"time": time},
        float_format="%.15g",
    )


@layout(LEG, rate=500.0)
def json_channels(folder: Path, run: Run) -> Answer:
    """JSON by channel with units mrad and mNm; only a sampling rate, no times."""
    channels = []
    for j, part in enumerate(("hip", "knee")):
        for name, unit, v in (("angle", "mrad", run.q), ("torque", "mNm", run.tau)):
            samples = np.round(1000 * v[:, j], 3).tolist()
            channels.append({"name": f"{part}_{name}", "unit": unit, "values": samples})
    meta = {"device": "legbench", "fs_hz": 500, "start": "2024-01-15T10:00:00Z"}
    (folder / "bench.json").write_text(json.dumps({"meta": meta, "channels": channels}, indent=1))
    right = answer("bench.json", {}, "{}_@", LEG.joints, "angle=q:mrad; torque=tau:mNm")
    return replace(right, rate=500.0)


@layout(SIX, rate=500.0)
def hdf5_german(folder: Path, run: Run) -> Answer:
    """Write a laboratory's HDF5: a group a joint, German names, units as attributes, times in
    us.
    """
    data = values(run) | {"rpm": run.dq * 30 / np.pi}
    parts = (("Lage_ist", "Grad", "q°"), ("Lage_soll", "Grad", "q_ref°"))
    parts += (
        ("Moment_ist", "Nm", "tau"),
        ("Drehzahl_ist", "1/min", "rpm"),
        ("Wicklungstemperatur", "°C", "temp"),
    )
    with h5py.File(folder / "Messung_07.h5", "w") as file:
        file["Messung_07/Zeitstempel_us"] = (data["us"] + 1_700_000_000_000_000).astype(np.uint64)
        for j in range(6):
            for name, unit, key in parts:
                path = f"Messung_07/Gelenk_{j + 1}/{name}"
                file[path] = data[key][:, j].astype("f4")
                file[path].attrs["Einheit"] = unit
    specs = "Lage_ist=q°; Lage_soll=q_ref°; Drehzahl_ist=dq:rpm; Moment_ist=tau"
    time = {"Messung_07/Zeitstempel_us": "us"}
    return answer("Messung_07.h5", time, "Messung_07/Gelenk_{}/@", range(1, 7), specs)


@layout(SIX, rate=250.0)
def mecademic_log(folder: Path, run: Run) -> Answer:
    """Mecademic trajectory logger: timestamps in us, deg, deg/s, torque in % of the maximum."""
    specs = "Timestamp=stamp; *TargetJointPos_{}=q_ref°; TargetCartPos_1=x; TargetCartPos_2=y;"
    specs += "TargetCartPos_3=z; *JointPos_{}=q°; *JointVel_{}=dq°; *JointTorq_{}=load:tau:%;"
    load = 100 * run.tau / np.array([200.0, 200.0, 90.0, 30.0, 25.0, 12.0])
    more = {"stamp": 83_120_000 + values(run)["us"], "load": load}
    return recorded(
        folder,
        run,
        "Meca500_R3_log.csv",
        {"Timestamp": "us"},
        specs + "CartPos_1=x; CartPos_2=y; CartPos_3=z",
        known=False,
        data=more,
        float_format="%.4f",
    )


@layout(THREE, robot="robot.toml", rate=200.0)
def hebi_mat(folder: Path, run: Run) -> Answer:
    """HEBI log converted to MAT: matrices by name, commands partly NaN, currents next to effort."""
    blank = np.where(run.t[:, None] < run.t[0] + 0.2, np.nan, 1.0)
    log = {"time": run.t[:, None], "position": run.q, "velocity": run.dq, "effort": run.tau}
    log |= {"positionCmd": run.q_ref * blank, "velocityCmd": np.nan * run.q}
    log |= {"effortCmd": 0.97 * run.tau * blank, "motorCurrent": current(run)}
    log |= {"motorWindingTemperature": run.temperature, "pwmCmd": np.clip(0.02 * run.tau, -1, 1)}
    savemat(folder / "hebi_20240214.mat", log, do_compression=True)
    specs = "position=q; velocity=dq; effort=tau; positionCmd=q_ref"
    return answer("hebi_20240214.mat", {"time": "s"}, "@[{}]", range(3), specs)


@layout(SIX, rate=50.0)
def influx_annotated(folder: Path, run: Run) -> Answer:
    """InfluxDB annotated CSV, long: one table a field and joint below each other, RFC 3339."""
    text = "#datatype,string,long,dateTime:RFC3339,double,string,string,string\n"
    text += "#group,false,false,false,false,true,true,true\n#default,_result,,,,,,\n"
    text += ",result,table,_time,_value,_field,_measurement,joint\n"
    rows, when, data = [], stamps(run, "%Y-%m-%dT%H:%M:%S.%fZ"), values(run)
    series = [("effort", "tau"), ("position", "q"), ("velocity", "dq")]
    for number, (k, j) in enumerate(np.ndindex(3, 6)):
        tail = f"{series[k][0]},joint_states,{run.arm.joints[j]}\n"
        for date, x in zip(when, data[series[k][1]][:, j], strict=True):
            rows.append(f",,{number},{date},{x:.9g},{tail}")
    (folder / "query.csv").write_text((text + "".join(rows)).replace("\n", "\r\n"))
    specs = "position=q; velocity=dq; effort=tau"
    return answer("query.csv", {"_time": DATE}, "@[{}]", run.arm.joints, specs, known=False)
