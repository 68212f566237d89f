"""Write moves from point to point as forty-one recordings of further makers, each with its answer.

Written down and frozen before the importer was mended after `outside_formats_6`; the form is the
same. `draftable` is False where the file leaves something open.
"""

import json
from functools import partial
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
from scipy.io import savemat

from benchmarks.outside_formats import (
    FOUR,
    GEN3,
    IIWA,
    LEFT,
    PANDA,
    SCARA,
    SIX,
    THREE,
    TWO,
    UNITS,
    UR,
    current,
    stamps,
    state,
    table,
    values,
    wide,
)  # fmt: skip
from benchmarks.outside_formats_5 import DATE, answer
from benchmarks.outside_layouts import Answer, Run, Signal, layout

SEVEN = range(7)
moves = partial(layout, how="points")


@moves(SIX, rate=125.0)
def techman_log(folder: Path, run: Run) -> Answer:
    """Techman TMflow log: date and time in two columns, deg, tool in mm, currents in mA."""
    specs = "Date=date; Time=time; *Joint{}_Angle=q°; Tool_X=x; Tool_Y=y; Tool_Z=z;"
    specs += "*Joint{}_Current(mA)=ma:current:mA; Joint{}_Temp=temp; Speed%=100"
    UNITS["mA"] = ("mA",)
    more = {"date": stamps(run, "%Y/%m/%d"), "time": stamps(run, "%H:%M:%S.%f")}
    columns, right = wide(run, specs, ma=1000 * current(run), **more)
    right["tau"] = (Signal(tuple(f"Joint{j}_Current(mA)" for j in range(1, 7)), ("mA",)),)
    table(folder / "tm_log.csv", columns, float_format="%.4f")
    return Answer("tm_log.csv", {"Time": DATE, "Date+Time": DATE}, right=right, draftable=False)


@moves(SIX, rate=125.0)
def aubo_json(folder: Path, run: Run) -> Answer:
    """Aubo SDK callbacks: JSON lines; six joint objects with current, voltage and three angles."""
    lines = []
    for k, t in enumerate(run.t):
        joints = [
            {"jointCurrentI": run.current[k, j], "jointSpeedMoto": run.dq[k, j] * 101,
             "jointPosJ": run.q[k, j], "jointCurVol": 48.1, "jointCurTemp": run.temperature[k, j],
             "jointTagCurrentI": run.current[k, j] * 1.02, "jointTagPosJ": run.q_ref[k, j]}
            for j in range(6)
        ]  # fmt: skip
        lines.append(json.dumps({"stamp": round(t, 6), "joint_status": joints}))
    (folder / "aubo.jsonl").write_text("\n".join(lines))
    specs = "jointPosJ=q; jointTagPosJ=q_ref; jointCurrentI=current:?"
    found = answer("aubo.jsonl", {"stamp": "s"}, "joint_status[{}].@", range(6), specs, known=False)
    found.right["current"] = found.right["tau"]
    return found


@moves(SIX, rate=250.0)
def jaka_csv(folder: Path, run: Run) -> Answer:
    """JAKA: actual and instruct values, velocity and "instTorque" in the same table, deg, ms."""
    specs = "timestamp(ms)=ms; *joint_actual_position_{}(°)=q°; *instruct_position_{}(°)=q_ref°;"
    specs += "*joint_actual_vel_{}(°/s)=dq°; joint_actual_torque_{}(%)=share;"
    specs += "*joint_torque_sensor_{}(Nm)=tau; tcp_x=x; tcp_y=y; tcp_z=z"
    columns, right = wide(run, specs, share=100 * run.tau / 120)
    table(folder / "jaka.csv", columns, float_format="%.4f")
    return Answer("jaka.csv", {"timestamp(ms)": "ms"}, right=right)


@moves(SIX, rate=100.0)
def load_in_percent(folder: Path, run: Run) -> Answer:
    """A Nachi monitor: "Torque" without a unit is a share of the rated torque in percent."""
    share = np.round(100 * run.tau / np.array([90, 140, 110, 24, 22, 18]), 1)
    columns, right = wide(
        run, "Time[s]=t; *J{} Angle[deg]=q°; *J{} Torque=share:tau:%", share=share
    )
    table(folder / "monitor.csv", columns, float_format="%.4f")
    return Answer("monitor.csv", {"Time[s]": "s"}, right=right, draftable=False)


@moves(SIX, rate=250.0)
def motor_torque_unsaid(folder: Path, run: Run) -> Answer:
    """A drive's trace: position of the joint in deg, torque of the motor's shaft, no word of it."""
    gear = np.array([101, 121, 101, 51, 51, 51])
    columns, right = wide(run, "t=t; *pos{}=q°; *spd{}=dq°; *trq{}=shaft:tau:?",
                          shaft=run.tau / gear)  # fmt: skip
    table(folder / "drives.csv", columns, float_format="%.5f")
    return Answer("drives.csv", {"t": "s"}, right=right, draftable=False)


@moves(SIX, robot=None, rate=250.0)
def rokae_registers(folder: Path, run: Run) -> Answer:
    """Rokae xCore: jointPos_m, jointVel_m, tau_m, tau_ext and commands _c; SI without units."""
    specs = "ts=us; *jointPos_m[{}]=q; *jointVel_m[{}]=dq; *tau_m[{}]=tau; tauExt_inBase[{}]=ext;"
    specs += "*jointPos_c[{}]=q_ref; jointVel_c[{}]=dq_ref; tau_c[{}]=tau_ref"
    columns, right = wide(run, specs, range(6))
    right["dq_ref"] = (Signal(tuple(f"jointVel_c[{j}]" for j in range(6)), UNITS["dq"]),)
    table(folder / "rokae.csv", columns, float_format="%.7f")
    return Answer("rokae.csv", {"ts": "us"}, right=right, draftable=False)


@moves(SIX, rate=500.0)
def unitree_z1(folder: Path, run: Run) -> Answer:
    """Unitree low state: q, dq, ddq, tauEst per motor, seven motors of which one is the gripper."""
    specs = "tick=ms; *motorState[{}].q=q; *motorState[{}].dq=dq; motorState[{}].ddq=ddq;"
    specs += "*motorState[{}].tauEst=tau; motorState[{}].temperature=temp"
    columns, right = wide(run, specs, range(6), joint_wise=True)
    columns |= {f"motorState[6].{part}": 0.1 * run.q[:, 0] ** 2 for part in ("q", "dq", "tauEst")}
    right["ddq"] = (Signal(tuple(f"motorState[{j}].ddq" for j in range(6)), UNITS["ddq"]),)
    table(folder / "z1.csv", columns, float_format="%.6f")
    return Answer("z1.csv", {"tick": "ms"}, right=right)


@moves(SIX, robot=None, rate=200.0)
def piper_can(folder: Path, run: Run) -> Answer:
    """AgileX Piper by CAN: thousandths of a degree as whole numbers, no unit, no torque."""
    more = {"angle": np.round(1000 * np.degrees(run.q)).astype(int), "clock": 1.7121433e9 + run.t}
    columns, right = wide(run, "time_stamp=clock; *joint_{}=angle:q:?; grippers_angle=0", **more)
    table(folder / "piper.csv", columns, float_format="%.6f")
    return Answer("piper.csv", {"time_stamp": "s"}, right=right, draftable=False)


@moves(FOUR, rate=100.0)
def interbotix_percent(folder: Path, run: Run) -> Answer:
    """Interbotix: efforts of joint_states are currents in mA, as its driver publishes them."""
    more = {"clock": 1.7121433e9 + run.t, "ma": 1000 * current(run)}
    specs = "stamp=clock; *position[{}]=q; *velocity[{}]=dq; *effort[{}]=ma:tau:?"
    columns, right = wide(run, specs, range(4), **more)
    table(folder / "joint_states.csv", columns, float_format="%.6f")
    return Answer("joint_states.csv", {"stamp": "s"}, right=right, draftable=False)


@moves(SIX, rate=500.0)
def barrett_btlog(folder: Path, run: Run) -> Answer:
    """Barrett libbarrett real-time log: time, jp_type, jv_type, jt_type without a header."""
    matrix = np.column_stack([run.t, run.q, run.dq, run.tau])
    np.savetxt(folder / "btlog.csv", matrix, "%.7g", ",")
    right = {role: (Signal((), UNITS[role]),) for role in ("q", "dq", "tau")}
    return Answer("btlog.csv", {"column_1": "s"}, right=right, texts=False, draftable=False)


@moves(THREE, robot="robot.toml", rate=250.0)
def siemens_trace(folder: Path, run: Run) -> Answer:
    """An S7-1500T trace: "TO.ActualPosition" in deg, lagging torque estimate, sample count, ms."""
    specs = "Sample=count; Zeit [ms]=clock; *Achse{}.ActualPosition [°]=q°;"
    specs += "*Achse{}.Position [°]=q_ref°; *Achse{}.ActualVelocity [°/s]=dq°;"
    specs += "Achse{}.StatusPositioning.FollowingError [°]=lag; *Achse{}.ActualTorque [Nm]=tau"
    more = {"clock": 1000 * run.t, "lag": np.degrees(run.q_ref - run.q)}
    columns, right = wide(run, specs, **more)
    table(folder / "trace.csv", columns, sep=";", decimal=",", float_format="%.5f")
    return Answer("trace.csv", {"Zeit [ms]": "ms"}, right=right)


@moves(THREE, rate=500.0)
def ctrlx_oscilloscope(folder: Path, run: Run) -> Answer:
    """Rexroth ctrlX oscilloscope: parameters S-0-0051 and so on, positions in deg, % torque."""
    specs = "Time [us]=us; *Axis{}/S-0-0051 Position feedback value 1 [°]=q°;"
    specs += "*Axis{}/S-0-0047 Position command value [°]=q_ref°;"
    specs += "*Axis{}/S-0-0040 Velocity feedback value [rpm]=rpm:dq:rpm;"
    specs += "*Axis{}/S-0-0084 Torque/force feedback value [%]=share:tau:%"
    more = {"rpm": run.dq * 30 / np.pi, "share": np.round(run.tau / 0.9, 1)}
    columns, right = wide(run, specs, **more)
    table(folder / "osc.csv", columns, sep=";", float_format="%.5f")
    return Answer("osc.csv", {"Time [us]": "us"}, right=right, draftable=False)


@moves(SCARA, robot="robot.toml", rate=250.0)
def omron_datatrace(folder: Path, run: Run) -> Answer:
    """Omron Sysmac data trace of a SCARA: Act.Pos in axis units, deg and mm by no word, Act.Trq %."""
    mixed = np.degrees(run.q)
    mixed[:, 2] = 1000 * run.q[:, 2]
    columns = {"Time": run.t} | {f"MC_Axis{j:03}.Act.Pos": mixed[:, j] for j in range(4)}
    columns |= {f"MC_Axis{j:03}.Cmd.Pos": mixed[:, j] + 0.01 for j in range(4)}
    columns |= {f"MC_Axis{j:03}.Act.Trq": 50 * run.tau[:, j] / SCARA.effort[j] for j in range(4)}
    table(folder / "DataTrace.csv", columns, float_format="%.5f")
    heads = tuple(f"MC_Axis{j:03}.Act.Pos" for j in range(4))
    right = {"q": (Signal(heads, ("deg,deg,mm,deg",)),)}
    right["q_ref"] = (Signal(tuple(h.replace("Act", "Cmd") for h in heads), ("deg,deg,mm,deg",)),)
    right["tau"] = (Signal(tuple(h.replace("Pos", "Trq") for h in heads)),)
    return Answer("DataTrace.csv", {"Time": "s"}, right=right, draftable=False)


@moves(SIX, robot=None, rate=140.6)
def melfa_monitor(folder: Path, run: Run) -> Answer:
    """Mitsubishi MELFA real-time monitor: 7.11 ms cycles counted, deg, current feedback of rated."""
    specs = "Counter=count; *Joint position(FB) J{} [deg]=q°; Joint position(CMD) J{} [deg]=q_ref°;"
    specs += "Current feedback J{} [Arms]=amps; Load level J{} [%]=temp"
    columns, right = wide(run, specs)
    state(right, "Current feedback J{} [Arms]", range(1, 7), "current:?")
    state(right, "Joint position(CMD) J{} [deg]", range(1, 7), "q_ref°")
    table(folder / "melfa.csv", columns, float_format="%.4f")
    return Answer("melfa.csv", {"Counter": "sample"}, right=right, draftable=False)


@moves(TWO, robot=None, rate=1000.0)
def galil_arrays(folder: Path, run: Run) -> Answer:
    """Galil arrays by upload: _TPA, _TPB position counts, _TTA torque in V, no time."""
    counts = np.round(run.q * 4000 * 50 / (2 * np.pi)).astype(int)
    columns = {"_TPA": counts[:, 0], "_TPB": counts[:, 1]}
    columns |= {"_TTA": run.tau[:, 0] / 12, "_TTB": run.tau[:, 1] / 5}
    table(folder / "galil.txt", columns, sep=" ", float_format="%.4f")
    right = {"q": (Signal(("_TPA", "_TPB"), ("counts",)),), "tau": (Signal(("_TTA", "_TTB")),)}
    return Answer("galil.txt", {}, right=right, draftable=False)


@moves(TWO, rate=1000.0)
def epos_recorder(folder: Path, run: Run) -> Answer:
    """maxon EPOS recorder, two drives merged: inc and rpm of the motor, torque of the motor in mN m."""
    gear = np.array([103.0, 66.0])
    more = {"inc": np.round(run.q * gear * 4096 / (2 * np.pi)).astype(int)}
    more |= {"rpm": run.dq * gear * 30 / np.pi, "mnm": 1000 * run.tau / gear}
    specs = "Time [ms]=ms; *Node{} Position actual value [inc]=inc:q:counts;"
    specs += "*Node{} Velocity actual value averaged [rpm]=rpm:dq:rpm;"
    specs += "*Node{} Torque actual value [mNm]=mnm:tau:mNm"
    columns, right = wide(run, specs, **more)
    table(folder / "epos.csv", columns, sep="\t", float_format="%.3f")
    return Answer("epos.csv", {"Time [ms]": "ms"}, right=right, draftable=False)


@moves(THREE, robot="robot.toml", rate=1200.0)
def catman_ascii(folder: Path, run: Run) -> Answer:
    """HBM catman ASCII: names, then units, then "TAG" rows; strain gauge torques, inclinometers."""
    columns, right = wide(run, "Zeit 1=t; *DM_{}=tau; Incl_x=incl; *WG_{}=q°; T_Raum=21.5",
                          incl=np.degrees(np.sin(run.q[:, 1])) / 60)  # fmt: skip
    state(right, "DM_{}", range(1, 4), "tau")
    units = ["s", "Nm", "Nm", "Nm", "°", "°", "°", "°", "°C"]
    text = "HBM_CATMAN_DATAFILE\t5\nKanäle:\t9\n" + "\t".join(columns) + "\n" + "\t".join(units)
    frame = pd.DataFrame(columns).to_csv(index=False, header=False, sep="\t", float_format="%.5f")
    (folder / "catman.asc").write_text(text + "\n" + frame.replace(".", ","), encoding="cp1252")
    return Answer("catman.asc", {"Zeit 1": "s"}, right=right)


@moves(SIX, rate=500.0)
def simulink_logsout(folder: Path, run: Run) -> Answer:
    """Simulink's logsout by writetable: "controller:2(3)" ports are numbers of joints, SI unsaid."""
    specs = "time=t; *plant/q({})=q; *plant/qd({})=dq; ctrl/e({})=err; *ctrl/tau({})=tau_ref:tau;"
    specs += "traj/q_d({})=q_ref"
    columns, right = wide(run, specs, err=run.q_ref - run.q)
    names_ = tuple(f"ctrl/tau({j})" for j in range(1, 7))
    right["tau"] = (Signal(names_, UNITS["tau"], run.tau_ref),)
    state(right, "traj/q_d({})", range(1, 7), "q_ref")
    table(folder / "logsout.csv", columns, float_format="%.7g")
    return Answer("logsout.csv", {"time": "s"}, right=right)


@moves(PANDA, rate=500.0)
def pybullet_npy(folder: Path, run: Run) -> Answer:
    """A structured .npy of PyBullet's getJointStates: position, velocity, applied torque."""
    kind = [("sim_time", "f8"), ("jointPosition", "f8", 7), ("jointVelocity", "f8", 7),
            ("jointReactionForces", "f8", 6), ("appliedJointMotorTorque", "f8", 7)]  # fmt: skip
    rows = np.zeros(len(run.t), dtype=kind)
    rows["sim_time"], rows["jointPosition"], rows["jointVelocity"] = run.t, run.q, run.dq
    rows["jointReactionForces"], rows["appliedJointMotorTorque"] = run.pose, run.tau
    np.save(folder / "states.npy", rows)
    specs = "jointPosition=q; jointVelocity=dq; appliedJointMotorTorque=tau"
    return answer("states.npy", {"sim_time": "s"}, "@_{}", range(1, 8), specs)


@moves(UR, rate=100.0)
def webots_supervisor(folder: Path, run: Run) -> Answer:
    """A Webots supervisor: "<joint>_sensor" positions, "<joint> torque feedback", pose of the hand."""
    columns = {"sim time [s]": run.t, "hand x": run.pose[:, 0], "hand y": run.pose[:, 1]}
    for j, name in enumerate(UR.joints):
        columns |= {f"{name}_sensor": run.q[:, j], f"{name} torque feedback": run.tau[:, j]}
    table(folder / "webots.csv", columns, float_format="%.6f")
    right = {"q": (Signal(tuple(f"{n}_sensor" for n in UR.joints), UNITS["q"]),)}
    right["tau"] = (Signal(tuple(f"{n} torque feedback" for n in UR.joints), UNITS["tau"]),)
    return Answer("webots.csv", {"sim time [s]": "s"}, right=right)


@moves(SIX, rate=200.0)
def copelia_graph(folder: Path, run: Run) -> Answer:
    """CoppeliaSim's graph export: a title, names with a unit behind a colon, seconds first."""
    columns, right = wide(run, "Time (s)=t; *j{} pos (deg)=q°; j{} target (deg)=q_ref°; "
                          "*j{} force (N*m)=tau", joint_wise=True)  # fmt: skip
    state(right, "j{} target (deg)", range(1, 7), "q_ref°")
    table(folder / "graph.csv", columns, 'Export of graph "Joints"\n', float_format="%.5f")
    return Answer("graph.csv", {"Time (s)": "s"}, right=right)


@moves(LEFT, rate=100.0)
def two_arms(folder: Path, run: Run) -> Answer:
    """Baxter's recorder: left and right arm and two grippers; the robot beside is the left arm."""
    columns = {"time": run.t + 0.51}
    right_arm = run.q[::-1] * 0.7
    for j, name in enumerate(LEFT.joints):
        columns[name] = run.q[:, j]
    columns["left_gripper"] = 50 + 10 * np.sin(run.t)
    for j, name in enumerate(LEFT.joints):
        columns[name.replace("left", "right")] = right_arm[:, j]
    columns["right_gripper"] = 50 + 10 * np.cos(run.t)
    table(folder / "baxter.csv", columns, float_format="%.6f")
    return Answer("baxter.csv", {"time": "s"}, right={"q": (Signal(LEFT.joints, UNITS["q"]),)},
                  draftable=False)  # fmt: skip


@moves(SIX, rate=250.0)
def external_axis(folder: Path, run: Run) -> Answer:
    """A KUKA cell with a linear unit: A1 to A6 and E1 beside, each with position and torque."""
    columns = {"Zeit_ms": values(run)["ms"]}
    for j in range(6):
        columns[f"AxisAct_A{j + 1}"] = np.degrees(run.q[:, j])
    columns["AxisAct_E1"] = 1200 + 300 * np.sin(run.t)
    for j in range(6):
        columns[f"TorqueAct_A{j + 1}"] = run.tau[:, j]
    columns["TorqueAct_E1"] = 40 * np.cos(run.t)
    table(folder / "cell.csv", columns, sep=";", float_format="%.4f")
    right: dict = {}
    state(right, "AxisAct_A{}", range(1, 7), "q°")
    state(right, "TorqueAct_A{}", range(1, 7), "tau")
    return Answer("cell.csv", {"Zeit_ms": "ms"}, right=right)


@moves(SIX, rate=100.0)
def whole_second_stamps(folder: Path, run: Run) -> Answer:
    """A database dump whose time has whole seconds only; a hundred rows share each."""
    specs = "created_at=date; *j{}_pos=q; *j{}_vel=dq; *j{}_torque=tau"
    columns, right = wide(run, specs, date=stamps(run, "%Y-%m-%d %H:%M:%S"))
    table(folder / "dump.csv", columns, float_format="%.6f")
    return Answer("dump.csv", {}, 100.0, right=right, draftable=True)


@moves(THREE, rate=200.0)
def appended_runs(folder: Path, run: Run) -> Answer:
    """Two runs appended without a mark: the clock starts again at zero in the middle."""
    half = len(run.t) // 2
    clock = np.concatenate([run.t[:half], run.t[: len(run.t) - half]])
    columns, right = wide(run, "t=clock; *q{}=q; *qd{}=dq; *tau{}=tau", clock=clock)
    table(folder / "both.csv", columns, float_format="%.6f")
    return Answer("both.csv", {"t": "s"}, right=right)


@moves(TWO, rate=200.0)
def minutes(folder: Path, run: Run) -> Answer:
    """A chart recorder: time in minutes, angles and torques with their units in Spanish."""
    specs = "Tiempo (min)=m; *Ángulo articulación {} (grados)=q°; *Par articulación {} (N·m)=tau"
    columns, right = wide(run, specs, m=run.t / 60)
    table(folder / "registro.csv", columns, sep=";", float_format="%.7f")
    return Answer("registro.csv", {"Tiempo (min)": "min"}, right=right)


@moves(SIX, rate=250.0)
def errors_beside(folder: Path, run: Run) -> Answer:
    """A controller's log: q, its error and a sliding variable, desired ones; torque is a command."""
    specs = "t=t; *q{}=q; qd{}=q_ref; e{}=err; s{}=slide; *tau_c{}=tau_ref:tau"
    more = {"err": run.q_ref - run.q, "slide": run.dq_ref - run.dq + 5 * (run.q_ref - run.q)}
    columns, right = wide(run, specs, **more)
    state(right, "qd{}", range(1, 7), "q_ref")
    right["tau"] = (Signal(tuple(f"tau_c{j}" for j in range(1, 7)), UNITS["tau"], run.tau_ref),)
    table(folder / "smc.csv", columns, float_format="%.6f")
    return Answer("smc.csv", {"t": "s"}, right=right)


@moves(IIWA, rate=200.0)
def ros2_parquet(folder: Path, run: Run) -> Answer:
    """A bag as Parquet: dotted fields, lists in cells, log time and header stamp in ns."""
    tick = 1712143331250000000 + np.round(run.t * 1e9).astype(np.int64)
    frame = pd.DataFrame({"log_time": tick + 300000, "header.stamp.sec": tick // 10**9})
    frame["header.stamp.nanosec"] = tick % 10**9
    frame["name"] = [list(IIWA.joints)] * len(run.t)
    for part, v in (("position", run.q), ("velocity", run.dq), ("effort", run.tau)):
        frame[part] = list(v)
    frame.to_parquet(folder / "joint_states.parquet")
    right = {role: (Signal((), UNITS[role]),) for role in ("q", "dq", "tau")}
    return Answer("joint_states.parquet", {}, right=right, texts=False)


@moves(GEN3, rate=100.0)
def hdf5_attributes(folder: Path, run: Run) -> Answer:
    """A lab's HDF5: arrays with a "unit" attribute, joints as rows, raw and joint side apart."""
    with h5py.File(folder / "run.h5", "w") as file:
        for name, v, unit in (("time", run.t, "s"), ("link/position", run.q.T, "rad"),
                              ("link/velocity", run.dq.T, "rad/s"), ("link/torque", run.tau.T, "Nm"),
                              ("motor/position", 100 * run.q.T, "rad"),
                              ("motor/current", run.current.T, "A")):  # fmt: skip
            file[name] = v
            file[name].attrs["unit"] = unit
    specs = "link/position=q; link/velocity=dq; link/torque=tau; motor/current=current:A"
    UNITS["A"] = ("A",)
    found = answer("run.h5", {"time": "s"}, "@[{}]", SEVEN, "; ".join(specs.split("; ")[:3]))
    return found


@moves(TWO, rate=500.0)
def mat_timeseries(folder: Path, run: Run) -> Answer:
    """A v7 MAT of timeseries as structs: Time and Data per signal, names in German."""

    def series(v: np.ndarray) -> dict:
        return {"Time": run.t[:, None], "Data": v}

    savemat(folder / "messung.mat", {
        "Winkel": series(run.q), "Winkelgeschwindigkeit": series(run.dq),
        "Sollwinkel": series(run.q_ref), "Antriebsmoment": series(run.tau),
    })  # fmt: skip
    form = "{}.Data_1", "{}.Data_2"
    right = {
        role: (Signal(tuple(f.format(name) for f in form), UNITS[role]),)
        for role, name in (("q", "Winkel"), ("dq", "Winkelgeschwindigkeit"), ("q_ref", "Sollwinkel"),
                           ("tau", "Antriebsmoment"))
    }  # fmt: skip
    clocks = ("Winkel", "Winkelgeschwindigkeit", "Sollwinkel", "Antriebsmoment")
    time = {f"{name}.Time{end}": "s" for name in clocks for end in ("", "_1")}
    return Answer("messung.mat", time, right=right)


@moves(SIX, rate=125.0)
def elite_packets(folder: Path, run: Run) -> Answer:
    """Elite EC monitor port: machinePos deg, absolute encoder counts, torques in per mille."""
    more = {"abs": np.round(run.q * 2**19 / (2 * np.pi)).astype(int) + 17000}
    more |= {"mille": np.round(1000 * run.tau / 160).astype(int), "stamp": values(run)["ms"] + 91}
    specs = "timestamp=stamp; *machinePos_{}=q°; bodyAbsEncoder_{}=abs; *torques_{}=mille:tau:?;"
    specs += "moduleTemp_{}=temp; machinePose_x=x; emergencyStop=0"
    columns, right = wide(run, specs, **more)
    table(folder / "ec.csv", columns, float_format="%.4f")
    return Answer("ec.csv", {"timestamp": "ms"}, right=right, draftable=False)


@moves(SIX, rate=250.0)
def friction_beside(folder: Path, run: Run) -> Answer:
    """A research controller: torque from the sensor, feed-forward parts and a friction estimate."""
    specs = "time=t; *q_{}=q; *dq_{}=dq; tau_g_{}=model; tau_fric_{}=fric; tau_ff_{}=model;"
    specs += "tau_pid_{}=pid; *tau_sensor_{}=tau; tau_dob_{}=ext"
    more = {"model": run.tau_model, "fric": run.tau - run.tau_model, "pid": run.tau_ext}
    columns, right = wide(run, specs, **more)
    table(folder / "research.csv", columns, float_format="%.6f")
    return Answer("research.csv", {"time": "s"}, right=right)


@moves(SIX, robot=None, rate=250.0)
def observer_alone(folder: Path, run: Run) -> Answer:
    """A disturbance observer's log: tau_dob is no joint torque, and none other is there."""
    columns, right = wide(run, "t=t; *q{}=q; *dq{}=dq; tau_dob{}=ext")
    table(folder / "dob.csv", columns, float_format="%.6f")
    return Answer("dob.csv", {"t": "s"}, right=right, draftable=False)


@moves(THREE, rate=250.0)
def japanese_units_row(folder: Path, run: Run) -> Answer:
    """A Japanese data logger (cp932): a row of units, 角度 angle, 角速度 speed, トルク torque, 秒 s."""
    columns, right = wide(run, "時刻=t; *角度{}=q°; *角速度{}=dq°; *トルク{}=tau; 電流{}=current")
    units = ["s"] + ["deg"] * 3 + ["deg/s"] * 3 + ["N・m"] * 3 + ["A"] * 3
    frame = pd.DataFrame(columns).to_csv(index=False, header=False, float_format="%.5f")
    text = ",".join(columns) + "\n" + ",".join(units) + "\n" + frame
    (folder / "ロガー.csv").write_bytes(text.encode("cp932"))
    return Answer("ロガー.csv", {"時刻": "s"}, right=right)


@moves(SIX, rate=250.0)
def velocity_before_position(folder: Path, run: Run) -> Answer:
    """Names of one letter: w is the speed, p the angle, m the torque; deg and rad/s mixed."""
    columns, right = wide(run, "t=t; *w{}=dq; *p{}=q°; *m{}=tau")
    table(folder / "short.csv", columns, float_format="%.6f")
    return Answer("short.csv", {"t": "s"}, right=right)


@moves(UR, rate=125.0)
def gazebo_duplicates(folder: Path, run: Run) -> Answer:
    """A Gazebo plugin: joints in an order of its own, stated in a comment; efforts are commands."""
    order = [5, 4, 3, 0, 1, 2]
    names_ = [UR.joints[k] for k in order]
    columns = {"sim_sec": np.floor(run.t).astype(int)}
    columns |= {"sim_nsec": np.round(run.t % 1 * 1e9).astype(int)}
    for part, v in (("pos", run.q), ("vel", run.dq), ("eff_cmd", run.tau_ref)):
        columns |= {f"{part}{i}": v[:, k] for i, k in enumerate(order)}
    table(folder / "gz.csv", columns, f"# joints: {', '.join(names_)}\n", float_format="%.6f")
    right = {
        role: (Signal(tuple(f"{part}{order.index(j)}" for j in range(6)), UNITS[role], v),)
        for role, part, v in (("q", "pos", run.q), ("dq", "vel", run.dq),
                              ("tau", "eff_cmd", run.tau_ref))
    }  # fmt: skip
    return Answer("gz.csv", {"sim_sec+sim_nsec": "s+ns"}, right=right, torque=("held-command",))


@moves(SIX, rate=500.0)
def encoders_on_both_sides(folder: Path, run: Run) -> Answer:
    """Dual encoders: primary at the motor in rad of the motor, secondary at the link in rad."""
    specs = "time_us=us; enc1_pos_{}=motor; enc2_pos_{}=q; enc1_vel_{}=speed; *torque_{}=tau"
    columns, right = wide(run, specs, motor=run.q * 121, speed=run.dq * 121)
    right["q"] = (Signal(tuple(f"enc2_pos_{j}" for j in range(1, 7)), UNITS["q"]),)
    table(folder / "dual.csv", columns, float_format="%.6f")
    return Answer("dual.csv", {"time_us": "us"}, right=right)


@moves(SIX, rate=100.0)
def deltas_between_samples(folder: Path, run: Run) -> Answer:
    """A learning data set: joint increments a step as actions beside joint states in degrees."""
    delta = np.diff(run.q_ref, axis=0, append=run.q_ref[-1:])
    specs = "timestamp=t; frame=count; *state_joint_{}=q°; action_joint_{}=delta; reward=0"
    columns, right = wide(run, specs, delta=np.degrees(delta))
    table(folder / "episode.csv", columns, float_format="%.6f")
    return Answer("episode.csv", {"timestamp": "s"}, right=right, draftable=False)


@moves(THREE, robot="robot.toml", rate=200.0)
def imu_beside(folder: Path, run: Run) -> Answer:
    """Three joints beside an IMU at the tip: gyro and accelerometer are three columns each as well."""
    specs = "t=t; gyro_x=g1; gyro_y=g2; gyro_z=g3; ax=a1; ay=a2; az=a3; *ang_{}=q; *trq_{}=tau"
    more = {f"g{k}": run.dq.sum(axis=1) * k / 3 for k in (1, 2, 3)}
    more |= {f"a{k}": 9.81 * np.cos(run.q[:, k - 1]) for k in (1, 2, 3)}
    columns, right = wide(run, specs, **more)
    table(folder / "imu.csv", columns, float_format="%.6f")
    return Answer("imu.csv", {"t": "s"}, right=right)


@moves(TWO, robot="robot.toml", rate=250.0)
def degrees_small_range(folder: Path, run: Run) -> Answer:
    """Small moves in degrees without a word: 2° to 5°, inside the limits in rad as well."""
    columns, right = wide(run, "time=t; *q{}=small:q:?; *tau{}=tau", small=np.degrees(run.q) / 25)
    table(folder / "small.csv", columns, float_format="%.6f")
    return Answer("small.csv", {"time": "s"}, right=right, draftable=False)


@moves(SIX, rate=250.0)
def markdown_table(folder: Path, run: Run) -> Answer:
    """A table pasted from a report: bars around the cells, a row of dashes, units in brackets."""
    columns, right = wide(run, "t [s]=t; *q{} [rad]=q; *tau{} [Nm]=tau")
    rows = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    for row in np.column_stack(list(columns.values())):
        rows.append("| " + " | ".join(f"{x:.6f}" for x in row) + " |")
    (folder / "table.md").write_text("\n".join(rows) + "\n")
    return Answer("table.md", {"t [s]": "s"}, right=right)
