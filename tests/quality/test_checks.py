"""The checks of one log: silent on healthy logs, exact on planted faults."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.io.files import Opened
from pipelines.io.limits import percent, sentinels
from pipelines.quality.checks import CHECKS, LogCheck, NotTested, Subject, check_log, check_together
from pipelines.quality.motion import limits, peak_speed
from pipelines.quality.segments import quantum, spikes, time_base, torque_limit
from tests.faulty import healthy_without_reference, turning
from tests.healthy import (
    changed,
    fourier,
    good_log,
    healthy_logs,
    make_log,
    one_joint,
    rest,
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


def test_what_is_measured_has_a_unit() -> None:
    """Torque, encoder steps, speed, acceleration and travel of every joint, those of a slide in its own."""
    said = {c.code: c.message for c in check_log(good_log())}
    assert re.search(r"at most [0-9.]+, [0-9.]+, [0-9.]+ N m$", said["RRID-D05"])
    assert re.search(r"speed at most .*[0-9] rad/s, acceleration .*[0-9] rad/s²$", said["RRID-D12"])
    assert said["RRID-D08"].endswith(" rad")
    assert " rad of travel" in said["RRID-S07"]
    log = good_log()
    first, *others = log.robot.joints
    joints = (replace(first, type="prismatic"), *others)
    slides: Any = SimpleNamespace(robot=replace(log.robot, joints=joints), n_joints=3)
    assert Subject(slides).with_units("ddq_ref", (1.0, None, 2.5)) == "1 m/s², not visible, 2.5 rad/s²"


def test_a_planned_log_has_no_sensors_to_judge() -> None:
    log = good_log()
    plan = replace(log, origin="planned", signals={k: log.signals[k] for k in ("t", "q_ref")})
    assert check_log(plan) == ()


def test_rounding_is_no_figure() -> None:
    """An even clock varies by what numbers of 64 bit leave of it; 1.2e-10 % is nothing that was measured."""
    messages = {c.code: c.message for c in check_log(good_log())}
    assert messages["RRID-T05"] == "the interval varies: rms below 0.001 %, at most below 0.001 % of the sample time"
    assert not [words for words in messages.values() if re.search(r"e-\d+ %", words)]


@pytest.mark.parametrize(("share", "said"), [(0.994, "99 %"), (0.996, "100 %"), (1.0, "100 %"), (0.051, "5.1 %"),
                                              (4.56, "456 %"), (0.00012, "0.012 %")])
def test_a_share_has_no_power_of_ten(share: float, said: str) -> None:
    assert percent(share, 2) == said


def test_commands_beyond_a_limit_are_not_said_to_lie_at_it() -> None:
    """D05: a drive cuts what its controller commands beyond the limit; how far it went is said."""
    log = good_log()
    tau = np.where(np.abs(log.tau) > 0.9 * np.abs(log.tau).max(axis=0), 1.5 * np.sign(log.tau) * torque_limit(log), log.tau)
    told = [c.message for c in check_log(with_signal(log, tau=tau)) if c.code == "RRID-D05"]
    assert any("at or beyond the described limit of 30, up to 45 N m" in words for words in told), told


def test_a_limit_that_is_passed_for_moments_is_no_wrong_unit() -> None:
    """S05: a controller that winds up commands much, for a moment; a tenth of the samples far beyond is another unit."""
    log = good_log()
    for share, expected in ((0.05, "ok"), (0.2, "reject")):
        many = np.where(np.arange(log.n_samples)[:, None] < share * log.n_samples, 20.0 * torque_limit(log), log.tau)
        levels = {c.code: c.level for c in check_log(with_signal(log, tau=many))}
        assert levels["RRID-S05"] == expected


@pytest.mark.parametrize(("joints", "winds_up"), [(slice(0, 1), True), (slice(None), False)])
def test_one_joint_beyond_its_limit_may_have_a_controller_that_winds_up(joints: slice, winds_up: bool) -> None:
    """S05: in N mm the torque of every joint is too large; of one joint alone it is said what else it may be."""
    log = good_log()
    tau = np.clip(log.tau, *(sign * 0.5 * torque_limit(log) for sign in (-1.0, 1.0)))
    tau[:, joints] *= 1000.0
    told = next(c for c in check_log(with_signal(log, tau=tau)) if c.code == "RRID-S05")
    assert told.level == "reject"
    assert ("N mm (1000 times too large)" in told.message, "winds up" in told.message) == (True, winds_up)


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


def test_values_without_a_step_have_none() -> None:
    assert quantum(np.random.default_rng(0).standard_normal(5000)) is None


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


def test_a_hard_stop_is_not_a_glitch() -> None:
    """Position runs into a stop: the speed breaks off from one sample to the next."""
    q = np.minimum(np.arange(2000) * 1e-3, 1.2345)[:, None]
    assert not spikes(q, True, np.array([1e-9])).any()


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


def opened(log: object, name: str, sha: str) -> Opened:
    return Opened(Path("folder") / name, sha, log, ())  # type: ignore[arg-type]


def test_a_log_that_fits_and_judges_is_a_leak() -> None:
    """D14, whatever the container: the same samples as identify and as validate."""
    one, other = good_log(), replace(good_log(), role="validate", name="other")
    found = check_together([opened(one, "a.h5", "1"), opened(other, "b.parquet", "2")], [Subject(one), Subject(other)])
    assert [(c.code, c.level) for c in found] == [("RRID-D14", "reject")]
    assert "leak" in found[0].message


def test_a_copy_is_named() -> None:
    one = good_log()
    found = check_together([opened(one, "a.h5", "1"), opened(one, "b.h5", "1")], [Subject(one)] * 2)
    assert [(c.code, c.level) for c in found] == [("RRID-D14", "warn")]
    assert "a.h5, b.h5" in found[0].message


def test_two_logs_of_one_name_in_one_folder() -> None:
    one, other = good_log(0), replace(good_log(1), name=good_log(0).name)
    found = check_together([opened(one, "a.h5", "1"), opened(other, "b.h5", "2")], [Subject(one), Subject(other)])
    assert [c.code for c in found] == ["RRID-S21"]


def test_friction_logs_are_judged_together() -> None:
    """D10: forth in one log and back in another is both ways; forth alone is not."""
    forth, back = (make_log(one_joint(turning(speed, 1), 2), "friction", joint=2, seed=k) for k, speed in enumerate((5.0, -5.0)))
    assert check_together([], [Subject(forth), Subject(back)]) == ()
    (found,) = check_together([], [Subject(forth)])
    assert (found.code, found.gate) == ("RRID-D10", True)
    assert "joint 2" in found.message


def test_texts_of_a_hostile_log_are_made_printable() -> None:
    log = replace(changed(good_log(), "q", (5, 0), np.nan), name="\x1b[31mred\x07")
    assert all("\x1b" not in c.where and "\x07" not in c.where for c in check_log(log))


def test_consequences_are_not_repeated() -> None:
    """Degrees exceed every limit and miss the reference; one sentence says why."""
    log = healthy_without_reference(good_log())
    found = [c.code for c in check_log(with_signal(log, q=np.rad2deg(log.q))) if c.level != "ok"]
    assert found == ["RRID-S07"] * 3


@pytest.mark.parametrize(("samples", "sample_time"), [(60, 1e-3), (150, 1e-3), (1200, 1e-6)])
def test_a_short_or_fast_log_has_a_speed(samples: int, sample_time: float) -> None:
    """D12: the peak of a sine of two periods is found within 10 %, however short and fast; zero would pass every limit."""
    log = rows(good_log(), slice(0, samples))
    t = sample_time * np.arange(samples)
    omega = 4.0 * np.pi / t[-1]
    fast = replace(with_signal(healthy_without_reference(log), t=t, q=np.outer(np.sin(omega * t), [1.0, 0.5, 0.2])),
                   sample_time=sample_time)
    np.testing.assert_allclose(peak_speed(Subject(fast)), omega * np.array([1.0, 0.5, 0.2]), rtol=0.1)
    found = [c for c in check_log(fast) if c.code == "RRID-D12"]
    assert any(c.gate and "speed reaches" in c.message for c in found)


def test_a_speed_that_cannot_be_taken_is_not_within_the_limits() -> None:
    """D12: of 60 samples with a hole in them no speed is taken; that is said, and counted as not tested."""
    log = rows(healthy_without_reference(good_log()), np.r_[0:30, 80:110])
    (found,) = [c for c in limits(Subject(log)) if c.code == "RRID-D12"]
    assert isinstance(found, NotTested)


def test_a_held_joint_that_trembles_by_some_encoder_steps_is_sampled_well_enough() -> None:
    """At 250 Hz by four steps, too few of them to show the encoder's step: the description gives it."""
    log = make_log(rest, "hold", duration=2.0)
    trembling = log.q.copy()
    trembling[:, 0] = log.q[0, 0] + 1e-5 * np.rint(4.0 * np.sin(0.5 * np.pi * np.arange(log.n_samples) + 0.4))
    assert [c for c in check_log(with_signal(log, q=trembling)) if c.code == "RRID-T09" and c.level != "ok"] == []


@pytest.mark.parametrize(("slower", "experiment", "joint", "said"), [
    (1000.0, "excitation", None, True), (1000.0, "friction", 2, True), (100.0, "excitation", None, False),
    (10.0, "excitation", None, False), (1000.0, "hold", None, False), (1e5, "excitation", None, False)])
def test_an_arm_that_creeps_is_asked_for_the_unit_of_time(slower: float, experiment: str, joint: int | None, said: bool) -> None:
    """S08 where every joint is slower than 0.02 rad/s at less than 10 Hz, and thousandths of a second make it an arm's motion."""
    path = fourier(np.random.default_rng(1))
    log = make_log(path if joint is None else one_joint(path, joint - 1), experiment, joint=joint)
    slow = replace(with_signal(log, t=slower * log.t), sample_time=slower * log.sample_time)
    assert any("with steps in ms" in c.message for c in check_log(slow) if c.code == "RRID-S08") == said
