"""Start `rrrid --help`, against the smallest program that typer can make: CPU seconds of a fresh
process.

python -m benchmarks.startup
"""

from __future__ import annotations

import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

PEER = """
import typer
app = typer.Typer(pretty_exceptions_enable=False, rich_markup_mode=None)
@app.command()
def one(x: int = 1) -> None: "one"
@app.command()
def two(x: int = 1) -> None: "two"
app()
"""


def cpu_seconds(command: list[str]) -> float:
    """User and system time of `command`, as the operating system counted it."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)  # os.times counts in steps of 10 ms
    subprocess.run(command, stdout=subprocess.DEVNULL, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main(repeats: int = 15) -> None:
    rrrid = shutil.which(
        "rrrid", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    )
    if rrrid is None:
        sys.exit("rrrid is not installed in this environment: pip install -e .")
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "peer.py"
        script.write_text(PEER)
        runs = [
            (cpu_seconds([rrrid, "--help"]), cpu_seconds([sys.executable, str(script), "--help"]))
            for _ in range(repeats)
        ]
    ours, peer = (statistics.median(side) for side in zip(*runs, strict=True))
    print(
        f"rrrid --help {1e3 * ours:.0f} ms CPU, typer alone {1e3 * peer:.0f} ms, ratio "
        f"{ours / peer:.2f}; goal ≤ 200 ms"
    )


if __name__ == "__main__":
    main()
