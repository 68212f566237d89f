"""Simulate an arm model: closed-loop forward dynamics with friction and effects.

experiment = Experiment.of_log(log)          references, controller and encoders of a log
simulated = simulate(arm, experiment, noise, seeds=range(10))
simulated.q, simulated.tau                   (replicas, samples, joints) as logged

windows = simulate_windows(Plant.of(arm), motion, tau, …)   where no controller is known
"""

from __future__ import annotations

from pipelines.simulation.closed_loop import Noise, Simulated, run, run_together
from pipelines.simulation.experiment import Experiment
from pipelines.simulation.plant import Plant
from pipelines.simulation.replay import Windows, simulate_windows
from pipelines.simulation.step import Step, choose_step, simulate

__all__ = [
    "Experiment",
    "Noise",
    "Plant",
    "Simulated",
    "Step",
    "Windows",
    "choose_step",
    "run",
    "run_together",
    "simulate",
    "simulate_windows",
]
