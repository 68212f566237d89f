"""Write one motion as forty-two further recordings of robots, drives and tools, each with its answer.

Written down by an engineer who had not seen how the importer decides. The form of an answer is that
of `outside_layouts`; `draftable` is False where the file leaves something open, so that a draft
without a blank cannot be right.
"""

import json
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
from scipy.io import savemat

from benchmarks.outside_formats import (
    FOUR,
    GEN3,
    IIWA,
    PANDA,
    SCARA,
    SIX,
    THREE,
    TWO,
    UNITS,
    UR,
    stamps,
    table,
    values,
    wide,
)  # fmt: skip
from benchmarks.outside_formats_5 import DATE, answer
from benchmarks.outside_layouts import Answer, Run, Signal, layout

UNITS |= {"deg/s": ("deg/s", "°/s"), "0.01": ()}
SEVEN = range(7)


@layout(UR, rate=125.0)
def bagpy_csv(folder: Path, run: Run) -> Answer:
    """bagpy's message_by_topic of /joint_states: lists flattened, names as a list in one cell."""
    order = [2, 1, 0, 3, 4, 5]
    clock = 1712143331.25 + run.t
    columns = {"Time": clock, "header.seq": np.arange(len(run.t)) + 771}
    columns |= {"header.stamp.secs": np.floor(clock).astype(int)}
    columns |= {"header.stamp.nsecs": np.round(clock % 1 * 1e9).astype(int) % 10**9}
    columns |= {"header.frame_id": "base", "name": str([UR.joints[k] for k in order])}
    for name, v in (("position", run.q), ("velocity", run.dq), ("effort", run.tau)):
        columns |= {f"{name}_{k}": v[:, order[k]] for k in range(6)}
    table(folder / "joint_states.csv", columns, float_format="%.9f")
    right = {
        role: (Signal(tuple(f"{name}_{order.index(k)}" for k in range(6)), UNITS[role]),)
        for role, name in (("q", "position"), ("dq", "velocity"), ("tau", "effort"))
    }
    time = {"Time": "s", "header.stamp.secs+header.stamp.nsecs": "s+ns"}
    return Answer("joint_states.csv", time, right=right)


@layout(SIX, rate=250.0)
def jtc_state_csv(folder: Path, run: Run) -> Answer:
    """ros2_control controller_state flattened: reference, feedback, error, output per quantity."""
    specs = "__time=clock; *reference.positions[{}]=q_ref; *reference.velocities[{}]=dq_ref;"
    specs += "*feedback.positions[{}]=q; *feedback.velocities[{}]=dq; error.positions[{}]=err;"
    specs += "error.velocities[{}]=verr; output.effort[{}]=out; speed_scaling_factor=1.0"
    more = {"err": run.q_ref - run.q, "verr": run.dq_ref - run.dq, "clock": 1.7155e9 + run.t}
    columns, right = wide(run, specs, range(6), out=run.tau_ref, **more)
    right["tau"] = (Signal(tuple(f"output.effort[{j}]" for j in range(6)), UNITS["tau"],
                           run.tau_ref),)  # fmt: skip
    table(folder / "controller_state.csv", columns, float_format="%.9f")
    return Answer("controller_state.csv", {"__time": "s"}, right=right,
                  torque=("held-command",))  # fmt: skip


@layout(SIX, rate=250.0)
def kuka_sysvars(folder: Path, run: Run) -> Answer:
    """KRL variables by a C# client: $AXIS_ACT [deg], $VEL_AXIS_ACT [% of the motor], no units."""
    speed = 100 * run.dq / np.array([2.7, 2.5, 2.6, 5.2, 5.1, 6.5]) * np.array([1, -1, 1, 1, -1, 1])
    specs = "IPOC=tick; *$AXIS_ACT.A{}=q°; $POS_ACT.X=x; $POS_ACT.Y=y; $POS_ACT.Z=z;"
    specs += "$VEL_AXIS_ACT[{}]=speed; $TORQUE_AXIS_ACT[{}]=tau; $MOT_TEMP[{}]=temp; $OV_PRO=100"
    columns, right = wide(run, specs, speed=speed, tick=values(run)["ms"] + 3320114)
    right["tau"] = (Signal(tuple(f"$TORQUE_AXIS_ACT[{j}]" for j in range(1, 7)), UNITS["tau"]),)
    table(folder / "vars.csv", columns, sep=";", float_format="%.5f")
    return Answer("vars.csv", {"IPOC": "ms"}, right=right)


@layout(SIX, rate=100.0)
def abb_rws(folder: Path, run: Run) -> Answer:
    """ABB Robot Web Services polled: deg, unused external axes are 9E9, UTC times, quaternion."""
    specs = "time=date; x=x; y=y; z=z; q1=0.71; q2=qa; q3=0.02; q4=qb; *rax_{}=q°;"
    specs += "eax_a=9E+09; eax_b=9E+09; eax_c=9E+09; ctrlstate=motoron; opmode=AUTO"
    more = {"qa": 0.7 * np.cos(run.q[:, 0]), "qb": 0.7 * np.sin(run.q[:, 0])}
    columns, right = wide(run, specs, date=stamps(run, "%Y-%m-%dT%H:%M:%S.%fZ"), **more)
    table(folder / "rws.csv", columns, float_format="%.6f")
    return Answer("rws.csv", {"time": DATE}, right=right, draftable=False)


@layout(SIX, rate=250.0)
def abb_signal_analyzer(folder: Path, run: Run) -> Answer:
    """RobotStudio Signal Analyzer to CSV: long titles with units, power and TCP beside the axes."""
    specs = "Time (ms)=clock; ROB_1 TCP Speed In Current Wobj (mm/s)=x; "
    specs += "*ROB_1 J{} Joint Position (deg)=q°; ROB_1 J{} Near Limit (deg)=near;"
    specs += "*ROB_1 J{} Joint Speed (deg/s)=dq°; ROB_1 J{} Joint Acceleration (deg/s²)=acc;"
    specs += "*ROB_1 J{} Joint Torque (Nm)=tau; Total Motor Power Consumption (W)=z"
    more = {"acc": np.degrees(run.ddq), "near": 177 - abs(np.degrees(run.q))}
    columns, right = wide(run, specs, clock=1000 * run.t, **more)
    table(folder / "signals.csv", columns, float_format="%.5f")
    return Answer("signals.csv", {"Time (ms)": "ms"}, right=right)


@layout(UR, rate=500.0)
def ur_current_as_torque(folder: Path, run: Run) -> Answer:
    """UR e-Series RTDE with actual_current_as_torque; a model's target_moment beside it."""
    specs = "timestamp=clock; *target_q_{}=q_ref; target_qd_{}=dq_ref; target_qdd_{}=ddq;"
    specs += "target_moment_{}=model; *actual_q_{}=q; *actual_qd_{}=dq;"
    specs += "*actual_current_as_torque_{}=tau; actual_TCP_force_{}=ext; runtime_state=2"
    columns, right = wide(run, specs, range(6), clock=891.002 + run.t, model=run.tau_model)
    right["dq_ref"] = (Signal(tuple(f"target_qd_{j}" for j in range(6)), UNITS["dq"]),)
    right["ddq_ref"] = (Signal(tuple(f"target_qdd_{j}" for j in range(6)), UNITS["ddq"]),)
    table(folder / "rtde.csv", columns, float_format="%.6f")
    return Answer("rtde.csv", {"timestamp": "s"}, right=right)


@layout(THREE, rate=100.0)
def foxglove_plot(folder: Path, run: Run) -> Answer:
    """Foxglove's plot panel download: one row a point, the path of the series as a text."""
    rows = []
    for k, t in enumerate(run.t):
        for part, v in (("position", run.q), ("velocity", run.dq), ("effort", run.tau)):
            for j in range(3):
                path = f"/joint_states.{part}[{j}]"
                rows.append((f"{t:.6f}", f"{1700000321 + t:.6f}", path, f"{v[k, j]:.7f}"))
    heads = ["elapsed", "receive time", "topic", "value"]
    pd.DataFrame(rows, columns=heads).to_csv(folder / "plot_data.csv", index=False)
    right = {
        role: (Signal(tuple(f"/joint_states.{part}[{j}]" for j in range(3)), UNITS[role]),)
        for role, part in (("q", "position"), ("dq", "velocity"), ("tau", "effort"))
    }
    return Answer("plot_data.csv", {"elapsed": "s", "receive time": "s"}, right=right, texts=False)


@layout(PANDA, rate=50.0)
def lerobot_parquet(folder: Path, run: Run) -> Answer:
    """A LeRobot episode: lists in cells, the action is the next joint target, float32 seconds."""
    frame = pd.DataFrame({"observation.state": list(run.q.astype(np.float32))})
    frame["observation.effort"] = list(run.tau.astype(np.float32))
    frame["action"] = list(run.q_ref.astype(np.float32))
    frame["timestamp"] = run.t.astype(np.float32)
    frame["frame_index"] = np.arange(len(run.t))
    frame["episode_index"] = 0
    frame["index"] = frame["frame_index"] + 4410
    frame["task_index"] = 0
    frame.to_parquet(folder / "episode_000000.parquet")
    right = {"q": (Signal((), UNITS["q"]),), "tau": (Signal((), UNITS["tau"]),)}
    right["q_ref"] = (Signal((), UNITS["q"]),)
    return Answer("episode_000000.parquet", {"timestamp": "s"}, right=right, texts=False)


@layout(GEN3, rate=100.0)
def kortex_wrapped(folder: Path, run: Run) -> Answer:
    """Kinova Gen3 feedback to CSV: angles from 0 to 360 as the arm counts them, deg/s, N m."""
    specs = "t_us=us; *Joint{} position=wrapped:q°; *Joint{} velocity=dq°; *Joint{} torque=tau;"
    specs += "Joint{} motor current=current; Joint{} motor temp=temp; tool ext wrench fx=x"
    columns, right = wide(run, specs, joint_wise=True, wrapped=np.degrees(run.q) % 360)
    table(folder / "gen3.csv", columns, float_format="%.5f")
    return Answer("gen3.csv", {"t_us": "us"}, right=right)


@layout(SIX, rate=250.0)
def staubli_french(folder: Path, run: Run) -> Answer:
    """A Stäubli recorder in French: decimal commas, consigne (command) before mesure (measured)."""
    specs = "Temps (s)=t; *Consigne position axe {} (°)=q_ref°; *Mesure position axe {} (°)=q°;"
    specs += "Écart de poursuite axe {} (°)=lag; *Vitesse mesurée axe {} (°/s)=dq°;"
    specs += "*Couple axe {} (N.m)=tau; Température moteur {} (°C)=temp"
    columns, right = wide(run, specs, lag=np.degrees(run.q_ref - run.q))
    table(folder / "essai.csv", columns, sep=";", decimal=",", float_format="%.5f")
    return Answer("essai.csv", {"Temps (s)": "s"}, right=right)


@layout(SIX, rate=250.0)
def comau_italian(folder: Path, run: Run) -> Answer:
    """A Comau log in Italian: ms, gradi, coppia, the current's share and an error beside them."""
    specs = "Tempo [ms]=ms; *Posizione giunto {} [gradi]=q°; Errore posizione giunto {} [gradi]=e;"
    specs += "*Velocità giunto {} [gradi/s]=dq°; *Coppia giunto {} [Nm]=tau;"
    specs += "Corrente giunto {} [% nominale]=share"
    more = {"e": np.degrees(run.q_ref - run.q), "share": 100 * run.tau / 300}
    columns, right = wide(run, specs, joint_wise=True, **more)
    table(folder / "prova.csv", columns, sep=";", float_format="%.5f")
    return Answer("prova.csv", {"Tempo [ms]": "ms"}, right=right)


@layout(SIX, rate=125.0)
def yaskawa_japanese(folder: Path, run: Run) -> Answer:
    """A Japanese trace: 指令 is commanded, 現在 present; 速度 speed, トルク torque, 温度 temperature."""
    specs = "時間[ms]=ms; *指令位置 J{}[deg]=q_ref°; *現在位置 J{}[deg]=q°; *速度 J{}[deg/s]=dq°;"
    specs += "*トルク J{}[Nm]=tau; 外乱トルク J{}[Nm]=ext; 温度 J{}[℃]=temp"
    columns, right = wide(run, specs)
    table(folder / "trace.csv", columns, float_format="%.5f")
    return Answer("trace.csv", {"時間[ms]": "ms"}, right=right)


@layout(SIX, robot=None, rate=125.0)
def fanuc_ticks(folder: Path, run: Run) -> Answer:
    """FANUC system variables: ticks of the interpolation, no unit; radians, disturbance torque."""
    specs = "Tick=count; *$MOR_GRP[1].$CURR_ANG[{}]=q; $MOR_GRP[1].$CUR_DSTRB[{}]=dist"
    columns, right = wide(run, specs, dist=run.tau_ext * 9.8)
    table(folder / "vardump.txt", columns, sep="\t", float_format="%.6f")
    return Answer("vardump.txt", {"Tick": "?"}, right=right, draftable=False)


@layout(TWO, rate=1000.0)
def controldesk_csv(folder: Path, run: Run) -> Answer:
    """dSPACE ControlDesk CSV: meta rows, quoted paths of the model, set and measured apart."""
    root = '"Platform()://Rig/Model Root/'
    names = [root + f'Meas/q_meas[{j}]"' for j in (0, 1)]
    names += [root + f'Ref/q_des[{j}]"' for j in (0, 1)]
    names += [root + f'Drive/tau_cmd[{j}]"' for j in (0, 1)]
    rows = np.column_stack([run.t, run.q, run.q_ref, run.tau_ref])
    text = 'descriptions,"ControlDesk export"\nversion,1.0\n'
    text += "time," + ",".join(names) + "\nunits: s" + ",rad" * 4 + ",Nm" * 2 + "\n"
    text += "\n".join(",".join(f"{x:.7f}" for x in row) for row in rows) + "\n"
    (folder / "recording.csv").write_text(text)
    plain = [name.strip('"') for name in names]
    right = {"q": (Signal(tuple(plain[:2]), UNITS["q"]),)}
    right["q_ref"] = (Signal(tuple(plain[2:4]), UNITS["q"]),)
    right["tau"] = (Signal(tuple(plain[4:]), UNITS["tau"], run.tau_ref),)
    return Answer("recording.csv", {"time": "s"}, right=right, torque=("held-command",))


@layout(THREE, robot="robot.toml", rate=500.0)
def twincat_filetime(folder: Path, run: Run) -> Answer:
    """A TwinCAT database log: Windows FILETIME ticks of 100 ns, NC axes in deg, drive torque."""
    more = {"tick": 133543218451230000 + np.round(run.t * 1e7).astype(np.int64)}
    specs = "TwinCATTime=tick; *MAIN.axis{}.NcToPlc.ActPos=q°; *MAIN.axis{}.NcToPlc.ActVelo=dq°;"
    specs += "*MAIN.axis{}.NcToPlc.SetPos=q_ref°; MAIN.axis{}.NcToPlc.PosDiff=lag;"
    specs += "MAIN.axis{}.NcToPlc.StateDWord=24609; *MAIN.axis{}.DriveTorque_Nm=tau"
    columns, right = wide(run, specs, lag=np.degrees(run.q_ref - run.q), **more)
    table(folder / "nc_log.csv", columns, sep=";", float_format="%.6f")
    return Answer("nc_log.csv", {"TwinCATTime": "100 ns"}, right=right)


@layout(THREE, rate=250.0)
def codesys_trace(folder: Path, run: Run) -> Answer:
    """A CODESYS trace: microseconds without a word, SoftMotion axes in deg, set and actual."""
    specs = "Time=us; *Application.axJ{}.fSetPosition=q_ref°; *Application.axJ{}.fActPosition=q°;"
    specs += "*Application.axJ{}.fActVelocity=dq°; Application.axJ{}.fSetAcceleration=acc;"
    specs += "*Application.axJ{}.fActTorque=tau; Application.axJ{}.nAxisState=6"
    columns, right = wide(run, specs, joint_wise=True, acc=np.degrees(run.ddq))
    table(folder / "Trace_1.csv", columns, sep=";", float_format="%.5f")
    return Answer("Trace_1.csv", {"Time": "us"}, right=right)


@layout(THREE, robot="robot.toml", rate=100.0)
def tdms_to_text(folder: Path, run: Run) -> Answer:
    """TDMS by LabVIEW to text: group/channel, date and time of day with a comma, encoder in rev."""
    specs = "Messung/Zeit=date; *Messung/Winkel{} [°]=q°; *Messung/Drehmoment{} [Nm]=tau;"
    specs += "Messung/Dehnung{} [µm/m]=strain; Umgebung/Temperatur [°C]=21,4"
    date = np.array([text[:-3].replace(".", ",") for text in stamps(run, "%d/%m/%Y %H:%M:%S.%f")])
    columns, right = wide(run, specs, date=date, strain=10 * run.tau)
    table(folder / "tdms.txt", columns, sep="\t", decimal=",", float_format="%.5f")
    return Answer("tdms.txt", {"Messung/Zeit": DATE}, right=right)


@layout(TWO, rate=200.0)
def matlab_duration(folder: Path, run: Run) -> Answer:
    """MATLAB writetimetable with durations hh:mm:ss.SSS; rad without a word."""
    time = [f"00:00:{t:06.3f}" for t in run.t]
    columns, right = wide(run, "Time=time; *q_{}=q; *qd_{}=dq; qdd_{}=ddq; *tau_{}=tau",
                          time=np.array(time))  # fmt: skip
    table(folder / "tt.csv", columns, float_format="%.8g")
    right["ddq"] = (Signal(("qdd_1", "qdd_2"), UNITS["ddq"]),)
    return Answer("tt.csv", {"Time": DATE}, right=right)


@layout(SIX, rate=250.0)
def pandas_timedelta(folder: Path, run: Run) -> Answer:
    """pandas to_csv with a TimedeltaIndex: "0 days 00:00:00.004000", raw and filtered speeds."""
    specs = (
        "=when; *pos_j{}=q; vel_raw_j{}=raw; *vel_filt_j{}=dq; *trq_j{}=tau; trq_cmd_j{}=tau_ref"
    )
    dice = np.random.default_rng(3)
    more = {"when": np.array([str(pd.Timedelta(round(x * 1e6), unit="us")) for x in run.t])}
    columns, right = wide(run, specs, raw=run.dq + 0.2 * dice.normal(size=run.dq.shape), **more)
    raw = tuple(f"vel_raw_j{j}" for j in range(1, 7))
    right["dq"] += (Signal(raw, UNITS["dq"], np.column_stack([columns[c] for c in raw])),)
    table(folder / "dump.csv", columns, float_format="%.8g")
    return Answer("dump.csv", {"Unnamed: 0": DATE, "": DATE, "column 1": DATE}, right=right)


@layout(IIWA, rate=200.0)
def parquet_ns(folder: Path, run: Run) -> Answer:
    """A data lake's Parquet: epoch ns as int64, float32 columns, commanded before measured."""
    specs = "event_time_ns=tick; robot_id=7; *joint_cmd_pos_{}=q_ref; *joint_act_pos_{}=q;"
    specs += "*joint_act_torque_{}=tau; joint_ext_torque_{}=ext; joint_temp_{}=temp"
    tick = 1712143331250000000 + np.round(run.t * 1e9).astype(np.int64)
    columns, right = wide(run, specs, tick=tick)
    frame = pd.DataFrame(columns)
    reals = frame.select_dtypes("float64").columns
    frame[reals] = frame[reals].astype(np.float32)
    frame.to_parquet(folder / "part-0.parquet")
    return Answer("part-0.parquet", {"event_time_ns": "ns"}, right=right)


@layout(FOUR, rate=100.0)
def mqtt_jsonl(folder: Path, run: Run) -> Answer:
    """An MQTT bridge: a JSON object a line, a list of joints with ids, epoch ms as a number."""
    lines, clock = [], values(run)["ms"] + 1712143331250
    for k in range(len(run.t)):
        joints = [
            {"id": j + 1, "temp": round(run.temperature[k, j], 1), "pos": run.q[k, j],
             "vel": run.dq[k, j], "trq": run.tau[k, j]} for j in range(4)
        ]  # fmt: skip
        row = {"ts": int(clock[k]), "state": "RUNNING", "joints": joints}
        lines.append(json.dumps({"topic": "arm/telemetry", "payload": row}))
    (folder / "mqtt.jsonl").write_text("\n".join(lines))
    specs = "pos=q; vel=dq; trq=tau"
    return answer("mqtt.jsonl", {"payload.ts": "ms"}, "payload.joints[{}].@", range(4), specs)


@layout(PANDA, rate=20.0)
def robomimic_hdf5(folder: Path, run: Run) -> Answer:
    """A robomimic demonstration: observations without a clock; actions are tip motions."""
    with h5py.File(folder / "demo.hdf5", "w") as file:
        demo = file.create_group("data/demo_0")
        demo["actions"] = np.column_stack([run.pose, np.sign(run.pose[:, 0])])
        demo["obs/robot0_joint_pos"] = run.q
        demo["obs/robot0_joint_vel"] = run.dq
        demo["obs/robot0_eef_pos"] = run.pose[:, :3]
        demo["obs/robot0_gripper_qpos"] = abs(run.pose[:, :2]) / 10
        demo["rewards"] = np.zeros(len(run.t))
    specs = "data/demo_0/obs/robot0_joint_pos=q; data/demo_0/obs/robot0_joint_vel=dq"
    return answer("demo.hdf5", {}, "@[{}]", SEVEN, specs, known=False)


@layout(IIWA, rate=500.0)
def npz_command(folder: Path, run: Run) -> Answer:
    """numpy.savez of a script: commanded and measured torque, planned accelerations."""
    np.savez(folder / "run.npz", time=run.t, q=run.q, qd=run.dq, qdd_plan=run.ddq,
             tau_cmd=run.tau_ref, tau_meas=run.tau, tau_ext=run.tau_ext)  # fmt: skip
    return answer("run.npz", {"time": "s"}, "@[{}]", SEVEN, "q=q; qd=dq; tau_meas=tau")


@layout(TWO, robot=None, rate=500.0)
def mat_degrees(folder: Path, run: Run) -> Answer:
    """A student's MAT: a struct with a unit text a signal; degrees, and torque in N cm."""
    data = {"t": run.t[:, None], "phi": np.degrees(run.q), "phi_dot": np.degrees(run.dq)}
    data |= {"M": 100 * run.tau, "units": "t: s, phi: deg, phi_dot: deg/s, M: Ncm"}
    savemat(folder / "versuch.mat", {"data": data})
    right = {"q": (Signal(("data.phi_1", "data.phi_2"), UNITS["q°"]),)}
    right["dq"] = (Signal(("data.phi_dot_1", "data.phi_dot_2"), UNITS["dq°"]),)
    right["tau"] = (Signal(("data.M_1", "data.M_2"), ("N cm", "Ncm")),)
    return Answer("versuch.mat", {"data.t": "s", "data.t_1": "s"}, right=right, draftable=False)


@layout(SIX, rate=200.0)
def tip_sensor_beside(folder: Path, run: Run) -> Answer:
    """A joint log beside a force sensor: Fx…Tz at the tip, six of them like six joints."""
    specs = "time_s=t; Fx=fx; Fy=fy; Fz=fz; Tx=tx; Ty=ty; Tz=tz; *theta{}=q; *tau{}=tau"
    w = run.tau_ext
    more = {f"f{a}": 10 * w[:, k] for k, a in enumerate("xyz")}
    more |= {f"t{a}": w[:, 3 + k] for k, a in enumerate("xyz")}
    columns, right = wide(run, specs, **more)
    table(folder / "ft_and_joints.csv", columns, float_format="%.6f")
    return Answer("ft_and_joints.csv", {"time_s": "s"}, right=right)


@layout(SIX, rate=250.0)
def doosan_drfl(folder: Path, run: Run) -> Answer:
    """Doosan DRFL monitoring: joint torque sensor, external torque, model and motor torque."""
    specs = "time_stamp=clock; *actual_joint_position[{}]=q°; actual_joint_position_abs[{}]=q°;"
    specs += "*actual_joint_velocity[{}]=dq°; actual_joint_error[{}]=err;"
    specs += "*target_joint_position[{}]=q_ref°; *raw_joint_torque[{}]=tau;"
    specs += "external_joint_torque[{}]=ext; dynamic_tor[{}]=model; actual_motor_torque[{}]=motor"
    more = {"err": np.degrees(run.q_ref - run.q), "model": run.tau_model, "motor": run.tau_ref}
    columns, right = wide(run, specs, range(6), clock=102.5 + run.t, **more)
    motor = tuple(f"actual_motor_torque[{j}]" for j in range(6))
    right["tau"] += (Signal(motor, UNITS["tau"], run.tau_ref),)
    right["q"] += (Signal(tuple(f"actual_joint_position_abs[{j}]" for j in range(6)), UNITS["q°"]),)
    table(folder / "drfl.csv", columns, float_format="%.5f")
    return Answer("drfl.csv", {"time_stamp": "s"}, right=right)


@layout(PANDA, rate=500.0)
def franka_theta(folder: Path, run: Run) -> Answer:
    """franka_states flattened: motor angles theta, desired q_d and ddq_d beside q and tau_J."""
    specs = "stamp.sec=s; stamp.nanosec=ns; theta{}=theta; dtheta{}=dq; *q_d{}=q_ref; *q{}=q;"
    specs += "dq_d{}=dq_ref; *dq{}=dq; ddq_d{}=ddq; dtau_J{}=rate; *tau_J{}=tau; tau_J_d{}=model;"
    specs += "tau_ext_hat_filtered{}=ext; control_command_success_rate=1.0"
    ns = np.round(run.t * 1e9).astype(np.int64) + 1712143331250000000
    more = {"s": ns // 10**9, "ns": ns % 10**9, "theta": run.q + run.tau / 14000}
    columns, right = wide(run, specs, SEVEN, rate=run.tau_ext, model=0.1 * run.tau, **more)
    right["dq"] += (Signal(tuple(f"dtheta{j}" for j in SEVEN), UNITS["dq"]),)
    right["dq_ref"] = (Signal(tuple(f"dq_d{j}" for j in SEVEN), UNITS["dq"]),)
    right["ddq_ref"] = (Signal(tuple(f"ddq_d{j}" for j in SEVEN), UNITS["ddq"]),)
    table(folder / "franka_states.csv", columns, float_format="%.8g")
    return Answer("franka_states.csv", {"stamp.sec+stamp.nanosec": "s+ns"}, right=right)


@layout(THREE, rate=500.0)
def mit_mode(folder: Path, run: Run) -> Answer:
    """MIT-mode actuators: p_des, v_des, kp, kd, t_ff sent; p, v, t answered; names of joints."""
    specs = "t_ms=clock; {}_p_des=q_ref; {}_v_des=dq_ref; {}_kp=40; {}_kd=1.5; {}_t_ff=model;"
    specs += "*{}_p=q; *{}_v=dq; *{}_t=tau; {}_temp=temp"
    more = {"clock": 1000 * run.t + 5521.25, "model": run.tau_model}
    columns, right = wide(run, specs, THREE.joints, joint_wise=True, **more)
    for role, part in (("q_ref", "p_des"), ("dq_ref", "v_des")):
        right[role] = (Signal(tuple(f"{j}_{part}" for j in THREE.joints), UNITS[role]),)
    table(folder / "leg.csv", columns, float_format="%.6f")
    return Answer("leg.csv", {"t_ms": "ms"}, right=right)


@layout(THREE, rate=500.0)
def cia402_objects(folder: Path, run: Run) -> Answer:
    """EtherCAT objects by number: counts, per mille of the rated torque, DC time in ns."""
    counts = 131072 * np.array([101, 121, 81]) / (2 * np.pi)
    more = {"pos": np.round(run.q * counts), "vel": np.round(run.dq * counts)}
    more |= {"torque": np.round(run.tau / 0.12), "set": np.round(run.q_ref * counts)}
    more |= {"dc": 744612000125000000 + np.round(run.t * 1e9).astype(np.int64)}
    specs = "DC time=dc; Slave{} 0x6041 Statusword=4663; *Slave{} 0x6064 Position actual=pos:q:?;"
    specs += (
        "*Slave{} 0x606C Velocity actual=vel:dq:?; *Slave{} 0x6077 Torque actual=torque:tau:0.1 %;"
    )
    specs += "Slave{} 0x607A Target position=set"
    columns, right = wide(run, specs, (1001, 1002, 1003), joint_wise=True, **more)
    right["q_ref"] = (
        Signal(tuple(f"Slave{j} 0x607A Target position" for j in (1001, 1002, 1003))),
    )
    table(folder / "ethercat.csv", columns, float_format="%.0f")
    return Answer("ethercat.csv", {"DC time": "ns"}, right=right, draftable=False)


@layout(SIX, rate=250.0)
def hundredths_of_degree(folder: Path, run: Run) -> Answer:
    """A B&R trace: axis units of 0.01 deg that nothing states, speeds alike, lag error."""
    more = {"pos": np.round(100 * np.degrees(run.q)), "vel": np.round(100 * np.degrees(run.dq))}
    specs = "Time [s]=t; *gAxis[{}].ActPos=pos:q:?; *gAxis[{}].ActSpeed=vel:dq:?;"
    specs += "gAxis[{}].LagError=lag; gAxis[{}].MotorTemp=temp; *gAxis[{}].Torque [Nm]=tau"
    columns, right = wide(run, specs, lag=np.round(100 * np.degrees(run.q_ref - run.q)), **more)
    table(folder / "bur_trace.csv", columns, float_format="%.3f")
    return Answer("bur_trace.csv", {"Time [s]": "s"}, right=right, draftable=False)


@layout(SCARA, rate=200.0)
def epson_scara(folder: Path, run: Run) -> Answer:
    """An Epson SCARA: J1, J2, J4 in deg, J3 in mm, torque as a share; the unit with each head."""
    mixed = np.degrees(run.q)
    mixed[:, 2] = 1000 * run.q[:, 2]
    heads = ("J1[deg]", "J2[deg]", "J3[mm]", "J4[deg]")
    columns = {"Time[ms]": values(run)["ms"]} | {h: mixed[:, k] for k, h in enumerate(heads)}
    columns |= {f"Trq{j + 1}[%]": 100 * run.tau[:, j] / SCARA.effort[j] for j in range(4)}
    table(folder / "scara.csv", columns, float_format="%.4f")
    right = {"q": (Signal(heads, ("deg,deg,mm,deg", "°,°,mm,°")),)}
    right["tau"] = (Signal(tuple(f"Trq{j}[%]" for j in range(1, 5)), ("%",)),)
    return Answer("scara.csv", {"Time[ms]": "ms"}, right=right, draftable=False)


@layout(TWO, rate=100.0)
def excel_serial_days(folder: Path, run: Run) -> Answer:
    """Excel's serial date as time: days since 1899; angles with units, torque last."""
    columns, right = wide(run, "Timestamp=days; *Angle {} (deg)=q°; *Speed {} (rpm)=rpm:dq:rpm; "
                          "*Torque {} (Nm)=tau", days=45353.5 + run.t / 86400,
                          rpm=run.dq * 30 / np.pi)  # fmt: skip
    table(folder / "sheet.csv", columns, float_format="%.10f")
    return Answer("sheet.csv", {"Timestamp": "d"}, right=right)


@layout(SIX, rate=125.0)
def midnight(folder: Path, run: Run) -> Answer:
    """Time of day only, and the run passes midnight; joints in rad by a header comment."""
    clock = pd.Timestamp("2024-02-11 23:59:56") + pd.to_timedelta(values(run)["us"], unit="us")
    specs = "clock=when; *q{}=q; *qd{}=dq; *torque{}=tau"
    columns, right = wide(run, specs, when=clock.strftime("%H:%M:%S.%f").to_numpy())
    table(folder / "night.csv", columns, "# units: rad, rad/s, Nm\n", float_format="%.6f")
    return Answer("night.csv", {"clock": DATE}, right=right)


@layout(SIX, rate=250.0)
def two_clocks(folder: Path, run: Run) -> Answer:
    """A host's jittered epoch beside the controller's own clock; either may serve."""
    dice = np.random.default_rng(8)
    host = np.sort(1.7121433e9 + run.t + abs(dice.normal(0, 6e-4, len(run.t))))
    specs = "host_time=host; ctrl_time=ctrl; seq=count; *jpos{}=q; *jvel{}=dq; *jtorque{}=tau"
    columns, right = wide(run, specs, host=host, ctrl=12.004 + run.t)
    table(folder / "two_clocks.csv", columns, float_format="%.7f")
    return Answer("two_clocks.csv", {"host_time": "s", "ctrl_time": "s"}, right=right)


@layout(TWO, rate=500.0)
def unit_row(folder: Path, run: Run) -> Answer:
    """Names, then a row of units, then numbers; mN m, degrees and temperatures between."""
    specs = "Time=t; *Pos{}=q°; Temp{}=temp; *Torque{}=mnm:tau:mNm; *Vel{}=dq°"
    columns, right = wide(run, specs, joint_wise=True, mnm=1000 * run.tau)
    units = ["s"] + ["deg", "°C", "mNm", "deg/s"] * 2
    text = ",".join(columns) + "\n" + ",".join(units) + "\n"
    frame = pd.DataFrame(columns).to_csv(index=False, header=False, float_format="%.5f")
    (folder / "bench.csv").write_text(text + frame)
    return Answer("bench.csv", {"Time": "s"}, right=right)


@layout(SIX, rate=250.0)
def reversed_joints(folder: Path, run: Run) -> Answer:
    """A logger that walks from the tip: joint 6 first, accelerations before positions."""
    columns = {"time": run.t}
    for j in range(6, 0, -1):
        columns |= {f"acc_joint_{j}": run.ddq[:, j - 1], f"vel_joint_{j}": run.dq[:, j - 1]}
        columns |= {f"pos_joint_{j}": run.q[:, j - 1], f"eff_joint_{j}": run.tau[:, j - 1]}
    table(folder / "from_tip.csv", columns, float_format="%.7f")
    right = {
        role: (Signal(tuple(f"{p}_joint_{j}" for j in range(1, 7)), UNITS[role]),)
        for role, p in (("q", "pos"), ("dq", "vel"), ("tau", "eff"), ("ddq", "acc"))
    }
    return Answer("from_tip.csv", {"time": "s"}, right=right)


@layout(IIWA, rate=200.0)
def fri_monitor(folder: Path, run: Run) -> Answer:
    """KUKA FRI client: ipo, commanded, measured joint positions; three torques; s and ns."""
    specs = "timestampSec=s; timestampNanoSec=ns; ipoJointPosition[{}]=ipo;"
    specs += "*commandedJointPosition[{}]=q_ref; *measuredJointPosition[{}]=q;"
    specs += "commandedTorque[{}]=zero; *measuredTorque[{}]=tau; externalTorque[{}]=ext;"
    specs += "trackingPerformance=0.98"
    ns = np.round(run.t * 1e9).astype(np.int64) + 1712143331250000000
    more = {"s": ns // 10**9, "ns": ns % 10**9, "ipo": run.q_ref, "zero": 0 * run.tau}
    columns, right = wide(run, specs, SEVEN, **more)
    right["q_ref"] += (Signal(tuple(f"ipoJointPosition[{j}]" for j in SEVEN), UNITS["q"]),)
    table(folder / "fri.csv", columns, float_format="%.8g")
    return Answer("fri.csv", {"timestampSec+timestampNanoSec": "s+ns"}, right=right)


@layout(SIX, rate=250.0)
def header_lies(folder: Path, run: Run) -> Answer:
    """A header copied from another tool says rad and rad/s; the numbers are degrees."""
    specs = "t [s]=t; *q{} [rad]=q°; *dq{} [rad/s]=dq°; *tau{} [Nm]=tau"
    columns, right = wide(run, specs)
    table(folder / "copied.csv", columns, float_format="%.5f")
    return Answer("copied.csv", {"t [s]": "s"}, right=right)


@layout(PANDA, rate=100.0)
def moveit_fingers_first(folder: Path, run: Run) -> Answer:
    """A table by joint name with the two fingers first, positions, velocities and efforts."""
    joints = ("panda_finger_joint1", "panda_finger_joint2", *PANDA.joints)
    columns = {"secs": np.floor(run.t).astype(int) + 1712143331}
    columns |= {"nsecs": np.round(run.t % 1 * 1e9).astype(int) % 10**9}
    grip = np.column_stack([0.02 + 0.01 * np.sin(run.t)] * 2)
    for part, v in (("position", run.q), ("velocity", run.dq), ("effort", run.tau)):
        both = np.column_stack([grip * (part == "position"), v])
        columns |= {f"{name}.{part}": both[:, k] for k, name in enumerate(joints)}
    table(folder / "panda.csv", columns, float_format="%.7f")
    right = {
        role: (Signal(tuple(f"{name}.{part}" for name in PANDA.joints), UNITS[role]),)
        for role, part in (("q", "position"), ("dq", "velocity"), ("tau", "effort"))
    }
    return Answer("panda.csv", {"secs+nsecs": "s+ns"}, right=right)


@layout(TWO, robot=None, rate=250.0)
def ascii_matrix(folder: Path, run: Run) -> Answer:
    """MATLAB save -ascii: numbers alone, time first, then q, dq and tau of two joints."""
    np.savetxt(folder / "data.txt", np.column_stack([run.t, run.q, run.dq, run.tau]), "%16.7e")
    return Answer("data.txt", {"*": "s", "column 1": "s", "c1": "s"}, texts=False, draftable=False,
                  right={"q": (Signal((), UNITS["q"]),), "dq": (Signal((), UNITS["dq"]),),
                         "tau": (Signal((), UNITS["tau"]),)})  # fmt: skip


@layout(SIX, robot=None, rate=250.0)
def currents_only(folder: Path, run: Run) -> Answer:
    """A drive log with motor currents and motor-side rpm; deg of the joint; no gear stated."""
    gear = np.array([101, 121, 81, 51, 51, 41])
    specs = "Zeit=ms; *Ist_A{}_Grad=q°; n_Motor{}_U/min=rpm; *I_q{}_A=current; T_Wicklung{}_C=temp"
    columns, right = wide(run, specs, rpm=run.dq * gear * 30 / np.pi)
    right["dq"] = (Signal(tuple(f"n_Motor{j}_U/min" for j in range(1, 7))),)
    table(folder / "antrieb.csv", columns, sep=";", decimal=",", float_format="%.5f")
    return Answer("antrieb.csv", {"Zeit": "ms"}, right=right, draftable=False)


@layout(THREE, rate=250.0)
def wide_strings(folder: Path, run: Run) -> Answer:
    """A Java logger: joint vectors as one quoted text a cell, brackets, ISO time with a zone."""

    def cells(v: np.ndarray) -> list[str]:
        return ["[" + "; ".join(f"{x:.6f}" for x in row) + "]" for row in v]

    columns = {"timestamp": stamps(run, "%Y-%m-%dT%H:%M:%S.%f+01:00"), "jointPos": cells(run.q)}
    columns |= {"jointPosCmd": cells(run.q_ref), "jointTorque": cells(run.tau)}
    table(folder / "java.csv", columns)
    right = {role: (Signal((), UNITS[role]),) for role in ("q", "q_ref", "tau")}
    return Answer("java.csv", {"timestamp": DATE}, right=right, texts=False)
