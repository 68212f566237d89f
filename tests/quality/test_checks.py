"""The checks of one log: silent on healthy logs, exact on planted faults."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.io.limits import sentinels
from pipelines.quality.checks import CHECKS, LogCheck, Subject, check_log
from pipelines.quality.segments import quantum, spikes, time_base
from tests.faulty import turning
from tests.healthy import (
    good_log,
    healthy_logs,
    make_log,
    one_joint,
    rows,
    stops,
    with_signal,
)
from tests.seeds import seeds


@pytest.mark.parametrize("check", CHECKS, ids=lambda c: c.__name__)
def test_no_check_complains_of_the_good_log(check: LogCheck) -> None:
    assert {found.level for found in check(Subject(good_log()))} <= {"ok"}


@pytest.mark.parametrize("seed", seeds(8, 2))
def test_healthy_logs_are_silent(seed: int) -> None:
    """Excitation, friction, hold, free and writing; 250 Hz to 2 kHz; no noise to ten times the usual; with rests."""
    for log in healthy_logs(range(seed, seed + 1)):
        assert [c for c in check_log(log) if c.level != "ok"] == []


def test_every_check_says_what_it_measured() -> None:
    codes = {c.code.removeprefix("RRID-") for c in check_log(good_log())}
    assert codes == {"T07", "S08", "T01", "T02", "T03", "T04", "T05", "T09", "D01", "D03", "D04", "D05", "D06", "D07",
                     "D08", "S05", "S07", "D12",
                     "S16", "D11", "D10"}


def test_a_planned_log_has_no_sensors_to_judge() -> None:
    log = good_log()
    plan = replace(log, origin="planned", signals={k: log.signals[k] for k in ("t", "q_ref")})
    assert check_log(plan) == ()


@pytest.mark.parametrize("share", [0.01, 0.03, 0.2])
def test_jitter_is_measured(share: float) -> None:
    """Stamps wander by ±`share` of a sample: the intervals then vary by share √(2/3) rms, within 5 %."""
    log = good_log()
    wander = np.random.default_rng(3).uniform(-share, share, log.n_samples) * log.sample_time
    assert time_base(with_signal(log, t=log.t + wander)).jitter == pytest.approx(share * np.sqrt(2 / 3), rel=0.05)


def test_dropped_samples_and_gaps_are_counted() -> None:
    """17 single samples, one run of 4, one hole of 250: 21 dropped, one gap of 251 sample times."""
    keep = np.ones(6000, dtype=bool)
    keep[100:2000:115] = False
    keep[3000:3004] = False
    keep[4000:4250] = False
    time = time_base(rows(good_log(), keep))
    assert time.dropped_samples == 21
    assert time.gaps.size == 1
    assert time.gap_lengths[0] == pytest.approx(0.251, abs=1e-9)


@pytest.mark.parametrize("step", [1e-5, 7.669903939428206e-4, 2 * np.pi / 8192])
def test_the_encoder_step_is_measured(step: float) -> None:
    q = step * np.rint(good_log().q[:, 0] / step)
    assert quantum(q) == pytest.approx(step, rel=1e-6)


def test_no_glitch_is_invented_and_none_overlooked() -> None:
    """White noise of a million samples has none; of 40 planted ones of 15 σ, one or two samples wide, all are found."""
    rng = np.random.default_rng(4)
    noise = rng.standard_normal((1_000_000, 1))
    assert not spikes(noise, False, np.array([1e-9])).any()
    at = np.arange(1000, 41_000, 1000)
    noise[at] = 15.0
    noise[at[::2] + 1] = 15.0
    found = spikes(noise[:50_000], False, np.array([1e-9]))[:, 0]
    assert found[at].all()
    assert found.sum() == 40 + 20


def test_a_torque_step_is_not_a_glitch() -> None:
    """An open-loop torque goes up in stairs."""
    stairs = np.repeat(np.arange(20.0), 200)[:, None] + 0.01 * np.random.default_rng(0).standard_normal((4000, 1))
    assert not spikes(stairs, False, np.array([1e-9])).any()


def test_a_position_of_minus_999_is_a_filler_only_where_no_joint_can_be() -> None:
    q = good_log().q.copy()
    assert not sentinels(q).any()
    q[5] = -999.0
    assert sentinels(q)[5].all()
    assert not sentinels(np.linspace(-1200, -800, 401)[:, None]).any()  # degrees on their way past -999


def test_a_rest_at_full_torque_is_not_saturation() -> None:
    """Held stretched out, the torque of an arm stays at its largest value without any limit at work."""
    log = make_log(stops(np.random.default_rng(2)), "free", noise=0.0)
    assert [c for c in check_log(log) if c.code == "RRID-D05" and c.level != "ok"] == []


@pytest.mark.row("D04")
def test_locked_joints_may_stand_still() -> None:
    """A friction log of joint 2 has constant positions and torques elsewhere, and a hold log everywhere."""
    log = make_log(one_joint(turning(0.0, 1), 2), "friction", joint=2, noise=0.0)
    assert [c for c in check_log(log) if c.level != "ok"] == []


def test_a_joint_that_spins_for_ever_is_not_in_degrees() -> None:
    """40 rad of travel at a speed within its limit are 40 rad."""
    log = make_log(turning(4.0, 0), "free", duration=10.0)
    assert float(np.ptp(log.q[:, 0])) > 4 * np.pi
    assert not any(c.code == "RRID-S07" and c.level != "ok" for c in check_log(log))
