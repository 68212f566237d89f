"""The ladder names the true law of six machines, or one that is declared to be equal, and says what it cannot tell."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.estimation.motion import Reconstruction, reconstruct
from pipelines.friction.fit import Equations
from pipelines.friction.joint import JointFit, JointLogs, fit_joint
from pipelines.friction.laws import OneJoint
from pipelines.friction.model_selection import climb, coverage, unseen
from pipelines.friction.weak_form import Stretch
from tests.friction.one_joint import JOINT, STEP, TRUTHS, driven_speeds, recorded, relative


def judged(law: str, seed: int = 1) -> JointFit:
    seen = [((log, reconstruct(log, Reconstruction())),) for log in (recorded(law, seed), recorded(law, seed + 50, "validate"))]
    return fit_joint(JointLogs(JOINT, *seen), 0.02)


@pytest.mark.parametrize("law", [law if law == "quadratic_drag" else pytest.param(law, marks=pytest.mark.slow)
                                 for law in TRUTHS])
def test_six_machines_with_six_laws(law: str) -> None:
    """The chosen law is the true one, and its curve the true one to 1.2 %: a joint jumps over the falling side of a hump in no
    time, so that a hump is the hardest to see. Nowhere is it off by more than four of its standard deviations.
    """
    found = judged(law)
    assert found.fit.law.name == law, [(one.law.name, one.validate_rms) for one in found.ladder.tried]
    speed = driven_speeds(recorded(law, 1))
    apart = found.fit.curve(speed) - TRUTHS[law].curve(speed)
    assert relative(found.fit.curve(speed), TRUTHS[law].curve(speed)) <= 0.012
    assert np.abs(apart / found.fit.curve_std(speed)).max() < 4.0
    # Fig. 6: what friction explains of the simulated speed
    errors = [found.driven.error(simulated) for simulated in (found.driven.with_friction, found.driven.without)]
    assert errors[0] <= 0.05 * errors[1]
    assert found.ladder.by == "logs"


def plateaus(speeds: tuple[float, ...], friction: object, rest: bool, noise: float) -> Stretch:
    """A joint at constant speeds, both ways, from one to the next in no time: no sample of a change is used."""
    rng = np.random.default_rng(8)
    levels = [side * v for v in speeds for side in (1.0, -1.0)] + ([0.0] if rest else [])
    size = 800
    dq = np.repeat(levels, size)
    t = np.arange(len(dq)) * STEP
    spoilt = np.zeros(len(dq), dtype=bool)
    for edge in range(0, len(dq) + 1, size):
        spoilt[max(0, edge - 20):edge + 20] = True
    q = np.concatenate([[0.0], np.cumsum(0.5 * STEP * (dq[1:] + dq[:-1]))])
    tau = np.array([friction(v) for v in dq.tolist()]) + 1.7 * np.sin(q) + noise * rng.standard_normal(len(dq))  # type: ignore[operator]
    return Stretch("plateaus", t, q, tau, q, dq, spoilt, 20, True)


def climbed(stretch: Stretch) -> tuple[object, tuple[str, ...], tuple[str, ...]]:
    joint = OneJoint.of(recorded("coulomb+viscous", 1).robot, JOINT)
    ladder = climb(Equations((stretch,), joint), None)
    gaps = unseen(coverage((stretch,)), ladder)
    others = tuple(one.law.name for one in ladder.alternatives)
    return ladder.chosen.law.name, others, tuple(f"{gap.what} {gap.record}" for gap in gaps)


def test_an_offset_is_not_told_from_asymmetric_friction_without_rest() -> None:
    """Always moving, an offset and friction that is larger one way are one column: both are named, and what to record."""
    chosen, alternatives, words = climbed(plateaus((0.5, 1.0, 2.0, 4.0), lambda v: 1.2 * np.sign(v) + 0.12 * v + 0.1, False, 0.02))
    assert {chosen, *alternatives} >= {"torque_offset", "asymmetric_friction"}
    assert any("Asymmetric friction" in text and "old still" in text for text in words)


@pytest.mark.slow
def test_few_speeds_do_not_tell_stribeck_from_drag() -> None:
    """At three speeds a hump at the lowest and drag at the highest are one curve; at nine, over two decades, they are not."""
    def drag(v: float) -> float:
        return float(1.2 * np.sign(v) + 0.12 * v + 0.03 * v * abs(v))

    chosen, alternatives, words = climbed(plateaus((0.2, 1.0, 3.0), drag, False, 0.02))
    assert {chosen, *alternatives} >= {"stribeck", "quadratic_drag"}
    assert any("Stribeck friction" in text and "seven to ten constant speeds" in text for text in words)
    assert any("decades" in text for text in words)
    chosen, alternatives, _ = climbed(plateaus(tuple(np.geomspace(0.03, 5.0, 9).tolist()), drag, True, 0.02))
    assert chosen == "quadratic_drag"
    assert "stribeck" not in alternatives
