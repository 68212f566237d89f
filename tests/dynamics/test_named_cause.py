"""Causes as they are written on the command line."""

from __future__ import annotations

import pytest

from pipelines.dynamics.named_cause import acting_cause
from pipelines.errors import UsageError

REVOLUTE = (True, True, False)


def test_a_cause_with_its_numbers() -> None:
    """Joint, amplitudes and non-linear numbers; what is not given keeps its default."""
    found = acting_cause("coulomb:2:level=1.5", REVOLUTE)
    assert (found.effect.name, found.effect.joint) == ("coulomb", 2)
    assert found.values == {"level": 1.5, "sharpness": 100.0, "roundness": 1.0}
    found = acting_cause("coulomb:1:level=1, sharpness=50", REVOLUTE)
    assert found.values == {"level": 1.0, "sharpness": 50.0, "roundness": 1.0}
    assert {q.origin for q in found.parameters} == {"assumed"}


@pytest.mark.parametrize(("text", "code", "words"), [
    ("", "C01", "is not a cause"),
    ("coulom:2:level=1", "C01", "did you mean 'coulomb'"),
    ("coulomb", "C02", "takes a joint"),
    ("coulomb:4:level=1", "C02", "no joint of this arm"),
    ("coulomb:2", "C02", "how strong"),
    ("coulomb:2:lvel=1", "C01", "did you mean 'level'"),
    ("coulomb:2:level=nan", "C02", "not a number"),
    ("coulomb:2:level=-1", "C02", "out of range"),
    ("encoder_crosstalk:1:from_joint=9", "C02", "no other joint of this arm, which has 3"),
    ("transmission_coupling:2:inertia=0.1,with_joint=7", "C02", "no other joint of this arm, which has 3; it takes 1 or 3"),
    ("presliding:1:distance=0.03", "C02", "does not say how strong it is"),
    ("contact:force=25", "C02", "force follows from other numbers"),
    ("encoder_eccentricity:3:amplitude=0.001", "C02", "joint 3 slides, and only one that turns"),
    ("link_length:error=0.01,link=9", "C02", "no link with a joint beyond it on this arm, which has 3; it takes 1 or 2"),
])
def test_anything_else_is_refused(text: str, code: str, words: str) -> None:
    """With a code, and a hint where a name is nearly right."""
    with pytest.raises(UsageError, match=words) as refused:
        acting_cause(text, REVOLUTE)
    assert refused.value.code == f"RRID-{code}"
    assert refused.value.remedy
