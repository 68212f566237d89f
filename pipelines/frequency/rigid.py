"""What a rigid body would answer: the double integrator with the inertia of the posture.

    under computed torque   q_j/r_j = D̂_jj(q) / D_jj(q) · 1/s²,    under PD   q_j/τ_j = 1 / (D_jj(q) s²)

sampled and held, the other joints standing still. D̂ is the inertia of the controller's model, D that of the arm's: where no
better model is known they are one, and the response is 1/s² (Kostić et al. 2004, eq. (26)).
"""

from __future__ import annotations

from dataclasses import dataclass

from pipelines.dynamics.arm import Arm
from pipelines.errors import RrridError
from pipelines.frequency.responses import Measured
from pipelines.frequency.signals import Turned
from pipelines.io.model_file import parse_model

__all__ = ["Expected", "expected_rigid"]


@dataclass(frozen=True)
class Expected:
    """Of one response."""

    level: float | None  # of the acceleration per input: 1 or D̂/D under computed torque, 1/D under PD [1/(kg m^2)]
    inertia: float | None  # D_jj [kg m^2] in the posture
    source: str  # whose model: "given model", "controller's model", "none"


def expected_rigid(measured: Measured, arm: Arm | None) -> Expected:
    """The level of acceleration to expect, and the inertia behind it."""
    turned = measured.first
    controllers = _controllers(turned)
    inertia, source = None, "none"
    for model, whose in ((arm, "given model"), (controllers, "controller's model")):
        # a model of friction alone, as a run has where the base parameters were refused, knows of no inertia
        if inertia is None and model is not None and (known := _inertia(model, turned)) > 0.0:
            inertia, source = known, whose
    if turned.quantity == "tau":
        return Expected(None if inertia is None else 1.0 / inertia, inertia, source)
    if inertia is None:
        return Expected(1.0, None, source)
    theirs = _inertia(controllers, turned) if controllers is not None else inertia
    theirs = theirs if theirs > 0.0 else inertia
    return Expected(theirs / inertia, inertia, source)


def _controllers(turned: Turned) -> Arm | None:
    text = turned.controller.model if turned.controller is not None else None
    if text is None:
        return None
    try:
        return Arm.from_model(parse_model(text))
    except RrridError:
        return None  # a model that cannot be read is one that is not there


def _inertia(arm: Arm, turned: Turned) -> float:
    """D_jj in the posture; the angle of joint j itself does not change it."""
    j = turned.joint - 1
    return float(arm.body.mass_matrix(turned.posture[None], arm.p)[0, j, j])
