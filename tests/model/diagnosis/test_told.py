"""The sentence for a technician: what is wrong, where, and how much, in the unit of the joint."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from pipelines.model.diagnosis.told import sentence
from pipelines.model.diagnosis.verdict import Ruling


@pytest.mark.parametrize(("joint", "words"), [
    (1, "Cogging at joint 1: 0.25 N m of torque that the model does not have."),
    (2, "Cogging at joint 2: 0.25 N of force that the model does not have."),
    (None, "Cogging: 0.25 N m of torque or N of force that the model does not have.")])
def test_what_a_slide_lacks_is_a_force(joint: int | None, words: str) -> None:
    finding: Any = SimpleNamespace(title="Cogging", joint=joint, torque_rms=0.25)
    assert sentence(Ruling("cause", (0,), ""), (finding,), (True, False)) == words
