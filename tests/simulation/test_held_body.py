"""Inertia, Coriolis forces and weight held over a step: Pinocchio's arm, which holds nothing, says what that costs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.dynamics.body import Array, Motion
from pipelines.io.log import Controller
from pipelines.simulation import Experiment, Noise, choose_step
from pipelines.simulation.closed_loop import run_together
from pipelines.simulation.imitate import How, imitate
from pipelines.simulation.integrate import RungeKutta
from pipelines.simulation.plant import Plant
from pipelines.writing.task import planned_log
from tests.seeds import rarely
from tests.simulation.arms import KD, KP, TS, Case, experiment, rrr, serial
from tests.simulation.pinocchio_loop import Loop
from tests.simulation.test_forward_dynamics import follow, offsets

SAMPLES = 120


def missed(name: str, shared: Path, folder: Path, torque: Array, *steps: int) -> list[float]:
    """[rad] root mean square over a quarter of a second in open loop, with so many steps a sample."""
    case = serial(name, shared, folder)
    start = np.linspace(-0.5, 0.5, case.n)
    judge, _, _ = Loop(case.model, steps=4).run(start + offsets(case.arm), np.zeros(case.n), lambda k, q: torque[k], SAMPLES)
    own = [follow(RungeKutta(Plant.of(case.arm).prepared(1), TS, count, held=True), start, torque, 1)[:, 0] for count in steps]
    return [float(np.sqrt(np.mean(np.square(found + offsets(case.arm) - judge)))) for found in own]


@pytest.mark.parametrize("name", ["tx40", "puma-mdh"])
@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_what_it_costs_in_open_loop_falls_with_the_square_of_the_step(name: str, noise: float, shared: Path,
                                                                      tmp_path: Path) -> None:
    """Less than a micrometre at a metre of an arm that falls for a quarter of a second, where torque jumps at every sample too;
    a quarter of that with two steps a sample."""
    torque = 3.0 * np.sin(np.arange(SAMPLES)[:, None] * np.linspace(0.005, 0.02, 6))
    torque = torque + noise * np.random.default_rng(5).standard_normal(torque.shape)
    one, two = missed(name, shared, tmp_path, torque, 1, 2)
    assert one < 1e-6
    assert two < 0.3 * one


def test_short_steps_share_one_body(shared: Path, tmp_path: Path) -> None:
    """Of eight steps a sample four each have the same, so that they are as exact as two."""
    torque = np.zeros((SAMPLES, 6))
    two, eight = missed("tx40", shared, tmp_path, torque, 2, 8)
    assert eight == pytest.approx(two, rel=0.05)


def swinging(case: Case, samples: int) -> Experiment:
    """Every joint under PD, its natural frequency 40 rad/s; encoders that do not count."""
    w, t = 2.0 * np.pi * np.linspace(0.5, 1.5, case.n), TS * np.arange(samples)[:, None]
    q, dq, ddq = 0.6 * (1.0 - np.cos(w * t)), 0.6 * w * np.sin(w * t), 0.6 * w * w * np.cos(w * t)
    inertia = np.diag(case.arm.body.mass_matrix(q[:1], case.arm.p)[0])
    pd = Controller("pd", 1600.0 * inertia, 56.0 * inertia, velocity="backward-difference")
    none = np.zeros(case.n)
    return Experiment(sample_time=TS, start_time=0.0, controller=pd, q_ref=q, dq_ref=dq, ddq_ref=ddq, q0=q[0], dq0=dq[0], tau0=none,
                      resolution=none)


def test_steps_that_are_asked_for_hold_nothing(shared: Path, tmp_path: Path) -> None:
    """Each of them is Runge-Kutta of order 4: 1 a sample is nearer to 4 than 1 that hold the body ever come."""
    case = serial("tx40", shared, tmp_path)
    asked = swinging(case, 250)
    t = np.asarray(TS * np.arange(250), dtype=np.float64)
    plan = planned_log("swing", case.arm.robot, Motion(t, asked.q_ref, asked.dq_ref, asked.ddq_ref))
    log = replace(plan, controller=asked.controller)
    one, four = (imitate(log, case.arm, How(steps=steps), "swing").logs[0].q for steps in (1, 4))
    held = run_together(Plant.of(case.arm), [Experiment.of_log(log)], 1, exact=False)[0].q[0]
    far, near = (float(np.abs(found - four).max()) for found in (held, one))
    assert far > 1e-8
    assert near < 0.1 * far


@pytest.mark.parametrize(("noise", "exact"), [*rarely((0.0, True)), (0.01, True), (1.0, False)])
def test_nothing_is_held_where_that_would_be_told(noise: float, exact: bool, shared: Path, tmp_path: Path) -> None:
    """1e-9 rad where nothing is random: shorter steps that share a body come no closer to it, one step that holds nothing does."""
    case = serial("tx40", shared, tmp_path)
    step = choose_step(Plant.of(case.arm), swinging(case, 400), Noise(np.full(6, noise), np.zeros(6)))
    assert (step.error <= step.allowed).all()
    assert step.exact is exact
    assert step.per_sample <= 2


def test_a_replica_does_the_same_alone_and_beside_a_shorter_run(shared: Path, tmp_path: Path) -> None:
    case = serial("tx40", shared, tmp_path)
    plant, noise = Plant.of(case.arm), Noise(np.full(6, 0.1), np.zeros(6))
    both = run_together(plant, [swinging(case, 120), swinging(case, 60)], 2, noise, (1, 2), exact=False)
    alone = run_together(plant, [swinging(case, 120)], 2, noise, (2,), exact=False)
    np.testing.assert_allclose(both[0].true_q[1], alone[0].true_q[0], rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("held", [False, True])
def test_one_arm_without_arrays_moves_as_among_many_held_or_not(held: bool) -> None:
    """Plain numbers and arrays share one body over the same steps."""
    plant = Plant.of(rrr().arm)
    asked = experiment(Controller("pd", KP, KD, velocity="backward-difference"), SAMPLES)
    noise = Noise(np.array([0.3, 0.2, 0.1]), np.zeros(3))
    alone, among = (run_together(plant, [asked], 2, noise, seeds, not held)[0].true_q[0] for seeds in ((7,), (7, *range(9))))
    np.testing.assert_allclose(alone, among, rtol=0.0, atol=1e-12)
    exact = run_together(plant, [asked], 2, noise, (7,))[0].true_q[0]
    assert bool(np.abs(alone - exact).max() > 1e-10) is held
    assert np.abs(alone - exact).max() < 1e-6
