"""Other plants drawn at random: the same for the same seed, and every fault where its arm can have it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.other_plants.arms import ARMS
from benchmarks.other_plants.cases import CASES
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


def test_both_faults_of_a_pair_act() -> None:
    """Nothing pulls along a table but an offset, which its drive bears; and noise of what is logged late is smoothed away."""
    plain = next(one for one in drawn(200, seed=3) if one.arm == "table")
    late = replace(plain, fault="torque_lag", joint=2, size=0.02, beside=None)
    tau = replace(plain, fault="torque_offset", joint=1, size=8.0, beside=late).logs()[-1].tau
    assert np.mean(tau[:, 0]) == pytest.approx(-8.0, rel=0.1)
    rough = np.std(np.diff(tau, axis=0), axis=0) / np.std(tau, axis=0)
    assert rough[1] < 0.3 * rough[0]


def test_no_two_cases_share_the_folder_of_their_logs() -> None:
    names = [case.name for case in (*CASES, *MANY, *drawn(200, seed=4))]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("fault", sorted({case.fault for case in MANY if case.fault}))
def test_a_fault_sits_at_a_joint_of_its_arm(fault: str) -> None:
    """A load shows beside reference logs only, and a constant force along a slide that stands upright is its weight."""
    for case in (case for case in MANY if case.fault == fault):
        joints = set(range(1, len(ARMS[case.arm].axes) + 1))
        assert case.joint in joints
        assert fault not in ("heat from another joint", "torque_crosstalk") or int(case.number) + 1 in joints - {case.joint}
        assert fault != "payload" or "reference" in {role for _, role in case.motions}
        assert fault != "torque_offset" or (case.arm, case.joint) not in {("lift", 1), ("gantry", 3), ("scara", 3)}


def test_a_fault_of_the_library_has_an_answer_and_one_outside_none() -> None:
    outside = {"heat from another joint", "hopping torque"}
    for case in MANY:
        assert bool(case.answers) is (case.law in ("stribeck", "lugre") if not case.fault else case.fault not in outside)
