"""What moved in the base parameters is asked beside the causes that were found: one cause is not told twice."""

from __future__ import annotations

import pytest

from pipelines.diagnosis.engine import Diagnosis, diagnose
from tests.diagnose.sessions import healthy_again, session


def since(cause: str, joint: int | None) -> Diagnosis:
    """The machine with a fault, after reference logs of the same machine without."""
    return diagnose((*healthy_again(session()), *session(cause, joint)))


@pytest.mark.slow
def test_a_payload_is_one() -> None:
    """Half a kilogram at the tip, within 3 %."""
    found = since("payload", None)
    assert [one.key[0] for one in found.decision.causes] == ["payload"]
    assert found.look.selection.end.model.effects[0].amplitudes[0] == pytest.approx(0.5, rel=0.03)
