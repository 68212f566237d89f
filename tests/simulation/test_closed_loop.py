"""Closed loops, judged by controllers written anew around Pinocchio."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pipelines.dynamics.arm import Arm
from pipelines.dynamics.body import Motion
from pipelines.io.log import Array, Controller
from pipelines.simulation import Noise, Plant, run
from pipelines.simulation.closed_loop import run_together
from tests.simulation.arms import GAIN, KD, KP, TS, experiment, rrr, rrr_friction, waving
from tests.simulation.pinocchio_loop import Loop, TransferObserver, backward_pd

SAMPLES = 200
MANY = 9  # robots that are simulated side by side, in arrays
NOISE = Noise(np.array([0.020, 0.010, 0.005]), np.zeros(3))
Law = Callable[[int, Array], Array]


def pinocchio_run(law: Law, samples: int = SAMPLES, steps: int = 8) -> tuple[Array, Array, Array]:
    q, dq, _ = waving(samples)
    return Loop(rrr().model, rrr_friction(), TS, steps).run(q[0], dq[0], law, samples)


def changed_pd(change: Callable[[int, Array, Array], Array] = lambda k, tau, e: tau) -> Law:
    """PD by the backward difference, changed by `change` of sample, torque and error."""
    q_ref = waving(SAMPLES)[0]
    law = backward_pd(q_ref, KP, KD)
    return lambda k, q: change(k, law(k, q), q - q_ref[k])


def plain(**changes: object) -> Controller:
    return Controller("pd", KP, KD, velocity="backward-difference", **changes)  # type: ignore[arg-type]


def agree(controller: Controller, law: Law, atol: float = 1e-8, **changes: Array) -> Array:
    """Ours, alone and as one of many, and Pinocchio's, with 8 steps a sample each: position within 1e-8 rad. Returns the torque."""
    q, dq, tau = pinocchio_run(law)
    for replicas in (1, MANY):
        found = run(Plant.of(rrr().arm), experiment(controller, SAMPLES, **changes), 8, seeds=range(replicas))
        assert np.abs(found.true_q[-1] - q).max() < atol
        assert np.abs(found.true_dq[-1] - dq).max() < 1e3 * atol
        assert np.abs(found.tau[-1] - tau).max() < 1e5 * atol
        np.testing.assert_array_equal(found.q, found.true_q)
    return tau


def test_decentralised_pd() -> None:
    """Eq. (23) with the backward difference."""
    agree(plain(), changed_pd())


def test_pd_on_the_observer() -> None:
    """Eq. (23) on the observer (20), which the judge computes by its transfer function."""
    q_ref = waving(SAMPLES)[0]
    observers = [TransferObserver(row, TS) for row in GAIN]

    def law(k: int, q: Array) -> Array:
        e, de = np.array([observe(float(y)) for observe, y in zip(observers, q - q_ref[k], strict=True)]).T
        return -KP * e - KD * de

    agree(Controller("pd", KP, KD, velocity="observer", observer_gain=GAIN), law)


def test_integral_action_and_excitation() -> None:
    """-Ki T Σe and the injected torque v."""
    ki, total = np.array([4000.0, 3000.0, 400.0]), np.zeros(3)
    v = np.random.default_rng(1).normal(size=(SAMPLES, 3)) * np.array([2.0, 1.0, 0.3])

    def change(k: int, tau: Array, e: Array) -> Array:
        total[:] = total + TS * e
        return tau - ki * total + v[k]

    agree(plain(ki=ki), changed_pd(change), v=v)


def test_one_sample_late() -> None:
    """With delay 1 a command acts one sample later; before the first one acts what the log says."""
    waiting = [np.array([1.0, 2.0, 0.5])]

    def change(k: int, tau: Array, e: Array) -> Array:
        waiting.append(tau)
        return waiting[-2]

    agree(plain(delay=1), changed_pd(change), tau0=waiting[0])


def test_limited_output() -> None:
    """The controller's own limit is in the loop and in the log."""
    limit = np.array([12.0, 9.0, 2.0])
    tau = agree(plain(output_limit=limit), changed_pd(lambda k, tau, e: np.clip(tau, -limit, limit)), atol=1e-7)
    assert (np.abs(tau).max(axis=0) == limit).all()


@pytest.mark.parametrize("parts", [
    ("friction", "inertia", "coriolis", "gravity"), *(pytest.param(parts, marks=pytest.mark.slow) for parts in (
        ("friction",), ("friction", "inertia"), ("gravity", "coriolis")))])
def test_feedforward(parts: tuple[str, ...]) -> None:
    """Eq. (24): the parts that the log names, of its own model (here 20 % too heavy), on the reference."""
    model = _wrong()
    q, dq, ddq = waving(SAMPLES)
    torque = model.torque_parts(Motion(TS * np.arange(SAMPLES), q, dq, ddq))
    ahead = sum(getattr(torque, part) for part in parts)
    agree(Controller("pd+feedforward", KP, KD, velocity="backward-difference", feedforward=parts),
          changed_pd(lambda k, tau, e: tau + ahead[k]), feedforward_arm=model)


def _wrong() -> Arm:
    arm = rrr().arm
    return replace(arm.with_body(arm.body, 1.2 * arm.p), friction=arm.friction)


def test_computed_torque() -> None:
    """Eq. (25)-(27) on a model that is 20 % too heavy."""
    model, q_ref, dq_ref = _wrong(), *waving(SAMPLES)[:2]
    v = np.random.default_rng(2).normal(size=(SAMPLES, 3)) * 20.0
    friction = model.friction_torque(Motion(TS * np.arange(SAMPLES), q_ref, dq_ref, 0 * q_ref))
    observers, last = [TransferObserver(row, TS) for row in GAIN], []

    def law(k: int, q: Array) -> Array:
        e = q - q_ref[k]
        de = (e - last[-1]) / TS if last else 0 * e
        last.append(e)
        r = -400.0 * e - 28.0 * de + v[k]
        seen, speed = np.array([observe(float(y)) for observe, y in zip(observers, e, strict=True)]).T
        state = (q_ref[k] + seen)[None], (dq_ref[k] + speed)[None]
        return model.body.torque(*state, r[None], model.p)[0] + friction[k]

    agree(Controller("computed-torque", np.full(3, 400.0), np.full(3, 28.0), velocity="backward-difference", observer_gain=GAIN),
          law, v=v, feedforward_arm=model)


def test_noise_is_each_replicas_own() -> None:
    """A seed gives the same run alone, among others and without arrays; another seed another one; its size is as asked."""
    plant, asked = Plant.of(rrr().arm), experiment(plain(), 400)
    seeds = range(4, 4 + MANY)
    many = run(plant, asked, 2, NOISE, seeds)
    for some in ((5,), (7, 5)):
        np.testing.assert_allclose(run(plant, asked, 2, NOISE, some).true_q[-1], many.true_q[1], atol=1e-12)
    assert np.abs(many.true_q[0] - many.true_q[1]).max() > 1e-7
    loud = run(plant, asked, 2, Noise(2 * NOISE.torque, NOISE.position), seeds)
    calm = run(plant, asked, 2)
    spread = [np.sqrt(np.mean((x.true_q - calm.true_q) ** 2)) for x in (many, loud)]
    assert spread[1] / spread[0] == pytest.approx(2.0, rel=0.05)


def test_experiments_side_by_side_do_what_they_do_alone() -> None:
    """Three experiments of different length and reference, many replicas each, run at once: bit for bit the same."""
    plant = Plant.of(rrr().arm)
    several = [experiment(plain(), samples) for samples in (60, 90, 40)]
    several[1] = replace(several[1], q_ref=several[1].q_ref[::-1].copy(), dq_ref=-several[1].dq_ref[::-1],
                         q0=several[1].q_ref[-1],
                         dq0=-several[1].dq_ref[-1])
    seeds = range(MANY)
    for one, alone in zip(run_together(plant, several, 2, NOISE, seeds), [run(plant, one, 2, NOISE, seeds) for one in several],
                          strict=True):
        np.testing.assert_array_equal(one.q, alone.q)
        np.testing.assert_array_equal(one.tau, alone.tau)
