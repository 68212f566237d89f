"""Of two causes at a joint that could be mistaken for each other, the one that leaves less beside all others is believed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.believed import mended
from pipelines.model.diagnosis.believed.fewer import without
from pipelines.model.diagnosis.believed.mended import not_mending, turned
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.named.findings import _in_steps
from pipelines.model.diagnosis.named.verdict import Ruling, explained
from pipelines.model.diagnosis.screened.candidates import Family, families, whole_motion
from pipelines.model.diagnosis.searched import search as search_module
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.ledger import Tried
from pipelines.model.diagnosis.searched.search import Found, search
from pipelines.model.effects import find_effect
from pipelines.model.rigid.body import Motion
from tests.model.diagnosis.arms import hidden

SHARP = 100.0  # [s/rad] of the friction of these arms


def one_sided(motion: Motion, drag: float, difference: float) -> np.ndarray:
    """Joint 1: drag [N m s²/rad²] v|v|, and `difference` [N m] more friction forwards than backwards."""
    v = motion.dq[:, 0]
    out = np.zeros_like(motion.q)
    out[:, 0] = drag * v * np.abs(v) + 0.5 * difference * np.abs(np.tanh(SHARP * v))
    return out


def misled(difference: float, monkeypatch: pytest.MonkeyPatch) -> tuple[Found, Case]:
    """A search that begins with an offset, of an arm with a drag and that difference (or an offset instead of it, where zero)."""
    def load(motion: Motion) -> np.ndarray:
        return one_sided(motion, 0.3, difference) + (0.0 if difference else np.array([0.15, 0.0, 0.0]))

    prepared = prepare(Logs((hidden(1, load), hidden(2, load)), (hidden(3, load, "validate"),)), DiagnosisSettings())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit)
    every = tuple(one for one in families(columns.laws, whole_motion(prepared.data), model.arm)
                  if one.cause in ("torque_offset", "asymmetric_friction", "quadratic_drag") and one.joint == 1)
    usual, asked = search_module.fewest, []

    def offset_first(tried: Sequence[Tried]) -> Tried | None:
        asked.append(tried)
        offset = [one for one in tried if one.effect.name == "torque_offset"]
        return offset[0] if len(asked) <= 2 and offset else usual(tried)

    monkeypatch.setattr(search_module, "fewest", offset_first)
    case = Case(prepared.data, prepared.judge, model, fit.weight, every, None)
    return search(case, 3), case


def test_an_offset_gives_way_to_the_friction_that_it_stood_for(monkeypatch: pytest.MonkeyPatch) -> None:
    found, case = misled(0.3, monkeypatch)
    names = [step.best.effect.name for step in found.steps if step.best is not None]
    assert sorted(names) == ["asymmetric_friction", "quadratic_drag", "torque_offset"]
    every = [0, 1, 2]
    others = [k for k in every if names[k] != "asymmetric_friction"]
    kept = turned(found, others, every, case)
    assert [names[k] for k in kept] == [name for name in names if name != "torque_offset"]
    ruling, all_left = Ruling("cause", tuple(kept), ""), without(found, kept, case)
    models = _in_steps(replace(found, final=all_left), ruling.named, [found.steps[k] for k in kept])
    shares = [explained(before.rms, after.rms, found.nominal.rms, all_left.rms) for before, after in models]
    assert sum(shares) == pytest.approx(1.0, abs=0.01), "what they explain is told beside each other, and not beside the offset"


def test_an_offset_that_is_one_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    found, case = misled(0.0, monkeypatch)
    names = [step.best.effect.name for step in found.steps if step.best is not None]
    assert "torque_offset" in names
    every = list(range(len(names)))
    kept = turned(found, not_mending(found, every, case), every, case)
    assert "torque_offset" in [names[k] for k in kept]


@pytest.mark.parametrize(("cause", "mends"), [("rotor_inertia", False), ("load_friction", True)])
def test_what_has_no_shape_mends_none(cause: str, mends: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """An inertia found after a scale of torque, which would have passed for it, is one of its own; a friction is what the first law
    leaves, as it was before."""
    kind, before = find_effect(cause), find_effect("torque_gain")
    made = SimpleNamespace(effects=[SimpleNamespace(effect=one(joint=3)) for one in (before, kind)])
    step = SimpleNamespace(best=None, before=SimpleNamespace(rms=np.ones(3)))
    found: Any = SimpleNamespace(final=SimpleNamespace(model=made, rms=np.ones(3)), steps=[step, step], nominal=step.before)
    case: Any = SimpleNamespace(families=(Family(cause, 3, (kind(joint=3),)),), beside=())
    monkeypatch.setattr(mended, "imitated", lambda *_: 0.7)
    assert (not_mending(found, [0, 1], case) == [0]) is mends
