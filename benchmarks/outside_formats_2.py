"""Write one simulated motion as drives, tools and file formats store it (see outside_formats)."""

import json
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.outside_formats import (
    DEG,
    DEGS,
    FOUR,
    GEN3,
    LEFT,
    NM,
    RAD,
    RADS,
    SCARA,
    SIX,
    THREE,
    TURNS,
    TWO,
    UR,
    block,
    csv,
    names,
)
from benchmarks.outside_layouts import Answer, Run, Signal, layout


@layout(TWO, robot=None)
def odrive_poll(folder: Path, run: Run) -> Answer:
    """ODrive polled from Python: turns and turns/s (ODrive 0.5 documentation), Iq in A, no unit
    in any name."""
    table = {"time": run.t}
    for j in range(2):
        axis = f"axis{j}."
        table |= {
            axis + "encoder.pos_estimate": run.q[:, j] / (2 * np.pi),
            axis + "encoder.vel_estimate": run.dq[:, j] / (2 * np.pi),
            axis + "controller.pos_setpoint": run.q_ref[:, j] / (2 * np.pi),
            axis + "motor.current_control.Iq_measured": run.current[:, j],
            axis + "motor.current_control.Iq_setpoint": run.current[:, j] * 1.01,
            axis + "error": 0,
        }
    csv(folder / "odrive.csv", table)
    right = {
        "q": (Signal(names("axis{}.encoder.pos_estimate", 2, 0), TURNS),),
        "dq": (Signal(names("axis{}.encoder.vel_estimate", 2, 0), ("rev/s", "turns/s")),),
        "q_ref": (Signal(names("axis{}.controller.pos_setpoint", 2, 0), TURNS),),
    }
    right["tau"] = right["current"] = (
        Signal(names("axis{}.motor.current_control.Iq_measured", 2, 0), ("A",)),
    )
    return Answer("odrive.csv", {"time": "s"}, right=right, torque=("measured",))


@layout(THREE, robot="robot.toml", rate=100.0)
def moteus_long_table(folder: Path, run: Run) -> Answer:
    """moteus query results appended as they come: one row per servo and cycle; revolutions
    (moteus reference)."""
    n, length = run.n, len(run.t)
    stamp = np.repeat(1.7e9 + run.t, n) + np.tile(0.0007 * np.arange(n), length)
    table = {
        "timestamp": stamp,
        "id": np.tile([1, 2, 3], length),
        "mode": 10,
        "position": run.q.ravel() / (2 * np.pi),
        "velocity": run.dq.ravel() / (2 * np.pi),
        "torque": run.tau.ravel(),
        "q_current": run.current.ravel(),
        "voltage": 24.1,
        "temperature": run.temperature.ravel(),
        "fault": 0,
    }
    csv(folder / "moteus.csv", table)
    right = {"q": (Signal((), TURNS),), "dq": (Signal((), ("rev/s",)),), "tau": (Signal((), NM),)}
    return Answer("moteus.csv", right=right, texts=False)


@layout(FOUR, rate=100.0)
def dynamixel_registers(folder: Path, run: Run) -> Answer:
    """Dynamixel XM430 registers as read: ticks of 1/4096 turn about 2048, 0.229 rpm, 2.69 mA;
    wall-clock text."""
    stamp = pd.to_datetime(1.7147e18 + np.round(run.t * 1e9, -3)).strftime("%Y-%m-%d %H:%M:%S.%f")
    table: dict[str, object] = {"Timestamp": stamp}
    ticks = 2048 + np.round(run.q * 4096 / (2 * np.pi)).astype(int)
    for j in range(4):
        table |= {
            f"ID{j + 1}_Goal_Position": 2048
            + np.round(run.q_ref[:, j] * 4096 / (2 * np.pi)).astype(int),
            f"ID{j + 1}_Present_Position": ticks[:, j],
            f"ID{j + 1}_Present_Velocity": np.round(run.dq[:, j] / 0.02398).astype(int),
            f"ID{j + 1}_Present_Current": np.round(run.current[:, j] * 1000 / 2.69).astype(int),
            f"ID{j + 1}_Present_Temperature": np.round(run.temperature[:, j]).astype(int),
        }
    csv(folder / "dxl.csv", table)
    current = (Signal(names("ID{}_Present_Current", 4)),)
    right = {
        "q": (Signal(names("ID{}_Present_Position", 4), ("counts", "count", "ticks")),),
        "q_ref": (Signal(names("ID{}_Goal_Position", 4), ("counts", "count", "ticks")),),
        "dq": (Signal(names("ID{}_Present_Velocity", 4)),),
        "tau": current,
        "current": current,
    }
    return Answer("dxl.csv", {"Timestamp": "*"}, rate=100.0, right=right, draftable=False)


@layout(FOUR, rate=50.0)
def lerobot_parquet(folder: Path, run: Run) -> Answer:
    """LeRobot data set, data/chunk-000/episode_000000.parquet: lists in observation.state and
    action, degrees."""
    rows = {
        "observation.state": list(np.degrees(run.q).astype(np.float32)),
        "action": list(np.degrees(run.q_ref).astype(np.float32)),
        "timestamp": run.t.astype(np.float32),
        "frame_index": np.arange(len(run.t)),
        "episode_index": 0,
        "index": np.arange(len(run.t)),
        "task_index": 0,
    }
    pd.DataFrame(rows).to_parquet(folder / "episode_000000.parquet")
    right = {"q": (Signal((), DEG),), "q_ref": (Signal((), DEG),)}
    return Answer("episode_000000.parquet", right=right, texts=False, draftable=False)


@layout(UR)
def json_lines(folder: Path, run: Run) -> Answer:
    """One JSON object a line from a control loop: nested joints, a text mode, Unix time in ms."""
    with (folder / "run.jsonl").open("w") as lines:
        for k, t in enumerate(run.t):
            joints = {
                "q": run.q[k].tolist(),
                "dq": run.dq[k].tolist(),
                "tau": run.tau[k].tolist(),
                "temp": run.temperature[k].tolist(),
            }
            lines.write(
                json.dumps(
                    {
                        "ts_ms": 1_700_000_000_000 + round(t * 1000),
                        "mode": "servo",
                        "joints": joints,
                    }
                )
                + "\n"
            )
    right = {"q": (Signal((), RAD),), "dq": (Signal((), RADS),), "tau": (Signal((), NM),)}
    return Answer("run.jsonl", right=right, texts=False)


@layout(UR)
def mujoco_json(folder: Path, run: Run) -> Answer:
    """MuJoCo roll-out dumped as JSON: qpos, qvel, ctrl (position targets), qfrc_actuator; dt in
    the metadata, no clock."""
    data = {"qpos": run.q, "qvel": run.dq, "ctrl": run.q_ref, "qfrc_actuator": run.tau}
    text = {
        "meta": {"model": "ur5e.xml", "dt": 0.005, "seed": 3},
        "data": {k: v.tolist() for k, v in data.items()},
    }
    (folder / "rollout.json").write_text(json.dumps(text))
    right = {
        "q": (Signal((), RAD),),
        "dq": (Signal((), RADS),),
        "q_ref": (Signal((), RAD),),
        "tau": (Signal((), NM),),
    }
    return Answer("rollout.json", rate=200.0, right=right, texts=False)


@layout(THREE, robot="robot.toml")
def numpy_npz(folder: Path, run: Run) -> Answer:
    """NumPy archive of a Python controller: np.savez_compressed(time, joint_positions, ...), the
    tip beside."""
    np.savez_compressed(
        folder / "run.npz",
        time=run.t,
        joint_positions=run.q,
        joint_velocities=run.dq,
        joint_torques=run.tau,
        desired_positions=run.q_ref,
        ee_pos=run.pose[:, :3],
    )
    right = {
        "q": (Signal((), RAD),),
        "dq": (Signal((), RADS),),
        "q_ref": (Signal((), RAD),),
        "tau": (Signal((), NM),),
    }
    return Answer("run.npz", rate=200.0, right=right, texts=False)


@layout(GEN3, rate=100.0)
def sarcos_headerless(folder: Path, run: Run) -> Answer:
    """SARCOS inverse-dynamics data as text (gaussianprocess.org): 28 columns without header or
    clock, in order."""
    csv(
        folder / "sarcos_inv.csv",
        dict(enumerate(np.hstack([run.q, run.dq, run.ddq, run.tau]).T)),
        header=False,
    )

    def columns(first: int) -> tuple[str, ...]:
        return names("column_{}", 7, first)

    right = {
        "q": (Signal(columns(1), RAD),),
        "dq": (Signal(columns(8), RADS),),
        "ddq": (Signal(columns(15), ("rad/s^2",)),),
        "tau": (Signal(columns(22), NM),),
    }
    return Answer("sarcos_inv.csv", rate=100.0, right=right)


@layout(LEFT, rate=100.0)
def baxter_recorder(folder: Path, run: Run) -> Answer:
    """Baxter joint_recorder: positions of both arms and grippers (0 to 100); efforts would be in
    another file."""
    rng = np.random.default_rng(1)
    table = {"time": run.t + 0.0132} | {j: run.q[:, k] for k, j in enumerate(run.arm.joints)}
    table["left_gripper"] = 100.0
    table |= {
        j.replace("left", "right"): 0.1 * k + 4e-4 * rng.normal(size=len(run.t))
        for k, j in enumerate(run.arm.joints)
    }
    table["right_gripper"] = 3.7
    csv(folder / "positions.csv", table)
    return Answer("positions.csv", {"time": "s"}, right={"q": (Signal(run.arm.joints, RAD),)})


@layout(GEN3, rate=100.0)
def kinova_cyclic(folder: Path, run: Run) -> Answer:
    """Kinova Gen3 BaseCyclic feedback, one actuator after the other from the tip to the base:
    degrees in 0..360, us."""
    table: dict[str, object] = {
        "timestamp_us": np.round(run.t * 1e6).astype(np.int64) + 1_234_567,
        "frame_id": np.arange(len(run.t)) % 65536,
    }
    for j in reversed(range(7)):
        name = f"actuator_{j + 1}."
        table |= {
            name + "position": np.degrees(run.q[:, j]) % 360,
            name + "velocity": np.degrees(run.dq[:, j]),
            name + "torque": run.tau[:, j],
            name + "current_motor": run.current[:, j],
            name + "voltage": 23.9,
            name + "temperature_motor": run.temperature[:, j],
        }
    csv(folder / "feedback.csv", table)
    right = {
        "q": (Signal(names("actuator_{}.position", 7), DEG),),
        "dq": (Signal(names("actuator_{}.velocity", 7), DEGS),),
        "tau": (Signal(names("actuator_{}.torque", 7), NM),),
        "current": (Signal(names("actuator_{}.current_motor", 7), ("A",)),),
    }
    return Answer("feedback.csv", {"timestamp_us": "us"}, right=right)


@layout(THREE, robot="robot.toml")
def merged_header(folder: Path, run: Run) -> Answer:
    """A spreadsheet saved as CSV: joint names over merged cells, the same three names below
    each, units, semicolons."""
    head = ["", "waist", "", "", "shoulder", "", "", "elbow", "", ""]
    rows = [
        ";".join(head),
        ";".join(["Time"] + ["Angle", "Speed", "Torque"] * 3),
        ";".join(["[s]"] + ["[deg]", "[deg/s]", "[Nm]"] * 3),
    ]
    values = np.column_stack(
        [run.t]
        + [
            c
            for j in range(3)
            for c in (np.degrees(run.q[:, j]), np.degrees(run.dq[:, j]), run.tau[:, j])
        ]
    )
    rows += [";".join(f"{x:.5f}".replace(".", ",") for x in row) for row in values]
    (folder / "sheet.csv").write_text("\ufeff" + "\r\n".join(rows) + "\r\n", encoding="utf-8")
    right = {"q": (Signal((), DEG),), "dq": (Signal((), DEGS),), "tau": (Signal((), NM),)}
    return Answer("sheet.csv", right=right, texts=False)


@layout(SIX)
def fanuc_export(folder: Path, run: Run) -> Answer:
    """Teach-pendant diagnosis table: line numbers, actual beside command, disturbance torque and
    current, commas at the end."""
    d = np.degrees
    table: dict[str, object] = {
        "Line": np.arange(1, len(run.t) + 1),
        "Time(ms)": np.round(run.t * 1000).astype(int),
    }
    table |= (
        block("J{} Cmd(deg)", d(run.q_ref))
        | block("J{}(deg)", d(run.q))
        | block("J{} Disturb Torque(Nm)", run.tau_ext)
    )
    table |= block("J{} Current(A)", run.current) | block("J{} Temp(C)", run.temperature)
    lines = pd.DataFrame(table).to_csv(index=False, float_format="%.4f").replace("\n", ",\r\n")
    (folder / "diag.csv").write_text("\ufeff" + lines, encoding="utf-8", newline="")
    right = {
        "q": (Signal(names("J{}(deg)", 6), DEG),),
        "q_ref": (Signal(names("J{} Cmd(deg)", 6), DEG),),
    }
    right["tau"] = right["current"] = (Signal(names("J{} Current(A)", 6), ("A",)),)
    return Answer("diag.csv", {"Time(ms)": "ms"}, right=right, torque=("measured",))


@layout(SCARA, robot="robot.toml")
def scara_percent(folder: Path, run: Run) -> Answer:
    """SCARA controller log (Denso, Epson): J3 in mm among degrees, load in percent of the rated
    torque."""
    scale = np.array([180 / np.pi, 180 / np.pi, 1000.0, 180 / np.pi])
    table: dict[str, object] = {"Elapsed[ms]": np.round(run.t * 1000).astype(int)}
    units = ("deg", "deg", "mm", "deg")
    table |= {f"J{j + 1}[{u}]": run.q[:, j] * scale[j] for j, u in enumerate(units)}
    table |= {f"J{j + 1}Cmd[{u}]": run.q_ref[:, j] * scale[j] for j, u in enumerate(units)}
    table |= block("Load{}[%]", 100 * run.tau / np.array(run.arm.effort)) | {
        "Override": 50,
        "Tool": 0,
    }
    csv(folder / "ctrl.csv", table)
    right = {
        "q": (Signal(tuple(f"J{j + 1}[{u}]" for j, u in enumerate(units)), (",".join(units),)),),
        "q_ref": (
            Signal(tuple(f"J{j + 1}Cmd[{u}]" for j, u in enumerate(units)), (",".join(units),)),
        ),
        "tau": (Signal(names("Load{}[%]", 4), ("%",)),),
    }
    return Answer("ctrl.csv", {"Elapsed[ms]": "ms"}, right=right, draftable=False)


@layout(UR, rate=50.0)
def isaac_many_environments(folder: Path, run: Run) -> Answer:
    """Isaac Lab log of four environments in one table: the rows of env_id 0 to 3 follow each
    other every step."""
    envs = 4
    shift = [np.roll(np.arange(len(run.t)), 37 * e) for e in range(envs)]
    table: dict[str, object] = {
        "step": np.repeat(np.arange(len(run.t)), envs),
        "env_id": np.tile(np.arange(envs), len(run.t)),
        "time": np.repeat(run.t, envs),
    }
    for name, v in (
        ("joint_pos", run.q),
        ("joint_vel", run.dq),
        ("applied_torque", run.tau),
        ("computed_torque", run.tau_ref),
    ):
        stacked = np.stack([v[s] for s in shift], axis=1).reshape(-1, 6)
        table |= {f"{name}/{joint}": stacked[:, j] for j, joint in enumerate(run.arm.joints)}
    csv(folder / "play.csv", table)
    return Answer("play.csv", texts=False, draftable=False)


@layout(SIX, rate=100.0)
def unitree_low_state(folder: Path, run: Run) -> Answer:
    """Unitree LowState of two arms: motor_state[0..11] with q, dq, ddq (zero), tau_est,
    temperature; which six, none can say."""
    other = np.roll(run.q, 300, axis=0), np.roll(run.dq, 300, axis=0), np.roll(run.tau, 300, axis=0)
    q, dq, tau = (np.hstack([o, v]) for o, v in zip(other, (run.q, run.dq, run.tau), strict=True))
    table: dict[str, object] = {"tick_ms": np.round(run.t * 1000).astype(int) + 88_000}
    for k in range(12):
        name = f"motor_state[{k}]."
        table |= {
            name + "mode": 1,
            name + "q": q[:, k],
            name + "dq": dq[:, k],
            name + "ddq": 0.0,
            name + "tau_est": tau[:, k],
            name + "temperature": 35 + k,
            name + "lost": 0,
        }
    csv(folder / "lowstate.csv", table)
    right = {
        k: (Signal(names(f"motor_state[{{}}].{f}", 6, 6), u),)
        for k, f, u in (("q", "q", RAD), ("dq", "dq", RADS), ("tau", "tau_est", NM))
    }
    return Answer("lowstate.csv", {"tick_ms": "ms"}, right=right)


@layout(UR)
def ros2_echo_csv(folder: Path, run: Run) -> Answer:
    """ROS 2 `ros2 topic echo --csv /joint_states`: no header; sec, nanosec, frame, then names,
    positions, velocities, efforts."""
    order = [2, 1, 0, 3, 4, 5]
    ns = (1.69e18 + run.t * 1e9).astype(np.int64)
    cells = [ns // 10**9, ns % 10**9, np.full(len(ns), "base_link")]
    cells += [np.full(len(ns), run.arm.joints[j]) for j in order]
    cells += [v[:, j] for v in (run.q, run.dq, run.tau) for j in order]
    csv(folder / "js.csv", dict(enumerate(cells)), header=False)
    right = {
        k: (Signal(tuple(f"column_{first + order.index(j)}" for j in range(6)), u),)
        for k, first, u in (("q", 10, RAD), ("dq", 16, RADS), ("tau", 22, NM))
    }
    return Answer("js.csv", {"column_1+column_2": "s+ns"}, right=right)


@layout(UR, rate=100.0)
def controller_state(folder: Path, run: Run) -> Answer:
    """ROS 2 joint_trajectory_controller state, flattened: reference, feedback, error, output;
    two gaps of half a second."""
    kept = np.ones(len(run.t), bool)
    kept[300:350] = kept[800:850] = False
    ns = (1.69e18 + run.t * 1e9).astype(np.int64)
    table: dict[str, object] = {
        "header.stamp.sec": ns // 10**9,
        "header.stamp.nanosec": ns % 10**9,
        "header.frame_id": "",
    }
    table |= {f"joint_names[{j}]": name for j, name in enumerate(run.arm.joints)}
    for name, v in (
        ("reference.positions", run.q_ref),
        ("reference.velocities", run.dq_ref),
        ("feedback.positions", run.q),
        ("feedback.velocities", run.dq),
        ("error.positions", run.q_ref - run.q),
        ("error.velocities", run.dq_ref - run.dq),
        ("output.effort", run.tau_ref),
    ):
        table |= block(f"{name}[{{}}]", v, 0)
    pd.DataFrame(table)[kept].to_csv(folder / "state.csv", index=False)
    right = {
        k: (Signal(names(f + "[{}]", 6, 0), u),)
        for k, f, u in (
            ("q", "feedback.positions", RAD),
            ("dq", "feedback.velocities", RADS),
            ("q_ref", "reference.positions", RAD),
            ("dq_ref", "reference.velocities", RADS),
        )
    }
    right["tau"] = (Signal(names("output.effort[{}]", 6, 0), NM, run.tau_ref),)
    return Answer("state.csv", {"header.stamp.sec+header.stamp.nanosec": "s+ns"}, right=right)


@layout(TWO, robot=None, rate=50.0)
def arduino_bridge(folder: Path, run: Run) -> Answer:
    """Arduino telemetry with two clocks (PC seconds, board milliseconds) and efforts u
    normalised to -1..1: no unit."""
    rng = np.random.default_rng(2)
    table = {
        "pc_time_s": 1.7e9 + run.t + 0.004 * rng.random(len(run.t)),
        "arduino_ms": np.round(run.t * 1000).astype(int) + 512,
    }
    table |= (
        block("q{}", run.q)
        | block("q{}_ref", run.q_ref)
        | block("u{}", run.tau / abs(run.tau).max(axis=0))
    )
    csv(folder / "log.csv", table)
    right = {
        "q": (Signal(("q1", "q2"), RAD),),
        "q_ref": (Signal(("q1_ref", "q2_ref"), RAD),),
        "tau": (Signal(("u1", "u2")),),
    }
    return Answer("log.csv", {"pc_time_s": "s", "arduino_ms": "ms"}, right=right, draftable=False)
