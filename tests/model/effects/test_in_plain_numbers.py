"""What an effect says in plain numbers, for one robot without arrays, it says by arrays as well. A new file inherits all this."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.model.arm import Arm
from pipelines.model.effects import all_effects
from pipelines.model.effects.base import Effect, Formula
from pipelines.model.effects.fast import Fast, own_load, own_memory
from pipelines.model.effects.terms import WRITTEN, summed
from pipelines.model.rigid.body import Motion
from tests.model.effects.test_every_effect import arm, drawn, every_effect, motion, placed

__all__ = ["arm", "motion"]


@every_effect
def test_a_load_in_plain_numbers(kind: type[Effect], arm: Arm, motion: Motion) -> None:
    """Where it follows from angle and speed of its own joint alone, it is the same as the torque by arrays."""
    values = drawn(placed(kind), 7)
    load = own_load(placed(kind), values)
    if load is None:
        return
    some = slice(0, None, 50)
    torque = placed(kind).torque(motion, arm, values)[some]
    plain = [load(angle, speed) for angle, speed in zip(motion.q[some, 1].tolist(), motion.dq[some, 1].tolist(), strict=True)]
    np.testing.assert_allclose(plain, torque[:, 1], rtol=1e-9, atol=1e-12 * np.abs(torque).max())
    assert not np.delete(torque, 1, axis=1).any()


@every_effect
def test_a_memory_in_plain_numbers(kind: type[Effect], arm: Arm, motion: Motion) -> None:
    """Where its load remembers one number alone, that moves, and loads, as by arrays."""
    values = drawn(placed(kind), 8)
    memory, hooks = own_memory(placed(kind), values), placed(kind).simulate(arm, values)
    if memory is None:
        return
    assert hooks.states == 1
    assert hooks.rate is not None
    assert hooks.load is not None
    some = Motion(*(x[::50] for x in (motion.t, motion.q, motion.dq, motion.ddq)))
    bent = np.linspace(-1.1, 1.1, len(some.t))[:, None]
    rate, load = hooks.rate(some, np.zeros_like(some.q), bent)[:, 0], hooks.load(some, bent)[:, 1]
    plain = [memory.rate(u, v) for u, v in zip(bent[:, 0].tolist(), some.dq[:, 1].tolist(), strict=True)]
    np.testing.assert_allclose(plain, rate, rtol=1e-9, atol=1e-12 * np.abs(rate).max())
    np.testing.assert_allclose([memory.load(u, du) for u, du in zip(bent[:, 0].tolist(), plain, strict=True)], load, rtol=1e-9,
                               atol=1e-12 * np.abs(load).max())


@every_effect
def test_a_drive_in_plain_numbers(kind: type[Effect], arm: Arm, motion: Motion) -> None:
    """Where speeds tell what comes of a command, it is what comes of it by arrays."""
    hooks = placed(kind).simulate(arm, drawn(placed(kind), 9))
    if hooks.drive is None:
        return
    assert hooks.actuator is not None
    some = Motion(*(x[::50] for x in (motion.t, motion.q, motion.dq, motion.ddq)))
    command = np.random.default_rng(2).uniform(-3e5, 3e5, some.q.shape)  # beyond any limit that is drawn
    arrays = hooks.actuator(command, some, np.zeros((len(command), 0)))
    plain = [hooks.drive(tuple(u), tuple(v)) for u, v in zip(command.tolist(), some.dq.tolist(), strict=True)]
    np.testing.assert_allclose(plain, arrays, rtol=1e-12, atol=1e-9)
    assert np.abs(arrays - command).max() > 1e-6


@every_effect
def test_what_is_written_out_is_what_is_called(kind: type[Effect]) -> None:
    """With any sign of its numbers, and within a product."""
    load = own_load(placed(kind), drawn(placed(kind), 11))
    if not isinstance(load, Formula):
        return
    for angle, speed in ((0.3, -0.7), (-1.1, 0.02), (2.0, 0.0)):
        assert eval(f"2.0 * ({load.text.format(q='a', v='b')})", {**WRITTEN, "a": angle, "b": speed}) == 2.0 * load(angle, speed)


def test_some_effects_have_them(arm: Arm) -> None:
    """Or the claims above would be about none; every drive without a memory has them."""
    hooks = {kind.name: placed(kind).simulate(arm, drawn(placed(kind), 9)) for kind in all_effects()}
    assert {name for name, one in hooks.items() if one.drive} == {
        name for name, one in hooks.items() if one.actuator and not one.states} != set()
    fast = [kind for kind in all_effects() if issubclass(kind, Fast)]
    assert any(kind.own_memory is not Fast.own_memory for kind in fast)
    assert any(kind.own_load is not Fast.own_load for kind in fast)


@pytest.mark.parametrize("samples", [1, 400])
def test_as_many_amplitudes_as_columns(samples: int) -> None:
    """Of few samples and of many the same sum; amplitudes that do not fit are refused by both."""
    columns, amplitudes = np.random.default_rng(1).normal(size=(samples, 3, 4)), np.array([1.0, -2.0, 0.5, 3.0])
    np.testing.assert_allclose(summed(columns, amplitudes), np.einsum("ijk,k->ij", columns, amplitudes), rtol=1e-12, atol=1e-14)
    with pytest.raises(ValueError, match=r"shorter|longer|mismatch"):
        summed(columns, amplitudes[:3])
