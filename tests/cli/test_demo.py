"""`rrrid demo`: a first verdict for who has no files, no network and no MuJoCo."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import threading
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipelines import demo
from pipelines.diagnosis.result import Diagnosis, Finding, NotIdentifiable, Value
from pipelines.errors import InputRejected
from pipelines.estimation.motion import Reconstruction, reconstruct
from pipelines.io.files import write_log
from pipelines.simulation.example import FAULT, example_arm, example_session
from pipelines.stage import Request
from tests.cli.commands import REPO, rrrid
from tests.io.logs import small_log

QUICK = ("--no-report", "--set", 'run.skip=["fit-friction", "estimate-bps", "validate-writing", "frf", "diagnose", "extend"]')


def test_the_hidden_fault_is_in_the_logs() -> None:
    """The torque of the arm with the fault is the logged one but for the drives' noise; without it 0.2 N m and more are missing."""
    log = example_session(FAULT)[2]
    motion = reconstruct(log, Reconstruction()).motion
    inside = slice(200, -200)
    missing = [np.sqrt(np.mean((log.tau - arm.torque(motion))[inside, 1]**2)) for arm in (example_arm(FAULT), example_arm())]
    assert missing[0] < 0.1
    assert missing[1] > 0.2


def test_logs_and_what_was_hidden(tmp_path: Path) -> None:
    """Logs that rrrid run takes, the run beside them; the end says what was hidden, what was found, and what to do next."""
    done = rrrid("demo", *QUICK, "--fault", "quadratic_drag:3:coefficient=0.1", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    told, found, report, next_ = done.stdout.splitlines()[-4:]
    assert told == "Was hidden: quadratic drag at joint 3 (coefficient 0.1 N m s²/rad²)."
    assert found.startswith("Was found: ")
    assert report.split(maxsplit=1) == ["Report:", "none was asked for"]
    assert "rrrid run FOLDER" in next_
    assert sorted(p.name for p in (tmp_path / "demo").iterdir()) == ["recording", "run"]
    assert len(list((tmp_path / "demo/recording/logs").iterdir())) == 3
    assert json.loads((tmp_path / "demo/run/result.json").read_text())["stages"][0]["name"] == "inspect"
    refused = rrrid("demo", *QUICK, "--fault", "quadratic_dog:3", cwd=tmp_path)
    assert (refused.returncode, "quadratic_drag" in refused.stderr) == (2, True)


def test_an_arm_that_runs_away_is_told_of_the_fault() -> None:
    """No log gave gains, and nobody gave a model: another number is what helps."""
    with pytest.raises(InputRejected, match=r"RRID-D17 .*joint_elasticity:2:stiffness=2000.* another number") as refused:
        demo.compute(demo.read(Request(()), demo.Settings()), demo.Settings(fault=("joint_elasticity:2:stiffness=2000",)))
    assert "log" not in refused.value.remedy


@pytest.mark.slow
@pytest.mark.row("C05")
def test_what_was_put_in_its_place_is_not_replaced(tmp_path: Path) -> None:
    """Another command's result is where the logs go: it is refused, with what to do."""
    write_log(tmp_path / "a.h5", small_log())
    assert rrrid("convert", "a.h5", "--out", "demo/recording", "--no-report", cwd=tmp_path).returncode == 0
    done = rrrid("demo", *QUICK, cwd=tmp_path)
    assert done.returncode == 2
    assert "holds the earlier result of convert" in done.stderr


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


def test_the_end_lays_what_was_found_beside_what_was_hidden() -> None:
    """The same numbers of both, with their deviations; nothing, what has no name, and no diagnosis are told apart."""
    recorded = demo.Result("arm", ("cogging:2:order=18,amplitude=0.4",), ())
    numbers = {name: Value(value, 0.002, unit) for name, value, unit in
               (("amplitude", 0.399, "N m"), ("order", 18.001, "1/rev"), ("phase", 1.0, "rad"), ("amplitude_2", 0.1, "N m"))}
    bare: Any = {field.name: None for field in fields(Finding)}
    one = Finding(**(bare | {"cause": "cogging", "joint": 2, "parameters": numbers}))

    def end(verdict: str, *findings: Finding) -> str:
        nothing: Any = {field.name: None for field in fields(Diagnosis)} | {"not_identifiable": ()}
        return demo.ending(recorded, Diagnosis(**(nothing | {"verdict": verdict, "findings": findings})))[1]

    assert demo.ending(recorded, None)[0] == "Was hidden: cogging at joint 2 (order 18 per rev, amplitude 0.4 N m)."
    assert end("cause", one) == "Was found:  cogging at joint 2 (order 18.0010 ± 0.0020 per rev, amplitude 0.3990 ± 0.0020 N m)."
    assert len({end("no-fault-found"), end("unknown"), demo.ending(recorded, None)[1]}) == 3


@pytest.mark.parametrize(("fault", "joint", "blind"), [
    ("joint_elasticity:2:stiffness=2e4", None, True), ("rotor_inertia:1:inertia=0.1", 1, True), ("payload:mass=1", None, True),
    ("rotor_inertia:3:inertia=0.1", 1, False), ("torque_gain:1:gain_error=0.1", None, False)])
def test_what_such_logs_cannot_show_is_said_with_what_would(fault: str, joint: int | None, blind: bool) -> None:
    """A spring that only frequency responses tell: nothing was found, for another reason than that nothing is there."""
    beyond = NotIdentifiable(fault.split(":")[0], joint, "needs what nobody recorded", "Record that.")
    nothing: Any = {field.name: None for field in fields(Diagnosis)}
    found = Diagnosis(**(nothing | {"verdict": "no-fault-found", "findings": (), "not_identifiable": (beyond,)}))
    _, second, *more = demo.ending(demo.Result("arm", (fault,), ()), found)
    assert second.startswith("Was found:  nothing; of " if blind else "Was found:  nothing.")
    assert ("such logs say nothing: needs what nobody recorded" in second) is blind
    assert more == ["To see it:  Record that."] * blind


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


def test_nothing_is_told_after_a_simulation_that_failed(tmp_path: Path) -> None:
    """The thread that reports a long step ends with the command."""
    before = set(threading.enumerate())
    done = rrrid("demo", *QUICK, "--fault", "joint_elasticity:2:stiffness=2000", cwd=tmp_path)
    assert done.returncode != 0
    assert set(threading.enumerate()) <= before
