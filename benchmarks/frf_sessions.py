"""Sessions of frequency responses on a plant of their own: compliance found for any v, loop, rate and band.

    nice python -m benchmarks.frf_sessions [--seed 1] [--count 60]

Two coupled joints of which one is excited, on a base: rigid, a soft base, a spring in the joint, or a gap in it; friction,
encoder steps, noise of the drive. Each session has two postures, v as a multisine, as band-limited noise or as a periodic sweep,
PD, PD with feed-forward or computed torque, 250 to 2000 Hz, and one of three bands. Printed: right, undecided, wrong with
intervals of 95 % (Wilson 1927). Undecided is an answer; of a gap, it is right where the gap is among the candidates.

    T = ½ I ẋ² + ½ J_m (ẋ + q̇)² + ½ [ẋ + q̇ + ẇ, ṙ] [[J - J_m, c], [c, k]] [ẋ + q̇ + ẇ, ṙ]ᵀ

x turns the base, q the motor, w twists the joint, r is the other joint. Position Verlet at 8 kHz or more, damping by its midpoint,
all sessions of one rate at once. It shares no code with the bench.
"""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import dataclass

import numpy as np

from pipelines.log.experiment import Array, Controller, ExperimentLog, Signal
from pipelines.log.schema import SIGNALS, unit_of
from pipelines.model.frf.findings import Findings, frf_findings

__all__ = ["Session", "drawn", "judged", "main", "recorded"]

INNER = 8000  # [Hz] at least
SECONDS, SPEED, LEG, RAMP = 24.0, 0.4, 6.0, 0.3
ENCODER = 1e-5  # [rad]
KINDS = ("rigid", "base", "joint", "gap")
ROBOT = 'name = "two"\ngravity = [0.0, 0.0, -9.81]\n[kinematics]\nconvention = "dh"\ntool = [0.0, 0.0, 0.0]\n' + "".join(
    f'[[joint]]\nname = "{name}"\ntype = "revolute"\na = 0.3\nalpha = 0.0\nd = 0.0\noffset = 0.0\nposition = [-inf, inf]\n'
    f"velocity = 6.0\nacceleration = 60.0\ntorque = 200.0\nencoder_resolution = {ENCODER}\n" for name in ("first", "second"))


@dataclass(frozen=True, eq=False)
class Session:
    """One arm, and how its responses are recorded. Numbers of joint 1 in two postures."""

    name: str
    kind: str
    inertia: Array  # J (2,) [kg m^2]
    coupling: Array  # c (2,)
    other: float  # k [kg m^2]
    base: tuple[float, float, float]  # f [Hz], damping ratio, I [kg m^2]
    spring: tuple[float, float, float, float]  # k [N m/rad], d [N m s/rad], J_m [kg m^2], gap [rad]
    excitation: str  # multisine, noise, sweep
    law: str  # pd, pd+feedforward, computed-torque
    rate: int  # [Hz]
    band: tuple[float, float]  # [Hz]
    loop_hz: float
    seed: int


def drawn(seed: int, count: int) -> list[Session]:
    """So many sessions; equally many of each kind."""
    return [_draw(seed, number) for number in range(count)]


def _draw(seed: int, number: int) -> Session:
    rng = np.random.default_rng([seed, number])
    rate = int(rng.choice([250, 500, 1000, 2000]))
    low, high = ((3.0, 80.0), (4.0, 150.0), (2.0, 220.0))[int(rng.integers(3))]
    high = min(high, 0.4 * rate)
    first = float(rng.uniform(0.2, 1.0))
    inertia = first * np.array([1.0, rng.uniform(1.2, 2.0)])
    other = float(rng.uniform(0.1, 0.3)) * first
    motor = float(rng.uniform(0.15, 0.5)) * first
    antiresonance = float(rng.uniform(3.0 * low, 0.75 * high * np.sqrt(motor / inertia[1])))
    kind = KINDS[number % len(KINDS)]
    stiffness = (2.0 * np.pi * antiresonance) ** 2 * (inertia[0] - motor)
    gap = 0.0
    if kind == "gap":
        stiffness, gap = (2.0 * np.pi * 2.5 * high) ** 2 * motor, float(10.0 ** rng.uniform(-3.6, -2.8))
    damping = 2.0 * float(rng.uniform(0.01, 0.05)) * np.sqrt(stiffness * (inertia[0] - motor))
    base = float(rng.uniform(max(3.0 * low, 10.0), min(0.6 * high, 45.0))), float(rng.uniform(0.02, 0.06)), float(
        rng.uniform(4.0, 12.0)) * first
    return Session(f"{seed}-{number}", kind, inertia, rng.uniform(-0.6, 0.6, 2) * np.sqrt(other * first), other, base,
                   (float(stiffness), float(damping), motor, gap), str(rng.choice(["multisine", "noise", "sweep"])),
                   str(rng.choice(["pd", "pd+feedforward", "computed-torque"])), rate, (low, high), float(rng.uniform(3.0, 8.0)),
                   int(rng.integers(1 << 30)))


def _excitation(s: Session, posture: int, samples: int) -> Array:
    """Torque (samples,) [N m], of which the speed swings by an eighth of the turn."""
    rng = np.random.default_rng([s.seed, posture])
    low, high = s.band
    n = samples if s.excitation == "noise" else 2 * s.rate
    f = np.fft.rfftfreq(n, 1.0 / s.rate)
    inside = (f >= low) & (f <= high)
    spectrum = np.zeros(len(f), dtype=np.complex128)
    count = int(inside.sum())
    if s.excitation == "sweep":  # Schroeder 1970: a flat periodic sweep
        spectrum[inside] = np.exp(-1j * np.pi * np.arange(count) ** 2 / count)
    else:
        spectrum[inside] = np.exp(2j * np.pi * rng.random(count)) * (rng.rayleigh(1.0, count) if s.excitation == "noise" else 1.0)
    v = np.resize(np.fft.irfft(spectrum, n), samples)
    swing = np.sqrt((1.0 / low - 1.0 / high) / (high - low)) / (2.0 * np.pi * s.inertia[posture])
    return np.asarray(v / v.std() * 0.125 * SPEED / swing)


def _reference(rate: int) -> tuple[Array, Array, Array]:
    t = np.arange(round(SECONDS * rate)) / rate
    phase = t % (2.0 * LEG)
    edge = np.minimum(np.minimum(phase % LEG, LEG - phase % LEG) / RAMP, 1.0)
    dq = SPEED * edge * np.where(phase < LEG, 1.0, -1.0)
    return np.cumsum(dq) / rate, dq, np.gradient(dq, 1.0 / rate)


def recorded(sessions: list[Session]) -> list[list[ExperimentLog]]:
    """The logs of both postures of each session; all of one rate."""
    rate = sessions[0].rate
    runs = [(s, p) for s in sessions for p in (0, 1)]
    q_ref, dq_ref, ddq_ref = _reference(rate)
    samples, n = len(q_ref), len(runs)
    inner, j, c, k = -(-INNER // rate), *(np.array([f(s, p) for s, p in runs]) for f in (
        lambda s, p: s.inertia[p], lambda s, p: s.coupling[p], lambda s, p: s.other))
    stiffness, damping, motor, gap = np.array([s.spring for s, _ in runs]).T
    f_b, z_b, i_b = np.array([s.base for s, _ in runs]).T
    k_b = i_b * (2.0 * np.pi * f_b) ** 2
    d_b = 2.0 * z_b * np.sqrt(i_b * k_b)
    mass = np.zeros((n, 4, 4))  # x, q, w, r
    link = j - motor
    mass[:, 0, 0], mass[:, 1, 1], mass[:, 2, 2], mass[:, 3, 3] = i_b + j, j, link, k
    mass[:, 0, 1] = mass[:, 1, 0] = j
    for a in (0, 1):
        mass[:, a, 2] = mass[:, 2, a] = link
    for a in (0, 1, 2):
        mass[:, a, 3] = mass[:, 3, a] = c
    there = np.array([[s.kind == "base", True, s.kind in ("joint", "gap"), True] for s, _ in runs])
    h = 1.0 / (inner * rate)
    lost = np.zeros_like(mass)
    lost[:, 0, 0], lost[:, 2, 2] = d_b, damping
    kick, kept_speed = np.zeros_like(mass), np.zeros_like(mass)
    for i in range(n):
        own = np.ix_(there[i], there[i])
        middle = np.linalg.inv(mass[i][own] + 0.5 * h * lost[i][own])
        kick[i][own], kept_speed[i][own] = h * middle, middle @ (mass[i][own] - 0.5 * h * lost[i][own])
    w = 2.0 * np.pi * np.array([s.loop_hz for s, _ in runs])
    size = np.stack([j, k], axis=1)
    linear = np.array([s.law == "computed-torque" for s, _ in runs])
    ahead = np.array([s.law == "pd+feedforward" for s, _ in runs])
    coulomb, viscous, slow = 0.4 * size, 0.6 * size, 0.02
    v = np.stack([_excitation(s, p, samples) for s, p in runs], axis=1)
    rng = np.random.default_rng(sessions[0].seed)
    wrong = 1.0 + 0.03 * rng.standard_normal(n)
    noise = 0.02 * v.std(axis=0)
    theirs = np.zeros((n, 2, 2))  # of the controller's model
    theirs[:, 0, 0], theirs[:, 1, 1], theirs[:, 0, 1], theirs[:, 1, 0] = wrong * j, wrong * k, wrong * c, wrong * c
    state, speed = np.zeros((n, 4)), np.zeros((n, 4))
    last = np.zeros((n, 2))
    kept = {name: np.zeros((samples, n, 2)) for name in ("q", "tau", "r")}
    for i in range(samples):
        read = np.rint(state[:, [1, 3]] / ENCODER) * ENCODER
        e = read - np.array([q_ref[i], 0.0])
        de = (e - last) * rate if i else np.zeros_like(e)
        last = e
        back = -(w**2)[:, None] * e - (1.4 * w)[:, None] * de
        r = back.copy()
        r[:, 0] += v[i] / j
        told = np.array([dq_ref[i], 0.0])
        friction = coulomb * np.tanh(told / slow) + viscous * told
        tau = size * back
        tau[:, 0] += v[i]
        tau = tau + ahead[:, None] * (0.9 * friction + np.stack([j * ddq_ref[i], c * ddq_ref[i]], axis=1))
        computed = np.einsum("nab,nb->na", theirs, r + np.array([ddq_ref[i], 0.0])) + 0.9 * friction
        tau = np.where(linear[:, None], computed, tau)
        kept["q"][i], kept["tau"][i], kept["r"][i] = read, tau, r + np.array([ddq_ref[i], 0.0])
        drive = tau[:, 0] + noise * rng.standard_normal(n)
        for _ in range(inner):
            state = state + 0.5 * h * speed
            twist = state[:, 2]
            bent = np.where(np.abs(twist) > 0.5 * gap, twist - 0.5 * gap * np.sign(twist), 0.0)
            force = np.empty((n, 4))
            force[:, 0] = -k_b * state[:, 0]
            force[:, 1] = drive - coulomb[:, 0] * np.tanh(speed[:, 1] / slow) - viscous[:, 0] * speed[:, 1]
            force[:, 2] = -stiffness * bent + damping * speed[:, 2] * (bent == 0.0) * (gap > 0.0)
            force[:, 3] = tau[:, 1] - coulomb[:, 1] * np.tanh(speed[:, 3] / slow) - viscous[:, 1] * speed[:, 3]
            speed = np.einsum("nab,nb->na", kept_speed, speed) + np.einsum("nab,nb->na", kick, force)
            state = state + 0.5 * h * speed
    t = np.arange(samples) / rate
    zero = np.zeros(samples)
    logs: list[list[ExperimentLog]] = [[] for _ in sessions]
    for i, (s, p) in enumerate(runs):
        values = {"t": t, "q": kept["q"][:, i], "tau": kept["tau"][:, i], "v": np.stack([v[:, i], zero], axis=1),
                  "q_ref": np.stack([q_ref, zero], axis=1), "dq_ref": np.stack([dq_ref, zero], axis=1),
                  "ddq_ref": np.stack([ddq_ref, zero], axis=1)}
        gains = (size[i] * w[i] ** 2, size[i] * 1.4 * w[i])
        if s.law == "computed-torque":
            values |= {"r": kept["r"][:, i] - values["ddq_ref"], "v": values["v"] / j[i]}
            gains = (np.full(2, w[i] ** 2), np.full(2, 1.4 * w[i]))
        signals = {name: Signal(x, unit_of(name, s.law), SIGNALS[name][1]) for name, x in values.items()}
        about: dict[str, object] = {
            "name": f"{s.name}-{p + 1}", "experiment": "frf", "role": "identify", "origin": "simulated", "robot_name": "two",
            "sample_time": 1.0 / rate, "robot_text": ROBOT, "signals": signals, "joint": 1, "posture": np.array([0.0, 0.5 * p]),
            "controller": Controller(s.law, *gains, velocity="backward-difference", delay=0)}
        logs[i // 2].append(ExperimentLog(**about))  # type: ignore[arg-type]
    return logs


def judged(session: Session, found: Findings) -> str:
    """right, undecided or wrong."""
    said = {one.kind for one in found.classification}
    if session.kind == "gap":
        if said & {"base", "joint", "rigid", "delay"}:
            return "wrong"
        return "right" if any("backlash" in one.candidates for one in found.undecided) else "undecided"
    if said - {session.kind}:
        return "wrong"
    return "right" if said and not found.undecided else "undecided"


def interval(number: int, total: int) -> tuple[float, float]:
    """95 % of a share; Wilson 1927."""
    z, p = 1.96, number / total
    middle, half = p + z * z / (2 * total), z * np.sqrt(p * (1 - p) / total + z * z / (4 * total**2))
    return (middle - half) / (1 + z * z / total), (middle + half) / (1 + z * z / total)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=60)
    given = parser.parse_args()
    sessions = drawn(given.seed, given.count)
    tally: Counter[str] = Counter()
    for rate in sorted({s.rate for s in sessions}):
        alike = [s for s in sessions if s.rate == rate]
        for session, logs in zip(alike, recorded(alike), strict=True):
            found = frf_findings(logs)
            verdict = judged(session, found)
            tally[verdict] += 1
            told = [(one.kind, {name: round(x.value, 4) for name, x in one.parameters.items()}) for one in found.classification]
            print(f"{session.name}: {session.kind}, {session.excitation}, {session.law}, {rate} Hz, {session.band[0]:g} to "
                  f"{session.band[1]:g} Hz: {verdict} {told} {[one.evidence for one in found.undecided]}", flush=True)
    for verdict in ("right", "undecided", "wrong"):
        low, high = interval(tally[verdict], len(sessions))
        print(f"{verdict}: {tally[verdict]} of {len(sessions)}, {low:.2f} to {high:.2f}")


if __name__ == "__main__":
    main()
