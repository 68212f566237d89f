"""Write motions as thirty recordings, each with its answer: fifteen ordinary ones, ten of
laboratory practice, five hard ones.

The seventh stranger's: written down, with their answers, before any of them ran, by one who had not
read the importer or the layouts of the other sets.
"""

import json
from pathlib import Path

import numpy as np
import pandas as pd
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
    table,
    values,
    wide,
)
from benchmarks.recorded_arm import FOUR, GEN3, IIWA, LEG, SEVEN, SIX, THREE, TWO, UR, Arm, Run

NAO = Arm(
    "nao_larm",
    ("LShoulderPitch", "LShoulderRoll", "LElbowYaw", "LElbowRoll", "LWristYaw"),
    "yzxzx",
    (20, 20, 10, 10, 5),
)
GO = Arm("go_leg", ("FR_HAA", "FR_HFE", "FR_KFE"), "xyy", (80, 80, 60))
PSM = Arm(
    "psm",
    tuple(f"outer_{p}" for p in ("yaw", "pitch", "insertion", "roll", "wrist_pitch", "wrist_yaw")),
    "yxYzyx",
    (60,) * 6,
)
EPOCH = 1714744931.25  # [s]


def also(
    right: dict,
    role: str,
    pattern: str,
    joints,
    units: tuple[str, ...],
    v: np.ndarray | None = None,
) -> None:
    """Accept the columns of a pattern as well as what is accepted already; `v` is what they hold
    (SI).
    """
    right[role] = (
        *right.get(role, ()),
        Signal(tuple(pattern.replace("{}", str(j)) for j in joints), units, v),
    )


def rows(
    path: Path, numbers: np.ndarray, separator: str, head: str = "", form: str = ".8g"
) -> None:
    """Write numbers as text without a header, below `head`."""
    path.write_text(
        head + "".join(separator.join(format(x, form) for x in row) + "\n" for row in numbers)
    )


def smooth(numbers: np.ndarray) -> np.ndarray:
    """Filter as a controller does, with a lag of about two samples."""
    return pd.DataFrame(numbers).ewm(alpha=0.3).mean().to_numpy()


# ---- ordinary ones


@layout(SEVEN, rate=1000.0)
def rokae_identification(folder: Path, run: Run) -> Answer:
    """ROKAE xCore SDK, step1_dynamics_data_collection.cpp: time, q0…, dq0…, ddq0…, tau0… with six
    digits.
    """
    specs = "time=t; *q{}=q; *dq{}=dq; ddq{}=ddq; *tau{}=tau"
    return recorded(
        folder,
        run,
        "dynamics_identification_data.csv",
        {"time": "s"},
        specs,
        range(7),
        float_format="%.6f",
    )


@layout(THREE, rate=100.0)
def arm_bot_continuous(folder: Path, run: Run) -> Answer:
    """Write a node that logs /joint_states at 100 Hz (arm_bot, continuous_logger.py): time_elapsed,
    pos1…, vel1…, torque1…
    """
    specs = "time_elapsed=t; *pos{}=q; *vel{}=dq; *torque{}=tau"
    name = "continuous_log_1_20240503_140211.csv"
    return recorded(folder, run, name, {"time_elapsed": "s"}, specs, float_format="%.6f")


@layout(TWO, rate=500.0)
def double_pendulum_csv(folder: Path, run: Run) -> Answer:
    """double_pendulum of dfki-ric-underactuated-lab, csv_trajectory.py: pos_meas, pos_filt,
    pos_des; four torques.
    """
    specs = (
        "time=t; *pos_meas{}=q; *vel_meas{}=dq; pos_filt{}=qf; vel_filt{}=dqf; *pos_des{}=q_ref; "
        "*vel_des{}=dq_ref;"
    )
    specs += (
        "tau_con{}=model; *tau_fric{}=friction:tau_friction:tau; *tau_meas{}=tau; tau_des{}=tau_ref"
    )
    data = {
        "qf": smooth(run.q),
        "dqf": smooth(run.dq),
        "model": run.tau_model,
        "friction": 0.2 * run.dq,
    }
    columns, right = wide(run, specs, **data)
    also(right, "q", "pos_filt{}", (1, 2), RAD, data["qf"])
    also(right, "q_obs", "pos_filt{}", (1, 2), RAD)
    also(right, "dq", "vel_filt{}", (1, 2), RADS, data["dqf"])
    also(right, "dq_obs", "vel_filt{}", (1, 2), RADS)
    also(right, "tau", "tau_des{}", (1, 2), NM, run.tau_ref)
    also(right, "tau", "tau_con{}", (1, 2), NM, run.tau_model)
    table(folder / "trajectory.csv", columns)
    return Answer("trajectory.csv", {"time": "s"}, right=right)


@layout(FOUR, rate=200.0)
def dynamixel_computed_torque(folder: Path, run: Run) -> Answer:
    """Write a computed-torque node of an OpenManipulator-X (public ROS 2 source, write_csv_header):
    ticks, four torques, currents.
    """
    specs = (
        "t=t; q{}_ticks=ticks; *q{}=q; *dq{}=dq; ddq{}=ddq; *q{}_ref=q_ref; *dq{}_ref=dq_ref; "
        "*ddq{}_ref=ddq:ddq_ref:ddq;"
    )
    specs += (
        "tau_g{}=gravity; *tau_nle{}=model:tau_feedforward:tau; *tau_meas{}=tau; tau_ref{}=tau_ref;"
        " tau_cmd{}=tau_ref;"
    )
    specs += (
        "curr_cmd_ticks{}=want_ticks; curr_cmd_A{}=want; curr_meas_ticks{}=amp_ticks; "
        "curr_meas_A{}=amps; phase=phase; saturated=0"
    )
    want = run.tau_ref / np.linspace(11.0, 5.0, 4)
    data = {
        "ticks": np.round(2048 + run.q * 2048 / np.pi).astype(int),
        "gravity": 0.8 * run.tau_model,
        "model": run.tau_model,
    }
    data |= {
        "want": want,
        "want_ticks": np.round(want / 0.00269).astype(int),
        "phase": np.ones(len(run.t), int),
    }
    data |= {"amp_ticks": np.round(run.current / 0.00269).astype(int)}
    columns, right = wide(run, specs, **data)
    for name in ("tau_ref{}", "tau_cmd{}"):
        also(right, "tau", name, range(1, 5), NM, run.tau_ref)
    also(right, "tau_feedforward", "tau_g{}", range(1, 5), NM)
    also(right, "current", "curr_meas_A{}", range(1, 5), ("A",))
    table(folder / "ct_run_01.csv", columns)
    return Answer("ct_run_01.csv", {"t": "s"}, right=right)


@layout(SIX, rate=50.0)
def unitree_policy_log(folder: Path, run: Run) -> Answer:
    """unitree_cpp_deploy's DataLogger (wty-yy/unitree_cpp_deploy, UPDATE.md): three clocks, two of
    0.1 s; q_des, q, dq, tau.
    """
    specs = (
        "time=t; unix_time=unix; wall_time=wall; *q_des_{}=q_ref; *q_{}=q; *dq_{}=dq; *tau_{}=tau; "
        "temperatures_{}=temp;"
    )
    specs += "imu_rpy_0=rx; imu_rpy_1=ry; imu_rpy_2=rz"
    unix = np.floor((EPOCH + run.t) * 10) / 10
    wall = np.array([f"14:02:{x:04.1f}" for x in np.floor((11.2 + run.t) * 10) / 10])
    columns, right = wide(run, specs, range(6), unix=unix, wall=wall)
    also(right, "temperature", "temperatures_{}", range(6), ("degC", "°C"))
    table(folder / "run.csv", columns)
    return Answer("run.csv", {"time": "s"}, right=right)


@layout(GEN3, rate=100.0)
def kortex_experiment_log(folder: Path, run: Run) -> Answer:
    """Write an experiment's log of a Kinova Gen3 (public C++ source, log_format = 2): cmd_j,
    meas_j, measraw_j, vel_j, torque_j.
    """
    specs = (
        "time_s=t; dt_s=0.01; pd_x=x; pd_y=y; pd_z=z; p_x=x; p_y=y; p_z=z; *cmd_j{}=q_ref; "
        "*cmdvel_j{}=dq_ref; *meas_j{}=q;"
    )
    specs += (
        "measraw_j{}=raw; *vel_j{}=dq; *torque_j{}=tau; fault_j{}=zeros; arm_state=2; base_fault=0;"
        " refresh_ok=1;"
    )
    specs += "sigma_min=0.21; rot_error_rad=ry; t_send_s=send; t_recv_s=receive"
    data = {"raw": np.mod(run.q, 2 * np.pi), "zeros": np.zeros(run.q.shape, int)}
    columns, right = wide(run, specs, **data, send=run.t + 2e-4, receive=run.t + 9e-4)
    also(right, "q", "measraw_j{}", range(1, 8), RAD)
    table(folder / "trial_004.csv", columns)
    return Answer("trial_004.csv", {"time_s": "s", "t_send_s": "s", "t_recv_s": "s"}, right=right)


@layout(UR, rate=125.0)
def cocarry_admittance(folder: Path, run: Run) -> Answer:
    """Write a ROS 2 logger of co-carrying (public source, CocarryAdmittanceLogger): four clocks in
    ns, texts, JSON in a cell.
    """
    specs = (
        "timestamp_ns=ns; f_human_x=rx; f_human_y=ry; f_human_z=rz; inference_ms=3.1; model=tcn; "
        "role=follower; fh_timestamp_ns=fh;"
    )
    specs += (
        "fr_timestamp_ns=fh; force_age_ms=1.5; udp_gap_ms=8.0; *joint_position_j{}=q; "
        "*joint_velocity_j{}=dq; *torque_J{}_Nm=tau;"
    )
    specs += (
        "joint_timestamp_ns=joint; robot_force_status=ok; robot_force_frame=base; "
        "hybrid_status_json=status"
    )
    ns = np.round((EPOCH + run.t) * 1e9).astype(np.int64)
    data = {"ns": ns, "joint": ns - 700_000, "fh": ns[np.arange(len(ns)) // 4 * 4] - 1_500_000}
    data |= {"status": np.full(len(ns), '{"mode": "admittance", "axes": [1, 1, 0]}', dtype=object)}
    clocks = {"timestamp_ns": "ns", "joint_timestamp_ns": "ns"}
    return recorded(folder, run, "cocarry_admittance_3d_20240503.csv", clocks, specs, data=data)


@layout(LEG, rate=100.0)
def candle_exoskeleton(folder: Path, run: Run) -> Answer:
    """Write an exoskeleton of two MD80 drives (public Python source): torque is the command,
    actual_torque the measured one.
    """
    specs = (
        "time=t; *position_{}=q; *velocity_{}=dq; gait_phase_{}=phase; torque_{}=tau_ref; "
        "*actual_torque_{}=tau;"
    )
    specs += "mechanicalPower_{}=power"
    columns, right = wide(run, specs, range(2), phase=np.mod(run.q + 1, 1), power=run.tau * run.dq)
    also(right, "tau", "torque_{}", range(2), NM, run.tau_ref)
    table(folder / "run_1.txt", columns, sep=" ", float_format="%.6f")
    return Answer("run_1.txt", {"time": "s"}, right=right)


@layout(IIWA, rate=20.0, how="points")
def trajectory_handler(folder: Path, run: Run) -> Answer:
    """matthias-mayr/ROS1-Joint-Trajectory-Handler, README: positions by joint, the time last; there
    is no torque.
    """
    name = "2022-02-02T14:55:13.888918_trajectory.csv"
    return recorded(folder, run, name, {"time": "s"}, "*iiwa_joint_{}=q; time=t", known=False)


@layout(UR, rate=125.0)
def ur3_dados(folder: Path, run: Run) -> Answer:
    """Write a UR3's identification (public MATLAB source, Validation_Data_Preparation.m): t, then
    theta, d_theta, torque a joint.
    """
    joints = [part[:, j] for j in range(6) for part in (run.q, run.dq, run.tau)]
    savemat(folder / "dados_aleatorios.mat", {"dados": np.column_stack([run.t, *joints])})
    return Answer("dados_aleatorios.mat", right=anywhere(q=RAD, dq=RADS, tau=NM), texts=False)


@layout(SIX, rate=400.0)
def y1_teach_jsonl(folder: Path, run: Run) -> Answer:
    """IMETA-Robotics/y1_sdk_python, record_trajectory.py: a line of JSON a sample, no clock, the
    rate in the file's name.
    """
    lines = []
    for q, dq, tau, pose in zip(run.q, run.dq, run.tau, run.pose, strict=True):
        line = {
            "position": list(q),
            "velocity": list(dq),
            "effort": list(tau),
            "end_pose": list(pose),
        }
        lines.append(json.dumps(line) + "\n")
    (folder / "arm_state_400hz.jsonl").write_text("".join(lines))
    return Answer(
        "arm_state_400hz.jsonl", rate=400.0, right=anywhere(q=RAD, dq=RADS, tau=NM), texts=False
    )


@layout(NAO, rate=50.0)
def naoqi_memory(folder: Path, run: Run) -> Answer:
    """ALMemory keys of a NAO's arm (doc.aldebaran.com, "Actuator & Sensor list"), logged by a
    script: rad, A, °C; no torque.
    """
    key = "Device/SubDeviceList/{}"
    specs = (
        f"timestamp=epoch; *{key}/Position/Actuator/Value=q_ref; *{key}/Position/Sensor/Value=q;"
    )
    specs += (
        f"*{key}/ElectricCurrent/Sensor/Value=amps:current:A; {key}/Temperature/Sensor/Value=temp"
    )
    columns, right = wide(run, specs, NAO.joints, joint_wise=True, epoch=EPOCH + run.t)
    also(right, "temperature", key + "/Temperature/Sensor/Value", NAO.joints, ("degC", "°C"))
    table(folder / "larm.csv", columns)
    return Answer("larm.csv", {"timestamp": "s"}, right=right)


@layout(THREE, rate=1000.0)
def robotran_results(folder: Path, run: Run) -> Answer:
    """Robotran's results (robotran-doc, "Results files explanation"): dirdyn_q.res, _qd.res,
    _Qq.res: t and a column a joint.
    """
    for suffix, part in (("q", run.q), ("qd", run.dq), ("Qq", run.tau)):
        rows(folder / f"dirdyn_{suffix}.res", np.column_stack([run.t, part]), "   ", form="+.8e")
    return Answer("dirdyn_q.res", right=anywhere(q=RAD, dq=RADS, tau=NM), texts=False, table=False)


@layout(SEVEN, rate=100.0)
def logsout_saved(folder: Path, run: Run) -> Answer:
    """robotology-playground/torque-control-params-estimation, SaveData.m: q, qD, qDD, tau, time and
    a structure PWM.
    """
    parts = {"q": run.q, "qD": run.dq, "qDD": run.ddq, "tau": run.tau, "time": run.t[:, None]}
    parts["PWM"] = {"torso": 3 * run.tau[:, :3], "left_arm": 5 * run.tau}
    savemat(folder / "left_arm_01.mat", parts)
    return Answer("left_arm_01.mat", right=anywhere(q=RAD, dq=RADS, tau=NM), texts=False)


@layout(THREE, rate=200.0)
def embed_export(folder: Path, run: Run) -> Answer:
    """Altair Embed's export block (help.altair.com, "export"): #I=start, end, increment; then
    signals without names.
    """
    head = f"#I=0,{run.t[-1]:g},{run.t[1]:g}\n"
    rows(folder / "scope.csv", np.column_stack([run.q, run.dq, run.tau]), ",", head)
    return Answer("scope.csv", rate=200.0, right=anywhere(q=RAD, dq=RADS, tau=NM), texts=False)


# ---- laboratory practice


@layout(THREE, rate=200.0)
def finnish_sheet(folder: Path, run: Run) -> Answer:
    """Write a Finnish test rig's export to a sheet: semicolons, decimal commas, code page 1252."""
    specs = (
        "Aika (s)=t; *Nivel {} kulma (°)=q°; *Nivel {} nopeus (°/s)=dq°; *Nivel {} ohje (°)=q_ref°;"
        " *Nivel {} momentti (Nm)=tau"
    )
    how = {"sep": ";", "decimal": ",", "encoding": "cp1252"}
    return recorded(folder, run, "mittaus_7.csv", {"Aika (s)": "s"}, specs, **how)


@layout(SIX, rate=500.0)
def notes_in_yaml(folder: Path, run: Run) -> Answer:
    """Write a laboratory's script: bare columns without a clock; rate and units stand in run03.yaml
    beside.
    """
    note = (
        "robot: cell 2\nsample_rate_hz: 500\nunits:\n  q: deg\n  dq: deg/s\n  tau: N*m\noperator: "
        "mk\n"
    )
    (folder / "run03.yaml").write_text(note)
    right = recorded(folder, run, "run03.csv", {}, "*q{}=q°; *dq{}=dq°; *tau{}=tau").right
    return Answer("run03.csv", rate=500.0, right=right)


@layout(SIX, rate=250.0)
def one_array_a_file(folder: Path, run: Run) -> Answer:
    """Write a script that calls np.save once a signal: t.npy, q.npy, dq.npy and tau.npy in one
    folder.
    """
    for name, part in (("t", run.t), ("q", run.q), ("dq", run.dq), ("tau", run.tau)):
        np.save(folder / f"{name}.npy", part)
    return Answer("q.npy", right=anywhere(q=RAD, dq=RADS, tau=NM), texts=False, table=False)


@layout(GO, rate=100.0)
def file_a_quantity(folder: Path, run: Run) -> Answer:
    """Write a Logger for Genesis (public Python source): joint_positions.csv, _velocities.csv and
    _efforts.csv, each with Time(ms).
    """
    for name, part in (("positions", run.q), ("velocities", run.dq), ("efforts", run.tau)):
        columns = {"Time(ms)": values(run)["ms"]} | dict(zip(GO.joints, part.T, strict=True))
        table(folder / f"joint_{name}.csv", columns)
    right = anywhere(q=RAD, dq=RADS, tau=NM)
    return Answer("joint_positions.csv", {"Time(ms)": "ms"}, right=right, texts=False, table=False)


@layout(THREE, rate=200.0)
def bench_with_head(folder: Path, run: Run) -> Answer:
    """Write a test bench's file: a head of keys and values, a row of symbols, a row of units; the
    speeds in 1/min.
    """
    specs = "t=t; *phi{}=q°; n{}=rpm; *M{}=tau; phi{}_soll=q_ref°"
    columns, right = wide(run, specs, rpm=run.dq * 30 / np.pi)
    also(right, "dq", "n{}", (1, 2, 3), ("rpm", "1/min"))
    also(right, "q_ref", "phi{}_soll", (1, 2, 3), DEG)
    head = (
        "Test bench;RRR 2\nDate;03.05.2024 14:02\nSampling time;5 ms\nPayload;2.5 kg\nOperator;HK\n"
        "\n"
    )
    units = ["s", *["deg"] * 3, *["1/min"] * 3, *["Nm"] * 3, *["deg"] * 3]
    head += ";".join(columns) + "\n" + ";".join(units) + "\n"
    table(folder / "bench_0503.csv", columns, head, header=False, sep=";")
    return Answer("bench_0503.csv", {"t": "s"}, right=right)


@layout(SIX, rate=250.0)
def writetable_names(folder: Path, run: Run) -> Answer:
    """MATLAB's readtable and writetable (mathworks.com, "VariableNamingRule"): "q1 [deg/s]" has
    become q1_deg_s_.
    """
    specs = "t_s_=t; *q{}_deg_=q°; *dq{}_deg_s_=dq°; *q{}_ref_deg_=q_ref°; *tau{}_Nm_=tau"
    return recorded(folder, run, "clean.csv", {"t_s_": "s"}, specs)


@layout(SEVEN, rate=200.0)
def warnings_between(folder: Path, run: Run) -> Answer:
    """Write a logger whose output and warnings went to one file: a line of text here and there
    between the rows.
    """
    answer = recorded(
        folder,
        run,
        "log.csv",
        {"stamp": "s"},
        "stamp=epoch; *q_{}=q; *dq_{}=dq; *tau_{}=tau",
        data={"epoch": EPOCH + run.t},
    )
    lines = (folder / "log.csv").read_text().splitlines()
    for k in (1700, 903, 411):
        lines.insert(k, f"[WARN] [{EPOCH + run.t[k]:.6f}]: control loop missed its rate of 200 Hz")
    (folder / "log.csv").write_text("\n".join(lines) + "\n")
    return answer


@layout(PSM, rate=200.0)
def dvrk_joints(folder: Path, run: Run) -> Answer:
    """Write a bag parser of a da Vinci's PSM (public Python source, dvrk force estimation): stamp,
    q, dq, efforts; the third slides.
    """
    rows(
        folder / "bag_0.csv",
        np.column_stack([EPOCH + run.t, run.q, run.dq, run.tau]),
        ",",
        form=".6f",
    )
    units = {"q": ("rad,rad,m,rad,rad,rad",), "dq": ("rad/s,rad/s,m/s,rad/s,rad/s,rad/s",)}
    units["tau"] = ("N m,N m,N,N m,N m,N m", "Nm,Nm,N,Nm,Nm,Nm")
    return Answer("bag_0.csv", right=anywhere(**units), texts=False)


@layout(SIX, rate=100.0)
def efforts_before_positions(folder: Path, run: Run) -> Answer:
    """segbot_arm_perception's logger (utexas-bwi/segbot_arm): six efforts, six positions, the
    tool's; no clock, no names.
    """
    rows(
        folder / "shake_12.csv", np.column_stack([run.tau, run.q, run.pose[:, :3]]), ",", form=".6f"
    )
    return Answer("shake_12.csv", right=anywhere(q=RAD, tau=NM), texts=False)


@layout(SEVEN, rate=30.0)
def realman_frames(folder: Path, run: Run) -> Answer:
    """Write a recorder of Realman arms (public "Data Recording Guide"): JSON of frames, joints in
    degrees and radians, mA.
    """
    frames = []
    for k, t in enumerate(run.t):
        arm = {"joints_deg": np.degrees(run.q[k]).tolist(), "joints_rad": run.q[k].tolist()}
        arm |= {
            "joint_current_ma": (1e3 * run.current[k]).tolist(),
            "position": run.pose[k, :3].tolist(),
        }
        frames.append({"frame": k, "timestamp": EPOCH + t, "arm1": arm})
    text = json.dumps(
        {"metadata": {"fps": 30, "arm1_ip": "192.168.1.18"}, "frames": frames}, indent=1
    )
    (folder / "recording_20240503_140211.json").write_text(text)
    right = anywhere(q=(*DEG, *RAD), current=("mA",), tau=("mA",))
    return Answer("recording_20240503_140211.json", right=right, texts=False)


# ---- hard ones


@layout(FOUR, rate=100.0)
def licas_two_arms(folder: Path, run: Run) -> Answer:
    """LiCAS_DataLog.txt (University of Seville, DataViewer_LiCAS_ECI.m): two arms of four joints;
    which is this one?
    """
    q, dq, tau = np.degrees(run.q), np.degrees(run.dq), run.tau
    pwm = np.clip(tau / np.abs(tau).max(axis=0), -1, 1)
    both = [part for p in (q, dq, tau, pwm) for part in (p, np.roll(p, 300, axis=0))]
    numbers = np.column_stack([run.t, 100 * run.pose, *both])
    rows(folder / "LiCAS_DataLog.txt", numbers, "\t", form=".5f")
    right = anywhere(q=DEG, dq=DEGS, tau=NM)
    return Answer("LiCAS_DataLog.txt", right=right, texts=False, draftable=False)


@layout(TWO, rate=200.0)
def panasonic_trace(folder: Path, run: Run) -> Answer:
    """Panasonic FPWIN's trace (infohub.industry.panasonic.eu, t-0000014610): date, time to the
    second, interval in 10 us, units.
    """
    names = [f"J{j}_{part}" for part in ("POS", "SPD", "TRQ") for j in (1, 2)]
    units = ["deg", "deg", "deg/s", "deg/s", "Nm", "Nm"]
    head = "Date,Time,Obtaining interval,1,2,3,4,5,6\n"
    head += "".join(",,," + ",".join(part) + "\n" for part in (names, units))
    lines = []
    for k, row in enumerate(np.column_stack([np.degrees(run.q), np.degrees(run.dq), run.tau])):
        lines.append(
            f"2024/05/03,14:02:{11 + int(run.t[k]):02d},{500 * (k > 0)},"
            + ",".join(f"{x:.5f}" for x in row)
            + "\n"
        )
    (folder / "Arm(240503_140211_TRACE).csv").write_text(head + "".join(lines))
    return Answer(
        "Arm(240503_140211_TRACE).csv",
        rate=200.0,
        right=anywhere(q=DEG, dq=DEGS, tau=NM),
        texts=False,
    )


@layout(TWO, rate=100.0)
def teleplot_lines(folder: Path, run: Run) -> Answer:
    """Teleplot's telemetry (github.com/nesnes/teleplot, "Telemetry Format"): >name:ms:value§unit, a
    line a value.
    """
    parts = [
        (f"{name}{j + 1}", part[:, j], u) for name, part, u in _teleplot(run) for j in range(2)
    ]
    start, lines = 1714744931250, []
    for k, ms in enumerate(values(run)["ms"]):
        lines += [f">{name}:{start + ms}:{part[k]:.5f}§{unit}\n" for name, part, unit in parts]
    (folder / "teleplot.log").write_text("".join(lines), encoding="utf-8")
    return Answer("teleplot.log", right=anywhere(q=RAD, dq=RADS, tau=NM), texts=False, table=False)


def _teleplot(run: Run) -> tuple:
    return ("q", run.q, "rad"), ("dq", run.dq, "rad/s"), ("tau", run.tau, "Nm")


@layout(SEVEN, rate=200.0)
def epoch_in_single_precision(folder: Path, run: Run) -> Answer:
    """Write a script that held time.time() in a float32 array: all stamps are one number; the
    velocity alone tells the rate.
    """
    stamps = (EPOCH + run.t).astype(np.float32).astype(np.float64)
    right = recorded(
        folder,
        run,
        "run.csv",
        {},
        "timestamp=stamps; *q{}=q; *dq{}=dq; *tau{}=tau",
        data={"stamps": stamps},
    ).right
    return Answer("run.csv", rate=200.0, right=right, table=False)


@layout(FOUR, rate=100.0)
def zeros_where_the_bus_failed(folder: Path, run: Run) -> Answer:
    """Write a servo bus that answers nothing now and then: zeros stand for all that could not be
    read, in nine rows of 1200.
    """
    q, dq, tau = run.q.copy(), run.dq.copy(), run.tau.copy()
    lost = np.random.default_rng(7).choice(np.arange(20, 1180), 9, replace=False)
    q[lost], dq[lost], tau[lost] = 0.0, 0.0, 0.0
    specs = "t=t; *pos{}=seen; *vel{}=rate; *eff{}=force"
    columns, _ = wide(run, specs.replace("*", ""), seen=q, rate=dq, force=tau)
    table(folder / "servo.csv", columns)
    right: dict = {}
    for role, name, units, v in (
        ("q", "pos{}", RAD, q),
        ("dq", "vel{}", RADS, dq),
        ("tau", "eff{}", NM, tau),
    ):
        also(right, role, name, range(1, 5), units)
        also(
            right, role, name, range(1, 5), units, v
        )  # zeros and all: the import keeps them and warns (RRID-D06)
    return Answer("servo.csv", {"t": "s"}, right=right, table=False)
