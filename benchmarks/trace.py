"""Count the files and functions of the project that one command enters.

    python -m benchmarks.trace                              `diagnose` on sample_logs/rrr-changed
    python -m benchmarks.trace estimate-bps sample_logs/rrr-closed-form --files

It runs in one thread; comprehensions and lambdas count with the function that holds them.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path
from types import FrameType

import typer

from rrrid_cli.main import call

ROOT = Path(__file__).parents[1]
PRODUCT = tuple(f"{ROOT / folder}/" for folder in ("pipelines", "rrrid_cli", "rrrid"))


def traced(arguments: list[str]) -> Counter[tuple[str, str]]:
    """Run a command; return how often each (file, function) of the product was called."""
    called: Counter[tuple[str, str]] = Counter()

    def enter(frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(PRODUCT):
            name = code.co_qualname.split(".<locals>")[0]
            if name != "<module>":
                called[str(Path(code.co_filename).relative_to(ROOT)), name] += 1

    sys.setprofile(enter)
    try:
        call(arguments)
    except typer.Exit:
        pass
    finally:
        sys.setprofile(None)
    return called


def main() -> None:
    """Print how many files and functions a command enters."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("command", nargs="?", default="diagnose")
    parser.add_argument("logs", nargs="?", default=str(ROOT / "sample_logs" / "rrr-changed"))
    parser.add_argument("--files", action="store_true", help="list the functions of each file")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        called = traced([asked.command, asked.logs, "--out", f"{folder}/out"])
    functions = Counter(file for file, _ in called)
    print(f"{asked.command}: {len(functions)} files, {len(called)} functions")
    for file, count in functions.most_common() if asked.files else ():
        print(f"{count:5d} {file}")


if __name__ == "__main__":
    main()
