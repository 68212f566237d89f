"""The loop: step size, repeatability, signs, delay, quantisation, and what may not go unsaid."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.control import Decentralised, OpenLoop
from bench.draw import draw_machine, paper_machine
from bench.faults import make
from bench.faults.structure import BaseResonance
from bench.motions import at_rest
from bench.plant import run
from pipelines.errors import UsageError
from tests.bench.machines import frictionless, sway, turntable
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
