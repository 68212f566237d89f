"""Write motions as thirty recordings, each with its answer: fifteen ordinary ones, ten of
laboratory practice, five hard ones.

The ninth stranger's: written down, with their answers, before any of them ran, by one who had not
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
    TURNS,
    Answer,
    Signal,
    anywhere,
    layout,
    names,
    recorded,
    stamps,
    table,
    wide,
)
from benchmarks.recorded_arm import (
    FOUR,
    GEN3,
    IIWA,
    LEG,
    PANDA,
    SCARA,
    SEVEN,
    SIX,
    SO100,
    THREE,
    TWO,
    UR,
    Arm,
    Run,
)

FIVE = Arm(
    "livelybot_arm", tuple(f"arm_joint{j}" for j in range(1, 6)), "zyyyx", (30, 30, 20, 10, 6)
)
DOG = Arm("solo_leg", ("HAA", "HFE", "KFE"), "xyy", (12, 12, 12))
EPOCH = 1714744931.25  # [s]
AMPS, MILLIAMPS, CELSIUS = ("A",), ("mA",), ("degC", "°C")
ACCELERATION = ("rad/s^2", "rad/s²", "rad/s2")
TURNS_A_SECOND = ("turn/s", "turns/s", "rev/s", "revolutions/s")


def also(right: dict, role: str, form: str, joints, units: tuple[str, ...], v=None) -> None:
    """Accept the columns of a form as well; `v` is what they hold (SI)."""
    columns = tuple(form.replace("{}", str(j)) for j in joints)
    right[role] = (*right.get(role, ()), Signal(columns, units, v))


def rows(path: Path, records) -> None:
    """Write one JSON object a line."""
    path.write_text("\n".join(json.dumps(record) for record in records) + "\n")


# ---- ordinary ones


@layout(FIVE, rate=250.0)
def sysid_both_frames(folder: Path, run: Run) -> Answer:
    """Write a ROS node's identification run: time, phase, traj_idx, then q_des_0 … q_meas_0,
    q_motor_0, tau_meas_0 a joint.
    """
    home = np.array([0.4, -1.2, 0.9, 0.0, 0.3])
    specs = "time=t; phase=2; traj_idx=count; *q_des_{}=q_ref; *dq_des_{}=dq_ref; ddq_des_{}=ddq; "
    specs += "*q_meas_{}=q; q_motor_{}=motor; *dq_meas_{}=dq; *tau_meas_{}=tau"
    how = {"data": {"motor": run.q + home}, "float_format": "%.6g"}
    answer = recorded(folder, run, "sysid_data.csv", {"time": "s"}, specs, range(5), True, **how)
    also(answer.right, "ddq_ref", "ddq_des_{}", range(5), ACCELERATION)
    return answer


@layout(SIX, rate=500.0)
def friction_compensation_output(folder: Path, run: Run) -> Answer:
    """Write a C++ controller's controller_output.csv: cycle, time_ms, q0, …, dq0, …, tau_f0, …,
    tau_total0, …, model_type.
    """
    specs = "cycle=count; time_ms=millis; *q{}=q; *dq{}=dq; tau_f{}=friction; *tau_total{}=tau; "
    specs += "model_type=LuGre"
    data = {"friction": run.tau - run.tau_model, "millis": run.t * 1e3}
    return recorded(
        folder,
        run,
        "controller_output.csv",
        {"time_ms": "ms"},
        specs,
        range(6),
        data=data,
        float_format="%.6f",
    )


@layout(PANDA, rate=200.0)
def isaac_tracking(folder: Path, run: Run) -> Answer:
    """Write an Isaac Lab joint tracking logger: qd_* is the commanded position, vd_* the commanded
    velocity.
    """
    fingers = "{}_panda_finger_joint1={}; {}_panda_finger_joint2={}"
    specs = "step=count; time=t; "
    specs += "*qd_{}=q_ref; " + fingers.format("qd", "0.04", "qd", "0.04") + "; "
    specs += "*q_{}=q; " + fingers.format("q", "0.039", "q", "0.0391") + "; "
    specs += "*vd_{}=dq_ref; " + fingers.format("vd", "0.0", "vd", "0.0") + "; "
    specs += "*v_{}=dq; " + fingers.format("v", "0.0001", "v", "-0.0001") + "; "
    specs += "*tau_measured_{}=tau; " + fingers.format("tau_measured", "1.2", "tau_measured", "1.1")
    return recorded(folder, run, "joint_tracking.csv", {"time": "s"}, specs, run.arm.joints)


@layout(FOUR, rate=100.0)
def ros2_topic_echo(folder: Path, run: Run) -> Answer:
    """`ros2 topic echo --csv /joint_states`: no header; sec, nanosec, frame, names, positions,
    velocities, efforts.
    """
    lines = []
    for k, t in enumerate(np.round((EPOCH + run.t) * 1e9).astype(np.int64)):
        numbers = [repr(float(x)) for x in (*run.q[k], *run.dq[k], *run.tau[k])]
        lines.append(",".join([str(t // 10**9), str(t % 10**9), "", *run.arm.joints, *numbers]))
    (folder / "joint_states.csv").write_text("\n".join(lines) + "\n")
    return Answer("joint_states.csv", right=anywhere(q=RAD, dq=RADS, tau=NM), texts=False)


@layout(THREE, rate=250.0)
def matlab_timetable(folder: Path, run: Run) -> Answer:
    """MATLAB's writetimetable: a duration is written as "0.004 sec", a matrix q as q_1, q_2,
    q_3.
    """
    specs = "Time=durations; *q_{}=q; *qd_{}=dq; *tau_{}=tau"
    data = {"durations": np.array([f"{t:.5g} sec" for t in run.t])}
    return recorded(folder, run, "run07.csv", {"Time": "*"}, specs, data=data)


@layout(SIX, rate=200.0)
def simulation_data_inspector(folder: Path, run: Run) -> Answer:
    """Simulink's Data Inspector, export to CSV: rows "Type:", "Unit:", "Interp:" below the
    names.
    """
    columns, right = wide(run, "time=t; *q({})=q; *q_ref({})=q_ref; *tau({})=tau")
    head, *body = pd.DataFrame(columns).to_csv(index=False).splitlines()
    about = [
        ",".join(["", *("Type: double" for _ in range(18))]),
        ",".join(["", *("Unit: rad" for _ in range(12)), *("Unit: N*m" for _ in range(6))]),
        ",".join(["", *("Interp: linear" for _ in range(18))]),
    ]
    (folder / "sdi_export.csv").write_text("\n".join([head, *about, *body]) + "\n")
    return Answer("sdi_export.csv", {"time": "s"}, right=right)


@layout(UR, rate=100.0)
def influx_pivot(folder: Path, run: Run) -> Answer:
    """InfluxDB's annotated CSV after pivot(): rows #group, #datatype, #default; fields by the
    alphabet.
    """
    specs = "result=; table=0; _start=start; _stop=stop; _time=date; cell=4; "
    specs += "*joint_{}_actual_current=amps:current; *joint_{}_actual_position=q; "
    specs += "*joint_{}_actual_velocity=dq"
    dates = stamps(run, "%Y-%m-%dT%H:%M:%S.%fZ")
    span = {"start": dates[:1].repeat(len(dates)), "stop": dates[-1:].repeat(len(dates))}
    columns, right = wide(run, specs, range(6), joint_wise=True, date=dates, **span)
    n = len(columns)
    head = "#group" + ",false" * 2 + ",true" * 2 + ",false,true" + ",false" * (n - 6) + "\n"
    head += (
        "#datatype,string,long" + ",dateTime:RFC3339" * 3 + ",string" + ",double" * (n - 6) + "\n"
    )
    head += "#default,_result" + "," * (n - 1) + "\n"
    table(folder / "query.csv", {"": "", **columns}, head)
    return Answer("query.csv", {"_time": "*"}, right=right)


@layout(THREE, rate=200.0)
def labview_german(folder: Path, run: Run) -> Answer:
    """Write a LabVIEW program in German: "Zeit (s)", "Istwinkel 1 (°)", tabs and decimal commas,
    cp1252.
    """
    specs = (
        "Zeit (s)=t; *Sollwinkel {} (°)=q_ref°:q_ref°; *Istwinkel {} (°)=q°:q°; *Drehmoment {} "
        "(Nm)=tau"
    )
    how = {"sep": "\t", "decimal": ",", "encoding": "cp1252", "float_format": "%.5f"}
    return recorded(folder, run, "Messung_003.txt", {"Zeit (s)": "s"}, specs, **how)


@layout(TWO, rate=500.0)
def startdrive_trace(folder: Path, run: Run) -> Answer:
    """Write a drive's trace as CSV, direct drives: actual position [°], r63 speed [rpm], r80 torque
    [Nm].
    """
    specs = (
        "Sample=count; Time [ms]=millis; *DRV{}.Actual position [°]=q°:q°; *DRV{}.r63[0] Actual "
        "speed [rpm]=rpm:dq:rpm; "
    )
    specs += "*DRV{}.r80[0] Actual torque [Nm]=tau"
    data = {"millis": run.t * 1e3, "rpm": run.dq * 30 / np.pi}
    columns, right = wide(run, specs, joint_wise=True, **data)
    table(folder / "trace_1.csv", columns, sep=";", float_format="%.5f")
    return Answer("trace_1.csv", {"Time [ms]": "ms"}, right=right)


@layout(IIWA, rate=200.0)
def drake_state_names(folder: Path, run: Run) -> Answer:
    """Write a Drake script: the log of the state under plant.GetStateNames():
    iiwa7_lbr_iiwa_joint_1_q, …_w.
    """
    specs = "time=t; *iiwa7_{}_q=q; *iiwa7_{}_w=dq; *iiwa7_{}_tau=tau"
    return recorded(folder, run, "drake_log.csv", {"time": "s"}, specs, run.arm.joints)


@layout(UR, rate=125.0)
def script_npz(folder: Path, run: Run) -> Answer:
    """Write a Python script's np.savez: t, q, qd, q_des, qd_des, tau, tau_ext, tcp_pose."""
    tip = {"tcp_pose": run.pose, "tau_ext": run.tau_ext}
    wanted = {"q_des": run.q_ref, "qd_des": run.dq_ref}
    np.savez(folder / "episode_12.npz", t=run.t, q=run.q, qd=run.dq, tau=run.tau, **wanted, **tip)
    right = anywhere(q=RAD, dq=RADS, tau=NM, q_ref=RAD, dq_ref=RADS)
    return Answer("episode_12.npz", {"t": "s"}, right=right, texts=False)


@layout(SEVEN, rate=200.0)
def hebi_log(folder: Path, run: Run) -> Answer:
    """Write a HEBI group log in MATLAB: a struct with time, position, velocity, effort,
    positionCmd, motorCurrent.
    """
    log = {"time": run.t[:, None], "position": run.q, "velocity": run.dq, "effort": run.tau}
    log |= {"positionCmd": run.q_ref, "velocityCmd": run.dq_ref, "effortCmd": run.tau_ref}
    log |= {"motorCurrent": run.current, "motorSensorTemperature": run.temperature}
    savemat(folder / "hebi_log.mat", {"log": log})
    right = anywhere(
        q=RAD, dq=RADS, tau=NM, q_ref=RAD, dq_ref=RADS, current=AMPS, temperature=CELSIUS
    )
    return Answer("hebi_log.mat", {"time": "s"}, right=right, texts=False)


@layout(SIX, rate=100.0)
def rainbow_state(folder: Path, run: Run) -> Answer:
    """Rainbow Robotics' systemSTAT by a script: jnt_ref[0], jnt_ang[0] in degrees, cur[0],
    temperature_mc[0].
    """
    specs = (
        "time=t; *jnt_ref[{}]=q_ref°:q_ref°; *jnt_ang[{}]=q°:q°; *cur[{}]=amps:current; "
        "temperature_mc[{}]=temp; "
    )
    specs += (
        "tcp_pos[0]=x; tcp_pos[1]=y; tcp_pos[2]=z; tcp_pos[3]=rx; tcp_pos[4]=ry; tcp_pos[5]=rz; "
        "robot_state=3"
    )
    answer = recorded(
        folder, run, "rb5_state.csv", {"time": "s"}, specs, range(6), float_format="%.5f"
    )
    also(answer.right, "temperature", "temperature_mc[{}]", range(6), CELSIUS)
    return answer


@layout(PANDA, rate=200.0)
def joint_states_parquet(folder: Path, run: Run) -> Answer:
    """JointState messages of a bag as Parquet: lists of name, position, velocity, effort, fingers
    included.
    """
    two = np.full((len(run.t), 2), 0.02)
    lists = {"position": run.q, "velocity": run.dq, "effort": run.tau}
    columns = {
        "timestamp": np.round((EPOCH + run.t) * 1e9).astype(np.int64),
        "frame_id": [""] * len(run.t),
    }
    columns["name"] = [[*run.arm.joints, *run.arm.fingers]] * len(run.t)
    columns |= {
        key: np.hstack([value, two * 0 if key != "position" else two]).tolist()
        for key, value in lists.items()
    }
    pyarrow.parquet.write_table(pyarrow.table(columns), folder / "joint_states.parquet")
    right = anywhere(q=RAD, dq=RADS, tau=NM)
    return Answer("joint_states.parquet", {"timestamp": "ns"}, right=right, texts=False)


@layout(GEN3, rate=100.0)
def kortex_feedback(folder: Path, run: Run) -> Answer:
    """Kinova Gen3 cyclic feedback as JSON lines: degrees from 0 to 360, deg/s, N m, A."""
    keys = ("position", "velocity", "torque", "currentMotor", "temperatureMotor")
    turned = np.degrees(run.q) % 360
    data = np.stack([turned, np.degrees(run.dq), run.tau, run.current, run.temperature])
    rows(
        folder / "gen3_feedback.jsonl",
        (
            {
                "t": round(float(t), 6),
                "frameId": k,
                "actuators": [
                    {
                        "commandId": k,
                        **dict(zip(keys, map(float, data[:, k, j]), strict=True)),
                        "voltage": 24.1,
                    }
                    for j in range(run.n)
                ],
            }
            for k, t in enumerate(run.t)
        ),
    )
    right = anywhere(q=DEG, dq=DEGS, tau=NM, current=AMPS, temperature=CELSIUS)
    return Answer("gen3_feedback.jsonl", {"t": "s"}, right=right, texts=False)


# ---- laboratory practice


@layout(THREE, rate=200.0)
def pandas_two_levels(folder: Path, run: Run) -> Answer:
    """pandas' to_csv of columns with two levels: quantity and joint in two rows, the index's name
    in a third.
    """
    levels = [("q", "dq", "tau"), run.arm.joints]
    columns = pd.MultiIndex.from_product(levels, names=["quantity", "joint"])
    frame = pd.DataFrame(np.hstack([run.q, run.dq, run.tau]), pd.Index(run.t, name="time"), columns)
    frame.to_csv(folder / "trial_4.csv")
    return Answer("trial_4.csv", {"time": "s"}, right=anywhere(q=RAD, dq=RADS, tau=NM), texts=False)


@layout(SEVEN, rate=100.0)
def robometry_device(folder: Path, run: Run) -> Answer:
    """robometry's MAT file: joints_state.positions with data (n, 1, N), elements_names,
    timestamps.
    """

    def channel(name: str, values: np.ndarray) -> dict:
        about = {"name": name, "dimensions": np.array([run.n, 1]), "timestamps": EPOCH + run.t}
        labels = np.array(run.arm.joints, dtype=object)
        return {"data": values.T[:, None, :], "elements_names": labels, **about}

    joints = {"positions": channel("positions", run.q), "velocities": channel("velocities", run.dq)}
    joints["torques"] = channel("torques", run.tau)
    motors = {"currents": channel("currents", run.current)}
    device = {"description_list": np.array(["arm7"], dtype=object), "yarp_robot_name": "arm7"}
    savemat(
        folder / "robot_logger_device.mat",
        {"robot_logger_device": {**device, "joints_state": joints, "motors_state": motors}},
    )
    right = anywhere(q=RAD, dq=RADS, tau=NM, current=AMPS)
    return Answer("robot_logger_device.mat", {"timestamps": "s"}, right=right, texts=False)


@layout(THREE, rate=200.0)
def opensim_moco(folder: Path, run: Run) -> Answer:
    """OpenSim Moco's solution (.sto): inDegrees=no … endheader; /jointset/elbow/elbow/value,
    /forceset/tau_elbow.
    """
    head = "inDegrees=no\nnum_controls=3\nnum_derivatives=0\nnum_states=6\n"
    head += "DataType=double\nversion=3\nOpenSimVersion=4.4\nendheader\n"
    specs = "time=t; *{}=q; *{}=dq; *{}=tau"
    for form in ("/jointset/{}/{}/value", "/jointset/{}/{}/speed", "/forceset/tau_{}"):
        specs = specs.replace("*{}=", f"*{form}=", 1)
    answer = recorded(
        folder, run, "solution.sto", {"time": "s"}, specs, run.arm.joints, head=head, sep="\t"
    )
    return Answer(
        answer.file, answer.time, right=answer.right, torque=("measured", "held-command", "model")
    )


@layout(TWO, rate=200.0)
def odrive_script(folder: Path, run: Run) -> Answer:
    """Write a script at an ODrive: axis0.encoder.pos_estimate [turn], vel_estimate [turn/s],
    Iq_measured [A].
    """
    turn = 2 * np.pi
    forms = {"q": "axis{}.encoder.pos_estimate", "dq": "axis{}.encoder.vel_estimate"}
    forms |= {
        "current": "axis{}.motor.current_control.Iq_measured",
        "q_ref": "axis{}.controller.input_pos",
    }
    what = {
        "q": run.q / turn,
        "dq": run.dq / turn,
        "current": run.current,
        "q_ref": run.q_ref / turn,
    }
    columns: dict = {"time": run.t}
    for j in range(2):
        columns |= {form.replace("{}", str(j)): what[key][:, j] for key, form in forms.items()}
    table(folder / "odrive_log.csv", columns)
    right: dict = {}
    units = {"q": TURNS, "dq": TURNS_A_SECOND, "current": AMPS, "q_ref": TURNS}
    for key, form in forms.items():
        also(right, key, form, range(2), units[key])
    right["tau"] = right["current"]
    return Answer("odrive_log.csv", {"time": "s"}, right=right)


@layout(SEVEN, rate=200.0)
def xbot_logger(folder: Path, run: Run) -> Answer:
    """XBot's MatLogger2 (MAT v7.3): link_position, motor_position, link_velocity, effort,
    position_reference.
    """
    path = folder / "robot_state_log.mat"
    data = {
        "time": EPOCH + run.t[:, None],
        "link_position": run.q,
        "link_velocity": run.dq,
        "effort": run.tau,
    }
    data |= {
        "motor_position": run.q + run.tau / 9000.0,
        "motor_velocity": run.dq,
        "position_reference": run.q_ref,
    }
    data |= {
        "temperature": run.temperature,
        "stiffness": np.full_like(run.q, 500.0),
        "damping": np.full_like(run.q, 5.0),
    }
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in data.items():
            file.create_dataset(name, data=values).attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    right = anywhere(q=RAD, dq=RADS, tau=NM, q_ref=RAD, temperature=CELSIUS)
    return Answer(path.name, {"time": "s"}, right=right, texts=False)


@layout(SCARA, rate=200.0)
def scara_mixed_units(folder: Path, run: Run) -> Answer:
    """Write a SCARA's controller by a lab's program: J1[deg], J2[deg], J3[mm], J4[deg], J1Trq[Nm],
    …, J3Trq[N].
    """
    lengths, efforts = ("deg", "deg", "mm", "deg"), ("Nm", "Nm", "N", "Nm")
    scale = np.array([180 / np.pi, 180 / np.pi, 1000.0, 180 / np.pi])
    columns: dict = {"Time[ms]": np.round(run.t * 1e3, 3)}
    columns |= {f"J{j + 1}[{unit}]": run.q[:, j] * scale[j] for j, unit in enumerate(lengths)}
    columns |= {f"J{j + 1}Trq[{unit}]": run.tau[:, j] for j, unit in enumerate(efforts)}
    table(folder / "scara_move.csv", columns)
    positions = tuple(",".join(p) for p in product(DEG, DEG, ("mm",), DEG))
    torques = tuple(",".join(p) for p in product(NM, NM, ("N",), NM))
    right = {
        "q": (Signal(names("J{}", 4), positions),),
        "tau": (Signal(names("J{}Trq", 4), torques),),
    }
    return Answer("scara_move.csv", {"Time[ms]": "ms"}, right=right)


@layout(FOUR, rate=200.0)
def group_a_joint(folder: Path, run: Run) -> Answer:
    """HDF5 with a group a joint: /joints/joint1/position with an attribute unit, /time beside
    them.
    """
    with h5py.File(folder / "session.h5", "w") as file:
        file.attrs["operator"] = "mk"
        file.create_dataset("time", data=run.t).attrs["unit"] = "s"
        for j, name in enumerate(run.arm.joints):
            group = file.create_group(f"joints/{name}")
            for key, unit, values in (
                ("position", "rad", run.q),
                ("velocity", "rad/s", run.dq),
                ("torque", "Nm", run.tau),
            ):
                group.create_dataset(key, data=values[:, j]).attrs["unit"] = unit
    right = anywhere(q=RAD, dq=RADS, tau=NM)
    return Answer("session.h5", {"time": "s"}, right=right, texts=False)


@layout(SO100, rate=100.0)
def servo_bus_lines(folder: Path, run: Run) -> Answer:
    """Write a servo bus as JSON lines: ts [ms], joints a list of {id, pos [deg], vel [deg/s], cur
    [mA]}.
    """
    q, dq, amps = np.degrees(run.q), np.degrees(run.dq), np.round(run.current * 1e3)
    rows(
        folder / "bus.jsonl",
        (
            {
                "ts": round((EPOCH + t) * 1e3),
                "joints": [
                    {
                        "id": 11 + j,
                        "pos": round(q[k, j], 3),
                        "vel": round(dq[k, j], 2),
                        "cur": int(amps[k, j]),
                    }
                    for j in range(run.n)
                ],
            }
            for k, t in enumerate(run.t)
        ),
    )
    right = anywhere(q=DEG, dq=DEGS, current=MILLIAMPS, tau=MILLIAMPS)
    return Answer("bus.jsonl", {"ts": "ms"}, right=right, texts=False)


@layout(LEG, rate=500.0)
def savetxt_header(folder: Path, run: Run) -> Answer:
    """numpy.savetxt with a header of two lines: a remark, then "# t[s] hip_pos[deg] …"."""
    specs = "t[s]=t; *{}_pos[deg]=q°:q°; *{}_vel[deg/s]=dq°:dq°; *{}_trq[Nm]=tau"
    columns, right = wide(run, specs, run.arm.joints)
    head = "run 3, leg on test stand, 2 kg at the foot\n" + " ".join(columns)
    np.savetxt(folder / "run3.dat", np.column_stack(list(columns.values())), "%.6e", header=head)
    return Answer("run3.dat", {"t[s]": "s"}, right=right)


@layout(SIX, rate=250.0)
def json_with_units(folder: Path, run: Run) -> Answer:
    """One JSON object: sample_rate_hz, units {"q": "deg", …}, matrices q, q_ref, tau; no clock."""
    data = {"robot": "m0609", "operator": "lab 2", "sample_rate_hz": 250.0}
    data["units"] = {"q": "deg", "q_ref": "deg", "tau": "Nm"}
    data |= {
        "q": np.degrees(run.q).round(5).tolist(),
        "q_ref": np.degrees(run.q_ref).round(5).tolist(),
    }
    data["tau"] = run.tau.round(4).tolist()
    (folder / "excitation_2.json").write_text(json.dumps(data))
    right = anywhere(q=DEG, q_ref=DEG, tau=NM)
    return Answer("excitation_2.json", rate=250.0, right=right, texts=False)


# ---- hard ones


@layout(SIX, rate=125.0)
def forearm_from_the_horizontal(folder: Path, run: Run) -> Answer:
    """Write a FANUC controller's J3 is the forearm's angle from the horizontal, so it holds J2 as
    well.
    """
    shown = np.degrees(run.q)
    shown[:, 2] += shown[:, 1]
    specs = "Time(ms)=millis; *J{}(deg)=shown:q°; *T{}(Nm)=tau"
    columns, right = wide(run, specs, shown=shown, millis=run.t * 1e3)
    right = {"q": (Signal(names("J{}(deg)", 6), DEG),), "tau": (Signal(names("T{}(Nm)", 6), NM),)}
    table(folder / "fanuc_axes.csv", columns, float_format="%.4f")
    return Answer("fanuc_axes.csv", {"Time(ms)": "ms"}, right=right, draftable=False)


@layout(FOUR, rate=100.0)
def grafana_formatted(folder: Path, run: Run) -> Answer:
    """Grafana's "formatted data" as CSV: the unit stands in every cell, "12.345°", "4.510 Nm"."""
    angles = np.vectorize("{:.3f}°".format)(np.degrees(run.q))
    torques = np.vectorize("{:.3f} Nm".format)(run.tau)
    specs = "Time=date; *J{} angle=angles:q°; *J{} torque=torques:tau"
    dates = [date[:-3] for date in stamps(run, "%Y-%m-%d %H:%M:%S.%f")]
    columns, _ = wide(run, specs, angles=angles, torques=torques, date=np.array(dates))
    right = {
        "q": (Signal(names("J{} angle", 4), DEG),),
        "tau": (Signal(names("J{} torque", 4), NM),),
    }
    table(folder / "panel.csv", columns, quoting=1, encoding="utf-8")
    return Answer("panel.csv", {"Time": "*"}, right=right)


@layout(LEG, rate=100.0)
def arduino_monitor(folder: Path, run: Run) -> Answer:
    """Write the Arduino IDE's serial monitor with time stamps: "14:02:11.250 -> 12.34<tab>…", no
    names.
    """
    data = np.hstack([np.degrees(run.q), np.degrees(run.dq), 1e3 * run.current])
    clock = [date[:-3] for date in stamps(run, "%H:%M:%S.%f")]
    lines = (
        f"{at} -> " + "\t".join(f"{x:.2f}" for x in row)
        for at, row in zip(clock, data, strict=True)
    )
    (folder / "serial.txt").write_text("\n".join(lines) + "\n")
    right = anywhere(q=DEG, dq=DEGS, current=MILLIAMPS, tau=MILLIAMPS)
    return Answer("serial.txt", right=right, texts=False)


@layout(DOG, rate=200.0)
def crocoddyl_states(folder: Path, run: Run) -> Answer:
    """Write a Crocoddyl solution by np.savez: xs (N + 1, 2 n) holds q and v, us (N, n) the torques,
    dt.
    """
    states = np.hstack([run.q, run.dq])
    np.savez(folder / "ddp.npz", xs=np.vstack([states, states[-1:]]), us=run.tau, dt=0.005)
    right = anywhere(q=RAD, dq=RADS, tau=NM)
    return Answer(
        "ddp.npz",
        rate=200.0,
        right=right,
        torque=("measured", "held-command", "model"),
        texts=False,
    )


@layout(SIX, rate=250.0)
def canopen_objects(folder: Path, run: Run) -> Answer:
    """CANopen drives by object: node1_6064 in counts of the motor, node1_606C in counts/s,
    node1_6077 in 0.1 %.
    """
    gear = np.array([101.0, 101, 101, 80, 80, 50]) * 65536 / (2 * np.pi)
    data = {
        "status": np.full(run.q.shape, 0x1637),
        "places": np.round(run.q * gear).astype(np.int64),
    }
    data["speeds"] = np.round(run.dq * gear).astype(np.int64)
    data["shares"] = np.round(1000 * run.tau / (1.7 * abs(run.tau).max(axis=0))).astype(np.int64)
    forms = {
        "status": "node{}_6041",
        "places": "node{}_6064",
        "speeds": "node{}_606C",
        "shares": "node{}_6077",
    }
    columns: dict = {"timestamp_us": np.round(run.t * 1e6).astype(np.int64)}
    for j in range(6):
        columns |= {form.replace("{}", str(j + 1)): data[key][:, j] for key, form in forms.items()}
    table(folder / "pdo_log.csv", columns)
    right: dict = {}
    also(right, "q", forms["places"], range(1, 7), ("counts",))
    also(right, "dq", forms["speeds"], range(1, 7), ("counts/s",))
    also(right, "tau", forms["shares"], range(1, 7), ("0.1 %",))
    right["current"] = right["tau"]
    return Answer("pdo_log.csv", {"timestamp_us": "us"}, right=right, draftable=False)
