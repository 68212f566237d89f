"""Hypotheses fitted by two processes are those that one fits, and stand on the rows of this one."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from dataclasses import replace
from multiprocessing.reduction import ForkingPickler
from typing import Any

import numpy as np
import pytest

from pipelines.log import shared_work
from pipelines.model.diagnosis.believed.steadied import steadied
from pipelines.model.diagnosis.fitted.refit import Refined, refine
from pipelines.model.diagnosis.searched.case import Case, HeldOut
from pipelines.model.diagnosis.searched.hypotheses import best_form, each_fitted, fitted
from pipelines.model.diagnosis.searched.search import glance, search
from tests.model.diagnosis.searched.test_search import waving

__all__ = ["waving"]

Answered = list[Any]


@pytest.fixture
def answered(monkeypatch: pytest.MonkeyPatch) -> Answered:
    """What another process has answered, in a program that may make one."""
    heard: Answered = []
    answer = shared_work._Other.answer

    def noted(self: Any) -> Any:
        heard.append(answer(self))
        return heard[-1]

    monkeypatch.setattr(shared_work, "processors", lambda: 2)
    monkeypatch.setattr("multiprocessing.parent_process", lambda: None)
    monkeypatch.setattr(shared_work._Other, "answer", noted)
    here, places = os.getpid(), shared_work._next

    def late(pipe: int) -> Iterator[int]:
        """The other one has begun when this one does."""
        time.sleep(0.5 if os.getpid() == here else 0.0)
        return places(pipe)

    monkeypatch.setattr(shared_work, "_next", late)
    return heard


def once(answered: Answered) -> bool:
    """Whether the other process was asked once, and has fitted something."""
    return len(answered) == 1 and len(answered[0][0]) > 0


def same(one: Refined, other: Refined) -> bool:
    """To the last bit: numbers, residual and slopes."""
    return (one.model.beta.tolist() == other.model.beta.tolist() and one.model.effects == other.model.effects
            and np.array_equal(one.left, other.left) and np.array_equal(one.slopes, other.slopes) and one.names == other.names)


def test_rivals(waving: Case, answered: Answered) -> None:
    """The three greatest causes."""
    seen = glance(waving)
    great = sorted((one for one in seen.screened if not one.family.event), key=lambda one: -one.gain[0])[:3]
    error = HeldOut.of(seen.before, waving)
    answered.clear()
    tried = each_fitted(waving, seen.before, great, error)
    assert once(answered)
    assert [one.screened for one in tried] == great
    for one, screened in zip(tried, great, strict=True):
        alone = fitted(waving, seen.before, screened, error)
        assert same(one.done, alone.done)
        assert (one.error, one.rank, one.visibility, one.possible) == (alone.error, alone.rank, alone.visibility, alone.possible)
        assert one.done.data is waving.data  # whose rows are laid already
        assert one.done.model.columns.body is seen.before.model.columns.body


def test_other_laws_of_a_cause(waving: Case, answered: Answered, monkeypatch: pytest.MonkeyPatch) -> None:
    """A wave of cogging is told by the law that alone would have been chosen."""
    seen = glance(waving)
    error = HeldOut.of(seen.before, waving)
    best = max((one for one in seen.screened if one.cause == "cogging"), key=lambda one: float(one.gain[0]))
    start = fitted(waving, seen.before, best, error)
    forms = (replace(start.effect, order=11.0), replace(start.effect, order=12.0))  # type: ignore[call-arg]
    monkeypatch.setattr(type(start.effect), "forms", lambda self: forms)
    answered.clear()
    chosen = best_form(waving, seen.before, start, error)
    assert once(answered)
    monkeypatch.setattr(shared_work, "processors", lambda: 1)
    alone = best_form(waving, seen.before, start, error)
    assert len(answered) == 1
    assert chosen.effect == alone.effect
    assert same(chosen.done, alone.done)


def test_models_refitted_with_the_ripple_among_the_noise(waving: Case, answered: Answered) -> None:
    """Each once, and the same object wherever it stands."""
    found = search(waving, 1)
    answered.clear()
    there, case = steadied(found, waving)
    assert once(answered)
    assert there.steps[0].best is not None
    assert found.steps[0].best is not None
    assert there.steps[-1].before is there.final
    assert there.steps[0].before is there.nominal
    alone = refine(found.steps[0].best.done.model, case.data, found.steps[0].best.done.weight)
    assert same(there.steps[0].best.done, alone)
    assert there.final.data is case.data


def test_what_is_sent_of_a_model_is_not_its_rows(waving: Case) -> None:
    """Its numbers, its residual and slopes."""
    done = refine(waving.model, waving.data, waving.weight)
    assert len(ForkingPickler.dumps(done.lean)) < 1.5 * (done.slopes.nbytes + done.left.nbytes)
    with pytest.raises(TypeError):  # rows hold what no other process can have
        ForkingPickler.dumps(done)
