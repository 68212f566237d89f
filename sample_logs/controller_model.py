"""What the controllers of the virtual test bench need of our model: the bench itself knows no line of it.

    model = controller_model(arm)
    model.text                      model.json, for the log
    model.parts(q, dq, ddq)         friction, inertia, coriolis, gravity, each a list of joint torques [N m]
    model.inertia_times(q, r)       D(q) r [N m]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pipelines.io.model_file import model_text
from pipelines.model.arm import Arm
from pipelines.model.online import OnlineModel, OnlineTorque

__all__ = ["ControllerModel", "controller_model"]


@dataclass(frozen=True)
class ControllerModel:
    """A model as a controller uses it, one sample at a time."""

    text: str
    online: OnlineModel

    def parts(self, q: Sequence[float], dq: Sequence[float], ddq: Sequence[float]) -> OnlineTorque:
        return self.online.parts(q, dq, ddq)

    def inertia_times(self, q: Sequence[float], r: Sequence[float]) -> list[float]:
        return self.online.inertia_times(q, r)


def controller_model(arm: Arm) -> ControllerModel:
    """The model of `arm` for a controller of the bench."""
    return ControllerModel(model_text(arm.to_model()), OnlineModel(arm))
