"""Run the command as a user does."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

RRRID = (sys.executable, "-m", "rrrid_cli.main")
REPO = Path(__file__).resolve().parents[2]


def rrrid(*words: object, cwd: Path, **more: object) -> subprocess.CompletedProcess[str]:
    """Run the command in `cwd`, as a fresh process without a terminal."""
    environment = os.environ | {"PYTHONPATH": str(REPO)}
    environment |= more.pop("env", {})  # type: ignore[arg-type]
    return subprocess.run([*RRRID, *map(str, words)], capture_output=True, text=True, cwd=cwd, check=False, timeout=120,
                          stdin=subprocess.DEVNULL, env=environment, **more)  # type: ignore[call-overload, no-any-return]
