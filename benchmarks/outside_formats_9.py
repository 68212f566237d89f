"""Write twenty-four last recordings, after all mending and before any of them ran."""

from functools import partial
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
from scipy.io import savemat

from benchmarks.outside_formats import (
    FOUR, GEN3, IIWA, LEFT, SCARA, SIX, THREE, TWO, UNITS, UR, current, stamps, state, table, values,
    wide,
)  # fmt: skip
from benchmarks.outside_formats_5 import DATE
from benchmarks.outside_formats_8 import si
from benchmarks.outside_layouts import Answer, Run, Signal, layout

turns, moves = partial(layout, how="turns"), partial(layout, how="points")


@moves(SIX, rate=250.0)
def hyundai_online(folder: Path, run: Run) -> Answer:
    """Hyundai HRpg: encoder values in hex beside joint angles in rad, torque in kgf·cm without a unit."""
    specs = "t=t; *ang_{}=q; cmd_ang_{}=q_ref; load_{}=kgf"
    columns, right = wide(run, specs, kgf=run.tau * 10.197)
    state(right, "cmd_ang_{}", range(1, 7), "q_ref")
    right["tau"] = (Signal(tuple(f"load_{j}" for j in range(1, 7))),)
    columns |= {
        f"enc_{j}": [f"0x{int(x * 1e4) & 0xFFFFFF:06X}" for x in run.q[:, j - 1]] for j in (1, 2)
    }
    table(folder / "hr.csv", columns, float_format="%.6f")
    return Answer("hr.csv", {"t": "s"}, right=right, draftable=False)


@turns(UR, rate=125.0)
def moment_from_model(folder: Path, run: Run) -> Answer:
    """RTDE with target_moment renamed "torque" by a script; currents measured beside it."""
    specs = "time=t; *q_{}=q; *qd_{}=dq; torque_{}=model; *current_{}=current"
    columns, right = wide(run, specs, range(6), model=run.tau_model)
    right["current"] = (Signal(right["current"][0].columns),)
    right["tau"] = right["current"]
    table(folder / "ur.csv", columns, float_format="%.6f")
    return Answer("ur.csv", {"time": "s"}, right=right, draftable=False)


@layout(IIWA, rate=100.0)
def external_only(folder: Path, run: Run) -> Answer:
    """iiwa_stack topics merged: joint position and external joint torque; no measured torque."""
    specs = "%time=ns; field.position.a{}=q; field.torque.a{}=ext"
    columns, _ = wide(run, specs, ns=1712143331250000000 + np.round(run.t * 1e9).astype(np.int64))
    right = {"q": (si("field.position.a{}", 7, "q"),)}
    table(folder / "external_joint_torque.csv", columns, float_format="%.7f")
    return Answer("external_joint_torque.csv", {"%time": "ns"}, right=right, draftable=False)


@moves(SIX, rate=500.0)
def torque_and_torque_target(folder: Path, run: Run) -> Answer:
    """CiA 402 by a tool that converts: "Torque demand" and "Torque actual" in N m, deg, deg/s."""
    specs = "Time[us]=us; *A{}.Position actual[deg]=q°; A{}.Position demand[deg]=q_ref°;"
    specs += (
        "*A{}.Velocity actual[deg/s]=dq°; A{}.Torque demand[Nm]=tau_ref; *A{}.Torque actual[Nm]=tau"
    )
    columns, right = wide(run, specs, joint_wise=True)
    state(right, "A{}.Position demand[deg]", range(1, 7), "q_ref°")
    table(folder / "c402.csv", columns, float_format="%.5f")
    return Answer("c402.csv", {"Time[us]": "us"}, right=right)


@turns(THREE, rate=250.0)
def portuguese(folder: Path, run: Run) -> Answer:
    """Portuguese headers: Tempo, Posição, Velocidade, Torque, Erro de posição with named units."""
    specs = "Tempo (s)=t; Erro de posição {} (graus)=lag; *Posição junta {} (graus)=q°;"
    specs += "*Velocidade junta {} (graus/s)=dq°; *Torque junta {} (N.m)=tau"
    columns, right = wide(run, specs, lag=np.degrees(run.q_ref - run.q))
    table(folder / "ensaio.csv", columns, sep=";", decimal=",", float_format="%.5f")
    return Answer("ensaio.csv", {"Tempo (s)": "s"}, right=right)


@turns(SIX, rate=200.0)
def swapped_joints(folder: Path, run: Run) -> Answer:
    """A wiring fault: the drives of joints 2 and 3 are swapped in the table, nothing says it."""
    swap = [0, 2, 1, 3, 4, 5]
    columns, _ = wide(run, "t=t; q{}=a; tau{}=b", a=run.q[:, swap], b=run.tau[:, swap])
    names = ("q1", "q3", "q2", "q4", "q5", "q6")
    right = {"q": (Signal(names, UNITS["q"]),)}
    right["tau"] = (Signal(tuple(n.replace("q", "tau") for n in names), UNITS["tau"]),)
    table(folder / "swapped.csv", columns, float_format="%.6f")
    return Answer("swapped.csv", {"t": "s"}, right=right, draftable=False)


@moves(SIX, rate=250.0)
def zero_of_the_controller(folder: Path, run: Run) -> Answer:
    """A controller whose zero is the upright arm: joints 2 and 3 differ from the URDF's by 90°."""
    off = np.array([0, 90, -90, 0, 0, 0])
    columns, _ = wide(run, "t=t; J{}_deg=a; trq{}_Nm=tau", a=np.degrees(run.q) + off)
    right = {"tau": (si("trq{}_Nm", 6, "tau"),)}
    table(folder / "upright.csv", columns, float_format="%.5f")
    return Answer("upright.csv", {"t": "s"}, right=right, draftable=False)


@layout(SIX, rate=250.0)
def kilogram_force(folder: Path, run: Run) -> Answer:
    """Torque in kgf·m as its header says, a unit the importer cannot have; angles in deg."""
    columns, right = wide(
        run, "t [ms]=ms; *pos{} [deg]=q°; *trq{} [kgf·m]=kg:tau:?", kg=run.tau / 9.81
    )
    table(folder / "kgf.csv", columns, float_format="%.5f")
    return Answer("kgf.csv", {"t [ms]": "ms"}, right=right, draftable=False)


@moves(FOUR, rate=100.0)
def cycle_counter(folder: Path, run: Run) -> Answer:
    """A servo loop's counter of 10 ms cycles from an arbitrary start, its cycle in no place."""
    columns, right = wide(
        run, "cycle=c; *pos{}=q; *vel{}=dq; *tau{}=tau", c=values(run)["count"] + 8123
    )
    table(folder / "loop.csv", columns, float_format="%.6f")
    return Answer("loop.csv", {"cycle": "sample"}, 100.0, right=right)


@moves(SIX, rate=100.0)
def am_pm(folder: Path, run: Run) -> Answer:
    """A Windows logger with 12-hour times and AM, PM behind them; two columns beside the joints."""
    date = stamps(run, "%m/%d/%Y %I:%M:%S.%f %p")
    columns, right = wide(
        run, "Timestamp=date; *Axis {} Pos (deg)=q°; *Axis {} Torque (Nm)=tau", date=date
    )
    table(folder / "win.csv", columns, float_format="%.5f")
    return Answer("win.csv", {"Timestamp": DATE}, right=right)


@turns(TWO, rate=200.0)
def rows_per_motor(folder: Path, run: Run) -> Answer:
    """CAN answers in turn: a row a motor with id, rad, rad/s, N m at its own time."""
    rows = [(f"{t + 0.0005 * j:.6f}", j + 1, run.q[k, j], run.dq[k, j], run.tau[k, j])
            for k, t in enumerate(run.t) for j in range(2)]  # fmt: skip
    pd.DataFrame(rows, columns=["time", "motor_id", "pos_rad", "vel_rads", "torque_nm"]).to_csv(
        folder / "can.csv", index=False, float_format="%.6f")  # fmt: skip
    right = {role: (Signal((), UNITS[role]),) for role in ("q", "dq", "tau")}
    return Answer("can.csv", {"time": "s"}, texts=False, right=right, draftable=False)


@moves(GEN3, rate=100.0)
def gripper_as_joint(folder: Path, run: Run) -> Answer:
    """Eight positions of which the first is the gripper's: joint_0 opens and closes."""
    columns = {"t": run.t, "joint_0_pos": 0.4 + 0.3 * np.sin(run.t)}
    columns |= {f"joint_{j}_pos": run.q[:, j - 1] for j in range(1, 8)}
    columns |= {"joint_0_torque": 0.1 * np.cos(run.t)}
    columns |= {f"joint_{j}_torque": run.tau[:, j - 1] for j in range(1, 8)}
    table(folder / "eight.csv", columns, float_format="%.6f")
    right = {"q": (si("joint_{}_pos", 7, "q"),), "tau": (si("joint_{}_torque", 7, "tau"),)}
    return Answer("eight.csv", {"t": "s"}, right=right, draftable=False)


@turns(SIX, rate=250.0)
def motor_side_named_joint(folder: Path, run: Run) -> Answer:
    """Joint angles in deg, but "joint torque" is the motor's times no gear: a factor of about 100."""
    columns, right = wide(run, "t [s]=t; *joint{} [deg]=q°; joint{} torque [Nm]=shaft",
                          shaft=run.tau / np.array([121, 121, 101, 51, 51, 51]))  # fmt: skip
    right["tau"] = (Signal(tuple(f"joint{j} torque [Nm]" for j in range(1, 7))),)
    table(folder / "shaft.csv", columns, float_format="%.6f")
    return Answer("shaft.csv", {"t [s]": "s"}, right=right, draftable=False)


@layout(SIX, rate=250.0)
def filtered_and_raw(folder: Path, run: Run) -> Answer:
    """Positions raw and Kalman-filtered, torques raw and low-passed; any of them is the motion."""
    specs = "t=t; *q_raw_{}=q; q_kf_{}=kf; *tau_raw_{}=tau; tau_lp_{}=tau_ref"
    columns, right = wide(run, specs, kf=run.q)
    right["q"] += (si("q_kf_{}", 6, "q"),)
    right["tau"] += (si("tau_lp_{}", 6, "tau", v=run.tau_ref),)
    table(folder / "kf.csv", columns, float_format="%.7f")
    return Answer("kf.csv", {"t": "s"}, right=right)


@moves(SIX, robot=None, rate=250.0)
def load_without_robot(folder: Path, run: Run) -> Answer:
    """No robot beside: angles in deg by header, "Load" a share of the rated torque, no unit."""
    columns, right = wide(run, "ms=ms; *J{}(deg)=q°; Load{}=share:tau:%", share=run.tau / 1.4)
    right["tau"] = (Signal(tuple(f"Load{j}" for j in range(1, 7))),)
    table(folder / "load.csv", columns, float_format="%.4f")
    return Answer("load.csv", {"ms": "ms"}, right=right, draftable=False)


@moves(SIX, robot="robot.toml", rate=250.0)
def speed_in_rpm(folder: Path, run: Run) -> Answer:
    """Joint angles without a unit in deg, joint speeds in r/min by name, torque in N m by name."""
    specs = "t_s=t; *angle{}=q°; *speed{}_rpm=rpm:dq:rpm; *torque{}_Nm=tau"
    columns, right = wide(run, specs, rpm=run.dq * 30 / np.pi)
    table(folder / "rpm.csv", columns, float_format="%.6f")
    return Answer("rpm.csv", {"t_s": "s"}, right=right)


@layout(THREE, rate=250.0)
def hdf5_compound(folder: Path, run: Run) -> Answer:
    """h5py's compound table: one record a sample with t, q[3], tau[3] and a state."""
    kind = [("t", "f8"), ("q", "f8", 3), ("tau", "f4", 3), ("state", "i2")]
    rows = np.zeros(len(run.t), dtype=kind)
    rows["t"], rows["q"], rows["tau"] = run.t, run.q, run.tau
    with h5py.File(folder / "table.h5", "w") as file:
        file["log"] = rows
    right = {"q": (Signal((), UNITS["q"]),), "tau": (Signal((), UNITS["tau"]),)}
    return Answer("table.h5", {"t": "s"}, texts=False, right=right)


@turns(TWO, rate=500.0)
def mat_with_counts(folder: Path, run: Run) -> Answer:
    """A MAT of a lab course: enc (counts), u (V), Ts as a scalar; nothing else."""
    savemat(
        folder / "lab3.mat",
        {"enc": np.round(run.q * 4096 / (2 * np.pi)), "u": run.tau / 5, "Ts": 0.002},
    )
    right = {"q": (Signal(("enc_1", "enc_2"), ("counts",)),), "tau": (Signal(("u_1", "u_2")),)}
    return Answer("lab3.mat", {}, 500.0, right=right, draftable=False)


@moves(LEFT, rate=100.0)
def topic_names_in_front(folder: Path, run: Run) -> Answer:
    """A merged bag: /robot/joint_states/<joint>/position and so on, seconds since 1970."""
    columns: dict = {"time": 1.7121433e9 + run.t}
    for n, name in enumerate(LEFT.joints):
        for part, v in (("position", run.q), ("velocity", run.dq), ("effort", run.tau)):
            columns[f"/robot/joint_states/{name}/{part}"] = v[:, n]
    table(folder / "merged.csv", columns, float_format="%.7f")
    right = {
        role: (Signal(tuple(f"/robot/joint_states/{n}/{part}" for n in LEFT.joints), UNITS[role]),)
        for role, part in (("q", "position"), ("dq", "velocity"), ("tau", "effort"))
    }
    return Answer("merged.csv", {"time": "s"}, right=right)


@layout(SCARA, robot="robot.toml", rate=250.0)
def scara_millimetres_unsaid(folder: Path, run: Run) -> Answer:
    """A SCARA's axes by one word, pos, in deg and mm; forces and torques as shares; s."""
    mixed = np.degrees(run.q)
    mixed[:, 2] = 1000 * run.q[:, 2]
    columns, _ = wide(run, "t=t; pos{}=mixed; load{}=share", mixed=mixed, share=run.tau / 2)
    right = {"q": (Signal(tuple(f"pos{j}" for j in range(1, 5)), ("deg,deg,mm,deg",)),)}
    right["tau"] = (Signal(tuple(f"load{j}" for j in range(1, 5))),)
    table(folder / "scara.csv", columns, float_format="%.5f")
    return Answer("scara.csv", {"t": "s"}, right=right, draftable=False)


@turns(SIX, rate=100.0)
def setpoint_is_all(folder: Path, run: Run) -> Answer:
    """A motion program's log: target angles and actual currents; the actual angles are missing."""
    columns, right = wide(run, "t [s]=t; Target J{} [deg]=q_ref°; *Actual current J{} [A]=current")
    state(right, "Target J{} [deg]", range(1, 7), "q_ref°")
    table(folder / "program.csv", columns, float_format="%.5f")
    return Answer("program.csv", {"t [s]": "s"}, right=right, draftable=False)


@moves(SIX, rate=250.0)
def gear_and_link_encoder(folder: Path, run: Run) -> Answer:
    """Elastic-joint robot: link position q_l, motor position q_m by the gear, spring torque."""
    specs = "t=t; q_m{}=motor; *q_l{}=q; *tau_spring{}=tau"
    columns, right = wide(run, specs, motor=run.q + run.tau / 3000)
    right["q"] += (si("q_m{}", 6, "q", v=run.q + run.tau / 3000),)
    table(folder / "elastic.csv", columns, float_format="%.7f")
    return Answer("elastic.csv", {"t": "s"}, right=right)


@turns(SIX, rate=250.0)
def noise_in_the_clock(folder: Path, run: Run) -> Answer:
    """A PC's clock in ms as text with a comma, jittered by 30 %, German decimal commas."""
    dice = np.random.default_rng(6)
    clock = np.sort(1000 * run.t + dice.uniform(0, 1.2, len(run.t)))
    columns, right = wide(run, "Zeit/ms=clock; *Winkel{}/Grad=q°; *Moment{}/Nm=tau", clock=clock)
    table(folder / "pc.csv", columns, sep=";", decimal=",", float_format="%.5f")
    return Answer("pc.csv", {"Zeit/ms": "ms"}, right=right)


@moves(IIWA, rate=200.0)
def current_per_joint_named_effort(folder: Path, run: Run) -> Answer:
    """A driver that fills effort of JointState with motor currents in A, as some do, unsaid."""
    columns, right = wide(run, "stamp=clock; *position_{}=q; *effort_{}=amps:tau:?",
                          clock=1.7121433e9 + run.t, amps=current(run))  # fmt: skip
    table(folder / "states.csv", columns, float_format="%.6f")
    return Answer("states.csv", {"stamp": "s"}, right=right, draftable=False)
