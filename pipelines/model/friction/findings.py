"""What a friction fit says of the log itself: torque with the wrong sign, in amperes, or without a part that the drive gave."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.errors import Check, RrridError
from pipelines.log.experiment import ExperimentLog
from pipelines.model.arm import Arm
from pipelines.model.friction.joint import JointFit
from pipelines.model.rigid.choose import rigid_body

__all__ = ["FindingsConfig", "findings"]

_SEED = 20040509


@dataclass(frozen=True)
class FindingsConfig:
    """When a fit shows that its logs are wrong."""

    sure: float = 3.0  # std below zero (two-sided .003)
    far: float = 2.0  # times the inertia of the described links; a choice, not measured
    nothing: float = 0.01  # of the torque (std): no gravity; a choice, not measured
    coarse: float = 0.05  # bias of the inertia by errors in variables; a choice, not measured


_CONFIG = FindingsConfig()


def findings(joint: JointFit) -> tuple[Check, ...]:
    """Every finding about the logs of one joint, of those that the joint's own numbers show."""
    log = joint.logs.identify[0][0]
    found = [check for check in (_sign(joint, log), _amperes(joint, log), _compensated(joint, log), _one_way(joint, log))
             if check is not None]
    return tuple(found)


def _sign(joint: JointFit, log: ExperimentLog) -> Check | None:
    if joint.fit.inertia > -_CONFIG.sure * float(joint.fit.std[0]):
        return None
    return Check.of("S14", "warn", f"the inertia of joint {joint.logs.joint} comes out negative, {joint.fit.inertia:.3g}: torque "
                    "and position have opposite signs, or are of different joints", where=log.source or log.name, gate=True,
                    remedy="let 'rrrid inspect' look at logs that move every joint: if it finds no columns mixed up, turn the sign "
                           "of this joint's torque or position in the import")


def _amperes(joint: JointFit, log: ExperimentLog) -> Check | None:
    """S10: torque equal to the current, or an inertia far from that of the described links."""
    j = joint.logs.joint - 1
    if "current" in log and np.allclose(log["current"][:, j], log.tau[:, j], rtol=1e-6, atol=1e-12, equal_nan=True):
        return Check.of("S10", "warn", f"torque of joint {j + 1} is its motor current, sample for sample", gate=True,
                        where=log.source or log.name, remedy="give the torque constant at the import: torque_constant in [drive]")
    known = _known_inertia(log, j)
    if known is None or joint.fit.inertia <= 0.0 or 1.0 / _CONFIG.far < joint.fit.inertia / known < _CONFIG.far:
        return None
    return Check.of("S10", "warn", f"the inertia of joint {j + 1} is {joint.fit.inertia:.3g}, that of the described links "
                    f"{known:.3g}: torque in A, at the motor's side of a gear, or links that are not these", gate=True,
                    where=log.source or log.name, remedy="give torque constant and gear ratio at the import, or correct the links")


def _known_inertia(log: ExperimentLog, j: int) -> float | None:
    try:
        arm = Arm.from_links(log.robot)
    except RrridError:
        return None
    q = np.nanmedian(log.q, axis=0)[None]
    push = np.zeros_like(q)
    push[0, j] = 1.0
    still = np.zeros_like(q)
    return float((arm.body.torque(q, still, push, arm.p) - arm.body.torque(q, still, still, arm.p))[0, j])


def _compensated(joint: JointFit, log: ExperimentLog) -> Check | None:
    """D18: the controller compensated gravity, and the logged torque lacks it."""
    control, j = log.controller, joint.logs.joint - 1
    if control is None or "gravity" not in (control.feedforward or ()):
        return None
    states = np.random.default_rng(_SEED).uniform(-3.0, 3.0, (16, log.n_joints))
    acts = np.abs(rigid_body(log.robot).regressor(states, 0.0 * states, 0.0 * states)[:, j]).max() > 1e-9
    size = float(np.nanstd(log.tau[:, j]))
    if not acts or float(np.hypot.reduce(joint.fit.gravity)) > _CONFIG.nothing * size:
        return None
    return Check.of("D18", "warn", f"gravity of joint {j + 1} was compensated, but the torque shows none: it is not the whole",
                    where=log.source or log.name, gate=True, remedy="log the total torque, compensation included")


def _one_way(joint: JointFit, log: ExperimentLog) -> Check | None:
    if joint.covered.forth and joint.covered.back:
        return None
    return Check.of("D10", "warn", f"joint {joint.logs.joint} moves one way only: Coulomb friction is confounded with an offset",
                    where=log.source or log.name, gate=True, remedy="record the joint in both directions")
