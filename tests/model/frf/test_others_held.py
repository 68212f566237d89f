"""What a joint would answer were the others held, where a brake holds them already."""

from __future__ import annotations

import numpy as np

from pipelines.model.frf.others_held import others_held
from pipelines.signal.frequency_response import Responses

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
    alone = others_held(responses, rigid, 0, 1, (2,))
    braked = others_held(responses, rigid, 0, 1, (2, 3), np.array([np.inf, 1.0]))
    assert alone is not None
    assert braked is not None
    np.testing.assert_array_equal(braked.response.response, alone.response.response)
    np.testing.assert_allclose(braked.response.response, 1.0 / (_J * s**2), rtol=1e-2)
    assert others_held(responses, rigid, 0, 1, (3,)) is None
