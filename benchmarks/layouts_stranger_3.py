"""Write motions as thirty recordings, each with its answer: fifteen ordinary ones, fifteen that
mislead.

The fourth stranger's: written down, with their answers, before any of them ran, by one who had not
read the importer or the layouts of the other sets.
"""

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
    anywhere,
    current,
    layout,
    recorded,
    si,
    stamps,
    state,
    table,
    values,
    wide,
)  # fmt: skip
from benchmarks.recorded_arm import FOUR, IIWA, LEG, SEVEN, SIX, THREE, TWO, UR, Arm, Run

turns = partial(layout, how="turns")
moves = partial(layout, how="points")
GANTRY = Arm("gantry", ("x_axis", "y_axis", "z_axis", "c_axis"), "XYZz", (400, 400, 300, 20))


# ---- ordinary ones


@layout(IIWA, rate=500.0)
def orocos_reporter(folder: Path, run: Run) -> Answer:
    """OROCOS OCL TextReporter: TimeStamp, then ports with the index in brackets, blanks; SI."""
    specs = (
        "TimeStamp=t; fri.CmdPosition[{}]=q_ref; *fri.MsrPosition[{}]=q; *fri.MsrVelocity[{}]=dq;"
    )
    specs += "*fri.MsrTorque[{}]=tau; fri.ExtTorque[{}]=ext"
    columns, right = wide(run, specs, joints=range(7))
    state(right, "fri.CmdPosition[{}]", range(7), "q_ref")
    table(folder / "reports.dat", columns, sep=" ", float_format="%.7g")
    return Answer("reports.dat", {"TimeStamp": "s"}, right=right)


@layout(LEG, rate=100.0)
def opensim_sto(folder: Path, run: Run) -> Answer:
    """OpenSim storage file: a head that ends with endheader, inDegrees=yes, tabs, moments in N
    m.
    """
    columns, right = wide(run, "time=t")
    for joint, k in (("hip", 0), ("knee", 1)):
        columns |= {
            f"{joint}_angle": np.degrees(run.q[:, k]),
            f"{joint}_speed": np.degrees(run.dq[:, k]),
        }
    columns |= {f"{joint}_moment": run.tau[:, k] for k, joint in enumerate(("hip", "knee"))}
    for role, word, unit in (
        ("q", "angle", "q°"),
        ("dq", "speed", "dq°"),
        ("tau", "moment", "tau"),
    ):
        right[role] = (Signal((f"hip_{word}", f"knee_{word}"), UNITS[unit]),)
    head = f"leg2_states\nversion=1\nnRows={len(run.t)}\nnColumns=7\ninDegrees=yes\nendheader\n"
    table(folder / "leg2.sto", columns, head, sep="\t", float_format="%.8f")
    return Answer("leg2.sto", {"time": "s"}, right=right)


@moves(SIX, rate=250.0)
def keba_scope(folder: Path, run: Run) -> Answer:
    """KEBA KeStudio scope: axis by axis setpoint and actual values, units in brackets, ms."""
    specs = "Time [ms]=ms; A{}.setPos [deg]=q_ref°; *A{}.actPos [deg]=q°; *A{}.actVel [deg/s]=dq°;"
    specs += "*A{}.actTrq [Nm]=tau; A{}.followErr [deg]=lag"
    lag = np.degrees(run.q_ref - run.q)
    columns, right = wide(run, specs, joint_wise=True, lag=lag)
    state(right, "A{}.setPos [deg]", range(1, 7), "q_ref°")
    table(folder / "scope.csv", columns, sep=";", float_format="%.6f")
    return Answer("scope.csv", {"Time [ms]": "ms"}, right=right)


@layout(SEVEN, rate=1000.0)
def arrow_utc(folder: Path, run: Run) -> Answer:
    """Write a pandas Parquet with a UTC time stamp and single precision; units behind the names."""
    specs = "utc=stamp; *q{}_rad=q; *qd{}_radps=dq; *tau{}_nm=tau; mode=3"
    columns, right = wide(run, specs, stamp=0)
    frame = pd.DataFrame(columns).astype({c: np.float32 for c in columns if c != "utc"})
    start = pd.Timestamp("2024-05-03 14:02:11.25", tz="UTC")
    frame["utc"] = start + pd.to_timedelta(values(run)["us"], unit="us")
    frame.to_parquet(folder / "run.parquet")
    return Answer("run.parquet", {"utc": "*"}, right=right)


@layout(UR, rate=125.0)
def struct_array(folder: Path, run: Run) -> Answer:
    """MATLAB: a structure array axis(1…6) with fields pos_deg, vel_degs, trq_Nm, and t beside
    it.
    """
    fields = ("name", "pos_deg", "vel_degs", "trq_Nm")
    axis = np.zeros((1, run.n), dtype=[(name, object) for name in fields])
    for j, name in enumerate(run.arm.joints):
        series = (np.degrees(run.q[:, [j]]), np.degrees(run.dq[:, [j]]), run.tau[:, [j]])
        axis[0, j] = (name, *series)
    savemat(folder / "axes.mat", {"t": run.t[:, None], "axis": axis, "operator": "mk"})
    right = anywhere(q=UNITS["q°"], dq=UNITS["dq°"], tau=UNITS["tau"])
    return Answer("axes.mat", right=right, texts=False)


@moves(THREE, rate=100.0)
def twenty_sim(folder: Path, run: Run) -> Answer:
    """20-sim's export of a plot: quoted names of the model, units in braces, tabs."""
    specs = (
        "time {s}=t; *Arm\\Joint{}\\phi {rad}=q; *Arm\\Joint{}\\omega {rad/s}=dq; *Arm\\Joint{}\\T "
        "{N.m}=tau"
    )
    columns, _ = wide(run, specs)
    table(folder / "arm.txt", columns, sep="\t", quoting=2, float_format="%.9g")
    right = anywhere(q=UNITS["q"], dq=UNITS["dq"], tau=(*UNITS["tau"], "N.m"))
    return Answer("arm.txt", right=right, texts=False)


@layout(FOUR, rate=200.0)
def julia_frame(folder: Path, run: Run) -> Answer:
    """Julia's RigidBodyDynamics by CSV.jl: q[1], v[1], τ[1]; a few cells are missing."""
    columns, right = wide(run, "t=t; *q[{}]=q; *v[{}]=dq; *τ[{}]=tau")
    frame = pd.DataFrame(columns).astype(object)
    dice = np.random.default_rng(len(run.t))
    for row in dice.choice(np.arange(50, len(frame) - 50, 10), 9, replace=False):
        frame.iloc[row, 9 + row % 4] = "missing"
    frame.to_csv(folder / "run.csv", index=False)
    return Answer("run.csv", {"t": "s"}, right=right)


@turns(SIX, rate=125.0)
def psql_listing(folder: Path, run: Run) -> Answer:
    """PostgreSQL's psql -o: names between bars, a line of dashes, the count of rows below."""
    columns, right = wide(run, "t_ms=ms; *pos_rad_{}=q; *vel_rads_{}=dq; *torque_nm_{}=tau")
    cells = [[f"{x:.6f}" if isinstance(x, float) else str(x) for x in v] for v in columns.values()]
    widths = [
        max(len(name), *map(len, column)) for name, column in zip(columns, cells, strict=True)
    ]
    lines = [" | ".join(f"{name:^{w}}" for name, w in zip(columns, widths, strict=True))]
    lines += ["-+-".join("-" * w for w in widths)]
    lines += [
        " | ".join(f"{x:>{w}}" for x, w in zip(row, widths, strict=True))
        for row in zip(*cells, strict=True)
    ]
    text = "\n".join(f" {line}" if k != 1 else f"-{line}-" for k, line in enumerate(lines))
    (folder / "listing.txt").write_text(f"{text}\n({len(run.t)} rows)\n\n")
    return Answer("listing.txt", {"t_ms": "ms"}, right=right)


@layout(UR, rate=100.0)
def netcdf_xarray(folder: Path, run: Run) -> Answer:
    """xarray's to_netcdf: (time, joint) arrays, a coordinate `joint` that names the columns in
    another order.
    """
    order = np.argsort(run.arm.joints)
    with h5py.File(folder / "run.nc", "w") as file:
        time = file.create_dataset("time", data=values(run)["us"])
        time.attrs["units"] = "microseconds since 2024-05-03 14:02:11.250000"
        time.make_scale("time")
        joint = file.create_dataset(
            "joint", data=np.array(run.arm.joints, object)[order], dtype=h5py.string_dtype()
        )
        joint.make_scale("joint")
        for name, v, unit in (
            ("position", run.q, "rad"),
            ("velocity", run.dq, "rad/s"),
            ("effort", run.tau, "N m"),
        ):
            data = file.create_dataset(name, data=v[:, order])
            data.attrs["units"] = unit
            data.dims[0].attach_scale(time)
            data.dims[1].attach_scale(joint)
    right = anywhere(q=UNITS["q"], dq=UNITS["dq"], tau=UNITS["tau"])
    return Answer("run.nc", right=right, texts=False)


@layout(FOUR, rate=50.0)
def long_channels(folder: Path, run: Run) -> Answer:
    """Write a bus logger's long format: time;channel;value;unit, one line a channel and sample."""
    lines = ["time;channel;value;unit"]
    kinds = (
        ("pos", np.degrees(run.q), "deg"),
        ("spd", np.degrees(run.dq), "deg/s"),
        ("trq", run.tau, "Nm"),
    )
    for k, t in enumerate(run.t):
        for j in range(run.n):
            lines += [
                f"{t:.3f};Joint{j + 1}.{name};{v[k, j]:.6f};{unit}" for name, v, unit in kinds
            ]
    (folder / "bus.csv").write_text("\n".join(lines) + "\n")
    right = anywhere(q=UNITS["q°"], dq=UNITS["dq°"], tau=UNITS["tau"])
    return Answer("bus.csv", {"time": "s"}, right=right, texts=False)


@moves(SIX, rate=200.0)
def polish_rig(folder: Path, run: Run) -> Answer:
    """Write a Polish rig in cp1250: położenie, prędkość, moment with units; decimal commas."""
    specs = (
        "Czas [s]=t; *Położenie osi {} [°]=q°; *Prędkość osi {} [°/s]=dq°; *Moment osi {} [Nm]=tau"
    )
    columns, right = wide(run, specs)
    how = {"sep": ";", "decimal": ",", "encoding": "cp1250", "float_format": "%.6f"}
    table(folder / "stanowisko.csv", columns, "Stanowisko badawcze nr 4\n", **how)
    return Answer("stanowisko.csv", {"Czas [s]": "s"}, right=right)


@layout(THREE, rate=1000.0)
def milli_names(folder: Path, run: Run) -> Answer:
    """Write a microcontroller's integers: t_us, pos1_mdeg, vel1_mdegs, trq1_mNm."""
    columns, right = wide(run, "t_us=us")
    for word, v, unit in (
        ("pos{}_mdeg", run.q, "mdeg"),
        ("vel{}_mdegs", run.dq, "mdeg/s"),
        ("trq{}_mNm", run.tau, "mN m"),
    ):
        scale = 1e3 if unit == "mN m" else np.degrees(1e3)
        columns |= {word.format(j + 1): np.round(v[:, j] * scale).astype(int) for j in range(3)}
        accepted = {"mdeg": ("mdeg",), "mdeg/s": ("mdeg/s",), "mN m": UNITS["mNm"]}[unit]
        role = {"mdeg": "q", "mdeg/s": "dq", "mN m": "tau"}[unit]
        right[role] = (Signal(tuple(word.format(j) for j in (1, 2, 3)), accepted),)
    table(folder / "mcu.csv", columns)
    return Answer("mcu.csv", {"t_us": "us"}, right=right)


@layout(UR, rate=200.0)
def isoformat_stamps(folder: Path, run: Run) -> Answer:
    """datetime.isoformat(): on whole seconds it writes no fraction; q0 …, qd0 …, tau0 … in SI."""
    columns, right = wide(run, "stamp=iso; *q{}=q; *qd{}=dq; *tau{}=tau", joints=range(6), iso=0)
    columns["iso"] = columns.pop("stamp")
    start = pd.Timestamp("2024-05-03 14:02:11.25")
    iso = [
        (start + pd.Timedelta(int(us), "us")).to_pydatetime().isoformat()
        for us in values(run)["us"]
    ]
    columns = {"stamp": iso} | {k: v for k, v in columns.items() if k != "iso"}
    table(folder / "run.csv", columns)
    return Answer("run.csv", {"stamp": "*"}, right=right)


@turns(SIX, rate=100.0)
def aubo_status(folder: Path, run: Run) -> Answer:
    """AUBO SDK's JointStatus: current in mA, motor's speed in rpm, position in rad, targets; no
    units.
    """
    gears = np.array([121, 121, 121, 101, 101, 101])
    more = {
        "mA": 1e3 * current(run),
        "rpm": np.round(run.dq * gears * 30 / np.pi),
        "mA*": 990 * current(run),
    }
    specs = (
        "time=t; jointCurrentI[{}]=mA; jointSpeedMoto[{}]=rpm; *jointPosJ[{}]=q; "
        "jointCurVol[{}]=48000;"
    )
    specs += "jointTgtCurrentI[{}]=mA*; jointTgtPosJ[{}]=q_ref"
    columns, right = wide(run, specs, joints=range(6), joint_wise=True, **more)
    state(right, "jointTgtPosJ[{}]", range(6), "q_ref")
    names = tuple(f"jointCurrentI[{j}]" for j in range(6))
    right["tau"] = right["current"] = (
        Signal(names, ("mA",)),
    )  # that it is mA stands in the manual alone
    right["dq"] = (
        Signal(tuple(f"jointSpeedMoto[{j}]" for j in range(6))),
    )  # the motor's: no unit alone makes it dq
    table(folder / "aubo.csv", columns, float_format="%.6f")
    return Answer("aubo.csv", {"time": "s"}, right=right, draftable=False)


@layout(TWO, rate=50.0)
def transposed_units(folder: Path, run: Run) -> Answer:
    """Write a line a signal: its name, its unit, then the numbers."""
    rows = [("t", "s", run.t)]
    for word, unit, v in (("q", "rad", run.q), ("qd", "rad/s", run.dq), ("tau", "Nm", run.tau)):
        rows += [(f"{word}{j + 1}", unit, v[:, j]) for j in range(2)]
    text = "\n".join(f"{name},{unit}," + ",".join(f"{x:.6f}" for x in v) for name, unit, v in rows)
    (folder / "rows.csv").write_text(text + "\n")
    right = {
        "q": (si("q{}", 2, "q"),),
        "dq": (si("qd{}", 2, "dq"),),
        "tau": (si("tau{}", 2, "tau"),),
    }
    return Answer("rows.csv", {"t": "s"}, right=right, texts=False)


# ---- hard ones


@layout(SIX, rate=250.0)
def gazebo_clocks(folder: Path, run: Run) -> Answer:
    """Gazebo at 0.63 of real time: real_time stands first, the motion follows sim_time."""
    dice = np.random.default_rng(len(run.t))
    real = 1714744931.25 + run.t / 0.63 + dice.uniform(0, 4e-4, len(run.t))
    specs = (
        "real_time=real; sim_time=sim; *joint_{}.position=q; *joint_{}.velocity=dq; "
        "*joint_{}.effort=tau"
    )
    how = {"data": {"real": real, "sim": 41.2 + run.t}, "joint_wise": True}
    return recorded(folder, run, "gazebo.csv", {"sim_time": "s"}, specs, **how)


@layout(FOUR, rate=100.0)
def dynamixel_effort(folder: Path, run: Run) -> Answer:
    """dynamixel_workbench's joint states: effort is the present current in mA, whatever ROS
    says.
    """
    specs = "Time=clock; *position.joint{}=q; *velocity.joint{}=dq; effort.joint{}=mA"
    more = {"clock": 1714744931.25 + run.t, "mA": np.round(1e3 * current(run) / 2.69) * 2.69}
    columns, right = wide(run, specs, **more)
    names = tuple(f"effort.joint{j}" for j in range(1, 5))
    right["tau"] = right["current"] = (Signal(names),)
    table(folder / "joint_states.csv", columns)
    return Answer("joint_states.csv", {"Time": "s"}, right=right, draftable=False)


@layout(UR, rate=125.0)
def wrist_sensor(folder: Path, run: Run) -> Answer:
    """Six positions beside the six channels of a force-torque sensor at the flange: no joint
    torque.
    """
    w = run.tau[:, [1, 2, 3, 3, 4, 5]] * np.array([0.3, 0.2, 1.0, 0.4, 0.3, 0.5])
    specs = "t=t; *actual_q_{} [deg]=q°; *actual_qd_{} [deg/s]=dq°; ft_{}=w"
    return recorded(folder, run, "contact.csv", {"t": "s"}, specs, known=False, data={"w": w})


@moves(GANTRY, rate=200.0)
def gantry_cell(folder: Path, run: Run) -> Answer:
    """Write a gantry of three slides and a turning head, German: X, Y, Z in mm and N, C in ° and
    Nm.
    """
    scale = np.array([1e3, 1e3, 1e3, np.degrees(1.0)])
    columns: dict = {"Zeit [s]": run.t}
    for j, axis in enumerate("XYZC"):
        unit, force = ("°", "Moment [Nm]") if axis == "C" else ("mm", "Kraft [N]")
        columns |= {
            f"{axis} soll [{unit}]": run.q_ref[:, j] * scale[j],
            f"{axis} ist [{unit}]": run.q[:, j] * scale[j],
        }
        columns[f"{axis} {force}"] = run.tau[:, j]
    units = tuple(f"mm,mm,mm,{u}" for u in ("deg", "°"))
    right = {
        r: (Signal(tuple(c for c in columns if w in c), units),)
        for r, w in (("q", " ist "), ("q_ref", " soll "))
    }
    torques = tuple(c for c in columns if "Kraft" in c or "Moment" in c)
    right["tau"] = (Signal(torques, ("N,N,N,N m", "N,N,N,Nm")),)
    table(folder / "portal.csv", columns, sep=";", decimal=",", float_format="%.6f")
    return Answer("portal.csv", {"Zeit [s]": "s"}, right=right)


@layout(TWO, rate=4000.0)
def every_fourth_cycle(folder: Path, run: Run) -> Answer:
    """Write a drive's trace without a clock: servo cycle 62.5 us, of which every fourth is
    recorded.
    """
    columns, right = wide(run, "*q{} [rad]=q; *dq{} [rad/s]=dq; *tau{} [Nm]=tau")
    head = "# servo cycle: 62.5 us\n# recorded: every 4th cycle\n"
    table(folder / "trace.csv", columns, head, float_format="%.7f")
    return Answer("trace.csv", rate=4000.0, right=right)


@layout(SEVEN, rate=200.0)
def track_zero(folder: Path, run: Run) -> Answer:
    """Write an arm on a track that is not in its description: axis 0 is the track in mm, 1 to 7 the
    arm.
    """
    columns, right = wide(run, "t=t; *q{}=q; *dq{}=dq; *tau{}=tau")
    more = {
        "q0": 500 + 400 * np.sin(0.3 * run.t),
        "dq0": 120 * np.cos(0.3 * run.t),
        "tau0": 30 * np.sign(np.cos(0.3 * run.t)),
    }
    order = ["t", *(f"{w}{j}" for w in ("q", "dq", "tau") for j in range(8))]
    table(
        folder / "track.csv", {name: (columns | more)[name] for name in order}, float_format="%.6f"
    )
    return Answer("track.csv", {"t": "s"}, right=right)


@layout(SIX, rate=200.0)
def stale_comment(folder: Path, run: Run) -> Answer:
    """Write a comment of an earlier version says degrees; positions are in rad, as their rates
    [rad/s] show.
    """
    columns, right = wide(run, "t=t; *q{}=q; *qd{} [rad/s]=dq; *tau{} [Nm]=tau")
    table(
        folder / "run.csv",
        columns,
        "# joint log v2\n# joint angles q1..q6 in deg\n",
        float_format="%.6f",
    )
    return Answer("run.csv", {"t": "s"}, right=right)


@moves(SIX, rate=125.0)
def fanuc_coupled(folder: Path, run: Run) -> Answer:
    """FANUC: J3 is shown against the horizontal, so that it moves with J2; a comment says it."""
    shown = run.q.copy()
    shown[:, 2] += shown[:, 1]
    columns, right = wide(
        run, "Time[s]=t; *J{}[deg]=shown:q°; *T{}[Nm]=tau", shown=np.degrees(shown)
    )
    head = "# J3 is measured against the horizontal, not against link 2 (J2/J3 interaction)\n"
    table(folder / "fanuc.csv", columns, head, float_format="%.5f")
    return Answer("fanuc.csv", {"Time[s]": "s"}, right=right, draftable=False)


@layout(THREE, rate=200.0)
def american_units(folder: Path, run: Run) -> Answer:
    """Write an American test stand: deg, rpm of the joint, inch-pounds."""
    more = {"rpm": run.dq * 30 / np.pi, "inlb": run.tau / 0.1129848290276167}
    specs = "Time (sec)=t; *Position {} (deg)=q°; *Speed {} (rpm)=rpm:rpm; Torque {} (in-lb)=inlb"
    columns, right = wide(run, specs, **more)
    right["dq"] = right.pop("rpm")
    names = tuple(f"Torque {j} (in-lb)" for j in (1, 2, 3))
    right["tau"] = (Signal(names, ("lbf in", "in lbf", "in lb", "lb in", "in-lb", "lbf*in")),)
    table(folder / "stand.csv", columns, float_format="%.6f")
    return Answer("stand.csv", {"Time (sec)": "s"}, right=right)


@layout(SIX, rate=250.0)
def group_header(folder: Path, run: Run) -> Answer:
    """Three rows of head: Command, Feedback, Torque over six columns each; J1 to J6 below;
    units.
    """
    blank = [""] * 5
    rows = [["", "Command", *blank, "Feedback", *blank, "Torque", *blank]]
    rows += [
        [
            "Time",
            *(f"J{j}" for j in range(1, 7)),
            *(f"J{j}" for j in range(1, 7)),
            *(f"J{j}" for j in range(1, 7)),
        ]
    ]
    rows += [["s", *["deg"] * 12, *["Nm"] * 6]]
    head = "\n".join(",".join(row) for row in rows) + "\n"
    columns, _ = wide(run, "t=t; a{}=q_ref°; b{}=q°; c{}=tau")
    table(folder / "bench.csv", columns, head, header=False, float_format="%.6f")
    right = anywhere(q=UNITS["q°"], q_ref=UNITS["q°"], tau=UNITS["tau"])
    return Answer("bench.csv", right=right, texts=False)


@moves(SIX, rate=50.0)
def coarse_clock(folder: Path, run: Run) -> Answer:
    """Write a PLC's log: a counter, and a time of day in whole seconds; fifty rows share each."""
    specs = "Nr=nr; Uhrzeit=clock; *Achse {} Istwinkel [°]=q°; *Achse {} Drehmoment [Nm]=tau"
    more = {"nr": np.arange(1, len(run.t) + 1), "clock": stamps(run, "%H:%M:%S")}
    columns, right = wide(run, specs, **more)
    table(folder / "sps.csv", columns, sep=";", float_format="%.5f")
    return Answer("sps.csv", {"Nr": "sample", "Uhrzeit": "*"}, rate=50.0, right=right)


@layout(FOUR, rate=50.0)
def datenum_script(folder: Path, run: Run) -> Answer:
    """Write a MATLAB script's now(): days since year 0 beside q, qd, tau in SI, by writetable."""
    columns, right = wide(run, "datenum=days; *q_{}=q; *qd_{}=dq; *tau_{}=tau", days=0)
    columns["datenum"] = [f"{739375.5848524306 + t / 86400:.9f}" for t in run.t]
    table(folder / "run.csv", columns, float_format="%.6f")
    return Answer("run.csv", {"datenum": "d"}, right=right)


@layout(SIX, rate=100.0)
def two_blocks(folder: Path, run: Run) -> Answer:
    """Write a panel's export of two plots: positions with their time, a blank line, torques with
    theirs.
    """
    first, right = wide(run, "Time [s]=t; *q{} [deg]=q°; *tau{} [Nm]=tau")
    positions = {name: v for name, v in first.items() if "tau" not in name}
    torques = {name: v for name, v in first.items() if "deg" not in name}
    text = pd.DataFrame(positions).to_csv(index=False, float_format="%.6f")
    (folder / "plots.csv").write_text(
        f"{text}\n{pd.DataFrame(torques).to_csv(index=False, float_format='%.6f')}"
    )
    return Answer("plots.csv", {"Time [s]": "s"}, right=right, table=False)


@layout(SIX, rate=500.0)
def motor_torque(folder: Path, run: Run) -> Answer:
    """Write encoders behind the gear in deg, torques of the motors before it in N m; no ratio
    anywhere.
    """
    ratio = np.array([121, 121, 101, 101, 80, 80])
    specs = "t [s]=t; *link encoder {} [deg]=q°; *motor torque {} [Nm]=m:tau"
    return recorded(
        folder, run, "drives.csv", {"t [s]": "s"}, specs, known=False, data={"m": run.tau / ratio}
    )


@turns(SIX, rate=200.0)
def piper_raw(folder: Path, run: Run) -> Answer:
    """AgileX Piper's messages: integers of 0.001 deg, 0.001 rad/s, 0.001 N m; no unit anywhere."""
    columns, right = wide(run, "timestamp=clock; mode=1", clock=1714744931.25 + run.t)
    parts = (
        ("joint_state.joint_{}", "q", np.degrees(run.q), ("mdeg",)),
        ("motor_{}.motor_speed", "dq", run.dq, ("mrad/s",)),
    )
    for form, role, v, unit in (*parts, ("motor_{}.effort", "tau", run.tau, UNITS["mNm"])):
        columns |= {form.format(j + 1): np.round(1e3 * v[:, j]).astype(int) for j in range(6)}
        right[role] = (Signal(tuple(form.format(j) for j in range(1, 7)), unit),)
    table(folder / "piper.csv", columns)
    return Answer("piper.csv", {"timestamp": "s"}, right=right)
