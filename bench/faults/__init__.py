"""Find every fault in this folder. A new file is a new fault: nothing has to be registered.

    fault_names()                          ("backlash", "cogging", …), without importing any
    find_fault(name)                       the class of one
    make(name, machine, joint, seed)       one at the strength of causes.md times `strength`
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import lru_cache

import numpy as np

from bench.fault import Case, Fault
from bench.machine import Machine
from pipelines.errors import UsageError, did_you_mean

__all__ = ["fault_names", "find_fault", "make"]


@lru_cache(maxsize=1)
def fault_names() -> tuple[str, ...]:
    """Identifiers of all faults, sorted."""
    return tuple(sorted(module.name for module in pkgutil.iter_modules(__path__)))


def find_fault(name: str) -> type[Fault]:
    """The fault whose file and identifier is `name`.

    Raises:
        UsageError: there is no such fault.
    """
    if name not in fault_names():
        raise UsageError("C02", f"'{name}' is not a fault{did_you_mean(name, fault_names())}",
                         remedy=f"the faults are {', '.join(fault_names())}")
    module = importlib.import_module(f"{__name__}.{name}")
    found: type[Fault] = next(member for member in vars(module).values() if getattr(member, "name", None) == name)
    return found


def make(name: str, machine: Machine, joint: int | None = None, seed: int = 0, strength: float = 1.0,
         peak_torque: tuple[float, ...] | None = None, duration: float = 10.0) -> Fault:
    """The fault `name` at `strength` times the figure of causes.md.

    Args:
        joint: 1-based; ignored where the fault belongs to the whole arm.
        seed: of what is drawn in it: phases, directions, frequencies.
        peak_torque: (n,) [N m] over the healthy logs; default: 60 % of the limits.
        duration: [s] of the logs to be recorded.
    """
    kind = find_fault(name)
    peak = peak_torque or tuple(0.6 * limit for limit in machine.torque_limit)
    at = None if kind.scope == "arm" else (joint or 1)
    fault = kind.full(Case(machine, at, np.random.default_rng([77, seed]), peak, duration))
    return fault if strength == 1.0 else fault.scaled(strength)
