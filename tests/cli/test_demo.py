"""`rrrid demo`: a first verdict for who has no files, no network and no MuJoCo."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pipelines.estimation.motion import Reconstruction, reconstruct
from pipelines.simulation.example import FAULT, example_arm, example_session
from tests.cli.commands import REPO, rrrid

QUICK = ("--no-report", "--set", 'run.skip=["fit-friction", "estimate-bps", "validate-writing", "frf", "diagnose", "extend"]')


def test_the_hidden_fault_is_in_the_logs() -> None:
    """The torque of the arm with the fault is the logged one but for the drives' noise; without it 0.2 N m and more are missing."""
    log = example_session(FAULT)[2]
    motion = reconstruct(log, Reconstruction()).motion
    inside = slice(200, -200)
    missing = [np.sqrt(np.mean((log.tau - arm.torque(motion))[inside, 1]**2)) for arm in (example_arm(FAULT), example_arm())]
    assert missing[0] < 0.1
    assert missing[1] > 0.2


def test_without_mujoco_and_network(tmp_path: Path) -> None:
    """With MuJoCo out of reach and sockets shut, the demo works; in a checkout it leaves nothing that git would take for work."""
    shutil.copy(REPO / ".gitignore", tmp_path)
    subprocess.run(["git", "init", "--quiet", tmp_path], check=True)
    code = ("import sys, socket\nsys.modules['mujoco'] = None\n"
            "def shut(*a, **k): raise OSError('no network')\nsocket.socket.connect = shut\nsocket.getaddrinfo = shut\n"
            f"sys.argv = ['rrrid', 'demo', '-q', *{QUICK!r}]\nfrom rrrid_cli.main import entry\nentry()")
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(REPO)}, text=True,
                          capture_output=True, check=False, timeout=300)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert (tmp_path / "demo").is_dir()
    said = subprocess.run(["git", "status", "--porcelain"], cwd=tmp_path, text=True, capture_output=True, check=True).stdout
    assert said.split() == ["??", ".gitignore"]


@pytest.mark.slow
def test_the_demo_names_what_it_hid(tmp_path: Path) -> None:
    """The whole of it: cogging at joint 2, its order within three std, nothing else."""
    done = rrrid("demo", "--no-report", "--json", cwd=tmp_path)
    finding, = json.loads(done.stdout)["findings"]
    assert (finding["cause"], finding["joint"]) == ("cogging", 2)
    order = finding["parameters"]["order"]
    assert abs(order["value"] - 18.0) < max(3.0 * order["std"], 0.02)


def test_a_place_that_is_taken_is_refused_before_the_arm_is_simulated(tmp_path: Path) -> None:
    """C05: what stands where the run's result would go is found first."""
    (tmp_path / "demo/run").mkdir(parents=True)
    (tmp_path / "demo/run/thesis.tex").write_text("years of work")
    done = rrrid("demo", *QUICK, cwd=tmp_path)
    assert (done.returncode, "RRID-C05 demo/run: " in done.stderr) == (2, True)
    assert [p.name for p in (tmp_path / "demo").iterdir()] == ["run"]
