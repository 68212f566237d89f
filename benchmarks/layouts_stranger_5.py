"""Write motions as thirty recordings, each with its answer: twelve ordinary ones, ten of laboratory
practice, eight hard ones.

The sixth stranger's: written down, with their answers, before any of them ran, by one who had not
read the importer or the layouts of the other sets.
"""

import json
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
from scipy.io import savemat

from benchmarks.import_layouts import (
    DEG,
    NM,
    RAD,
    Answer,
    Signal,
    anywhere,
    layout,
    recorded,
    stamps,
    table,
    wide,
)
from benchmarks.recorded_arm import (
    FOUR,
    GEN3,
    IIWA,
    LEFT,
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

YUMI_ORDER = (
    1,
    2,
    7,
    3,
    4,
    5,
    6,
)  # from the base to the flange, as yumi_description names its joints
YUMI = Arm(
    "yumi", tuple(f"yumi_joint_{j}_l" for j in YUMI_ORDER), "zyzyxyx", (40, 40, 30, 30, 12, 12, 6)
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


def turns(run: Run) -> dict[str, np.ndarray]:
    """Return position and velocity in revolutions, and a time that counts from 1970."""
    return {"rev": run.q / (2 * np.pi), "revs": run.dq / (2 * np.pi), "epoch": EPOCH + run.t}


# ---- ordinary ones


@layout(SIX, rate=250.0)
def doosan_rt(folder: Path, run: Run) -> Answer:
    """Doosan CDRFLEx get_rt_control_output_data_list (manual.doosanrobotics.com): three joint
    torques, two encoders; deg, N m.
    """
    specs = (
        "time_stamp=t; *actual_joint_position_{}=q°; actual_joint_position_abs_{}=abs; "
        "*actual_joint_velocity_{}=dq°;"
    )
    specs += (
        "actual_joint_velocity_abs_{}=dq°; *actual_motor_torque_{}=tau; "
        "actual_joint_torque_{}=model; raw_joint_torque_{}=raw;"
    )
    specs += (
        "external_joint_torque_{}=ext; *target_joint_position_{}=q_ref°; "
        "*target_joint_velocity_{}=dq_ref°"
    )
    bent = run.q - run.tau / 20000
    data = {"abs": np.degrees(bent), "model": run.tau_model, "raw": run.tau_model + run.tau_ext}
    columns, right = wide(run, specs, **data)
    also(right, "q", "actual_joint_position_abs_{}", range(1, 7), DEG, bent)
    also(right, "dq", "actual_joint_velocity_abs_{}", range(1, 7), ("deg/s", "°/s"))
    also(right, "tau", "actual_joint_torque_{}", range(1, 7), NM, run.tau_model)
    also(right, "tau", "raw_joint_torque_{}", range(1, 7), NM, data["raw"])
    table(folder / "rt_output.csv", columns)
    return Answer("rt_output.csv", {"time_stamp": "s"}, right=right)


@layout(SIX, rate=250.0, how="points")
def kuka_nextgen_drive(folder: Path, run: Run) -> Answer:
    """KUKA NextGenDrive of a body shop (data.edincubator.eu/dataset/robot-data-from-the-body-shop):
    its names and units.
    """
    specs = (
        "Time [s]=t; *A{} Programmed Axis Velocity [°/s]=dq_ref°; *A{} Real Axis Velocity "
        "[°/s]=dq°;"
    )
    specs += "A{} Difference Axis Velocity [°/s]=edq; A{} Programmed Axis Acceleration [°/ss]=ddq;"
    specs += (
        "A{} Calculated Axis Moment [Nm]=model; A{} Difference Axis Moment [Nm]=etau; A{} Motor "
        "Temperature [K]=kelvin;"
    )
    specs += "*A{} Axis Current [A]=amps:current:A; *A{} Real Axis Moment [Nm]=tau;"
    specs += "*A{} Programmed Axis Position [°]=q_ref°; *A{} Real Axis Position [°]=q°"
    data = {
        "edq": np.degrees(run.dq_ref - run.dq),
        "ddq": np.degrees(run.ddq),
        "model": run.tau_model,
    }
    data |= {"etau": run.tau_model - run.tau, "kelvin": run.temperature + 273.15}
    columns, right = wide(run, specs, joint_wise=True, **data)
    also(right, "temperature", "A{} Motor Temperature [K]", range(1, 7), ("K",))
    also(
        right,
        "ddq_ref",
        "A{} Programmed Axis Acceleration [°/ss]",
        range(1, 7),
        ("deg/s^2", "°/s^2", "°/ss"),
    )
    also(right, "tau_feedforward", "A{} Calculated Axis Moment [Nm]", range(1, 7), NM)
    table(folder / "KASTIR313755R01.csv", columns)
    return Answer("KASTIR313755R01.csv", {"Time [s]": "s"}, right=right)


@layout(SEVEN)
def matlab_durations(folder: Path, run: Run) -> Answer:
    """MATLAB's writetimetable (mathworks.com): durations as "0.005 sec", a matrix q becomes q_1,
    q_2, ….
    """
    times = np.array([f"{t:g} sec" for t in run.t])
    specs = "Time=clock; *q_{}=q; *qd_{}=dq; qdd_{}=ddq; *tau_{}=tau"
    return recorded(folder, run, "timetable.csv", {"Time": "*"}, specs, data={"clock": times})


@layout(FOUR, rate=500.0)
def simulink_with_time(folder: Path, run: Run) -> Answer:
    """Simulink's To Workspace, "Structure With Time" (mathworks.com): time, signals.values,
    .dimensions, .label, blockName each.
    """

    def logged(v: np.ndarray, label: str) -> dict:
        signals = {"values": v, "dimensions": float(v.shape[1]), "label": label}
        return {"time": run.t[:, None], "signals": signals, "blockName": f"rig/{label}"}

    parts = {"q_meas": run.q, "qd_meas": run.dq, "q_cmd": run.q_ref, "tau_meas": run.tau}
    savemat(
        folder / "run7.mat", {name: logged(v, name) for name, v in parts.items()} | {"Ts": 0.002}
    )
    return Answer(
        "run7.mat", rate=500.0, right=anywhere(q=RAD, dq=("rad/s",), q_ref=RAD, tau=NM), texts=False
    )


@layout(THREE, rate=250.0, how="points")
def siemens_to_trace(folder: Path, run: Run) -> Answer:
    """TIA Portal trace of S7-1500 axes as CSV: <TO>.Position and .Velocity are set points (S7-1500
    Motion Control manual).
    """
    specs = (
        "Zeit [ms]=ms; *Achse_{}.Position=q_ref°; *Achse_{}.ActualPosition=q°; "
        "*Achse_{}.Velocity=dq_ref°;"
    )
    specs += "*Achse_{}.ActualVelocity=dq°; *Achse_{}.StatusTorqueData.ActualTorque=tau"
    return recorded(
        folder,
        run,
        "Trace_1.csv",
        {"Zeit [ms]": "ms"},
        specs,
        joint_wise=True,
        sep=";",
        decimal=",",
    )


@layout(FOUR, rate=200.0)
def moteus_by_id(folder: Path, run: Run) -> Answer:
    """mjbots moteus registers (docs/reference.md): position in revolutions, velocity in rev/s,
    torque in N m, q_current.
    """
    specs = (
        "timestamp=epoch; id{}_mode=10; *id{}_position=rev:q:rev; *id{}_velocity=revs:dq:rev/s; "
        "*id{}_q_current=amps:current:A;"
    )
    specs += (
        "*id{}_torque=tau; id{}_d_current=0.0; id{}_voltage=24.1; id{}_temperature=temp; "
        "id{}_fault=0"
    )
    columns, right = wide(run, specs, joint_wise=True, **turns(run))
    also(right, "temperature", "id{}_temperature", range(1, 5), ("degC", "°C", "C"))
    table(folder / "moteus.csv", columns)
    return Answer("moteus.csv", {"timestamp": "s"}, right=right)


@layout(IIWA, rate=1000.0)
def mc_rtc_log(folder: Path, run: Run) -> Answer:
    """mc_rtc's log by mc_bin_to_log (jrl-umi3218.github.io/mc_rtc): t, qIn_0 … measured, qOut
    commanded, alphaIn, tauIn; SI.
    """
    specs = (
        "t=t; *qIn_{}=q; *qOut_{}=q_ref; *alphaIn_{}=dq; *alphaOut_{}=dq_ref; *tauIn_{}=tau; "
        "tauOut_{}=tau_ref;"
    )
    specs += "perf_GlobalRun=loop; perf_LoopDt=dt"
    dice = np.random.default_rng(3)
    data = {
        "loop": dice.gamma(9.0, 0.05, len(run.t)),
        "dt": 1.0 + 0.01 * dice.standard_normal(len(run.t)),
    }
    return recorded(folder, run, "mc-control.csv", {"t": "s"}, specs, range(7), data=data, sep=";")


@layout(THREE, rate=1000.0, how="points")
def trifinger_log(folder: Path, run: Run) -> Answer:
    """robot_interfaces' RobotLogger (open-dynamic-robot-initiative): #time_index, timestamp [ms],
    unused actions nan.
    """
    specs = (
        "#time_index=count; timestamp=stamp; status_action_repetitions=0; status_error_status=0; "
        "*observation_position_{}=q;"
    )
    specs += (
        "*observation_velocity_{}=dq; *observation_torque_{}=tau; observation_tip_force_0=0.0; "
        "applied_action_torque_{}=tau_ref;"
    )
    specs += (
        "applied_action_position_{}=nan; applied_action_position_kp_{}=nan; "
        "desired_action_torque_{}=tau_ref"
    )
    data = {"stamp": 1e3 * (EPOCH + run.t), "nan": np.full(run.q.shape, np.nan)}
    return recorded(
        folder,
        run,
        "robot_data.dat",
        {"timestamp": "ms"},
        specs,
        range(3),
        data=data,
        sep=" ",
        na_rep="nan",
    )


@layout(SEVEN, rate=200.0)
def flobaroid_measurements(folder: Path, run: Run) -> Answer:
    """FloBaRoID's measurements.npz (kjyv/FloBaRoID, excite.py): positions, velocities, times,
    target_*, contacts as dict.
    """
    none, n = np.zeros((len(run.t), 6)), len(run.t)
    data = {
        "positions": run.q,
        "positions_raw": run.q,
        "velocities": run.dq,
        "velocities_raw": run.dq,
        "accelerations": run.ddq,
    }
    data |= {
        "torques": run.tau,
        "torques_raw": run.tau,
        "target_positions": run.q_ref,
        "target_velocities": run.dq_ref,
    }
    data |= {
        "target_accelerations": run.ddq,
        "base_velocity": none,
        "base_acceleration": none,
        "base_rpy": np.zeros((n, 3)),
    }
    np.savez(folder / "measurements.npz", times=run.t, contacts=np.array({}), **data)
    right = anywhere(
        q=RAD, dq=("rad/s",), tau=NM, q_ref=RAD, dq_ref=("rad/s",), ddq_ref=("rad/s^2",)
    )
    return Answer("measurements.npz", right=right, texts=False)


@layout(LEFT, rate=100.0)
def baxter_sea_state(folder: Path, run: Run) -> Answer:
    """Baxter's SEAJointState (RethinkRobotics/baxter_common): actual_*, commanded_*, gravity and
    hysteresis models.
    """
    specs = (
        "header.stamp=epoch; *{}.commanded_position=q_ref; *{}.commanded_velocity=dq_ref; "
        "{}.commanded_effort=tau_ref;"
    )
    specs += (
        "*{}.actual_position=q; *{}.actual_velocity=dq; *{}.actual_effort=tau; "
        "{}.gravity_model_effort=model;"
    )
    specs += "{}.hysteresis_model_effort=ext"
    data = turns(run) | {"model": run.tau_model}
    return recorded(
        folder,
        run,
        "gravity_compensation_torques.csv",
        {"header.stamp": "s"},
        specs,
        run.arm.joints,
        data=data,
    )


@layout(UR, rate=500.0)
def ros2_dynamic_joint_states(folder: Path, run: Run) -> Answer:
    """PlotJuggler's CSV of control_msgs/DynamicJointState (ros2_control): by joint, alphabetical,
    with a wrist sensor.
    """
    specs = (
        "__time=epoch; *{}/effort=tau; *{}/position=q; *{}/velocity=dq; tcp_fts_sensor/force.x=x; "
        "tcp_fts_sensor/torque.z=rz"
    )
    specs = specs.replace("{}", "/dynamic_joint_states/{}").replace(
        "tcp", "/dynamic_joint_states/tcp"
    )
    columns, right = wide(run, specs, run.arm.joints, **turns(run))
    table(
        folder / "dynamic.csv",
        dict(sorted(columns.items(), key=lambda item: (item[0] != "__time", item[0]))),
    )
    return Answer("dynamic.csv", {"__time": "s"}, right=right)


@layout(SIX)
def pandas_fixed_hdf(folder: Path, run: Run) -> Answer:
    """DataFrame.to_hdf(key="df") in its fixed format (pandas, io/pytables.py): axis0 names, axis1
    times, block0_values.
    """
    columns, _ = wide(run, "q{}=q; dq{}=dq; tau{}=tau")
    labels = np.array([name.encode() for name in columns])
    with h5py.File(folder / "run.h5", "w") as file:
        group = file.create_group("df")
        group.attrs.update(
            {
                "pandas_type": "frame",
                "pandas_version": "0.15.2",
                "encoding": "UTF-8",
                "ndim": 2,
                "nblocks": 1,
            }
        )
        group["axis0"], group["block0_items"] = labels, labels
        group["axis1"], group["block0_values"] = run.t, np.column_stack(list(columns.values()))
        group["axis1"].attrs.update({"kind": "float", "name": "t"})
    return Answer("run.h5", right=anywhere(q=RAD, dq=("rad/s",), tau=NM), texts=False)


# ---- laboratory practice


@layout(FOUR, how="points")
def french_sheet(folder: Path, run: Run) -> Answer:
    """Write a sheet saved by Excel with French settings: Temps, Position, Vitesse, Couple, Consigne
    "axe 1"; Latin-1, decimal commas.
    """
    specs = (
        "Temps (s)=t; *Consigne axe {} (°)=q_ref°; *Position axe {} (°)=q°; *Vitesse axe {} "
        "(°/s)=dq°; Couple axe {} (N.m)=tau"
    )
    columns, right = wide(run, specs, joint_wise=True)
    also(right, "tau", "Couple axe {} (N.m)", range(1, 5), (*NM, "N.m"))
    table(folder / "essai_03.csv", columns, sep=";", decimal=",", encoding="latin-1")
    return Answer("essai_03.csv", {"Temps (s)": "s"}, right=right)


@layout(TWO, rate=1000.0)
def reference_and_error(folder: Path, run: Run) -> Answer:
    """Write what a tracking experiment's scope holds: reference, error e = reference - position,
    torque; no position at all.
    """
    data = {"e": run.q_ref - run.q}
    return recorded(
        folder,
        run,
        "tracking.csv",
        {"t": "s"},
        "t=t; *q_ref{}=q_ref; e{}=e; *u{}=tau",
        known=False,
        data=data,
    )


@layout(SIX, rate=1000.0)
def motor_side(folder: Path, run: Run) -> Answer:
    """Write encoders before the gears, as drives give them: theta_m [rad] is 50 to 120 times the
    joint's angle; ratios in no file.
    """
    ratio = np.array([100, 120, 100, 80, 80, 50])
    specs = "time=t; *theta_m{}=motor:q; *theta_m_dot{}=speed:dq; *i_m{}=amps:current:A"
    data = {"motor": run.q * ratio, "speed": run.dq * ratio}
    return recorded(folder, run, "drives.csv", {"time": "s"}, specs, known=False, data=data)


@layout(SEVEN, rate=100.0)
def time_of_day(folder: Path, run: Run) -> Answer:
    """Write a LabVIEW or C# logger's time of day without a date, 14:02:11.250000; units in
    brackets.
    """
    specs = "Time=clock; *J{} pos [deg]=q°; *J{} vel [deg/s]=dq°; *J{} trq [Nm]=tau"
    data = {"clock": stamps(run, "%H:%M:%S.%f")}
    return recorded(
        folder, run, "2024-05-03_run.csv", {"Time": "*"}, specs, joint_wise=True, data=data
    )


@layout(GEN3, rate=100.0, how="points")
def kortex_wrapped(folder: Path, run: Run) -> Answer:
    """Kinova Kortex ActuatorFeedback (BaseCyclic.proto): position from 0 to 360 deg, deg/s, torque,
    current_motor.
    """
    specs = (
        "time=epoch; frame_id=count; *actuators[{}].position=wrapped:q°; "
        "*actuators[{}].velocity=dq°;"
    )
    specs += (
        "*actuators[{}].current_motor=amps:current:A; *actuators[{}].torque=tau; "
        "actuators[{}].temperature_motor=temp"
    )
    columns, right = wide(run, specs, range(7), wrapped=np.degrees(run.q) % 360, **turns(run))
    also(right, "temperature", "actuators[{}].temperature_motor", range(7), ("degC", "°C", "C"))
    table(folder / "feedback.csv", columns)
    return Answer("feedback.csv", {"time": "s"}, right=right)


@layout(LEG, rate=500.0)
def strain_in_volts(folder: Path, run: Run) -> Answer:
    """Write a test bench's amplifier: strain gauges at the joints in volts, uncalibrated, beside
    encoders and motor currents.
    """
    volts = 2.5 + run.tau / 61.0
    specs = (
        "Time (s)=t; *Encoder {} (deg)=q°; Strain gauge {} (V)=volts; *Motor current {} "
        "(A)=amps:current:A"
    )
    return recorded(folder, run, "bench.csv", {"Time (s)": "s"}, specs, data={"volts": volts})


@layout(THREE)
def desired_as_qd(folder: Path, run: Run) -> Answer:
    """French notation (Khalil, Dombre): q, its derivative qp, desired values qd and qpd; qd is no
    velocity here.
    """
    return recorded(
        folder,
        run,
        "mesures.txt",
        {"t": "s"},
        "t=t; *q{}=q; *qd{}=q_ref; *qp{}=dq; *qpd{}=dq_ref; *tau{}=tau",
        sep="\t",
    )


@layout(SIX, rate=500.0)
def savetxt_with_header(folder: Path, run: Run) -> Answer:
    """numpy.savetxt with header="t q(6) dq(6) tau(6)": a comment that names blocks, not columns."""
    np.savetxt(
        folder / "run.txt",
        np.column_stack([run.t, run.q, run.dq, run.tau]),
        header="t q(6) dq(6) tau(6)",
    )
    return Answer("run.txt", right=anywhere(q=RAD, dq=("rad/s",), tau=NM), texts=False)


@layout(FOUR, rate=100.0)
def odrive_by_number(folder: Path, run: Run) -> Answer:
    """Write a cable rig's ODrives (eliasoa/TTK4900_CDPR, Plot.m): ODrive0Position …, Velocity,
    Current; turns, turn/s.
    """
    specs = (
        "time=t; *ODrive{}Position=rev:q:rev; *ODrive{}Velocity=revs:dq:rev/s; "
        "*ODrive{}Current=amps:current:A"
    )
    return recorded(folder, run, "Up05.csv", {"time": "s"}, specs, range(4), data=turns(run))


@layout(YUMI)
def yumi_two_arms(folder: Path, run: Run) -> Answer:
    """Joint states of both arms of an ABB YuMi (yumi_description), numbered 1 to 7 while joint 7 is
    the third from the base.
    """
    back = {"q": run.q[::-1], "dq": -run.dq[::-1], "tau": run.tau[::-1]}
    specs = "stamp=epoch; *{}_position=q; *{}_velocity=dq; *{}_effort=tau"
    columns, right = wide(run, specs, run.arm.joints, **turns(run))
    others, _ = wide(run, specs, [name[:-1] + "r" for name in run.arm.joints], **turns(run) | back)
    columns |= others
    table(
        folder / "yumi.csv",
        {name: columns[name] for name in ["stamp", *sorted(set(columns) - {"stamp"})]},
    )
    return Answer("yumi.csv", {"stamp": "s"}, right=right)


# ---- hard ones


@layout(THREE)
def trials_in_one(folder: Path, run: Run) -> Answer:
    """Repetitions appended to one file: a column "trial", and t that starts again with each."""
    columns, right = wide(
        run,
        "trial=trial; t=t; *q{}=q; *dq{}=dq; *tau{}=tau",
        trial=1 + 3 * np.arange(len(run.t)) // len(run.t),
    )
    columns["t"] = run.t % run.t[len(run.t) // 3]
    table(folder / "all_trials.csv", columns)
    return Answer("all_trials.csv", {"t": "s"}, right=right, table=False)


@layout(SEVEN, rate=100.0)
def yarp_dumper(folder: Path, run: Run) -> Answer:
    """yarpdatadumper's data.log of stateExt:o (robotology/yarp, stateExt.thrift): lists in
    brackets, with flags; deg, deg/s.
    """

    def line(k: int) -> str:
        lists = (np.degrees(run.q[k]), np.degrees(run.dq[k]), np.degrees(run.ddq[k]), run.tau[k])
        return f"{k} {EPOCH + run.t[k]:.6f} " + " ".join(
            f"({' '.join(f'{x:.6f}' for x in v)}) 1" for v in lists
        )

    (folder / "data.log").write_text("\n".join(map(line, range(len(run.t)))) + "\n")
    return Answer(
        "data.log", right=anywhere(q=DEG, dq=("deg/s", "°/s"), tau=NM), texts=False, table=False
    )


@layout(LEG, rate=50.0)
def advantagescope_list(folder: Path, run: Run) -> Answer:
    """AdvantageScope's CSV (List) of Phoenix 6 signals (docs/EXPORT.md): Timestamp, Key, Value;
    rotations, rotations/s, A.
    """
    data, parts = turns(run), []
    signals = {
        "Position": data["rev"],
        "Velocity": data["revs"],
        "TorqueCurrent": run.current,
        "DeviceTemp": run.temperature,
    }
    for name, v in signals.items():
        for j in range(2):
            parts.append(
                pd.DataFrame(
                    {
                        "Timestamp": run.t,
                        "Key": f"Phoenix6/TalonFX-{j + 1}/{name}",
                        "Value": v[:, j],
                    }
                )
            )
    table(folder / "Log_24.csv", pd.concat(parts).sort_values("Timestamp", kind="stable"))
    right = anywhere(
        q=("rev", "turn", "turns"),
        dq=("rev/s", "turn/s"),
        current=("A",),
        tau=("A",),
        temperature=("degC", "°C"),
    )
    return Answer("Log_24.csv", right=right, texts=False, table=False)


@layout(THREE, rate=100.0)
def influx_query(folder: Path, run: Run) -> Answer:
    """InfluxDB's annotated CSV (docs.influxdata.com): #group, #datatype, #default, one row a value,
    joints as a tag.
    """
    head = (
        "#group,false,false,false,false,true,true,true\n#datatype,string,long,dateTime:RFC3339,"
        "double,string,string,string\n"
    )
    head, frames = head + "#default,_result,,,,,,\n", []
    for field, v in {"effort": run.tau, "position": run.q, "velocity": run.dq}.items():
        for j, joint in enumerate(run.arm.joints):
            frame = {
                "": "",
                "result": "",
                "table": len(frames),
                "_time": stamps(run, "%Y-%m-%dT%H:%M:%S.%fZ"),
                "_value": v[:, j],
            }
            frames.append(
                pd.DataFrame(
                    frame | {"_field": field, "_measurement": "joint_state", "joint": joint}
                )
            )
    table(folder / "influx.csv", pd.concat(frames), head)
    return Answer(
        "influx.csv", right=anywhere(q=RAD, dq=("rad/s",), tau=NM), texts=False, table=False
    )


@layout(FOUR, rate=20.0)
def grafana_formatted(folder: Path, run: Run) -> Answer:
    """Grafana's panel data with "Formatted data" on (grafana.com, inspect a panel): the unit stands
    in each cell.
    """
    cells = {
        "q": (np.degrees(run.q), "°"),
        "dq": (np.degrees(run.dq), " °/s"),
        "tau": (run.tau, " N·m"),
    }
    data = {
        key: np.vectorize(lambda x, unit=unit: f"{x:.4f}{unit}")(v)
        for key, (v, unit) in cells.items()
    }
    specs = "Time=clock; *Joint {} position=q; *Joint {} velocity=dq; *Joint {} torque=tau"
    columns, right = wide(run, specs, clock=stamps(run, "%Y-%m-%d %H:%M:%S.%f"), **data)
    right["q"], right["dq"] = (), ()
    also(right, "q", "Joint {} position", range(1, 5), DEG)
    also(right, "dq", "Joint {} velocity", range(1, 5), ("deg/s", "°/s"))
    table(folder / "panel.csv", columns, quoting=1)
    return Answer("panel.csv", {"Time": "*"}, right=right, table=False)


@layout(SIX, rate=250.0)
def schunk_states(folder: Path, run: Run) -> Answer:
    """Liu and Althoff's Schunk arm (IROS 2018; readme of nikhilushinde/AutoKoopman): states of 12,
    inputs of 6, a sampling time.
    """
    savemat(
        folder / "robot.mat",
        {"states": np.column_stack([run.q, run.dq]), "inputs": run.tau, "dt": 0.004},
    )
    return Answer(
        "robot.mat", rate=250.0, right=anywhere(q=RAD, dq=("rad/s",), tau=NM), texts=False
    )


@layout(PANDA, rate=20.0, how="points")
def robomimic_demos(folder: Path, run: Run) -> Answer:
    """robomimic's HDF5 (robomimic.github.io, dataset contents): data/demo_0/obs/robot0_joint_pos …;
    actions move the tool.
    """
    dice = np.random.default_rng(11)
    with h5py.File(folder / "low_dim.hdf5", "w") as file:
        file.create_group("data").attrs["env_args"] = json.dumps(
            {"env_name": "Lift", "env_kwargs": {"control_freq": 20}}
        )
        for k, part in enumerate(np.array_split(np.arange(len(run.t)), 2)):
            demo = file.create_group(f"data/demo_{k}")
            demo.attrs["num_samples"] = len(part)
            demo["actions"] = np.clip(
                0.4 * dice.standard_normal((len(part), 7)).cumsum(axis=0) * 0.1, -1, 1
            )
            demo["rewards"], demo["dones"] = (
                np.zeros(len(part)),
                np.arange(len(part)) == len(part) - 1,
            )
            demo["obs/robot0_joint_pos"], demo["obs/robot0_joint_vel"] = run.q[part], run.dq[part]
            demo["obs/robot0_eef_pos"], demo["obs/robot0_gripper_qpos"] = (
                run.pose[part, :3],
                0.02 + 0.01 * run.pose[part, :2],
            )
    return Answer(
        "low_dim.hdf5", rate=20.0, right=anywhere(q=RAD, dq=("rad/s",)), texts=False, table=False
    )


@layout(UR, how="points")
def plotjuggler_two_rates(folder: Path, run: Run) -> Answer:
    """PlotJuggler's CSV of two topics: /joint_states, and the controller's state at a quarter of
    the rate, between its rows.
    """
    specs = "__time=epoch; *{}/position=q; *{}/velocity=dq; *{}/effort=tau".replace(
        "{}", "/joint_states/{}"
    )
    columns, right = wide(run, specs, run.arm.joints, **turns(run))
    form = "/scaled_joint_trajectory_controller/controller_state/reference/positions[{}]"
    slow = {form.format(j): run.q_ref[::4, j] for j in range(6)}
    also(right, "q_ref", form, range(6), RAD)
    both = pd.concat(
        [pd.DataFrame(columns), pd.DataFrame({"__time": EPOCH + run.t[::4] + 1.1e-3} | slow)]
    ).sort_values("__time")
    table(folder / "bag.csv", both[["__time", *sorted(set(both.columns) - {"__time"})]])
    return Answer("bag.csv", {"__time": "s"}, right=right)
