"""Write motions joint by joint, and others, as forty-two recordings, each with its answer.

The third stranger's: written down before any of it ran, after work on two other sets of his
that are not kept.
"""

import json
from functools import partial
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
from scipy.io import savemat

from benchmarks.import_layouts import (
    UNITS,
    Answer,
    Signal,
    current,
    layout,
    recorded,
    si,
    stamps,
    state,
    table,
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
    SEVEN,
    SIX,
    THREE,
    TWO,
    UR,
    Run,
)

turns = partial(layout, how="turns")
moves = partial(layout, how="points")


@turns(SIX, rate=125.0)
def dobot_feedback(folder: Path, run: Run) -> Answer:
    """Dobot CR port 30004: q_target, qd_target, i_target, m_target, then q_actual, i_actual; m in
    %.
    """
    share = 100 * run.tau / np.array([220, 220, 160, 60, 50, 40])
    specs = "time_stamp=tick; q_target_{}=q_ref°; qd_target_{}=v°; m_target_{}=share;"
    specs += "*q_actual_{}=q°; *qd_actual_{}=dq°; *i_actual_{}=current:A; tool_vector_actual_x=x;"
    specs += "robot_mode=7; load=0.8"
    more = {"tick": values(run)["ms"] + 1712143331250, "v°": np.degrees(run.dq_ref)}
    columns, right = wide(run, specs, share=share, **more)
    state(right, "q_target_{}", range(1, 7), "q_ref°")
    right["dq_ref"] = (si("qd_target_{}", 6, "dq°"),)
    right["current"] = right["tau"] = (Signal(tuple(f"i_actual_{j}" for j in range(1, 7))),)
    table(folder / "dobot.csv", columns, float_format="%.5f")
    return Answer("dobot.csv", {"time_stamp": "ms"}, right=right, draftable=False)


@turns(SEVEN, rate=500.0)
def flexiv_rdk(folder: Path, run: Run) -> Answer:
    """Flexiv RDK states: q, theta, dq, dtheta, tau, tau_des, tau_dot, tau_ext of seven joints."""
    specs = "t=t; *q{}=q; theta{}=theta; *dq{}=dq; dtheta{}=dq; *tau{}=tau; tau_des{}=tau_ref;"
    specs += "tau_dot{}=rate; tau_ext{}=ext; ext_wrench_in_tcp_x=x"
    more = {"theta": run.q + run.tau / 9000, "rate": run.tau_ext * 100}
    return recorded(folder, run, "rdk.csv", {"t": "s"}, specs, data=more, float_format="%.7g")


@moves(SIX, rate=125.0)
def kawasaki_as(folder: Path, run: Run) -> Answer:
    """Kawasaki data storage: JT1 to JT6 in deg, "Cmd value", "Enc value", motor currents in A."""
    specs = "Time [s]=t; JT{} Cmd value [deg]=q_ref°; *JT{} Enc value [deg]=q°;"
    specs += "*JT{} Motor current [A]=current; JT{} Deviation [deg]=lag"
    columns, right = wide(run, specs, lag=np.degrees(run.q_ref - run.q))
    state(right, "JT{} Cmd value [deg]", range(1, 7), "q_ref°")
    right["tau"] = right["current"] = (si("JT{} Motor current [A]", 6, "A"),)
    table(folder / "kawasaki.csv", columns, float_format="%.4f")
    return Answer("kawasaki.csv", {"Time [s]": "s"}, right=right, draftable=False)


@moves(SIX, rate=250.0)
def staubli_english_units_below(folder: Path, run: Run) -> Answer:
    """Stäubli's CS9 recorder: a first line of names, a second of units in brackets, tabs."""
    specs = "Time=t; *JntPosFbk{}=q°; *JntVelFbk{}=dq°; JntPosCmd{}=q_ref°; *JntTrqFbk{}=tau"
    columns, right = wide(run, specs)
    state(right, "JntPosCmd{}", range(1, 7), "q_ref°")
    units = ["[s]", *["[deg]"] * 6, *["[deg/s]"] * 6, *["[deg]"] * 6, *["[Nm]"] * 6]
    text = "\t".join(columns) + "\n" + "\t".join(units) + "\n"
    text += pd.DataFrame(columns).to_csv(index=False, header=False, sep="\t", float_format="%.5f")
    (folder / "cs9.txt").write_text(text)
    return Answer("cs9.txt", {"Time": "s"}, right=right)


@turns(FOUR, rate=100.0)
def robotis_raw(folder: Path, run: Run) -> Answer:
    """ROBOTIS wizard: present position in units of 0..4095, velocity 0.229 rpm, current 2.69 mA."""
    more = {"pos": np.round(2048 + run.q * 4096 / (2 * np.pi)).astype(int)}
    more |= {"vel": np.round(run.dq * 30 / np.pi / 0.229).astype(int)}
    more |= {"amp": np.round(current(run) / 2.69e-3 / 10).astype(int)}
    specs = "Time(ms)=ms; *ID{} Present Position=pos:q:?; *ID{} Present Velocity=vel:dq:?;"
    specs += "*ID{} Present Current=amp:current:?; ID{} Present Temperature=temp"
    columns, right = wide(run, specs, joint_wise=True, **more)
    right["q"] = (Signal(tuple(f"ID{j} Present Position" for j in range(1, 5)), ("counts",)),)
    right["tau"] = right["current"]
    table(folder / "wizard.csv", columns, float_format="%.1f")
    return Answer("wizard.csv", {"Time(ms)": "ms"}, right=right, draftable=False)


@layout(LEFT, rate=100.0)
def intera_recorder(folder: Path, run: Run) -> Answer:
    """Baxter's joint_recorder with velocities and efforts of the left arm by name, right arm
    absent.
    """
    columns: dict = {"time": run.t}
    for part, v in (("", run.q), ("_vel", run.dq), ("_eff", run.tau)):
        columns |= {f"{name}{part}": v[:, j] for j, name in enumerate(LEFT.joints)}
    columns["left_gripper"] = 100 * np.abs(np.sin(run.t))
    table(folder / "rec.csv", columns, float_format="%.6f")
    right = {
        role: (Signal(tuple(f"{n}{part}" for n in LEFT.joints), UNITS[role]),)
        for role, part in (("q", ""), ("dq", "_vel"), ("tau", "_eff"))
    }
    return Answer("rec.csv", {"time": "s"}, right=right)


@moves(GEN3, rate=40.0)
def slow_fieldbus(folder: Path, run: Run) -> Answer:
    """Write a PLC's data log by date and time of day with milliseconds apart in a third column."""
    specs = "Date=date; Time=time; ms=ms; *Axis{}_ActPos_deg=q°; *Axis{}_ActTorque_Nm=tau"
    more = {"date": stamps(run, "%d.%m.%Y"), "time": stamps(run, "%H:%M:%S")}
    more |= {"ms": (values(run)["ms"] + 250) % 1000}
    return recorded(
        folder, run, "plc.csv", {"Time+ms": "s+ms"}, specs, data=more, sep=";", float_format="%.4f"
    )


@turns(UR, rate=125.0)
def polyscope_german(folder: Path, run: Run) -> Answer:
    """Write a German UR log: Basis, Schulter, Ellbogen, Handgelenk 1 to 3 with Winkel and Strom
    each.
    """
    parts = ("Basis", "Schulter", "Ellbogen", "Handgelenk 1", "Handgelenk 2", "Handgelenk 3")
    columns: dict = {"Zeit [s]": run.t}
    amps = current(run)
    for j, name in enumerate(parts):
        columns |= {f"{name} Winkel [°]": np.degrees(run.q[:, j]), f"{name} Strom [A]": amps[:, j]}
        columns[f"{name} Temperatur [°C]"] = run.temperature[:, j]
    table(folder / "ur.csv", columns, sep=";", decimal=",", float_format="%.5f")
    amperes = (Signal(tuple(f"{p} Strom [A]" for p in parts), UNITS["A"]),)
    right = {"q": (Signal(tuple(f"{p} Winkel [°]" for p in parts), UNITS["q°"]),)}
    return Answer("ur.csv", {"Zeit [s]": "s"}, right=right | {"tau": amperes, "current": amperes},
                  draftable=False)  # fmt: skip


@layout(TWO, rate=1000.0)
def adwin_voltages(folder: Path, run: Run) -> Answer:
    """Write an ADwin capture: tachometer and current monitor in volts, encoder in quarter
    increments.
    """
    more = {"inc": np.round(run.q * 8000 / (2 * np.pi)), "tacho": run.dq / 7, "imon": run.tau / 20}
    specs = "n=count; *Enc_{}=inc:q:counts; Tacho_{}_V=tacho; IMon_{}_V=imon"
    columns, _ = wide(run, specs, **more)
    right = {"q": (Signal(("Enc_1", "Enc_2"), ("counts",)),)}
    table(folder / "adwin.dat", columns, sep="\t", float_format="%.5f")
    return Answer("adwin.dat", {"n": "sample"}, right=right, draftable=False)


@moves(THREE, robot="robot.toml", rate=1000.0)
def dewesoft(folder: Path, run: Run) -> Answer:
    """Dewesoft's text export: a preamble, names, units in a row of brackets, torque sensors."""
    columns, right = wide(run, "Time=t; *Torque shaft {}=tau; *Angle {}=q°; Temp {}=temp")
    units = ["(s)", *["(Nm)"] * 3, *["(deg)"] * 3, *["(°C)"] * 3]
    text = (
        "Data file name: rig_007.dxd\nStart time: 3/4/2024 09:11:52.123\nSample rate: 1000 Hz\n\n"
    )
    text += "\t".join(columns) + "\n" + "\t".join(units) + "\n"
    text += pd.DataFrame(columns).to_csv(index=False, header=False, sep="\t", float_format="%.5f")
    (folder / "rig_007.txt").write_text(text)
    return Answer("rig_007.txt", {"Time": "s"}, right=right)


@turns(SIX, robot=None, rate=100.0)
def candump(folder: Path, run: Run) -> Answer:
    """candump of a bus: raw hexadecimal frames, no table of numbers; only a refusal or blanks
    serve.
    """
    lines = []
    for k, t in enumerate(run.t):
        for j in range(6):
            raw = round(run.q[k, j] * 1000) & 0xFFFFFFFF
            lines.append(f"({1712143331.25 + t:.6f}) can0 {0x281 + j:X}#{raw:08X}00000000")
    (folder / "candump.log").write_text("\n".join(lines) + "\n")
    return Answer("candump.log", {"*": "s"}, texts=False, draftable=False)


@moves(PANDA, rate=60.0)
def droid_hdf5(folder: Path, run: Run) -> Answer:
    """DROID trajectories: nested observations and actions, epoch ms as int64, joint torques
    computed.
    """
    tick = 1712143331250 + np.round(run.t * 1000).astype(np.int64)
    with h5py.File(folder / "trajectory.h5", "w") as file:
        file["observation/timestamp/robot_state/read_start"] = tick
        state_ = file.create_group("observation/robot_state")
        state_["joint_positions"], state_["joint_velocities"] = run.q, run.dq
        state_["joint_torques_computed"], state_["motor_torques_measured"] = run.tau_model, run.tau
        state_["cartesian_position"] = run.pose
        file["action/joint_position"], file["action/joint_velocity"] = run.q_ref, run.dq_ref
        file["action/gripper_position"] = np.abs(np.sin(run.t))
    root = "observation.robot_state."
    right = {"q": (si(root + "joint_positions_{}", 7, "q"),)}
    right["dq"] = (si(root + "joint_velocities_{}", 7, "dq"),)
    right["tau"] = (si(root + "motor_torques_measured_{}", 7, "tau"),)
    right["q_ref"] = (si("action.joint_position_{}", 7, "q"),)
    right["dq_ref"] = (si("action.joint_velocity_{}", 7, "dq"),)
    time = {"observation.timestamp.robot_state.read_start": "ms"}
    return Answer("trajectory.h5", time, right=right)


@turns(SIX, rate=250.0)
def percent_speed(folder: Path, run: Run) -> Answer:
    """Write an Estun monitor: pulses of the motor, speed in r/min of the motor, torque in % of
    rated.
    """
    more = {"pls": np.round(run.q * 131072 * 80 / (2 * np.pi)).astype(int)}
    more |= {"rpm": run.dq * 80 * 30 / np.pi, "share": np.round(run.tau / 1.3, 1)}
    specs = "Time(s)=t; *J{} Feedback pulse=pls:q:counts; *J{} Speed(r/min)=rpm:dq:rpm;"
    specs += "*J{} Torque(%)=share:tau:%"
    columns, right = wide(run, specs, joint_wise=True, **more)
    right["q"] = (Signal(right["q"][0].columns, ("counts", "pulse")),)
    right["dq"] = (Signal(right["dq"][0].columns, ("rpm", "r/min")),)
    table(folder / "estun.csv", columns, float_format="%.3f")
    return Answer("estun.csv", {"Time(s)": "s"}, right=right, draftable=False)


@layout(SIX, rate=200.0)
def torque_in_kilonewton(folder: Path, run: Run) -> Answer:
    """Write a heavy robot's log in kN m, angles in mrad, time in µs: odd units, all of them
    named.
    """
    more = {"mrad": 1000 * run.q, "kn": run.tau / 1000}
    return recorded(
        folder,
        run,
        "heavy.csv",
        {"T [µs]": "us"},
        "T [µs]=us; *phi{} [mrad]=mrad:q:mrad; *M{} [kNm]=kn:tau:kNm",
        data=more,
        float_format="%.8f",
    )


@moves(UR, rate=125.0)
def shuffled_by_name(folder: Path, run: Run) -> Answer:
    """Write a dictionary of joints written in random order: quantity by quantity, the order
    differs.
    """
    dice = np.random.default_rng(4)
    columns: dict = {"stamp": 1.7121433e9 + run.t}
    for part, v in (("velocity", run.dq), ("effort", run.tau), ("position", run.q)):
        for j in dice.permutation(6):
            columns[f"{part}/{UR.joints[j]}"] = v[:, j]
    table(folder / "dict.csv", columns, float_format="%.7f")
    right = {
        role: (Signal(tuple(f"{part}/{n}" for n in UR.joints), UNITS[role]),)
        for role, part in (("q", "position"), ("dq", "velocity"), ("tau", "effort"))
    }
    return Answer("dict.csv", {"stamp": "s"}, right=right)


@turns(SIX, rate=250.0)
def reversed_numbers(folder: Path, run: Run) -> Answer:
    """Write a controller that counts from the tip: axis_1 is the last joint; a comment says so."""
    specs = "t=t; *axis_{}_pos=flip:q; *axis_{}_tau=fliptau:tau"
    columns, _ = wide(run, specs, flip=run.q[:, ::-1], fliptau=run.tau[:, ::-1])
    right = {"q": (Signal(tuple(f"axis_{j}_pos" for j in range(6, 0, -1)), UNITS["q"]),)}
    right["tau"] = (Signal(tuple(f"axis_{j}_tau" for j in range(6, 0, -1)), UNITS["tau"]),)
    head = "# axis_1 is the flange, axis_6 the base\n"
    table(folder / "tip_first.csv", columns, head, float_format="%.6f")
    return Answer("tip_first.csv", {"t": "s"}, right=right, draftable=False)


@moves(THREE, rate=500.0)
def sensor_offsets(folder: Path, run: Run) -> Answer:
    """Write a torque sensor's log with raw and tared values; both are measured, the tared one is
    right.
    """
    specs = "t [s]=t; *q{} [rad]=q; tau{}_raw [Nm]=raw; *tau{}_tared [Nm]=tau"
    return recorded(
        folder,
        run,
        "sensors.csv",
        {"t [s]": "s"},
        specs,
        data={"raw": run.tau + np.array([4.1, -7.3, 2.2])},
        float_format="%.6f",
    )


@turns(SIX, rate=200.0)
def gravity_free_torque(folder: Path, run: Run) -> Answer:
    """Write an impedance controller logs tau_J_d as libfranka wants it: without gravity and
    friction.
    """
    part = 0.15 * run.tau_ext + 3 * (run.q_ref - run.q)
    return recorded(
        folder,
        run,
        "impedance.csv",
        {"time": "s"},
        "time=t; *q_{}=q; *dq_{}=dq; tau_J_d_{}=part",
        known=False,
        data={"part": part},
        float_format="%.6f",
    )


@layout(IIWA, rate=200.0)
def two_robots(folder: Path, run: Run) -> Answer:
    """Two equal arms in one file, r1_ and r2_; the robot beside fits both."""
    specs = "t=t; r1_q{}=q; r1_tau{}=tau; r2_q{}=other; r2_tau{}=othertau"
    columns, _ = wide(run, specs, other=run.q[::-1], othertau=run.tau[::-1])
    right = {"q": (si("r1_q{}", 7, "q"), si("r2_q{}", 7, "q", v=run.q[::-1]))}
    right["tau"] = (si("r1_tau{}", 7, "tau"), si("r2_tau{}", 7, "tau", v=run.tau[::-1]))
    table(folder / "pair.csv", columns, float_format="%.6f")
    return Answer("pair.csv", {"t": "s"}, right=right, draftable=False)


@moves(SIX, rate=250.0)
def deviation_first(folder: Path, run: Run) -> Answer:
    """Write a German axis log whose deviation comes before the value: Regelabweichung, Istlage,
    Solllage.
    """
    specs = (
        "Zeit [ms]=ms; Regelabweichung A{} [°]=lag; *Istlage A{} [°]=q°; *Solllage A{} [°]=q_ref°;"
    )
    specs += "*Antriebsmoment A{} [Nm]=tau"
    return recorded(
        folder,
        run,
        "achsen.csv",
        {"Zeit [ms]": "ms"},
        specs,
        data={"lag": np.degrees(run.q_ref - run.q)},
        sep=";",
        decimal=",",
        float_format="%.5f",
    )


@moves(SIX, rate=250.0)
def deviation_alone(folder: Path, run: Run) -> Answer:
    """Only the control deviation and the torque were recorded: no position is there at all."""
    specs = "Zeit [ms]=ms; Regelabweichung A{} [°]=lag; *Moment A{} [Nm]=tau"
    return recorded(
        folder,
        run,
        "nur_abweichung.csv",
        {"Zeit [ms]": "ms"},
        specs,
        known=False,
        data={"lag": np.degrees(run.q_ref - run.q)},
        sep=";",
        decimal=",",
        float_format="%.5f",
    )


@turns(TWO, robot=None, rate=500.0)
def quanser_scope(folder: Path, run: Run) -> Answer:
    """Write a Quanser scope saved by QUARC: one matrix, rows time, theta, theta_dot, Vm without
    names.
    """
    matrix = np.vstack([run.t, run.q.T, run.dq.T, run.tau.T / 8])
    savemat(folder / "scope.mat", {"scope_data": matrix})
    right = {"q": (Signal((), UNITS["q"]),), "dq": (Signal((), UNITS["dq"]),)}
    right["tau"] = (Signal(()),)  # a voltage: what it is is asked
    return Answer("scope.mat", {"*": "s"}, texts=False, right=right, draftable=False)


@layout(SIX, rate=100.0)
def speedgoat_mat73(folder: Path, run: Run) -> Answer:
    """Speedgoat file log as v7.3: Data and Time per signal, joints along the first side, SI."""
    with h5py.File(folder / "filelog.mat", "w", userblock_size=512) as file:
        for name, v in (("q_meas", run.q), ("q_des", run.q_ref), ("tau_meas", run.tau)):
            file[f"logs/{name}/Data"] = v.T
            file[f"logs/{name}/Time"] = run.t[None]
    with (folder / "filelog.mat").open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    right = {"q": (si("logs.q_meas.Data_{}", 6, "q"),)}
    right["q_ref"] = (si("logs.q_des.Data_{}", 6, "q"),)
    right["tau"] = (si("logs.tau_meas.Data_{}", 6, "tau"),)
    time = {f"logs.{name}.Time": "s" for name in ("q_meas", "q_des", "tau_meas")}
    return Answer("filelog.mat", time, right=right)


@turns(FOUR, rate=50.0)
def influx_lines(folder: Path, run: Run) -> Answer:
    """InfluxDB line protocol: tags, fields and ns at the end of a line; one line a joint."""
    lines = []
    for k, t in enumerate(run.t):
        tick = 1712143331250000000 + round(t * 1e9)
        for j in range(4):
            fields = f"pos={run.q[k, j]:.6f},vel={run.dq[k, j]:.6f},trq={run.tau[k, j]:.5f}"
            lines.append(f"arm,joint=joint{j + 1},host=rpi {fields} {tick}")
    (folder / "export.lp").write_text("\n".join(lines) + "\n")
    right = {"q": (Signal((), UNITS["q"]),), "dq": (Signal((), UNITS["dq"]),)}
    right["tau"] = (Signal((), UNITS["tau"]),)
    return Answer("export.lp", {"*": "ns"}, texts=False, right=right)


@moves(SIX, rate=250.0)
def r_and_unused(folder: Path, run: Run) -> Answer:
    """Write an R data frame with quoted names, row numbers and dots: pos.joint.1, effort in Nm by
    name.
    """
    specs = "elapsed.ms=ms; *pos.joint.{}.deg=q°; *trq.joint.{}.Nm=tau; amb.temp=21.5"
    columns, right = wide(run, specs)
    frame = pd.DataFrame(columns)
    frame.index += 1
    text = ",".join(f'"{c}"' for c in columns) + "\n"
    text += frame.to_csv(header=False, float_format="%.5f")
    (folder / "df.csv").write_text(text)
    return Answer("df.csv", {"elapsed.ms": "ms"}, right=right)


@turns(SIX, rate=200.0)
def frame_numbers(folder: Path, run: Run) -> Answer:
    """Write a motion tracker's export: frame and sub-frame, its rate in the preamble, angles in
    deg.
    """
    text = "Devices\n200\n"
    columns, right = wide(run, "Frame=frame; Sub Frame=0; *Joint {} Angle (deg)=q°; "
                          "*Joint {} Torque (N.mm)=nmm:tau:N mm", nmm=1000 * run.tau,
                          frame=np.arange(len(run.t)) + 1)  # fmt: skip
    table(folder / "nexus.csv", columns, text, float_format="%.4f")
    return Answer("nexus.csv", {"Frame": "sample"}, 200.0, right=right)


@moves(SCARA, rate=250.0)
def scara_named_units(folder: Path, run: Run) -> Answer:
    """Write a SCARA with units in the names: J1_deg, J2_deg, Z_mm, R_deg, and forces in N or N
    m.
    """
    mixed = np.degrees(run.q)
    mixed[:, 2] = 1000 * run.q[:, 2]
    heads = ("J1_deg", "J2_deg", "J3_mm", "J4_deg")
    efforts = ("J1_Nm", "J2_Nm", "J3_N", "J4_Nm")
    columns = {"t_s": run.t} | {h: mixed[:, k] for k, h in enumerate(heads)}
    columns |= {h: run.tau[:, k] for k, h in enumerate(efforts)}
    table(folder / "scara.csv", columns, float_format="%.5f")
    right = {"q": (Signal(heads, ("deg,deg,mm,deg",)),)}
    right["tau"] = (Signal(efforts, ("N m,N m,N,N m", "Nm,Nm,N,Nm")),)
    return Answer("scara.csv", {"t_s": "s"}, right=right)


@turns(SIX, rate=125.0)
def igus_rebel(folder: Path, run: Run) -> Answer:
    """igus ReBeL's CRI log: A1 to A6 and E1 to E3 that rest, set points first, currents in mA."""
    specs = "timestamp=ms; *posJointSetPoint_A{}=q_ref°; *posJointCurrent_A{}=q°;"
    specs += "*currentJoint_A{}=ma:current:?; posJointCurrent_E1=0; posJointCurrent_E2=0; eStop=3"
    columns, right = wide(run, specs, ma=1000 * current(run))
    right["tau"] = right["current"]
    table(folder / "cri.csv", columns, float_format="%.3f")
    return Answer("cri.csv", {"timestamp": "ms"}, right=right, draftable=False)


@layout(THREE, rate=250.0)
def chinese_headers(folder: Path, run: Run) -> Answer:
    """Write a Chinese tool: 关节位置 position, 关节速度 speed, 关节力矩 torque, units named."""
    specs = "时间(ms)=ms; 指令位置{}(deg)=q_ref°; *关节位置{}(deg)=q°; *关节速度{}(deg/s)=dq°;"
    specs += "*关节力矩{}(Nm)=tau; 外力矩{}(Nm)=ext"
    columns, right = wide(run, specs)
    right["q_ref"] = (si("指令位置{}(deg)", 3, "q°"),)
    table(folder / "日志.csv", columns, float_format="%.5f")
    return Answer("日志.csv", {"时间(ms)": "ms"}, right=right)


@moves(THREE, rate=250.0)
def chinese_external_alone(folder: Path, run: Run) -> Answer:
    """Write the same tool with the external torque (外力矩) alone: it is no joint torque."""
    return recorded(
        folder,
        run,
        "日志.csv",
        {"时间(ms)": "ms"},
        "时间(ms)=ms; *关节位置{}(deg)=q°; 外力矩{}(Nm)=ext",
        known=False,
        float_format="%.5f",
    )


@turns(SIX, rate=250.0)
def sim_ground_truth(folder: Path, run: Run) -> Answer:
    """Write a simulator with sensor noise: q_true, q_meas, tau_true, tau_meas; both sets are the
    motion.
    """
    specs = "sim_time=t; q_true_{}=q; *q_meas_{}=q; *tau_meas_{}=tau; tau_true_{}=model"
    return recorded(
        folder,
        run,
        "sim.csv",
        {"sim_time": "s"},
        specs,
        data={"model": run.tau_ref},
        float_format="%.7f",
    )


@moves(SIX, rate=200.0)
def normalised(folder: Path, run: Run) -> Answer:
    """Write a learning data set scaled to -1..1: qpos_norm and torque_norm; no unit can be
    given.
    """
    q = run.q / abs(run.q).max()
    tau = run.tau / abs(run.tau).max(axis=0)
    columns, _ = wide(run, "t=t; qpos_norm_{}=scaled; torque_norm_{}=load", scaled=q, load=tau)
    right = {"q": (Signal(tuple(f"qpos_norm_{j}" for j in range(1, 7))),)}
    right["tau"] = (Signal(tuple(f"torque_norm_{j}" for j in range(1, 7))),)
    table(folder / "norm.csv", columns, float_format="%.6f")
    return Answer("norm.csv", {"t": "s"}, right=right, draftable=False)


@turns(SIX, rate=100.0)
def relative_to_start(folder: Path, run: Run) -> Answer:
    """Incremental encoders zeroed at switch-on: "rel" positions from an unknown start, in deg."""
    specs = "t [s]=t; *q_rel_{} [deg]=rel:q:q°; *tau_{} [Nm]=tau"
    columns, right = wide(run, specs.replace(":q:q°", ":q°"), rel=np.degrees(run.q - run.q[0]))
    right["q"] = (Signal(tuple(f"q_rel_{j} [deg]" for j in range(1, 7)), UNITS["q°"]),)
    table(folder / "rel.csv", columns, float_format="%.5f")
    return Answer("rel.csv", {"t [s]": "s"}, right=right, draftable=False)


@moves(UR, rate=500.0)
def ur_speed_scaled(folder: Path, run: Run) -> Answer:
    """RTDE with the controller's joint_control_output and momentum beside currents and q."""
    specs = "timestamp=clock; *actual_q_{}=q; *actual_qd_{}=dq; *actual_current_{}=current;"
    specs += "joint_control_output_{}=amps; actual_current_window_{}=w; actual_momentum=x"
    more = {"clock": 4021.002 + run.t, "w": 2 + 0 * run.q}
    columns, right = wide(run, specs, range(6), **more)
    right["current"] = (Signal(right["current"][0].columns),)
    right["tau"] = right["current"]
    table(folder / "rtde.csv", columns, float_format="%.6f")
    return Answer("rtde.csv", {"timestamp": "s"}, right=right, draftable=False)


@turns(SIX, rate=200.0)
def half_hourly_zip(folder: Path, run: Run) -> Answer:
    """Write a gzip of a plain CSV under its own name: a refusal that says so is right."""
    import gzip

    columns, _ = wide(run, "t=t; q{}=q; tau{}=tau")
    text = pd.DataFrame(columns).to_csv(index=False)
    (folder / "log.csv.gz").write_bytes(gzip.compress(text.encode()))
    return Answer("log.csv.gz", table=False)


@moves(SIX, rate=250.0)
def trailing_statistics(folder: Path, run: Run) -> Answer:
    """Write a spreadsheet that ends with rows of minimum, maximum and mean below the samples."""
    columns, right = wide(run, "Time (s)=t; *Pos {} (rad)=q; *Torque {} (Nm)=tau")
    frame = pd.DataFrame(columns)
    text = frame.to_csv(index=False, float_format="%.6f")
    for name in ("min", "max", "mean"):
        row = getattr(frame, name)()
        text += name + "," + ",".join(f"{x:.6f}" for x in row.to_numpy()[1:]) + "\n"
    (folder / "sheet.csv").write_text(text)
    return Answer("sheet.csv", {"Time (s)": "s"}, right=right)


@turns(SIX, rate=250.0)
def thousands_separators(folder: Path, run: Run) -> Answer:
    """Excel's display format: thousands separated by commas in quoted cells, time in ms."""
    columns: dict = {"Time [ms]": [f"{x:,.1f}" for x in 1000 * run.t]}
    for j in range(6):
        columns[f"Angle {j + 1} [mdeg]"] = [f"{x:,.1f}" for x in 1000 * np.degrees(run.q[:, j])]
        columns[f"Torque {j + 1} [Nmm]"] = [f"{x:,.1f}" for x in 1000 * run.tau[:, j]]
    pd.DataFrame(columns).to_csv(folder / "display.csv", index=False)
    right = {"tau": (si("Torque {} [Nmm]", 6, "N mm"),)}
    right["q"] = (Signal(tuple(f"Angle {j} [mdeg]" for j in range(1, 7)), ("mdeg",)),)
    return Answer("display.csv", {"Time [ms]": "ms"}, right=right)


@moves(SIX, rate=250.0)
def sparse_topics(folder: Path, run: Run) -> Answer:
    """PlotJuggler's merged export: two topics of different rates, empty cells where one is
    absent.
    """
    specs = "__time=clock; *arm/pos[{}]=q; *arm/eff[{}]=tau; temp/t[{}]=temp"
    columns, right = wide(run, specs, range(6), clock=1.7121433e9 + run.t)
    frame = pd.DataFrame(columns)
    late = frame.copy()
    late["__time"] += 0.001
    late.iloc[:, 1:13] = np.nan
    frame.iloc[:, 13:] = np.nan
    both = pd.concat([frame, late.iloc[::25]]).sort_values("__time")
    both.to_csv(folder / "merged.csv", index=False, float_format="%.6f")
    return Answer("merged.csv", {"__time": "s"}, right=right)


@turns(SIX, rate=250.0)
def restarted_counter(folder: Path, run: Run) -> Answer:
    """Write a 16-bit millisecond counter that starts again during the run, beside nothing else of
    time.
    """
    tick = (values(run)["ms"] + 60000) % 65536
    return recorded(
        folder,
        run,
        "tick.csv",
        {"tick_ms": "ms"},
        "tick_ms=tick; *q{}_rad=q; *tau{}_Nm=tau",
        data={"tick": tick},
        float_format="%.6f",
    )


@moves(SIX, rate=250.0)
def feedforward_named_torque(folder: Path, run: Run) -> Answer:
    """Write a controller's inverse dynamics as "torque", the drive's answer as "load" in %: no
    torque is measured.
    """
    share = np.round(100 * run.tau / 140, 1)
    columns, right = wide(run, "t=t; *pos{}_deg=q°; invdyn_torque{}_Nm=model; load{}_pct=share",
                          model=run.tau_model, share=share)  # fmt: skip
    right["tau"] = (Signal(tuple(f"load{j}_pct" for j in range(1, 7)), ("%",)),)
    table(folder / "ff.csv", columns, float_format="%.5f")
    return Answer("ff.csv", {"t": "s"}, right=right, draftable=False)


@turns(TWO, rate=500.0)
def json_columns_with_units(folder: Path, run: Run) -> Answer:
    """Write a web tool's JSON: meta, then a list of series with name, unit and values."""
    series = [{"name": "time", "unit": "ms", "values": (1000 * run.t).tolist()}]
    for j in (1, 2):
        angle, torque = np.degrees(run.q[:, j - 1]).tolist(), run.tau[:, j - 1].tolist()
        series.append({"name": f"angle_{j}", "unit": "deg", "values": angle})
        series.append({"name": f"torque_{j}", "unit": "Nm", "values": torque})
    document = {"meta": {"robot": "leg", "version": 3}, "series": series}
    (folder / "web.json").write_text(json.dumps(document))
    right = {"q": (si("angle_{}", 2, "q°"),), "tau": (si("torque_{}", 2, "tau"),)}
    return Answer("web.json", {"time": "ms"}, right=right, texts=False)


@moves(TWO, robot=None, rate=100.0)
def sensorless_pendulum(folder: Path, run: Run) -> Answer:
    """Write a student's pendulum: angle in counts of 0..1023 from a potentiometer, PWM of
    -255..255.
    """
    more = {"pot": np.round(512 + run.q * 1024 / (1.5 * np.pi)), "pwm": np.round(run.tau)}
    columns, _ = wide(run, "millis=ms; *pot{}=pot:q:?; pwm{}=pwm", **more)
    table(folder / "pendulum.csv", columns, float_format="%.0f")
    right = {"q": (Signal(("pot1", "pot2"), ("counts",)),), "tau": (Signal(("pwm1", "pwm2")),)}
    return Answer("pendulum.csv", {"millis": "ms"}, right=right, draftable=False)
