"""Judge the drafts of `rrrid import --guess` on recordings in formats that others chose.

    python -m benchmarks.import_layouts [NAME ...] [--set robots] [--keep FOLDER]

A layout writes one simulated motion as a recorder does, after its documentation or public source
code, and states the right answer beside it. The draft is "right" where every field that is filled
in is true and the imported log is the simulated motion, "asks" where a field that it cannot know is
blank, "refused" with a remedy, or "wrong": a field is filled in that is not true, or the import
succeeds with other numbers. Blanks are then filled in as a person would who knows the truth: a
draft that this makes no usable recipe has "failed".
"""

import argparse
import re
import sys
import tempfile
import tomllib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from math import sqrt
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import tomli_w

from benchmarks.recorded_arm import Arm, Run, simulate
from pipelines.errors import RrridError
from pipelines.import_log import STAGE, Settings, draft_recipe
from pipelines.stage import Request, run_stage

SAME = 5e-3  # rms difference over standard deviation of an equal signal (rounding)
ASK = "FILL IN"
SETS = (
    "robots",
    "programs",
    "stranger",
    "stranger_2",
    "fresh",
    "fresh_2",
    "stranger_3",
    "stranger_4",
    "stranger_5",
    "stranger_6",
)
SETS += ("stranger_7", "stranger_8", "stranger_9")


@dataclass(frozen=True)
class Signal:
    """The source of a signal: columns in the robot's order of joints, and spellings of
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
    table: bool = True  # False: a refusal with a remedy is all that is right


@dataclass(frozen=True)
class Layout:
    name: str
    source: str
    arm: Arm
    robot: str | None
    write: Callable[[Path, Run], Answer]
    rate: float
    how: str = "series"  # the motion
    size: float = 1.0  # of the motion


LAYOUTS: list[Layout] = []


def layout(
    arm: Arm,
    robot: str | None = "arm.urdf",
    rate: float = 200.0,
    how: str = "series",
    size: float = 1.0,
) -> Callable[[Callable[[Path, Run], Answer]], Callable[[Path, Run], Answer]]:
    """Register a function that writes one recording into a folder; its docstring names the
    source.
    """

    def register(write: Callable[[Path, Run], Answer]) -> Callable[[Path, Run], Answer]:
        source = (write.__doc__ or "").splitlines()[0]
        LAYOUTS.append(Layout(write.__name__, source, arm, robot, write, rate, how, size))
        return write

    return register


DEG = ("deg", "degree", "degrees", "°")
RAD, RADS, NM = ("rad",), ("rad/s",), ("N m", "Nm", "N*m")
DEGS, TURNS = ("deg/s", "°/s"), ("rev", "turn", "turns", "revolutions")

UNITS = {"q": RAD, "q_ref": RAD, "dq": RADS, "tau": NM, "current": ("A",), "%": ("%",)}
UNITS |= {"q°": DEG, "q_ref°": DEG, "dq°": DEGS, "counts": ("counts",), "counts/s": ("counts/s",)}
UNITS |= {"dq_ref": RADS, "dq_ref°": DEGS, "ddq": ("rad/s^2",), "tau_ref": NM, "N mm": ("N mm",)}
UNITS |= {"rev": ("turn", "turns", "rev"), "rev/s": ("turn/s", "turns/s", "rev/s"), "?": ()}
UNITS |= {"mrad": ("mrad",), "mNm": ("mN m", "mNm", "N mm"), "0.1 %": ("0.1 %",), "rpm": ("rpm",)}
UNITS |= {
    "mA": ("mA",),
    "A": ("A",),
    "kNm": ("kN m", "kNm"),
    "kgf cm": ("kgf cm",),
    "deg/s": ("deg/s",),
}


def block(pattern: str, values: np.ndarray, start: int = 1) -> dict[str, np.ndarray]:
    """Return columns named after a pattern with {}, one a joint."""
    return {pattern.format(start + j): column for j, column in enumerate(values.T)}


def names(pattern: str, n: int, start: int = 1) -> tuple[str, ...]:
    return tuple(pattern.format(start + j) for j in range(n))


def csv(path: Path, columns: dict, head: str = "", **how: object) -> None:
    """Write a table, below `head` as it stands."""
    encoding = str(how.pop("encoding", "utf-8"))
    how = {"index": False, "float_format": "%.6f", **how}
    path.write_bytes((head + pd.DataFrame(columns).to_csv(**how)).encode(encoding))


def table(path: Path, columns: dict, head: str = "", **how: object) -> None:
    """Write a table with all digits."""
    csv(path, columns, head, **{"float_format": None, **how})


def current(run: Run) -> np.ndarray:
    """Motor currents, with noise, by torque constants that no file states."""
    dice = np.random.default_rng(abs(int(1e6 * float(np.sum(run.q)))) % 2**32)
    constant = dice.uniform(5, 15, run.q.shape[1])
    return run.tau / constant * (1 + 0.02 * dice.standard_normal(run.q.shape))


def values(run: Run) -> dict[str, np.ndarray]:
    """Return what a layout may write: the motion, its times, and a tool pose [mm, rad] that follows
    it.
    """
    a, b = run.q[:, 0], run.q[:, 1]
    data = {"q": run.q, "dq": run.dq, "tau": run.tau, "q_ref": run.q_ref, "ext": run.tau_ext}
    data |= {"ddq": run.ddq, "dq_ref": run.dq_ref, "tau_ref": run.tau_ref, "amps": run.current}
    data |= {f"{s}°": np.degrees(data[s]) for s in ("q", "dq", "q_ref", "dq_ref")}
    data |= {"current": current(run), "temp": run.temperature, "t": run.t}
    data |= {"count": np.arange(len(run.t)), "us": np.round(run.t * 1e6).astype(np.int64)}
    data |= {"ms": np.round(run.t * 1e3).astype(np.int64), "x": 400 + 200 * np.cos(a)}
    data |= {"y": 300 * np.sin(a), "z": 500 + 100 * np.sin(b), "rx": 3.1 + 0.02 * b}
    return data | {"ry": 0.05 * a, "rz": 0.3 * a + 0.1 * b}


def anywhere(**units: tuple[str, ...]) -> dict:
    """State units alone, of columns whose names are not compared."""
    return {role: (Signal((), unit),) for role, unit in units.items()}


def state(right: dict, form: str, joints, spec: str) -> None:
    """Add a right answer "role" or "role:unit" for the columns of a form. A current (or share of
    a rated torque) is all that is known of torque, so it may stand under either."""
    role, _, unit = spec.partition(":")
    columns = tuple(form.replace("{}", str(j)) for j in joints)
    units = UNITS[unit or role]
    signal = Signal(columns, units) if units else Signal(columns)
    for name in ("current", "tau") if role == "current" else (role.rstrip("°"),):
        right[name] = (signal,)


def wide(run: Run, specs: str, joints=None, joint_wise: bool = False, **more) -> tuple[dict, dict]:
    """Make columns, and the right answer, of "name=value; name{}=value; *name{}=value:role:unit":
    {} is a joint (consecutive specs with it are interleaved if `joint_wise`), * marks what is
    true (its role is the value's name unless given), a value without array is a constant."""
    data, columns, right = values(run) | more, {}, {}
    joints = range(1, run.q.shape[1] + 1) if joints is None else joints
    groups: list[list[tuple[str, str]]] = []
    for spec in specs.split(";"):
        name, _, value = spec.strip().rpartition("=")
        key, _, truth = value.partition(":")
        if name.startswith("*"):
            name = name[1:]
            state(right, name, joints, truth or key)
        if joint_wise and "{}" in name and groups and "{}" in groups[-1][-1][0]:
            groups[-1].append((name, key))
        else:
            groups.append([(name, key)])
    for specs_of_group in groups:
        for k, j in enumerate(joints if "{}" in specs_of_group[0][0] else [""]):
            for name, key in specs_of_group:
                v = data.get(key, key)
                matrix = isinstance(v, np.ndarray) and v.ndim == 2
                columns[name.replace("{}", str(j))] = v[:, k] if matrix else v
    return columns, right


def stamps(run: Run, form: str) -> np.ndarray:
    """Return the dates of the samples as text."""
    times = pd.Timestamp("2024-05-03 14:02:11.25") + pd.to_timedelta(values(run)["us"], unit="us")
    return times.strftime(form).to_numpy()


def vector(numbers: np.ndarray) -> str:
    """Write numbers between commas."""
    return ", ".join(f"{x:.6f}" for x in numbers)


def recorded(  # noqa: PLR0913 (146 layouts call it)
    folder: Path,
    run: Run,
    file: str,
    time: dict[str, str],
    specs: str,
    joints=None,
    joint_wise: bool = False,
    known: bool = True,
    data: dict | None = None,
    **how: object,
) -> Answer:
    """Write the table of `wide` as a text file, and return its answer; `known` tells whether all of
    it can be known.
    """
    columns, right = wide(run, specs, joints, joint_wise, **(data or {}))
    table(folder / file, columns, **how)
    return Answer(file, time, right=right, draftable=known)


def si(pattern: str, n: int, unit: str, start: int = 1, v: np.ndarray | None = None) -> Signal:
    """State the columns of a pattern and the spellings of a unit."""
    return Signal(names(pattern, n, start), UNITS[unit], v)


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
    return re.sub(r"\s*[\[(][^\])0-9]+[\])]$|,\s+\S+$", "", name).lstrip("%")


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


def wrong_values(recipe: str, folder: Path, answer: Answer, run: Run) -> list[str] | str:
    """Import by a recipe, and return every signal of the log that is not the simulated motion; or
    why it does not run.
    """
    path, out = folder.parent / "recipe.toml", folder.parent / "out"
    path.write_text(recipe, encoding="utf-8")
    try:
        outcome = run_stage(
            STAGE, Request((), out, no_report=True), Settings(recipe=str(path), source=folder)
        )
    except RrridError as problem:
        return str(problem)
    with h5py.File(sorted((outcome.folder / "logs").glob("*.h5"))[0]) as log:
        signals = {name: np.asarray(values) for name, values in log["signals"].items()}
    t = signals["t"] - signals["t"][0]
    names = [name for name in ("q", "dq", "tau", "q_ref", "current") if name in signals]
    return [
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
    size, truth = truth.std(axis=0), np.column_stack([np.interp(t, t_true, c) for c in truth.T])
    if values.shape != truth.shape:
        return False
    error = values - truth
    if name in ("q", "q_ref"):
        error -= 2 * np.pi * np.round(np.median(error, axis=0) / (2 * np.pi))
    return bool(np.all(np.sqrt(np.mean(error**2, axis=0)) <= SAME * 4 * size))


def written(lay: Layout, folder: Path, seed: int) -> tuple[Run, Answer]:
    """Write a recording, and the robot beside it, into `folder`."""
    run = simulate(lay.arm, seed, lay.rate, how=lay.how, size=lay.size)
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
    if "sign = -1" in draft or "sign = [" in draft:
        wrong.append("sign")
    if not asks(draft) and not answer.draftable:
        wrong.append("a draft without blanks")
    return wrong


def filled(draft: str, answer: Answer, run: Run) -> str | None:
    """Return the recipe with its blanks filled in from the truth; None where the answer does not
    say what belongs there.
    """
    if not answer.draftable:
        return None
    recipe = tomllib.loads(draft)
    robot, time = recipe.get("robot", {}), recipe.get("time", {})
    if ASK in str(robot.get("use", "")):
        robot["use"] = "truth/arm.urdf"
    if ASK in str(robot.get("tip_link", "")):
        robot["tip_link"] = f"link_{run.n}"
    if ASK in str(robot.get("gravity", "")):
        robot["gravity"] = [0.0, -9.81, 0.0]
    column = time.get("column")
    known = {plain(name): unit for name, unit in answer.time.items()}
    if isinstance(column, str) and ASK in time.get("unit", ""):
        time["unit"] = known.get(column, ASK)
    if ASK in str(time.get("rate", "")) or time.get("unit") == "sample":
        time["rate"] = float(1.0 / (run.t[1] - run.t[0]))
    for name, entry in recipe["signals"].items():
        truth = answer.right.get(name, (Signal(()),))[0]
        if ASK in str(entry) and not (truth.columns and answer.texts and truth.units):
            return None
        if ASK in str(entry.get("columns", "")):
            entry["columns"] = list(map(plain, truth.columns))
        if ASK in str(entry.get("unit", "")):
            several = truth.units[0].split(",")
            entry["unit"] = several if len(several) > 1 else several[0]
    text = tomli_w.dumps(recipe)
    return None if ASK in text else text


def judge(lay: Layout, folder: Path, seed: int) -> tuple[str, str]:
    """Return (class, details) of one layout, written into `folder`."""
    folder = folder / "data"
    folder.mkdir()
    run, answer = written(lay, folder, seed)
    try:
        draft = draft_recipe(folder / answer.file).text
    except RrridError as problem:
        return ("refused" if answer.table and answer.draftable else "asks"), str(problem)[-300:]
    (folder.parent / "draft.toml").write_text(draft, encoding="utf-8")
    blanks, wrong = asks(draft), untrue(draft, lay, answer, run)
    if wrong:
        return "wrong", "; ".join(wrong)
    (folder / "truth").mkdir()
    (folder / "truth" / "arm.urdf").write_text(lay.arm.urdf())
    recipe = filled(draft, answer, run) if blanks else draft
    wrong = wrong_values(recipe, folder, answer, run) if recipe is not None else []
    if isinstance(wrong, str):
        return ("failed" if blanks else "refused"), wrong[-300:]
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
    wanted = [f"benchmarks.layouts_{part}" for part in sets]
    for module in wanted:
        import_module(module)
    return [lay for lay in LAYOUTS if lay.write.__module__ in wanted]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*")
    parser.add_argument("--set", choices=SETS, action="append")
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--seed", type=int, default=5100, help="of the first motion")
    options = parser.parse_args()
    layouts = load(options.set or SETS)
    chosen = [lay for lay in layouts if not options.names or lay.name in options.names]
    counts: Counter[str] = Counter()
    for k, lay in enumerate(chosen):
        with tempfile.TemporaryDirectory() as scratch:
            folder = (options.keep or Path(scratch)) / lay.name
            folder.mkdir(parents=True, exist_ok=True)
            verdict, details = judge(lay, folder, seed=options.seed + k)
        counts[verdict] += 1
        print(f"{lay.name:26} {verdict:8} {details}", flush=True)
    good, n = counts["right"] + counts["asks"], len(chosen)
    low, high = wilson(good, n)
    print(f"{dict(counts)}: right or asks {good}/{n} = {good / n:.3f} [{low:.3f}, {high:.3f}]")


if __name__ == "__main__":
    sys.modules["benchmarks.import_layouts"] = sys.modules["__main__"]
    main()
