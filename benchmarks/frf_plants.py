"""Three plants whose frequency responses are recorded: equations, arms in MuJoCo, the test bench.

    logs = recorded([session, …])          those of both postures of each session

"equations"  two coupled joints of which one is excited, on a base; x turns the base, q the motor, w
             twists the joint, r is the other joint; position Verlet at 8 kHz or more

    T = ½ I ẋ² + ½ J_m (ẋ + q̇)² + ½ [ẋ + q̇ + ẇ, ṙ] [[J - J_m, c], [c, k]] [ẋ + q̇ + ẇ, ṙ]ᵀ

"arms"       those of benchmarks.other_plants, two to six axes, with a rotor before a spring or gap,
             and a base; Runge-Kutta 4
"bench"      the machines of bench, at its 1 kHz
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from bench.control import ComputedTorque, Decentralised, FeedForward, Observer, Step
from bench.draw import draw_machine
from bench.dynamics import RigidDynamics, motor_share, typical_inertia
from bench.experiments import Experiment, frf_postures
from bench.faults.structure import Backlash, BaseResonance, JointElasticity
from bench.machine import Case as FaultCase
from bench.machine import Fault, Machine
from bench.motions import Reference, turning
from bench.plant import record
from benchmarks.other_plants.arms import ARMS, Arm
from benchmarks.other_plants.friction import Friction
from pipelines.io import schema
from pipelines.io.log import Array, Controller, ExperimentLog, Signal
from pipelines.io.robot import format_robot
from sample_logs.bench_session import controllers_model

PLANTS = ("equations", "arms", "bench")
KINDS = ("rigid", "base", "joint", "gap")
SECONDS, SPEED, LEG, RAMP = 24.0, 0.4, 6.0, 0.3
ENCODER = 1e-5  # [rad]
_INNER = 8000  # [Hz] at least
_SWING = 0.125  # of the speed of the turn, by the excitation
_TWO = (
    'name = "two"\ngravity = [0.0, 0.0, -9.81]\n[kinematics]\nconvention = "dh"\n'
    "tool = [0.0, 0.0, 0.0]\n"
) + "".join(
    f'[[joint]]\nname = "{name}"\ntype = "revolute"\na = 0.3\nalpha = 0.0\nd = 0.0\noffset = 0.0\n'
    f"position = [-inf, inf]\nvelocity = 6.0\nacceleration = 60.0\ntorque = 200.0\n"
    f"encoder_resolution = {ENCODER}\n"
    for name in ("first", "second")
)
_EXCITED = {"table": (1,), "planar": (1,), "upright": (1, 2), "scara": (1,), "six": (1, 2)}


@dataclass(frozen=True)
class Session:
    """One recording of an arm; its plant draws the numbers of the machine from `seed`."""

    name: str
    plant: str
    kind: str
    excitation: str  # multisine, noise, sweep
    law: str  # pd, pd+feedforward, computed-torque
    rate: int  # [Hz]
    band: tuple[float, float]  # [Hz] of v
    loop_hz: float
    seed: int

    @property
    def known(self) -> tuple[float, float]:
        """Band [Hz] of v up to .3 of the rate, where modes are fitted."""
        return self.band[0], min(self.band[1], 0.3 * self.rate)

    def antiresonance(self, rng: np.random.Generator, share: float) -> float:
        """[Hz] of a link whose motor has `share` of the inertia; both modes inside the band."""
        high = 0.75 * self.known[1] * np.sqrt(share)
        return float(rng.uniform(min(3.0 * self.band[0], 0.7 * high), high))

    def base(self, rng: np.random.Generator) -> tuple[float, float]:
        """Frequency [Hz] and damping ratio."""
        high = min(0.6 * self.known[1], 45.0)
        return float(rng.uniform(min(max(3.0 * self.band[0], 10.0), 0.7 * high), high)), float(
            rng.uniform(0.02, 0.06)
        )


def recorded(sessions: list[Session]) -> list[list[ExperimentLog]]:
    """Return the logs of both postures of each session, all of one plant and rate."""
    if sessions[0].plant == "equations":
        return _equations(sessions)
    return [(_arm if one.plant == "arms" else _bench)(one) for one in sessions]


def _excitation(s: Session, posture: int, samples: int, inertia: float, speed: float) -> Array:
    """Torque (samples,) [N m], of which the speed swings by an eighth of the turn's."""
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
        size = rng.rayleigh(1.0, count) if s.excitation == "noise" else 1.0
        spectrum[inside] = np.exp(2j * np.pi * rng.random(count)) * size
    v = np.resize(np.fft.irfft(spectrum, n), samples)
    swing = np.sqrt((1.0 / low - 1.0 / high) / (high - low)) / (2.0 * np.pi * inertia)
    return np.asarray(v / v.std() * _SWING * speed / swing)


def _reference(rate: int) -> tuple[Array, Array, Array]:
    t = np.arange(round(SECONDS * rate)) / rate
    phase = t % (2.0 * LEG)
    edge = np.minimum(np.minimum(phase % LEG, LEG - phase % LEG) / RAMP, 1.0)
    dq = SPEED * edge * np.where(phase < LEG, 1.0, -1.0)
    return np.cumsum(dq) / rate, dq, np.gradient(dq, 1.0 / rate)


def _log(
    s: Session, place: int, values: dict[str, Array], controller: Controller, **about: Any
) -> ExperimentLog:
    """Return the log of posture `place`; `about` has robot_name, robot_text, joint and posture."""
    signals = {
        name: Signal(x, schema.unit_of(name, s.law), schema.SIGNALS[name][1])
        for name, x in values.items()
    }
    return ExperimentLog(
        name=f"{s.name}-{place + 1}",
        experiment="frf",
        role="identify",
        origin="simulated",
        sample_time=1.0 / s.rate,
        signals=signals,
        controller=controller,
        **about,
    )


def _controller(s: Session, inertia: Array) -> Controller:
    """Return the gains of w², 1.4 w, in torque where they are no accelerations."""
    w, unit = 2.0 * np.pi * s.loop_hz, np.ones_like(inertia)
    size = unit if s.law == "computed-torque" else inertia
    return Controller(s.law, size * w**2, size * 1.4 * w, velocity="backward-difference", delay=0)


@dataclass(frozen=True, eq=False)
class _Two:
    """Two coupled joints on a base, one row a run: two runs a session."""

    inertia: Array  # J (runs,) [kg m^2] of the excited joint
    coupling: Array  # c
    other: Array  # k
    base: Array  # I [kg m^2], k_b [N m/rad], d_b [N m s/rad] (runs, 3)
    spring: Array  # k [N m/rad], d [N m s/rad], J_m [kg m^2], gap [rad] (runs, 4)
    there: Array  # which of x, q, w, r move (runs, 4)

    @classmethod
    def drawn(cls, sessions: list[Session]) -> _Two:
        return cls(
            *(np.array(x) for x in zip(*(own for s in sessions for own in cls._of(s)), strict=True))
        )

    @staticmethod
    def _of(s: Session) -> list[tuple[Any, ...]]:
        rng = np.random.default_rng([s.seed, 9])
        first = float(rng.uniform(0.2, 1.0))
        inertia = first * np.array([1.0, rng.uniform(1.2, 2.0)])
        other, motor = rng.uniform(0.1, 0.3) * first, rng.uniform(0.15, 0.5) * first
        coupling = rng.uniform(-0.6, 0.6, 2) * np.sqrt(other * first)
        link, gap = inertia[0] - motor, 0.0
        stiffness = (2.0 * np.pi * s.antiresonance(rng, motor / inertia[1])) ** 2 * link
        if s.kind == "gap":
            stiffness = (2.0 * np.pi * 2.5 * s.band[1]) ** 2 * motor
            gap = float(10.0 ** rng.uniform(-3.6, -2.8))
        damping = 2.0 * float(rng.uniform(0.01, 0.05)) * np.sqrt(stiffness * link)
        hertz, ratio = s.base(rng)
        heavy = rng.uniform(4.0, 12.0) * first
        w = 2.0 * np.pi * hertz
        there = (s.kind == "base", True, s.kind in ("joint", "gap"), True)
        return [
            (
                j,
                c,
                other,
                (heavy, heavy * w**2, 2.0 * ratio * w * heavy),
                (stiffness, damping, motor, gap),
                there,
            )
            for j, c in zip(inertia, coupling, strict=True)
        ]

    def steps(self, h: float) -> tuple[Array, Array]:
        """By what a force and a speed (4,) become the speed after h [s], damping at its
        midpoint.
        """
        n, link = len(self.inertia), self.inertia - self.spring[:, 2]
        mass, lost = np.zeros((n, 4, 4)), np.zeros((n, 4, 4))  # x, q, w, r
        mass[:, 0, 0], mass[:, 1, 1] = self.base[:, 0] + self.inertia, self.inertia
        mass[:, 2, 2], mass[:, 3, 3] = link, self.other
        mass[:, 0, 1] = mass[:, 1, 0] = self.inertia
        mass[:, :2, 2] = mass[:, 2, :2] = link[:, None]
        mass[:, :3, 3] = mass[:, 3, :3] = self.coupling[:, None]
        lost[:, 0, 0], lost[:, 2, 2] = self.base[:, 2], self.spring[:, 1]
        kick, kept = np.zeros_like(mass), np.zeros_like(mass)
        for i, there in enumerate(self.there):
            own = np.ix_(there, there)
            middle = np.linalg.inv(mass[i][own] + 0.5 * h * lost[i][own])
            kick[i][own], kept[i][own] = (
                h * middle,
                middle @ (mass[i][own] - 0.5 * h * lost[i][own]),
            )
        return kick, kept

    def forces(
        self, state: Array, speed: Array, tau: Array, drive: Array, friction: Array
    ) -> Array:
        """Return the forces (runs, 4) [N m]."""
        stiffness, damping, _, gap = self.spring.T
        twist = state[:, 2]
        bent = np.where(np.abs(twist) > 0.5 * gap, twist - 0.5 * gap * np.sign(twist), 0.0)
        open_ = (bent == 0.0) & (gap > 0.0)
        return np.stack(
            [
                -self.base[:, 1] * state[:, 0],
                drive - friction[:, 0],
                -stiffness * bent + damping * speed[:, 2] * open_,
                tau[:, 1] - friction[:, 1],
            ],
            axis=1,
        )


def _equations(sessions: list[Session]) -> list[list[ExperimentLog]]:
    rate, two = sessions[0].rate, _Two.drawn(sessions)
    q_ref, dq_ref, ddq_ref = (np.stack([x, np.zeros_like(x)], axis=1) for x in _reference(rate))
    samples, runs = len(q_ref), [(s, p) for s in sessions for p in (0, 1)]
    v = np.stack(
        [_excitation(s, p, samples, j, SPEED) for (s, p), j in zip(runs, two.inertia, strict=True)],
        axis=1,
    )
    tau_of = _two_laws([s for s, _ in runs], two)
    kept = {name: np.zeros((samples, len(runs), 2)) for name in ("q", "tau", "r")}
    size = np.stack([two.inertia, two.other], axis=1)
    rng, noise = np.random.default_rng(sessions[0].seed), 0.02 * v.std(axis=0)
    inner = -(-_INNER // rate)
    kick, kept_speed = two.steps(1.0 / (inner * rate))
    state, speed, last, half = *np.zeros((2, len(runs), 4)), None, 0.5 / (inner * rate)
    for i in range(samples):
        read = np.rint(state[:, [1, 3]] / ENCODER) * ENCODER
        e = read - q_ref[i]
        de = np.zeros_like(e) if last is None else (e - last) * rate
        last = e
        tau, r = tau_of(e, de, v[i], dq_ref[i], ddq_ref[i])
        kept["q"][i], kept["tau"][i], kept["r"][i] = read, tau, r
        drive = tau[:, 0] + noise * rng.standard_normal(len(runs))
        for _ in range(inner):
            state = state + half * speed
            turned = speed[:, [1, 3]]
            friction = size * (0.4 * np.tanh(turned / 0.02) + 0.6 * turned)
            force = two.forces(state, speed, tau, drive, friction)
            speed = (kept_speed @ speed[..., None] + kick @ force[..., None])[..., 0]
            state = state + half * speed
    logs: list[list[ExperimentLog]] = [[] for _ in sessions]
    for i, (s, p) in enumerate(runs):
        values = {
            "t": np.arange(samples) / rate,
            "q": kept["q"][:, i],
            "tau": kept["tau"][:, i],
            "v": np.stack([v[:, i], np.zeros(samples)], axis=1),
            "q_ref": q_ref,
            "dq_ref": dq_ref,
            "ddq_ref": ddq_ref,
        }
        if s.law == "computed-torque":
            values |= {"r": kept["r"][:, i], "v": values["v"] / two.inertia[i]}
        about = {"robot_name": "two", "robot_text": _TWO, "joint": 1}
        about["posture"] = np.array([0.0, 0.5 * p])
        logs[i // 2].append(_log(s, p, values, _controller(s, size[i]), **about))
    return logs


def _two_laws(runs: list[Session], two: _Two) -> Callable[..., tuple[Array, Array]]:
    """τ and r (runs, 2) of e, ė (runs, 2), v (runs,), and the reference's speed and
    acceleration.
    """
    w = 2.0 * np.pi * np.array([[s.loop_hz] for s in runs])
    size = np.stack([two.inertia, two.other], axis=1)
    linear = np.array([[s.law == "computed-torque"] for s in runs])
    ahead = np.array([[s.law == "pd+feedforward"] for s in runs])
    wrong = 1.0 + 0.03 * np.random.default_rng(runs[0].seed).standard_normal(len(runs))
    theirs = wrong[:, None, None] * np.array(
        [[[j, c], [c, k]] for j, c, k in zip(two.inertia, two.coupling, two.other, strict=True)]
    )
    across = np.stack([two.inertia, two.coupling], axis=1)

    def law(e: Array, de: Array, v: Array, dq: Array, ddq: Array) -> tuple[Array, Array]:
        back = -(w**2) * e - 1.4 * w * de
        r = back + np.stack([v / two.inertia, np.zeros_like(v)], axis=1)
        friction = 0.9 * size * (0.4 * np.tanh(dq / 0.02) + 0.6 * dq)
        tau = size * back + ahead * (friction + across * ddq[0])
        tau[:, 0] += v
        computed = (theirs @ (r + ddq)[..., None])[..., 0] + friction
        return np.where(linear, computed, tau), r

    return law


@dataclass(frozen=True, eq=False)
class _Soft:
    """An arm in MuJoCo with a compliant base or joint."""

    model: Any
    places: Array  # of the joints' angles among all
    twist: int | None  # place of the angle between rotor and link
    stiffness: float = 0.0  # [N m/rad]; of a gap that is closed
    damping: float = 0.0
    gap: float = 0.0  # [rad]

    def run(
        self,
        law: Callable[..., tuple[Array, Array]],
        friction: Friction,
        start: Array,
        path: tuple[Array, Array, Array],
        noise: Array,
        rng: np.random.Generator,
        substeps: int,
    ) -> dict[str, Array]:
        """q, tau, r (samples, joints) along `path`."""
        data, at = mujoco.MjData(self.model), self.places
        data.qpos[at] = start
        kept = {name: np.zeros_like(path[0]) for name in ("q", "tau", "r")}
        drive = np.zeros(len(at))

        def passive(model: Any, now: Any) -> None:
            v = now.qvel[at]
            now.qfrc_passive[at] += drive - friction.dry(v) - friction.viscous * v
            if self.twist is not None:
                x = now.qpos[self.twist]
                if abs(x) > 0.5 * self.gap:
                    now.qfrc_passive[self.twist] -= (
                        self.stiffness * (x - np.copysign(0.5 * self.gap, x))
                        + self.damping * now.qvel[self.twist]
                    )

        mujoco.set_mjcb_passive(passive)
        try:
            for k in range(len(path[0])):
                kept["q"][k] = ENCODER * np.rint(data.qpos[at] / ENCODER)
                kept["tau"][k], kept["r"][k] = law(k, kept["q"][k])
                drive[:] = kept["tau"][k] + noise * rng.standard_normal(len(at))
                mujoco.mj_step(self.model, data, substeps)
        finally:
            mujoco.set_mjcb_passive(None)
        return kept


def _arm(s: Session) -> list[ExperimentLog]:
    rng = np.random.default_rng([s.seed, 9])
    arm = ARMS[str(rng.choice(sorted(_EXCITED)))].varied(rng)
    joint = 1 if s.kind == "base" else int(rng.choice(_EXCITED[arm.name]))
    rigid = arm.model(1e-3)
    postures = _unlike(arm, rigid, joint - 1, rng)
    mass = np.array([_mass(rigid, q) for q in postures])
    own = mass[:, joint - 1, joint - 1]
    soft, substeps = _softened(s, arm, joint - 1, own, rng)
    size = np.diag(mass[0])
    slow = np.full(len(size), float(rng.uniform(0.01, 0.03)))
    friction = Friction(
        str(rng.choice(["tanh", "root", "arctan"])),
        rng.uniform(0.2, 1.0) * size,
        rng.uniform(0.3, 1.0) * size,
        slow,
        slow,
    )
    wrong = arm.model(1e-3, scale=1.0 + 0.03 * float(rng.standard_normal()))
    robot = arm.described((ENCODER,) * len(size), np.ceil(60.0 * size + 20.0), True)
    logs = []
    for p, posture in enumerate(postures):
        path = tuple(np.zeros((len(x), len(size))) for x in _reference(s.rate))
        for full, x in zip(path, _reference(s.rate), strict=True):
            full[:, joint - 1] = x
        path = (path[0] + posture, *path[1:])
        v = np.zeros_like(path[0])
        v[:, joint - 1] = _excitation(s, p, len(v), own[p], SPEED)
        noise = np.where(np.arange(len(size)) == joint - 1, 0.02 * v[:, joint - 1].std(), 0.0)
        if s.law == "computed-torque":
            v /= own[p]
        law = _law(s, wrong, size, friction, path, v)
        values = soft.run(law, friction, posture, path, noise, rng, substeps)
        values |= {
            "t": np.arange(len(v)) / s.rate,
            "v": v,
            "q_ref": path[0],
            "dq_ref": path[1],
            "ddq_ref": path[2],
        }
        if s.law != "computed-torque":
            del values["r"]
        logs.append(
            _log(
                s,
                p,
                values,
                _controller(s, size),
                robot_name=robot.name,
                robot_text=format_robot(robot),
                joint=joint,
                posture=posture,
            )
        )
    return logs


def _law(
    s: Session,
    model: Any,
    size: Array,
    friction: Friction,
    path: tuple[Array, Array, Array],
    v: Array,
) -> Callable[[int, Array], tuple[Array, Array]]:
    """τ and r (joints,) at sample k from the angles as read; `model` is the controller's own."""
    w, data, before = 2.0 * np.pi * s.loop_hz, mujoco.MjData(model), np.zeros((2, len(size)))
    out = np.zeros(len(size))

    def inverse(q: Array, dq: Array, ddq: Array) -> Array:
        """Without `mj_forward`, which would call back the plant's friction."""
        data.qpos[:], data.qvel[:], data.qacc[:] = q, dq, ddq
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 1, out)
        return out + model.dof_armature * ddq

    def law(k: int, q: Array) -> tuple[Array, Array]:
        q_ref, dq_ref, ddq_ref = (x[k] for x in path)
        e = q - q_ref
        de = np.zeros_like(e) if k == 0 else (e - before[0]) * s.rate
        before[0] = e
        back = -(w**2) * e - 1.4 * w * de
        known = 0.9 * (friction.dry(dq_ref) + friction.viscous * dq_ref)
        if s.law == "computed-torque":
            return inverse(q, dq_ref, ddq_ref + back + v[k]) + known, back + v[k]
        ahead = inverse(q_ref, dq_ref, ddq_ref) + known if s.law == "pd+feedforward" else 0.0
        return np.asarray(size * back + v[k] + ahead), back

    return law


def _mass(model: Any, q: Array) -> Array:
    data, mass = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, mass)
    return mass


def _unlike(arm: Arm, model: Any, j: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Of twenty postures the two whose inertia about joint `j` differs most."""
    home, reach = np.array([(axis.home, axis.reach) for axis in arm.axes]).T
    tried = home + rng.uniform(-1.0, 1.0, (20, len(home))) * reach
    tried[:, : j + 1] = home[: j + 1]
    order = np.argsort([_mass(model, q)[j, j] for q in tried])
    return tried[order[0]], tried[order[-1]]


def _softened(
    s: Session, arm: Arm, j: int, inertia: Array, rng: np.random.Generator
) -> tuple[_Soft, int]:
    """Return the compliant arm and its steps a sample; `inertia` about its joint in both
    postures.
    """
    motor = arm.axes[j].rotor
    link, fastest = float(inertia.min()) - motor, 0.0
    spec = arm.spec()
    bodies, twist, stiffness, damping, gap = [spec.worldbody.first_body()], None, 0.0, 0.0, 0.0
    while (inner := bodies[-1].first_body()) is not None:
        bodies.append(inner)
    for k, body in enumerate(bodies):
        body.first_joint().name = f"axis {k + 1}"
    if s.kind in ("joint", "gap"):
        share = motor / float(inertia.max())
        stiffness = (2.0 * np.pi * s.antiresonance(rng, share)) ** 2 * link
        damping = 2.0 * float(rng.uniform(0.01, 0.05)) * np.sqrt(stiffness * link)
        if s.kind == "gap":
            stiffness = (2.0 * np.pi * 2.5 * s.band[1]) ** 2 * motor
            damping = 0.2 * np.sqrt(stiffness * motor)
            gap = float(10.0 ** rng.uniform(-3.6, -2.8))
        fastest = np.sqrt(stiffness * (1.0 / motor + 1.0 / link))
        hinge = bodies[j].first_joint()
        hinge.name, hinge.armature = "twist", 0.0
        bodies[j].add_joint(
            type=mujoco.mjtJoint.mjJNT_HINGE, axis=hinge.axis, name=f"axis {j + 1}", armature=motor
        )
    if s.kind == "base":
        hertz, ratio = s.base(rng)
        heavy = float(rng.uniform(4.0, 12.0) * inertia.min())
        w = 2.0 * np.pi * hertz
        bodies[0].add_joint(
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=bodies[0].first_joint().axis,
            name="base",
            armature=heavy,
            stiffness=heavy * w**2,
            damping=2.0 * ratio * w * heavy,
        )
        fastest = 2.0 * w
    substeps = max(int(np.ceil(2000 / s.rate)), int(np.ceil(2.0 * fastest / s.rate)))
    spec.option.timestep = 1.0 / (s.rate * substeps)
    model = spec.compile()
    places = np.array([model.joint(f"axis {k + 1}").qposadr[0] for k in range(len(bodies))])
    if s.kind in ("joint", "gap"):
        twist = int(model.joint("twist").qposadr[0])
    return _Soft(model, places, twist, stiffness, damping, gap), substeps


@dataclass(frozen=True, eq=False)
class _Injected:
    """A law of the bench with v added to its torque."""

    law: Decentralised | FeedForward
    v: Array  # (samples, n) [N m]

    def describe(self, machine: Machine) -> Controller:
        return self.law.describe(machine)

    def start(self, machine: Machine, reference: Reference) -> tuple[Step, dict[str, Array]]:
        inner, extras = self.law.start(machine, reference)
        v = self.v.tolist()

        def step(k: int, q: list[float], observer: Observer) -> list[float]:
            return [a + b for a, b in zip(inner(k, q, observer), v[k], strict=True)]

        return step, {**extras, "v": self.v}


def _bench(s: Session) -> list[ExperimentLog]:
    rng = np.random.default_rng([s.seed, 9])
    machine = draw_machine(int(rng.integers(1 << 20)), "paper")
    joint = 1 if s.kind == "base" else int(rng.integers(1, 4))
    bent, straight, between = frf_postures(machine)
    postures = (bent, straight) if joint != 3 else (bent, between)
    model, faults = controllers_model(machine), _bench_faults(s, machine, joint, rng)
    w = 2.0 * np.pi * s.loop_hz
    experiments = []
    for p, posture in enumerate(postures):
        reference = turning(machine, joint, posture, SECONDS)
        inertia = float(RigidDynamics(machine.robot).mass_matrix(posture)[joint - 1, joint - 1])
        v = np.zeros_like(reference.q)
        v[:, joint - 1] = _excitation(s, p, len(v), inertia, float(np.abs(reference.dq).max()))
        law: Any = {
            "pd": lambda v=v: _Injected(Decentralised("backward-difference", 0.3), v),
            "pd+feedforward": lambda v=v: _Injected(
                FeedForward(model, velocity="backward-difference", stiffness=0.3), v
            ),
            "computed-torque": lambda v=v, j=inertia: ComputedTorque(
                model, v / j, (w**2,) * machine.n, (1.4 * w,) * machine.n
            ),
        }[s.law]()
        experiments.append(
            Experiment(f"{s.name}-{p + 1}", "frf", reference, law, joint=joint, posture=posture)
        )
    return record(machine, faults, experiments, seed=s.seed % 100_000)


def _bench_faults(
    s: Session, machine: Machine, joint: int, rng: np.random.Generator
) -> tuple[Fault, ...]:
    if s.kind == "rigid":
        return ()
    if s.kind == "base":
        heavy = float(rng.uniform(8.0, 27.0)) * max(machine.torque_limit) / 60.0
        return (BaseResonance(None, *s.base(rng), heavy),)
    if s.kind == "gap":
        case = FaultCase(machine, joint, rng, (1.0,) * machine.n)
        return (Backlash.full(case).scaled(float(rng.uniform(0.1, 1.0))),)
    motor = motor_share(machine.robot, joint - 1)
    inertia = typical_inertia(machine.robot)[joint - 1]
    link = inertia - motor
    stiffness = (2.0 * np.pi * s.antiresonance(rng, motor / inertia)) ** 2 * link
    damping = 2.0 * float(rng.uniform(0.01, 0.05)) * np.sqrt(stiffness * link)
    return (JointElasticity(joint, float(stiffness), float(damping), motor, link),)
