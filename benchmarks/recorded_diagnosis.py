"""Diagnose the two recorded machines, and judge what is named on time that nothing was chosen by.

    python -m benchmarks.recorded_diagnosis                       both, as a table
    python -m benchmarks.recorded_diagnosis --only tx40 --folds 5
    python -m benchmarks.recorded_diagnosis --data FOLDER         of tx40/ and odrive/

The folder is else $RRRID_RECORDED, or ../shared/real.

TX40: Butterworth 4 at 100 Hz, 50 Hz, slow samples left out, as published. Time is cut into blocks;
each is held out once, and the whole search, and the choice of what is kept of it, is done without
it: the error over all of them is nobody's choice. ODrive: two runs at 0.1 rev/s are fitted, blocks
of them choose; a third one, and one at 0.03 rev/s, only judge.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.engine import Look, diagnose_prepared
from pipelines.diagnosis.trained import Standing, train
from pipelines.estimation.estimate import Recipe
from pipelines.estimation.preparation import Logs, Prepared, prepare
from pipelines.estimation.rows import Data
from pipelines.import_log import STAGE, Settings
from pipelines.io.files import open_log
from pipelines.io.log import Array, ExperimentLog
from pipelines.stage import Request, run_stage

TX40 = Recipe(cutoff_hz=100.0, decimation=100, min_speed=(0.05, 0.05, 0.05, 0.12, 0.12, 0.12))
_TX40_CAUSES = 8  # at most
_ODRIVE = Recipe(cutoff_hz=40.0)
_ODRIVE_CAUSES = 9
_FOLDS = 10  # unused where other rows judge
_GUARD = 1  # rows to either side of a held-out block: the low-pass reaches half a row


@dataclass(frozen=True)
class Step:
    """One cause that was accepted, and what the model with it leaves of time that it was not chosen
    by.
    """

    name: str  # "cogging:4"; "nominal" before any
    left: float  # squared residual [N^2 m^2]
    joints: tuple[float, ...]  # the same of each joint


@dataclass(frozen=True)
class Judged:
    """One search."""

    what: str
    power: float  # squared torque [N^2 m^2] of what judged
    steps: tuple[Step, ...]  # nominal, and every cause that the search keeps
    seconds: float  # of CPU

    @property
    def errors(self) -> list[float]:
        """Relative torque error after each step."""
        return [float(np.sqrt(step.left / self.power)) for step in self.steps]


def imported(name: str, data: Path) -> dict[str, ExperimentLog]:
    """Return the logs of a recorded set, by name."""
    with tempfile.TemporaryDirectory() as folder:
        done = run_stage(
            STAGE,
            Request((), Path(folder) / "out", no_report=True),
            Settings(recipe=name, source=data / name),
        )
        logs = [open_log(path).log for path in sorted((done.folder / "logs").glob("*.h5"))]
    return {log.name: log for log in logs}


def fold(data: Data, number: int, count: int) -> tuple[Data, Data]:
    """Return the rows of one log without block `number` of `count`, and that block alone."""
    one = data.logs[0]
    inside = np.arange(one.rows) * count // one.rows == number
    near = np.convolve(inside, np.ones(2 * _GUARD + 1), "same") > 0.0
    return (
        replace(data, logs=(replace(one, weighed=one.weighed & ~near),)),
        replace(data, logs=(replace(one, weighed=one.weighed & inside),)),
    )


def searched(prepared: Prepared, most: int, exclude: Sequence[str] = ()) -> Look:
    """Return what `diagnose` finds without reference logs, `most` causes at most."""
    return diagnose_prepared(prepared, DiagnosisConfig(causes=most), exclude).look


def judged(what: str, prepared: Prepared, look: Look, judge: Data, seconds: float) -> Judged:
    """Return what the models of a search, without its standing dictionary, leave of `judge`."""
    effects, standing = look.selection.end.model.effects, Standing(look.later.dataset.model)
    trained = train(replace(prepared, judge=judge), look.later, effects, _FOLDS, standing)
    names = ["nominal", *(place(one.effect.name, one.effect.joint) for one in effects)]
    steps = []
    for k, name in enumerate(names):
        left = np.where(judge.counts, trained.held_out(k), 0.0)
        own = tuple(float(np.sum(left[judge.joint == j] ** 2)) for j in range(judge.n_joints))
        steps.append(Step(name, float(left @ left), own))
    power = float(np.sum(np.where(judge.counts, judge.y, 0.0) ** 2))
    return Judged(what, power, tuple(steps), seconds)


def place(cause: str, joint: int | None) -> str:
    return cause if joint is None else f"{cause}:{joint}"


def judged_tx40(
    data: Path, numbers: Sequence[int], count: int, settings: Recipe = TX40
) -> list[Judged]:
    """Blocks `numbers` of `count`, each judged by a search that never saw it."""
    prepared = prepare(Logs.by_role(tuple(imported("tx40", data).values())), settings)
    out = []
    for number in numbers:
        begin = time.process_time()
        rest, judge = fold(prepared.data, number, count)
        own = replace(prepared, data=rest)
        found = searched(own, _TX40_CAUSES)
        seconds = time.process_time() - begin
        out.append(judged(f"block {number + 1} of {count}", own, found, judge, seconds))
        print(
            f"  {out[-1].what}: "
            + ", ".join(
                f"{step.name} {100 * error:.2f} %"
                for step, error in zip(out[-1].steps, out[-1].errors, strict=True)
            ),
            flush=True,
        )
    return out


def judged_odrive(data: Path, settings: Recipe = _ODRIVE) -> tuple[Look, list[Judged]]:
    """Search on two runs, judged on the others, which it did not see."""
    logs = imported("odrive", data)
    begin = time.process_time()
    prepared = prepare(Logs((logs["nocomp_0"], logs["nocomp_1"])), settings)
    found = searched(prepared, _ODRIVE_CAUSES)
    seconds = time.process_time() - begin
    out = []
    for name in ("nocomp_2", "comp_0", "slower_nocomp_0", "slower_comp_0"):
        other = prepare(Logs((logs["nocomp_0"],), (logs[name],)), settings)
        if other.judge is not None:
            out.append(judged(name, prepared, found, other.judge, seconds))
    return found, out


def nested_error(folds: Sequence[Judged]) -> tuple[float, float, Array]:
    """Relative error of the nominal model and of the last of each search over all blocks; and of
    the joints (joints,).
    """
    power = sum(one.power for one in folds)
    before, after = (
        float(np.sqrt(sum(one.steps[k].left for one in folds) / power)) for k in (0, -1)
    )
    return before, after, np.sqrt(np.sum([one.steps[-1].joints for one in folds], axis=0) / power)


def payoff(folds: Sequence[Judged]) -> dict[str, tuple[int, float]]:
    """Of each cause: in how many searches it was found, and what it took off the squared error of
    the blocks held out there.
    """
    out: dict[str, tuple[int, float]] = {}
    for one in folds:
        for before, after in zip(one.steps, one.steps[1:], strict=False):
            times, taken = out.get(after.name, (0, 0.0))
            out[after.name] = times + 1, taken + (before.left - after.left) / before.left
    return {name: (times, taken / times) for name, (times, taken) in out.items()}


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    here = (
        os.environ.get("RRRID_RECORDED") or Path(__file__).resolve().parents[2] / "shared" / "real"
    )
    parser.add_argument("--data", type=Path, default=Path(here))
    parser.add_argument("--only", choices=("tx40", "odrive"))
    parser.add_argument("--folds", type=int, default=5)
    given = parser.parse_args(arguments)
    if given.only != "tx40":
        _print_odrive(given.data)
    if given.only != "odrive":
        _print_tx40(given.data, given.folds)


def _print_tx40(data: Path, count: int) -> None:
    print(f"TX40, {count} blocks, each held out once")
    folds = judged_tx40(data, range(count), count)
    before, after, joints = nested_error(folds)
    print(
        f"  relative torque error held out: nominal {100 * before:.2f} %, extended "
        f"{100 * after:.2f} % (bar 5.0, aim 4.5)"
    )
    print("  share of each joint:", ", ".join(f"{100 * x:.2f} %" for x in joints))
    for name, (times, taken) in sorted(payoff(folds).items(), key=lambda item: -item[1][1]):
        print(
            f"  {name:28s} found in {times} of {count}, takes {100 * taken:6.2f} % off the squared "
            "error held out"
        )
    print(f"  {sum(one.seconds for one in folds):.0f} s of CPU")


def _print_odrive(data: Path) -> None:
    print("ODrive")
    found, runs = judged_odrive(data)
    for one in found.selection.end.model.effects:
        print(
            f"  {one.effect.name:22s}",
            ", ".join(f"{name} {value:.4g}" for name, value in one.values.items()),
        )
    inertia = float(found.selection.end.model.beta[0])
    print(f"  inertia {inertia:.3g} kg m^2 (2.5e-4 within 30 %: 1.75e-4 to 3.25e-4)")
    for run in runs:
        print(
            f"  {run.what:18s} held-out error "
            + " -> ".join(f"{100 * error:.1f}" for error in run.errors)
            + " %"
        )
    print(f"  {runs[0].seconds:.0f} s of CPU")


if __name__ == "__main__":
    main()
