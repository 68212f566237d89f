"""Which log shows measured over simulated, and whose errors."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.diagnosis import figures as simulated
from pipelines.model.simulation.comparison import Strayed


@dataclass(frozen=True)
class Evidence:
    simulated_t: Any = None
    simulated_position_error: Any = None
    simulated_log: str = ""
    extended_position_error: Any = None


@dataclass(frozen=True)
class Told:
    evidence: tuple[Evidence, ...]
    nominal: str | None = "nominal"
    extended: str | None = "extended"
    findings: tuple[str, ...] = ("one",)


def test_without_a_simulation_nothing_is_shown() -> None:
    """What an earlier simulation has shown is none of this model's then."""
    told: Any = Told((Evidence(np.zeros(1), np.ones((1, 3)), "old", np.ones((1, 3))), Evidence("kept")))
    assert simulated.with_simulation(told, None).evidence == (Evidence(), Evidence("kept"))
    nothing: Any = Told(())
    assert simulated.with_simulation(nothing, None) is nothing


def run(samples: int, error: float) -> Any:
    t = 1e-3 * np.arange(samples)
    return SimpleNamespace(first=Strayed("free-1", t, np.full((samples, 2), error)))


@pytest.mark.parametrize(("samples", "shown"), [(5000, 3.0), (1000, 1.0)])
def test_what_was_simulated_is_shown_as_far_as_it_is_long(samples: int, shown: float) -> None:
    """At most three seconds, of both arms the same."""
    found = simulated.as_simulated((run(samples, 2.0), run(samples, 1.0)))
    assert found is not None
    assert found.log == "free-1"
    assert found.t[0] == 0.0
    assert found.t[-1] == pytest.approx(shown, abs=0.01)
    assert [error.shape for error in found.errors] == [(len(found.t), 2)] * 2
    assert [float(error[0, 0]) for error in found.errors] == [2.0, 1.0]


@pytest.mark.parametrize("runs", [(), (run(1000, 1.0), SimpleNamespace(first=None))])
def test_arms_that_were_not_all_in_a_loop_are_not_shown(runs: Any) -> None:
    """Short windows have no error that grows with time."""
    assert simulated.as_simulated(runs) is None
