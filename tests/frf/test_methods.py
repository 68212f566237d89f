"""Three methods and three estimators against a plant that scipy simulates in a sampled loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.frequency.findings import frf_findings
from pipelines.frequency.modes import fitted_modes
from pipelines.frequency.responses import Measured, measured_responses
from pipelines.frequency.spectra import FrequencyResponse
from pipelines.io.log import Array, Signal
from tests.frf.loops import Loop, T, elastic, rigid
from tests.seeds import rarely

LINK = Loop(elastic(0.2, 0.8, 8000.0, 4.0))


def measured(loop: Loop) -> Measured:
    (one,) = measured_responses([loop.log()])
    return one


def error(loop: Loop, response: FrequencyResponse, low: float, high: float) -> float:
    """Median share by which it is off the truth."""
    part = response.within(low, high)
    return float(np.median(np.abs(part.response / loop.response(part.frequency) - 1.0)))


@pytest.mark.parametrize("loop", [LINK, replace(LINK, law="pd"), replace(LINK, inertia=1.3)], ids=["multisine", "pd", "wrong model"])
def test_default_and_indirect_find_the_plant(loop: Loop) -> None:
    """Within 1 % from 2 to 100 Hz without disturbance, under computed torque and PD."""
    found = measured(loop)
    assert found.indirect is not None
    for response in (found.plant, found.indirect):
        assert error(loop, response, 2.0, 20.0) < 0.003
        assert error(loop, response, 20.0, 100.0) < 0.01


def test_a_strong_disturbance_misleads_the_direct_method_alone() -> None:
    """Below the bandwidth its coherence is fine and its answer wrong by tens of percent; the default stays within 3 %."""
    loop = replace(Loop(rigid(1.0)), disturbance=10.0, seconds=200.0)
    found = measured(loop)
    low = found.direct.within(1.0, 2.5)
    wrong = np.abs(low.response / loop.response(low.frequency) - 1.0)
    assert np.median(low.coherence) > 0.7
    assert np.median(wrong) > 0.5
    fit = fitted_modes(found)
    frequency = np.linspace(4.0, 100.0, 50)
    assert np.abs(fit.fit.response(frequency) - 1.0).max() < 0.03
    inside = found.plant.within(1.0, 100.0)
    off = np.abs(inside.response / loop.response(inside.frequency) - 1.0) / np.sqrt(inside.variance) * np.abs(inside.response)
    assert np.mean(off**2) < 1.3  # no more than its variance says: no bias


@pytest.mark.parametrize("law", [*rarely("computed-torque"), "pd"])
def test_the_delay_of_a_controller_is_known(law: str) -> None:
    """A sample between what it read and the torque it leads to, as the log says: no delay of the plant, by either method."""
    loop = Loop(rigid(1.0), law=law, late=1)
    log = loop.log()
    assert log.controller is not None
    signals = dict(log.signals)
    if law == "pd":  # torque is logged as it acts
        acting = np.concatenate([np.zeros((1, 1)), log.tau[:-1]])
        signals["tau"] = Signal(acting, "N m", "torque")
    (found,) = measured_responses([replace(log, signals=signals, controller=replace(log.controller, delay=1))])
    assert fitted_modes(found).delay.value == pytest.approx(0.0, abs=1e-5)
    truth = loop if law == "computed-torque" else replace(loop, late=0)
    assert found.indirect is not None
    assert error(truth, found.plant, 3.0, 60.0) < 0.01
    assert error(truth, found.indirect, 3.0, 60.0) < 0.01


@pytest.mark.parametrize("late", [0, 1, 5])
def test_a_delay_is_a_delay(late: int) -> None:
    """Whole samples, also so many that the phase turns round in the band; none is rigid."""
    found = frf_findings([Loop(rigid(1.0), late=late, disturbance=0.02).log()])
    (one,) = found.classification
    assert one.kind == ("delay" if late else "rigid")
    assert found.seen[0].modes.delay.value == pytest.approx(late * 1e-3, abs=2e-5)


@pytest.mark.parametrize("period", [2000, None])
def test_modes_of_a_link_on_a_spring(period: int | None) -> None:
    """By lines and by noise: frequencies within 0.1 %, damping within 3 %, inertia of the rigid body within 1 %."""
    found = frf_findings([replace(LINK, period=period).log()])
    modes = found.seen[0].modes
    locked, free = np.sqrt(8000.0 / 0.8), np.sqrt(8000.0 * (1.0 / 0.2 + 1.0 / 0.8))
    truth = [(locked, 4.0 / (2.0 * 0.8 * locked)), (free, 4.0 * (1.0 / 0.2 + 1.0 / 0.8) / (2.0 * free))]
    assert [m.kind for m in modes.modes] == ["antiresonance", "resonance"]
    for mode, (omega, damping) in zip(modes.modes, truth, strict=True):
        assert mode.frequency.value == pytest.approx(omega / (2.0 * np.pi), rel=1e-3)
        assert mode.damping.value == pytest.approx(damping, rel=0.03)
    assert modes.inertia is not None
    assert modes.inertia.value == pytest.approx(1.0, rel=0.01)
    (one,) = found.classification
    assert (one.kind, one.joint) == ("joint", 1)
    assert one.parameters["motor_inertia"].value == pytest.approx(0.2, rel=0.02)
    assert one.parameters["stiffness"].value == pytest.approx(8000.0, rel=0.02)


class Noise(Loop):
    """v is noise from 3 to 80 Hz."""

    def _excitation(self, rng: np.random.Generator, samples: int) -> Array:
        f = np.fft.rfftfreq(samples, T)
        spectrum = np.where((f >= 3.0) & (f <= 80.0), np.fft.rfft(rng.standard_normal(samples)), 0.0)
        return np.asarray(3.0 * self.strength * np.fft.irfft(spectrum, samples))


def test_a_bin_at_the_end_of_the_band_does_not_hide_a_rigid_joint() -> None:
    """A flat response whose last bin, at the edge of v, is off by as much as it is long."""
    found = frf_findings([Noise(rigid(1.0), strength=2.0, encoder=3e-6, seconds=24.0, seed=0).log()])
    assert [one.kind for one in found.classification] == ["rigid"]
