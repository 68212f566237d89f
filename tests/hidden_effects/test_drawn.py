"""Other plants drawn at random: the same for the same seed, and every fault where its arm can have it."""

from __future__ import annotations

import pytest

from benchmarks.other_plants.arms import ARMS
from benchmarks.other_plants.drawn import drawn, pairs

MANY = drawn(200, seed=3)


def test_a_seed_draws_the_same_cases_and_fewer_are_the_first_of_them() -> None:
    assert drawn(200, seed=3) == MANY
    assert drawn(7, seed=3) == MANY[:7]
    assert drawn(7, seed=4) != MANY[:7]


def test_pairs_are_two_faults_of_one_arm_that_no_name_covers_both_of() -> None:
    several = pairs(60, seed=3)
    assert pairs(7, seed=3) == several[:7]
    for case in several:
        first, second = case.faults
        assert first.arm == second.arm
        assert not set(first.answers) & set(second.answers)
        assert "payload" not in (first.fault, second.fault) or "reference" in {role for _, role in case.motions}


@pytest.mark.parametrize("fault", sorted({case.fault for case in MANY if case.fault}))
def test_a_fault_sits_at_a_joint_of_its_arm(fault: str) -> None:
    """A load shows beside reference logs only, and a constant force along a slide that stands upright is its weight."""
    for case in (case for case in MANY if case.fault == fault):
        joints = set(range(1, len(ARMS[case.arm].axes) + 1))
        assert case.joint in joints
        assert fault not in ("heat from another joint", "torque_crosstalk") or int(case.number) + 1 in joints - {case.joint}
        assert fault != "payload" or "reference" in {role for _, role in case.motions}
        assert fault != "torque_offset" or (case.arm, case.joint) not in {("lift", 1), ("gantry", 3), ("scara", 3)}
