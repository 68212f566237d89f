"""The bars of frequency responses on the virtual test bench."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.frequency.findings import frf_findings
from pipelines.frequency.modes import fitted_modes
from pipelines.frequency.responses import measured_responses
from tests.frf.cases import accuracy_case, recorded, sealed_case, truth_of


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 3])
def test_modes_of_a_soft_machine(number: int) -> None:
    """Base and joint give way together, two postures of 60 s: every mode within 1 %, its damping within 15 %."""
    case = accuracy_case(number)
    for log in recorded(case):
        (measured,) = measured_responses([log])
        modes = fitted_modes(measured)
        for kind, values in zip(("resonance", "antiresonance"), truth_of(case, log)[0].modes(), strict=True):
            found = [m for m in modes.modes if m.kind == kind]
            assert len(found) == len(values) == 2
            for mode, (frequency, damping) in zip(found, values, strict=True):
                assert mode.frequency.value == pytest.approx(frequency, rel=0.01)
                assert mode.damping.value == pytest.approx(damping, rel=0.15)


@pytest.mark.slow
def test_what_gives_way_is_named() -> None:
    """Twelve cases of base, joint, delay or nothing: eleven right at least, none wrongly named."""
    right = []
    for number in range(12):
        case = sealed_case(number)
        found = frf_findings(list(recorded(case)))
        said = {(one.kind, one.joint) for one in found.classification}
        wanted = {(case.kind, None if case.kind == "base" else case.joint)}
        assert said == wanted or found.undecided, f"{case.name}: {wanted} taken for {said}"
        right.append(said == wanted and not found.undecided)
    assert np.sum(right) >= 11
