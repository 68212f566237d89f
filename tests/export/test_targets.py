"""The exported texts, loaded again by other programs: their torque is ours."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.dynamics.arm import Arm
from pipelines.effects import all_effects, find_effect
from pipelines.export.states import course, random_states
from sample_logs.make_model import synthetic_arm
from tests.dynamics.serial_arms import ARMS, physical_links
from tests.dynamics.serial_arms import Arm as Pinocchio
from tests.export.exported import arm_of, caused, exported, off, with_exact

ROUNDING = 1e-9
# At joint 2, as strong as a fault may be; any other number is that of the effect.
VALUES: dict[str, dict[str, float]] = {
    "asymmetric_friction": {"coulomb_difference": 0.8, "viscous_difference": 0.2},
    "cogging": {"order": 12.0, "amplitude": 0.4, "phase": 0.3, "amplitude_2": 0.1, "amplitude_3": 0.05},
    "concave_friction": {"amplitude": 1.0, "speed": 0.7, "knee": 2.0}, "coulomb": {"level": 2.0, "roundness": 2.3},
    "encoder_crosstalk": {"coefficient": 0.02, "from_joint": 1.0}, "encoder_eccentricity": {"amplitude": 0.01, "phase": 0.5},
    "load_friction": {"mu": 0.06, "behind": 0.4, "input_side": 0.5}, "quadratic_drag": {"coefficient": 0.08},
    "position_friction": {"amplitude": 0.5, "order": 2.0, "amplitude_2": 0.2, "sharpness": 50.0},
    "rotor_inertia": {"inertia": 0.3}, "spring": {"stiffness": 2.0, "rest_angle": 0.4, "curvature": 0.3, "fifth": 0.01},
    "stribeck": {"amplitude": 1.0, "speed": 0.2, "tail": 0.5, "exponent": 1.5},
    "three_sigmoid": {"f1": 1.0, "f2": 2.0, "f3": -1.0, "b": 0.2}, "torque_crosstalk": {"coefficient": 0.1, "from_joint": 1.0},
    "torque_gain": {"gain_error": 0.1}, "torque_offset": {"offset": 0.4}, "two_sigmoid": {"f1": 1.0, "f2": -0.4, "b": 0.2},
    "torque_saturation": {"limit": 8.0, "coefficient": 1.0}, "viscous": {"coefficient": 0.7},
    "transmission_coupling": {"inertia": 0.1, "viscous": 0.2, "coulomb": 0.3, "with_joint": 1.0},
    "viscous_drift": {"relative_change": 0.5, "time_constant": 2.0},
    "payload": {"mass": 0.5, "first_moment_x": 0.02, "inertia_xx": 0.01, "inertia_yy": 0.01, "inertia_zz": 0.01},
    "gravity_tilt": {"angle": 0.09, "direction": 0.7, "waist_sine": 0.4, "waist_cosine": -0.2},
    "link_length": {"error": 0.012, "link": 2.0},
}
# What C writes with an error, and what it does not write.
APPROXIMATED = {"presliding": {"amplitude": 1.0, "distance": 0.02}, "time_delay": {"delay": 0.002}}
LOST = {"backlash": {"gap": 0.004}, "base_resonance": {"frequency": 28.0, "damping_ratio": 0.05, "inertia": 27.0},
        "contact": {"duration": 0.2, "force_x": 10.0}, "drive_lag": {"time_constant": 0.005},
        "joint_elasticity": {"stiffness": 4000.0, "damping": 2.0, "frequency": 50.0, "motor_inertia": 0.04},
        "torque_lag": {"time_constant": 0.005}}


def ailing(name: str, values: dict[str, float]) -> Arm:
    kind = find_effect(name)
    return synthetic_arm().extended(caused(name, 2 if kind.scope == "joint" else None, **values))


@pytest.mark.parametrize("to", ["urdf", "mjcf", "c", "json"])
@pytest.mark.parametrize("make", ARMS.values(), ids=ARMS)
def test_the_torque_of_any_arm(make: Callable[[Path, Path], Pinocchio], to: str, shared: Path, tmp_path: Path) -> None:
    """Rigid body, rotor inertia and viscous friction are exact at a thousand states, whatever the frames."""
    robot = make(shared, tmp_path).robot
    arm = with_exact(arm_of(robot, physical_links(robot.n_joints, np.random.default_rng(3))))
    found, states = exported(arm, to), random_states(robot, None)
    assert {cause.carried for cause in found.held.causes} == {"exactly"}
    assert len(states.q) == 1000
    assert off(found.torque(states), arm.torque(states)) <= ROUNDING


def test_every_effect_has_its_place_in_c() -> None:
    """A new effect is either written in C, or told to be lost."""
    known = {*VALUES, *APPROXIMATED, *LOST}
    assert {kind.name for kind in all_effects()} == known


@pytest.mark.parametrize("name", VALUES)
def test_a_cause_with_a_formula_is_exact_in_c(name: str) -> None:
    """Whatever Python makes of it, at states that have nothing to do with each other."""
    arm = ailing(name, VALUES[name])
    found, states = exported(arm, "c"), random_states(arm.robot, None)
    assert all(cause.carried == "exactly" for cause in found.held.causes)
    assert off(found.torque(states), arm.torque(states)) <= ROUNDING
    assert off(arm.torque(states), synthetic_arm().torque(states)) > 1e-4


def test_causes_act_around_each_other_in_c_as_in_the_model() -> None:
    """Encoders, loads and drives of one joint, in the order of the model."""
    causes = [caused(name, 2, **VALUES[name]) for name in (
        "encoder_eccentricity", "encoder_crosstalk", "load_friction", "cogging", "torque_gain", "torque_crosstalk")]
    arm = synthetic_arm().extended(*causes, caused("payload", None, **VALUES["payload"]))
    states = random_states(arm.robot, None)
    assert off(exported(arm, "c").torque(states), arm.torque(states)) <= ROUNDING


@pytest.mark.parametrize("name", APPROXIMATED)
def test_a_state_in_c_follows_a_motion(name: str) -> None:
    """What is integrated sample by sample, or without the jerk, has most of what the model has."""
    arm, bare = ailing(name, APPROXIMATED[name]), synthetic_arm()
    motion = course(arm.robot, None)
    own = arm.torque(motion) - bare.torque(motion)
    error = exported(arm, "c").torque(motion) - arm.torque(motion)
    assert np.sqrt(np.mean(error**2)) < 0.15 * np.sqrt(np.mean(own**2))


@pytest.mark.parametrize("name", sorted(LOST))
def test_a_cause_without_a_formula_is_lost_in_c(name: str) -> None:
    """The header says so."""
    found = exported(ailing(name, LOST[name]), "c")
    assert found.held.causes[-1].carried == "lost"
    assert f"not in it: {found.held.causes[-1].place}" in found.texts[next(iter(found.texts))]


@pytest.mark.parametrize("name", ["quadratic_drag", "torque_offset", "torque_gain", "payload", "gravity_tilt", "link_length"])
def test_what_mujoco_holds_exactly(name: str) -> None:
    """Polynomial damping, constant and scaled drives, and what is in links and gravity."""
    values = VALUES[name] | ({"waist_sine": 0.0, "waist_cosine": 0.0} if name == "gravity_tilt" else {})
    arm = replace(synthetic_arm(), friction=()).extended(*ailing(name, values).effects)
    found, states = exported(arm, "mjcf"), random_states(arm.robot, None)
    assert all(cause.carried == "exactly" for cause in found.held.causes)
    assert off(found.torque(states), arm.torque(states)) <= ROUNDING


def test_a_spring_of_three_powers_is_exact_in_mujoco() -> None:
    """A fourth power, or an end to the powers, is not: what it costs is told."""
    bent = {"curvature": 0.5, "hardening": -0.2}
    for more, carried in (({}, "exactly"), (bent, "exactly"), ({"fourth": 0.1}, "approximated"),
                          (bent | {"seen_from": -0.5, "seen_to": 0.5}, "approximated")):
        arm = replace(synthetic_arm(), friction=()).extended(caused("spring", 2, stiffness=2.0, rest_angle=0.4, **more))
        found, states = exported(arm, "mjcf"), random_states(arm.robot, None)
        assert found.held.causes[0].carried == carried
        assert off(found.torque(states), found.held.torque(states, found.target)) <= ROUNDING
        if carried == "exactly":
            assert off(found.torque(states), arm.torque(states)) <= ROUNDING


def test_drives_of_mujoco_clip_and_lag() -> None:
    """They act in a simulation, which inverse dynamics does not show."""
    causes = (caused("torque_saturation", 1, limit=5.0, coefficient=1.0), caused("drive_lag", 2, time_constant=0.004))
    found = exported(replace(synthetic_arm(), friction=(), effects=causes), "mjcf")
    (text,) = found.texts.values()
    assert [cause.carried for cause in found.held.causes] == ["exactly", "exactly"]
    assert 'ctrlrange="-5.0 5.0"' in text
    assert 'dyntype="filterexact" dynprm="0.004"' in text


def test_friction_that_a_urdf_lacks_is_fitted_and_its_cost_told() -> None:
    """Coulomb friction is nearly a sign; of cogging nothing is left, and it costs its own size."""
    arm = synthetic_arm().extended(caused("cogging", 2, order=12.0, amplitude=0.4))
    found = exported(replace(arm, friction=(caused("coulomb", 3, level=2.0),)), "urdf")
    coulomb, cogging = found.held.causes
    assert (coulomb.carried, cogging.carried) == ("approximated", "lost")
    assert found.held.terms[2].friction == pytest.approx(2.0, rel=0.01)
    assert coulomb.cost is not None
    assert coulomb.cost[2] < 0.1
    assert cogging.cost is not None
    assert cogging.cost[1] == pytest.approx(0.4 / np.sqrt(2.0), rel=0.05)


def compiled(folder: Path, texts: dict[str, str], main: str) -> Path:
    """A program of the exported C and a main function."""
    for file, text in {**texts, "main.c": main}.items():
        (folder / file).write_text(text)
    sources = [file for file in (*texts, "main.c") if file.endswith(".c")]
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wconversion", "-Wshadow"]
    subprocess.run([str(shutil.which("cc")), *flags, *sources, "-o", "a.out", "-lm"], cwd=folder, check=True)
    return folder / "a.out"


SPEED = """#include <stdio.h>
#include <time.h>
#include "NAME.h"
int main(void)
{
    NAME_state state = {0};
    double q[3] = {0.1, 0.2, 0.3}, v[3] = {1, 2, 3}, a[3] = {3, 2, 1}, tau[3], sum = 0.0;
    const clock_t start = clock();
    for (int k = 0; k < 200000; k++) {
        q[0] += 1e-6; v[1] -= 1e-6; a[2] += 1e-6;
        NAME_torque(&state, 1e-3 * k, q, v, a, tau);
        sum += tau[0];
    }
    printf("%g %g\\n", 1e6 * (double)(clock() - start) / CLOCKS_PER_SEC / 200000, sum);
    return 0;
}
"""


def test_c_compiles_without_a_warning_takes_two_microseconds_and_no_heap(tmp_path: Path) -> None:
    """Three joints with friction and six further causes."""
    causes = [caused(name, 2, **VALUES[name]) for name in ("cogging", "spring", "load_friction", "encoder_eccentricity",
                                                           "viscous_drift")]
    arm = synthetic_arm().extended(*causes, caused("presliding", 1, amplitude=1.0, distance=0.02))
    found = exported(arm, "c")
    name = next(file for file in found.texts if file.endswith(".c"))[:-2]
    program = compiled(tmp_path, found.texts, SPEED.replace("NAME", name))
    taken = min(float(subprocess.run([str(program)], capture_output=True, text=True, check=True).stdout.split()[0])
                for _ in range(3))
    assert taken <= 2.0
    assert not re.search(r"malloc|calloc|realloc|alloca|free\(", found.texts[f"{name}.c"])
