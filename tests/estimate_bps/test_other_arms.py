"""Arms of one joint to seven, sliding and turning, and logs of different rates: the parameters of Pinocchio's links come out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pipelines.dynamics.base_parameters import BaseArm
from pipelines.dynamics.rrr import rigid_body
from pipelines.errors import UsageError
from pipelines.estimate_bps import Result, Settings, compute, report
from pipelines.io.files import Opened
from pipelines.io.log import Array, ExperimentLog, Signal
from pipelines.io.robot import format_robot
from pipelines.stage import Inputs
from tests.dynamics.serial_arms import GANTRY, SEVEN, Arm, by_hand, physical_links, pin, table
from tests.seeds import rarely

ENCODER, NOISE = 1e-5, 0.01  # [rad], [N m]
COULOMB, VISCOUS = 1.0, 0.5
TWO = [("revolute", 1.57, 0.3, 0.1, 0.0), ("revolute", 0.0, 0.2, 0.0, 0.0)]

ROWS: dict[str, tuple[str, list[tuple[str, float, float, float, float]]]] = {
    "one turns": ("dh", TWO[:1]), "one slides": ("dh", [("prismatic", 0.4, 0.0, 0.1, 0.0)]),
    "gantry": ("mdh", GANTRY), "seven": ("dh", SEVEN)}


def an_arm(name: str) -> tuple[Arm, Array]:
    """An arm whose links Pinocchio holds, and the standard parameters of these."""
    convention, rows = ROWS.get(name, ("dh", TWO))
    arm = by_hand(table(name, convention, rows))
    phi = physical_links(arm.n, np.random.default_rng(99))
    arm.load(phi)
    return arm, phi


def swing(joints: int, seed: int, base_hz: float, speed: float) -> Callable[[Array], tuple[Array, Array, Array]]:
    """Eight harmonics on every joint."""
    k = 2.0 * np.pi * base_hz * np.arange(1, 9)[:, None]
    a, b = np.random.default_rng(seed).standard_normal((2, 8, joints)) / k

    def path(t: Array) -> tuple[Array, Array, Array]:
        s, c = np.sin(t[:, None] * k.T), np.cos(t[:, None] * k.T)
        return s @ a + c @ b, c @ (k * a) - s @ (k * b), -s @ (k**2 * a) - c @ (k**2 * b)

    scale = speed / np.abs(path(np.arange(0.0, 1.0 / base_hz, 1e-3))[1]).max(axis=0)
    return lambda t: tuple(scale * x for x in path(t))  # type: ignore[return-value]


def recorded(arm: Arm, seed: int = 0, *, sample_time: float = 2e-3, base_hz: float = 0.2, speed: float = 1.5,
             name: str = "log", role: str = "identify", coulomb: float = COULOMB) -> ExperimentLog:
    """10 s; the torque, by Pinocchio, is averaged over each sample."""
    rng, path, data = np.random.default_rng([7, seed]), swing(arm.n, seed, base_hz, speed), arm.model.createData()

    def torque(t: Array) -> Array:
        q, dq, ddq = path(t)
        rigid = np.array([pin.rnea(arm.model, data, *state) for state in zip(arm.offset(q), dq, ddq, strict=True)])
        return np.asarray(rigid + coulomb * np.tanh(100.0 * dq) + VISCOUS * dq)

    t = np.arange(round(10.0 / sample_time)) * sample_time
    tau = np.mean([torque(t + sample_time * (k + 0.5) / 4) for k in range(4)], axis=0)
    counted = ENCODER * np.rint(path(t)[0] / ENCODER)
    signals = {"t": Signal(t, "s", "time stamp"), "q": Signal(counted, "rad", "measured joint position"),
               "tau": Signal(tau + NOISE * rng.standard_normal(tau.shape), "N m", "commanded joint torque")}
    return ExperimentLog(name=name, experiment="excitation", role=role, origin="measured", robot_name=arm.robot.name,
                         sample_time=sample_time, robot_text=format_robot(arm.robot), signals=signals)


def estimated(*logs: ExperimentLog, **settings: object) -> Result:
    opened = tuple(Opened(Path(log.name), "", log, ()) for log in logs)
    return compute(Inputs(opened), Settings(**settings))  # type: ignore[arg-type]


def deviations(found: Result, arm: Arm, phi: Array, coulomb: float = COULOMB) -> Array:
    """(estimate - truth) / std of every parameter."""
    body = rigid_body(arm.robot)
    assert isinstance(body, BaseArm)
    known = dict(zip([p.name for p in body.parameters], body.base.combine @ phi, strict=True))
    friction = {"coulomb": coulomb, "viscous": VISCOUS, "torque_offset": 0.0}
    truth = [known[p.name] if p.name in known else friction[p.name.partition(":")[0]] for p in found.parameters]
    assert not found.unresolved
    return np.array([(p.value - value) / p.std for p, value in zip(found.parameters, truth, strict=True)])  # type: ignore[operator]


@pytest.mark.parametrize("name", ROWS)
def test_any_arm_gives_its_own_parameters(name: str) -> None:
    """Within four standard deviations each, about one in the mean square; forces of a slide are in N."""
    arm, phi = an_arm(name)
    found = estimated(recorded(arm))
    z = deviations(found, arm, phi)
    assert np.abs(z).max() < 4.0
    assert np.sqrt(np.mean(np.square(z))) < 1.5
    assert found.torque_units == tuple("N m" if joint.revolute else "N" for joint in arm.robot.joints)
    unit = {"one turns": "[N m]", "one slides": "[N]", "gantry": "[N or N m]", "seven": "[N m]"}[name]
    (left,) = (section.tables[0] for section in report(found).sections if section.title == "Torque along the experiment")
    assert all(column.endswith(unit) for column in left.columns[1:4])


@pytest.mark.parametrize("role", ["identify", *rarely("validate")])
def test_a_slower_log_beside_a_fast_one(role: str) -> None:
    """1 kHz, whose motion asks for a low-pass above what 50 Hz can hold, beside 50 Hz: both are used, the truth comes out.

    Without Coulomb friction, whose reversals last less than one of the slow samples.
    """
    arm, phi = an_arm("two")
    fast = recorded(arm, 1, sample_time=1e-3, base_hz=0.8, speed=5.0, name="fast", coulomb=0.0)
    slow = recorded(arm, 2, sample_time=2e-2, base_hz=0.1, name="slow", role=role, coulomb=0.0)
    found = estimated(fast, slow)
    assert found.filter_hz is not None
    assert found.filter_hz > 25.0
    assert np.abs(deviations(found, arm, phi, 0.0)).max() < 4.0
    assert found.relative_error["validate"] < 0.01
    assert len(found.courses) == 2
    alone = estimated(fast)
    assert (sum(found.equations) > sum(alone.equations)) == (role == "identify")


def test_a_low_pass_that_would_do_nothing_is_not_accepted() -> None:
    """--cutoff-hz at 0.45 of the rate: refused, instead of reported and left out."""
    arm, _ = an_arm("two")
    with pytest.raises(UsageError, match=r"C02 .*below 0.4 of the rate, 200 Hz"):
        estimated(recorded(arm), cutoff_hz=225.0)


def test_symmetric_links_are_the_papers() -> None:
    """p4 = p15 = 0 says nothing of another arm."""
    arm, _ = an_arm("two")
    with pytest.raises(UsageError, match="--symmetric"):
        estimated(recorded(arm), symmetric=True)
