"""The friction fit on the virtual test bench: MuJoCo moves the whole arm, held joints sway, and nothing of ours is in it."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from pipelines.bench.experiments import friction
from pipelines.bench.machine import Machine, draw_machine
from pipelines.bench.rigid import RigidDynamics
from pipelines.bench.session import record
from pipelines.model.friction.joint import JointFit, JointLogs, fit_joint
from pipelines.model.friction.laws import law_named
from pipelines.model.motion import Reconstruction, reconstruct
from tests.model.friction.one_joint import relative


def machine(seed: int) -> Machine:
    """Links ±10 %, friction ±20 %, 1e-5 rad, 0.02 N m at every joint."""
    return replace(draw_machine(seed, nuisances=False), amplifier_noise=(0.02,) * 3)


@lru_cache
def fitted(seed: int, joint: int) -> tuple[JointFit, float, float]:
    """The fit of one joint; error of its curve over the driven speeds; inertia of the bench's arm with the others locked."""
    bench = machine(seed)
    (log,) = record(bench, (), [friction(bench, joint, seed)], seed)
    found = fit_joint(JointLogs(joint, ((log, reconstruct(log, Reconstruction())),)), 0.02, law_named("three_sigmoid"))
    law = bench.friction[joint - 1].law()
    speed = np.geomspace(found.covered.slowest, found.covered.fastest, 100)
    speed = np.concatenate([-speed[::-1], speed])
    inertia = RigidDynamics(bench.robot).mass_matrix(np.median(log.q, axis=0))[joint - 1, joint - 1]
    return found, relative(found.fit.curve(speed), np.array([law(v) for v in speed.tolist()])), float(inertia)


def check(seed: int, joint: int) -> float:
    found, error, inertia = fitted(seed, joint)
    assert found.fit.inertia == pytest.approx(inertia, rel=0.01)
    errors = [found.driven.error(simulated) for simulated in (found.driven.with_friction, found.driven.without)]
    assert errors[0] <= 0.05 * errors[1]
    return error


def test_one_joint_of_one_machine() -> None:
    """Curve below 1.2 %, inertia to 1 %, simulated speed 20 times closer than without friction."""
    assert check(0, 3) <= 0.012


@pytest.mark.slow
@pytest.mark.parametrize("joint", [1, 2, 3])
def test_six_machines(joint: int) -> None:
    """Median of the curve's error below 0.4 %, worst below 1.2 %, whichever joint is driven."""
    errors = [check(seed, joint) for seed in range(6)]
    assert np.median(errors) <= 0.004, errors
    assert max(errors) <= 0.012, errors
