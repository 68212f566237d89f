"""What responses have named is judged beside all that was found: where it is too slight to tell, nothing else moves for it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.model.diagnosis.result import BeforeAfter, Gain, TorqueGain
from pipelines.model.diagnosis.searched import beside
from pipelines.model.diagnosis.searched.beside import Part, judged

TORQUE = TorqueGain(np.ones(3), np.ones(3), np.zeros((3, 2)))


def part(after: float | None, final: str, doubt: str = "") -> Any:
    """Positions were 1e-5 rad off before."""
    told = None if after is None else BeforeAfter(np.full(3, 1e-5), np.array([1e-5, 1e-5, after]))
    gain = Gain(TORQUE, told, "none" if told is None else "closed-loop", None)
    return Part("base", "before", final, gain, doubt)  # type: ignore[arg-type]


def asked(monkeypatch: pytest.MonkeyPatch, refitted: Any, alike: Any, count: int = 1) -> beside.Judged:
    held: Any = SimpleNamespace(case=SimpleNamespace(beside=("base",)), prepared=SimpleNamespace(judge=None),
                                acting=("base",) * count)
    monkeypatch.setattr(beside, "_part", lambda acting, held, final, alike=False, two=(refitted, alike): two[alike])
    return judged(held, "refitted")  # type: ignore[arg-type]


@pytest.mark.parametrize(("refitted", "alike", "kept"), [
    (part(0.9e-5, "refitted"), part(0.8e-5, "alike"), "refitted"),  # nearer already
    (part(None, "refitted"), part(0.8e-5, "alike"), "refitted"),  # nothing can be simulated
    (part(1.01e-5, "refitted"), part(0.99e-5, "alike"), "alike"),
    (part(1.01e-5, "refitted"), part(1.02e-5, "alike"), "refitted"),  # nor does it come nearer then
    (part(1.01e-5, "refitted"), part(0.99e-5, "alike", "a log gets worse"), "refitted")])
def test_all_else_stays_where_only_that_comes_nearer(refitted: Any, alike: Any, kept: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found = asked(monkeypatch, refitted, alike)
    assert found.final == kept
    assert [one.after for one in found.parts] == [kept]


def test_of_several_each_is_judged_beside_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    assert asked(monkeypatch, part(1.01e-5, "refitted"), part(0.99e-5, "alike"), 2).final == "refitted"
