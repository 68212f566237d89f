"""Judge the drafts of `rrrid import --guess` on recordings in formats its authors did not choose.

    python -m benchmarks.outside_layouts [NAME ...] [--set formats] [--keep FOLDER]

Every layout of `outside_formats` (ROS, controllers), `outside_formats_2` (drives, tools, files; its
last twenty, from abb_test_signals on, made later), `_5` and `_6` (each by a stranger) copies a
real export after its documentation or public source code, and states the right answer beside it. A draft is "right"
where every field that is filled in is true (with no blank it is also imported, and the log compared with
the simulated motion), "asks" where a field that it cannot know is blank, "refused" with a remedy,
or "wrong": a field is filled in that is not true.
"""

import argparse
import re
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from math import sqrt
from pathlib import Path

import h5py
import numpy as np

SAME = 5e-3  # rms difference over standard deviation of an equal signal (rounding)
ASK = "FILL IN"
TESTED = ("formats", "formats_2", "formats_5")  # by the suite of tests
SETS = (*TESTED, "formats_6")


@dataclass(frozen=True)
class Arm:
    """A serial arm whose links lie along x; `axes` are x, y, z for hinges and X, Y, Z for
    sliders."""

    name: str
    joints: tuple[str, ...]
    axes: str
    effort: tuple[float, ...]  # N m or N
    fingers: tuple[str, ...] = ()  # further joints of the URDF, at the last link
    continuous: bool = False

    def urdf(self) -> str:
        """Return the description as URDF text."""
        parts = [f'<robot name="{self.name}"><link name="link_0"/>']
        for j, (name, axis) in enumerate(zip(self.joints, self.axes, strict=True)):
            kind = (
                "prismatic" if axis.isupper() else "continuous" if self.continuous else "revolute"
            )
            limit = (
                'lower="0.0" upper="0.4" velocity="1"'
                if axis.isupper()
                else 'lower="-3.1" upper="3.1" velocity="3.2"'
            )
            parts.append(_link(f"link_{j + 1}", 6.0 / (j + 1.5)))
            parts.append(
                _joint(
                    name,
                    kind,
                    j,
                    j + 1,
                    axis,
                    0.0 if j == 0 else 0.3,
                    f'{limit} effort="{self.effort[j]}"',
                )
            )
        n = len(self.joints)
        for k, name in enumerate(self.fingers):
            parts.append(_link(f"link_{n + 1 + k}", 0.05))
            parts.append(
                _joint(
                    name,
                    "prismatic",
                    n,
                    n + 1 + k,
                    "Y",
                    0.1,
                    'lower="0" upper="0.04" velocity="0.2" effort="20"',
                )
            )
        return "\n".join([*parts, "</robot>"])

    def toml(self) -> str:
        """Return the description as a robot file of this project, modified DH where axes are z
        and y only."""
        text = [
            f'name = "{self.name}"',
            "gravity = [0.0, 0.0, -9.81]",
            '[kinematics]\nconvention = "dh"',
        ]
        for j, (name, axis) in enumerate(zip(self.joints, self.axes, strict=True)):
            slides = axis.isupper()
            values = {
                "name": f'"{name}"',
                "type": '"prismatic"' if slides else '"revolute"',
                "a": 0.0 if j == 0 else 0.3,
                "alpha": 1.5707963 if j == 0 and axis == "z" else 0.0,
                "d": 0.0,
                "offset": 0.0,
                "position": [0.0, 0.4] if slides else [-3.1, 3.1],
                "velocity": 1.0 if slides else 3.2,
                "torque": self.effort[j],
            }
            text += ["[[joint]]", *(f"{key} = {value}" for key, value in values.items())]
        return "\n".join(text) + "\n"


def _link(name: str, mass: float) -> str:
    inertia = " ".join(
        f'{k}="{mass * f}"' for k, f in (("ixx", 0.002), ("iyy", 0.01), ("izz", 0.01))
    )
    return (
        f'<link name="{name}"><inertial><origin xyz="0.12 0.01 0.02"/><mass value="{mass}"/>'
        f'<inertia {inertia} ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def _joint(name: str, kind: str, parent: int, child: int, axis: str, x: float, limit: str) -> str:
    direction = " ".join("1" if axis.lower() == a else "0" for a in "xyz")
    return (
        f'<joint name="{name}" type="{kind}">'
        f'<parent link="link_{parent}"/><child link="link_{child}"/>'
        f'<origin xyz="{x} 0 0.1"/><axis xyz="{direction}"/><limit {limit}/></joint>'
    )


@dataclass(frozen=True)
class Run:
    """One motion of an arm: SI, (N,) or (N, n)."""

    arm: Arm
    t: np.ndarray
    q: np.ndarray
    dq: np.ndarray
    ddq: np.ndarray
    tau: np.ndarray
    q_ref: np.ndarray  # the reference, 20 ms ahead
    dq_ref: np.ndarray
    tau_ref: np.ndarray  # the commanded torque
    tau_model: np.ndarray  # without friction
    current: np.ndarray  # motor current
    temperature: np.ndarray  # degC
    tau_ext: np.ndarray  # estimate of the external torque: noise
    pose: np.ndarray  # (N, 6), m and rad

    @property
    def n(self) -> int:
        return self.q.shape[1]


def from_point_to_point(
    t: np.ndarray, rng: np.random.Generator, n: int, in_turn: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return position, velocity, acceleration of moves by quintics of 1.1 s with rests of 0.4 s,
    of all joints together or of one after the other."""
    targets = np.vstack([np.zeros(n), rng.uniform(-1, 1, (int(t[-1] / 1.5) + 2, n))])
    if in_turn:
        moving = np.arange(len(targets))[:, None] % n == np.arange(n)
        targets = np.cumsum(np.where(moving, np.sign(targets) * (0.3 + abs(targets)), 0.0), axis=0)
    k = np.floor(t / 1.5).astype(int)
    s = np.clip((t - 1.5 * k) / 1.1, 0.0, 1.0)[:, None]
    start, step = targets[k], targets[k + 1] - targets[k]
    return (
        start + step * s**3 * (10 - 15 * s + 6 * s**2),
        step * 30 * s**2 * (1 - s) ** 2 / 1.1,
        step * 60 * s * (1 - s) * (1 - 2 * s) / 1.1**2,
    )


def simulate(
    arm: Arm,
    seed: int,
    rate: float = 200.0,
    seconds: float = 12.0,
    how: str = "series",
    size: float = 1.0,
) -> Run:
    """Move the arm along a Fourier series, from point to point ("points") or joint by joint
    ("turns"); Pinocchio's inverse dynamics and friction make its torque."""
    import pinocchio

    model = pinocchio.buildModelFromXML(Arm(arm.name, arm.joints, arm.axes, arm.effort).urdf())
    data, n = model.createData(), len(arm.joints)
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * rate)) / rate
    slides = np.array([a.isupper() for a in arm.axes])
    reach, centre = np.where(slides, 0.15, 1.1), np.where(slides, 0.2, rng.uniform(-0.4, 0.4, n))
    w = 2 * np.pi * np.arange(1, 6) / 8.0
    a, b = rng.normal(size=(2, 5, n)) / np.arange(1, 6)[:, None] ** 0.5

    def series(at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        if how != "series":
            return from_point_to_point(at, np.random.default_rng(seed), n, how == "turns")
        c, s = np.cos(np.outer(at, w)), np.sin(np.outer(at, w))
        return c @ a + s @ b, (c * w) @ b - (s * w) @ a, -(c * w**2) @ a - (s * w**2) @ b

    scale = size * reach / abs(series(t)[0]).max(axis=0)
    q, dq, ddq = (x * scale for x in series(t))
    centre = size * centre
    q, ahead, dq_ahead = (
        q + centre,
        series(t + 0.02)[0] * scale + centre,
        series(t + 0.02)[1] * scale,
    )
    rigid = np.array([pinocchio.rnea(model, data, *row) for row in zip(q, dq, ddq, strict=True)])
    effort = abs(rigid).max(axis=0) + 0.5
    tau = rigid + 0.08 * effort * np.tanh(dq / 0.02) + 0.05 * effort * dq / abs(dq).max(axis=0)
    tau_measured = tau + 0.003 * effort * rng.normal(size=tau.shape)
    return Run(
        arm,
        t,
        q + 1e-5 * rng.normal(size=q.shape),
        dq + 2e-3 * reach * rng.normal(size=q.shape),
        ddq,
        tau_measured,
        ahead,
        dq_ahead,
        tau + 0.02 * effort * rng.normal(size=tau.shape),
        rigid,
        tau_measured / np.linspace(11.0, 5.0, n),
        31.0 + np.arange(n) + 0.2 * t[:, None] + 0.05 * rng.normal(size=q.shape),
        0.01 * effort * rng.normal(size=tau.shape),
        np.column_stack([np.sin(0.5 * t + k) * 0.4 for k in range(6)]),
    )


@dataclass(frozen=True)
class Signal:
    """What a signal may be made of: columns in the robot's order of joints, and spellings of
    their unit."""

    columns: tuple[str, ...]
    units: tuple[str, ...] = ()  # none: no unit can be known, it must be left blank
    values: np.ndarray | None = None  # SI, where not what the run calls so


@dataclass(frozen=True)
class Answer:
    """The right answer of one layout. A signal without an entry must not be filled in."""

    file: str
    time: dict[str, str] = field(default_factory=dict)  # column, or columns joined by +: unit(s)
    rate: float | None = None  # where there is no column
    right: dict[str, tuple[Signal, ...]] = field(default_factory=dict)
    torque: tuple[str, ...] = ("measured", "held-command")
    texts: bool = True  # columns are compared by name too
    draftable: bool = True  # False: nothing but blanks or a refusal is right


@dataclass(frozen=True)
class Layout:
    name: str
    source: str
    arm: Arm
    robot: str | None
    write: Callable[[Path, Run], Answer]
    rate: float
    how: str = "series"  # the motion


LAYOUTS: list[Layout] = []


def layout(
    arm: Arm, robot: str | None = "arm.urdf", rate: float = 200.0, how: str = "series"
) -> Callable[[Callable[[Path, Run], Answer]], Callable[[Path, Run], Answer]]:
    """Register a function that writes one recording into a folder; its docstring names the
    source."""

    def register(write: Callable[[Path, Run], Answer]) -> Callable[[Path, Run], Answer]:
        LAYOUTS.append(
            Layout(
                write.__name__,
                (write.__doc__ or "").splitlines()[0],
                arm,
                robot,
                write,
                rate,
                how,
            )
        )
        return write

    return register


def rrrid(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "rrrid_cli.main", *arguments],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def expanded(entry: dict[str, object], n: int) -> tuple[str, ...] | None:
    """Return the columns of one entry of [signals], or None where they are left blank."""
    columns = entry.get("columns", entry.get("column"))
    if isinstance(columns, str):
        if ASK in columns:
            return None
        columns = (
            [
                re.sub(r"\{j(-1)?\}", lambda m, j=j: str(j - 1 if m[1] else j), columns)
                for j in range(1, n + 1)
            ]
            if "{j" in columns
            else [columns]
        )
    return None if columns is None or any(ASK in c for c in columns) else tuple(columns)


def plain(name: str) -> str:
    """Return a column's name as a draft writes it: without a unit in brackets and without the %
    of a comment."""
    return re.sub(r"\s*[\[(][^\])0-9]+[\])]$", "", name).lstrip("%")


def unit_of(entry: dict[str, object]) -> str:
    unit = entry.get("unit", "")
    return ",".join(unit) if isinstance(unit, list) else str(unit)


def wrong_fields(draft: dict, answer: Answer, run: Run, robot: str | None) -> list[str]:
    """Return every field of a draft that is filled in and is not true."""
    use = draft.get("robot", {}).get("use", ASK)
    wrong = [f"robot: {use}"] if ASK not in use and use.partition(":")[0] != robot else []
    return wrong + wrong_clock(draft.get("time", {}), answer) + wrong_signals(draft, answer, run)


def wrong_clock(time: dict, answer: Answer) -> list[str]:
    """Return what [time] of a draft holds and is not true."""
    wrong = []
    column, unit = time.get("column"), time.get("unit", "")
    column = "+".join(column) if isinstance(column, list) else column
    unit = "+".join(unit) if isinstance(unit, list) else unit
    clocks = {plain(name): u for name, u in answer.time.items()}
    if (
        column is not None
        and ASK not in column
        and answer.texts
        and (column not in clocks or (ASK not in unit and clocks[column] not in ("*", unit)))
    ):
        wrong.append(f"time: {column} [{unit}]")
    rate = time.get("rate")
    if isinstance(rate, (int, float)) and (
        answer.rate is None or abs(rate / answer.rate - 1) > 0.02
    ):
        wrong.append(f"rate: {rate}")
    return wrong


def wrong_signals(draft: dict, answer: Answer, run: Run) -> list[str]:
    """Return what [signals] of a draft holds and is not true."""
    wrong = []
    for name, entry in draft.get("signals", {}).items():
        if not isinstance(entry, dict):
            continue
        columns, unit, accepted = expanded(entry, run.n), unit_of(entry), answer.right.get(name, ())
        if columns is None:
            continue
        same = [s for s in accepted if not answer.texts or tuple(map(plain, s.columns)) == columns]
        if not same:
            wrong.append(f"{name}: {', '.join(columns[:3])} …")
        elif ASK not in unit and not any(unit in s.units for s in same):
            wrong.append(f"{name}: unit {unit}")
    return wrong


def wrong_values(folder: Path, answer: Answer, run: Run) -> list[str]:
    """Import by the draft as it is, and return every signal of the log that is not the simulated
    motion."""
    done = rrrid(
        "import", "draft.toml", "--source", ".", "--out", "imported", "--no-report", cwd=folder
    )
    logs = sorted((folder / "imported").rglob("*.h5"))
    if done.returncode or not logs:
        return [] if done.returncode in (2, 3) else [f"import exits {done.returncode}"]
    with h5py.File(logs[0]) as log:
        signals = {name: np.asarray(values) for name, values in log["signals"].items()}
    t = signals["t"] - signals["t"][0]
    step, true = np.median(np.diff(t)), run.t[1] - run.t[0]
    wrong = [] if abs(step / true - 1) < 0.02 else [f"clock: a step of {step:.4g} s"]
    names = [name for name in ("q", "dq", "tau", "q_ref", "current") if name in signals]
    return wrong + [
        f"{name}: not the motion"
        for name in names
        if not _is_motion(name, t, signals[name], answer, run)
    ]


def _is_motion(name: str, t: np.ndarray, values: np.ndarray, answer: Answer, run: Run) -> bool:
    """Tell whether a signal of a log is what one of the accepted ones holds."""
    accepted = [
        s.values if s.values is not None else getattr(run, name) for s in answer.right.get(name, ())
    ]
    return any(_same(t, values, run.t - run.t[0], a, name) for a in accepted)


def _same(
    t: np.ndarray, values: np.ndarray, t_true: np.ndarray, truth: np.ndarray, name: str
) -> bool:
    truth = np.column_stack([np.interp(t, t_true, c) for c in truth.T])
    if values.shape != truth.shape:
        return False
    error = values - truth
    if name in ("q", "q_ref"):
        error -= 2 * np.pi * np.round(np.median(error, axis=0) / (2 * np.pi))
    return bool(np.all(np.sqrt(np.mean(error**2, axis=0)) <= SAME * 4 * truth.std(axis=0)))


def written(lay: Layout, folder: Path, seed: int) -> tuple[Run, Answer]:
    """Write a recording, and the robot beside it, into `folder`."""
    run = simulate(lay.arm, seed, lay.rate, how=lay.how)
    if lay.robot:
        text = lay.arm.urdf() if lay.robot.endswith("urdf") else lay.arm.toml()
        (folder / lay.robot).write_text(text)
    return run, lay.write(folder, run)


def asks(draft: str) -> list[str]:
    """Return the lines of a draft that hold a blank."""
    return [line.strip() for line in draft.splitlines() if ASK in line.partition("#")[0]]


def untrue(draft: str, lay: Layout, answer: Answer, run: Run) -> list[str]:
    """Return what a draft claims that is not true, advice in its comments included."""
    recipe = tomllib.loads(draft)
    wrong = wrong_fields(recipe, answer, run, lay.robot)
    torque = recipe.get("log", {}).get("torque")
    line = next((line for line in draft.splitlines() if line.startswith("torque =")), "")
    claimed = torque not in (None, ASK, *answer.torque) and "unsure" not in line
    if claimed and recipe.get("signals", {}).get("tau"):
        wrong.append(f"torque: {torque}")
    if "add sign = -1" in draft:
        wrong.append("sign")
    if not asks(draft) and not answer.draftable:
        wrong.append("a draft without blanks")
    return wrong


def judge(lay: Layout, folder: Path, seed: int) -> tuple[str, str]:
    """Return (class, details) of one layout, written into `folder`."""
    run, answer = written(lay, folder, seed)
    done = rrrid("import", "--guess", answer.file, cwd=folder)
    (folder / "draft.toml").write_text(done.stdout)
    if done.returncode:
        refused = done.returncode in (2, 3) and "RRID" in done.stderr
        return ("refused" if refused else "wrong"), done.stderr.strip()[-300:]
    blanks = asks(done.stdout)
    wrong = untrue(done.stdout, lay, answer, run)
    if not blanks and not wrong:
        wrong = wrong_values(folder, answer, run)
    if wrong:
        return "wrong", "; ".join(wrong)
    return ("asks" if blanks else "right"), ", ".join(line[:60] for line in blanks)


def wilson(k: int, n: int) -> tuple[float, float]:
    """Return the 95 % interval of a rate (Wilson 1927, eq. 4)."""
    z, p = 1.96, k / n
    middle, half = p + z * z / (2 * n), z * sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return (middle - half) / (1 + z * z / n), (middle + half) / (1 + z * z / n)


def load(sets: Sequence[str] = SETS) -> list[Layout]:
    """Return the layouts of some modules, in the order in which they are written."""
    for part in sets:
        import_module(f"benchmarks.outside_{part}")
    wanted = [f"benchmarks.outside_{part}" for part in sets]
    return [lay for lay in LAYOUTS if lay.write.__module__ in wanted]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*")
    parser.add_argument("--set", choices=SETS, action="append")
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--seed", type=int, default=5100, help="of the first motion")
    options = parser.parse_args()
    layouts = load(options.set or SETS)
    counts: dict[str, int] = {}
    chosen = [lay for lay in layouts if not options.names or lay.name in options.names]
    for k, lay in enumerate(chosen):
        with tempfile.TemporaryDirectory() as scratch:
            folder = (options.keep or Path(scratch)) / lay.name
            folder.mkdir(parents=True, exist_ok=True)
            verdict, details = judge(lay, folder, seed=options.seed + k)
        counts[verdict] = counts.get(verdict, 0) + 1
        print(f"{lay.name:26} {verdict:8} {details}", flush=True)
    good, n = sum(counts.get(c, 0) for c in ("right", "asks")), len(chosen)
    low, high = wilson(good, n)
    print(f"{counts}: right or asks {good}/{n} = {good / n:.3f} [{low:.3f}, {high:.3f}]")


if __name__ == "__main__":
    sys.modules["benchmarks.outside_layouts"] = sys.modules["__main__"]
    main()
