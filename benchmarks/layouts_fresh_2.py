"""Write one simulated motion as thirty more recordings, written down before any of them ran (see
import_layouts).
"""

import json
from pathlib import Path

import h5py
import numpy as np
import pandas as pd

from benchmarks.import_layouts import (
    UNITS,
    Answer,
    Signal,
    anywhere,
    current,
    layout,
    names,
    recorded,
    si,
    table,
    wide,
)
from benchmarks.recorded_arm import FOUR, IIWA, LIFT, SEVEN, SIX, THREE, TWO, UR, Run

PLAIN = "t=t; *q{}=q; *tau{}=tau"


@layout(SIX, rate=100.0)
def pandas_to_json(folder: Path, run: Run) -> Answer:
    """DataFrame.to_json() as it is by default: a column is an object of row numbers."""
    columns, right = wide(run, "t=t; *q{}=q; *dq{}=dq; *tau{}=tau")
    pd.DataFrame(columns).to_json(folder / "frame.json")
    return Answer("frame.json", {"t": "s"}, right=right)


@layout(THREE, robot="robot.toml", rate=200.0)
def pandas_to_json_split(folder: Path, run: Run) -> Answer:
    """DataFrame.to_json(orient="split"): names, row numbers and rows apart."""
    columns, right = wide(run, "time_s=t; *pos_{}_deg=q°; *torque_{}_Nm=tau")
    pd.DataFrame(columns).to_json(folder / "split.json", orient="split")
    return Answer("split.json", {"time_s": "s"}, right=right)


@layout(SIX, rate=250.0, how="turns")
def torques_called_t(folder: Path, run: Run) -> Answer:
    """Write a MATLAB script's header t, q1 … q6, T1 … T6: torques or temperatures?"""
    return recorded(folder, run, "run.csv", {"t": "s"}, "t=t; *q{}=q; *T{}=tau")


@layout(SIX, rate=250.0)
def states_and_inputs(folder: Path, run: Run) -> Answer:
    """Control engineering's names: x1 … x12 for positions and speeds, u1 … u6 for torques."""
    columns = {"t": run.t} | {f"x{k + 1}": v for k, v in enumerate(np.hstack([run.q, run.dq]).T)}
    table(folder / "sys.csv", columns | {f"u{k + 1}": v for k, v in enumerate(run.tau.T)})
    right = {
        "q": (si("x{}", 6, "q"),),
        "dq": (si("x{}", 6, "dq", 7),),
        "tau": (si("u{}", 6, "tau"),),
    }
    return Answer("sys.csv", {"t": "s"}, right=right)


@layout(IIWA, rate=200.0, how="points")
def desired_behind_the_number(folder: Path, run: Run) -> Answer:
    """q1d … beside q1 …, qp1 … beside qp1d …, tau1 …: d for desired behind the joint's number."""
    return recorded(
        folder,
        run,
        "exp.dat",
        {"t": "s"},
        "t=t; *q{}d=q_ref; *q{}=q; *qp{}=dq; *tau{}=tau",
        sep=" ",
    )


@layout(SIX, rate=125.0)
def command_and_feedback_without_noun(folder: Path, run: Run) -> Answer:
    """Write a test bench: "J1 Cmd [deg]", "J1 Fbk [deg]", "J1 Trq Fbk [%]"."""
    load = np.round(100 * run.tau / np.array(run.arm.effort), 2)
    specs = "Time [ms]=ms; *J{} Cmd [deg]=q_ref°; *J{} Fbk [deg]=q°; *J{} Trq Fbk [%]=load:tau:%"
    return recorded(
        folder,
        run,
        "bench.csv",
        {"Time [ms]": "ms"},
        specs,
        None,
        True,
        known=False,
        data={"load": load},
    )


@layout(SIX, rate=100.0)
def hungarian_names(folder: Path, run: Run) -> Answer:
    """Write a language that no table of words has: Idő, Szög, Előírt szög, Nyomaték."""
    specs = (
        "Idő [s]=t; *{}. tengely előírt szög [°]=q_ref°; *{}. tengely szög [°]=q°; *{}. tengely "
        "nyomaték [Nm]=tau"
    )
    return recorded(folder, run, "meres.csv", {"Idő [s]": "s"}, specs, sep=";", decimal=",")


@layout(SIX, rate=100.0)
def hungarian_command_alone(folder: Path, run: Run) -> Answer:
    """Write the same with the commanded angle alone: no position was measured."""
    specs = "Idő [s]=t; *{}. tengely előírt szög [°]=q_ref°; *{}. tengely nyomaték [Nm]=tau"
    return recorded(folder, run, "meres.csv", {"Idő [s]": "s"}, specs, known=False, sep=";")


@layout(SEVEN, rate=100.0)
def motor_and_link_positions(folder: Path, run: Run) -> Answer:
    """Series-elastic joints: motor_pos (gear 100, rad), link_pos, motor_current, spring_torque."""
    more = {"motor": 100 * run.q, "amps": run.current}
    specs = (
        "time=t; *link_pos_{}=q; motor_pos_{}=motor; motor_vel_{}=motor; *spring_torque_{}=tau; "
        "motor_current_{}=amps"
    )
    return recorded(folder, run, "sea.csv", {"time": "s"}, specs, data=more)


@layout(SIX, robot=None, rate=200.0)
def motor_radians_plainly_named(folder: Path, run: Run) -> Answer:
    """Write a drive's log: "position", "velocity" and "torque" of each axis are the motor's, in rad
    and N m.
    """
    gear = np.array([121.0, 121.0, 101.0, 80.0, 80.0, 51.0])
    more = {"angle": run.q * gear, "speed": run.dq * gear, "load": run.tau / gear}
    specs = (
        "time=t; *axis{}_position=angle:q:?; *axis{}_velocity=speed:dq:?; *axis{}_torque=load:tau:?"
    )
    return recorded(folder, run, "drive.csv", {"time": "s"}, specs, known=False, data=more)


@layout(SIX, rate=200.0)
def motor_radians_beside_a_robot(folder: Path, run: Run) -> Answer:
    """Write the same beside the robot's description, gears of 20 to 60."""
    gear = np.array([60.0, 60.0, 50.0, 30.0, 25.0, 20.0])
    more = {"angle": run.q * gear, "load": run.tau / gear}
    specs = "time=t; *axis{}_position=angle:q:?; *axis{}_torque=load:tau:?"
    return recorded(folder, run, "drive.csv", {"time": "s"}, specs, known=False, data=more)


@layout(SIX, rate=250.0)
def degrees_beside_radians(folder: Path, run: Run) -> Answer:
    """Positions in deg, velocities in rad/s, no unit anywhere: joint_pos, joint_vel, joint_eff."""
    return recorded(
        folder,
        run,
        "mixed.csv",
        {"time": "s"},
        "time=t; *joint_pos_{}=q°; *joint_vel_{}=dq; *joint_eff_{}=tau",
    )


@layout(UR, rate=125.0)
def other_names_alphabetical(folder: Path, run: Run) -> Answer:
    """Joints by short names of the maker's manual in alphabetical order: base, elbow, shoulder,
    wrist1 …
    """
    short = ("base", "shoulder", "elbow", "wrist1", "wrist2", "wrist3")
    columns, right = wide(run, "*{}_angle_rad=q; *{}_torque_Nm=tau", short)
    table(folder / "ur.csv", {"t_s": run.t} | dict(sorted(columns.items())))
    return Answer("ur.csv", {"t_s": "s"}, right=right)


@layout(SEVEN, rate=200.0)
def six_columns_for_seven_joints(folder: Path, run: Run) -> Answer:
    """Write a robot of seven joints, of which six were recorded."""
    specs = "t=t; *q{}=six:q; *tau{}=load:tau"
    more = {"six": run.q[:, :6], "load": run.tau[:, :6]}
    return recorded(folder, run, "six.csv", {"t": "s"}, specs, range(1, 7), known=False, data=more)


@layout(THREE, robot="robot.toml", rate=100.0)
def header_again_and_again(folder: Path, run: Run) -> Answer:
    """Write a logger that was started three times into one file: its header comes again, the clock
    goes on.
    """
    columns, right = wide(run, "time_s=t; *pos{}_rad=q; *tau{}_Nm=tau")
    frame, head = pd.DataFrame(columns), ",".join(columns) + "\n"
    parts = [frame.iloc[k : k + 400].to_csv(index=False, header=False) for k in range(0, 1200, 400)]
    (folder / "again.csv").write_text(head + head.join(parts))
    return Answer("again.csv", {"time_s": "s"}, right=right)


@layout(TWO, robot=None, rate=50.0)
def units_in_the_cells(folder: Path, run: Run) -> Answer:
    """Write a panel's printout: "12.345 deg", "-3.20 Nm" in the cells."""
    columns: dict = {"Time": [f"{t:.3f} s" for t in run.t]}
    for j in range(2):
        columns[f"Angle {j + 1}"] = [f"{x:.4f} deg" for x in np.degrees(run.q[:, j])]
        columns[f"Torque {j + 1}"] = [f"{x:.4f} Nm" for x in run.tau[:, j]]
    table(folder / "panel.csv", columns)
    right = {"q": (si("Angle {}", 2, "q°"),), "tau": (si("Torque {}", 2, "tau"),)}
    return Answer("panel.csv", {"Time": "s"}, right=right)


@layout(SIX, rate=500.0)
def structured_npy(folder: Path, run: Run) -> Answer:
    """numpy.save of a structured array: t, q1 … q6, m1 … m6 as fields."""
    fields = ["t", *names("q{}", 6), *names("m{}", 6)]
    records = np.zeros(len(run.t), [(name, "f8") for name in fields])
    for name, v in zip(fields, np.column_stack([run.t, run.q, run.tau]).T, strict=True):
        records[name] = v
    np.save(folder / "run.npy", records)
    return Answer(
        "run.npy", {"t": "s"}, right={"q": (si("q{}", 6, "q"),), "tau": (si("m{}", 6, "tau"),)}
    )


@layout(FOUR, rate=100.0)
def kilogram_force(folder: Path, run: Run) -> Answer:
    """Write a hobby servo's bench: degrees and kgf·cm."""
    specs = "ms=ms; *servo{}_deg=q°; *servo{}_load (kgf·cm)=kg:tau:kgf cm"
    return recorded(folder, run, "servo.csv", {"ms": "ms"}, specs, data={"kg": run.tau * 10.197})


@layout(SIX, rate=200.0)
def minutes(folder: Path, run: Run) -> Answer:
    """Write a slow plant's historian: time in decimal minutes, so named."""
    more = {"now": run.t / 60}
    specs = "Time (min)=now; *Axis {} Position (deg)=q°; *Axis {} Torque (Nm)=tau"
    return recorded(folder, run, "hist.csv", {"Time (min)": "min"}, specs, data=more)


@layout(LIFT, rate=100.0)
def lift_without_units(folder: Path, run: Run) -> Answer:
    """Write an arm on a lift: the lift in cm, the joints in rad, nothing named."""
    more = {"mixed": run.q * np.array([100.0, 1, 1, 1])}
    return recorded(folder, run, "lift.csv", {"t": "s"}, (
        "t=t; *{}_position=mixed:q:?; *{}_effort=tau"
    ), run.arm.joints,
                    known=False, data=more)  # fmt: skip


@layout(SIX, rate=100.0)
def velocities_in_another_order(folder: Path, run: Run) -> Answer:
    """Write a driver's bug: velocities 2 and 3 stand under each other's names; nothing else is
    wrong.
    """
    more = {"bug": run.dq[:, [0, 2, 1, 3, 4, 5]]}
    specs = "stamp=t; *joint{}_pos_rad=q; joint{}_vel_rad_s=bug; *joint{}_tau_Nm=tau"
    return recorded(folder, run, "bug.csv", {"stamp": "s"}, specs, data=more)


@layout(SIX, rate=1000.0)
def torque_from_a_slower_bus(folder: Path, run: Run) -> Answer:
    """Torque sensors at 100 Hz in a log at 1 kHz: each measured value stands ten times."""
    held = np.repeat(run.tau[::10], 10, axis=0)[: len(run.t)]
    columns, right = wide(run, "t=t; *q{}=q; *tau{}=held:tau", held=held)
    table(folder / "slow.csv", columns)
    right["tau"] = (Signal(right["tau"][0].columns, right["tau"][0].units, held),)
    return Answer("slow.csv", {"t": "s"}, right=right, torque=("measured",))


@layout(SIX, rate=250.0)
def pose_of_six_numbers(folder: Path, run: Run) -> Answer:
    """X, Y, Z, A, B, C of the flange and drive torques; the joints' positions were not recorded."""
    specs = (
        "Time [s]=t; X [mm]=x; Y [mm]=y; Z [mm]=z; A [deg]=a; B [deg]=a; C [deg]=a; *Torque A{} "
        "[Nm]=tau"
    )
    return recorded(
        folder, run, "pose.csv", {"Time [s]": "s"}, specs, known=False, data={"a": 30 * run.q[:, 0]}
    )


@layout(THREE, rate=250.0)
def orientation_of_three_numbers(folder: Path, run: Run) -> Answer:
    """Three Euler angles A, B, C in deg beside three torques of an arm with three joints."""
    specs = "Time [s]=t; A [deg]=a; B [deg]=b; C [deg]=a; *M{} [Nm]=tau"
    more = {"a": 30 * np.sin(run.q[:, 0]), "b": 10 * run.q[:, 1]}
    return recorded(folder, run, "euler.csv", {"Time [s]": "s"}, specs, known=False, data=more)


@layout(SIX, rate=125.0)
def setpoint_chinese_alone(folder: Path, run: Run) -> Answer:
    """Write a Chinese log with the 给定 (set) angle and the 前馈 (feedforward) torque alone."""
    specs = "时间(s)=t; *给定角度{}(度)=q_ref°; 前馈力矩{}(牛米)=model"
    more = {"model": run.tau_model}
    return recorded(
        folder, run, "给定.csv", {"时间(s)": "s"}, specs, known=False, data=more, encoding="gb18030"
    )


@layout(SIX, rate=125.0)
def korean_log(folder: Path, run: Run) -> Answer:
    """Write a Korean controller's log in CP949: 시간, 목표 각도, 현재 각도, 토크 with units."""
    specs = "시간(ms)=ms; *목표 각도 J{} (deg)=q_ref°; *현재 각도 J{} (deg)=q°; *토크 J{} (Nm)=tau"
    return recorded(
        folder, run, "로그.csv", {"시간(ms)": "ms"}, specs, encoding="cp949", float_format="%.5f"
    )


@layout(SIX, rate=50.0)
def episodes(folder: Path, run: Run) -> Answer:
    """Write a learning set's Parquet of two episodes: the clock starts again; state and action in
    rad.
    """
    half = len(run.t) // 2
    frame = pd.DataFrame(
        {"episode_index": np.repeat([0, 1], half), "timestamp": np.tile(run.t[:half], 2)}
    )
    frame["observation.state"], frame["action"] = (
        list(run.q[: 2 * half]),
        list(run.q_ref[: 2 * half]),
    )
    frame.to_parquet(folder / "train.parquet")
    return Answer(
        "train.parquet",
        {"timestamp": "s"},
        right=anywhere(q=UNITS["q"]),
        texts=False,
        draftable=False,
    )


@layout(SIX, rate=500.0)
def hdf5_group_a_joint_records(folder: Path, run: Run) -> Answer:
    """Write a table of records for each joint: joint_1/data with fields time, actual, target,
    torque; units as attributes.
    """
    kind = np.dtype([("time", "f8"), ("target", "f8"), ("actual", "f8"), ("torque", "f8")])
    with h5py.File(folder / "axes.h5", "w") as file:
        for j in range(6):
            records = np.zeros(len(run.t), kind)
            records["time"], records["torque"] = run.t, run.tau[:, j]
            records["target"], records["actual"] = (
                np.degrees(run.q_ref[:, j]),
                np.degrees(run.q[:, j]),
            )
            file[f"joint_{j + 1}/data"] = records
    right = {
        "tau": (si("joint_{}.data.torque", 6, "tau"),),
        "q": (si("joint_{}.data.actual", 6, "q°"),),
    }
    return Answer("axes.h5", {f"joint_{j}.data.time": "s" for j in range(1, 7)}, right=right)


@layout(SIX, rate=100.0)
def currents_called_load(folder: Path, run: Run) -> Answer:
    """Write a cobot's JSON lines: q in deg as "joints", "load" in A; no torque."""
    lines = [
        json.dumps({"ts": 1.7e9 + t, "joints": np.degrees(q).tolist(), "load": amps.tolist()})
        for t, q, amps in zip(run.t, run.q, current(run), strict=True)
    ]
    (folder / "cobot.jsonl").write_text("\n".join(lines) + "\n")
    right = {"q": (si("joints[{}]", 6, "q°", 0),)}
    return Answer("cobot.jsonl", {"ts": "s"}, right=right, draftable=False)


@layout(SIX, rate=250.0)
def rosbag2_database(folder: Path, run: Run) -> Answer:
    """Write a rosbag2 itself (SQLite), no export: a refusal that says so is right."""
    (folder / "bag.db3").write_bytes(b"SQLite format 3\x00" + bytes(range(256)) * 40)
    return Answer("bag.db3", table=False)
