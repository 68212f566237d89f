"""What stands in the reference logs: of two that explain it, the one that can be."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.model.diagnosis.reference import standing
from pipelines.model.diagnosis.reference.standing import standing_set

ROWS = 400
HUMP = np.sin(np.arange(ROWS) / 7.0)  # of what is left at the joint


class Law:
    """One amplitude, which has to be positive."""

    fixed_amplitudes, joint, needs = None, 1, ()

    def __init__(self, name: str) -> None:
        self.name = name

    def values(self, amplitudes: Any) -> Any:
        return {"amplitude": float(amplitudes[0])}

    def possible(self, values: Any) -> bool:
        return bool(values["amplitude"] > 0.0)


def chosen(monkeypatch: pytest.MonkeyPatch, **tables: Any) -> list[str]:
    """Of laws with these columns, in that order."""
    rng = np.random.default_rng(7)
    noise = 0.02 * rng.standard_normal(ROWS)
    laws = [Law(name) for name in tables]
    families = [SimpleNamespace(event=False, shapes=(law,)) for law in laws]
    found = [SimpleNamespace(family=family, shape=family.shapes, joint=1) for family in families]
    monkeypatch.setattr(standing, "screen", lambda *_: found)
    monkeypatch.setattr(standing, "lay_shape", lambda data, family, place, arm: tables[family.shapes[0].name][None])
    data = SimpleNamespace(rows=ROWS, n_joints=1, joint=np.zeros(ROWS, dtype=int), counts=np.ones(ROWS, dtype=bool),
                           blocks=lambda count: np.arange(ROWS) * count // ROWS)
    fit: Any = SimpleNamespace(data=data, residual=HUMP + noise, project=lambda x: x)
    return [one.effect.name for one in standing_set(data, fit, families, None)]  # type: ignore[arg-type, attr-defined]


def test_what_cannot_be_leaves_its_place_to_what_can(monkeypatch: pytest.MonkeyPatch) -> None:
    """Upside down one law explains a little more than another as it is: that is the one that stands."""
    like = HUMP + 0.1 * np.cos(np.arange(ROWS) / 5.0)
    assert chosen(monkeypatch, hump=like) == ["hump"]
    assert chosen(monkeypatch, bent=-HUMP, hump=like) == ["hump"]
    assert chosen(monkeypatch, bent=-HUMP) == []


def test_what_explains_most_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    like = HUMP + 0.3 * np.cos(np.arange(ROWS) / 5.0)
    assert chosen(monkeypatch, worse=like, best=HUMP) == ["best"]


def test_it_takes_no_more_of_its_joint_than_there_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """An effect of joint 1 that most of what joint 2 has left comes of as well: what it takes there is no share of joint 1."""
    both = np.concatenate([HUMP, 3.0 * HUMP])
    law, joint = Law("both"), np.repeat([0, 1], ROWS)
    found = SimpleNamespace(family=SimpleNamespace(event=False, shapes=(law,)), shape=(law,), joint=1)
    monkeypatch.setattr(standing, "screen", lambda *_: [found])
    monkeypatch.setattr(standing, "lay_shape", lambda *_: both[None])
    data = SimpleNamespace(rows=2 * ROWS, n_joints=2, joint=joint, counts=np.ones(2 * ROWS, dtype=bool),
                           blocks=lambda count: np.tile(np.arange(ROWS) * count // ROWS, 2))
    residual = both + np.where(joint == 0, 1.0, 0.1) * np.random.default_rng(7).standard_normal(2 * ROWS)
    fit: Any = SimpleNamespace(data=data, residual=residual, project=lambda x: x)
    (one,) = standing_set(data, fit, [found.family], None)  # type: ignore[arg-type, list-item]
    assert one.gain == pytest.approx(1.0 / 3.0, abs=0.05)  # the power of HUMP in that of HUMP and noise
