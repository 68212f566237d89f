"""Apply a fault to an arm: to its loads, its drives, its encoders and its log.

    acting = Acting(Fault("cogging", 1, 0.4, 14.3), law, sample_time, rng)
    made = acting.driven(command)               once a sample
    load = acting.load(now)                     at every stage of the integrator
    acting.after(applied, v)                    once a sample
    seen, logged = acting.seen(q), acting.logged(commands)

`Several` is more than one fault with the same methods.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.other_plants.friction import Friction
from pipelines.io.log import Array

_HEATING, _HOPS = 5.0, 0.7  # [s] time constant of a gear that warms, mean time between two hops
_DRIFTING = 6.0  # [s] time constant of viscous friction that drifts
_TOUCH = (3.0, 3.25)  # [s] from and to when something is touched
_PHASE = 0.7  # [rad] of a fault that goes with an angle


@dataclass(frozen=True)
class Fault:
    """A fault at one joint (from 0) or none; `size` in the unit of its kind."""

    kind: str
    joint: int = 0
    size: float = 0.0
    # Order [1/rad or 1/m] of what goes with the angle, phase [rad] of an encoder's; of what comes
    # from another joint: which; where a spring rests [rad or m]; speed of concave friction [rad/s
    # or m/s]; where a tilt or a push points [rad].
    number: float = 0.0


@dataclass(frozen=True, eq=False)
class Now:
    """The arm at one stage of the integrator. Arrays (joints,)."""

    t: float  # [s]
    q: Array
    v: Array
    dry: Array  # [N m] its friction
    applied: Array  # [N m] by the drives
    pushed: Callable[[Array], Array]  # [N m] what a force [N] (3,) at the tip does to the joints


class Acting:
    """A fault during one run, with its state."""

    def __init__(
        self, fault: Fault, law: Friction, sample_time: float, rng: np.random.Generator
    ) -> None:
        self.kind, self.j, self.size, self.number = (
            fault.kind,
            fault.joint,
            fault.size,
            fault.number,
        )
        self._law, self._lasting, self._rng = law, sample_time, rng
        self._heat, self._hop = 0.0, 1.0
        late = round(self.size / sample_time) if self.kind in ("torque_delay", "time_delay") else 0
        self._late: deque[Array] = deque(maxlen=late + 1)
        self._made: Array | None = None

    def driven(self, command: Array) -> Array:
        """Return the torques of the drives under the command."""
        made, j = command.copy(), self.j
        if self.kind == "torque_delay":
            self._late.append(made)
            return self._late[0]
        if self.kind == "torque_gain":
            made[j] *= 1.0 + self.size
        elif self.kind == "torque_crosstalk":
            made[j] += self.size * command[int(self.number)]
        elif self.kind == "torque_saturation":
            made[j] = np.clip(made[j], -self.size, self.size)
        elif self.kind == "drive_lag":
            before = made if self._made is None else self._made
            made[j] = before[j] - np.expm1(-self._lasting / self.size) * (made[j] - before[j])
            self._made = made
        return made

    def load(self, now: Now) -> Array:
        """Return the load (joints,) [N m] in addition to friction, in the direction of motion."""
        out = np.zeros_like(now.q)
        if self.kind == "contact":
            if _TOUCH[0] <= now.t < _TOUCH[1]:
                out = now.pushed(
                    np.array([np.cos(self.number), np.sin(self.number), 0.3]) * self.size
                )
            return out
        out[self.j] = self._friction(now) + self._other(now)
        return out

    def _friction(self, now: Now) -> float:
        """Return the load [N m] of a fault of friction."""
        j, size, v = self.j, self.size, now.v[self.j]
        if self.kind == "asymmetric_friction":
            return -size * abs(np.tanh(v / self._law.width[j]))
        if self.kind == "load_friction":
            return -size * abs(now.applied[j]) * np.tanh(v / self._law.width[j])
        if self.kind == "viscous_drift":
            return size * self._law.viscous[j] * v * np.expm1(-now.t / _DRIFTING)
        if self.kind == "quadratic_drag":
            return -size * v * abs(v)
        if self.kind == "concave_friction":
            return -size * np.tanh(v / self.number)
        if self.kind == "position_friction":
            return -size * now.dry[j] * np.sin(self.number * now.q[j] + _PHASE)
        if self.kind == "heat from another joint":
            return -self._heat * (now.dry[j] + self._law.viscous[j] * v)
        return 0.0

    def _other(self, now: Now) -> float:
        """Return the load [N m] of a fault that has nothing to do with friction."""
        q, size = now.q[self.j], self.size
        if self.kind == "hopping torque":
            return self._hop * size
        if self.kind == "torque_offset":
            return size
        if self.kind == "cogging":
            return size * (np.sin(self.number * q + _PHASE) + 0.3 * np.sin(2.0 * self.number * q))
        if self.kind == "spring":
            return -size * ((q - self.number) + 0.1 * (q - self.number) ** 3)
        return 0.0

    def after(self, applied: Array, v: Array) -> None:
        """Update the state at the end of a sample."""
        if self.kind == "heat from another joint":
            other = int(self.number)
            self._heat += (
                self._lasting / _HEATING * (abs(applied[other] * v[other]) / self.size - self._heat)
            )
        if self.kind == "hopping torque" and self._rng.random() < self._lasting / _HOPS:
            self._hop = -self._hop

    def seen(self, q: Array) -> Array:
        """Return the positions at the encoders, before quantisation."""
        out, j = q.copy(), self.j
        if self.kind == "encoder_eccentricity":
            out[j] += self.size * np.sin(q[j] + self.number)
        elif self.kind == "encoder_crosstalk":
            out[j] += self.size * q[int(self.number)]
        elif self.kind == "time_delay":
            self._late.append(q.copy())
            out[j] = self._late[0][j]
        return out

    def logged(self, commands: Array) -> Array:
        """Return the commands (samples, joints) as logged."""
        if self.kind != "torque_lag":
            return commands
        out, kept = commands.copy(), np.exp(-self._lasting / self.size)
        for k in range(1, len(out)):
            out[k, self.j] = kept * out[k - 1, self.j] + (1.0 - kept) * commands[k, self.j]
        return out


class Several:
    """All faults of an arm during one run, applied in order."""

    def __init__(
        self, faults: tuple[Fault, ...], law: Friction, sample_time: float, rng: np.random.Generator
    ) -> None:
        self._all = [Acting(fault, law, sample_time, rng) for fault in faults]

    def driven(self, command: Array) -> Array:
        """Return the torques of the drives under the command."""
        made = command
        for one in self._all:
            made = one.driven(made)
        return made

    def load(self, now: Now) -> Array:
        """Return the load (joints,) [N m] in addition to friction, in the direction of motion."""
        return sum((one.load(now) for one in self._all), np.zeros_like(now.q))

    def after(self, applied: Array, v: Array) -> None:
        """Update the state at the end of a sample."""
        for one in self._all:
            one.after(applied, v)

    def seen(self, q: Array) -> Array:
        """Return the positions at the encoders, before quantisation."""
        out = q
        for one in self._all:
            out = one.seen(out)
        return out

    def logged(self, commands: Array) -> Array:
        """Return the commands (samples, joints) as logged."""
        out = commands
        for one in self._all:
            out = one.logged(out)
        return out
