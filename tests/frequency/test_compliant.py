"""Base and joint springs: their frequencies by scipy's eigenvalues, and that neither is taken for the other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh

from pipelines.frequency.grouping import (
    explain,
    group_joint,
    predicted,
)
from pipelines.frequency.modes import Modes, Pair
from pipelines.frequency.rational import Known, Mode, Rational
from pipelines.frequency.spectra import FrequencyResponse
from pipelines.io.log import Array
from tests.seeds import seeds

_EMPTY = FrequencyResponse(np.zeros(0), np.zeros(0, complex), np.zeros(0), np.zeros(0), 1.0, 1.0, 1.0)
_NONE = Rational(np.zeros(2), np.zeros((2, 2)), 0, 0, 1.0, (4.0, 250.0), 1.0, 0.0)


def two_masses(motor: float, link: float, stiffness: float) -> tuple[float, float]:
    """Antiresonance (motor locked) and resonance [Hz], by scipy's generalised eigenvalues."""
    k = stiffness * np.array([[1.0, -1.0], [-1.0, 1.0]])
    free = np.sqrt(np.maximum(eigh(k, np.diag([motor, link]), eigvals_only=True), 0.0)) / (2.0 * np.pi)
    return float(np.sqrt(stiffness / link) / (2.0 * np.pi)), float(free[1])


def base_under_arm(frequency: float, base: float, arm: float) -> tuple[float, float]:
    """A base on a spring to the ground, the arm turning freely on it, or locked to it."""
    return frequency * float(np.sqrt(base / (base + arm))), frequency


def three_masses(f_b: float, base: float, motor: float, link: float, stiffness: float) -> tuple[Array, Array]:
    """Base, motor and link in angles against the ground; with the motor locked to the base, and free."""
    ground = base * (2.0 * np.pi * f_b) ** 2
    k = np.array([[ground, 0.0, 0.0], [0.0, stiffness, -stiffness], [0.0, -stiffness, stiffness]])
    m = np.diag([base, motor, link])
    locked = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    hertz = [np.sqrt(np.maximum(eigh(t.T @ k @ t, t.T @ m @ t, eigvals_only=True), 0.0)) / (2.0 * np.pi)
             for t in (locked, np.eye(3))]
    return hertz[0], hertz[1][1:]


def modes_of(pairs: list[tuple[float, float]], inertia: float, delay: float = 0.0, flat: float = 1.01, std: float = 1e-3) -> Modes:
    """As they would have been measured, without error."""
    def mode(kind: str, f: float) -> Mode:
        return Mode(kind, Known(f, std * f), Known(0.03, 1e-3))  # type: ignore[arg-type]

    found = tuple(Pair(mode("antiresonance", a), mode("resonance", r)) for a, r in pairs)
    every = tuple(m for p in found for m in (p.antiresonance, p.resonance))
    return Modes(every, found, (), Known(1.0, 1e-3), Known(delay, 2e-6), flat, Known(inertia, 1e-3), 1.0, 0.001, 0.001, (4.0, 250.0),
                 _EMPTY, _NONE)


def test_frequencies_are_those_of_the_masses() -> None:
    """Joint, base, and both at once, against scipy."""
    np.testing.assert_allclose(np.concatenate(predicted(1.2, None, (9000.0, 0.2))), two_masses(0.2, 1.0, 9000.0), rtol=1e-9)
    np.testing.assert_allclose(np.concatenate(predicted(1.2, (28.0, 8.0), None)), base_under_arm(28.0, 8.0, 1.2), rtol=1e-9)
    for own, truth in zip(predicted(1.2, (28.0, 8.0), (9000.0, 0.2)), three_masses(28.0, 8.0, 0.2, 1.0, 9000.0), strict=True):
        np.testing.assert_allclose(own, truth, rtol=1e-9)


@pytest.mark.parametrize("seed", seeds(40, usual=10))
def test_neither_is_taken_for_the_other(seed: int) -> None:
    """Random bases and joints in two postures, frequencies off by 0.3 %: named rightly or left open, never the other."""
    rng = np.random.default_rng([8, seed])
    inertia = np.array([1.0, rng.uniform(1.0, 1.4)])
    joint = bool(seed % 2)
    motor, base, f = float(rng.uniform(0.05, 0.7)), float(rng.uniform(3.0, 80.0)), float(rng.uniform(20.0, 90.0))
    true = [two_masses(motor, j - motor, (1.0 - motor) * (2.0 * np.pi * f) ** 2) if joint else base_under_arm(f, base, j)
            for j in inertia]
    noisy = [(a * rng.normal(1.0, 0.003), r * rng.normal(1.0, 0.003)) for a, r in true]
    noisy = [(min(a, 0.9999 * r), r) for a, r in noisy]
    found, _ = group_joint(1, [modes_of([pair], float(j), std=3e-3) for pair, j in zip(noisy, inertia, strict=True)], 1e-3)
    assert [one.kind for one in found] in ([], ["joint" if joint else "base"])


def test_numbers_come_back() -> None:
    """Stiffness and motor inertia of a joint, frequency and inertia of a base, and all four of both together."""
    inertia = (1.1, 1.3)
    pairs = [[Pair(*one.modes[:2])] for one in (modes_of([two_masses(0.2, j - 0.2, 15000.0)], j) for j in inertia)]
    spring = explain(pairs, inertia, (False, True))
    assert spring is not None
    assert spring.joint == pytest.approx((15000.0, 0.2), rel=1e-4)
    both = [list(zip(*three_masses(28.0, 8.0, 0.2, j - 0.2, 15000.0), strict=True)) for j in inertia]
    found, left = group_joint(1, [modes_of(p, j) for p, j in zip(both, inertia, strict=True)], 1e-3)
    assert not left
    by_kind = {one.kind: one.parameters for one in found}
    assert by_kind["base"]["inertia"].value == pytest.approx(8.0, rel=1e-3)
    assert by_kind["joint"]["stiffness"].value == pytest.approx(15000.0, rel=1e-3)
    assert by_kind["joint"]["motor_inertia"].value == pytest.approx(0.2, rel=1e-3)


def geared_arm(f_b: float, base: float, rotor: float, link: float) -> tuple[float, float]:
    """A link on a base, turned by a rotor whose speed is that between them and which the base does not carry along."""
    ground = base * (2.0 * np.pi * f_b) ** 2
    m = np.array([[base + link, link], [link, link + rotor]])  # x of the base, q of the joint
    free = eigh(np.diag([ground, 0.0]), m, eigvals_only=True)
    return float(np.sqrt(ground / (base + link)) / (2.0 * np.pi)), float(np.sqrt(free[1]) / (2.0 * np.pi))


def test_a_base_under_a_geared_arm_is_a_base() -> None:
    """Two fifths of the inertia are a rotor's: its resonance moves by 1 to 2 %; its inertia comes back within 2 %."""
    links = (0.6, 1.1)
    pairs = [geared_arm(20.0, 5.0, 0.5, link) for link in links]
    (base,), left = group_joint(1, [modes_of([p], link + 0.5, std=1e-4) for p, link in zip(pairs, links, strict=True)], 1e-3)
    assert base.kind == "base"
    assert not left
    assert base.parameters["inertia"].value == pytest.approx(5.0, rel=0.02)


def test_numbers_vary_as_their_deviations_say() -> None:
    """A spring's stiffness and motor inertia from 40 draws of noisy frequencies."""
    rng, inertia, found = np.random.default_rng(5), (1.1, 1.4), []
    for _ in range(40):
        pairs = [tuple(f * rng.normal(1.0, 4e-3) for f in two_masses(0.3, j - 0.3, 15000.0)) for j in inertia]
        ((one,), _) = group_joint(1, [modes_of([(a, r)], j, std=4e-3) for (a, r), j in zip(pairs, inertia, strict=True)], 1e-3)
        found.append([(known.value, known.std) for known in (one.parameters["stiffness"], one.parameters["motor_inertia"])])
    values, told = np.moveaxis(np.array(found), 2, 0)
    assert np.median(told, axis=0) == pytest.approx(np.std(values, axis=0), rel=0.35)


def test_one_posture_does_not_tell() -> None:
    """A small pair in one posture is open, with what to record; where the rise is large it is a link behind a spring."""
    found, left = group_joint(1, [modes_of([base_under_arm(28.0, 8.0, 1.2)], 1.2)], 1e-3)
    assert found == []
    assert left[0].candidates == ("base_resonance", "joint_elasticity", "backlash")
    assert "further posture" in left[0].experiment
    found, left = group_joint(3, [modes_of([two_masses(0.02, 0.1, 3000.0)], 0.12)], 1e-3)
    assert [(one.kind, one.joint) for one in found] == [("joint", 3)]


def test_delay_and_rigid() -> None:
    """A turning phase under a flat magnitude is a delay; under one that falls it is open; neither is rigid."""
    late, _ = group_joint(2, [modes_of([], 0.5, delay=1.5e-3), modes_of([], 0.6, delay=1.52e-3)], 1e-3)
    assert [one.kind for one in late] == ["delay"]
    assert late[0].parameters["delay"].value == pytest.approx(1.51e-3, rel=0.01)
    nothing, lag = group_joint(2, [modes_of([], 0.5, delay=1.5e-3, flat=3.0)], 1e-3)
    assert nothing == []
    assert "drive_lag" in lag[0].candidates
    rigid, _ = group_joint(2, [modes_of([], 0.5)], 1e-3)
    assert [(one.kind, one.cause) for one in rigid] == [("rigid", None)]
