"""The arm model: its torque, its parts, its numbers, and its way through a model file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pytest

from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.body import Array, Motion
from pipelines.dynamics.parameter import Parameter
from pipelines.effects.angle import Cogging
from pipelines.effects.base import (
    ArmModel,
    Effect,
    Parameters,
    Predict,
    Quantity,
    Words,
)
from pipelines.effects.friction import Viscous
from pipelines.errors import InputRejected, UsageError
from pipelines.io.model_file import (
    ModelFile,
    StoredEffect,
    StoredParameter,
    StoredValue,
    model_text,
    parse_model,
)
from pipelines.io.robot import Joint, LinkParameters, RobotDescription
from pipelines.io.robot_files import load_robot
from sample_logs.make_model import synthetic_arm
from tests.dynamics.rrr_arms import column, random_states


@pytest.fixture(scope="module")
def arm() -> Arm:
    return synthetic_arm()


@pytest.fixture(scope="module")
def motion() -> Motion:
    return Motion(np.linspace(0.0, 0.199, 200), *random_states(np.random.default_rng(1), 200))


@dataclass(frozen=True)
class HalfTorque(Effect):
    """τ = τ_before / 2: not a sum, so the order of effects shows."""

    name = "half_torque"
    scope = "arm"
    parameters: ClassVar[Parameters] = Parameters(Quantity("part", "1", 0.0, 1.0, "part that is left"))
    words = Words("Half the torque", *["For tests."] * 4)

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return arm.torque(motion)[..., None]

    def apply(self, motion: Motion, arm: ArmModel, values: Mapping[str, float],
              predict: Predict | None = None) -> Array:
        return values["part"] * (predict or (lambda m, a: a.torque(m)))(motion, arm)


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


def test_effects_act_around_those_before(arm: Arm, motion: Motion) -> None:
    """Half of everything, then drag; drag, then half of everything."""
    half, drag = Acting.of(HalfTorque(), {"part": 0.5}), Acting.of(Viscous(3), {"coefficient": 1.0})
    rest, own = arm.torque(motion), np.array([0.0, 0.0, 1.0]) * motion.dq
    np.testing.assert_allclose(arm.extended(half, drag).torque(motion), 0.5 * rest + own, rtol=1e-12)
    np.testing.assert_allclose(arm.extended(drag, half).torque(motion), 0.5 * (rest + own), rtol=1e-12)
    assert arm.extended(half, drag).nominal == arm


def test_what_is_kept_of_a_motion_is_that_of_the_very_arm(arm: Arm, motion: Motion, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of one that nobody writes to, torque is worked out once: for another arm anew, and whoever writes to it writes to a copy."""
    still = replace(motion, q=motion.q.copy(), dq=motion.dq.copy(), ddq=motion.ddq.copy())
    for x in (still.q, still.dq, still.ddq):
        x.flags.writeable = False
    heavier = replace(arm, base=tuple(replace(p, value=1.1 * p.value) for p in arm.base))
    smoother = replace(arm, friction=arm.friction[:1])
    arms = (arm.nominal, heavier.nominal, smoother.nominal, arm, heavier)
    asked, worked = list[int](), type(arm.body).torque
    monkeypatch.setattr(type(arm.body), "torque", lambda body, q, *rest: asked.append(id(q)) or worked(body, q, *rest))
    for one in (*arms, *reversed(arms)):
        torque = one.torque(still)
        np.testing.assert_allclose(torque, one.torque(motion), rtol=0, atol=1e-12)
        np.testing.assert_allclose(one.friction_torque(still), one.friction_torque(motion), rtol=0, atol=1e-12)
        torque += 1.0
    assert asked.count(id(still.q)) == 3
    half = arm.nominal.extended(Acting(HalfTorque(), (Parameter("part", 0.5, None, "1"),)))
    inside = half.torque(still, lambda there, own: own.torque(there) + 1.0)
    np.testing.assert_allclose(inside, half.torque(motion) + 0.5, rtol=0, atol=1e-12)  # it acts on what stands inside too


def test_every_number_has_an_address(arm: Arm) -> None:
    """Base parameters by name, the rest by place and name, as the command line writes them."""
    numbers = arm.extended(Acting.of(Viscous(2), {"coefficient": 0.4}, {"coefficient": 0.01})).parameters
    assert numbers["p3"].value == pytest.approx(0.17306)
    assert numbers["p3"].origin == "known"
    assert numbers["three_sigmoid:1:b"].value == 0.6
    assert numbers["viscous:2:coefficient"] == Parameter("coefficient", 0.4, 0.01, "N m s/rad", (0.0, 1e5))
    assert len(numbers) == 15 + 3 * 7 + 1


def test_another_body_keeps_the_friction(arm: Arm, motion: Motion) -> None:
    """An effect may hand on the arm with another geometry."""
    heavier = arm.with_body(arm.body, 1.1 * arm.p)
    rigid = arm.torque(motion) - arm.friction_torque(motion)
    np.testing.assert_allclose(heavier.torque(motion), arm.torque(motion) + 0.1 * rigid, rtol=1e-9, atol=1e-9)
    assert {parameter.origin for parameter in heavier.base} == {"assumed"}


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


def test_unknown_links_are_refused() -> None:
    """A description without links is no model; the message names the joints."""
    robot = load_robot("rrr")
    bare = replace(robot, joints=(replace(robot.joints[0], link=None), *robot.joints[1:]))
    with pytest.raises(UsageError, match="waist"):
        Arm.from_links(bare)


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
    ({"friction": (replace(VISCOUS, joint=0),)}, "joint 0"),
    ({"effects": (replace(VISCOUS, joint=None),)}, "belongs to one joint"),
    ({"effects": (replace(VISCOUS, parameters={}),)}, "coefficient missing"),
    ({"effects": (replace(VISCOUS, parameters={"coeficient": VISCOUS.parameters["coefficient"]}),)},
     "did you mean 'coefficient'"),
    ({"effects": (replace(VISCOUS, parameters={"coefficient": StoredValue(1.0, None, "N m", "fitted")}),)},
     "in N m, not N m s/rad"),
    ({"effects": (CROSSTALK,)}, "from_joint = 9 is no other joint of this arm, which has 3"),
    ({"effects": (replace(CROSSTALK, effect="torque_crosstalk"),)}, "from_joint = 9 is no other joint"),
    ({"effects": (LENGTH,)}, "link = 3 is no link with a joint beyond it on this arm, which has 3"),
    ({"base_parameters": ()}, "p1, p2"),
    ({"base_parameters": (StoredParameter("p16", 1.0, None, "kg", True, "fitted", ""),)}, "p16"),
    ({"robot": "name = 1"}, "robot description"),
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


def test_units_follow_the_kind_of_joint() -> None:
    """A prismatic joint has N where a revolute one has N m."""
    assert Quantity("b", "N m s/rad", 0, 1, "").unit_at(revolute=False) == "N s/m"
    assert Quantity("b", "N m s/rad", 0, 1, "").unit_at(revolute=True) == "N m s/rad"
    assert Quantity("J", "kg m^2", 0, 1, "").unit_at(revolute=False) == "kg"
    assert Quantity("k", "1/rev", 0, 1, "").unit_at(revolute=False) == "1/(2 pi m)"
    assert Quantity("x", "rad", 0, 1, "").unit_at(revolute=False) == "m"


def test_a_wave_along_a_slide_has_its_phase_in_rad() -> None:
    """Its amplitude is a force and its waves are counted in 2π metres; where in a wave one is, is no length."""
    units = {p.name: p.unit for p in Acting.of(Cogging(2), dict.fromkeys((q.name for q in Cogging.parameters), 1.0),
                                               revolute=False).parameters}
    assert {units[f"phase{tail}"] for tail in ("", "_2", "_3")} == {"rad"}
    assert (units["amplitude"], units["order"], units["order_2"]) == ("N", "1/(2 pi m)", "1/(2 pi m)")


def test_a_model_with_an_eccentric_encoder_at_a_slide_is_refused() -> None:
    """Its error goes once a turn, and a slide has none."""
    rail = RobotDescription("rail", (0.0, 0.0, -9.81), "dh", (Joint("rail", "prismatic"),))
    arm = Arm.from_links(replace(rail, joints=(replace(rail.joints[0], link=LinkParameters(1.0, (0.0,) * 3, (0.0,) * 6)),)))
    stored = StoredEffect("encoder_eccentricity", 1, {"amplitude": StoredValue(1e-3, None, "m", "fitted"),
                                                      "phase": StoredValue(0.0, None, "rad", "fitted")})
    with pytest.raises(InputRejected, match="cannot be at joint 1"):
        Arm.from_model(replace(arm.to_model(), effects=(stored,)))


def test_a_prismatic_joint_is_told_from_a_turning_one() -> None:
    assert Joint("rail", "prismatic").revolute is False


@pytest.mark.parametrize(("parameter", "words"), [
    (Parameter("m", 1.93, 0.021, "kg"), "1.930 ± 0.021 kg"), (Parameter("k", 123.4, 25.0), "123 ± 25"),
    (Parameter("g", 9.8062, None, "m/s^2"), "9.8062 m/s^2")])
def test_a_number_in_words(parameter: Parameter, words: str) -> None:
    """As many digits as the uncertainty leaves."""
    assert parameter.words == words
