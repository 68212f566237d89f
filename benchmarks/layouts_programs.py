"""Write one simulated motion as drives, tools and file formats store it (see import_layouts)."""

import json
from pathlib import Path

import h5py
import numpy as np
import pandas as pd

from benchmarks.import_layouts import (
    DEG,
    DEGS,
    NM,
    RAD,
    RADS,
    TURNS,
    UNITS,
    Answer,
    Signal,
    anywhere,
    block,
    csv,
    layout,
    names,
    recorded,
    values,
    wide,
)
from benchmarks.recorded_arm import (
    FOUR,
    GEN3,
    IIWA,
    LEFT,
    PANDA,
    SCARA,
    SIX,
    SO100,
    THREE,
    TWO,
    UR,
    Run,
)


@layout(TWO, robot=None)
def odrive_poll(folder: Path, run: Run) -> Answer:
    """ODrive polled from Python: turns and turns/s (ODrive 0.5), Iq in A, no unit in any name."""
    turn, amps = 2 * np.pi, run.current
    more = {"rev": run.q / turn, "rev/s": run.dq / turn, "goal": run.q_ref / turn}
    specs = "axis{}.encoder.pos_estimate=rev; axis{}.encoder.vel_estimate=rev/s; "
    specs += (
        "axis{}.controller.pos_setpoint=goal; "
        "*axis{}.motor.current_control.Iq_measured=amps:current; "
    )
    specs += "axis{}.motor.current_control.Iq_setpoint=wanted; axis{}.error=0"
    columns, right = wide(run, specs, range(2), joint_wise=True, wanted=amps * 1.01, **more)
    csv(folder / "odrive.csv", {"time": run.t} | columns)
    right["q"] = (Signal(names("axis{}.encoder.pos_estimate", 2, 0), TURNS),)
    right["dq"] = (Signal(names("axis{}.encoder.vel_estimate", 2, 0), ("rev/s", "turns/s")),)
    right["q_ref"] = (Signal(names("axis{}.controller.pos_setpoint", 2, 0), TURNS),)
    return Answer("odrive.csv", {"time": "s"}, right=right, torque=("measured",))


@layout(THREE, robot="robot.toml", rate=100.0)
def moteus_long_table(folder: Path, run: Run) -> Answer:
    """moteus query results as they come: one row per servo and cycle; revolutions (reference)."""
    n, length, turn = run.n, len(run.t), 2 * np.pi
    stamp = np.repeat(1.7e9 + run.t, n) + np.tile(0.0007 * np.arange(n), length)
    table = {"timestamp": stamp, "id": np.tile([1, 2, 3], length), "mode": 10}
    table |= {"position": run.q.ravel() / turn, "velocity": run.dq.ravel() / turn}
    table |= {"torque": run.tau.ravel(), "q_current": run.current.ravel(), "voltage": 24.1}
    csv(folder / "moteus.csv", table | {"temperature": run.temperature.ravel(), "fault": 0})
    right = anywhere(q=TURNS, dq=("rev/s",), tau=NM)
    return Answer("moteus.csv", right=right, texts=False)


@layout(FOUR, rate=100.0)
def dynamixel_registers(folder: Path, run: Run) -> Answer:
    """Dynamixel XM430 registers: ticks of 1/4096 turn about 2048, .229 rpm, 2.69 mA; wall clock."""
    stamp = pd.to_datetime(1.7147e18 + np.round(run.t * 1e9, -3)).strftime("%Y-%m-%d %H:%M:%S.%f")

    def whole(x: np.ndarray) -> np.ndarray:
        return np.round(x).astype(int)

    more = {"goal": 2048 + whole(run.q_ref * 4096 / (2 * np.pi)), "heat": whole(run.temperature)}
    more |= {"ticks": 2048 + whole(run.q * 4096 / (2 * np.pi)), "speed": whole(run.dq / 0.02398)}
    specs = "Timestamp=stamp; ID{}_Goal_Position=goal; ID{}_Present_Position=ticks; "
    specs += (
        "*ID{}_Present_Velocity=speed:dq:?; *ID{}_Present_Current=mA:current:?; "
        "ID{}_Present_Temperature=heat"
    )
    more |= {"mA": whole(run.current * 1000 / 2.69)}
    columns, right = wide(run, specs, joint_wise=True, stamp=stamp, **more)
    csv(folder / "dxl.csv", columns)
    for role, name in (("q", "Present"), ("q_ref", "Goal")):
        right[role] = (Signal(names(f"ID{{}}_{name}_Position", 4), ("counts", "count", "ticks")),)
    return Answer("dxl.csv", {"Timestamp": "*"}, rate=100.0, right=right, draftable=False)


@layout(FOUR, rate=50.0)
def lerobot_parquet(folder: Path, run: Run) -> Answer:
    """LeRobot data set, episode_000000.parquet: lists in observation.state and action, degrees."""
    rows: dict = {"observation.state": list(np.degrees(run.q).astype(np.float32))}
    rows |= {"action": list(np.degrees(run.q_ref).astype(np.float32))}
    rows |= {"timestamp": run.t.astype(np.float32), "frame_index": np.arange(len(run.t))}
    rows |= {"episode_index": 0, "index": np.arange(len(run.t)), "task_index": 0}
    pd.DataFrame(rows).to_parquet(folder / "episode_000000.parquet")
    right = anywhere(q=DEG, q_ref=DEG)
    return Answer("episode_000000.parquet", right=right, texts=False, draftable=False)


@layout(UR)
def json_lines(folder: Path, run: Run) -> Answer:
    """One JSON object a line from a control loop: nested joints, a text mode, Unix time in ms."""
    data = {"q": run.q, "dq": run.dq, "tau": run.tau, "temp": run.temperature}
    with (folder / "run.jsonl").open("w") as lines:
        for k, t in enumerate(run.t):
            line = {"ts_ms": 1_700_000_000_000 + round(t * 1000), "mode": "servo"}
            line |= {"joints": {name: v[k].tolist() for name, v in data.items()}}
            lines.write(json.dumps(line) + "\n")
    return Answer("run.jsonl", right=anywhere(q=RAD, dq=RADS, tau=NM), texts=False)


@layout(UR)
def mujoco_json(folder: Path, run: Run) -> Answer:
    """MuJoCo roll-out as JSON: qpos, qvel, ctrl (position targets), qfrc_actuator; dt, no clock."""
    data = {"qpos": run.q, "qvel": run.dq, "ctrl": run.q_ref, "qfrc_actuator": run.tau}
    text = {"meta": {"model": "ur5e.xml", "dt": 0.005, "seed": 3}}
    text |= {"data": {k: v.tolist() for k, v in data.items()}}
    (folder / "rollout.json").write_text(json.dumps(text))
    right = anywhere(q=RAD, dq=RADS, q_ref=RAD, tau=NM)
    return Answer("rollout.json", rate=200.0, right=right, texts=False)


@layout(THREE, robot="robot.toml")
def numpy_npz(folder: Path, run: Run) -> Answer:
    """NumPy archive of a Python controller: np.savez_compressed(time, joint_positions, …), tip."""
    data = {"joint_positions": run.q, "joint_velocities": run.dq, "joint_torques": run.tau}
    data |= {"desired_positions": run.q_ref, "ee_pos": run.pose[:, :3]}
    np.savez_compressed(folder / "run.npz", time=run.t, **data)
    right = anywhere(q=RAD, dq=RADS, q_ref=RAD, tau=NM)
    return Answer("run.npz", rate=200.0, right=right, texts=False)


@layout(GEN3, rate=100.0)
def sarcos_headerless(folder: Path, run: Run) -> Answer:
    """SARCOS inverse-dynamics data (gaussianprocess.org): 28 columns, no header, no clock."""
    numbers = np.hstack([run.q, run.dq, run.ddq, run.tau])
    csv(folder / "sarcos_inv.csv", dict(enumerate(numbers.T)), header=False)
    parts = zip(("q", "dq", "ddq", "tau"), (1, 8, 15, 22), strict=True)
    right = {role: (Signal(names("column_{}", 7, k), UNITS[role]),) for role, k in parts}
    return Answer("sarcos_inv.csv", rate=100.0, right=right)


@layout(LEFT, rate=100.0)
def baxter_recorder(folder: Path, run: Run) -> Answer:
    """Baxter joint_recorder: positions of both arms, grippers (0 to 100); efforts elsewhere."""
    rng = np.random.default_rng(1)
    table, right = wide(
        run, "time=stamp; *{}=q; left_gripper=100.000000", run.arm.joints, stamp=run.t + 0.0132
    )
    for k, joint in enumerate(run.arm.joints):
        other = joint.replace("left", "right")
        table[other] = 0.1 * k + 4e-4 * rng.normal(size=len(run.t))
    csv(folder / "positions.csv", table | {"right_gripper": 3.7})
    return Answer("positions.csv", {"time": "s"}, right=right)


@layout(GEN3, rate=100.0)
def kinova_cyclic(folder: Path, run: Run) -> Answer:
    """Kinova Gen3 BaseCyclic feedback, actuators from the tip to the base: 0..360 deg, us."""
    table: dict = {"timestamp_us": values(run)["us"] + 1_234_567}
    table |= {"frame_id": np.arange(len(run.t)) % 65536}
    specs = "*actuator_{}.position=turned:q°; *actuator_{}.velocity=dq°; *actuator_{}.torque=tau; "
    specs += (
        "actuator_{}.current_motor=amps; actuator_{}.voltage=23.900000; "
        "actuator_{}.temperature_motor=temp"
    )
    columns, right = wide(run, specs, turned=np.degrees(run.q) % 360)
    table |= {n: columns[n] for j in "7654321" for n in columns if n.startswith(f"actuator_{j}.")}
    csv(folder / "feedback.csv", table)
    right["current"] = (Signal(names("actuator_{}.current_motor", 7), ("A",)),)
    return Answer("feedback.csv", {"timestamp_us": "us"}, right=right)


@layout(THREE, robot="robot.toml")
def merged_header(folder: Path, run: Run) -> Answer:
    """Write a spreadsheet as CSV: joints over merged cells, three names below each, units,
    semicolons.
    """
    rows = [";waist;;;shoulder;;;elbow;;", "Time" + ";Angle;Speed;Torque" * 3]
    rows += ["[s]" + ";[deg];[deg/s];[Nm]" * 3]
    triples = np.stack([np.degrees(run.q), np.degrees(run.dq), run.tau], axis=2)
    for row in np.column_stack([run.t, triples.reshape(len(run.t), 9)]):
        rows.append(";".join(f"{x:.5f}".replace(".", ",") for x in row))
    (folder / "sheet.csv").write_text("\ufeff" + "\r\n".join(rows) + "\r\n", encoding="utf-8")
    return Answer("sheet.csv", right=anywhere(q=DEG, dq=DEGS, tau=NM), texts=False)


@layout(SIX)
def fanuc_export(folder: Path, run: Run) -> Answer:
    """Teach-pendant table: line numbers, actual and command, disturbance, current, commas at
    end.
    """
    specs = (
        "Line=line; Time(ms)=ms; *J{} Cmd(deg)=q_ref°; *J{}(deg)=q°; J{} Disturb Torque(Nm)=ext; "
    )
    specs += "*J{} Current(A)=amps:current; J{} Temp(C)=temp"
    columns, right = wide(run, specs, line=np.arange(1, len(run.t) + 1))
    lines = pd.DataFrame(columns).to_csv(index=False, float_format="%.4f").replace("\n", ",\r\n")
    (folder / "diag.csv").write_text("\ufeff" + lines, encoding="utf-8", newline="")
    return Answer("diag.csv", {"Time(ms)": "ms"}, right=right, torque=("measured",))


@layout(SCARA, robot="robot.toml")
def scara_percent(folder: Path, run: Run) -> Answer:
    """SCARA log (Denso, Epson): J3 in mm among degrees, load in percent of the rated torque."""
    units = ("deg", "deg", "mm", "deg")
    scale = np.array([180 / np.pi, 180 / np.pi, 1000.0, 180 / np.pi])
    table: dict = {"Elapsed[ms]": values(run)["ms"]}
    right = {}
    for role, form, v in (("q", "J{}[{}]", run.q), ("q_ref", "J{}Cmd[{}]", run.q_ref)):
        columns = tuple(form.format(j, u) for j, u in enumerate(units, 1))
        table |= dict(zip(columns, (v * scale).T, strict=True))
        right[role] = (Signal(columns, (",".join(units),)),)
    table |= block("Load{}[%]", 100 * run.tau / np.array(run.arm.effort))
    csv(folder / "ctrl.csv", table | {"Override": 50, "Tool": 0})
    right["tau"] = (Signal(names("Load{}[%]", 4), ("%",)),)
    return Answer("ctrl.csv", {"Elapsed[ms]": "ms"}, right=right, draftable=False)


@layout(UR, rate=50.0)
def isaac_many_environments(folder: Path, run: Run) -> Answer:
    """Isaac Lab log of four environments in one table: rows of env_id 0 to 3 in turn."""
    envs, length = 4, len(run.t)
    shift = [np.roll(np.arange(length), 37 * e) for e in range(envs)]
    table: dict = {
        "step": np.repeat(np.arange(length), envs),
        "env_id": np.tile(range(envs), length),
    }
    table["time"] = np.repeat(run.t, envs)
    data = {"joint_pos": run.q, "joint_vel": run.dq}
    for name, v in (data | {"applied_torque": run.tau, "computed_torque": run.tau_ref}).items():
        stacked = np.stack([v[s] for s in shift], axis=1).reshape(-1, 6)
        table |= {f"{name}/{joint}": stacked[:, j] for j, joint in enumerate(run.arm.joints)}
    csv(folder / "play.csv", table)
    return Answer("play.csv", texts=False, draftable=False)


@layout(SIX, rate=100.0)
def unitree_low_state(folder: Path, run: Run) -> Answer:
    """Unitree LowState of two arms, motor_state[0..11], ddq zero; which six, none can say."""
    table: dict = {"tick_ms": values(run)["ms"] + 88_000}
    both = [np.hstack([np.roll(v, 300, axis=0), v]).T for v in (run.q, run.dq, run.tau)]
    for k, (q, dq, tau) in enumerate(zip(*both, strict=True)):
        motor = {"mode": 1, "q": q, "dq": dq, "ddq": 0.0, "tau_est": tau, "temperature": 35 + k}
        table |= {f"motor_state[{k}].{name}": v for name, v in (motor | {"lost": 0}).items()}
    csv(folder / "lowstate.csv", table)
    parts = (("q", "q"), ("dq", "dq"), ("tau", "tau_est"))
    right = {r: (Signal(names(f"motor_state[{{}}].{f}", 6, 6), UNITS[r]),) for r, f in parts}
    return Answer("lowstate.csv", {"tick_ms": "ms"}, right=right)


@layout(UR)
def ros2_echo_csv(folder: Path, run: Run) -> Answer:
    """ROS 2 `ros2 topic echo --csv /joint_states`: no header; sec, nanosec, frame, names,
    values.
    """
    order = [2, 1, 0, 3, 4, 5]
    ns = (1.69e18 + run.t * 1e9).astype(np.int64)
    cells = [ns // 10**9, ns % 10**9, np.full(len(ns), "base_link")]
    cells += [np.full(len(ns), run.arm.joints[j]) for j in order]
    cells += [v[:, j] for v in (run.q, run.dq, run.tau) for j in order]
    csv(folder / "js.csv", dict(enumerate(cells)), header=False)
    at = [order.index(j) for j in range(6)]
    parts = (("q", 10), ("dq", 16), ("tau", 22))
    right = {r: (Signal(tuple(f"column_{k + j}" for j in at), UNITS[r]),) for r, k in parts}
    return Answer("js.csv", {"column_1+column_2": "s+ns"}, right=right)


@layout(UR, rate=100.0)
def controller_state(folder: Path, run: Run) -> Answer:
    """ROS 2 joint_trajectory_controller state, flattened, with two gaps of half a second."""
    kept = np.ones(len(run.t), bool)
    kept[300:350] = kept[800:850] = False
    ns = (1.69e18 + run.t * 1e9).astype(np.int64)
    table: dict = {"header.stamp.sec": ns // 10**9, "header.stamp.nanosec": ns % 10**9}
    table |= {"header.frame_id": ""}
    table |= {f"joint_names[{j}]": name for j, name in enumerate(run.arm.joints)}
    specs = (
        "*reference.positions[{}]=q_ref; *reference.velocities[{}]=dq_ref; "
        "*feedback.positions[{}]=q; "
    )
    specs += "*feedback.velocities[{}]=dq; error.positions[{}]=lag; error.velocities[{}]=slip"
    more = {"lag": run.q_ref - run.q, "slip": run.dq_ref - run.dq}
    columns, right = wide(run, specs, range(6), **more)
    table |= columns | block("output.effort[{}]", run.tau_ref, 0)
    pd.DataFrame(table)[kept].to_csv(folder / "state.csv", index=False)
    right["tau"] = (Signal(names("output.effort[{}]", 6, 0), NM, run.tau_ref),)
    return Answer("state.csv", {"header.stamp.sec+header.stamp.nanosec": "s+ns"}, right=right)


@layout(TWO, robot=None, rate=50.0)
def arduino_bridge(folder: Path, run: Run) -> Answer:
    """Arduino telemetry with two clocks (PC s, board ms) and efforts u of -1..1: no unit."""
    rng = np.random.default_rng(2)
    specs = "pc_time_s=pc; arduino_ms=board; *q{}=q; *q{}_ref=q_ref; *u{}=share:tau:?"
    more = {"pc": 1.7e9 + run.t + 0.004 * rng.random(len(run.t)), "board": values(run)["ms"] + 512}
    return recorded(
        folder,
        run,
        "log.csv",
        {"pc_time_s": "s", "arduino_ms": "ms"},
        specs,
        known=False,
        data={"share": run.tau / abs(run.tau).max(axis=0), **more},
    )


@layout(SIX, robot=None, rate=500.0)
def abb_test_signals(folder: Path, run: Run) -> Answer:
    """ABB Test Signal Viewer: 1718 position, 1717 speed, 4947 torque of the motor side.

    No name says a quantity, and no unit is given: an arm's angle in rad these numbers are not.
    """
    gear = np.array([100.0, -120.0, 110.0, 80.0, 90.0, 60.0])
    specs = (
        "Time=t; *1718 ROB_1 axis {}=angle:q:?; *1717 ROB_1 axis {}=speed:dq:?; *4947 ROB_1 axis "
        "{}=torque:tau:?"
    )
    return recorded(
        folder,
        run,
        "signals.log",
        {"Time": "s"},
        specs,
        known=False,
        data={"angle": run.q * gear, "speed": run.dq * gear, "torque": run.tau / gear},
        sep=";",
    )


@layout(SIX, rate=100.0)
def xarm_report(folder: Path, run: Run) -> Answer:
    """xArm SDK report saved by a script: angles in deg without a unit, currents, no torque."""
    specs = (
        "stamp=stamp; state=1; mode=0; cmdnum=3; *angle_j{}=q°; *speed_j{}=dq°; "
        "*current_j{}=amps:current; "
    )
    specs += "voltage_j{}=24.000000; temp_j{}=temp; err=OK"
    return recorded(folder, run, "report.csv", {"stamp": "s"}, specs, data={"stamp": 1.7e9 + run.t})


@layout(THREE, robot="robot.toml")
def matlab_timetable(folder: Path, run: Run) -> Answer:
    """MATLAB writetimetable: the time is a duration, written as text "0.005 sec"."""
    time = np.array([f"{t:g} sec" for t in run.t])
    columns, right = wide(run, "Time=time; *q{}=q; *qd{}=dq; *tau{}=tau", time=time)
    csv(folder / "timetable.csv", columns)
    return Answer("timetable.csv", {"Time": "s"}, rate=200.0, right=right)


@layout(THREE, robot="robot.toml")
def excel_quoted(folder: Path, run: Run) -> Answer:
    """Excel-minded logger: a line "sep=;", numbers in quotes with decimal commas, German names."""
    specs = "Zeit [s]=t; *Istwinkel {} [°]=q°; *Sollwinkel {} [°]=q_ref°; *Drehmoment {} [Nm]=tau"
    return recorded(
        folder,
        run,
        "messung.csv",
        {"Zeit [s]": "s"},
        specs,
        head="sep=;\r\n",
        sep=";",
        decimal=",",
        quoting=1,
    )


@layout(UR)
def one_file_an_axis(folder: Path, run: Run) -> Answer:
    """Write a file for each of six axes: axis1.csv holds one joint of the six-joint robot."""
    for j in range(6):
        table = {"time": run.t, "pos": run.q[:, j], "vel": run.dq[:, j], "torque": run.tau[:, j]}
        csv(folder / f"axis{j + 1}.csv", table)
    return Answer("axis1.csv", {"time": "s"}, draftable=False)


@layout(THREE, robot="arm.urdf", rate=240.0)
def pybullet_states(folder: Path, run: Run) -> Answer:
    """PyBullet getJointState per step: position, velocity, six reaction forces, applied torque."""
    axes = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
    specs = "step=count; *joint{}_position=q; *joint{}_velocity=dq; "
    specs += "".join(f"joint{{}}_reaction_{axis}={axis}; " for axis in axes)
    forces = {axis: run.tau_model * np.cos(k) + k for k, axis in enumerate(axes)}
    specs += "*joint{}_appliedJointMotorTorque=tau"
    columns, right = wide(run, specs, range(3), joint_wise=True, **forces)
    csv(folder / "states.csv", columns)
    return Answer("states.csv", {"step": "sample"}, rate=240.0, right=right)


@layout(IIWA)
def reversed_joints(folder: Path, run: Run) -> Answer:
    """Write a C++ logger that writes from the flange to the base: a7 … a1, us since power-on."""
    specs = "*a{}_pos_msr=q; *a{}_pos_cmd=q_ref; *a{}_trq_msr=tau; a{}_trq_ext=ext"
    columns, right = wide(run, specs)
    table = {"t_us": values(run)["us"] + 9_000_000}
    table |= {n: columns[n] for j in "7654321" for n in columns if n.startswith(f"a{j}_")}
    csv(folder / "log.txt", table, sep="\t")
    return Answer("log.txt", {"t_us": "us"}, right=right, torque=("measured",))


@layout(THREE, robot=None, rate=500.0)
def canopen_objects(folder: Path, run: Run) -> Answer:
    """CiA 402 objects: 6064h increments, 606Ch increments/s, 6077h per mille of rated torque."""
    scale = 2**20 / (2 * np.pi)
    data = {"goal": run.q_ref * scale, "place": run.q * scale, "speed": run.dq * scale}
    data |= {"load": run.tau / np.array(run.arm.effort) * 1000}
    specs = "timestamp_ns=ns; *Axis{}_0x607A=goal:q_ref:counts; *Axis{}_0x6064=place:q:counts; "
    specs += "*Axis{}_0x606C=speed:dq:counts/s; *Axis{}_0x6077=load:tau:?; Axis{}_0x6041=4663"
    more = {name: np.round(v).astype(int) for name, v in data.items()}
    ns = np.round(run.t * 1e9).astype(np.int64)
    return recorded(
        folder,
        run,
        "bus.csv",
        {"timestamp_ns": "ns"},
        specs,
        joint_wise=True,
        known=False,
        data={"ns": ns, **more},
    )


@layout(PANDA, rate=20.0)
def robomimic_hdf5(folder: Path, run: Run) -> Answer:
    """robomimic demonstrations in HDF5: obs/robot0_joint_pos, actions of the tip, no clock."""
    with h5py.File(folder / "demo.hdf5", "w") as file:
        obs = file.create_group("data/demo_0/obs")
        obs["robot0_joint_pos"], obs["robot0_joint_vel"] = run.q, run.dq
        obs["robot0_eef_pos"] = run.pose[:, :3]
        obs["robot0_gripper_qpos"] = np.full((len(run.t), 2), 0.02)
        file["data/demo_0/actions"] = np.tanh(run.pose[:, [0, 1, 2, 3, 4, 5, 0]])
        file["data/demo_0/rewards"] = np.zeros(len(run.t))
    return Answer("demo.hdf5", rate=20.0, right=anywhere(q=RAD, dq=RADS), texts=False)


@layout(UR, rate=100.0)
def long_table_with_holes(folder: Path, run: Run) -> Answer:
    """Write a database query result: one row a joint, some rows lost, ISO stamps."""
    order = [5, 3, 4, 0, 1, 2]
    stamp = pd.to_datetime(1.71e18 + np.round(np.repeat(run.t, run.n) * 1e9, -3))
    data: dict = {"ts": stamp.strftime("%Y-%m-%dT%H:%M:%S.%fZ")}
    data |= {"joint_name": [run.arm.joints[j] for j in order] * len(run.t)}
    data |= {"position_rad": run.q[:, order].ravel(), "effort_nm": run.tau[:, order].ravel()}
    lost = np.random.default_rng(3).choice(run.q.size, 60, replace=False)
    kept = pd.DataFrame(data).drop(index=lost)
    kept.to_csv(folder / "query.csv", index=False, float_format="%.6f")
    return Answer("query.csv", {"ts": "*"}, texts=False, draftable=False)


@layout(THREE, robot="robot.toml")
def dymola_result(folder: Path, run: Run) -> Answer:
    """Modelica result as CSV: quoted paths, phi, w, a, tau (Modelica.Mechanics.Rotational)."""
    at = "*robot.axis{}."
    specs = f"time=t; {at}phi=q; {at}w=dq; {at}a=ddq; {at}flange_a.tau=tau"
    return recorded(folder, run, "result.csv", {"time": "s"}, specs, joint_wise=True, quoting=2)


@layout(THREE, robot="robot.toml", rate=500.0)
def controldesk_csv(folder: Path, run: Run) -> Answer:
    """dSPACE ControlDesk CSV: a key in the first column (path, unit, trace_values), semicolons."""
    at = "*Model Root/Plant/"
    specs = f"Model Root/Time=t; {at}q_rad[{{}}]=q; {at}qd_rad_s[{{}}]=dq; {at}tau_Nm[{{}}]=tau"
    columns, right = wide(run, specs, range(3))
    head = "name;Recorder 1\ntimestamp;2024-02-07T10:11:12\n" + ";".join(["path", *columns]) + "\n"
    head += ";".join(["unit", "s", *["rad"] * 3, *["rad/s"] * 3, *["Nm"] * 3]) + "\n"
    csv(folder / "rec.csv", {"": "trace_values"} | columns, head, sep=";", header=False)
    return Answer("rec.csv", {"Model Root/Time": "s"}, right=right)


@layout(SIX, robot=None, rate=250.0)
def sinamics_trace(folder: Path, run: Run) -> Answer:
    """Siemens drive trace: parameters by number (r482, r61, r80) a drive, motor side."""
    gear = np.array([121.0, 121.0, 101.0, 80.0, 80.0, 51.0])
    specs = "Time [ms]=time; *Drive_{}.r482[0] Actual encoder value=counts:q:counts; "
    specs += (
        "*Drive_{}.r61 Actual speed [rpm]=rpm:dq:rpm; *Drive_{}.r80 Actual torque [Nm]=torque:tau"
    )
    more = {"counts": np.round(run.q * gear * 1e4), "rpm": run.dq * gear * 30 / np.pi}
    more |= {"torque": run.tau / gear, "time": run.t * 1000}
    return recorded(
        folder,
        run,
        "trace.csv",
        {"Time [ms]": "ms"},
        specs,
        joint_wise=True,
        known=False,
        data=more,
        sep=";",
    )


@layout(UR, rate=125.0)
def webots_sensors(folder: Path, run: Run) -> Answer:
    """Webots controller log: NAME_sensor positions, torque feedback, gripper fingers."""
    specs = "sim_time=stamp; *{}_sensor=q; *{}_torque_feedback=tau"
    table, right = wide(run, specs, run.arm.joints, joint_wise=True, stamp=run.t + 0.032)
    for finger in ("finger_1_joint_1", "finger_2_joint_1"):
        table |= {f"{finger}_sensor": 0.05, f"{finger}_torque_feedback": 0.0}
    csv(folder / "webots.csv", table)
    return Answer("webots.csv", {"sim_time": "s"}, right=right)


@layout(SIX, rate=100.0)
def coppelia_graph(folder: Path, run: Run) -> Answer:
    """CoppeliaSim graph export: "/m0609/joint_1: position (deg)", forces in N*m, time in s."""
    specs = "Time (s)=t; */m0609/{}: position (deg)=q°; */m0609/{}: target position (deg)=q_ref°; "
    return recorded(
        folder,
        run,
        "graph.csv",
        {"Time (s)": "s"},
        specs + "*/m0609/{}: force (N*m)=tau",
        run.arm.joints,
        joint_wise=True,
    )


@layout(SIX, rate=500.0)
def dot_by_letter_p(folder: Path, run: Run) -> Answer:
    """Write a German laboratory's notation: q, qp and qpp for the derivatives ("Punkt")."""
    specs = "t=t; *q{}=q; *qp{}=dq; *qpp{}=ddq; *qsoll{}=q_ref; *tauM{}=tau; tauExt{}=ext"
    return recorded(folder, run, "versuch.dat", {"t": "s"}, specs, sep=" ", float_format="%.8e")


@layout(THREE, robot="robot.toml")
def adams_table(folder: Path, run: Run) -> Answer:
    """MSC Adams result table: quoted names, fixed width, Fortran exponents, degrees, N mm."""
    specs = "Time=t; *.arm.JOINT_{}_ANGLE.Q=q°; *.arm.MOTION_{}.TORQUE.Q=mNm:tau:N mm"
    columns, right = wide(run, specs, mNm=1000 * run.tau)
    text = "Last_Run   Results   2023-11-02\n" + "  ".join(f'"{n}"' for n in columns) + "\n"
    for row in zip(*columns.values(), strict=True):
        text += "".join(f"{x:18.8E}".replace("E", "D") for x in row) + "\n"
    (folder / "adams.tab").write_text(text)
    return Answer("adams.tab", {"Time": "s"}, right=right)


@layout(SIX, rate=100.0)
def two_arms(folder: Path, run: Run) -> Answer:
    """Two arms of one type in a table, left/joint_1 … right/joint_6, and one description."""
    table = {"time": 1.7e9 + run.t}
    data = {"position": run.q, "velocity": run.dq, "effort": run.tau}
    for side, shift in (("left", 200), ("right", 0)):
        for j, joint in enumerate(run.arm.joints):
            table |= {f"{side}/{joint}/{f}": np.roll(v[:, j], shift) for f, v in data.items()}
    csv(folder / "bimanual.csv", table)
    return Answer("bimanual.csv", {"time": "s"}, draftable=False)


@layout(THREE, robot="robot.toml")
def greek_names(folder: Path, run: Run) -> Answer:
    """Write a notebook's data frame with Greek names, written by pandas with its index."""
    specs = "t [s]=t; *φ{} [°]=q°; *φ̇{} [°/s]=dq°; *τ{} [N·m]=tau; ϑ{} [°C]=temp"
    return recorded(folder, run, "greek.csv", {"t [s]": "s"}, specs, index=True)


@layout(SO100, rate=30.0)
def so100_normalised(folder: Path, run: Run) -> Answer:
    """LeRobot SO-100 table: positions normalised to -100..100 of the calibrated range."""
    reach = np.array([1.9, 1.7, 1.6, 1.8, 2.8])
    specs = (
        "timestamp=t; frame_index=count; *observation.{}.pos=state:q:?; "
        "observation.gripper.pos=42.000000; "
    )
    more = {"state": 100 * run.q / reach, "goal": 100 * run.q_ref / reach}
    return recorded(
        folder,
        run,
        "episode.csv",
        {"timestamp": "s"},
        specs + "*action.{}.pos=goal:q_ref:?",
        run.arm.joints,
        known=False,
        data=more,
    )
