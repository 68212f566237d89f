"""Strengths are those that causes.md lists, on the paper's machine; other machines get what fits
them.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from bench.draw import paper_machine
from bench.faults import make
from bench.machine import Parameters

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


def at(name: str, joint: int = 2, strength: float = 1.0) -> Parameters:
    return make(
        name, paper_machine(), joint, seed=6, strength=strength, peak_torque=PEAK
    ).parameters()


@pytest.mark.parametrize("name", LISTED)
def test_full_strength(name: str) -> None:
    for joint in (1, 2, 3):
        found = at(name, joint)
        for key, expected in LISTED[name].items():
            assert abs(found[key]) == pytest.approx(expected(joint - 1), rel=1e-12), key  # type: ignore[arg-type]
    if name in RANGES:
        key, low, high = RANGES[name]
        assert low <= found[key] <= high  # type: ignore[operator]
