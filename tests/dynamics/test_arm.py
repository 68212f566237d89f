"""The arm model: its torque, its parts, its numbers, and its way through a model file."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.body import Motion
from pipelines.effects.friction import Viscous
from pipelines.errors import InputRejected
from pipelines.io.model_file import (
    ModelFile,
    StoredEffect,
    StoredParameter,
    StoredValue,
    model_text,
    parse_model,
)
from pipelines.io.robot_files import load_robot
from sample_logs.make_model import synthetic_arm
from tests.dynamics.rrr_arms import column, random_states


@pytest.fixture(scope="module")
def arm() -> Arm:
    return synthetic_arm()


@pytest.fixture(scope="module")
def motion() -> Motion:
    return Motion(np.linspace(0.0, 0.199, 200), *random_states(np.random.default_rng(1), 200))


def test_torque_of_the_synthetic_arm(arm: Arm, vectors: dict[str, Any]) -> None:
    """Rigid torque as Pinocchio has it, friction as the reference has it."""
    case = vectors["dynamics"][1]
    q, dq, ddq = (column(case, key) for key in ("q", "dq", "ddq"))
    motion = Motion(np.linspace(0.0, 0.199, len(q)), q, dq, ddq)
    friction = np.stack([np.tanh(dq[:, [k]] * np.array(law["w"])) @ law["f"] + law["b"] * dq[:, k]
                         for k, law in enumerate(vectors["synthetic_friction"])], axis=1)
    tau = column(case, "tau") + friction
    assert np.abs(arm.torque(motion) - tau).max() <= 1e-12 * np.abs(tau).max()


def test_the_parts_sum_to_the_torque(arm: Arm, motion: Motion) -> None:
    """Inertia, Coriolis, gravity, friction and effects are all there is."""
    extended = arm.extended(Acting.of(Viscous(2), {"coefficient": 0.4}))
    parts = extended.torque_parts(motion)
    np.testing.assert_allclose(parts.total, extended.torque(motion), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(parts.effects[:, 1], 0.4 * motion.dq[:, 1], rtol=1e-9, atol=1e-12)
    assert not arm.torque_parts(motion).effects.any()
    assert np.abs(parts.friction).max() > 1.0


def test_any_serial_arm_is_modelled_alike(motion: Motion) -> None:
    """The RRR arm with a tool goes through the general recursion: other base parameters, the same torque and parts."""
    robot = load_robot("rrr")
    closed, general = Arm.from_links(robot), Arm.from_links(replace(robot, tool=(0.0, 0.0, 0.1)))
    assert type(closed.body) is not type(general.body)
    ours, theirs = closed.torque_parts(motion), general.torque_parts(motion)
    for part in ("inertia", "coriolis", "gravity"):
        assert np.abs(getattr(ours, part) - getattr(theirs, part)).max() <= 1e-11 * np.abs(ours.total).max()
    back = Arm.from_model(parse_model(model_text(general.to_model())))
    np.testing.assert_array_equal(back.torque(motion), general.torque(motion))


def test_through_a_model_file_and_back(arm: Arm, motion: Motion) -> None:
    """The arm read back gives the same torque, bit for bit, and the same numbers."""
    extended = arm.extended(Acting.of(Viscous(2), {"coefficient": 0.4}, {"coefficient": 0.01}))
    back = Arm.from_model(parse_model(model_text(extended.to_model())))
    np.testing.assert_array_equal(back.torque(motion), extended.torque(motion))
    assert back.parameters == extended.parameters
    assert model_text(back.to_model()) == model_text(extended.to_model())


CROSSTALK = StoredEffect("encoder_crosstalk", 1, {"coefficient": StoredValue(0.1, None, "1", "fitted"),
                                                  "from_joint": StoredValue(9.0, None, "1", "fitted")})
LENGTH = StoredEffect("link_length", None, {"error": StoredValue(0.01, None, "m", "fitted"),
                                            "link": StoredValue(3.0, None, "1", "fitted")})
VISCOUS = StoredEffect("viscous", 1, {"coefficient": StoredValue(0.1, None, "N m s/rad", "fitted")})


@pytest.mark.parametrize(("fault", "message"), [
    ({"friction": (replace(VISCOUS, effect="viscuos"),)}, "did you mean 'viscous'"),
    ({"friction": (replace(VISCOUS, joint=4),)}, "joint 4"),
    ({"effects": (replace(VISCOUS, parameters={"coeficient": VISCOUS.parameters["coefficient"]}),)},
     "did you mean 'coefficient'"),
    ({"effects": (replace(VISCOUS, parameters={"coefficient": StoredValue(1.0, None, "N m", "fitted")}),)},
     "in N m, not N m s/rad"),
    ({"effects": (CROSSTALK,)}, "from_joint = 9 is no other joint of this arm, which has 3"),
    ({"effects": (LENGTH,)}, "link = 3 is no link with a joint beyond it on this arm, which has 3"),
    ({"base_parameters": (StoredParameter("p16", 1.0, None, "kg", True, "fitted", ""),)}, "p16"),
])
def test_a_model_that_fits_nothing_is_refused(arm: Arm, fault: dict[str, Any], message: str) -> None:
    """A model file whose parts do not fit each other names the part."""
    model: ModelFile = replace(arm.to_model(), **fault)
    with pytest.raises(InputRejected, match=message):
        Arm.from_model(model)


def test_a_file_from_before_a_number_was_known_keeps_its_law(arm: Arm, motion: Motion) -> None:
    """Dahl 1968 as an earlier version wrote him: u = s (1 - 2 exp(-|q - q_r|/x_c)) after a reversal while sliding."""
    stored = StoredEffect("presliding", 2, {"amplitude": StoredValue(1.5, None, "N m", "fitted"),
                                            "distance": StoredValue(0.01, None, "rad", "fitted"),
                                            "damping_time": StoredValue(0.0, None, "s", "fitted")})
    model = replace(arm.to_model(), effects=(stored,))
    back = Arm.from_model(parse_model(model_text(model)))
    q = np.zeros((500, 3))
    q[:, 1] = np.concatenate([np.linspace(0.0, 0.3, 300), np.linspace(0.3, 0.25, 200)])
    dq = np.zeros_like(q)
    dq[:300, 1], dq[300:, 1] = 0.1, -0.1
    there = Motion(np.arange(500) * 1e-2, q, dq, np.zeros_like(q))
    more = back.torque(there) - replace(back, effects=()).torque(there)
    np.testing.assert_allclose(more[300:, 1], -1.5 * (1.0 - 2.0 * np.exp(-(0.3 - q[300:, 1]) / 0.01)), atol=1e-6)
