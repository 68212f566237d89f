"""The model for one sample, as it runs online: the same torques as from arrays, and as from Pinocchio."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from pipelines.io.model_file import parse_model
from pipelines.model.arm import Acting, Arm
from pipelines.model.effects import all_effects, find_effect
from pipelines.model.effects.base import Effect
from pipelines.model.effects.kinds import FrictionLaw
from pipelines.model.effects.rotor_inertia import RotorInertia
from pipelines.model.effects.torque_offset import TorqueOffset
from pipelines.model.online import OnlineModel
from pipelines.model.parameter import Parameter
from pipelines.model.rigid.base import BaseArm
from pipelines.model.rigid.body import Array, Motion
from pipelines.model.rigid.choose import rigid_body
from sample_logs.make_model import synthetic_arm
from tests.bench_support import controller_model
from tests.model.rigid.rrr_arms import random_states
from tests.model.rigid.serial_arms import ARMS, physical_links
from tests.model.rigid.serial_arms import Arm as Judge

# every effect as an accepted one, and every law of friction as friction too
PLACES = [(kind, False) for kind in all_effects()] + [(kind, True) for kind in all_effects() if issubclass(kind, FrictionLaw)]


def arm_with(judge: Judge, phi: Array) -> Arm:
    """The arm with standard parameters `phi`, Pinocchio's model loaded with the same."""
    judge.load(phi)
    general, body = BaseArm(judge.robot), rigid_body(judge.robot)
    if isinstance(body, BaseArm):
        p = general.base.combine @ phi
    else:  # the closed form: whatever gives the same torques
        q, dq, ddq = judge.states(40, 8)
        Y = body.regressor(q, dq, ddq).reshape(-1, len(body.parameters))
        p = np.linalg.lstsq(Y, general.torque(q, dq, ddq, general.base.combine @ phi).ravel(), rcond=None)[0]
    base = tuple(Parameter(known.name, float(value), None, known.unit) for known, value in zip(body.parameters, p, strict=True))
    return Arm(judge.robot.name, body, base)


def one_by_one(online: OnlineModel, q: Array, dq: Array, ddq: Array) -> Array:
    """(4, samples, joints): friction, inertia, Coriolis, gravity."""
    return np.array([online.parts(*row) for row in zip(q.tolist(), dq.tolist(), ddq.tolist(), strict=True)]).transpose(1, 0, 2)


def largest(parts: Array, wanted: Array) -> float:
    return float(np.abs(parts - wanted).max() / max(1.0, float(np.abs(wanted).max())))


def test_the_parts_are_those_of_the_arm() -> None:
    """RRR arm with three-sigmoid friction, 500 states as wide as the arm moves: friction, inertia, Coriolis, gravity to 1e-12."""
    arm = synthetic_arm()
    q, dq, ddq = random_states(np.random.default_rng(1), 500)
    parts = arm.torque_parts(Motion(np.arange(500.0), q, dq, ddq))
    found = one_by_one(OnlineModel(arm), q, dq, ddq)
    for mine, theirs in zip(found, (parts.friction, parts.inertia, parts.coriolis, parts.gravity), strict=True):
        assert largest(mine, theirs) <= 1e-12


@pytest.mark.parametrize("name", ARMS)
def test_pinocchio_computes_the_same(name: str, shared: Path, tmp_path: Path) -> None:
    """Every kind of arm with physical links: D(q) q̈, c, h and D(q) r against rnea, gravity and mass matrix, to 1e-11."""
    judge = ARMS[name](shared, tmp_path)
    online = OnlineModel(arm_with(judge, physical_links(judge.n, np.random.default_rng(3))))
    data, q, dq, ddq = judge.model.createData(), *judge.states(40, 9)
    still = np.zeros(judge.n)
    for sample, (angles, v, u) in enumerate(zip(judge.offset(q), dq, ddq, strict=True)):
        gravity = pin.rnea(judge.model, data, angles, still, still).copy()
        coriolis = pin.rnea(judge.model, data, angles, v, still) - gravity
        inertia = pin.rnea(judge.model, data, angles, still, u) - gravity
        found = online.parts(q[sample], v, u)
        for mine, theirs in zip(found, (still, inertia, coriolis, gravity), strict=True):
            assert largest(np.array(mine), theirs) <= 1e-11
        assert largest(np.array(online.inertia_times(q[sample], u)), inertia) <= 1e-11


@pytest.mark.parametrize(("kind", "as_friction"), PLACES, ids=lambda value: getattr(value, "name", f"friction={value}"))
def test_every_effect_acts_as_in_the_arm(kind: type[Effect], as_friction: bool) -> None:
    """Whether it has a form in plain numbers or not, as friction or as an accepted effect: as on an array of one row."""
    effect = kind(joint=2) if kind.scope == "joint" else kind()
    values = {q.name: 1.0 if q.discrete else 0.6 * q.low + 0.4 * q.high for q in effect.parameters}  # the first joint, or link
    acting = (Acting.of(effect, values),)
    rigid = synthetic_arm().nominal
    arm = Arm("with", rigid.body, rigid.base, acting) if as_friction else rigid.extended(*acting)
    online = OnlineModel(arm)
    for row in zip(*random_states(np.random.default_rng(2), 20), strict=True):
        motion = Motion(np.zeros(1), *(values[None] for values in row))
        wanted = arm.torque_parts(motion)
        torque = np.array(online.torque(*row))
        assert largest(torque, wanted.total[0]) <= 1e-12
        assert largest(np.array(online.effects(*row)), wanted.effects[0]) <= 1e-11
        assert largest(np.array(online.parts(*row).friction), wanted.friction[0]) <= 1e-12


def test_the_torque_is_linear_in_acceleration() -> None:
    """τ(q, dq, r) = D(q) r + τ(q, dq, 0), with a rotor's inertia in D(q): computed torque, eq. (25), rests on it."""
    arm = synthetic_arm().extended(Acting.of(RotorInertia(2), {"inertia": 0.7}), Acting.of(TorqueOffset(1), {"offset": 3.0}))
    online = OnlineModel(arm)
    without = OnlineModel(synthetic_arm())
    for q, dq, r in zip(*random_states(np.random.default_rng(4), 50), strict=True):
        whole = np.array(online.inertia_times(q, r)) + online.torque(q, dq, np.zeros(3))
        assert largest(whole, np.array(online.torque(q, dq, r))) <= 1e-12
        assert online.inertia_times(q, r)[1] - without.inertia_times(q, r)[1] == pytest.approx(0.7 * r[1], abs=1e-11)


def test_two_laws_at_one_joint_add_up() -> None:
    """Coulomb and viscous friction at one joint: level tanh(w v) + b v."""
    rigid = synthetic_arm()
    laws = (Acting.of(find_effect("coulomb")(joint=3), {"level": 1.5, "sharpness": 100.0}),
            Acting.of(find_effect("viscous")(joint=3), {"coefficient": 0.4}))
    online = OnlineModel(Arm("two", rigid.body, rigid.base, laws))
    for v in (-2.0, -0.01, 0.0, 0.003, 5.0):
        friction = online.parts([0.1, 0.2, 0.3], [0.0, 0.0, v], [0.0, 0.0, 0.0]).friction
        assert friction == pytest.approx([0.0, 0.0, 1.5 * np.tanh(100.0 * v) + 0.4 * v], abs=1e-14)


def test_a_controller_of_the_bench_can_use_it() -> None:
    """The text is the model file of the arm, the parts are lists of plain floats."""
    arm = synthetic_arm()
    model = controller_model(arm)
    back = Arm.from_model(parse_model(model.text))
    q, dq, ddq = [0.1, -0.4, 0.8], [0.5, -1.0, 2.0], [3.0, -4.0, 5.0]
    assert [list(part) for part in model.parts(q, dq, ddq)] == [list(part) for part in OnlineModel(back).parts(q, dq, ddq)]
    assert all(type(value) is float for part in model.parts(q, dq, ddq) for value in part)
    assert len(model.inertia_times(q, ddq)) == 3
