"""What the controllers of the virtual test bench need of our model, as the sample logs have it."""

from __future__ import annotations

from sample_logs.bench_session import ControllerModel, controller_model

__all__ = ["ControllerModel", "controller_model"]
