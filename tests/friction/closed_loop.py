"""One joint under a position loop, simulated here: LuGre friction, coarse encoder, drift, stick-slip.

    J ddq + W sin(q - q0) + F = u + actuator noise
    dz = v - |v| z / g(v),   F = (1 + drift(t)) (s0 z + s1 dz + b v)      Canudas de Wit et al. 1995, eq. (1)-(4)

Nothing of it is the project's. Machines of one sample rate are integrated side by side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.io import schema
from pipelines.io.log import Array, ExperimentLog, Signal
from pipelines.io.robot import Joint, RobotDescription, format_robot

RATES = (250, 500, 1000, 2000)  # [Hz]
KINDS = ("rests", "closed-loop", "vertical", "12-bit", "trend", "step", "stick-slip")
_INTEGRATION = 4000  # [Hz]
_SPEEDS = np.geomspace(0.05, 2.0, 6)  # [rad/s] of the reference


@dataclass(frozen=True)
class Machine:
    """One machine and its session."""

    kind: str
    seed: int
    rate: int  # [Hz]
    inertia: float  # [kg m^2]
    weight: float  # [N m]
    hanging: float  # [rad] position in which the weight pulls down
    coulomb: tuple[float, float]  # [N m] forth, back
    viscous: tuple[float, float]  # [N m s/rad]
    stribeck: float  # share of Coulomb friction added at standstill
    stribeck_speed: float  # [rad/s]
    bending: float  # [rad] of the bristles at the onset of sliding
    kp: float
    kd: float
    encoder: float  # [rad] step
    noise: float  # [N m] of a torque sample
    measured: bool  # torque is measured with noise; else commanded, and the drive adds the noise
    drift: float  # relative change of friction
    when: float  # [s] of a step; of a trend its time constant
    seconds: float
    rests: float  # [s] between the plateaus

    def friction(self, v: Array) -> Array:
        """Sliding friction (samples,) [N m] without drift."""
        forth, back = (c * (1.0 + self.stribeck * np.exp(-((v / self.stribeck_speed) ** 2))) + b * np.abs(v)
                       for c, b in zip(self.coulomb, self.viscous, strict=True))
        return np.where(v >= 0.0, forth, -back)

    def scale(self, t: Array) -> Array:
        """Return the factor of friction at time t."""
        if self.kind == "step":
            return np.where(t >= self.when, 1.0 + self.drift, 1.0)
        return 1.0 + self.drift * -np.expm1(-t / self.when) if self.kind == "trend" else np.ones_like(t)


def draw(kind: str, seed: int) -> Machine:
    """A machine of this kind."""
    rng = np.random.default_rng([501, KINDS.index(kind), seed])
    inertia, coulomb = float(np.exp(rng.uniform(np.log(0.1), np.log(2.0)))), float(rng.uniform(0.8, 5.0))
    viscous, law = coulomb * float(rng.uniform(0.15, 0.6)), rng.choice(["plain", "asymmetric", "stribeck"])
    spread = rng.uniform(0.1, 0.35, 2) * rng.choice([-1.0, 1.0], 2) if law == "asymmetric" else np.zeros(2)
    slips = kind == "stick-slip"
    stribeck = float(rng.uniform(0.3, 0.6) if slips else rng.uniform(0.15, 0.4)) if law == "stribeck" or slips else 0.0
    frequency = 2.0 * np.pi * (rng.uniform(0.7, 1.5) if slips else rng.uniform(2.0, 6.0))
    bits = 12 if kind == "12-bit" else int(rng.integers(16, 21))
    seconds = 30.0
    when = rng.uniform(0.3, 1.0) * seconds if kind == "trend" else rng.uniform(0.25, 0.75) * seconds
    weight = 0.0 if kind == "vertical" or rng.random() < 0.3 else inertia * rng.uniform(2.0, 15.0)
    return Machine(
        kind, seed, int(rng.choice(RATES)), inertia, float(weight), float(rng.uniform(-np.pi, np.pi)),
        (coulomb * (1.0 + spread[0]), coulomb * (1.0 - spread[0])), (viscous * (1.0 + spread[1]), viscous * (1.0 - spread[1])),
        stribeck, float(rng.uniform(0.08, 0.3)), float(np.exp(rng.uniform(np.log(1e-4), np.log(2e-3)))),
        inertia * frequency**2, 2.0 * (0.35 if slips else 0.9) * inertia * frequency, 2.0 * np.pi / 2**bits,
        coulomb * float(rng.uniform(0.002, 0.02)), bool(rng.random() < 0.6),
        float(rng.uniform(0.15, 0.4) * rng.choice([-1.0, -1.0, 1.0])) if kind in ("trend", "step") else 0.0, float(when), seconds,
        float(rng.uniform(0.2, 0.8)) if kind != "closed-loop" else 0.0)


def reference(machine: Machine) -> tuple[Array, Array]:
    """Position and speed (samples, 2) of plateaus both ways, or of sines that swell, at the integration rate."""
    rng = np.random.default_rng([502, KINDS.index(machine.kind), machine.seed])
    t = np.arange(round(machine.seconds * _INTEGRATION)) / _INTEGRATION
    if machine.kind == "closed-loop" and rng.random() < 0.5:
        phases = rng.uniform(0, 2 * np.pi, 4)
        speed = sum(np.sin(2.0 * np.pi * f * t + p) for f, p in zip((0.11, 0.23, 0.41, 0.77), phases, strict=True))
        speed = 1.5 * np.clip(t / 2.0, 0.0, 1.0) * (0.55 - 0.45 * np.cos(2.0 * np.pi * t / machine.seconds)) * speed / 1.6
    else:
        knots, values, now = [0.0], [0.0], 0.3
        levels = np.repeat(rng.permutation(_SPEEDS) if rng.random() < 0.5 else _SPEEDS, 2) * np.tile([1.0, -1.0], len(_SPEEDS))
        each = (machine.seconds - 1.0) / len(levels)
        ramp = 0.25
        for level in levels:
            hold = each - 2.0 * ramp - machine.rests
            knots += [now, now + ramp, now + ramp + hold, now + 2.0 * ramp + hold]
            values += [0.0, level, level, 0.0]
            now += each
        speed = np.interp(t, knots, values)
    return np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))]) / _INTEGRATION, speed


def simulate(machines: list[Machine]) -> list[ExperimentLog]:
    """Logs of machines of one sample rate."""
    every, dt = _INTEGRATION // machines[0].rate, 1.0 / _INTEGRATION
    assert len({(m.rate, m.seconds) for m in machines}) == 1
    rng = np.random.default_rng([503, *(m.seed + 1000 * KINDS.index(m.kind) for m in machines)])
    position, speed = (np.stack(x, axis=1) for x in zip(*(reference(m) for m in machines), strict=True))

    def row(name: str) -> Array:
        return np.array([getattr(m, name) for m in machines], dtype=np.float64)

    J, W, q0, kp, kd, step, noise = map(row, ("inertia", "weight", "hanging", "kp", "kd", "encoder", "noise"))
    fc, fv = np.array([m.coulomb for m in machines]).T, np.array([m.viscous for m in machines]).T
    hump, vs, bend, measured = row("stribeck"), row("stribeck_speed"), row("bending"), row("measured") > 0.5
    scale = np.stack([m.scale(np.arange(len(position), dtype=np.float64) * dt) for m in machines], axis=1)
    top = np.maximum(fc[0], fc[1]) * (1.0 + hump)
    s0 = top / bend
    s1 = 0.5 * 2.0 * np.sqrt(s0 * J)
    q = np.zeros(len(machines))
    v, z, u, before = q.copy(), q.copy(), q.copy(), q.copy()
    held = W * np.sin(-q0)  # the loop compensates the weight that it starts with
    log = np.empty((len(position) // every, 2, len(machines)))
    for k in range(len(position)):
        if k % every == 0:
            seen = np.round(q / step) * step
            rate = (seen - before) / (every * dt) if k else 0.0 * q
            u = kp * (position[k] - seen) + kd * (speed[k] - rate) + held
            before, w = seen, noise * rng.standard_normal(len(machines))
            log[k // every] = seen, u + np.where(measured, w, 0.0)
            u = u + np.where(measured, 0.0, w)
        side = v >= 0.0
        h = hump * np.exp(-np.square(v / vs))
        g = np.where(side, fc[0], fc[1]) * (1.0 + h) / s0
        dz = v - np.abs(v) * z / g
        friction = scale[k] * (s0 * z + s1 * dz + np.where(side, fv[0], fv[1]) * v)
        slope = scale[k] * s1 * np.maximum(1.0 - np.sign(v) * z / g, 0.0)
        drag = scale[k] * np.where(side, fv[0], fv[1])  # of the middle of the step: else J would change by b dt/2
        last, v = v, v + dt * (u - W * np.sin(q + 0.5 * dt * v - q0) - friction) / (J + dt * (slope + 0.5 * drag))
        q = q + 0.5 * dt * (last + v)
        z = (z + dt * v) / (1.0 + dt * np.abs(v) / g)
    return [_log(m, log[:, :, i]) for i, m in enumerate(machines)]


def _log(machine: Machine, rows: Array) -> ExperimentLog:
    gravity = (0.0, 0.0, -9.81) if machine.kind == "vertical" else (9.81, 0.0, 0.0)
    robot = RobotDescription("one", gravity, "dh", (Joint("j1"),))
    values = {"t": np.arange(len(rows)) / machine.rate, "q": rows[:, :1], "tau": rows[:, 1:]}
    signals = {key: Signal(array, schema.unit_of(key), schema.SIGNALS[key][1]) for key, array in values.items()}
    return ExperimentLog(f"{machine.kind}-{machine.seed}", "friction", "identify", "simulated", robot.name, 1.0 / machine.rate,
                         format_robot(robot), signals, joint=1, torque="measured" if machine.measured else "commanded")


def logs_of(machines: list[Machine]) -> dict[str, ExperimentLog]:
    """Logs by name, those of one rate together."""
    found: dict[str, ExperimentLog] = {}
    for rate in RATES:
        some = [m for m in machines if m.rate == rate]
        if some:
            found |= {log.name: log for log in simulate(some)}
    return found
