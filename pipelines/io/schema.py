"""The names, units and shapes of the experiment log, version 1: what `log-format.md` says, as data."""

from __future__ import annotations

from typing import Final

FORMAT: Final = "rrrid-log"
FORMAT_VERSION: Final = 1

EXPERIMENTS: Final = ("friction", "excitation", "writing", "frf", "hold", "free")
ROLES: Final = ("identify", "validate", "reference")
ORIGINS: Final = ("measured", "simulated", "planned")
TORQUE_KINDS: Final = ("held-command", "measured")
LAWS: Final = ("open-loop", "pd", "pd+feedforward", "computed-torque", "unknown")
FEEDFORWARD: Final = ("friction", "inertia", "coriolis", "gravity")
VELOCITIES: Final = ("observer", "backward-difference")

# Experiments that move one joint, and say which.
ONE_JOINT: Final = ("friction", "frf")

# name -> (quantity, words). The quantity becomes a unit by the joint's type (`unit_of`).
SIGNALS: Final[dict[str, tuple[str, str]]] = {
    "t": ("time", "time stamp"),
    "q": ("position", "measured joint position"),
    "tau": ("torque", "commanded joint torque"),
    "q_ref": ("position", "reference position"),
    "dq_ref": ("velocity", "reference velocity"),
    "ddq_ref": ("acceleration", "reference acceleration"),
    "dq": ("velocity", "measured joint velocity"),
    "v": ("excitation", "injected excitation"),
    "r": ("acceleration", "input of the feedback-linearised plant"),
    "q_obs": ("position", "position observed by the controller"),
    "dq_obs": ("velocity", "velocity observed by the controller"),
    "ddq_obs": ("acceleration", "acceleration observed by the controller"),
    "tau_friction": ("torque", "friction torque computed by the controller"),
    "tau_feedforward": ("torque", "feed-forward torque computed by the controller"),
    "current": ("current", "motor current"),
    "temperature": ("temperature", "motor or joint temperature"),
}

# What stages derive; allowed only in a log that has a /derived group.
DERIVED: Final[dict[str, tuple[str, str]]] = {
    "q_hat": ("position", "reconstructed position"),
    "dq_hat": ("velocity", "reconstructed velocity"),
    "ddq_hat": ("acceleration", "reconstructed acceleration"),
    "q_hat_std": ("position", "standard deviation of the reconstructed position"),
    "dq_hat_std": ("velocity", "standard deviation of the reconstructed velocity"),
    "ddq_hat_std": ("acceleration", "standard deviation of the reconstructed acceleration"),
    "tau_model": ("torque", "torque of the model"),
    "tau_inertia": ("torque", "inertial torque of the model"),
    "tau_coriolis": ("torque", "Coriolis and centripetal torque of the model"),
    "tau_gravity": ("torque", "gravity torque of the model"),
    "tau_friction_model": ("torque", "friction torque of the model"),
    "tau_effects": ("torque", "torque of the further effects of the model"),
    "tau_residual": ("torque", "measured minus modelled torque"),
}

_REVOLUTE: Final = {"time": "s", "position": "rad", "velocity": "rad/s", "acceleration": "rad/s^2", "torque": "N m",
                    "current": "A", "temperature": "degC"}
_PRISMATIC: Final = _REVOLUTE | {"position": "m", "velocity": "m/s", "acceleration": "m/s^2", "torque": "N"}


def unit_of(name: str, law: str | None = None) -> str:
    """The `units` attribute of signal `name`. It names the revolute unit; the robot says which joints are prismatic.

    `law` decides what an injected excitation is: torque under "pd", acceleration under "computed-torque" (eq. 27).
    """
    quantity = (SIGNALS | DERIVED)[name][0]
    if quantity == "excitation":
        quantity = "torque" if law in ("pd", "pd+feedforward") else "acceleration"
    return _REVOLUTE[quantity]


def joint_unit(name: str, revolute: bool) -> str:
    """SI unit of signal `name` on one joint, for labels and messages."""
    return (_REVOLUTE if revolute else _PRISMATIC)[(SIGNALS | DERIVED)[name][0]]
