"""A payload set in the controller shows in reference logs and good links, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.compensated_payload import described, session, subtracted
from pipelines.estimation.checks.boundary import Boundary, torque_boundary
from pipelines.report.sections import boundary_card
from tests.seeds import usually


def boundary(seed: int, loaded: bool) -> Boundary:
    log, reference, _ = session(seed, loaded)
    found = torque_boundary([log, reference])
    assert found is not None
    return found


@pytest.mark.parametrize("seed", usually((9001, 9002, 9003, 9020), 9003))
def test_reference_logs_tell_the_mass_that_is_subtracted(seed: int) -> None:
    payload, mass = subtracted(seed, loaded=True, reference=True)
    assert payload is not None
    assert (payload.present, payload.by) == (True, "reference logs")
    assert payload.mass is not None
    assert payload.std is not None
    assert abs(payload.mass - mass) < 3.0 * payload.std
    assert payload.std < 0.05 * mass


@pytest.mark.parametrize("seed", usually((9001, 9002, 9003, 9020), 9003))
def test_a_machine_whose_friction_changed_since_the_reference_has_no_payload(seed: int) -> None:
    payload, _ = subtracted(seed, loaded=False, reference=True)
    assert payload is not None
    assert payload.present is False


@pytest.mark.parametrize("seed", usually((9001, 9020, 9123), 9020))
def test_links_that_agree_with_the_logs_tell_the_mass_to_a_twentieth_of_the_last(seed: int) -> None:
    """Described exactly, or wrong by up to 5 %: the last link may be wrong by that too."""
    assert described(seed) in ("right", "near")
    payload, mass = subtracted(seed, loaded=True, reference=False)
    assert payload is not None
    assert (payload.present, payload.by) == (True, "described links")
    assert payload.mass is not None
    assert payload.std is not None
    assert abs(payload.mass - mass) < 2.0 * payload.std


@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("seed", usually((9000, 9002, 9007), 9000, 9002))
def test_links_described_wrong_or_not_at_all_tell_no_payload(seed: int, loaded: bool) -> None:
    """It is absorbed by their masses."""
    assert described(seed) in ("wrong", "none")
    log, _, _ = session(seed, loaded)
    found = torque_boundary([log])
    assert found is not None
    assert found.payload.present is None
    assert "links described within 5 %" in found.payload.reason
    assert "compensated payload" in [one.what for one in found.not_identifiable]


def test_the_card_gives_the_mass_and_what_else_it_may_be() -> None:
    found = boundary(9002, loaded=True)
    (card,) = boundary_card(found)
    row = next(row for row in card.tables[0].rows if row[0] == "compensated payload [kg]")
    assert found.payload.mass is not None
    assert row[1].startswith(f"{found.payload.mass:.2f}")
    assert "or it was taken off" in row[2]
    assert "compensated payload" not in [one.what for one in found.not_identifiable]
    (healthy,) = boundary_card(replace(found, payload=boundary(9002, loaded=False).payload))
    assert "holds all of the last link" in healthy.tables[0].rows[-1][2]
