"""What holds for every effect in the folder. A new file inherits all of these tests."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.body import Array, Motion
from pipelines.effects import all_effects, effect_names
from pipelines.effects.base import Effect, FrictionLaw, adds, everywhere
from pipelines.effects.parameters import causes
from sample_logs.make_model import synthetic_arm

UNITS = {"1", "1/rev", "Hz", "s", "s/rad", "rad", "rad/s", "m", "kg", "kg m", "kg m^2", "N", "N m", "N m s/rad",
         "N m/rad", "N m/rad^2", "N m/rad^3", "N m/rad^4",
         "N m/rad^5", "N m/rad^6", "N m/rad^7", "N m s^2/rad^2"}
REPO = Path(__file__).resolve().parents[2]
FOLDER = REPO / "pipelines" / "effects"

every_effect = pytest.mark.parametrize("kind", all_effects(), ids=lambda kind: kind.name)

every_friction_law = pytest.mark.parametrize("kind", [kind for kind in all_effects() if issubclass(kind, FrictionLaw)],
                                            ids=lambda kind: kind.name)


@pytest.fixture(scope="module")
def arm() -> Arm:
    return synthetic_arm()


@pytest.fixture(scope="module")
def motion() -> Motion:
    """Three joints swinging with reversals, two seconds at 1 kHz."""
    t = np.linspace(0.0, 1.999, 2000)
    w = 2 * np.pi * np.array([0.5, 1.0, 1.5])
    q0, a = np.array([0.3, -0.4, 0.9]), np.array([0.8, 0.6, 0.5])
    s, c = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    return Motion(t, q0 + a * s, a * w * c, -a * w**2 * s)


def placed(kind: type[Effect]) -> Effect:
    """`kind` at joint 2, or of the whole arm."""
    return kind(joint=2) if kind.scope == "joint" else kind()


def drawn(effect: Effect, seed: int) -> dict[str, float]:
    """Values out of the prior ranges; what counts joints or time is one of this arm, and within this motion."""
    rng = np.random.default_rng(seed)
    values = {q.name: float(rng.uniform(max(q.low, -1e3), min(q.high, 1e3))) for q in effect.parameters}
    chosen = {q.name: float(getattr(effect, q.name)) for q in effect.parameters
              if q.discrete or q.name == "sample_time"}  # lags of digital filters: `test_digital_lags`
    moment = {q.name: float(getattr(effect, q.name)) for q in effect.parameters if q.shape and effect.clock == "log"}
    values |= chosen | moment
    return effect.at(values).values(effect.at(values).amplitudes(values))


def without_amplitude(effect: Effect, values: dict[str, float]) -> dict[str, float]:
    shaped = effect.at(values)
    return shaped.values(np.zeros(len(shaped.amplitudes(values))))


def test_every_entry_of_the_table_is_an_effect() -> None:
    """Each stands once, in the file that the table says, and no effect of a file is missing from the table."""
    assert [kind.name for kind in all_effects()] == sorted(effect_names())
    contract = {"__init__", "base", "config", "hooks", "parameters"}
    files = {path.stem for path in FOLDER.glob("*.py")} - contract
    assert {cause.file for cause in causes().values()} == files
    written = re.findall(r'^    name = "(\w+)"$', "\n".join((FOLDER / f"{file}.py").read_text(encoding="utf-8") for file in files),
                         re.MULTILINE)
    assert sorted(written) == sorted(effect_names())
    assert {"coulomb", "viscous", "three_sigmoid"} <= set(written)


@every_effect
def test_words(kind: type[Effect]) -> None:
    """Title, signature, explanation, remedy and experiment are there, as sentences."""
    assert "=" in (kind.__doc__ or ""), "the equation stands above the code"
    assert kind.words.title.strip()
    assert not kind.words.title.endswith(".")
    for words in (kind.words.signature, kind.words.explanation, kind.words.remedy, kind.words.experiment):
        assert words == words.strip()
        assert words.endswith(".")
        assert words[0].isupper()
    assert kind.scope in ("joint", "arm")


@every_effect
def test_parameters(kind: type[Effect]) -> None:
    """Each parameter has a unit, a meaning and a range; the non-linear ones are fields with a default."""
    names = [q.name for q in kind.parameters]
    assert len(set(names)) == len(names) > 0
    assert all(re.fullmatch(r"[a-z][a-z0-9_]*", name) for name in names)
    for q in kind.parameters:
        assert q.unit in UNITS
        assert q.meaning
        assert q.low < q.high
        if q.shape:
            assert q.low <= getattr(placed(kind), q.name) <= q.high


@every_effect
def test_place(kind: type[Effect], arm: Arm) -> None:
    """It stands at every joint once, or once for the arm; a wrong place is refused."""
    joints = [effect.joint for effect in everywhere(kind, arm.robot.revolute)]
    assert joints in ([[1, 2, 3], [2, 3]] if kind.scope == "joint" else [[None]])
    for joint in (None, 0) if kind.scope == "joint" else (1,):
        with pytest.raises(ValueError, match="belongs to"):
            kind(joint=joint)


@every_effect
def test_columns(kind: type[Effect], arm: Arm, motion: Motion) -> None:
    """Columns are finite, (samples, joints, amplitudes), and not all zero, in every shape; they change no input."""
    before = motion.q.copy(), motion.dq.copy()
    for effect in placed(kind).shapes(motion, arm):
        columns = effect.columns(motion, arm)
        assert columns.shape[:2] == motion.q.shape
        assert columns.shape[2] == len(effect.amplitudes(drawn(effect, 0)))
        assert np.isfinite(columns).all()
        assert np.abs(columns).max() > 0
    np.testing.assert_array_equal(motion.q, before[0])
    np.testing.assert_array_equal(motion.dq, before[1])


@every_effect
def test_time_counts_from_the_start_of_the_log(kind: type[Effect], arm: Arm, motion: Motion) -> None:
    """Logs of one session may share its clock, and begin at any time of it: an effect does there what it does from zero on."""
    later = replace(motion, t=motion.t + 300.0)
    for shape, found in zip(*(placed(kind).shapes(one, arm) for one in (motion, later)), strict=True):
        here = shape.columns(motion, arm)
        for there in (shape.columns(later, arm), found.columns(later, arm)):
            np.testing.assert_allclose(there, here, rtol=1e-6, atol=1e-6 * np.abs(here).max())


@every_effect
def test_values_and_amplitudes_are_one(kind: type[Effect]) -> None:
    """From values to shape and amplitudes and back."""
    values = drawn(placed(kind), 1)
    effect = placed(kind).at(values)
    back = effect.values(effect.amplitudes(values))
    np.testing.assert_allclose(effect.amplitudes(back), effect.amplitudes(values), rtol=1e-9, atol=1e-12)
    assert back == pytest.approx(values, rel=1e-7, abs=1e-9)
    assert list(back) == [q.name for q in kind.parameters]
    assert effect.at(back) == effect


@every_effect
def test_a_value_out_of_its_range_is_impossible(kind: type[Effect]) -> None:
    """A lag of negative time is none: every parameter is held to its range."""
    effect, inside = placed(kind), {q.name: 0.5 * (q.low + min(q.high, 1e6)) for q in kind.parameters}
    assert effect.possible(inside)
    for q in kind.parameters:
        assert not effect.possible(inside | {q.name: q.low - 1.0})
        assert not effect.possible(inside | {q.name: q.high + 1.0}) or q.high == np.inf


@every_effect
def test_torque_is_linear_in_amplitude(kind: type[Effect], arm: Arm, motion: Motion) -> None:
    """Twice the amplitude is twice the torque of first order; none is none, exactly, in every form."""
    values = drawn(placed(kind), 2)
    effect = placed(kind).at(values)
    none = without_amplitude(effect, values)
    double = effect.values(2 * effect.amplitudes(values))
    np.testing.assert_allclose(first_order(effect, motion, arm, double), 2 * first_order(effect, motion, arm, values),
                               rtol=1e-9, atol=1e-12)
    assert not effect.torque(motion, arm, none).any()
    np.testing.assert_array_equal(effect.apply(motion, arm, none), arm.torque(motion))


@every_effect
def test_apply(kind: type[Effect], arm: Arm, motion: Motion) -> None:
    """The exact form is the first order where nothing else is said, and tends to it for small amplitudes everywhere."""
    values = drawn(placed(kind), 3)
    effect = placed(kind).at(values)
    linear = adds(effect)
    if not linear:
        values = effect.values(1e-6 * effect.amplitudes(values))
    change = effect.apply(motion, arm, values) - arm.torque(motion)
    expected = first_order(effect, motion, arm, values)
    assert np.abs(change - expected).max() <= (1e-9 if linear else 0.05) * np.abs(expected).max()
    model = arm.extended(Acting.of(effect, values))
    np.testing.assert_allclose(model.torque(motion), effect.apply(motion, arm, values), rtol=1e-12, atol=1e-12)


@every_friction_law
def test_friction_takes_power(kind: type[Effect], arm: Arm, motion: Motion) -> None:
    """What claims to be friction is dissipative column by column, odd in speed, and nothing at rest; what rubs behind a gear loads
    it more when a weight is lifted than when it is lowered, and is dissipative alone."""
    effect = placed(kind)
    power = effect.columns(motion, arm) * motion.dq[..., None]
    assert power.min() >= 0
    assert power.max() > 0
    values = drawn(effect, 5)
    speed = np.linspace(-5, 5, 101)
    assert (effect.curve(speed, arm, values) * speed).min() >= 0.0
    plain = values | {q.name: q.unsaid for q in effect.parameters if q.unsaid is not None}
    curve = effect.curve(speed, arm, plain)
    np.testing.assert_allclose(curve, -curve[::-1], atol=1e-9 * np.abs(curve).max())
    assert curve[50] == 0.0


@every_effect
def test_simulation_hooks(kind: type[Effect], arm: Arm, motion: Motion) -> None:
    """It enters the simulation in some way; a plain load is its torque."""
    values = drawn(placed(kind), 6)
    hooks = placed(kind).simulate(arm, values)
    assert any(hook is not None for hook in (hooks.load, hooks.actuator, hooks.drive, hooks.sensor, hooks.inertia, hooks.arm, hooks.record))
    assert (hooks.states == 0) == (hooks.rate is None and hooks.update is None)
    if kind.simulate is Effect.simulate:
        assert hooks.load is not None
        np.testing.assert_array_equal(hooks.load(motion, np.zeros((len(motion.t), 0))),
                                      placed(kind).torque(motion, arm, values))


def first_order(effect: Effect, motion: Motion, arm: Arm, values: dict[str, float]) -> Array:
    return np.asarray(effect.at(values).columns(motion, arm) @ effect.amplitudes(values))
