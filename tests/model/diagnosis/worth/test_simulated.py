"""Which log shows measured over simulated, and whose errors."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.model.diagnosis.worth import simulated
from pipelines.model.diagnosis.worth.gains import Strayed


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


def logs_of(validate: str, identify: str) -> Any:
    return SimpleNamespace(**{role: [SimpleNamespace(name=name, t=np.arange(3.0) + 5.0) for name in names]
                              for role, names in (("validate", validate), ("identify", identify))})


@pytest.mark.parametrize(("in_loop", "away", "shown", "looked_at"), [
    ("abc", "", "a", "a"), ("bc", "b", "c", "abc"), ("abcd", "ab", "", "ab"), ("d", "", "d", "abcd"), ("", "", "", "abcd")])
def test_the_first_log_in_which_no_model_runs_away_is_shown(in_loop: str, away: str, shown: str, looked_at: str,
                                                            monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two that can be simulated, held-out ones first; no log behind these is looked at. That the extended model runs away is
    enough."""
    seen: list[str] = []

    def known(arm: str, log: Any) -> bool:
        seen.append(log.name)
        return log.name in in_loop

    def error(arm: str, log: Any) -> Any:
        return None if arm == "extended" and log.name in away else np.full((3, 1), float(len(arm)))

    monkeypatch.setattr(simulated, "in_loop", known)
    monkeypatch.setattr(simulated, "_error", error)
    monkeypatch.setattr(simulated, "shared_out", lambda work, arms: [work(arm) for arm in arms])
    told: Any = Told((Evidence(), Evidence()))
    found: Any = simulated.with_simulation(told, simulated.followed_by(simulated.arms_of(told), logs_of("ab", "cd")))
    first, second = found.evidence
    assert (first.simulated_log, "".join(seen), second) == (shown, looked_at, Evidence())
    if shown:
        assert first.simulated_t.tolist() == [0.0, 1.0, 2.0]
        assert (first.simulated_position_error[0], first.extended_position_error[0]) == (7.0, 8.0)


@pytest.mark.parametrize(("told", "arms"), [
    (Told(()), ("nominal", "extended")), (Told((), findings=()), ("nominal",)), (Told((), extended=None), ("nominal",)),
    (Told((), nominal=None, extended=None), ())])
def test_an_arm_is_extended_by_what_was_found(told: Any, arms: tuple[str, ...]) -> None:
    assert simulated.arms_of(told) == arms


def test_no_arm_is_asked_in_no_log() -> None:
    """What an earlier simulation has shown is none of this model's then."""
    assert simulated.followed_by((), logs_of("a", "")) is None
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
