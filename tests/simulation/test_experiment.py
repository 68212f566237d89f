"""What a log must say to be simulated in closed loop, and what of it is used."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pipelines.errors import InputRejected
from pipelines.io import schema
from pipelines.io.log import Controller, ExperimentLog, Signal
from pipelines.io.model_file import model_text
from pipelines.io.robot import format_robot
from pipelines.io.robot_files import load_robot
from pipelines.simulation import Experiment
from tests.simulation.arms import KD, KP, TS, rrr, waving

SAMPLES = 50
PD = Controller("pd", KP, KD, velocity="backward-difference")


def log_of(controller: Controller | None = PD, without: tuple[str, ...] = (), **about: Any) -> ExperimentLog:
    """A log of the RRR arm that follows `waving`, a little behind it."""
    q, dq, ddq = waving(SAMPLES)
    values = {"t": 3.0 + TS * np.arange(SAMPLES), "q": np.round((q - 1e-3) / 1e-5) * 1e-5, "tau": 0 * q + 0.5, "q_ref": q,
              "dq_ref": dq, "ddq_ref": ddq}
    known = {"name": "wave", "experiment": "excitation", "role": "identify", "origin": "measured", "robot_name": "rrr",
             "sample_time": TS, "robot_text": format_robot(load_robot("rrr")), "controller": controller}
    signals = {name: Signal(x, schema.unit_of(name), schema.SIGNALS[name][1]) for name, x in values.items() if name not in without}
    return ExperimentLog(**(known | about), signals=signals)  # type: ignore[arg-type]


def replaced(log: ExperimentLog, **values: np.ndarray) -> ExperimentLog:
    return replace(log, signals=dict(log.signals) | {name: replace(log.signals[name], values=x) for name, x in values.items()})


@pytest.mark.parametrize(("log", "code", "words"), [
    (log_of(None), "S22", "does not say how its controller works"),
    (log_of(replace(PD, kd=None)), "S22", "lacks kd"),
    (log_of(replace(PD, law="pd+feedforward")), "S22", "lacks feedforward"),
    (log_of(Controller("open-loop"), experiment="friction", joint=2), "S22", "open loop"),
    (log_of(without=("q_ref",)), "S22", "q_ref"),
    (replaced(log_of(), q_ref=np.full((SAMPLES, 3), np.nan)), "D02", "q_ref"),
    (replaced(log_of(), t=np.cumsum(np.r_[0.0, np.full(SAMPLES - 1, TS)]) + 0.3 * (np.arange(SAMPLES) > 20)), "T05", "gaps"),
])
def test_what_is_missing_is_named(log: ExperimentLog, code: str, words: str) -> None:
    """Nothing about a controller is guessed."""
    with pytest.raises(InputRejected, match=words) as refused:
        Experiment.of_log(log)
    assert refused.value.code == f"RRID-{code}"


def test_speed_is_derived_where_only_positions_were_planned() -> None:
    """dq_ref from q_ref; ddq_ref only where a feed-forward asks for it."""
    found = Experiment.of_log(log_of(without=("dq_ref", "ddq_ref")))
    np.testing.assert_allclose(found.dq_ref[1:-1], waving(SAMPLES)[1][1:-1], atol=2e-3)
    model = model_text(rrr().arm.to_model())
    asked = replace(PD, law="pd+feedforward", feedforward=("gravity",), model=model)
    with pytest.raises(InputRejected, match="ddq_ref"):
        Experiment.of_log(log_of(asked, without=("ddq_ref",)))
