"""`rrrid batch` on 200 logs of 10 s, beside one process for each log: CPU seconds of all processes,
in turn.

    python -m benchmarks.batch [--logs 200] [--stage reconstruct] [--alone 20] [--memory 1000]

Goals (performance.md): 15 times less than a process a log; 5 ms an item beyond what its stage takes
in a process that is warm; with --memory, memory that does not grow after the first 20 items. CPU
seconds first of all: the machine is shared. Reports are left out. The processes of their own are
timed on --alone logs, in turn with batches, and scaled to all.
"""

from __future__ import annotations

from benchmarks.startup import cpu_seconds  # isort: skip

import argparse
import ctypes
import gc
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from pipelines.batch import module_of
from pipelines.executor import load_stage
from pipelines.io.files import open_log, write_log
from pipelines.stage import Request, run_stage

REPO = Path(__file__).resolve().parents[1]
SAMPLE = REPO / "sample_logs/rrr-closed-form/excitation-1.h5"
RRRID = (sys.executable, "-m", "rrrid_cli.main")
_PR_SET_CHILD_SUBREAPER = (
    36  # prctl(2): whose processes lose their parent, gets them, and their CPU time with them
)


def lay(root: Path, count: int, seconds: float = 10.0) -> None:
    """`count` folders of one log, each log another."""
    log = open_log(SAMPLE).log
    keep = log.signals["t"].values < log.signals["t"].values[0] + seconds
    signals = {
        name: replace(signal, values=signal.values[keep]) for name, signal in log.signals.items()
    }
    for i in range(count):
        tau = replace(signals["tau"], values=signals["tau"].values * (1.0 + 1e-6 * i))
        write_log(
            root / f"{i:04d}/log.h5", replace(log, signals={**signals, "tau": tau}, period=None)
        )


def batch(root: Path, out: Path, stage: str, jobs: int) -> tuple[float, float]:
    """[s] CPU of a batch, all its processes together, and by the clock."""
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    subprocess.run(
        [
            *RRRID,
            "batch",
            str(root),
            "--stage",
            stage,
            "--jobs",
            str(jobs),
            "--no-report",
            "-q",
            "--out",
            str(out),
        ],
        check=False,
        cwd=REPO,
    )
    lasted = time.monotonic() - began
    while True:  # the server of its workers comes to us when it has ended, and brings theirs
        try:
            os.wait()
        except ChildProcessError:
            break
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    shutil.rmtree(out)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime, lasted


def warm_cpu(root: Path, out: Path, stage: str) -> float:
    """[s] CPU of an item's stage in this process, the mean of all items after the first five."""
    gc.set_threshold(100_000, 20, 20)
    module = load_stage(module_of(stage))

    def mine() -> float:
        own, children = (
            resource.getrusage(resource.RUSAGE_SELF),
            resource.getrusage(resource.RUSAGE_CHILDREN),
        )
        return own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime + _living()

    began = 0.0
    folders = sorted(root.iterdir())
    for i, folder in enumerate(folders):
        if i == 5:
            began = mine()
        run_stage(
            module,
            Request((folder,), out / folder.name, no_report=True, check=True),
            module.settings(),
        )
        gc.collect()  # what an item leaves in cycles is part of it
        if i < 3:
            gc.freeze()
    spent = (mine() - began) / (len(folders) - 5)
    shutil.rmtree(out)
    return spent


def _living() -> float:
    """[s] CPU of this process's children that have not ended: the one that reads logs."""
    spent = 0.0
    for child in Path(f"/proc/self/task/{os.getpid()}/children").read_text().split():
        fields = Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()
        spent += (int(fields[11]) + int(fields[12])) / os.sysconf(
            "SC_CLK_TCK"
        )  # proc(5): utime, stime
    return spent


def memory(root: Path, out: Path, stage: str) -> list[tuple[int, float]]:
    """(items done, MB of the largest process) all along a batch with one worker."""
    words = (
        "batch",
        str(root),
        "--stage",
        stage,
        "--jobs",
        "1",
        "--no-report",
        "-v",
        "--out",
        str(out),
    )
    process = subprocess.Popen(
        [*RRRID, *words],
        cwd=REPO,
        stderr=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    )
    assert process.stderr is not None
    seen = []
    for line in process.stderr:
        done = line.split(" of ")[0]
        if done.isdigit() and (int(done) in (1, 5, 10, 20) or int(done) % 100 == 0):
            seen.append((int(done), max(_resident(process.pid))))
    process.wait()
    return seen


def _resident(group: int) -> list[float]:
    """[MB] of each process of a group, what they share counted in each."""
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        try:
            if int((path / "stat").read_text().rpartition(")")[2].split()[2]) == group:
                found.append(
                    int((path / "statm").read_text().split()[1]) * resource.getpagesize() / 1e6
                )
        except (OSError, IndexError):
            continue  # it has just ended
    return found or [0.0]


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--logs", type=int, default=200)
    options.add_argument("--alone", type=int, default=20)
    options.add_argument("--repeats", type=int, default=3)
    options.add_argument("--stage", default="reconstruct")
    options.add_argument("--memory", type=int, default=0)
    given = options.parse_args()
    ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        lay(folder / "root", max(given.logs, given.alone))
        print(
            f"{given.stage}, {given.logs} logs of 10 s: CPU of all processes, and by the clock [s]"
        )
        ratios = [
            _side_by_side(folder, given.stage, given.logs, given.alone)
            for _ in range(given.repeats)
        ]
        cpu, clock = (statistics.median(one) for one in zip(*ratios, strict=True))
        print(f"median: ×{cpu:.1f} by CPU, ×{clock:.1f} by the clock with two workers")
        _overhead(folder, given.stage, given.logs)
        if given.memory:
            shutil.rmtree(folder / "root")
            lay(folder / "root", given.memory, seconds=2.0)
            began = time.monotonic()
            for done, size in memory(folder / "root", folder / "out", given.stage):
                print(f"  {done:5d} items {size:7.1f} MB")
            print(f"  {time.monotonic() - began:.0f} s")


def _side_by_side(folder: Path, stage: str, logs: int, alone: int) -> tuple[float, float]:
    """How many times more a process a log takes than a batch: CPU, and by the clock one after
    another.
    """
    whole, lasted = batch(folder / "root", folder / "out", stage, 2)
    began = time.monotonic()
    single = statistics.mean(
        cpu_seconds(
            [
                *RRRID,
                stage,
                str(folder / f"root/{i:04d}"),
                "--no-report",
                "-q",
                "--out",
                str(folder / "one"),
            ]
        )
        for i in range(alone)
    )
    clock = (time.monotonic() - began) / alone
    print(
        f"  batch {whole:7.2f} {lasted:7.2f}   a process a log {single * logs:7.2f} "
        f"{clock * logs:7.2f}"
        f"   ×{single * logs / whole:.1f} ×{clock * logs / lasted:.1f}"
    )
    return single * logs / whole, clock * logs / lasted


def _overhead(folder: Path, stage: str, logs: int) -> None:
    """Print what an item costs in a batch with one worker, beyond its stage in a warm process."""
    for i in range(10):
        shutil.copytree(folder / f"root/{i:04d}", folder / f"few/{i:04d}")
    differences = []
    for _ in range(3):
        warm = warm_cpu(folder / "root", folder / "warm", stage)
        few, whole = (batch(folder / name, folder / "out", stage, 1)[0] for name in ("few", "root"))
        item = (whole - few) / (logs - 10)
        differences.append(item - warm)
        print(
            f"  an item in a warm process {1e3 * warm:.1f} ms CPU, in a batch {1e3 * item:.1f} ms; "
            f"a batch of ten {few:.2f} s"
        )
    print(f"overhead {1e3 * statistics.median(differences):.1f} ms an item")


if __name__ == "__main__":
    main()
