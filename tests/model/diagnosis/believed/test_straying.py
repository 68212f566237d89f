"""A cause with which the simulated arm strays is asked again: beside what was found after it, and as rows weighed alike have it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from pipelines.model.diagnosis.believed import straying
from tests.model.diagnosis.made_up import effect, left, searched

REST: Any = SimpleNamespace(model=SimpleNamespace(arm="rest"))
RUNS: Any = [SimpleNamespace(how="closed-loop")] * 3


def found_two(suffix: str = "") -> Any:
    found = searched(left(0.5, 0.5, 0.01), (effect("spring", 1), left(0.4, 0.5, 0.01)),
                     (effect("spring", 2), left(0.01, 0.01, 0.01)))
    for name, done in (("nominal", found.steps[0].before), ("first", found.steps[0].best.done), ("both", found.steps[1].best.done)):
        done.model.arm = name + suffix
    found.final.model.arm = "final"
    return found


@pytest.fixture(autouse=True)
def arms(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(straying, "acted", lambda arm, effects: arm)
    monkeypatch.setattr(straying, "simulation_errors", lambda arms, motions: arms)


def asked(found: Any, plain: Any, k: int) -> str:
    case: Any = SimpleNamespace(beside=())
    prepared: Any = SimpleNamespace(judging=(), motions=())
    return straying.strays(found, plain, k, RUNS, prepared, case, False, lambda: REST)


@pytest.mark.parametrize(("beside", "strays"), [("", False), ("farther", True)])
def test_beside_what_was_found_after_it(beside: str, strays: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both joints are late: with the first alone told so, the arm strays; the last was found beside all the others already."""
    found = found_two()
    monkeypatch.setattr(straying, "no_nearer", lambda before, after, late: beside if before == "rest" else "farther")
    assert bool(asked(found, found, 0)) is strays
    assert asked(found, found, 1) == "farther"


@pytest.mark.parametrize(("alike", "strays"), [("", False), ("farther", True)])
def test_as_rows_weighed_alike_have_it(alike: str, strays: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A nominal arm whose numbers are steady may come nearer by chance than one with the cause; the arms as found do not."""
    found, plain = found_two(), found_two(" alike")

    def farther(before: Any, after: Any, late: bool) -> str:
        return alike if (before, after) == ("first alike", "both alike") else "farther"

    monkeypatch.setattr(straying, "no_nearer", farther)
    assert bool(asked(found, plain, 1)) is strays
