"""Effects whose numbers are known from elsewhere, from frequency responses say: all else is fitted beside them.

    held = beside(case, prepared, effects)
    held.case, held.prepared       what is left to be explained: their torque is subtracted from every log
    held.parts                     each effect with the model before and after it

What a soft base or a soft joint does to the torque hangs on the rigid arm, which is fitted anew, in turns. Their own numbers are
refitted together with everything else where motion knows them: where the refit stays within what the responses allow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Acting, Arm
from pipelines.model.diagnosis.data import Data
from pipelines.model.diagnosis.exact import Exact, Refined, refine
from pipelines.model.diagnosis.gains import farther, gain_of, simulation_errors, torque_gain_of, worse_log
from pipelines.model.diagnosis.inputs import Prepared
from pipelines.model.diagnosis.nominal import fit_nominal
from pipelines.model.diagnosis.numbers import standard_deviations
from pipelines.model.diagnosis.result import Gain
from pipelines.model.diagnosis.search import Case, held_out_left
from pipelines.model.parameter import Parameter

__all__ = ["Held", "Part", "acted", "beside", "less", "torque_of"]

_ROUNDS = 2  # of the arm and the effects' torque in turns
_STDS = 3.0  # of a response's number, that a refit may move it
_SHARE = 0.05  # of a number, that it may move it whatever its deviation
_LOOSE = {"damping": 1.0, "damping_ratio": 1.0}  # the same of what both tell badly


@dataclass(frozen=True, eq=False)
class Part:
    """One effect, and the models without and with it."""

    acting: Acting
    before: Refined
    after: Refined
    left: tuple[Array, Array]  # (rows,) [N m] of held-out rows
    gain: Gain
    doubt: str  # why the model goes without it all the same; empty where it does not


@dataclass(frozen=True, eq=False)
class Held:
    """What is left to be explained, and what was taken away."""

    case: Case
    prepared: Prepared
    parts: tuple[Part, ...]


def beside(case: Case, prepared: Prepared, effects: Sequence[Acting]) -> Held:
    """One effect after the other; each is refitted, if it can be, to what those before it leave."""
    parts: list[Part] = []
    now = refine(case.model, case.data, case.weight) if effects else None
    for acting in effects:
        assert now is not None
        own = _refitted(now, case, acting) or acting
        there, ready = _with(case, prepared, own)
        after = refine(there.model, there.data, there.weight)
        part = _judged(own, now, after, case, there, prepared)
        parts.append(part)
        if not part.doubt:
            case, prepared, now = there, ready, after
    return Held(case, prepared, tuple(parts))


def _judged(acting: Acting, before: Refined, after: Refined, case: Case, there: Case, prepared: Prepared) -> Part:
    """What it is worth on held-out logs. Responses have named it: it need not prove itself again, but must do no harm."""
    left = held_out_left(before, case.judge, case.blocks), held_out_left(after, there.judge, case.blocks)
    data = after.data if case.judge is None else case.judge
    torque = torque_gain_of(data, *left)
    arms = [acted(one.model.arm, two.beside) for one, two in ((before, case), (after, there))]
    simulated = simulation_errors(arms, prepared.judging or prepared.motions)
    weights = before.weight[data.joint]
    worse = float(np.linalg.norm(left[1] * weights)) > float(np.linalg.norm(left[0] * weights))
    doubt = ("the held-out torque error is larger with it" if worse and (torque.ci95[:, 0] > 0.0).any()
             else worse_log(data, *left) or farther(*simulated))
    return Part(acting, before, after, left, gain_of(torque, *simulated), doubt)


def acted(arm: Arm, acting: Sequence[Acting]) -> Arm:
    """`arm` with effects below its own."""
    return replace(arm, effects=(*acting, *arm.effects)) if acting else arm


def torque_of(acting: Sequence[Acting], arm: Arm, data: Data) -> Array:
    """(rows,) [N m] that these effects add to the torque of `arm`."""
    return data.lay(lambda motion: arm.extended(*acting).torque(motion) - arm.torque(motion))


def less(data: Data, torque: Array) -> Data:
    """The same rows less a torque (rows,) [N m] that is known."""
    return replace(data, known=torque if data.known is None else data.known + torque)


def _with(case: Case, prepared: Prepared, acting: Acting) -> tuple[Case, Prepared]:
    """Everything fitted beside the effect, whose numbers are held."""
    arm, raw = case.model.nominal, case
    for _ in range(_ROUNDS):
        data = less(raw.data, torque_of((acting,), arm, raw.data))
        columns, fit = fit_nominal(data, prepared.columns)
        model = Exact.start(columns, fit)
        arm = model.nominal
    judge = None if raw.judge is None else less(raw.judge, torque_of((acting,), arm, raw.judge))
    there = replace(case, data=data, judge=judge, model=model, weight=fit.weight, beside=(*case.beside, acting))
    return there, replace(prepared, data=data, judge=judge)


def _refitted(now: Refined, case: Case, acting: Acting) -> Acting | None:
    """With its numbers fitted to the logs together with everything else; None where they leave what the responses allow."""
    effect, given = acting.effect, {p.name: p for p in acting.parameters}
    done = refine(now.model.with_effect(effect, effect.amplitudes(acting.values)), case.data, now.weight)
    place = len(done.model.effects) - 1
    one = done.model.effects[place]
    if not one.possible or done.rss >= now.rss:
        return None
    for name, value in one.values.items():
        known = given[name]
        share = _LOOSE.get(name, _SHARE) * abs(known.value)
        if not abs(value - known.value) <= max(share, _STDS * (known.std or 0.0)):
            return None
    std = _combined(given, one.values, standard_deviations(done, place, done.covariance()))
    joint = effect.joint
    return Acting.of(one.effect, one.values, std, revolute=joint is None or now.model.arm.robot.revolute[joint - 1])


def _combined(given: Mapping[str, Parameter], values: Mapping[str, float], std: Mapping[str, float]) -> dict[str, float]:
    """Of each number: what the refit leaves, and how far responses and motion are apart."""
    return {name: float(np.hypot(known, values[name] - given[name].value)) for name, known in std.items()}
