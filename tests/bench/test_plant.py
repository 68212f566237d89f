"""The loop: step size, repeatability, signs, delay, quantisation, and what may not go unsaid."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from bench.control import ComputedTorque, Decentralised, FeedForward, OpenLoop
from bench.draw import draw_machine, paper_machine
from bench.faults import make
from bench.faults.structure import BaseResonance
from bench.machine import Floats, Hooks, Run
from bench.motions import at_rest
from bench.plant import run
from pipelines.errors import UsageError
from tests.bench.link_model import LinkModel
from tests.bench.machines import CENTRE, Spy, frictionless, sway, turntable
from tests.seeds import rarely


@pytest.mark.parametrize("around", [*rarely("paper"), "fault"])
def test_the_inner_step_is_fine_enough(around: str) -> None:
    """Five times finer steps move a 1 s closed-loop run with steep friction by less than a
    hundredth of an encoder step.
    """
    machine = draw_machine(2, around, nuisances=False).ideal  # type: ignore[arg-type]
    coarse, fine = (
        run(machine, Decentralised(), sway(), inner_step=step) for step in (2.5e-4, 5e-5)
    )
    assert np.abs(coarse.q - fine.q).max() < 1e-7


def test_a_run_repeats_itself() -> None:
    """Same machine, faults and seed: the same samples, bit for bit, with any other run in between;
    another seed: other noise.
    """
    machine = draw_machine(3, "fault")
    faults = [make("time_delay", machine, 2), make("drive_lag", machine, 1)]
    first = run(machine, Decentralised(), sway(0.3), faults, seed=5)
    other = run(machine, Decentralised(), sway(0.3), faults, seed=6)
    again = run(machine, Decentralised(), sway(0.3), faults, seed=5)
    assert (first.q == again.q).all()
    assert (first.tau == again.tau).all()
    assert not (first.q == other.q).all()


def test_torque_acts_from_its_own_sample_on() -> None:
    """A turntable of inertia J: one sample of torque u at k gives speed u T/J at k + 1 and not
    before.
    """
    machine = turntable(0.8)
    torque = np.zeros((20, 1))
    torque[10] = 4.0
    recording = run(machine, OpenLoop(torque, (True,)), at_rest(np.zeros(1), 0.02))
    expected = np.where(np.arange(20) > 10, 4.0 * 1e-3 / 0.8, 0.0)
    np.testing.assert_allclose(recording.true_dq[:, 0], expected, atol=1e-12)


def test_delay_of_one_sample() -> None:
    """With delay 1 the first torque is zero and the law's answer to q[k] is logged, and acts, at k
    + 1.
    """
    prompt = frictionless(paper_machine()).ideal
    late = replace(prompt, delay=1)
    first, second = (run(machine, Decentralised(), sway(0.01)) for machine in (prompt, late))
    assert (second.tau[0] == 0.0).all()
    e, de = second.observed[0] - second.reference.q, second.observed[1] - second.reference.dq
    np.testing.assert_allclose(
        second.tau[1:], (-np.array(late.kp) * e - np.array(late.kd) * de)[:-1], atol=1e-9
    )
    assert np.abs(first.tau[1:5]).max() > 0.0


def test_readings_and_commands_are_rounded_as_the_log_says() -> None:
    """q is whole encoder steps, tau whole bits within the limit; feedback of eq. (23) gives tau to
    half a bit.
    """
    machine = draw_machine(6)
    recording = run(machine, Decentralised(), sway(0.5))
    bits = recording.tau / np.array(machine.torque_resolution)
    assert np.abs(bits - np.round(bits)).max() < 1e-9
    steps = recording.q / 1e-5
    assert np.abs(steps - np.round(steps)).max() < 1e-6
    e, de = (
        recording.observed[0] - recording.reference.q,
        recording.observed[1] - recording.reference.dq,
    )
    law = -np.array(machine.kp) * e - np.array(machine.kd) * de
    assert (np.abs(recording.tau - law) <= 0.5 * np.array(machine.torque_resolution) + 1e-9).all()


def test_perfect_feedforward_leaves_nothing_to_the_feedback() -> None:
    """Eq. (24) on the true model, without friction: errors are a hundredth of those of PD alone,
    and less than 0.1 mrad: what it costs to hold a torque for a sample.
    """
    machine = frictionless(draw_machine(7, nuisances=False).ideal)
    alone, ahead = (
        run(machine, law, sway(2.0, hz=0.5))
        for law in (Decentralised(), FeedForward(LinkModel(machine, error=0.0)))
    )
    settled = slice(500, None)
    worst = [np.abs(r.true_q - r.reference.q)[settled].max() for r in (alone, ahead)]
    assert worst[1] < min(0.01 * worst[0], 1e-4)


def test_computed_torque_makes_a_double_integrator() -> None:
    """Eq. (25)-(27) on the true model without friction: q̈ = r, so q̇ after the kick v T is v T on
    that joint alone.
    """
    machine = frictionless(draw_machine(8, nuisances=False).ideal)
    reference = at_rest(CENTRE, 0.1)
    v = np.zeros((100, 3))
    v[20:50, 0] = 8.0  # [rad/s^2]
    law = ComputedTorque(LinkModel(machine, error=0.0), v, (0.0,) * 3, (0.0,) * 3)
    recording = run(machine, law, reference)
    np.testing.assert_allclose(recording.true_dq[60], [8.0 * 0.03, 0.0, 0.0], atol=2e-3)
    np.testing.assert_array_equal(recording.extras["r"], v)


def test_backward_difference_takes_the_derivative_from_readings() -> None:
    """velocity "backward-difference": τ = -K_p e - K_d (e[k] - e[k-1])/T, from what was read."""
    machine = draw_machine(9, nuisances=False).ideal
    recording = run(machine, Decentralised(velocity="backward-difference"), sway(0.2))
    e = recording.q - recording.reference.q
    law = (
        -np.array(machine.kp) * e - np.array(machine.kd) * np.diff(e, axis=0, prepend=e[:1]) / 1e-3
    )
    np.testing.assert_allclose(recording.tau, law, atol=1e-9)


class Breaking(Spy):
    """Fails in MuJoCo's callback after a while."""

    def start(self, run: Run) -> Hooks:
        def load(t: float, q: Floats, v: Floats, force: Floats) -> None:
            if t > 0.01:
                raise ZeroDivisionError

        return Hooks(load=load)


def test_a_run_that_fails_leaves_nothing_behind() -> None:
    """Neither forces in MuJoCo nor anything that the next run could feel."""
    machine = paper_machine()
    before = run(machine, Decentralised(), sway(0.05), seed=5)
    with pytest.raises(ZeroDivisionError):
        run(machine, Decentralised(), sway(0.05), [Breaking()])
    assert mujoco.get_mjcb_passive() is None
    np.testing.assert_array_equal(run(machine, Decentralised(), sway(0.05), seed=5).q, before.q)


def test_what_cannot_be_integrated_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A spring far too stiff for the inner step: the same error, and MuJoCo writes no log of its
    own where we are.
    """
    monkeypatch.chdir(tmp_path)
    impossible = [BaseResonance(None, 400.0, 0.08, 8e4), BaseResonance(None, 28.0, 0.08, 8.0)]
    with pytest.raises(UsageError, match="RRID-C02 the loop runs away at"):
        run(
            turntable(), OpenLoop(np.ones((100, 1)), (True,)), at_rest(np.zeros(1), 0.1), impossible
        )
    assert not list(tmp_path.iterdir())


def test_a_loop_that_runs_away_says_so() -> None:
    """Gains of the wrong sign: an error with a code, not a log of infinities."""
    machine = replace(paper_machine(), kp=(-9e4, -9e4, -9e4), torque_limit=(1e6, 1e6, 1e6))
    with pytest.raises(UsageError, match="RRID-C02 the loop runs away at"):
        run(machine, Decentralised(), sway(2.0))
