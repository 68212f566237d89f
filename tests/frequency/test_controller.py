"""The sampled controller, against the bench's own loop and scipy's filters; what a continuous one would cost."""

from __future__ import annotations

import numpy as np
from scipy.signal import freqz

from bench.control import Observer, observer_gain
from pipelines.frequency.controller import (
    double_integrator,
    loop_delay,
    sampled_controller,
)
from pipelines.io.log import Controller

T = 1e-3
FREQUENCY = np.array([1.0, 5.0, 28.0, 80.0, 200.0])


def controller(velocity: str, **more: object) -> Controller:
    return Controller("computed-torque", kp=np.array([400.0]), kd=np.array([28.0]), velocity=velocity, **more)  # type: ignore[arg-type]


def test_backward_difference_is_the_filter_it_says() -> None:
    """u = kp e + kd (e[k] - e[k-1])/T, by scipy's freqz."""
    found = sampled_controller(controller("backward-difference"), 1, FREQUENCY, T)
    _, truth = freqz([400.0 + 28.0 / T, -28.0 / T], [1.0], worN=2.0 * np.pi * FREQUENCY * T)
    assert found is not None
    np.testing.assert_allclose(found, truth, rtol=1e-12)


def test_observer_is_the_recursion_of_the_bench() -> None:
    """Its pulse response, sample by sample in plain Python, transformed."""
    gain = observer_gain(T, 3e-6, 4000.0)
    own, out = Observer((gain,), T), []
    for k in range(4000):
        own.update([1.0 if k == 0 else 0.0])
        # The recursion starts from nothing, as the filter does: the first step of zero time changes nothing.
        out.append(400.0 * own.e[0] + 28.0 * own.de[0])
    truth = np.array(out) @ np.exp(-2j * np.pi * np.outer(np.arange(4000) * T, FREQUENCY))
    found = sampled_controller(controller("observer", observer_gain=np.array([gain])), 1, FREQUENCY, T)
    assert found is not None
    np.testing.assert_allclose(found, truth, rtol=1e-6)


def test_the_double_integrator_is_sampled_and_held() -> None:
    """scipy's cont2discrete of 1/s², and a whole sample of delay."""
    from scipy.signal import cont2discrete

    b, a, _ = cont2discrete(([1.0], [1.0, 0.0, 0.0]), T, method="zoh")
    _, truth = freqz(np.squeeze(b), a, worN=2.0 * np.pi * FREQUENCY * T)
    np.testing.assert_allclose(double_integrator(FREQUENCY, T), truth, rtol=1e-7)
    np.testing.assert_allclose(double_integrator(FREQUENCY, T, 1), truth * np.exp(-2j * np.pi * FREQUENCY * T), rtol=1e-7)


def test_what_is_not_described_is_not_guessed() -> None:
    """No gains, an integral part, no word on the velocity, an observer without its gain: no controller."""
    f = FREQUENCY
    assert sampled_controller(None, 1, f, T) is None
    assert sampled_controller(Controller("pd", kp=np.ones(1)), 1, f, T) is None
    assert sampled_controller(controller("observer"), 1, f, T) is None
    assert sampled_controller(controller("backward-difference", ki=np.ones(1)), 1, f, T) is None
    assert loop_delay(controller("observer", delay=1), "r") == (0, 1)
    assert loop_delay(controller("observer", delay=1), "tau") == (1, 0)
