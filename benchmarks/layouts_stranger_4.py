"""Write motions as thirty recordings, each with its answer: ordinary ones, usual laboratory
practice, hard ones.

The fifth stranger's: written down, with their answers, before any of them ran, by one who had not
read the importer or the layouts of the other sets.
"""

import json
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import h5py
import numpy as np
import pandas as pd
from scipy.signal import butter, lfilter

from benchmarks.import_layouts import (
    DEG,
    UNITS,
    Answer,
    Signal,
    anywhere,
    current,
    layout,
    names,
    recorded,
    state,
    table,
    values,
    wide,
)  # fmt: skip
from benchmarks.recorded_arm import (
    FOUR,
    IIWA,
    LEG,
    LIFT,
    SCARA,
    SEVEN,
    SIX,
    THREE,
    TWO,
    UR,
    Arm,
    Run,
)

DIGGER = Arm("excavator", ("swing", "boom", "stick", "bucket"), "zyyy", (300, 300, 150, 60))
TEMPERATURE = ("degC", "C", "°C", "deg C")


def percent(run: Run) -> np.ndarray:
    """Torque in per cent of a rated torque that no file states."""
    return 100 * run.tau / (np.array(run.arm.effort) * 0.37)


def lines(path: Path, rows: list[str], encoding: str = "utf-8") -> None:
    path.write_text("\n".join(rows) + "\n", encoding=encoding)


# ---- ordinary ones


@layout(IIWA)
def drake_iiwa_lcm(folder: Path, run: Run) -> Answer:
    """Drake's lcmt_iiwa_status as CSV: utime, joint_position_measured_0 …, commanded, ipo,
    external; SI.
    """
    specs = (
        "utime=us; *joint_position_measured_{}=q; *joint_position_commanded_{}=q_ref; "
        "joint_position_ipo_{}=ipo;"
    )
    specs += (
        "*joint_velocity_estimated_{}=dq; *joint_torque_measured_{}=tau; "
        "joint_torque_commanded_{}=tau_ref;"
    )
    specs += "joint_torque_external_{}=ext"
    columns, right = wide(run, specs, range(7), ipo=run.q + 0.8 * (run.q_ref - run.q))
    ipo = Signal(
        names("joint_position_ipo_{}", 7, 0),
        UNITS["q"],
        columns_of(columns, "joint_position_ipo_", 7),
    )
    right["q_ref"] += (ipo,)
    table(folder / "iiwa_status.csv", columns)
    return Answer("iiwa_status.csv", {"utime": "us"}, right=right)


def columns_of(columns: dict, start: str, n: int) -> np.ndarray:
    """Return the columns that are called `start` and a number from 0."""
    return np.column_stack([columns[f"{start}{j}"] for j in range(n)])


@layout(SEVEN, rate=1000.0, how="points")
def rokae_states(folder: Path, run: Run) -> Answer:
    """Rokae xCore SDK's real-time states: jointPos_m (measured) and _c (commanded), tauVel_m is the
    torque's rate.
    """
    specs = (
        "ts_ms=ms; *jointPos_m[{}]=q; *jointPos_c[{}]=q_ref; *jointVel_m[{}]=dq; "
        "*jointVel_c[{}]=dq_ref;"
    )
    specs += "*tau_m[{}]=tau; tau_c[{}]=tau_ref; tauVel_m[{}]=rate"
    rate = np.gradient(run.tau, run.t, axis=0)
    return recorded(
        folder, run, "rt_state.csv", {"ts_ms": "ms"}, specs, range(7), data={"rate": rate}
    )


@layout(FOUR, rate=500.0, how="points")
def simscape_export(folder: Path, run: Run) -> Answer:
    """Simscape Multibody's simlog as a table: Revolute_1.Rz.q (deg), .w (deg/s), .b (deg/s^2), .t
    (N*m).
    """
    specs = "Time (s)=t; *Revolute_{}.Rz.q (deg)=q°; *Revolute_{}.Rz.w (deg/s)=dq°;"
    specs += "Revolute_{}.Rz.b (deg/s^2)=acc; *Revolute_{}.Rz.t (N*m)=tau"
    data = {"acc": np.degrees(run.ddq)}
    return recorded(
        folder, run, "simlog.csv", {"Time (s)": "s"}, specs, joint_wise=True, data=data, sep="\t"
    )


@layout(SIX, rate=500.0)
def mujoco_script(folder: Path, run: Run) -> Answer:
    """Write a MuJoCo loop's CSV: qpos_0 …, qvel, qacc, ctrl of position servos, actuator_force,
    qfrc_bias, qfrc_passive.
    """
    specs = "time=t; *qpos_{}=q; *qvel_{}=dq; qacc_{}=ddq; *ctrl_{}=q_ref; *actuator_force_{}=tau;"
    specs += "qfrc_bias_{}=bias; qfrc_passive_{}=passive"
    data = {"bias": run.tau_model, "passive": run.tau_model - run.tau_ref}
    return recorded(folder, run, "rollout.csv", {"time": "s"}, specs, range(6), data=data)


@layout(TWO, rate=600.0)
def catman_ascii(folder: Path, run: Run) -> Answer:
    """HBM catman's ASCII export, German: a preamble, tabs, decimal commas, torque transducers; no
    velocity.
    """
    specs = (
        "Zeit 1 - schnelle Messrate [s]=t; *Winkel_{} [°]=q°; *Drehmoment_{} [Nm]=tau; "
        "Temperatur_Öl [°C]=oil"
    )
    head = (
        "HBM_CATMAN_DATAFILE_40\nDatum:\t03.05.2024 14:02:11\nKommentar:\tDoppelpendel, Lauf 7\n"
        "Prüfer:\tMs\n"
    )
    head += f"Anzahl Kanäle:\t6\nMaximale Kanallänge:\t{len(run.t)}\n\n"
    how = {"head": head, "sep": "\t", "decimal": ",", "float_format": "%.6f", "encoding": "cp1252"}
    how["data"] = {"oil": 31.5 + 0.1 * run.t}
    return recorded(folder, run, "lauf7.asc", {"Zeit 1 - schnelle Messrate [s]": "s"}, specs, **how)


@layout(SCARA, rate=281.25, how="points")
def melfa_oscillograph(folder: Path, run: Run) -> Answer:
    """Mitsubishi RT ToolBox oscillograph of an RH SCARA: deg, J3 in mm, currents in % of the rated
    one.
    """
    columns: dict = {"Time [msec]": 1e3 * run.t}
    scale = np.where([a.isupper() for a in run.arm.axes], 1e3, 180 / np.pi)
    parts = (
        ("Position command", run.q_ref * scale),
        ("Position feedback", run.q * scale),
        ("Current feedback", percent(run)),
    )
    for j in range(4):
        for word, v in parts:
            unit = "%" if "Current" in word else ("deg", "deg", "mm", "deg")[j]
            columns[f"J{j + 1} {word} [{unit}]"] = v[:, j]
    right = {}
    for role, word in (("q_ref", "Position command"), ("q", "Position feedback")):
        right[role] = (Signal(names(f"J{{}} {word}", 4), ("deg,deg,mm,deg",)),)
    state(right, "J{} Current feedback", range(1, 5), "current:?")
    table(folder / "osc.csv", columns, float_format="%.4f")
    return Answer("osc.csv", {"Time [msec]": "*"}, right=right)


@layout(THREE, None, rate=4000.0, how="points")
def rexroth_scope(folder: Path, run: Run) -> Answer:
    """IndraWorks oscilloscope: Sercos numbers, time from before the trigger, Deg, Rpm of the axis,
    % of rated torque.
    """
    specs = "Time [ms]=pre; *Axis{} S-0-0047 Position command value [Deg]=q_ref°;"
    specs += (
        "*Axis{} S-0-0051 Position feedback value 1 [Deg]=q°; *Axis{} S-0-0040 Velocity feedback "
        "value [Rpm]=rpm:dq:rpm;"
    )
    specs += "*Axis{} S-0-0084 Torque/force feedback value [%]=load:current:?"
    data = {"pre": 1e3 * run.t - 1000.0, "rpm": run.dq * 30 / np.pi, "load": percent(run)}
    head = (
        "IndraWorks oscilloscope\nDate;03.05.2024\nTrigger;Axis1 S-0-0047;rising\nTime resolution;"
        "250 us\n\n"
    )
    how = {"head": head, "sep": ";", "float_format": "%.5f"}
    return recorded(
        folder, run, "osci.csv", {"Time [ms]": "ms"}, specs, joint_wise=True, data=data, **how
    )


@layout(SIX, rate=50.0)
def indy_control_states(folder: Path, run: Run) -> Answer:
    """Neuromeka IndyDCP3's control states as JSON lines: q, qdot, qdes in deg, tau commanded,
    tau_act; Unix time.
    """
    parts = {"q": np.degrees(run.q), "qdot": np.degrees(run.dq), "qddot": np.degrees(run.ddq)}
    parts |= {"qdes": np.degrees(run.q_ref), "qdotdes": np.degrees(run.dq_ref), "tau": run.tau_ref}
    parts |= {"tau_act": run.tau, "tau_ext": run.tau_ext}
    rows = []
    for k, t in enumerate(run.t):
        row = {"time": round(1714744931.25 + t, 6), "op_state": 6}
        rows.append(
            json.dumps(row | {name: np.round(v[k], 6).tolist() for name, v in parts.items()})
        )
    lines(folder / "states.jsonl", rows)
    right = anywhere(q=DEG, dq=UNITS["dq°"], q_ref=DEG, dq_ref=UNITS["dq°"], tau=UNITS["tau"])
    return Answer("states.jsonl", right=right, texts=False)


@layout(SIX, None, rate=100.0)
def turkish_rig(folder: Path, run: Run) -> Answer:
    """Write a Turkish rig in cp1254: Zaman, Referans Konum before Konum, Hız, Tork; decimal commas,
    units in brackets.
    """
    specs = (
        "Zaman (ms)=ms; *Eklem {} Referans Konum (°)=q_ref°; *Eklem {} Konum (°)=q°; *Eklem {} Hız "
        "(°/s)=dq°;"
    )
    specs += "*Eklem {} Tork (Nm)=tau"
    how = {"sep": ";", "decimal": ",", "float_format": "%.5f", "encoding": "cp1254"}
    return recorded(folder, run, "kayit.csv", {"Zaman (ms)": "ms"}, specs, **how)


# ---- usual laboratory practice


@layout(UR, rate=125.0)
def swedish_log(folder: Path, run: Run) -> Answer:
    """Write a Swedish log in cp1252: dates with a comma before the ms, börvärde and ärvärde in
    grader, moment.
    """
    specs = (
        "Tid=stamp; *Axel {} börvärde [grader]=q_ref°; *Axel {} ärvärde [grader]=q°; *Axel {} "
        "hastighet [grader/s]=dq°;"
    )
    specs += "*Axel {} moment [Nm]=tau"
    times = pd.Timestamp("2024-05-03 14:02:11.256") + pd.to_timedelta(values(run)["ms"], unit="ms")
    stamp = np.array([f"{s:%Y-%m-%d %H:%M:%S},{s.microsecond // 1000:03d}" for s in times])
    columns, right = wide(run, specs, joint_wise=True, stamp=stamp)
    for role, spelling in (("q", "grader"), ("q_ref", "grader"), ("dq", "grader/s")):
        right[role] = (Signal(right[role][0].columns, (*right[role][0].units, spelling)),)
    table(
        folder / "logg.txt", columns, sep=";", decimal=",", float_format="%.6f", encoding="cp1252"
    )
    return Answer("logg.txt", {"Tid": "*"}, right=right)


@layout(LEG, rate=50.0)
def serial_plotter(folder: Path, run: Run) -> Answer:
    """Write an Arduino's output for the Serial Plotter, label:value by commas: ms, deg, set points,
    currents in mA; no unit.
    """
    specs = "ms=ms; *ang{}=q°; *set{}=q_ref°; *cur{}=ma:current:?"
    columns, right = wide(run, specs, ma=np.round(1e3 * current(run)))
    frame = pd.DataFrame(columns)
    rows = [
        ",".join(f"{name}:{v:g}" for name, v in row.items())
        for row in frame.round(2).to_dict("records")
    ]
    lines(folder / "serial.txt", rows)
    return Answer("serial.txt", {"ms": "ms"}, right=right)


@layout(UR, rate=250.0)
def matlab_h5write(folder: Path, run: Run) -> Answer:
    """MATLAB's h5write of N x 6 matrices: as other programs see them, 6 x N; t is 1 x N; SI, no
    attributes.
    """
    with h5py.File(folder / "run.h5", "w") as file:
        file["t"] = run.t[None, :]
        for name, v in (("q", run.q), ("qd", run.dq), ("q_des", run.q_ref), ("tau_meas", run.tau)):
            file[name] = v.T
    right = anywhere(q=UNITS["q"], dq=UNITS["dq"], q_ref=UNITS["q"], tau=UNITS["tau"])
    return Answer("run.h5", right=right, texts=False)


@layout(THREE, "arm.toml", rate=500.0)
def raw_and_filtered(folder: Path, run: Run) -> Answer:
    """Write a thesis' table: q1_raw, q1_filt …, tau1_raw, tau1_filt …: filtered causally, torques
    by a slower filter.
    """
    slow, fast = butter(2, 5, fs=500.0), butter(2, 40, fs=500.0)
    data = {"qf": lfilter(*fast, run.q, axis=0), "tf": lfilter(*slow, run.tau, axis=0)}
    specs = "time_s=t; *q{}_raw=q; q{}_filt=qf; *tau{}_raw=tau; tau{}_filt=tf"
    return recorded(folder, run, "exp3.csv", {"time_s": "s"}, specs, joint_wise=True, data=data)


@layout(THREE, rate=100.0)
def terminal_stamps(folder: Path, run: Run) -> Answer:
    """Write a terminal program's capture with its own stamps before the firmware's line: pos in
    deg, trq in N m, no unit.
    """
    start, rows = pd.Timestamp("2024-05-03 14:02:11.250"), []
    for t, q, tau in zip(run.t, np.degrees(run.q), run.tau, strict=True):
        stamp = f"{start + pd.to_timedelta(round(t * 1e3), unit='ms'):%Y-%m-%d %H:%M:%S.%f}"[:-3]
        rows.append(
            f"[{stamp}] pos "
            + " ".join(f"{x:.3f}" for x in q)
            + " trq "
            + " ".join(f"{x:.3f}" for x in tau)
        )
    lines(folder / "capture.log", rows)
    return Answer("capture.log", right=anywhere(q=DEG, tau=UNITS["tau"]), texts=False)


@layout(SIX, None, rate=100.0, how="points")
def twelve_hours(folder: Path, run: Run) -> Answer:
    """Write a .NET logger in the USA: 5/3/2024 12:59:55.250 PM, then 1:00:00.000 PM; deg, Nm, case
    temperatures.
    """
    times = pd.Timestamp("2024-05-03 12:59:55.250") + pd.to_timedelta(values(run)["ms"], unit="ms")
    stamp = [
        f"{s.month}/{s.day}/{s.year} {(s.hour - 1) % 12 + 1}:{s:%M:%S}.{s.microsecond // 1000:03d} "
        "PM"
        for s in times
    ]
    specs = "Timestamp=stamp; *J{} Angle (deg)=q°; *J{} Torque (Nm)=tau; J{} Temp (C)=temp"
    columns, right = wide(run, specs, stamp=np.array(stamp))
    right["temperature"] = (Signal(names("J{} Temp (C)", 6), TEMPERATURE),)
    table(folder / "log.csv", columns, float_format="%.5f")
    return Answer("log.csv", {"Timestamp": "*"}, right=right)


def workbook(path: Path, frame: pd.DataFrame) -> None:
    """Write a table as the least that Excel opens."""
    main, office = "spreadsheetml/2006/main", "officeDocument/2006/relationships"
    base, package = "http://schemas.openxmlformats.org", "package/2006"
    head = "".join(f'<c t="inlineStr"><is><t>{name}</t></is></c>' for name in frame)
    body = "".join(
        "<row>" + "".join(f"<c><v>{x:.6f}</v></c>" for x in row) + "</row>"
        for row in frame.to_numpy()
    )
    kind = "application/vnd.openxmlformats-officedocument.spreadsheetml"
    parts = {
        "[Content_Types].xml": f'<Types xmlns="{base}/{package}/content-types">'
        '<Default Extension="rels" ContentType='
        '"application/vnd.openxmlformats-package.relationships+xml"/>'
        '<Override PartName="/xl/workbook.xml" ContentType='
        f'"{kind}.sheet.main+xml"/>'
        '<Override PartName="/xl/worksheets/sheet1.xml" ContentType='
        f'"{kind}.worksheet+xml"/></Types>',
        "_rels/.rels": f'<Relationships xmlns="{base}/{package}/relationships">'
        '<Relationship Id="rId1" '
        f'Type="{base}/{office}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        "xl/workbook.xml": f'<workbook xmlns="{base}/{main}" xmlns:r="{base}/{office}"><sheets>'
        '<sheet name="Tabelle1" sheetId="1" r:id="rId1"/></sheets></workbook>',
        "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{base}/{package}/relationships">'
        '<Relationship Id="rId1" '
        f'Type="{base}/{office}/worksheet" Target="worksheets/sheet1.xml"/></Relationships>',
        "xl/worksheets/sheet1.xml": (
            "<worksheet "
            f'xmlns="{base}/{main}"><sheetData><row>{head}</row>{body}</sheetData></worksheet>'
        ),
    }
    with ZipFile(path, "w", ZIP_DEFLATED) as file:
        for name, text in parts.items():
            file.writestr(name, '<?xml version="1.0" encoding="UTF-8"?>' + text)


@layout(THREE, rate=100.0)
def excel_workbook(folder: Path, run: Run) -> Answer:
    """Write an Excel workbook itself: a refusal that says so is right."""
    columns, _ = wide(run, "t [s]=t; q{} [deg]=q°; tau{} [Nm]=tau")
    workbook(folder / "messung.xlsx", pd.DataFrame(columns))
    return Answer("messung.xlsx", table=False, draftable=False)


@layout(UR, rate=125.0)
def json_sorted_names(folder: Path, run: Run) -> Answer:
    """json.dump(sort_keys=True) of a dictionary by joint name, units and rate_hz apart, no
    times.
    """
    joints = {}
    for j, name in enumerate(run.arm.joints):
        joints[name] = {
            "pos": run.q[:, j].tolist(),
            "torque": run.tau[:, j].tolist(),
            "vel": run.dq[:, j].tolist(),
        }
    data = {"joints": joints, "rate_hz": 125.0, "robot": "ur5", "started": "2024-05-03T14:02:11Z"}
    data["units"] = {"pos": "rad", "torque": "Nm", "vel": "rad/s"}
    (folder / "trial_04.json").write_text(json.dumps(data, sort_keys=True, indent=1))
    right = anywhere(q=UNITS["q"], dq=UNITS["dq"], tau=UNITS["tau"])
    return Answer("trial_04.json", rate=125.0, right=right, texts=False)


@layout(FOUR, rate=100.0)
def excel_serial_days(folder: Path, run: Run) -> Answer:
    """Write a VBA logger: Now() in days since 1900 with all digits; angles in deg by the header,
    torques in Nm.
    """
    specs = "Date/Time=days; *Joint {} (deg)=q°; *Torque {} (Nm)=tau"
    data = {"days": 45415.5848524 + run.t / 86400}
    return recorded(
        folder, run, "vba.csv", {"Date/Time": "*"}, specs, data=data, float_format="%.11f"
    )


@layout(THREE, rate=1000.0)
def halsampler(folder: Path, run: Run) -> Answer:
    """LinuxCNC's halsampler -t: sample number, pos-cmd, pos-fb in deg and torque in %; no header,
    no clock.
    """
    rows = np.column_stack(
        [np.arange(len(run.t)), np.degrees(run.q_ref), np.degrees(run.q), percent(run)]
    )
    lines(
        folder / "samples.txt",
        [f"{row[0]:.0f} " + " ".join(f"{x:.6f}" for x in row[1:]) for row in rows],
    )
    right: dict = {
        "q_ref": (Signal(names("column_{}", 3, 2), DEG),),
        "q": (Signal(names("column_{}", 3, 5), DEG),),
    }
    right |= {role: (Signal(names("column_{}", 3, 8), ("%",)),) for role in ("tau", "current")}
    return Answer("samples.txt", {"column_1": "sample"}, right=right, draftable=False)


@layout(LIFT, rate=100.0)
def openmodelica_lift(folder: Path, run: Run) -> Answer:
    """OpenModelica's CSV: states, der(…), then the rest; lift_joint.s and .f in m and N,
    joint_1.phi and .tau.
    """
    kinds = [("s", "v", "f") if a.isupper() else ("phi", "w", "tau") for a in run.arm.axes]
    joints = list(zip(run.arm.joints, kinds, strict=True))
    columns: dict = {"time": run.t}
    for k, v in ((0, run.q), (1, run.dq)):
        columns |= {f"{joint}.{kind[k]}": v[:, j] for j, (joint, kind) in enumerate(joints)}
    for k, v in ((0, run.dq), (1, run.ddq)):
        columns |= {f"der({joint}.{kind[k]})": v[:, j] for j, (joint, kind) in enumerate(joints)}
    columns |= {f"{joint}.{kind[2]}": run.tau[:, j] for j, (joint, kind) in enumerate(joints)}
    told = [tuple(f"{joint}.{kind[k]}" for joint, kind in joints) for k in range(3)]
    slopes = tuple(f"der({name})" for name in told[0])
    speeds = ("m/s,rad/s,rad/s,rad/s",)
    right = {
        "q": (Signal(told[0], ("m,rad,rad,rad",)),),
        "tau": (Signal(told[2], ("N,N m,N m,N m",)),),
    }
    right["dq"] = (Signal(told[1], speeds), Signal(slopes, speeds))
    table(folder / "Lift_res.csv", columns, quoting=2)
    return Answer("Lift_res.csv", {"time": "s"}, right=right)


# ---- hard ones


@layout(SIX, rate=250.0)
def tia_trace(folder: Path, run: Run) -> Answer:
    """TIA Portal trace of technology objects: .Position is the set point, .ActualPosition the
    encoder's; no units.
    """
    specs = (
        "Time (ms)=ms; *Axis_{}.Position=q_ref°; *Axis_{}.ActualPosition=q°; "
        "*Axis_{}.Velocity=dq_ref°;"
    )
    specs += "*Axis_{}.ActualVelocity=dq°; *Axis_{}.StatusTorqueData.ActualTorque=tau"
    how = {"sep": ";", "float_format": "%.5f"}
    return recorded(folder, run, "trace.csv", {"Time (ms)": "ms"}, specs, joint_wise=True, **how)


@layout(FOUR, rate=100.0, how="points")
def rockwell_trend(folder: Path, run: Run) -> Answer:
    """Studio 5000 trend: lines of key and value, Header: and Data in the first column,
    14:02:11;250; torque in %.
    """
    specs = (
        "Date=stamp; Time=clock; *Axis{}.CommandPosition=q_ref°; *Axis{}.ActualPosition=q°; "
        "*Axis{}.ActualVelocity=dq°;"
    )
    specs += "*Axis{}.TorqueReference=load:current:?"
    times = pd.Timestamp("2024-05-03 14:02:11.250") + pd.to_timedelta(values(run)["ms"], unit="ms")
    clock = np.array([f"{s:%H:%M:%S};{s.microsecond // 1000:03d}" for s in times])
    columns, right = wide(run, specs, stamp="05/03/2024", clock=clock, load=percent(run))
    frame = pd.DataFrame(columns)
    head = [
        'Controller Name:,"Cell4"',
        'Trend Name:,"Arm"',
        f"Trend Tags:,{frame.shape[1] - 2}",
        "Sample Period:,10 ms",
    ]
    head += [
        'Description:,""',
        'Start Time:,"05/03/2024;14:02:11.250"',
        'Stop Time:,"05/03/2024;14:02:23.240"',
        "",
    ]
    head += ["Header:," + ",".join(f'"{name}"' for name in frame)]
    rows = frame.to_csv(index=False, header=False, float_format="%.6f").splitlines()
    lines(folder / "trend.csv", head + [f"Data,{row}" for row in rows])
    return Answer("trend.csv", {"Date+Time": "*", "Time": "*"}, right=right)


@layout(SIX, rate=100.0)
def gz_model_json(folder: Path, run: Run) -> Answer:
    """gz topic --json-output of a Model message: sec is text, and what is zero (sec, nsec) is left
    out; SI.
    """
    rows = []
    for k, t in enumerate(run.t):
        sec, milli = divmod(round(t * 1e3), 1000)
        stamp = ({"sec": str(sec)} if sec else {}) | ({"nsec": milli * 1000000} if milli else {})
        joints = []
        for j, name in enumerate(run.arm.joints):
            axis = {
                "position": run.q[k, j],
                "velocity": run.dq[k, j],
                "force": run.tau[k, j],
                "xyz": {"z": 1},
            }
            joints.append({"name": name, "id": 11 + j, "axis1": axis})
        rows.append(
            json.dumps({"header": {"stamp": stamp}, "name": run.arm.name, "id": 8, "joint": joints})
        )
    lines(folder / "joint_state.json", rows)
    right = anywhere(q=UNITS["q"], dq=UNITS["dq"], tau=UNITS["tau"])
    return Answer("joint_state.json", right=right, texts=False)


@layout(SEVEN, rate=200.0)
def crocoddyl_npz(folder: Path, run: Run) -> Answer:
    """Crocoddyl's solution in an NPZ: xs of N + 1 states (q, then v), us of N torques, dt; SI."""
    np.savez(
        folder / "solution.npz", xs=np.column_stack([run.q, run.dq]), us=run.tau[:-1], dt=0.005
    )
    right = anywhere(q=UNITS["q"], dq=UNITS["dq"], tau=UNITS["tau"])
    return Answer("solution.npz", rate=200.0, right=right, texts=False)


@layout(UR, rate=125.0)
def two_publishers(folder: Path, run: Run) -> Answer:
    """/joint_states of a bag as CSV of lists: rows of the arm and of the gripper, which publishes
    there too, in turn.
    """
    order = [1, 2, 3, 4, 5, 0]
    arm, rows = [run.arm.joints[j] for j in order], ["Time,name,position,velocity,effort"]
    for k, t in enumerate(run.t):
        parts = [np.round(v[k, order], 6).tolist() for v in (run.q, run.dq, run.tau)]
        rows.append(f"{1714744931.25 + t:.6f}," + ",".join(f'"{part}"' for part in (arm, *parts)))
        if k % 2:
            rows.append(
                f"{1714744931.2521 + t:.6f},['finger_joint'],[{0.3 + 0.1 * np.sin(t):.6f}],[0.0],"
                "[0.0]"
            )
    lines(folder / "joint_states.csv", rows)
    right = anywhere(q=UNITS["q"], dq=UNITS["dq"], tau=UNITS["tau"])
    return Answer("joint_states.csv", {"Time": "s"}, right=right, texts=False)


@layout(SIX, rate=100.0)
def newest_first(folder: Path, run: Run) -> Answer:
    """Write a historian's query ORDER BY ts DESC: ISO stamps, the newest row stands first; units in
    the names.
    """
    times = pd.Timestamp("2024-05-03 14:02:11.250") + pd.to_timedelta(values(run)["ms"], unit="ms")
    specs = "ts=stamp; *j{}_pos_deg=q°; *j{}_vel_degs=dq°; *j{}_trq_nm=tau"
    columns, right = wide(
        run,
        specs,
        stamp=np.array([f"{s:%Y-%m-%dT%H:%M:%S}.{s.microsecond // 1000:03d}Z" for s in times]),
    )
    pd.DataFrame(columns)[::-1].to_csv(folder / "query.csv", index=False, float_format="%.6f")
    return Answer(
        "query.csv", {"ts": "*"}, right=right, table=False
    )  # a refusal that says so serves


@layout(DIGGER, rate=100.0, how="points")
def hydraulic_arm(folder: Path, run: Run) -> Answer:
    """Write an excavator's log: angles and rates, pressures at both ports of each actuator; no
    torque is there.
    """
    columns: dict = {"time [s]": run.t}
    force = run.tau / np.array(run.arm.effort)
    sides = (("pA", 90 + 60 * force, "bar"), ("pB", 90 - 45 * force, "bar"))
    for word, v, unit in (
        ("angle", np.degrees(run.q), "deg"),
        ("rate", np.degrees(run.dq), "deg/s"),
        *sides,
    ):
        columns |= {f"{joint} {word} [{unit}]": v[:, j] for j, joint in enumerate(run.arm.joints)}
    columns |= {"engine speed [rpm]": 1800 + 20 * np.sin(run.t), "tank pressure [bar]": 2.1}
    right = {"q": (Signal(tuple(f"{joint} angle" for joint in run.arm.joints), DEG),)}
    right["dq"] = (Signal(tuple(f"{joint} rate" for joint in run.arm.joints), UNITS["dq°"]),)
    table(folder / "dig.csv", columns, sep=";", float_format="%.5f")
    return Answer("dig.csv", {"time [s]": "s"}, right=right, draftable=False)


@layout(THREE, rate=2258.8)
def power_pmac_gather(folder: Path, run: Run) -> Answer:
    """Power PMAC's gather file: servo counts for a clock, motor counts, current in ADC bits; scales
    nowhere.
    """
    counts = 8192 * np.array([101, 121, 81]) / (2 * np.pi)
    data = {
        "servo": 161803398 + np.arange(len(run.t)),
        "act": run.q * counts,
        "des": run.q_ref * counts,
    }
    data |= {"bits": np.round(300 * current(run))}
    specs = (
        "Sys.ServoCount.a=servo; *Motor[{}].DesPos.a=des:q_ref:counts; "
        "*Motor[{}].ActPos.a=act:q:counts;"
    )
    specs += "*Motor[{}].IqMeas.a=bits:current:?"
    columns, right = wide(run, specs, joint_wise=True, **data)
    table(folder / "gather.txt", columns, sep=" ", float_format="%.4f")
    return Answer("gather.txt", {"Sys.ServoCount.a": "sample"}, right=right, draftable=False)


@layout(SIX, rate=500.0)
def sysmac_trace(folder: Path, run: Run) -> Answer:
    """Omron Sysmac's data trace: MC_Axis000.Act.Pos in deg, .Cmd.Pos, .Act.Vel, .Act.Trq, which is
    in %; no unit.
    """
    specs = (
        "Time[ms]=ms; *MC_Axis00{}.Cmd.Pos=q_ref°; *MC_Axis00{}.Act.Pos=q°; "
        "*MC_Axis00{}.Act.Vel=dq°;"
    )
    specs += "*MC_Axis00{}.Act.Trq=load:current:?"
    head = "Data Trace,Trace0\nSampling,2ms\n\n"
    data = {"load": np.round(percent(run), 1)}
    return recorded(
        folder,
        run,
        "trace0.csv",
        {"Time[ms]": "ms"},
        specs,
        range(6),
        joint_wise=True,
        data=data,
        head=head,
    )


@layout(LEG, rate=1000.0)
def epos_nodes(folder: Path, run: Run) -> Answer:
    """maxon EPOS Studio: a file a node, motor side: increments, rpm, torque in thousandths of the
    rated one.
    """
    motor = 2048 * np.array([156, 113]) / (2 * np.pi)
    for j in range(2):
        columns = {
            "Time [ms]": values(run)["ms"],
            "Position demand value [inc]": np.round(run.q_ref[:, j] * motor[j]),
        }
        columns |= {"Position actual value [inc]": np.round(run.q[:, j] * motor[j])}
        columns |= {"Velocity actual value [rpm]": np.round(run.dq[:, j] * motor[j] / 2048 * 60)}
        columns |= {
            "Torque actual value [1/1000 of rated torque]": np.round(10 * percent(run)[:, j])
        }
        table(folder / f"node{j + 1}.txt", columns, sep=";")
    right = {"q": (Signal(("Position actual value",), ("inc", "counts")),)}
    right["q_ref"] = (Signal(("Position demand value",), ("inc", "counts")),)
    right["dq"] = (Signal(("Velocity actual value",), ("rpm",)),)
    right |= {role: (Signal(("Torque actual value",), ("0.1 %",)),) for role in ("tau", "current")}
    return Answer("node1.txt", {"Time [ms]": "ms"}, right=right, draftable=False)
