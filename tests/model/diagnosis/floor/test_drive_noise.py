"""The noise of drives, on arms of the bench: what a law lacks passes for noise, but not where the motion comes again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.bench import experiments
from pipelines.bench.fault import Fault
from pipelines.bench.faults.presliding import Presliding
from pipelines.bench.machine import Machine, draw_machine
from pipelines.bench.session import record
from pipelines.log.experiment import Array, ExperimentLog
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.floor.drive_noise import drive_noise

JOINT = 1  # from 0, whose friction is the largest
HERTZ = 8.0  # of a low-pass that leaves little that is quick


def recorded(machine: Machine, *faults: Fault) -> ExperimentLog:
    """Two periods of 8 s."""
    return record(machine, faults, [experiments.excitation(machine, 3, 8.0, 2)], 5)[0]


def noise(log: ExperimentLog) -> tuple[Array, Array]:
    """(joints,) [N m] white noise of the drives, and what the nominal model leaves."""
    prepared = prepare(Logs((log,)), DiagnosisSettings(cutoff_hz=HERTZ))
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit)
    found = drive_noise(model, prepared.data, fit.left, prepared.motions, prepared.recipe, 0, 1)
    return found.white, fit.rms


@pytest.mark.slow
def test_what_repeats_is_no_noise() -> None:
    """A joint that bends over 30 mrad before it slides leaves eighty times the noise, and as much in each period: told of its
    period, the log has a third of the noise that is told of it without. Joints in order have the same, told or not."""
    machine = draw_machine(11, "fault")
    law = machine.friction[JOINT]
    log = recorded(machine, Presliding(JOINT + 1, 1.0, law.coulomb, law.sharpness))
    (told, left), (untold, _) = noise(log), noise(replace(log, period=None))
    assert left[JOINT] > 50.0 * machine.amplifier_noise[JOINT]
    assert told[JOINT] < 0.5 * untold[JOINT]
    order = np.arange(3) != JOINT
    assert (told[order] <= untold[order]).all()


@pytest.mark.slow
@pytest.mark.parametrize("seed", [11, 12])
def test_the_period_of_an_arm_in_order_says_nothing_new(seed: int) -> None:
    log = recorded(draw_machine(seed, "fault"))
    np.testing.assert_allclose(noise(log)[0], noise(replace(log, period=None))[0], rtol=1e-9)
