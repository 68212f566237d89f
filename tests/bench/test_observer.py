"""The observer in the loop is the stationary Kalman filter: scipy and filterpy are the judges."""

from __future__ import annotations

import numpy as np

from bench.control import Observer, observer_gain

T, NOISE, JERK = 1e-3, 3e-6, 4000.0


def model() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    gamma = np.array([[T**3 / 6], [T**2 / 2], [T]])
    return (
        np.array([[1, T, T**2 / 2], [0, 1, T], [0, 0, 1]]),
        JERK**2 * gamma @ gamma.T,
        np.array([[1.0, 0.0, 0.0]]),
    )


def test_recursion_is_filterpys() -> None:
    """Eq. (20) on a random signal, joint by joint, from zero error."""
    from filterpy.kalman import KalmanFilter

    e, q, c = model()
    gains = (observer_gain(T, NOISE, JERK), observer_gain(T, 1e-5, 500.0))
    y = 1e-3 * np.random.default_rng(1).standard_normal((300, 2))
    observer = Observer(gains, T)
    for j, gain in enumerate(gains):
        reference = KalmanFilter(3, 1)
        reference.F, reference.H, reference.x = e, c, np.zeros((3, 1))
        states = []
        for k, value in enumerate(y[:, j]):
            if k:
                reference.x = reference.F @ reference.x
            reference.x = reference.x + np.array(gain)[:, None] * (
                value - reference.H @ reference.x
            )
            states.append(reference.x[:, 0])
        if j == 0:
            ours = []
            for row in y.tolist():
                observer.update(row)
                ours.append([*observer.e, *observer.de, *observer.nu])
            found = np.array(ours)
        np.testing.assert_allclose(found[:, j::2], states, rtol=1e-9, atol=1e-12)
    assert q.shape == (3, 3)
