"""Position against reference: of another run, of another joint, in another unit or scale; a soft controller is none of these."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.errors import Check
from pipelines.io.log import ExperimentLog
from pipelines.quality.checks import check_log
from tests.healthy import good_log, with_signal


def said_of(log: ExperimentLog) -> list[Check]:
    return [c for c in check_log(log) if c.level != "ok" and c.code[-3:] in ("S07", "S13", "S15", "S16")]


def test_a_sagging_controller_still_follows() -> None:
    """S16 must not take a soft controller, 20 % behind, for another run."""
    log = good_log()
    lazy = with_signal(log, q_ref=log.q + 0.2 * (log.q - log.q.mean(axis=0)))
    assert not any(c.code == "RRID-S16" and c.level != "ok" for c in check_log(lazy))


@pytest.mark.row("S13")
@pytest.mark.parametrize("name", ["q", "q_ref"])
def test_joints_that_follow_the_references_of_each_other_are_mixed_up(name: str) -> None:
    """Told of both, whichever of the two signals has its columns swapped; a third joint that is right is not spoken of."""
    log = good_log()
    whole = with_signal(log, q_ref=log.q + 0.05 * (log.q - log.q.mean(axis=0)))
    mixed = said_of(with_signal(whole, **{name: whole[name][:, [0, 2, 1]]}))
    assert {(c.code, c.level) for c in mixed} == {("RRID-S13", "reject")}
    assert "position of joint 2 follows the reference of joint 3" in mixed[0].message
    assert "position of joint 3 follows the reference of joint 2" in mixed[1].message
    assert len(mixed) == 2


@pytest.mark.row("S15")
@pytest.mark.parametrize("lag", [1.0, 0.97])
@pytest.mark.parametrize("scale", [np.pi / 180.0, 180.0 / np.pi])
def test_a_reference_in_the_other_unit_of_angle_is_no_other_gear(scale: float, lag: float) -> None:
    """A reference in degrees, and one that was divided by 57 though it was in rad already; trusting units does not hide it."""
    log = good_log()
    said = said_of(with_signal(log, q_ref=log.q / (lag * scale)))
    assert {c.code for c in said} == {"RRID-S15"}
    assert len(said) == log.n_joints
    large = "q_ref" if scale < 1.0 else "q"
    assert all(c.message.endswith(f"{large} looks like degrees, declared in rad") for c in said)
