"""What an effect says in plain numbers, for one robot without arrays, it says by arrays as well. A new file inherits all this."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.dynamics.arm import Arm
from pipelines.dynamics.body import Motion
from pipelines.dynamics.functions import ARRAYS, NUMBERS
from pipelines.effects import all_effects
from pipelines.effects.base import Effect, summed
from tests.effects.test_every_effect import arm, drawn, every_effect, motion, placed

__all__ = ["arm", "motion"]


@every_effect
def test_a_load_in_plain_numbers(kind: type[Effect], arm: Arm, motion: Motion) -> None:
    """Where it follows from angle and speed of its own joint alone, it is the same as the torque by arrays."""
    values = drawn(placed(kind), 7)
    load = placed(kind).own_load(values)
    if load is None:
        return
    some = slice(0, None, 50)
    torque = placed(kind).torque(motion, arm, values)[some]
    plain = [load(angle, speed, NUMBERS) for angle, speed in zip(motion.q[some, 1].tolist(), motion.dq[some, 1].tolist(), strict=True)]
    np.testing.assert_allclose(plain, torque[:, 1], rtol=1e-9, atol=1e-12 * np.abs(torque).max())
    assert not np.delete(torque, 1, axis=1).any()


@every_effect
def test_a_memory_in_numbers_and_arrays(kind: type[Effect], arm: Arm, motion: Motion) -> None:
    """Where its load remembers one number alone, that moves, and loads, in numbers as in arrays."""
    values = drawn(placed(kind), 8)
    memory = placed(kind).own_memory(values)
    if memory is None:
        return
    speed = motion.dq[::50, 1]
    bent = np.linspace(-1.1, 1.1, len(speed))
    rate = memory.rate(bent, speed, ARRAYS)
    plain = [memory.rate(u, v, NUMBERS) for u, v in zip(bent.tolist(), speed.tolist(), strict=True)]
    np.testing.assert_allclose(plain, rate, rtol=1e-9, atol=1e-12 * np.abs(rate).max())
    load = memory.load(bent, rate)
    np.testing.assert_allclose([memory.load(u, du) for u, du in zip(bent.tolist(), plain, strict=True)], load, rtol=1e-9,
                               atol=1e-12 * np.abs(load).max())


@every_effect
def test_a_drive_in_numbers_and_arrays(kind: type[Effect], arm: Arm, motion: Motion) -> None:
    """Where speeds tell what comes of a command, it is the same of numbers as of arrays."""
    hooks = placed(kind).simulate(arm, drawn(placed(kind), 9))
    if hooks.drive is None:
        return
    joint, drive = hooks.drive
    speed = motion.dq[::50]
    command = np.random.default_rng(2).uniform(-3e5, 3e5, speed.shape)  # beyond any limit that is drawn
    arrays = drive(command.T, speed.T, ARRAYS)
    plain = [drive(u, v, NUMBERS) for u, v in zip(command.tolist(), speed.tolist(), strict=True)]
    np.testing.assert_allclose(plain, arrays, rtol=1e-12, atol=1e-9)
    assert np.abs(arrays - command[:, joint]).max() > 1e-6


def test_some_effects_have_them(arm: Arm) -> None:
    """Or the claims above would be about none; every drive without a memory is a function of its joint."""
    hooks = {kind.name: placed(kind).simulate(arm, drawn(placed(kind), 9)) for kind in all_effects()}
    assert any(one.drive for one in hooks.values())
    assert not [name for name, one in hooks.items() if one.actuator and not one.states]
    every = all_effects()
    assert any(kind.own_memory is not Effect.own_memory for kind in every)
    assert any(kind.own_load is not Effect.own_load for kind in every)


@pytest.mark.parametrize("samples", [1, 400])
def test_as_many_amplitudes_as_columns(samples: int) -> None:
    """Of few samples and of many the same sum; amplitudes that do not fit are refused by both."""
    columns, amplitudes = np.random.default_rng(1).normal(size=(samples, 3, 4)), np.array([1.0, -2.0, 0.5, 3.0])
    np.testing.assert_allclose(summed(columns, amplitudes), np.einsum("ijk,k->ij", columns, amplitudes), rtol=1e-12, atol=1e-14)
    with pytest.raises(ValueError, match=r"shorter|longer|mismatch"):
        summed(columns, amplitudes[:3])
