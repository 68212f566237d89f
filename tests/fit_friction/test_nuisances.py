"""Rests, a vertical axis, a coarse encoder and friction that drifts, as logs of a joint in a position loop show them.

Recorded cases: ../shared/cases, made by a program of their own (LuGre friction, PD loop); see each README there. Machines
under gravity: tests/friction/closed_loop.py.
"""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipelines import fit_friction
from pipelines.fit_friction import Settings
from pipelines.friction.findings import misfits
from pipelines.friction.fit import Value
from pipelines.friction.result import JointResult, Result
from pipelines.io.files import Opened
from pipelines.io.log import ExperimentLog
from pipelines.stage import Inputs
from tests.cli.commands import rrrid
from tests.friction.closed_loop import draw, logs_of


def fitted(shared: Path, folder: Path, case: str) -> dict[str, Any]:
    """The result of a recorded case, imported by its recipe and fitted with a free choice of laws."""
    recipe = next((shared / "cases").glob(f"{case}-*")) / "r.toml"
    made = rrrid("import", str(recipe), "--out", "imp", "--no-report", cwd=folder)
    assert made.returncode == 0, made.stderr
    made = rrrid("fit-friction", "imp", "--out", "o", "--no-report", "--json", cwd=folder)
    assert made.returncode == 0, made.stderr
    result: dict[str, Any] = json.loads(made.stdout)
    return result


def within(value: dict[str, float], truth: float, std: float, relative: float) -> bool:
    return abs(value["value"] - truth) <= max(std * value["std"], relative * abs(truth))


@pytest.mark.slow
def test_rests_do_not_count_as_sliding(shared: Path, tmp_path: Path) -> None:
    """Case 24: 3 and 2 N m, 1.0 and 1.6 N m s/rad, 0.5 kg m²; no gravity about an axis that is parallel to it."""
    (joint,) = fitted(shared, tmp_path, "24")["joints"]
    numbers = joint["parameters"]
    assert within(numbers["asymmetric_friction.coulomb_difference"], 1.0, 2.0, 0.001)
    assert within(numbers["asymmetric_friction.viscous_difference"], -0.6, 2.0, 0.001)
    assert within(joint["inertia"], 0.5, 2.0, 0.001)
    assert all(value["value"] == 0.0 for value in joint["gravity"].values())
    assert joint["sticking"]["share"] > 0.2
    assert joint["drift"] is None


@pytest.mark.slow
def test_a_coarse_encoder_is_given_longer_windows(shared: Path, tmp_path: Path) -> None:
    """Case 26: 2 mrad a count. The inertia is 0.5 kg m² within two of its standard deviations, and these are below 2 %."""
    (joint,) = fitted(shared, tmp_path, "26")["joints"]
    assert within(joint["inertia"], 0.5, 2.0, 0.0)
    assert joint["inertia"]["std"] < 0.01
    assert joint["sticking"]["window"] > 0.02


def test_friction_that_warms_up_is_named_with_its_course(shared: Path, tmp_path: Path) -> None:
    """Case 28: friction falls by 35 % with 15 s, anew in each log of 32 s: by 0.31 of 0.77 in its middle."""
    result = fitted(shared, tmp_path, "28")
    (joint,) = result["joints"]
    assert joint["drift"]["kind"] == "trend"
    assert joint["drift"]["when"] == pytest.approx(15.0, rel=0.25)
    assert 0.0 < joint["drift"]["when_std"] < 0.25 * 15.0
    assert abs(joint["drift"]["when"] - 15.0) < 3.0 * joint["drift"]["when_std"]
    assert joint["drift"]["change"]["value"] == pytest.approx(-0.40, abs=0.03)
    assert any(check["code"] == "RRID-D26" and "falls" in check["message"] for check in result["checks"])
    assert within(joint["inertia"], 0.5, 2.0, 0.002)


MACHINES = {
    "rests": replace(draw("rests", 1), seconds=20.0, rests=0.2),
    # a drive that regenerates and does not log it: torque that falls as speed rises
    "regenerating": replace(draw("rests", 1), seed=2, seconds=20.0, rests=0.2, viscous=(-0.4, -0.4), coulomb=(4.0, 4.0)),
}


@cache
def logs() -> dict[str, ExperimentLog]:
    """Logs of these machines, integrated side by side."""
    return dict(zip(MACHINES, logs_of(list(MACHINES.values())).values(), strict=True))


@cache
def computed(name: str, law: str | None) -> tuple[JointResult, Result]:
    opened = Opened(Path("a.h5"), "", logs()[name], ())
    result = fit_friction.compute(Inputs((opened,), label="logs"), Settings(law=law))
    return result.joints[0], result


def sure(value: Value, truth: float) -> bool:
    assert value.std is not None
    return abs(value.value - truth) <= max(3.0 * value.std, 0.002 * abs(truth))


def test_constant_speeds_under_a_loop_and_gravity() -> None:
    """Inertia, both sides of gravity and the curve, to three standard deviations or 0.2 %."""
    machine = MACHINES["rests"]
    joint, result = computed("rests", "asymmetric_friction")
    assert sure(joint.inertia, machine.inertia)
    assert sure(joint.gravity["sine"], machine.weight * np.cos(machine.hanging))
    assert sure(joint.gravity["cosine"], -machine.weight * np.sin(machine.hanging))
    speed = joint.driven[1] * np.array([-0.9, -0.5, 0.5, 0.9])
    apart = np.abs(np.interp(speed, joint.series.speed, joint.series.curve) - machine.friction(speed))
    assert np.all(apart <= 0.005 * np.abs(machine.friction(speed)))
    assert not any(check.code in ("RRID-D26", "RRID-D08", "RRID-S14") for check in result.checks)


def test_viscous_friction_below_zero_is_named() -> None:
    """It is reported with the possible reasons."""
    _, result = computed("regenerating", "coulomb+viscous")
    (check,) = [check for check in result.checks if check.code == "RRID-S14"]
    assert "viscous friction" in check.message
    assert "regenerat" in check.remedy


def test_an_inertia_below_zero_is_remarked() -> None:
    """Of a joint that was driven alone within its deviation, of one among all at any."""
    joint, _ = computed("rests", "asymmetric_friction")
    below = replace(joint, inertia=Value(-0.02, 0.015, "kg m^2"))
    (check,) = misfits((below,), "logs")
    assert (check.code, "these logs do not show it" in check.message) == ("RRID-S14", True)
    among = replace(below, inertia=Value(-0.2, 0.015, "kg m^2"), validation=replace(joint.validation, by=""))
    assert any("opposite signs" in check.message for check in misfits((among,), "logs"))
    assert not misfits((joint,), "logs")


def test_a_validation_log_at_rest_judges_nothing() -> None:
    """It is reported, and held-out blocks of the identification log judge."""
    log = logs()["rests"]
    still = {name: replace(signal, values=signal.values[:2500].copy()) for name, signal in log.signals.items()}
    still["q"] = replace(still["q"], values=MACHINES["rests"].encoder * (np.arange(2500) % 7 == 0.0)[:, None])
    rest = replace(log, name="rest", role="validate", signals=still)
    result = fit_friction.compute(Inputs(tuple(Opened(Path(f"{one.name}.h5"), "", one, ()) for one in (log, rest)), label="logs"),
                                  Settings(law="coulomb+viscous"))
    assert result.joints[0].judged_by == "blocks"
    assert any(check.code == "RRID-D09" and "validation" in check.message for check in result.checks)
