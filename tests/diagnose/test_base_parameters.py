"""What moved in the base parameters is asked beside the causes that were found: one cause is not told twice."""

from __future__ import annotations

import pytest

from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.engine import Diagnosis, diagnose, pose
from pipelines.diagnosis.screening import best_of
from pipelines.estimation.preparation import Logs, prepare
from tests.diagnose.sessions import healthy_again, session


def since(cause: str, joint: int | None) -> Diagnosis:
    """The machine with a fault, after reference logs of the same machine without."""
    return diagnose((*healthy_again(session()), *session(cause, joint)))


@pytest.mark.slow
@pytest.mark.parametrize(("cause", "joint"), [("torque_gain", 2), ("link_length", None)])
def test_what_moves_base_parameters_as_well_is_no_payload(cause: str, joint: int | None) -> None:
    """A drive that pulls less looks there as if links had grown lighter; masses beyond a longer link sit elsewhere."""
    found = since(cause, joint)
    assert [one.key for one in found.decision.causes] == [(cause, joint)]


@pytest.mark.slow
def test_a_longer_link_is_screened_beside_the_masses_that_it_moves() -> None:
    """What screening says that it saves is what a fit saves, in which how heavy each link is stays free."""
    config, logs = DiagnosisConfig(), (*healthy_again(session()), *session("link_length"))
    later = pose(prepare(Logs.by_role(logs), config.recipe()), config)
    start = later.start()
    seen = best_of(later.screened(start))["link_length", None]
    effect = later.dictionary.families[seen.group.key].shapes[seen.group.shape]
    longer = start.model.with_effect(effect, seen.amplitudes)
    found = later.fit(longer, start.theta, later.freed(start.belief, effect))
    assert seen.gain == pytest.approx(start.cost - found.cost, rel=0.05)


@pytest.mark.slow
def test_a_payload_is_one() -> None:
    """Half a kilogram at the tip, within 3 %."""
    found = since("payload", None)
    assert [one.key[0] for one in found.decision.causes] == ["payload"]
    assert found.look.selection.end.model.effects[0].amplitudes[0] == pytest.approx(0.5, rel=0.03)
