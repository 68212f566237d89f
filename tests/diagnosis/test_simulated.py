"""Which log shows measured over simulated, and whose errors."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.estimation.residual_analysis import with_simulation
from pipelines.simulation.comparison import Strayed


@dataclass(frozen=True)
class Evidence:
    simulated_t: Any = None
    simulated_position_error: Any = None
    simulated_log: str = ""
    extended_position_error: Any = None


def run(samples: int, error: float) -> Any:
    t = 1e-3 * np.arange(samples)
    return SimpleNamespace(first=Strayed("free-1", t, np.full((samples, 2), error)))


@pytest.mark.parametrize(("samples", "shown"), [(5000, 3.0), (1000, 1.0)])
def test_what_was_simulated_is_shown_as_far_as_it_is_long(samples: int, shown: float) -> None:
    """At most three seconds, of both arms the same."""
    first: Any = with_simulation(Evidence(), run(samples, 2.0), run(samples, 1.0))  # type: ignore[arg-type]
    assert first.simulated_log == "free-1"
    assert first.simulated_t[0] == 0.0
    assert first.simulated_t[-1] == pytest.approx(shown, abs=0.01)
    assert first.simulated_position_error.shape == (len(first.simulated_t), 2)
    assert (first.simulated_position_error[0, 0], first.extended_position_error[0, 0]) == (2.0, 1.0)


def test_arms_that_were_not_all_in_a_loop_are_not_shown() -> None:
    """Short windows have no error that grows with time."""
    one: Any = Evidence()
    assert with_simulation(one, run(1000, 1.0), SimpleNamespace(first=None)) is one  # type: ignore[arg-type]
