"""Which arms are simulated for what each cause is worth, on made-up steps: always those that are told of."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest

from pipelines.model.diagnosis.named import chain


def left(name: str) -> Any:
    return SimpleNamespace(model=SimpleNamespace(arm=name))


@pytest.fixture
def simulated_anew(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The arms that are simulated again; a gain is told by the simulations before and after."""
    asked: list[str] = []

    def simulate(arms: list[str], motions: object, known: dict[int, str] | None = None) -> list[str]:
        left = [k for k in range(len(arms)) if k not in (known or {})]
        asked.extend(arms[k] for k in left)
        return [f"simulated {arm}" if k in left else (known or {})[k] for k, arm in enumerate(arms)]

    monkeypatch.setattr(chain, "simulation_errors", simulate)
    monkeypatch.setattr(chain, "acted", lambda arm, beside: arm)
    monkeypatch.setattr(chain, "torque_gain", lambda before, after, judge, blocks: None)
    monkeypatch.setattr(chain, "gain_of", lambda torque, before, after: (before, after))
    monkeypatch.setattr(chain, "with_some", lambda found, places: left(f"with {places}"))
    return asked


@pytest.mark.parametrize(("named", "order", "chained"), [
    ((0, 1), (0, 1), ["then nominal", "then 1", "then 2"]),  # as they were found
    ((0,), (0,), ["simulated nominal", "simulated final"]),  # the last was dropped, and the weights are still its
    ((1,), (0,), ["simulated nominal", "simulated final"]),  # the first
    ((0, 1), (1, 0), ["then nominal", "simulated with [1]", "then 2"]),  # told in another order: only what lies between is another
    ((0, 1), ((0, 1),), ["then nominal", "then 2"])])  # two waves of one gear
def test_a_gain_is_that_of_the_arm_that_is_told(named: tuple[int, ...], order: tuple[Any, ...], chained: list[str],
                                               simulated_anew: list[str]) -> None:
    """What was simulated after each step of the search serves only where the final model is the search's own."""
    steps = [SimpleNamespace(before=left(name)) for name in ("nominal", "after 1", "after 2")]
    found: Any = SimpleNamespace(nominal=left("nominal"), steps=steps, final=left("final"))
    runs: Any = ["then nominal", "then 1", "then 2"]
    prepared: Any = SimpleNamespace(judging=(), motions=(), judge=None)
    told = chain.worth(found, named, [[k] if isinstance(k, int) else list(k) for k in order], runs, prepared, (), 10)
    assert [f"simulated {arm}" for arm in simulated_anew] == [one for one in chained if one.startswith("simulated")]
    assert [one.gain for one in told] == list(pairwise(chained))
