"""Logs to test with: small, complete, and drawn at random within the format."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipelines.io import schema
from pipelines.io.log import Controller, Derived, ExperimentLog, Signal

ROBOT_TEXT = (Path(__file__).parents[2] / "sample_logs/robots/rrr.toml").read_text(encoding="utf-8")


def small_log(samples: int = 2000, seed: int = 0, **changes: object) -> ExperimentLog:
    """An excitation log of the RRR arm with every optional attribute a converter could lose."""
    rng = np.random.default_rng(seed)
    t = 12.5 + 1e-3 * np.arange(samples)
    q = np.cumsum(rng.normal(scale=1e-3, size=(samples, 3)), axis=0)
    motion = np.sin(t)[:, None] * np.ones(3)
    values = {"t": t, "q": np.round(q / 1e-5) * 1e-5, "tau": rng.normal(size=(samples, 3)), "q_ref": motion,
              "dq_ref": np.cos(t)[:, None] * np.ones(3), "ddq_ref": -motion, "temperature": 20 + q}
    signals = {name: Signal(value, schema.unit_of(name), schema.SIGNALS[name][1]) for name, value in values.items()}
    fields: dict[str, object] = {
        "name": "small", "experiment": "excitation", "role": "identify", "origin": "simulated", "robot_name": "rrr-tue",
        "sample_time": 1e-3, "robot_text": ROBOT_TEXT, "signals": signals, "torque": "held-command", "period": 1.0,
        "recorded": "2004-05-17T09:30:00Z", "controller": Controller(
            "pd", kp=[1500, 1100, 140], kd=[45, 32, 3.2], feedforward=("friction", "gravity"), velocity="observer",
            observer_gain=np.arange(9.0).reshape(3, 3), output_limit=[60, np.inf, 15], delay=1, model='{"name": "µ ✓"}')}
    return ExperimentLog(**(fields | changes))  # type: ignore[arg-type]


def random_log(rng: np.random.Generator) -> ExperimentLog:
    """Any log the format allows: odd numbers of samples, denormal and infinite-looking values, some attributes left out."""
    samples = int(rng.integers(2, 400))
    bits = rng.integers(0, 2**63, size=(samples, 3), dtype=np.int64)
    wild = bits.view(np.float64)
    wild = np.where(np.isfinite(wild), wild, -0.0)
    t = np.cumsum(rng.uniform(1e-9, 1e3, size=samples))
    signals = {"t": Signal(t, "s", "Zeit ✓"), "q": Signal(wild, "rad", "position"), "tau": Signal(-wild, "N m", "torque \\ \" '")}
    experiment = str(rng.choice(schema.EXPERIMENTS))
    if experiment == "frf":
        signals["v"] = Signal(wild, "rad/s^2", "excitation")
    derived = Derived("import", "{}", "0" * 64, "1970-01-01T00:00:00Z") if rng.random() < 0.5 else None
    if derived is not None:
        signals["tau_residual"] = Signal(wild, "N m", "what is left")
    law = None if rng.random() < 0.5 else Controller("unknown", feedforward=() if rng.random() < 0.5 else None)
    return ExperimentLog("näme\t,=1+1", experiment, str(rng.choice(schema.ROLES)), "measured", "rrr-tue",
                         float(rng.uniform(1e-5, 1)),
                         ROBOT_TEXT, signals, joint=2 if experiment in schema.ONE_JOINT else None, controller=law, derived=derived,
                         posture=rng.normal(size=3) if experiment in ("frf", "hold") else None)
