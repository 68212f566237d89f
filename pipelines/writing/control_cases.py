"""Compare six controllers on the writing task by the error of the tip.

    1  PD alone, eq. (23); and with parts of the model's torque on the reference ahead, eq. (24):
    2  friction   3  friction, inertia   4  friction, Coriolis   5  friction, gravity   6  all

Kostić et al. 2004, Section IV.C.5, Table IV, Figs. 15 and 16: the standard deviation of the tip's
error over the task, in x, y, z. Cases that were not recorded are simulated on the controller of a
log: the plant is the fitted model plus the residual of that log, replayed over time, and the
controller's model another draw of the same fit, or case 6 would be perfect by construction.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.dynamics.body import Motion
from pipelines.dynamics.draw import drawn
from pipelines.dynamics.kinematics import serial_chain, tip_position
from pipelines.effects.base import Hooks
from pipelines.errors import InputRejected
from pipelines.estimation.motion import Reconstructed
from pipelines.io.log import Array, ExperimentLog
from pipelines.simulation.closed_loop import run
from pipelines.simulation.experiment import Experiment
from pipelines.simulation.plant import Plant
from pipelines.simulation.step import choose_step
from pipelines.writing.config import CONFIG

__all__ = [
    "CASES",
    "Case",
    "TipStd",
    "TipTrack",
    "case_of",
    "measured_cases",
    "one_task",
    "possible",
    "simulated_cases",
    "tip_std",
    "why_not",
]

CASES: tuple[tuple[str, ...], ...] = (
    (),
    ("friction",),
    ("friction", "inertia"),
    ("friction", "coriolis"),
    ("friction", "gravity"),
    ("friction", "inertia", "coriolis", "gravity"),
)


@dataclass(frozen=True)
class TipStd:
    """Standard deviation of the tip's error [m] along the base frame's axes."""

    x: float
    y: float
    z: float

    @property
    def values(self) -> tuple[float, float, float]:
        return self.x, self.y, self.z


@dataclass(frozen=True)
class TipTrack:
    """The tip as wanted and as executed, thinned; (points, 3) [m]."""

    wanted: Array
    executed: Array


@dataclass(frozen=True)
class Case:
    """One of the six."""

    case: int  # 1 to 6
    feedforward: tuple[str, ...]
    tip_error_std: TipStd
    tip_error_std_spread: TipStd | None  # standard deviation over the drawn models
    origin: str  # "measured" | "simulated"
    logs: tuple[str, ...]  # measured: which; simulated: on whose controller
    track: TipTrack | None


def case_of(log: ExperimentLog) -> int | None:
    """Return which of the six cases a log's controller is; None for any other."""
    if log.controller is None or log.controller.law not in ("pd", "pd+feedforward"):
        return None
    parts = () if log.controller.law == "pd" else log.controller.feedforward
    if parts is None:
        return None
    return next((k for k, case in enumerate(CASES, 1) if set(case) == set(parts)), None)


def tip_std(log: ExperimentLog, q: Array) -> Array:
    """Return the standard deviation (3,) [m] of the tip's error along q (samples, joints)."""
    chain = serial_chain(log.robot)
    return np.asarray(np.std(tip_position(chain, q) - tip_position(chain, log["q_ref"]), axis=0))


def one_task(logs: Sequence[ExperimentLog], like: ExperimentLog) -> list[ExperimentLog]:
    """Return those of `logs` with the robot, the reference and the gains of `like`."""
    return [
        log
        for log in logs
        if log.robot_text == like.robot_text
        and _same_reference(log, like)
        and _same_gains(log, like)
    ]


def _same_reference(one: ExperimentLog, two: ExperimentLog) -> bool:
    """Return whether both follow one reference, counted from where it sets out."""
    if not np.isclose(one.sample_time, two.sample_time, rtol=1e-9, atol=0.0):
        return False
    a, b = one["q_ref"], two["q_ref"]
    first, second = (
        int(np.argmax((np.abs(q - q[0]) > CONFIG.same_reference).any(axis=1))) for q in (a, b)
    )
    a, b = a[max(0, first - second) :], b[max(0, second - first) :]
    shared = min(len(a), len(b))
    if shared < CONFIG.shared * max(one.n_samples, two.n_samples):
        return False
    return bool(np.abs(a[:shared] - b[:shared]).max() <= CONFIG.same_reference)


def _same_gains(one: ExperimentLog, two: ExperimentLog) -> bool:
    a, b = one.controller, two.controller
    if a is None or b is None:
        return a is b
    gains = ((a.kp, b.kp), (a.kd, b.kd), (a.ki, b.ki))
    return all(
        x is y if x is None or y is None else np.allclose(x, y, rtol=1e-9, atol=0.0)
        for x, y in gains
    )


def measured_cases(pairs: Sequence[tuple[ExperimentLog, Reconstructed]]) -> dict[int, Case]:
    """Return the cases that logs of one task show; the mean square of several of one case."""
    by_case: dict[int, list[tuple[ExperimentLog, Array]]] = {}
    for log, motion in pairs:
        if (case := case_of(log)) is not None:
            by_case.setdefault(case, []).append((log, motion.motion.q))
    return {case: _case(case, some, "measured") for case, some in sorted(by_case.items())}


def _case(case: int, runs: Sequence[tuple[ExperimentLog, Array]], origin: str) -> Case:
    """Pool the runs of one case; those of a simulation also give a spread."""
    each = np.array([tip_std(log, q) for log, q in runs])
    log, q = runs[0]
    chain, rows = serial_chain(log.robot), slice(None, None, -(-len(q) // CONFIG.track_points))
    track = TipTrack(tip_position(chain, log["q_ref"][rows]), tip_position(chain, q[rows]))
    spread = None
    if origin == "simulated" and len(runs) > 1:
        spread = TipStd(*each.std(axis=0, ddof=1).tolist())
    pooled = TipStd(*np.sqrt(np.mean(each**2, axis=0)).tolist())
    names = [log.name for log, _ in runs]
    logs = tuple(names if origin == "measured" else names[:1])
    return Case(case, CASES[case - 1], pooled, spread, origin, logs, track)


def why_not(log: ExperimentLog) -> str:
    """Return why no case can be simulated on this log's controller; empty where one can."""
    if log.controller is not None and log.controller.law not in ("pd", "pd+feedforward", "unknown"):
        return f"its controller, {log.controller.law}, is not PD with or without feed-forward"
    try:
        Experiment.of_log(log)
    except InputRejected as lacking:
        return lacking.message
    return ""


def possible(log: ExperimentLog, cases: Iterable[int]) -> tuple[list[int], str]:
    """Return those of `cases` whose feed-forward the log's references give, and why not all."""
    cases = list(cases)
    some = [case for case in cases if "ddq_ref" in log or "inertia" not in CASES[case - 1]]
    lacking = ", ".join(str(case) for case in cases if case not in some)
    if not lacking:
        return some, ""
    return some, (
        f"cases {lacking} would have inertia ahead, and {log.name} has no signal ddq_ref; log it"
    )


def simulated_cases(
    log: ExperimentLog, arm: Arm, residual: Array, cases: Sequence[int], draws: int, seed: int
) -> dict[int, Case]:
    """Simulate `cases` on the PD controller and the reference of `log`.

    Args:
        residual: measured minus modelled torque of that log (samples, joints) [N m], low-passed.
        draws: how many models the controller runs on in turn, drawn with `seed`.

    Raises:
        InputRejected: D15, D17, the model cannot be simulated.
    """
    experiment = Experiment.of_log(log)
    controller = replace(experiment.controller, law="pd", feedforward=None, model=None)
    experiment = replace(experiment, controller=controller, feedforward_arm=None)
    plant = Plant.of(arm)
    plant = replace(plant, hooks=(*plant.hooks, _replayed(residual, experiment)))
    step = choose_step(plant, experiment)
    ahead, owners = _feedforward(experiment, arm, cases, draws, seed)
    v = ahead if experiment.v is None else ahead + experiment.v[..., None]
    done = run(
        plant, replace(experiment, v=v), step.per_sample, None, range(len(owners)), step.exact
    )
    return {
        case: _case(
            case,
            [(log, done.true_q[k]) for k, owner in enumerate(owners) if owner == case],
            "simulated",
        )
        for case in cases
    }


def _replayed(residual: Array, experiment: Experiment) -> Hooks:
    """Return `residual` as a load over time, linear between samples."""
    last = len(residual) - 2

    def load(motion: Motion, states: Array) -> Array:
        del states
        place = (float(motion.t[0]) - experiment.start_time) / experiment.sample_time
        k = min(max(int(place), 0), last)
        share = min(max(place - k, 0.0), 1.0)
        return np.asarray((1.0 - share) * residual[k : k + 1] + share * residual[k + 1 : k + 2])

    return Hooks(load=load)


def _feedforward(
    experiment: Experiment, arm: Arm, cases: Sequence[int], draws: int, seed: int
) -> tuple[Array, list[int]]:
    """Return the feed-forward (samples, joints, replicas) [N m], and each replica's case.

    Case 1 is simulated once, the others with every draw.
    """
    t = experiment.start_time + experiment.sample_time * np.arange(
        experiment.n_samples, dtype=np.float64
    )
    motion = Motion(t, experiment.q_ref, experiment.dq_ref, experiment.ddq_ref)
    rng = np.random.default_rng([24, seed])
    models = [drawn(arm, rng).nominal.torque_parts(motion) for _ in range(draws)]
    columns, owners = [], []
    for case in cases:
        for parts in models if CASES[case - 1] else models[:1]:
            torque = sum(
                (getattr(parts, name) for name in CASES[case - 1]), np.zeros(experiment.q_ref.shape)
            )
            columns.append(torque)
            owners.append(case)
    return np.stack(columns, axis=-1), owners
