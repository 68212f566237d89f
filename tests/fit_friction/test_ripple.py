"""`rrrid fit-friction` tells what no law of friction holds, in verdict, tone, finding and result; healthy arms have none of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines import fit_friction, import_log
from pipelines.fit_friction import Settings
from pipelines.io.files import Opened, open_log
from pipelines.model.friction.findings import misfits
from pipelines.model.friction.fit import Value
from pipelines.model.friction.result import Result
from pipelines.stage import Inputs, Request, run_stage

_TORQUE_CONSTANT = 0.0551  # N m/A of the outrunner


def fitted(*opened: Opened, law: str | None = None) -> Result:
    return fit_friction.compute(Inputs(opened, label="logs"), Settings(law=law))


@pytest.fixture(scope="module")
def outrunner(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> Result:
    """The recorded motor, its six runs."""
    request = Request((), tmp_path_factory.mktemp("odrive") / "out", no_report=True)
    done = run_stage(import_log.STAGE, request, import_log.Settings(recipe="odrive", source=shared / "real/odrive"))
    return fitted(*(open_log(path) for path in sorted((done.folder / "logs").glob("*.h5"))), law="coulomb+viscous")


def test_an_outrunner_that_cogs_is_not_called_good(outrunner: Result) -> None:
    """Cogging is nearly all of its torque: the fit is a problem, and says that its inertia (2.5e-4 kg m² in truth) is not seen."""
    told = fit_friction.report(outrunner)
    assert told.tone == "bad"
    assert "7 cycles per revolution" in told.verdict
    assert "no friction" in told.verdict
    assert "depends on its angle alone" in told.verdict
    codes = [(check.code, check.gate) for check in outrunner.checks if check.code in ("RRID-D19", "RRID-D21")]
    assert codes == [("RRID-D19", True), ("RRID-D21", False)]
    assert any("neither is to be relied on" in check.message and "rrrid diagnose" in check.remedy for check in outrunner.checks)


def test_its_ripple_is_that_of_the_holding_current(outrunner: Result, shared: Path) -> None:
    """The current that holds the rotor at each angle was recorded at rest: its torque has the same size, within 5 %."""
    ripple = outrunner.joints[0].ripple
    assert ripple is not None
    ways = (np.genfromtxt(shared / f"real/odrive/holding_current_{way}.csv", delimiter=",", skip_header=1)
            for way in ("forward", "reverse"))
    grid = np.arange(0.0, 8192.0, 16.0)
    mean = sum(0.5 * np.interp(grid, *one[np.argsort(one[:, 0])].T, period=8192.0) for one in ways)
    assert ripple.rms.value == pytest.approx(_TORQUE_CONSTANT * float(np.std(mean)), rel=0.05)
    assert float(np.std(ripple.along.waves)) == pytest.approx(_TORQUE_CONSTANT * float(np.std(mean)), rel=0.05)
    assert ripple.orders[0] == 7.0  # pole pairs


def test_cogging_of_a_motor_that_was_replaced(samples: Path) -> None:
    """sin 18q and sin 36q as sample_logs/README.md has it, at joint 2 alone; inertia as before the motor was replaced, to 0.5 %."""
    before, after = (fitted(open_log(samples / f"{name}.h5"), law="stribeck")
                     for name in ("rrr-healthy/friction-2-1", "rrr-changed/friction-2-3"))
    (joint,) = after.joints
    assert joint.ripple is not None
    q = open_log(samples / "rrr-changed/friction-2-3.h5").log.q[:, 1]
    angle = np.linspace(q.min(), q.max(), 2000)
    truth = float(np.std(0.35 * np.sin(18.0 * angle + 0.8) + 0.35 * 0.35 * np.sin(36.0 * angle + 2.1)))
    assert float(np.std(joint.ripple.along.waves)) == pytest.approx(truth, rel=0.03)
    inertia = before.joints[0].inertia.value
    assert joint.ripple.inertia is not None
    assert joint.ripple.inertia.value == pytest.approx(inertia, rel=0.005)
    assert abs(joint.ripple.inertia.value - inertia) < abs(joint.inertia.value - inertia)
    told = fit_friction.report(after)
    assert told.tone == "attention"
    assert "18 cycles per revolution" in told.verdict
    assert "ripple-2" in [figure.name for section in told.sections for figure in section.figures]


_IN_ORDER = ("rrr-healthy/friction-1-1", "rrr-healthy/friction-2-1", "rrr-healthy/friction-3-1", "rrr-closed-form/friction-1",
             "rrr-closed-form/friction-2", "rrr-closed-form/friction-3", "rrr-changed/friction-1-3", "rrr-changed/friction-3-3")


@pytest.mark.parametrize(("name", "law"), [
    pytest.param(name, law, marks=() if (name, law) == ("rrr-closed-form/friction-1", "coulomb+viscous") else pytest.mark.slow)
    for name in _IN_ORDER for law in (None, "coulomb+viscous")])
def test_joints_in_order_have_no_ripple(name: str, law: str | None, samples: Path) -> None:
    """Chosen laws and one that is too poor: what a healthy joint leaves is not the torque of an angle."""
    result = fitted(open_log(samples / f"{name}.h5"), law=law)
    assert [joint.ripple for joint in result.joints] == [None]
    assert not result.checks
    verdict = fit_friction.report(result).verdict
    assert "waves" not in verdict
    assert "angle" not in verdict


@pytest.mark.parametrize("law", [pytest.param("three_sigmoid", marks=pytest.mark.slow), "coulomb+viscous"])
def test_joints_that_move_together_and_are_in_order(law: str, samples: Path) -> None:
    """A healthy arm's excitation: nothing is told, of a law that fits and of one that is too poor; one tenth of it is not left."""
    result = fitted(*(open_log(samples / f"rrr-closed-form/excitation-{number}.h5") for number in (1, 2)), law=law)
    assert [joint.ripple for joint in result.joints] == [None] * 3
    assert not result.checks
    assert max(joint.validation.torque_error or 1.0 for joint in result.joints) < 0.1


def test_a_joint_that_its_brake_holds_is_no_fault(samples: Path) -> None:
    """One encoder step of jitter and a torque that is noise: all of it is left, and that says nothing of the joint."""
    opened, rng = open_log(samples / "rrr-closed-form/excitation-1.h5"), np.random.default_rng(3)
    log = opened.log
    q, tau = log.q.copy(), log.tau.copy()
    step = np.diff(np.unique(q[:, 2])).min()
    q[:, 2] = 0.3 + step * rng.integers(0, 2, len(q))
    tau[:, 2] = 0.02 * rng.standard_normal(len(q))
    signals = {key: value for key, value in log.signals.items() if key == "t"}
    signals |= {key: replace(log.signals[key], values=values) for key, values in (("q", q), ("tau", tau))}
    result = fitted(replace(opened, log=replace(log, signals=signals)), law="coulomb+viscous")
    assert [joint.moved for joint in result.joints] == [True, True, False]
    assert result.joints[2].validation.torque_error == pytest.approx(1.0, abs=0.1)
    assert not [check for check in result.checks if check.gate]
    told = fit_friction.report(result)
    assert told.tone == "attention"
    assert "does not move in these logs" in told.verdict


def test_half_of_the_torque_left_is_no_good_fit(outrunner: Result) -> None:
    """Without any ripple, what is left of held-out torque alone decides: 5 % is good, 30 % is not, and unknown is not either."""
    (joint,) = outrunner.joints
    for error, tone in ((0.05, "good"), (0.3, "attention"), (None, "attention")):
        judged = replace(joint, ripple=None, validation=replace(joint.validation, torque_error=error))
        assert fit_friction.report(replace(outrunner, joints=(judged,), checks=())).tone == tone


@pytest.mark.parametrize(("inertia", "said"), [
    (Value(1.0, None, "kg m^2"), "these logs do not show it"), (Value(1.0, 0.6, "kg m^2"), "these logs do not show it"),
    (Value(-0.531, 0.0008, "kg m^2"), "no inertia is negative; look at the sign of this torque")])
def test_what_the_inertia_beside_a_ripple_says(outrunner: Result, inertia: Value, said: str) -> None:
    """Of unknown or great uncertainty it is not seen; known well and negative, it tells of a flipped sign."""
    (joint,) = outrunner.joints
    assert joint.ripple is not None
    ripple = replace(joint.ripple, inertia=inertia)
    (check,) = (check for check in misfits((replace(joint, ripple=ripple),), "logs") if not check.gate)
    assert said in check.message


def test_inertias_of_two_methods_are_not_compared(outrunner: Result) -> None:
    """Where another method found the inertia, the one beside the ripple is not known: nothing is said of either."""
    (joint,) = outrunner.joints
    assert joint.ripple is not None
    other = replace(joint, method="ekf", ripple=replace(joint.ripple, inertia=None))
    messages = [check.message for check in misfits((other,), "logs") if not check.gate]
    told = fit_friction.report(replace(outrunner, joints=(other,)))
    words = " ".join(words for section in told.sections for words in section.text)
    assert "angle alone" in words
    assert len(messages) == 1
    assert "The inertia" not in words + messages[0]


def test_a_slide_is_told_in_its_own_units(outrunner: Result) -> None:
    """7 waves in 2π m are a wave every 900 mm."""
    (joint,) = outrunner.joints
    assert joint.ripple is not None
    ripple = replace(joint.ripple, rms=replace(joint.ripple.rms, unit="N"), inertia=Value(1.0, 0.01, "kg"))
    slide = replace(joint, inertia=Value(1.0, 0.01, "kg"), ripple=ripple)
    (check,) = (check for check in misfits((slide,), "logs") if not check.gate)
    assert "N rms of the torque" not in check.message
    assert "depends on its position alone, mostly a wave every 900 mm" in check.message


def test_a_curve_without_points_claims_none(outrunner: Result) -> None:
    """Joints that all move have no pairs of torques."""
    assert not len(outrunner.joints[0].series.map_speed)
    captions = [figure.caption for section in fit_friction.report(outrunner).sections for figure in section.figures]
    assert any("no torques at equal position and opposite speed" in caption for caption in captions)
