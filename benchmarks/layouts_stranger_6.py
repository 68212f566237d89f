"""Write motions as thirty recordings, each with its answer: thirteen ordinary ones, ten of
laboratory practice, seven hard ones.

The sixth stranger's: written down, with their answers, before any of them ran, by one who had not
read the importer or the layouts of the other sets.
"""

import json
import pickle
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
from scipy.io import savemat

from benchmarks.import_layouts import (
    DEG,
    NM,
    RAD,
    RADS,
    Answer,
    Signal,
    anywhere,
    layout,
    recorded,
    table,
    vector,
    wide,
)
from benchmarks.recorded_arm import (
    FOUR,
    GEN3,
    IIWA,
    LEG,
    PANDA,
    SEVEN,
    SIX,
    THREE,
    TWO,
    UR,
    Arm,
    Run,
)

PENDULUM = Arm("pendulum", ("R1",), "y", (20,))
EPOCH = 1714744931.25  # [s]
UNNAMED = ("", "Unnamed: 0", "column_1")  # what a column without a name may be called


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


def block(start: int, n: int) -> tuple[str, ...]:
    """Name columns of a file without a header, from `start` on."""
    return tuple(f"column_{start + k}" for k in range(n))


def rows(path: Path, numbers: np.ndarray, separator: str, head: str = "") -> None:
    """Write numbers as text without a header, below `head`."""
    path.write_text(
        head + "".join(separator.join(f"{x:.8g}" for x in row) + "\n" for row in numbers)
    )


def misread(name: str) -> str:
    """Return a name of code page 1250 as code page 1252 reads it."""
    return name.encode("cp1250").decode("cp1252")


# ---- ordinary ones


@layout(IIWA)
def pyfri_collect(folder: Path, run: Run) -> Answer:
    """pyfri's collect_data (github.com/lbr-stack/pyfri, doc/examples.rst): mp, ip, mt, et; four
    clocks.
    """
    ns = np.round((EPOCH + run.t) * 1e9).astype(np.int64)
    specs = (
        "index=count; time=t; record_time_nsec=ns; tsec=sec; tnsec=nsec; *mp{}=q; *ip{}=q_ref; "
        "*mt{}=tau; et{}=ext; dt=0.005"
    )
    clocks = {"time": "s", "record_time_nsec": "ns", "tsec+tnsec": "s+ns"}
    return recorded(
        folder,
        run,
        "lbr.csv",
        clocks,
        specs,
        data={"ns": ns, "sec": ns // 10**9, "nsec": ns % 10**9},
    )


@layout(FOUR, rate=100.0)
def omx_joint_logger(folder: Path, run: Run) -> Answer:
    """Write a node that logs /joint_states by csv.writer (mekala-2405/omx_ws_back,
    omx_log_joint_states.py): NAME_pos, _vel, _eff.
    """
    specs = "t=t; *joint{}_pos=q; *joint{}_vel=dq; *joint{}_eff=tau"
    return recorded(folder, run, "omx_joint_log.csv", {"t": "s"}, specs)


@layout(UR, rate=125.0, how="points")
def factorynet_parquet(folder: Path, run: Run) -> Answer:
    """FactoryNet's columns of a UR (huggingface.co/datasets/FactoryNet4/factorynet): setpoint_,
    feedback_, effort_, ctx_.
    """
    specs = (
        "timestamp=t; ctx_speed_scaling=one; *setpoint_pos_{}=q_ref; *setpoint_vel_{}=dq_ref; "
        "setpoint_acc_{}=ddq;"
    )
    specs += (
        "setpoint_current_{}=want; setpoint_torque_{}=tau_ref; *feedback_pos_{}=q; "
        "*feedback_vel_{}=dq;"
    )
    specs += (
        "*effort_current_{}=amps:current:A; effort_voltage_{}=volts; ctx_temp_{}=temp; "
        "ctx_joint_mode_{}=mode"
    )
    data = {"want": run.tau_ref / np.linspace(11.0, 5.0, 6), "volts": 12 + run.dq + 0.01 * run.tau}
    data |= {"one": np.ones(len(run.t)), "mode": np.full(run.q.shape, 253)}
    columns, right = wide(run, specs, range(6), joint_wise=True, **data)
    also(right, "tau", "setpoint_torque_{}", range(6), NM, run.tau_ref)
    also(right, "ddq_ref", "setpoint_acc_{}", range(6), ("rad/s^2",))
    also(right, "temperature", "ctx_temp_{}", range(6), ("degC", "°C"))
    also(right, "tau_feedforward", "setpoint_torque_{}", range(6), NM)
    pd.DataFrame(columns).to_parquet(folder / "episode_000.parquet")
    return Answer("episode_000.parquet", {"timestamp": "s"}, right=right)


@layout(THREE, rate=500.0)
def sdi_csv(folder: Path, run: Run) -> Answer:
    """Write Simulation Data Inspector, CSV (mathworks.com, "Import Data from a CSV File"): rows of
    units and interpolation below.
    """
    specs = "time=t; *q({})=q°; *qd({})=dq°; *tau({})=tau; *q_cmd({})=q_ref°"
    columns, right = wide(run, specs)
    units = ["", *["Unit: deg"] * 3, *["Unit: deg/s"] * 3, *["Unit: N*m"] * 3, *["Unit: deg"] * 3]
    below = ["", *["Interp: zoh"] * 12]
    head = ",".join(columns) + "\n" + ",".join(units) + "\n" + ",".join(below) + "\n"
    table(folder / "run_1.csv", columns, head, header=False)
    return Answer("run_1.csv", {"time": "s"}, right=right)


@layout(IIWA, rate=100.0)
def drake_vector_log(folder: Path, run: Run) -> Answer:
    """Drake's VectorLogSink (drake.mit.edu): sample_times(), and data() of one column a time; state
    = [q; v].
    """
    state = np.hstack([run.q, run.dq]).T
    np.savez(folder / "iiwa_log.npz", sample_times=run.t, state=state, torque_measured=run.tau.T)
    return Answer("iiwa_log.npz", right=anywhere(q=RAD, dq=RADS, tau=NM), texts=False)


@layout(UR, rate=100.0)
def ur_record_state(folder: Path, run: Run) -> Answer:
    """MATLAB's recordRobotState of a urRTDEClient (mathworks.com): a struct of N x 6 arrays, no
    time, no torque.
    """
    names = ("JointConfiguration", "JointVelocity", "Pose", "EEVelocity", "JointAcceleration")
    speed = np.gradient(run.pose, run.t, axis=0)
    savemat(
        folder / "ur5e_20s.mat",
        {"data": dict(zip(names, (run.q, run.dq, run.pose, speed, run.ddq), strict=True))},
    )
    return Answer("ur5e_20s.mat", rate=100.0, right=anywhere(q=RAD, dq=RADS), texts=False)


@layout(SEVEN, rate=100.0)
def yarp_robot_logger(folder: Path, run: Run) -> Answer:
    """YarpRobotLoggerDevice by robometry (ami-iit/bipedal-locomotion-framework): .mat 7.3, data of
    n x 1 x T, names.
    """
    path = folder / "robot_logger_device_2024_08_21_11_00_02.mat"
    with h5py.File(path, "w", userblock_size=512) as file:

        def cells(group: h5py.Group, name: str, texts: tuple[str, ...]) -> None:
            made = [
                file.create_dataset(f"#refs#/{group.name}/{name}_{k}", data=[[ord(c)] for c in s])
                for k, s in enumerate(texts)
            ]
            group.create_dataset(
                name, data=np.array([[d.ref for d in made]], dtype=h5py.ref_dtype)
            ).attrs["MATLAB_class"] = b"cell"

        device = file.create_group("robot_logger_device")
        cells(device, "description_list", run.arm.joints)
        parts = {
            "joints_state/positions": run.q,
            "joints_state/velocities": run.dq,
            "joints_state/torques": run.tau,
        }
        for name, v in (parts | {"motors_state/currents": run.current}).items():
            group = device.create_group(name)
            group["data"] = v[:, None, :]
            group["timestamps"] = (EPOCH + run.t)[:, None]
            cells(group, "elements_names", run.arm.joints)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return Answer(path.name, right=anywhere(q=RAD, dq=RADS, tau=NM, current=("A",)), texts=False)


@layout(PANDA, rate=100.0)
def mcap_cat_json(folder: Path, run: Run) -> Answer:
    """`mcap cat --json` of /joint_states (github.com/foxglove/mcap, CLI): log_time, publish_time,
    the message under data.
    """
    names = [*run.arm.joints, *run.arm.fingers]
    lines = []
    for k, t in enumerate(EPOCH + run.t):
        data = {
            "header": {"stamp": {"sec": int(t), "nanosec": round(t % 1 * 1e9)}, "frame_id": ""},
            "name": names,
        }
        for key, v, finger in (
            ("position", run.q, 0.035),
            ("velocity", run.dq, 0.0),
            ("effort", run.tau, 0.0),
        ):
            data[key] = [*np.round(v[k], 9).tolist(), finger, finger]
        log = {
            "topic": "/joint_states",
            "sequence": k,
            "log_time": round(t + 4e-4, 9),
            "publish_time": round(t + 2e-4, 9),
        }
        lines.append(json.dumps(log | {"data": data}))
    (folder / "joint_states.json").write_text("\n".join(lines) + "\n")
    return Answer("joint_states.json", right=anywhere(q=RAD, dq=RADS, tau=NM), texts=False)


@layout(THREE, rate=1000.0)
def aerotech_signals(folder: Path, run: Run) -> Answer:
    """Aerotech Automation1, Data Visualizer (help.aerotech.com): AxisDataSignal names, the axis and
    the unit in brackets.
    """
    specs = (
        "Time (sec)=t; *PositionCommand(J{}) (deg)=q_ref°; *PositionFeedback(J{}) (deg)=q°; "
        "PositionError(J{}) (deg)=error;"
    )
    specs += (
        "*VelocityCommand(J{}) (deg/sec)=dq_ref°:dq_ref°:deg/s; *VelocityFeedback(J{}) "
        "(deg/sec)=dq°:dq°:deg/s;"
    )
    specs += "CurrentCommand(J{}) (A)=want; *CurrentFeedback(J{}) (A)=amps:current:A"
    data = {"error": np.degrees(run.q_ref - run.q), "want": run.tau_ref / np.linspace(11.0, 5.0, 3)}
    answer = recorded(folder, run, "plot.csv", {"Time": "s"}, specs, joint_wise=True, data=data)
    for role in ("dq", "dq_ref"):
        answer.right[role] = (Signal(answer.right[role][0].columns, ("deg/s", "°/s", "deg/sec")),)
    return answer


@layout(TWO, rate=500.0)
def kollmorgen_workbench(folder: Path, run: Run) -> Answer:
    """Kollmorgen WorkBench scope (webhelp.kollmorgen.com): PL.FB, PL.CMD, VL.FB, IL.FB by drive;
    deg, rpm, Arms.
    """
    specs = (
        "Time (ms)=ms; *AKD{}.PL.CMD (deg)=q_ref°; *AKD{}.PL.FB (deg)=q°; *AKD{}.VL.FB "
        "(rpm)=rpm:dq:rpm;"
    )
    specs += "*AKD{}.IL.FB (Arms)=amps:current:A"
    answer = recorded(
        folder,
        run,
        "scope.csv",
        {"Time": "ms"},
        specs,
        joint_wise=True,
        data={"rpm": run.dq * 30 / np.pi},
    )
    for role in ("current", "tau"):
        answer.right[role] = (Signal(answer.right[role][0].columns, ("A", "Arms")),)
    return answer


@layout(THREE, rate=500.0)
def nptdms_frame(folder: Path, run: Run) -> Answer:
    """npTDMS as_dataframe(time_index=True).to_csv() (nptdms.readthedocs.io): columns are paths,
    time is the index.
    """
    specs = (
        "*/'Motion'/'J{} Angle'=q°; */'Motion'/'J{} Speed'=dq°; */'Drives'/'J{} "
        "Current'=amps:current:A;"
    )
    specs += "*/'Drives'/'J{} Torque'=tau"
    return recorded(folder, run, "rig_0007.csv", dict.fromkeys(UNNAMED, "s"), "=t;" + specs)


@layout(SEVEN, rate=500.0)
def hrpsys_log(folder: Path, run: Run) -> Answer:
    """hrpsys DataLogger (start-jsk/rtmros_common, hrpsys_ros_bridge): a file a port,
    NAME.RobotHardware0_q: time and values.
    """
    for port, v in (("q", run.q), ("dq", run.dq), ("tau", run.tau)):
        rows(folder / f"log.RobotHardware0_{port}", np.column_stack([run.t, v]), " ")
    return Answer(
        "log.RobotHardware0_q", {"column_1": "s"}, right={"q": (Signal(block(2, 7), RAD),)}
    )


@layout(PENDULUM, rate=100.0)
def bam_json(folder: Path, run: Run) -> Answer:
    """Write a recording of BAM, one servo with a pendulum (bam.readthedocs.io,
    identification/acquisition): settings, then entries.
    """
    entries = [
        {
            "position": q,
            "speed": dq,
            "load": 100 * tau / 20,
            "input_volts": 15.1,
            "temp": 31,
            "timestamp": t,
            "goal_position": goal,
        }
        for t, q, dq, tau, goal in zip(
            run.t, *(v[:, 0].round(7) for v in (run.q, run.dq, run.tau, run.q_ref)), strict=True
        )
    ]
    head = {
        "mass": 0.5,
        "length": 0.1,
        "kp": 400,
        "vin": 15.0,
        "motor": "mx106",
        "trajectory": "sin_time_square",
        "dt": 0.01,
    }
    (folder / "2024-05-03_14h02m11.json").write_text(json.dumps(head | {"entries": entries}))
    right = anywhere(q=RAD, dq=RADS, q_ref=RAD) | {"tau": (Signal((), ()),)}
    return Answer("2024-05-03_14h02m11.json", right=right, texts=False)


# ---- usual laboratory practice


@layout(UR, rate=10.0, how="points")
def rtde_without_time(folder: Path, run: Run) -> Answer:
    """Write a script by ur_rtde in teach mode, DataFrame.to_csv with its index (public code): q0 …
    q5, px … rz, no time.
    """
    specs = "=count; *q{}=q; px=x; py=y; pz=z; rx=rx; ry=ry; rz=rz"
    columns, right = wide(run, specs, range(6))
    table(folder / "teach.csv", columns)
    return Answer("teach.csv", dict.fromkeys(UNNAMED, "sample"), rate=10.0, right=right)


@layout(UR, rate=125.0)
def moose_headerless(folder: Path, run: Run) -> Answer:
    """writeLog of swiatecki/ProjectMoose (Tests/camSwing/logging.cpp): clocks, q, qd, targets,
    tool, camera; no header.
    """
    camera = np.column_stack([320 + 100 * run.pose[:, 0], 0.4 * run.pose[:, 0]])
    parts = (
        4000 + run.t,
        EPOCH + run.t,
        run.q,
        run.dq,
        run.ddq,
        run.dq_ref,
        run.q_ref,
        run.pose,
        camera,
    )
    np.savetxt(folder / "swing3.csv", np.column_stack(parts), fmt="%.15g", delimiter=", ")
    units = {
        "q": (3, RAD),
        "dq": (9, RADS),
        "ddq_ref": (15, ("rad/s^2",)),
        "dq_ref": (21, RADS),
        "q_ref": (27, RAD),
    }
    right = {role: (Signal(block(start, 6), unit),) for role, (start, unit) in units.items()}
    return Answer("swing3.csv", {"column_1": "s", "column_2": "s"}, right=right)


@layout(SIX, rate=250.0)
def czech_sheet(folder: Path, run: Run) -> Answer:
    """Write a sheet of a Czech rig, saved by Excel as CSV in code page 1250: semicolons, decimal
    commas (own).
    """
    specs = (
        "čas [s]=t; *poloha {} [°]=q°; *žádaná poloha {} [°]=q_ref°; *rychlost {} [°/s]=dq°; "
        "*moment {} [Nm]=tau;"
    )
    specs += "teplota {} [°C]=temp"
    columns, right = wide(run, specs)
    also(right, "temperature", "teplota {} [°C]", range(1, 7), ("degC", "°C"))
    for role, signals in right.items():  # as code page 1252 reads the names: they serve as well
        right[role] = (
            *signals,
            Signal(tuple(misread(c) for c in signals[0].columns), signals[0].units),
        )
    table(folder / "měření.csv", columns, encoding="cp1250", sep=";", decimal=",")
    return Answer("měření.csv", dict.fromkeys(("čas", misread("čas")), "s"), right=right)


@layout(THREE)
def latex_headers(folder: Path, run: Run) -> Answer:
    """Write a table made for pgfplots, its header in LaTeX (own, after usual practice)."""
    specs = "$t$ [s]=t; *$q_{}$ [rad]=q; *$\\dot{q}_{}$ [rad/s]=dq; *$\\tau_{}$ [Nm]=tau"
    return recorded(folder, run, "fig4.csv", {"$t$": "s"}, specs)


@layout(TWO, rate=1000.0)
def gnuplot_columns(folder: Path, run: Run) -> Answer:
    """Write a data file for gnuplot: comments say what each column is, one a line (own, after usual
    practice).
    """
    names = [
        "time [ms]",
        *(
            f"{name}_{j} [{unit}]"
            for name, unit in (("theta", "deg"), ("omega", "deg/s"), ("M", "Nm"))
            for j in (1, 2)
        ),
    ]
    head = "# double pendulum, run 12\n" + "".join(
        f"# {k}: {name}\n" for k, name in enumerate(names, 1)
    )
    numbers = np.column_stack([run.t * 1e3, np.degrees(run.q), np.degrees(run.dq), run.tau])
    rows(folder / "run12.dat", numbers, "\t", head)
    right = {
        "q": (Signal(block(2, 2), DEG),),
        "dq": (Signal(block(4, 2), ("deg/s", "°/s")),),
        "tau": (Signal(block(6, 2), NM),),
    }
    also(right, "q", "theta_{}", (1, 2), DEG)
    also(right, "dq", "omega_{}", (1, 2), ("deg/s", "°/s"))
    also(right, "tau", "M_{}", (1, 2), NM)
    return Answer("run12.dat", {"column_1": "ms", "time": "ms"}, right=right)


@layout(FOUR)
def units_in_a_readme(folder: Path, run: Run) -> Answer:
    """Write a student's log: its units (ms, deg, deg/s, N mm) stand in a readme beside, not in the
    file (own).
    """
    (folder / "README.txt").write_text(
        "time in ms, ang in deg, vel in deg/s, trq in N mm (joint side)\n"
    )
    specs = "time=ms; *ang{}=q°; *vel{}=dq°; *trq{}=nmm:tau:N mm"
    return recorded(folder, run, "trial_3.csv", {"time": "ms"}, specs, data={"nmm": run.tau * 1e3})


@layout(THREE)
def same_names_again(folder: Path, run: Run) -> Answer:
    """Three joints beside each other, each below the same three names (own, after usual
    practice).
    """
    parts = [np.column_stack([run.q[:, j], run.dq[:, j], run.tau[:, j]]) for j in range(3)]
    rows(
        folder / "arm.csv",
        np.column_stack([run.t, *parts]),
        ",",
        "time" + ",pos,vel,trq" * 3 + "\n",
    )
    return Answer(
        "arm.csv", {"time": "s"}, right=anywhere(q=RAD, dq=RADS, tau=NM), texts=False, table=False
    )


@layout(SIX, rate=20.0)
def mycobot_lists(folder: Path, run: Run) -> Answer:
    """Write a script by pymycobot (docs.elephantrobotics.com): get_angles [deg], get_servo_speeds
    [steps/s], get_servo_currents [mA].
    """
    parts = {
        "angles": np.degrees(run.q),
        "servo_speeds": run.dq / (2 * np.pi) * 4096,
        "servo_currents": run.current * 1e3,
    }
    columns = {name: [f"[{vector(row)}]" for row in v] for name, v in parts.items()}
    table(folder / "mycobot.csv", {"timestamp": EPOCH + run.t} | columns)
    right = anywhere(q=DEG, dq=("counts/s", "steps/s"), current=("mA",), tau=("mA",))
    return Answer("mycobot.csv", {"timestamp": "s"}, right=right, texts=False)


@layout(THREE)
def bilateral_teleoperation(folder: Path, run: Run) -> Answer:
    """Two equal arms coupled to each other: m_ is the master, s_ the slave (own, after papers on
    bilateral control).
    """
    specs = (
        "t=t; m_theta_{}=q_ref; *s_theta_{}=q; m_dtheta_{}=dq_ref; *s_dtheta_{}=dq; "
        "m_tau_{}=tau_ref; *s_tau_{}=tau"
    )
    columns, right = wide(run, specs)
    for role, name, units in (("q", "theta", RAD), ("dq", "dtheta", RADS), ("tau", "tau", NM)):
        also(right, role, f"m_{name}_{{}}", range(1, 4), units, getattr(run, f"{role}_ref"))
    also(right, "q_ref", "m_theta_{}", range(1, 4), RAD)
    also(right, "dq_ref", "m_dtheta_{}", range(1, 4), RADS)
    table(folder / "exp_2.csv", columns)
    return Answer("exp_2.csv", {"t": "s"}, right=right)


@layout(LEG, rate=500.0)
def exoskeleton_onedof(folder: Path, run: Run) -> Answer:
    """Write a logger of exoskeleton joints (public code, onedof_logger.cpp): R_JOINT_Load, _fLoad,
    _deg, _abs_r, _fAbs, _enc, _T_des.
    """
    smooth, filtered = (
        pd.DataFrame(v).rolling(5, min_periods=1).mean().to_numpy() for v in (run.tau, run.q)
    )
    joints = run.arm.joints
    specs = (
        "Elapsed Time(ms)=ms; R_{}_fault=0; *R_{}_Load=tau; R_{}_fLoad=smooth; *R_{}_deg=q°; "
        "R_{}_abs_r=q; R_{}_fAbs=filtered;"
    )
    specs += "R_{}_enc=ticks; R_{}_T_des=tau_ref"
    data = {
        "smooth": smooth,
        "filtered": filtered,
        "ticks": np.round(run.q / (2 * np.pi) * 16384).astype(int),
    }
    columns, right = wide(run, specs, joints, joint_wise=True, **data)
    also(right, "q", "R_{}_abs_r", joints, RAD)
    also(right, "q", "R_{}_fAbs", joints, RAD, filtered)
    also(right, "q", "R_{}_enc", joints, ("counts",))
    also(right, "tau", "R_{}_fLoad", joints, NM, smooth)
    also(right, "tau", "R_{}_T_des", joints, NM, run.tau_ref)
    table(folder / "walk_04.csv", columns)
    return Answer("walk_04.csv", {"Elapsed Time": "ms"}, right=right)


# ---- hard ones


@layout(SIX, rate=50.0)
def kuka_benchmark(folder: Path, run: Run) -> Answer:
    """Write the KR 300 of nonlinearbenchmark.org (Weigand 2022): u_train [N m], y_train [deg],
    time_train; _test.
    """
    cut = 3 * len(run.t) // 4
    parts = {}
    for name, part in (("train", slice(0, cut)), ("test", slice(cut, None))):
        parts |= {
            f"time_{name}": run.t[None, part],
            f"u_{name}": run.tau[part].T,
            f"y_{name}": np.degrees(run.q[part]).T,
        }
    savemat(folder / "forward_identification_without_raw_data.mat", parts)
    return Answer(
        "forward_identification_without_raw_data.mat",
        right=anywhere(q=DEG, tau=NM),
        texts=False,
        table=False,
    )


@layout(TWO)
def galil_scope(folder: Path, run: Run) -> Answer:
    """Galil's scope and data record (galil.com, Command Reference RP, TP, TE, TV, TT): counts, axes
    by letter, torque in volts.
    """
    specs = (
        "TIME=ms; *_RP{}=want:q_ref:counts; *_TP{}=is:q:counts; _TE{}=error; "
        "*_TV{}=speed:dq:counts/s; *_TT{}=volts:tau:?"
    )
    per = np.array([20000, 16000]) / (2 * np.pi)
    counts = {
        "want": run.q_ref * per,
        "is": run.q * per,
        "speed": run.dq * per,
        "error": (run.q_ref - run.q) * per,
    }
    data = {name: np.round(v).astype(int) for name, v in counts.items()} | {
        "volts": run.tau_ref / 12
    }
    return recorded(
        folder,
        run,
        "capture.csv",
        {"TIME": "*"},
        specs,
        "AB",
        joint_wise=True,
        known=False,
        data=data,
    )


@layout(UR, rate=50.0)
def pickled_steps(folder: Path, run: Run) -> Answer:
    """Write a list of dictionaries, pickled, as scripts of learning write it (own, after GELLO and
    others).
    """
    steps = [
        {"t": t, "q": q, "dq": dq, "tau": tau}
        for t, q, dq, tau in zip(run.t, run.q, run.dq, run.tau, strict=True)
    ]
    (folder / "episode_3.pkl").write_bytes(pickle.dumps(steps))
    return Answer(
        "episode_3.pkl",
        {"t": "s"},
        right=anywhere(q=RAD, dq=RADS, tau=NM),
        texts=False,
        table=False,
    )


@layout(IIWA, rate=50.0)
def sunrise_toolbox_cells(folder: Path, run: Run) -> Answer:
    """KUKA Sunrise Toolbox (Modi1987/KST-Kuka-Sunrise-Toolbox): its getters return 1 x 7 cells,
    here stacked.
    """
    savemat(
        folder / "iiwa_run.mat",
        {"t": run.t[:, None], "jPos": run.q.astype(object), "torques": run.tau.astype(object)},
    )
    return Answer("iiwa_run.mat", right=anywhere(q=RAD, tau=NM), texts=False, table=False)


@layout(THREE, rate=100.0)
def key_value_console(folder: Path, run: Run) -> Answer:
    """Write a console kept by tee: key=value pairs behind a level and a stamp (own, after
    logfmt).
    """
    lines = ["[INFO] arm ready"]
    for k, t in enumerate(run.t):
        pairs = {
            f"{key}{j + 1}": v[k, j]
            for key, v in (("q", run.q), ("dq", run.dq), ("tau", run.tau))
            for j in range(3)
        }
        lines.append(
            f"[INFO] [{EPOCH + t:.6f}] " + " ".join(f"{name}={x:.5f}" for name, x in pairs.items())
        )
    (folder / "console.log").write_text("\n".join(lines) + "\n")
    return Answer("console.log", right=anywhere(q=RAD, dq=RADS, tau=NM), texts=False, table=False)


@layout(GEN3, rate=100.0, size=3.0)
def angles_that_wrap(folder: Path, run: Run) -> Answer:
    """Joint states of Kinovarobotics/ros_kortex as CSV: endless joints are published within +-pi,
    so that they jump.
    """
    specs = "stamp=epoch; *joint_{}.position=wrapped:q; *joint_{}.velocity=dq; *joint_{}.effort=tau"
    data = {"epoch": EPOCH + run.t, "wrapped": (run.q + np.pi) % (2 * np.pi) - np.pi}
    return recorded(
        folder, run, "joint_states.csv", {"stamp": "s"}, specs, joint_wise=True, data=data
    )


@layout(FOUR)
def differences_called_dq(folder: Path, run: Run) -> Answer:
    """dq is np.diff(q), a step from sample to sample that nobody divided by the time (own, after
    usual practice).
    """
    steps = np.diff(run.q, axis=0, prepend=run.q[:1])
    specs = "t=t; *q{}=q; *dq{}=steps:dq:?; *tau{}=tau"
    return recorded(folder, run, "run.csv", {"t": "s"}, specs, data={"steps": steps})
