"""Damage TOML, CSV and URDF texts at random and read them: none may take long, much memory, or end
in an internal error.

    python -m benchmarks.mutations                10,000 of seed 0
    python -m benchmarks.mutations 500 7          500 of seed 7

A mutation takes one of some healthy texts and cuts, repeats, swaps, deletes or inserts pieces of
it, up to repeating a piece a hundred thousand times. Each is read in a process of its own, whose
time and peak of memory are measured, the peak beyond the memory in use before.
"""

from __future__ import annotations

import os
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipelines.errors import RrridError
from pipelines.importers.guess import guess_recipe
from pipelines.importers.recipe import parse_recipe
from pipelines.io.robot_files import load_robot
from rrrid_cli.options import make_settings

_REPO = Path(__file__).resolve().parents[1]
_SECONDS, _MEGABYTES = 5.0, 500.0  # the bars
_KILLED = 60  # [s]
_TOKENS = (
    "[",
    "]",
    "{",
    "}",
    '"',
    "'",
    '"""',
    "'''",
    ".",
    "a.",
    "=",
    ",",
    ";",
    "\n",
    "\r\n",
    "\0",
    "\\",
    "#",
    "%",
    "1e999",
    "nan",
    "inf",
    "-",
    "9" * 400,
    "\t",
    " ",
    "é",
    "→",
    "[[a]]",
    "[a.b]",
    "true",
    "2020-01-01",
    "0x",
    "1_",
    "<",
    ">",
    "&x;",
    "<link/>",
    "|",
)


@dataclass(frozen=True)
class Reading:
    """Result of reading one mutated text."""

    kind: str
    outcome: str  # "read", the code of an error, or "internal: …"
    seconds: float
    megabytes: float  # peak beyond what the process had before
    text: bytes


def mutations(count: int, seed: int) -> Iterator[tuple[str, bytes]]:
    """(kind, text) of `count` mutated texts."""
    rng = np.random.default_rng(seed)
    healthy = list(_healthy())
    for _ in range(count):
        kind, text = healthy[rng.integers(len(healthy))]
        for _ in range(rng.integers(1, 6)):
            text = _mutated(text, rng)
        yield kind, text.encode("utf-8", "surrogateescape")


def _healthy() -> Iterator[tuple[str, str]]:
    for path in sorted((_REPO / "sample_logs" / "robots").glob("*.toml")):
        yield "robot", path.read_text()
    for path in sorted((_REPO / "sample_logs" / "recipes").glob("*.toml")):
        yield "recipe", path.read_text()
    yield "settings", '[convert]\nto = "csv"\n'
    rng = np.random.default_rng(1)
    rows = np.round(np.cumsum(rng.normal(size=(300, 6)), axis=0), 4)
    names = ("q1 [rad]", "q2 [rad]", "q3 [rad]", "tau1 [Nm]", "tau2 [Nm]", "tau3 [Nm]")
    for separator in (",", ";", "\t", " "):
        lines = [separator.join(("t", *(name.replace(" ", "_") for name in names)))]
        lines += [separator.join(map(str, (0.01 * k, *row))) for k, row in enumerate(rows)]
        yield "csv", "\n".join(lines) + "\n"
    yield "csv", "\n".join(",".join(map(str, row)) for row in rows) + "\n"
    yield (
        "urdf",
        (
            '<robot name="r"><link name="a"/><link name="b"><inertial><mass value="1"/>'
            '<origin xyz="0 0 0.1"/>'
            '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            '<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
            '<limit lower="-1" upper="1" effort="9" velocity="2"/></joint></robot>'
        ),
    )


def _mutated(text: str, rng: np.random.Generator) -> str:
    """Return the text with one random change; the logarithm of a repetition's count is uniform up
    to 1e5.
    """
    a, b = sorted(int(k) for k in rng.integers(0, len(text) + 1, 2))
    piece = text[a : min(b, a + int(2.0 ** rng.uniform(0, 9)))]
    token = _TOKENS[rng.integers(len(_TOKENS))]
    many = int(10.0 ** rng.uniform(0, 5))
    repeated = (piece or token) * min(many, 400_000 // max(len(piece or token), 1))
    choices: tuple[Callable[[], str], ...] = (
        lambda: text[:a] + text[a + len(piece) :],
        lambda: text[:a] + repeated + text[a:],
        lambda: text[:a] + token * min(many, 400_000 // len(token)) + text[a:],
        lambda: text[:a],
        lambda: text[:a] + token + text[a + 1 :],
        lambda: text[:a] + text[b:] + piece,
        lambda: text[:a] + "".join(map(chr, rng.integers(1, 0x3000, 8))) + text[a:],
    )
    return choices[rng.integers(len(choices))]()[:2_000_000]


def read_apart(kind: str, text: bytes) -> Reading:
    """Read a text in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / {"csv": "r.csv", "urdf": "r.urdf"}.get(kind, "r.toml")
        path.write_bytes(text)
        ours, theirs = os.pipe()
        process = os.fork()
        if process == 0:
            signal.alarm(_KILLED)
            os.write(theirs, _read(kind, path).encode())
            os._exit(0)
        os.close(theirs)
        with os.fdopen(ours, "rb") as end:
            said = end.read().decode()
        os.waitpid(process, 0)
        outcome, _, figures = (said or f"internal: killed\n{_KILLED} 0").rpartition("\n")
        seconds, megabytes = map(float, figures.split())
        return Reading(kind, outcome, seconds, megabytes, text)


def _read(kind: str, path: Path) -> str:
    """In the child: the outcome, then seconds and megabytes."""
    before, began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    try:
        if kind in ("robot", "urdf"):
            load_robot(path)
        elif kind == "recipe":
            parse_recipe(path.read_text(encoding="utf-8", errors="surrogateescape"), path)
        elif kind == "settings":
            make_settings("convert", path, (), {})
        else:
            guess_recipe(path)
        outcome = "read"
    except RrridError as problem:
        outcome = problem.code if problem.exit_code in (2, 3, 5, 6) else f"internal: {problem}"
    except BaseException as problem:  # what a user would see as exit 70
        outcome = f"internal: {type(problem).__name__}: {str(problem)[:200]}"
    spent = time.process_time() - began
    return (
        f"{outcome}\n{spent} "
        f"{(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024.0}"
    )


def warm_up() -> None:
    """Read every healthy text here: what is imported for it then counts to no mutation."""
    with tempfile.TemporaryDirectory() as folder:
        for k, (kind, text) in enumerate(_healthy()):
            path = Path(folder) / f"{k}" / {"csv": "r.csv", "urdf": "r.urdf"}.get(kind, "r.toml")
            path.parent.mkdir()
            path.write_text(text)
            outcome = _read(kind, path).partition("\n")[0]
            assert outcome == "read", (kind, outcome)


def main(count: int, seed: int) -> int:
    """Print how all of them were read; the exit code is 1 where a bar is not met."""
    warm_up()
    found: Counter[str] = Counter()
    slowest = largest = Reading("", "", 0.0, 0.0, b"")
    wrong: list[Reading] = []
    for k, (kind, text) in enumerate(mutations(count, seed)):
        reading = read_apart(kind, text)
        found[f"{kind}: {reading.outcome.split(':')[0]}"] += 1
        slowest = max(slowest, reading, key=lambda one: one.seconds)
        largest = max(largest, reading, key=lambda one: one.megabytes)
        if (
            reading.outcome.startswith("internal")
            or reading.seconds > _SECONDS
            or reading.megabytes > _MEGABYTES
        ):
            wrong.append(reading)
            kept = Path(tempfile.gettempdir()) / f"rrrid-mutation-{seed}-{k}.{kind}"
            kept.write_bytes(text)
            print(
                f"{kept}: {reading.outcome}, {reading.seconds:.1f} s, {reading.megabytes:.0f} MB",
                flush=True,
            )
    for name, times in sorted(found.items()):
        print(f"  {name:24} {times}")
    print(
        f"{count} mutations of seed {seed}: slowest {slowest.seconds:.2f} s ({slowest.kind}), "
        f"largest {largest.megabytes:.0f} MB "
        f"({largest.kind}), {len(wrong)} beyond {_SECONDS:.0f} s or {_MEGABYTES:.0f} MB or "
        "internal errors"
    )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(
        main(
            int(sys.argv[1]) if len(sys.argv) > 1 else 10_000,
            int(sys.argv[2]) if len(sys.argv) > 2 else 0,
        )
    )
