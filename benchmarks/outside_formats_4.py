"""Write one simulated motion as ten exports of yet other kinds do, made after the thirty and the
ten were mended."""

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.outside_formats import (
    DEG,
    DEGS,
    NM,
    RAD,
    RADS,
    SIX,
    THREE,
    UR,
    block,
    csv,
    names,
)
from benchmarks.outside_layouts import Answer, Arm, Run, Signal, layout

SO100 = Arm(
    "so100",
    ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"),
    "zyyyx",
    (60, 60, 40, 20, 10),
)


@layout(THREE, robot="robot.toml")
def dymola_result(folder: Path, run: Run) -> Answer:
    """Modelica result as CSV: quoted paths, phi, w, a and tau of each flange
    (Modelica.Mechanics.Rotational)."""
    table: dict[str, np.ndarray] = {"time": run.t}
    for j in range(3):
        flange = f"robot.axis{j + 1}"
        table |= {f"{flange}.phi": run.q[:, j], f"{flange}.w": run.dq[:, j]}
        table |= {f"{flange}.a": run.ddq[:, j], f"{flange}.flange_a.tau": run.tau[:, j]}
    csv(folder / "result.csv", table, head="", quoting=2)
    right = {
        "q": (Signal(names("robot.axis{}.phi", 3), RAD),),
        "dq": (Signal(names("robot.axis{}.w", 3), RADS),),
        "ddq": (Signal(names("robot.axis{}.a", 3), ("rad/s^2",)),),
        "tau": (Signal(names("robot.axis{}.flange_a.tau", 3), NM),),
    }
    return Answer("result.csv", {"time": "s"}, right=right)


@layout(THREE, robot="robot.toml", rate=500.0)
def controldesk_csv(folder: Path, run: Run) -> Answer:
    """dSPACE ControlDesk CSV: a key in the first column (path, unit, trace_values), semicolons."""
    paths = ["Model Root/Time"] + [
        f"Model Root/Plant/{s}[{j}]" for s in ("q_rad", "qd_rad_s", "tau_Nm") for j in range(3)
    ]
    units = ["s", *["rad"] * 3, *["rad/s"] * 3, *["Nm"] * 3]
    head = "name;Recorder 1\ntimestamp;2024-02-07T10:11:12\n"
    head += ";".join(["path", *paths]) + "\n" + ";".join(["unit", *units]) + "\n"
    body = np.column_stack([run.t, run.q, run.dq, run.tau])
    rows = [";".join(["trace_values", *(f"{x:.6f}" for x in row)]) for row in body]
    (folder / "rec.csv").write_text(head + "\n".join(rows) + "\n")
    right = {
        "q": (Signal(names("Model Root/Plant/q_rad[{}]", 3, 0), RAD),),
        "dq": (Signal(names("Model Root/Plant/qd_rad_s[{}]", 3, 0), RADS),),
        "tau": (Signal(names("Model Root/Plant/tau_Nm[{}]", 3, 0), NM),),
    }
    return Answer("rec.csv", {"Model Root/Time": "s"}, right=right)


@layout(SIX, robot=None, rate=250.0)
def sinamics_trace(folder: Path, run: Run) -> Answer:
    """Siemens drive trace: parameters by number (r482 encoder, r61 speed, r80 torque) a drive,
    motor side."""
    gear = np.array([121.0, 121.0, 101.0, 80.0, 80.0, 51.0])
    table: dict[str, np.ndarray] = {"Time [ms]": run.t * 1000}
    for j in range(6):
        drive = f"Drive_{j + 1}"
        table[f"{drive}.r482[0] Actual encoder value"] = np.round(run.q[:, j] * gear[j] * 1e4)
        table[f"{drive}.r61 Actual speed [rpm]"] = run.dq[:, j] * gear[j] * 30 / np.pi
        table[f"{drive}.r80 Actual torque [Nm]"] = run.tau[:, j] / gear[j]
    csv(folder / "trace.csv", table, sep=";")
    right = {
        "q": (Signal(names("Drive_{}.r482[0] Actual encoder value", 6), ("counts",)),),
        "dq": (Signal(names("Drive_{}.r61 Actual speed [rpm]", 6), ("rpm",)),),
        "tau": (Signal(names("Drive_{}.r80 Actual torque [Nm]", 6), NM),),
    }
    return Answer("trace.csv", {"Time [ms]": "ms"}, right=right, draftable=False)


@layout(UR, rate=125.0)
def webots_sensors(folder: Path, run: Run) -> Answer:
    """Webots controller log: NAME_sensor positions, torque feedback by motor name, gripper
    fingers."""
    table: dict[str, np.ndarray] = {"sim_time": run.t + 0.032}
    for j, joint in enumerate(run.arm.joints):
        table[f"{joint}_sensor"] = run.q[:, j]
        table[f"{joint}_torque_feedback"] = run.tau[:, j]
    for finger in ("finger_1_joint_1", "finger_2_joint_1"):
        table |= {f"{finger}_sensor": 0.05 + 0 * run.t, f"{finger}_torque_feedback": 0 * run.t}
    csv(folder / "webots.csv", table)
    right = {
        "q": (Signal(tuple(f"{j}_sensor" for j in run.arm.joints), RAD),),
        "tau": (Signal(tuple(f"{j}_torque_feedback" for j in run.arm.joints), NM),),
    }
    return Answer("webots.csv", {"sim_time": "s"}, right=right)


@layout(SIX, rate=100.0)
def coppelia_graph(folder: Path, run: Run) -> Answer:
    """CoppeliaSim graph export: "/m0609/joint_1: position (deg)", forces in N*m, time in s."""
    table: dict[str, np.ndarray] = {"Time (s)": run.t}
    for j, joint in enumerate(run.arm.joints):
        table[f"/m0609/{joint}: position (deg)"] = np.degrees(run.q[:, j])
        table[f"/m0609/{joint}: target position (deg)"] = np.degrees(run.q_ref[:, j])
        table[f"/m0609/{joint}: force (N*m)"] = run.tau[:, j]
    csv(folder / "graph.csv", table)
    right = {
        "q": (Signal(tuple(f"/m0609/{j}: position (deg)" for j in run.arm.joints), DEG),),
        "q_ref": (
            Signal(tuple(f"/m0609/{j}: target position (deg)" for j in run.arm.joints), DEG),
        ),
        "tau": (Signal(tuple(f"/m0609/{j}: force (N*m)" for j in run.arm.joints), NM),),
    }
    return Answer("graph.csv", {"Time (s)": "s"}, right=right)


@layout(SIX, rate=500.0)
def dot_by_letter_p(folder: Path, run: Run) -> Answer:
    """A German laboratory's notation: q, qp and qpp for the derivatives ("Punkt"), Q for the
    torque."""
    table: dict[str, np.ndarray] = {"t": run.t}
    for name, v in (("q", run.q), ("qp", run.dq), ("qpp", run.ddq), ("qsoll", run.q_ref)):
        table |= block(f"{name}{{}}", v)
    table |= block("tauM{}", run.tau) | block("tauExt{}", run.tau_ext)
    csv(folder / "versuch.dat", table, sep=" ", float_format="%.8e")
    right = {
        "q": (Signal(names("q{}", 6), RAD),),
        "dq": (Signal(names("qp{}", 6), RADS),),
        "ddq": (Signal(names("qpp{}", 6), ("rad/s^2",)),),
        "q_ref": (Signal(names("qsoll{}", 6), RAD),),
        "tau": (Signal(names("tauM{}", 6), NM),),
    }
    return Answer("versuch.dat", {"t": "s"}, right=right)


@layout(THREE, robot="robot.toml")
def adams_table(folder: Path, run: Run) -> Answer:
    """MSC Adams result table: a title, quoted names, fixed width, Fortran exponents, degrees, N
    mm."""
    head = ["Time", *names(".arm.JOINT_{}_ANGLE.Q", 3), *names(".arm.MOTION_{}.TORQUE.Q", 3)]
    values = np.column_stack([run.t, np.degrees(run.q), 1000 * run.tau])
    rows = ["".join(f"{x:18.8E}".replace("E", "D") for x in row) for row in values]
    text = "Last_Run   Results   2023-11-02\n" + "  ".join(f'"{n}"' for n in head)
    (folder / "adams.tab").write_text(text + "\n" + "\n".join(rows) + "\n")
    right = {
        "q": (Signal(names(".arm.JOINT_{}_ANGLE.Q", 3), DEG),),
        "tau": (Signal(names(".arm.MOTION_{}.TORQUE.Q", 3), ("N mm",)),),
    }
    return Answer("adams.tab", {"Time": "s"}, right=right)


@layout(SIX, rate=100.0)
def two_arms(folder: Path, run: Run) -> Answer:
    """Two arms of one type in a table, left/joint_1 … right/joint_6, beside the description of
    one."""
    left = np.roll(run.q, 200, axis=0), np.roll(run.dq, 200, axis=0), np.roll(run.tau, 200, axis=0)
    table: dict[str, np.ndarray] = {"time": 1.7e9 + run.t}
    for side, (q, dq, tau) in (("left", left), ("right", (run.q, run.dq, run.tau))):
        for j, joint in enumerate(run.arm.joints):
            table |= {f"{side}/{joint}/position": q[:, j], f"{side}/{joint}/velocity": dq[:, j]}
            table[f"{side}/{joint}/effort"] = tau[:, j]
    csv(folder / "bimanual.csv", table)
    return Answer("bimanual.csv", {"time": "s"}, draftable=False)


@layout(THREE, robot="robot.toml")
def greek_names(folder: Path, run: Run) -> Answer:
    """A notebook's data frame with Greek names: φ1 [°], φ̇1 [°/s], τ1 [N·m], written by pandas
    with its index."""
    table: dict[str, np.ndarray] = {"t [s]": run.t}
    table |= block("φ{} [°]", np.degrees(run.q)) | block("φ̇{} [°/s]", np.degrees(run.dq))
    table |= block("τ{} [N·m]", run.tau) | block("ϑ{} [°C]", run.temperature)
    pd.DataFrame(table).to_csv(folder / "greek.csv", float_format="%.6f")
    right = {
        "q": (Signal(names("φ{} [°]", 3), DEG),),
        "dq": (Signal(names("φ̇{} [°/s]", 3), DEGS),),
        "tau": (Signal(names("τ{} [N·m]", 3), NM),),
    }
    return Answer("greek.csv", {"t [s]": "s"}, right=right)


@layout(SO100, rate=30.0)
def so100_normalised(folder: Path, run: Run) -> Answer:
    """LeRobot SO-100 table: positions normalised to -100..100 of the calibrated range; no unit
    of angle."""
    reach = np.array([1.9, 1.7, 1.6, 1.8, 2.8])
    table: dict[str, object] = {"timestamp": run.t, "frame_index": np.arange(len(run.t))}
    table |= {
        f"observation.{j}.pos": 100 * run.q[:, k] / reach[k] for k, j in enumerate(run.arm.joints)
    }
    table["observation.gripper.pos"] = 42.0
    table |= {
        f"action.{j}.pos": 100 * run.q_ref[:, k] / reach[k] for k, j in enumerate(run.arm.joints)
    }
    csv(folder / "episode.csv", table)
    right = {
        "q": (Signal(tuple(f"observation.{j}.pos" for j in run.arm.joints)),),
        "q_ref": (Signal(tuple(f"action.{j}.pos" for j in run.arm.joints)),),
    }
    return Answer("episode.csv", {"timestamp": "s"}, right=right, draftable=False)
