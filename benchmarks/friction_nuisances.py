"""Friction laws of joints in a position loop: rests, closed loop, vertical axis, 12 bits, drift,
stick-slip.

    python -m benchmarks.friction_nuisances --out FOLDER [--kinds rests 12-bit] [--count 30]

Each kind draws its machines from tests/friction/closed_loop.py and fits them with the
defaults of `rrrid fit-friction`. Values judged: the inertia, and the friction curve at a quarter,
half and nine tenths of the fastest speed, both ways, each within two of its standard deviations or
not. Of a drift: whether it is named, and as what. Machines that are done are not done again.
Intervals are those of Wilson 1927 at 95 %; the values of one machine are not independent.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.hidden_effects.table import wilson
from pipelines import fit_friction
from pipelines.errors import RrridError
from pipelines.fit_friction import Settings
from pipelines.friction.result import JointResult
from pipelines.io.files import Opened
from pipelines.io.log import Array, ExperimentLog
from pipelines.stage import Inputs
from tests.friction.closed_loop import KINDS, Machine, draw, logs_of

_PLACES = (0.25, 0.5, 0.9)  # of the fastest speed of the fit


def rate(right: int, count: int) -> str:
    """Share and its interval in per cent."""
    low, high = wilson(right, count)
    return (
        f"{right}/{count} = {100 * right / count:.1f} % ({100 * low:.1f} to {100 * high:.1f})"
        if count
        else "none"
    )


def judge(machine: Machine, log: ExperimentLog) -> dict[str, Any]:
    """Errors in standard deviations, and what was said."""
    begun = time.process_time()
    try:
        result = fit_friction.compute(
            Inputs((Opened(Path(f"{log.name}.h5"), "", log, ()),), label=log.name), Settings()
        )
    except RrridError as refused:
        return {"name": log.name, "refused": f"{refused.code} {refused}"}
    (joint,) = result.joints
    series = joint.series
    speed = joint.driven[1] * np.array([side * place for place in _PLACES for side in (1.0, -1.0)])
    curve, band = (np.interp(speed, series.speed, x) for x in (series.curve, series.band))
    truth = machine.friction(speed) * machine.scale(np.array([_reference(joint, machine)]))
    gravity = {name: (value.value, value.std) for name, value in joint.gravity.items()}
    drift = joint.drift
    return {
        "name": log.name,
        "law": joint.law,
        "inertia": (joint.inertia.value, joint.inertia.std, machine.inertia),
        "curve": [list(map(float, row)) for row in zip(speed, curve, band, truth, strict=True)],
        "gravity": gravity,
        "weight": (
            machine.weight * math.cos(machine.hanging),
            -machine.weight * math.sin(machine.hanging),
        ),
        "drift": None if drift is None else [drift.kind, drift.when, drift.change.value],
        "codes": [check.code for check in result.checks],
        "seconds": time.process_time() - begun,
    }


def _reference(joint: JointResult, machine: Machine) -> float:
    """Time for which the law holds [s]: that said, and of a drift that was missed the middle of the
    log.
    """
    return machine.seconds / 2 if joint.drift is None else joint.drift.holds_at


def table(kind: str, rows: list[dict[str, Any]]) -> None:
    """Print one line of figures for a kind of machine."""
    fits = [row for row in rows if "refused" not in row]
    numbers = np.array([row["inertia"] for row in fits], dtype=np.float64).reshape(-1, 3)
    values = np.array([value for row in fits for value in row["curve"]], dtype=np.float64).reshape(
        -1, 4
    )
    inertia, curve = (
        (numbers[:, 0] - numbers[:, 2]) / numbers[:, 1],
        (values[:, 1] - values[:, 3]) / values[:, 2],
    )
    relative = np.median(np.abs(numbers[:, 0] / numbers[:, 2] - 1.0)) if fits else math.nan
    named = [row for row in fits if row["drift"] is not None]
    as_kind = sum(row["drift"][0] == kind for row in named)
    seconds = np.mean([row["seconds"] for row in fits]) if fits else math.nan
    print(
        f"{kind:12s} refused {len(rows) - len(fits)}/{len(rows)}; J {_within(inertia)}, median "
        f"error {100 * relative:.2f} %; "
        f"curve {_within(curve)}; drift named {rate(len(named), len(fits))}, as {kind} {as_kind}; "
        f"{seconds:.1f} s",
        flush=True,
    )


def _within(errors: Array) -> str:
    return rate(int(np.sum(np.abs(errors) <= 2.0)), len(errors))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--kinds", nargs="+", default=list(KINDS), choices=KINDS)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=30)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    machines = [
        draw(kind, seed)
        for kind in arguments.kinds
        for seed in range(arguments.first, arguments.first + arguments.count)
    ]
    path = arguments.out / "judged.jsonl"
    done = (
        {row["name"]: row for row in map(json.loads, path.read_text().splitlines())}
        if path.exists()
        else {}
    )
    missing = [m for m in machines if f"{m.kind}-{m.seed}" not in done]
    logs = logs_of(missing)
    with path.open("a") as file:
        for machine in missing:
            row = judge(machine, logs[f"{machine.kind}-{machine.seed}"])
            done[str(row["name"])] = json.loads(json.dumps(row))
            file.write(json.dumps(row) + "\n")
            file.flush()
    for kind in arguments.kinds:
        table(kind, [done[f"{m.kind}-{m.seed}"] for m in machines if m.kind == kind])


if __name__ == "__main__":
    main()
