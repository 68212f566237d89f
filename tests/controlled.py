"""A log of the RRR arm under PD control, recorded on the virtual test bench: its controller is described."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from bench.control import Decentralised
from bench.draw import paper_machine
from bench.motions import Reference
from bench.plant import run
from pipelines.io import schema
from pipelines.io.log import ExperimentLog, Signal
from pipelines.io.robot import format_robot
from tests.simulation.arms import waving

__all__ = ["TORQUE_NOISE", "controlled_log"]

TORQUE_NOISE = (0.020, 0.010, 0.005)  # [N m] rms, of the bench's drives


@lru_cache(maxsize=4)
def controlled_log(samples: int = 1500, seed: int = 1) -> ExperimentLog:
    """The machine of the shipped model, nuisances off, along `waving`."""
    machine = paper_machine()
    t = 1e-3 * np.arange(samples)
    done = run(machine, Decentralised(), Reference(t, *waving(samples)), seed=seed)
    values = {"t": t, "q": done.q, "tau": done.tau, "q_ref": done.reference.q, "dq_ref": done.reference.dq,
              "ddq_ref": done.reference.ddq}
    signals = {name: Signal(x, schema.unit_of(name), schema.SIGNALS[name][1]) for name, x in values.items()}
    return ExperimentLog("waving", "free", "identify", "simulated", machine.robot.name, 1e-3, format_robot(machine.described),
                         signals, controller=done.controller)
