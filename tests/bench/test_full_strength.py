"""Strengths are those that causes.md lists, on the paper's machine; other machines get what fits
them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bench.control import Decentralised
from bench.draw import machine_of, paper_machine
from bench.faults import fault_names, find_fault, make
from bench.machine import Fault, Machine, Parameters
from bench.motions import Reference, sweeps
from bench.plant import Recording, run
from pipelines.errors import UsageError
from pipelines.io.robot import Joint, RobotDescription
from tests.bench.machines import turntable

S = (1.0, 0.7, 0.25)  # "joint factors 1, 0.7, 0.25 where s stands"
FC, FV = (
    (4.8, 2.4, 1.2),
    (0.60, 0.30, 0.12),
)  # of the paper's machine: sums of its sigmoids, [N m] and [N m s/rad]
PEAK = (40.0, 20.0, 10.0)  # [N m]

# causes.md, "Full strength (×1)": size of a number in the answer, at joint j (0-based).
LISTED: dict[str, dict[str, Callable[[int], float]]] = {
    "cogging": {"amplitude": lambda j: 0.4 * S[j], "amplitude_2": lambda j: 0.35 * 0.4 * S[j]},
    "stribeck": {"amplitude": lambda j: 0.4 * FC[j]},
    "asymmetric_friction": {"coulomb_difference": lambda j: 0.2 * FC[j]},
    "load_friction": {"mu": lambda j: 0.06},
    "position_friction": {"amplitude": lambda j: 0.4 * FC[j]},
    "presliding": {"distance": lambda j: 30e-3},
    "quadratic_drag": {"coefficient": lambda j: 0.08 * S[j]},
    "viscous_drift": {"relative_change": lambda j: 0.5, "time_constant": lambda j: 15.0},
    "spring": {"stiffness": lambda j: 2.5 * S[j]},
    "torque_offset": {"offset": lambda j: 0.4 * S[j]},
    "torque_gain": {"gain_error": lambda j: 0.1},
    "torque_saturation": {"limit": lambda j: 0.55 * PEAK[j]},
    "drive_lag": {"time_constant": lambda j: 5e-3},
    "time_delay": {"delay": lambda j: 5e-3},
    "encoder_eccentricity": {"amplitude": lambda j: 4e-3},
    "encoder_crosstalk": {"coefficient": lambda j: 0.015},
    "payload": {"mass": lambda j: 0.5},
    "gravity_tilt": {"angle": lambda j: math.radians(5.0)},
    "link_length": {"error": lambda j: 0.012},
    "rotor_inertia": {"inertia": lambda j: 6e-3},
    "joint_elasticity": {"frequency": lambda j: 30.0},
    "base_resonance": {"inertia": lambda j: 8.0},
    "backlash": {"gap": lambda j: 4e-3},
    "contact": {"force": lambda j: 25.0},
    "torque_crosstalk": {"coefficient": lambda j: 0.1},
    "concave_friction": {"amplitude": lambda j: 0.4 * FC[j]},
    "torque_lag": {"time_constant": lambda j: 5e-3},
}
RANGES = {"base_resonance": ("frequency", 24.0, 32.0), "contact": ("duration", 0.1, 0.3)}
# Where ×0.3 and ×0.1 are listed too.
WEAKER = {
    "presliding": ("distance", 10e-3, 3e-3),
    "torque_saturation": ("limit", 0.7 * 20.0, 0.82 * 20.0),
    "joint_elasticity": ("frequency", 50.0, 80.0),
    "base_resonance": ("inertia", 27.0, 80.0),
}


def at(name: str, joint: int = 2, strength: float = 1.0) -> Parameters:
    return make(
        name, paper_machine(), joint, seed=6, strength=strength, peak_torque=PEAK
    ).parameters()


def test_every_cause_with_a_strength_is_looked_at() -> None:
    """causes.md gives none for the coupling of a transmission."""
    known = {name for name in fault_names() if find_fault(name).known}
    assert set(LISTED) == known - {"transmission_coupling"}


@pytest.mark.parametrize("name", LISTED)
def test_full_strength(name: str) -> None:
    for joint in (1, 2, 3):
        found = at(name, joint)
        for key, expected in LISTED[name].items():
            assert abs(found[key]) == pytest.approx(expected(joint - 1), rel=1e-12), key  # type: ignore[arg-type]
    if name in RANGES:
        key, low, high = RANGES[name]
        assert low <= found[key] <= high  # type: ignore[operator]


@pytest.mark.parametrize("name", WEAKER)
def test_weaker_by_the_list(name: str) -> None:
    key, *values = WEAKER[name]
    for strength, expected in zip((0.3, 0.1), values, strict=True):
        assert at(name, 2, strength)[key] == pytest.approx(expected, rel=0.02)
    whole = make(name, paper_machine(), 2, seed=6, peak_torque=PEAK)
    assert whole.scaled(0.5).scaled(0.2).parameters() == pytest.approx(
        whole.scaled(0.1).parameters()
    )


def gantry() -> Machine:
    """Two slides that carry a turning joint."""
    joints = (
        Joint(
            "x",
            type="prismatic",
            alpha=math.pi / 2,
            position=(-0.4, 0.4),
            velocity=1.0,
            torque=200.0,
        ),
        Joint(
            "y",
            type="prismatic",
            alpha=math.pi / 2,
            position=(-0.4, 0.4),
            velocity=1.0,
            torque=120.0,
        ),
        Joint("wrist", a=0.2, velocity=6.0, torque=30.0),
    )
    return machine_of(RobotDescription("gantry", (0.0, 0.0, -9.81), "dh", joints), seed=2)


@pytest.fixture(scope="module")
def sound() -> tuple[Machine, Reference, Recording]:
    """Return the healthy gantry, its reference, and its run."""
    machine = gantry()
    reference = sweeps(machine, np.random.default_rng(1), 0.2)
    return machine, reference, run(machine, Decentralised(), reference)


@pytest.mark.parametrize("name", fault_names())
def test_a_slide_can_have_every_fault(
    name: str, sound: tuple[Machine, Reference, Recording]
) -> None:
    """It moves or loads the machine, and no more than a machine survives: less than 10 cm."""
    machine, reference, well = sound
    peak = tuple(np.abs(well.tau).max(axis=0).tolist())
    sick = run(
        machine,
        Decentralised(),
        reference,
        [make(name, machine, 1, 3, peak_torque=peak, duration=0.2)],
    )
    if (
        name != "link_length"
    ):  # where on a slide the next joint sits, neither inertia nor weight tells
        assert np.abs(np.hstack([sick.true_q - well.true_q, sick.tau - well.tau])).max() > 1e-7
    assert np.abs(sick.true_q - well.true_q)[:, :2].max() < 0.1


def test_lengths_on_a_slide_are_a_tenth_of_a_metre_for_a_radian() -> None:
    """So are speeds; stiffness and drag grow so that a stroke feels as much of them as a turn
    does.
    """
    slide = gantry()
    turn = replace(
        slide,
        robot=replace(
            slide.robot,
            joints=tuple(replace(joint, type="revolute") for joint in slide.robot.joints),
        ),
    )

    def ratio(name: str, key: str) -> float:
        a, b = (make(name, machine, 1, seed=3).parameters()[key] for machine in (slide, turn))
        return float(a / b)  # type: ignore[operator]

    for name, key in (
        ("backlash", "gap"),
        ("presliding", "distance"),
        ("stribeck", "speed"),
        ("concave_friction", "speed"),
        ("spring", "rest_angle"),
        ("encoder_eccentricity", "amplitude"),
    ):
        assert ratio(name, key) == pytest.approx(0.1), name
    assert ratio("spring", "stiffness") == pytest.approx(10.0)
    assert ratio("quadratic_drag", "coefficient") == pytest.approx(100.0)


@pytest.mark.parametrize("name", ["torque_crosstalk", "encoder_crosstalk", "transmission_coupling"])
def test_what_two_joints_share_needs_two(name: str) -> None:
    with pytest.raises(UsageError, match="the machine has one"):
        make(name, turntable(), 1)


def faults_at(*names: str) -> list[Fault]:
    return [make(name, paper_machine(), 2) for name in names]


def test_one_joint_does_not_give_way_twice() -> None:
    """A spring and a gap at one joint would silently be one of them: it is refused, at two joints
    it is not.
    """
    from bench.plant import plan_with

    with pytest.raises(UsageError, match="joint 2 gives way twice"):
        plan_with(paper_machine(), faults_at("joint_elasticity", "backlash"))
    both = plan_with(
        paper_machine(), [make("joint_elasticity", paper_machine(), 1), *faults_at("backlash")]
    )
    assert [joint.twist is not None for joint in both.joints] == [True, True, False]
