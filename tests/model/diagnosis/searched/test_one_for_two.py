"""Two causes that are one: what was found is dropped again for one in its place, where that one could have been accepted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pipelines.log.experiment import ExperimentLog
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.screened.candidates import families, whole_motion
from pipelines.model.diagnosis.searched import search as search_module
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.ledger import Tried
from pipelines.model.diagnosis.searched.search import Step, search
from pipelines.model.rigid.body import Motion
from tests.model.diagnosis.arms import hidden


@pytest.mark.slow
def test_two_scales_of_torque_that_are_one_are_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """The drive of joint 3 gives a tenth less than its log tells, and a great wave at joint 1 hides what that does there. If the
    search begins with the scale of joint 2, it needs that of joint 1 beside it; of scales only the ratios show."""
    def rippling(motion: Motion) -> np.ndarray:
        out = np.zeros_like(motion.q)
        out[:, 0] = 5.0 * np.sin(11.0 * motion.q[:, 0])
        return out

    def short(seed: int, role: str = "identify") -> ExperimentLog:
        log = hidden(seed, rippling, role)
        return replace(log, signals={**log.signals, "tau": replace(log.signals["tau"], values=log.tau / [1.0, 1.0, 0.9])})

    prepared = prepare(Logs((short(1), short(2)), (short(3, "validate"),)), DiagnosisSettings())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit)
    every = tuple(one for one in families(columns.laws, whole_motion(prepared.data), model.arm)
                  if one.cause == "torque_gain" or (one.cause, one.joint) == ("cogging", 1))
    usual, asked = search_module.fewest, []

    def misled(tried: Sequence[Tried]) -> Tried | None:
        asked.append(tried)
        second = [one for one in tried if (one.effect.name, one.effect.joint) == ("torque_gain", 2)]
        return second[0] if len(asked) <= 2 and second else usual(tried)

    monkeypatch.setattr(search_module, "fewest", misled)
    found = search(Case(prepared.data, prepared.judge, model, fit.weight, every, None), 4)
    there = [one.effect for one in found.final.model.effects]
    assert [(one.name, one.joint) for one in there] == [("torque_gain", 3), ("cogging", 1)]
    assert found.final.model.effects[0].values["gain_error"] == pytest.approx(-0.1, rel=0.05)


@pytest.mark.parametrize(("possible", "error", "gives_way", "taken"), [
    (True, 0.5, False, True), (False, 0.5, False, False), (True, 1.1, False, False), (True, 0.5, True, False)])
@pytest.mark.parametrize("before", [2.0, 1.05])
def test_one_for_two_is_what_could_have_been_accepted(possible: bool, error: float, gives_way: bool, taken: bool, before: float,
                                                      monkeypatch: pytest.MonkeyPatch) -> None:
    """A drag that drives its joint, what held-out time speaks against, and what gives way to something that gives way, are none;
    nor is what misses a fifth of what the second of the two took."""
    def tried(joint: int, **more: Any) -> Any:
        return SimpleNamespace(effect=SimpleNamespace(name="quadratic_drag", joint=joint), log=None,
                               done=SimpleNamespace(model=SimpleNamespace(effects=()), rss=1.0), **more)

    rival, plain = tried(3, possible=possible, error=error), Exact(cast("Any", None), np.zeros(1), ())
    steps: Any = (SimpleNamespace(best=tried(2), rivals=(rival,)),
                  SimpleNamespace(best=tried(1), before=SimpleNamespace(model=plain, weight=None, rss=before)))
    monkeypatch.setattr(search_module, "held_out", lambda *args: 1.0)
    monkeypatch.setattr(search_module, "refine", lambda *args: SimpleNamespace(rss=1.01))
    monkeypatch.setattr(search_module, "first_order_missed", lambda *args: 0.0)
    monkeypatch.setattr(search_module, "_step", lambda *args: SimpleNamespace(best=None if gives_way else args[-1]))
    found = search_module._one_for_two(cast("Case", SimpleNamespace(data=None)), steps, cast("Any", ((None, None),)))
    assert (found is not None and found[2] is rival) is (taken and before == 2.0)


@pytest.mark.slow
def test_a_search_that_takes_one_for_two_comes_to_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two drives are off, and each is taken for both of them: neither rests until the other is there."""
    def scaled(seed: int, role: str = "identify") -> ExperimentLog:
        log = hidden(seed, role=role)
        return replace(log, signals={**log.signals, "tau": replace(log.signals["tau"], values=log.tau / [1.0, 1.2, 0.85])})

    prepared = prepare(Logs((scaled(1),), (scaled(3, "validate"),)), DiagnosisSettings())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit)
    every = tuple(one for one in families(columns.laws, whole_motion(prepared.data), model.arm) if one.cause == "torque_gain")
    step, taken = search_module._step, []

    def counted(*args: Any) -> Step:
        taken.append(args[3])
        assert len(taken) < 20
        return step(*args)

    for tolerance in ("PARSIMONY", "_MISSED", "_NEAR"):
        monkeypatch.setattr(search_module, tolerance, 1e6)
    monkeypatch.setattr(search_module, "_step", counted)
    found = search(Case(prepared.data, prepared.judge, model, fit.weight, every, None), 4)
    assert taken.count(1) == 2  # one was taken for two
    assert "takes more numbers, or a second of its kind" in {trial.reason for trial in found.steps[0].trials}
    assert [one.effect.name for one in found.final.model.effects] == ["torque_gain", "torque_gain"]
