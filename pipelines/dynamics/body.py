"""The motion of an arm, and the interface of every rigid body."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from pipelines.io.robot import LinkParameters, RobotDescription

__all__ = [
    "Array", "BaseParameter", "Motion", "RigidBody", "TorqueParts", "refuse_other_length",
    "refuse_other_shapes", "standard_parameters",
]

Array = npt.NDArray[np.float64]

_KEPT = 16  # numerics: torques of a motion: slopes of seven joints, arm and body, and two more


@dataclass(frozen=True)
class Motion:
    """Joint motion on one time base."""

    t: Array  # [s] (samples,)
    # [rad] (samples, joints), in the log's zero: offsets of the description are not yet added
    q: Array
    dq: Array  # [rad/s] (samples, joints)
    ddq: Array  # [rad/s^2] (samples, joints)
    # [N m] (samples, joints) as logged, held from each sample to the next; None: not known
    tau: Array | None = None
    # [N m] (joints,) measured torque at sample `since`, before which the motion is vague
    logged: Array | None = None
    since: int = field(default=0, kw_only=True)
    # [s] this may be every other sample of it
    log_sample_time: float | None = field(default=None, kw_only=True)
    _kept: list[tuple[tuple[object, ...], Array]] = field(
        default_factory=list, init=False, repr=False, compare=False)

    @property
    def sample_time(self) -> float:
        """[s] between two samples of its log."""
        return self.log_sample_time or (float(np.median(np.diff(self.t)))
                                        if len(self.t) > 1 else 0.0)

    def kept(self, key: tuple[object, ...], work: Callable[[], Array]) -> Array:
        """Return what `work` makes of this motion: once for the objects of a key, of the last few.

        It is not to be written to. Of a motion whose arrays may be written to nothing is kept.
        """
        if any(x.flags.writeable for x in (self.q, self.dq, self.ddq)):
            return work()
        for place, (known, torque) in enumerate(self._kept):
            if len(known) == len(key) and all(a is b for a, b in zip(key, known, strict=True)):
                self._kept.insert(0, self._kept.pop(place))
                return torque
        torque = work()
        torque.flags.writeable = False
        self._kept.insert(0, (key, torque))
        del self._kept[_KEPT:]
        return torque


@dataclass(frozen=True)
class BaseParameter:
    """One element of the base parameter set."""

    name: str  # "p3", or the leading standard parameter of a general arm: "Ixx2"
    unit: str  # "kg m^2"
    combination: str  # readable: "m3 (a3 + x3)", "Ixx2 - Iyy2 - 0.04 m3"


@dataclass(frozen=True)
class TorqueParts:
    """The rigid body's torque, split. Each (samples, joints) [N m]; their sum is the torque."""

    inertia: Array  # D(q) ddq
    coriolis: Array  # c(q, dq)
    gravity: Array  # h(q)


def refuse_other_shapes(columns: int, **states: Array) -> None:
    """Refuse arrays by their names that are not (samples, columns), all with as many samples.

    Raises:
        ValueError: says which array, the shape it has and the shape it must have.
    """
    samples = None
    for name, values in states.items():
        shape = np.shape(values)
        if shape != (*shape[:1], columns):
            raise ValueError(f"{name} has the shape {shape}, wanted is (samples, {columns})")
        samples = shape[0] if samples is None else samples
        if shape[0] != samples:
            wanted = (samples, columns)
            raise ValueError(f"{name} has the shape {shape}, wanted is {wanted}, as before it")


def refuse_other_length(parameters: int, p: Array) -> None:
    """Refuse p that is not (parameters,), with a ValueError."""
    if np.shape(p) != (parameters,):
        raise ValueError(f"p has the shape {np.shape(p)}, wanted is ({parameters},)")


class RigidBody(ABC):
    """A rigid arm whose torque is linear in its base parameters: τ = Y(q, dq, ddq) p, eq. (8)."""

    robot: RobotDescription
    parameters: tuple[BaseParameter, ...]

    @property
    @abstractmethod
    def combine(self) -> Array:
        """(parameters, 10 · joints): p of standard parameters, not to be written to."""

    @property
    @abstractmethod
    def links_behind(self) -> Array:
        """(10 · joints, parameters): standard parameters with the torques of p, the same."""

    @abstractmethod
    def regressor(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Y (samples, joints, parameters), stored with samples fastest."""

    @abstractmethod
    def torque(self, q: Array, dq: Array, ddq: Array, p: Array) -> Array:
        """τ = Y p (samples, joints) [N m], without forming Y where that is faster."""

    @abstractmethod
    def tip(self, q: Array) -> Array:
        """Tip position (samples, 3) [m] in the base frame."""

    def torque_parts(self, q: Array, dq: Array, ddq: Array, p: Array) -> TorqueParts:
        """D(q) ddq, c(q, dq) and h(q): what is left of τ with the others at rest."""
        rest = np.zeros_like(q)
        gravity = self.torque(q, rest, rest, p)
        return TorqueParts(self.torque(q, rest, ddq, p) - gravity,
                           self.torque(q, dq, rest, p) - gravity, gravity)

    def mass_matrix(self, q: Array, p: Array) -> Array:
        """D(q) (samples, joints, joints) [kg m^2]: what unit accelerations take."""
        rest = np.zeros_like(q)
        gravity = self.torque(q, rest, rest, p)
        units = np.eye(self.robot.n_joints)
        return np.stack([self.torque(q, rest, rest + unit, p) - gravity for unit in units], axis=-1)

    def known_parameters(self) -> Array | None:
        """Return p of the links of the description; None where it does not know them all."""
        links = [joint.link for joint in self.robot.joints if joint.link is not None]
        if len(links) < self.robot.n_joints:
            return None
        terms = self.combine * standard_parameters(links)
        return np.array([math.fsum(row) for row in terms])  # to the last bit on any processor


def standard_parameters(links: Sequence[LinkParameters]) -> Array:
    """Return the standard parameters (links * 10,) of known links."""
    return np.array([v for k in links for v in (k.mass, *(k.mass * c for c in k.com), *k.inertia)],
                    dtype=float)
