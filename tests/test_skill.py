"""The guide for coding assistants: its steps pass as written, on the beginning of sample logs."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

from pipelines.io.files import open_log
from tests.diagnose.sessions import written
from tests.healthy import begun

ROOT = Path(__file__).resolve().parents[1]
LOGS = ROOT / "sample_logs" / "rrr-closed-form"


def test_the_steps_of_the_skill_pass_as_written(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "SKILL.md").read_text()
    logs = written(tmp_path / "logs", [begun(open_log(path).log, 6000) for path in LOGS.glob("*.h5")])
    replay = logs / "free-1.h5"
    commands = "\n".join(re.findall(r"```sh\n(.*?)```", text, re.DOTALL))
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    script = commands.replace("LOGS", str(logs)).replace("REPLAY", str(replay))
    done = subprocess.run(["bash", "-e", "-c", script], cwd=tmp_path, env={**os.environ, "PATH": path}, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "held-out torque error 0.00" in done.stdout
    assert "no-fault-found | " in done.stdout
    assert json.loads((tmp_path / "simulate.json").read_text())["command"] == "simulate"
