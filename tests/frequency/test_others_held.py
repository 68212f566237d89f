"""What a joint would answer were the others held: by a brake already, or not at all."""

from __future__ import annotations

import numpy as np

from pipelines.frequency.others_held import others_held
from pipelines.frequency.spectra import Responses

_J, _COUPLING = 2.0, 0.5  # [kg m^2]


def test_a_joint_that_its_brake_holds_changes_nothing() -> None:
    f = np.arange(4.0, 60.0)
    s = np.asarray(2j * np.pi * f, dtype=np.complex128)
    rigid = np.asarray(1.0 / s**2, dtype=np.complex128)
    moving = 0.3 / (1.0 + s / 200.0) / s**2
    torque = 1.0 + _COUPLING * s**2 * moving
    values = np.stack([torque, 1.0 / (_J * s**2), moving, np.zeros_like(s)], axis=1)
    covariance = np.einsum("bk,kl->bkl", (1e-4 * np.abs(values)) ** 2, np.eye(4)).astype(complex)
    responses = Responses(f, values, covariance, np.ones(values.shape), "welch", 1.0, 10.0, 1.0)
    alone = others_held(responses, rigid, 0, 1, (2,), np.array([np.inf]))
    braked = others_held(responses, rigid, 0, 1, (2, 3), np.array([np.inf, 1.0]))
    assert alone is not None
    assert braked is not None
    np.testing.assert_array_equal(braked.response.response, alone.response.response)
    np.testing.assert_allclose(braked.response.response, 1.0 / (_J * s**2), rtol=1e-2)
    assert others_held(responses, rigid, 0, 1, (3,), np.array([np.inf])) is None


def test_a_link_on_a_spring_stays_one_mode_where_its_neighbour_swings_freely() -> None:
    """Motor, spring, link, and a second joint that its loop holds up to 3 Hz alone, with noise of its encoder."""
    f = np.arange(20.0, 150.0, 0.5)
    s = np.asarray(2j * np.pi * f, dtype=np.complex128)
    motor, link, coupled, other, stiffness, damping = 0.65, 1.57, 0.37, 0.39, 137e3, 32.0
    held, spring = 2.0 * np.pi * 3.0, damping * s + stiffness
    zero = np.zeros_like(s)
    impedance = np.array([[motor * s**2 + spring, -spring, zero],
                          [-spring, link * s**2 + spring, coupled * s**2],
                          [zero, coupled * s**2, other * (s**2 + (1.4 * held + 1.0) * s + held**2)]])
    motion = np.linalg.inv(np.moveaxis(impedance, 2, 0))[:, :, 0]  # of a unit torque
    values = np.stack([np.ones_like(s), motion[:, 0], motion[:, 2]], axis=1)
    std = np.tile([2e-3, 5e-8, 5e-8], (len(f), 1))
    noise = np.random.default_rng(9).standard_normal((2, *values.shape)) / np.sqrt(2.0)
    values = values + std * (noise[0] + 1j * noise[1])
    covariance = np.einsum("bk,kl->bkl", std**2, np.eye(3)).astype(complex)
    responses = Responses(f, values, covariance, np.ones(values.shape), "welch", 1.0, 10.0, 1.0)
    found = others_held(responses, np.asarray(1.0 / s**2), 0, 1, (2,), np.array([2.0]))
    assert found is not None
    mode = link * s**2 / (s**2 + damping / link * s + stiffness / link)
    np.testing.assert_allclose(found.response.response * s**2 * (motor + link - mode), 1.0, atol=0.2)


def test_a_neighbour_that_is_mostly_noise_does_not_stand_in_for_modes() -> None:
    """Four modes, one more than are sought: as large a D_jk as masses cannot have would hide the fourth in noise."""
    f = np.arange(8.0, 120.0, 0.5)
    s = np.asarray(2j * np.pi * f, dtype=np.complex128)
    impedance = 1.2 + np.zeros_like(s)
    for share, hertz, damping in ((0.6, 26.0, 0.03), (0.3, 33.0, 0.04), (0.1, 60.0, 0.05), (0.05, 90.0, 0.05)):
        omega = 2.0 * np.pi * hertz
        impedance -= share * s**2 / (s**2 + 2.0 * damping * omega * s + omega**2)
    values = np.stack([np.ones_like(s), 1.0 / (impedance * s**2), 0.03 / s**2], axis=1)
    std = np.stack([np.full(len(f), 4e-3), 1e-3 * np.abs(values[:, 1]), np.full(len(f), 1e-6)], axis=1)
    noise = np.random.default_rng(0).standard_normal((2, *values.shape)) / np.sqrt(2.0)
    values = values + std * (noise[0] + 1j * noise[1])
    covariance = np.einsum("bk,kl->bkl", std**2, np.eye(3)).astype(complex)
    responses = Responses(f, values, covariance, np.ones(values.shape), "welch", 1.0, 10.0, 1.0)
    found = others_held(responses, np.asarray(1.0 / s**2), 0, 1, (2,), np.array([1.2]))
    assert found is not None
    np.testing.assert_allclose(found.response.response * s**2 * impedance, 1.0, atol=0.5)
