"""Every fault of the bench by its name; a new one is a class in the file of its kind and here.

fault_names()                          ("asymmetric_friction", "backlash", …)
find_fault(name)                       the class of one
make(name, machine, joint, seed)       one at the strength of causes.md times `strength`
"""

from __future__ import annotations

import numpy as np

from bench.faults import drive, friction, load, sensor, structure
from bench.machine import Case, Fault, Machine
from pipelines.errors import UsageError, did_you_mean

FAULTS: tuple[type[Fault], ...] = (
    drive.Cogging,
    drive.DriveLag,
    drive.HuntingDrive,
    drive.TorqueCrosstalk,
    drive.TorqueGain,
    drive.TorqueOffset,
    drive.TorqueSaturation,
    friction.AsymmetricFriction,
    friction.CableHysteresis,
    friction.ConcaveFriction,
    friction.LoadFriction,
    friction.PositionFriction,
    friction.Presliding,
    friction.QuadraticDrag,
    friction.RelativeDamper,
    friction.SelfHeating,
    friction.StickingSeal,
    friction.Stribeck,
    friction.ViscousDrift,
    load.Contact,
    load.LeakingCounterbalance,
    load.Payload,
    load.RattlingMass,
    load.SloshingLoad,
    load.Spring,
    sensor.EncoderCrosstalk,
    sensor.EncoderEccentricity,
    sensor.TimeDelay,
    sensor.TorqueLag,
    structure.Backlash,
    structure.BaseResonance,
    structure.GravityTilt,
    structure.JointElasticity,
    structure.LinkLength,
    structure.RotorInertia,
    structure.TransmissionCoupling,
)


def fault_names() -> tuple[str, ...]:
    """Return the identifiers of all faults, sorted."""
    return tuple(sorted(kind.name for kind in FAULTS))


def find_fault(name: str) -> type[Fault]:
    """Return the fault with this identifier.

    Raises:
        UsageError: there is no such fault.
    """
    for kind in FAULTS:
        if kind.name == name:
            return kind
    names = fault_names()
    raise UsageError(
        "C02",
        f"'{name}' is not a fault{did_you_mean(name, names)}",
        remedy=f"the faults are {', '.join(names)}",
    )


def make(
    name: str,
    machine: Machine,
    joint: int | None = None,
    seed: int = 0,
    strength: float = 1.0,
    peak_torque: tuple[float, ...] | None = None,
    duration: float = 10.0,
) -> Fault:
    """Return the fault `name` at `strength` times the figure of causes.md.

    Args:
        name: its identifier.
        machine: that it is for.
        joint: 1-based; ignored where the fault is of the whole arm.
        seed: of what is drawn in it: phases, directions, frequencies.
        strength: 1 for that of causes.md.
        peak_torque: (n,) [N m] over the healthy logs; default: 60 % of the limits.
        duration: [s] of the logs to be recorded.
    """
    kind = find_fault(name)
    peak = peak_torque or tuple(0.6 * limit for limit in machine.torque_limit)
    at = None if kind.scope == "arm" else (joint or 1)
    fault = kind.full(Case(machine, at, np.random.default_rng([77, seed]), peak, duration))
    return fault if strength == 1.0 else fault.scaled(strength)
