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


@pytest.mark.parametrize("scale", [2.0, 0.25, -1.0])
def test_a_position_in_another_scale_is_told_from_one_of_another_run(scale: float) -> None:
    """S15, not S16: an encoder counts twice as far as the reference asks, or backwards; the controller saw what it should."""
    log = good_log()
    counted = log.q.copy()
    counted[:, 1] *= scale
    said = [c for c in check_log(with_signal(log, q=counted, q_ref=log.q)) if c.level != "ok" and c.code[-3:] in ("S15", "S16")]
    assert [c.code for c in said] == ["RRID-S15"]
    assert f"position of joint 2 is {scale:.3g} times its reference" in said[0].message
    still = with_signal(log, q=np.where(np.arange(log.n_joints) == 1, log.q[0], log.q) + 1e-3 * counted, q_ref=log.q)
    assert any(c.code == "RRID-S16" for c in check_log(still) if c.level != "ok")  # a joint that stands still has no scale


def test_a_drive_at_its_limit_is_no_log_of_another_run() -> None:
    """S16: a joint whose torque is at its limit for half of the time does not follow; a fault of the arm, not of the log."""
    log = good_log()
    away = with_signal(log, q_ref=log.q[::-1])
    assert any(c.code == "RRID-S16" and c.level == "reject" for c in check_log(away))
    weak = with_signal(away, tau=np.clip(log.tau, -0.5 * np.abs(log.tau).max(axis=0), 0.5 * np.abs(log.tau).max(axis=0)))
    said = [c for c in check_log(weak) if c.code == "RRID-S16"]
    assert {c.level for c in said} == {"warn"}
    assert "cannot follow" in said[0].message
    wave = np.outer(np.sin(np.linspace(0.0, 60.0, len(log.t))), np.abs(log.tau).max(axis=0))
    assert any(c.code == "RRID-S16" and c.level == "reject" for c in check_log(with_signal(away, tau=wave)))  # a crest


@pytest.mark.filterwarnings("error")
def test_a_reference_of_another_run_is_one_without_any_torque_too() -> None:
    """S16 looks for a limit in what torque there is."""
    log = good_log()
    away = with_signal(log, q_ref=log.q[::-1], tau=np.full_like(log.tau, np.nan))
    assert any(c.code == "RRID-S16" and c.level == "reject" for c in check_log(away))


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


def test_two_references_that_are_alike_but_for_their_size_are_mixed_up_too() -> None:
    """Half of the motion at one joint and all of it at the other, swapped: no gear of two is to blame."""
    log = good_log()
    reference = log.q.copy()
    reference[:, 1] = 0.5 * reference[:, 2]
    position = reference[:, [0, 2, 1]] + 1e-4
    assert said_of(with_signal(log, q=position, q_ref=reference))[0].code == "RRID-S13"
    doubled = reference * [1.0, 2.0, 1.0] + [0.0, 1e-4, 0.0]  # where joint 3 should be, and is
    assert [c.code for c in said_of(with_signal(log, q=doubled, q_ref=reference))] == ["RRID-S15"]


@pytest.mark.row("S15")
@pytest.mark.parametrize("lag", [1.0, 0.97])
@pytest.mark.parametrize("scale", [np.pi / 180.0, 180.0 / np.pi])
def test_a_reference_in_the_other_unit_of_angle_is_no_other_gear(scale: float, lag: float) -> None:
    """A reference in degrees, and one that was divided by 57 though it was in rad already; trusting units does not hide it."""
    log = good_log()
    said = said_of(with_signal(log, q_ref=log.q / (lag * scale)))
    assert {c.code for c in said} == {"RRID-S15"}
    assert len(said) == log.n_joints
    large, small = ("q_ref", "q") if scale < 1.0 else ("q", "q_ref")
    assert all(c.message.endswith(f"{large} looks like degrees, declared in rad") and f'"deg" of {large}' in c.remedy and
               f"if {small} was converted to rad twice" in c.remedy for c in said)
