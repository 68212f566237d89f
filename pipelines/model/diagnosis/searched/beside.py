"""Effects whose numbers are known from elsewhere, from frequency responses say: all else is fitted beside them.

    held = beside(case, prepared, effects)
    held.case, held.prepared       what is left to be explained: their torque is subtracted from every log
    done = judged(held, final)     when all else was found: what each effect is worth beside it

What a soft base or a soft joint does to the torque hangs on the rigid arm, which is fitted anew, in turns. Their own numbers are
refitted together with everything else where motion knows them: where the refit stays within what the responses allow.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Acting, Arm
from pipelines.model.diagnosis.asked.inputs import Prepared
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.fitted.refit import Refined, moved_by, refine
from pipelines.model.diagnosis.result import Gain
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.worth.gains import farther, gain_of, no_nearer, simulation_errors, torque_gain_of, worse_log
from pipelines.model.diagnosis.worth.held_out import held_out_left
from pipelines.model.diagnosis.worth.numbers import standard_deviations
from pipelines.model.effects import all_effects
from pipelines.model.effects.base import Effect
from pipelines.model.parameter import Parameter

__all__ = ["Held", "Judged", "Part", "acted", "beside", "judged", "less", "torque_of", "unsolved"]

_ROUNDS = 2  # of the arm and the effects' torque in turns
_STDS = 3.0  # of a response's number, that a refit may move it
_SHARE = 0.05  # of a number, that it may move it whatever its deviation
_LOOSE = {"damping": 1.0, "damping_ratio": 1.0}  # the same of what both tell badly


@dataclass(frozen=True, eq=False)
class Part:
    """One effect, and what it is worth beside everything else that was found."""

    acting: Acting
    before: Refined  # without it
    after: Refined
    gain: Gain
    doubt: str  # why the model goes without it all the same; empty where it does not
    useless: str  # why it is of no use in a simulation; empty where it is


@dataclass(frozen=True, eq=False)
class Held:
    """What is left to be explained, and what was taken away."""

    case: Case
    prepared: Prepared
    acting: tuple[Acting, ...] = ()
    plain: Refined | None = None  # before anything was taken away; None where nothing was
    judge: Data | None = None  # the held-out rows of that
    failed: tuple[tuple[Acting, str], ...] = ()  # effects beside which nothing could be fitted, with their numbers and why


def beside(case: Case, prepared: Prepared, effects: Sequence[Acting]) -> Held:
    """One effect after the other; each is refitted, if it can be, to what those before it leave.

    One at whose numbers nothing can be solved is left out, and told as `failed`.
    """
    if not effects:
        return Held(case, prepared)
    plain, judge, own, failed = refine(case.model, case.data, case.weight), case.judge, [], []
    now = plain
    for acting in effects:
        try:
            chosen = _refitted(now, case, acting) or acting
            case, prepared = _with(case, prepared, chosen)
        except np.linalg.LinAlgError as error:
            failed.append((acting, unsolved(acting, error)))
            continue
        own.append(chosen)
        now = refine(case.model, case.data, case.weight)
    return Held(case, prepared, tuple(own), plain, judge, tuple(failed))


@dataclass(frozen=True, eq=False)
class Judged:
    """Every effect judged, and the model with those that do no harm."""

    parts: tuple[Part, ...]
    final: Refined
    acting: tuple[Acting, ...]  # what it has beside its own effects
    judge: Data | None


def judged(held: Held, final: Refined, paying: bool = False) -> Judged:
    """What each effect is worth beside all that was found since; `final` is the model with all of it.

    Responses have named it, so that it need not prove itself again; but it must do no harm, and be of use to who asks for a model
    that is `paying`.
    """
    case, prepared = held.case, held.prepared
    judge, every = prepared.judge, case.beside
    parts = tuple(_part(one, held, final) for one in held.acting)
    if paying:
        parts = tuple(replace(part, doubt=part.doubt or part.useless) for part in parts)
    harmful = [part.acting for part in parts if part.doubt]
    if not harmful:
        return Judged(parts, final, every, judge)
    arm, back = final.model.nominal, [one for one in every if one not in harmful]
    data = less(final.data, -torque_of(harmful, arm, final.data))
    rows = None if judge is None else less(judge, -torque_of(harmful, arm, judge))
    return Judged(parts, refine(final.model, data, final.weight), tuple(back), rows)


def _part(acting: Acting, held: Held, final: Refined) -> Part:
    """What sampling did to numbers was taken out of the final ones, and a fit would have it again: as much is taken out of those of
    the model without the effect, or what one of them lacks beside the other would count for the effect."""
    case, prepared = held.case, held.prepared
    judge, arm = prepared.judge, final.model.nominal
    data = less(final.data, -torque_of((acting,), arm, final.data))
    there = None if judge is None else less(judge, -torque_of((acting,), arm, judge))
    before = moved_by(refine(final.model, data, final.weight), -final.left)
    left = held_out_left(before, there, case.blocks), held_out_left(final, judge, case.blocks)
    rows = final.data if judge is None else judge
    torque = torque_gain_of(rows, *left)
    arms = [acted(before.model.arm, [one for one in case.beside if one != acting]), acted(final.model.arm, case.beside)]
    simulated = simulation_errors(arms, prepared.judging or prepared.motions)
    weights = final.weight[rows.joint]
    worse = float(np.linalg.norm(left[1] * weights)) > float(np.linalg.norm(left[0] * weights))
    doubt = ("the held-out torque error is larger with it" if worse and (torque.ci95[:, 0] > 0.0).any()
             else worse_log(rows, *left) or farther(*simulated))
    return Part(acting, before, final, gain_of(torque, *simulated), doubt, no_nearer(*simulated))


def acted(arm: Arm, acting: Sequence[Acting]) -> Arm:
    """`arm` with effects below its own."""
    return replace(arm, effects=(*acting, *arm.effects)) if acting else arm


def unsolved(acting: Acting, error: np.linalg.LinAlgError) -> str:
    """Why an effect was left out, with its numbers."""
    numbers = ", ".join(f"{name} {value:.4g}" for name, value in acting.values.items())
    return f"no model can be fitted beside it with {numbers}: {error}"


def torque_of(acting: Sequence[Acting], arm: Arm, data: Data) -> Array:
    """(rows,) [N m] that these effects add to the torque of `arm`.

    Raises:
        LinAlgError: it is not finite, so that nothing can be solved beside it.
    """
    torque = data.lay(lambda motion: arm.extended(*acting).torque(motion) - arm.torque(motion))
    if not np.isfinite(torque).all():
        raise np.linalg.LinAlgError("its torque is not finite")
    return torque


def less(data: Data, torque: Array, effects: Iterable[Effect] = ()) -> Data:
    """The same rows less a known torque (rows,) [N m], that of `effects`: joints at which one of them is friction, or could be
    mistaken for it, are remembered."""
    rubbing = data.rubbing | {one.joint for one in effects if one.joint is not None and _rubs(one)}
    if data.cleared is not None:  # so is the torque that was laid in its rows
        return replace(data, taken=torque if data.taken is None else data.taken + torque, rubbing=rubbing)
    return replace(data, known=torque if data.known is None else data.known + torque, rubbing=rubbing)


def _rubs(effect: Effect) -> bool:
    nominal = (kind for kind in all_effects() if kind.friction and kind.evidence == "none")
    return effect.friction or any(kind.name in effect.twins or effect.name in kind.twins for kind in nominal)


def _with(case: Case, prepared: Prepared, acting: Acting) -> tuple[Case, Prepared]:
    """Everything fitted beside the effect, whose numbers are held."""
    arm, raw = case.model.nominal, case
    for _ in range(_ROUNDS):
        data = less(raw.data, torque_of((acting,), arm, raw.data))
        columns, fit = fit_nominal(data, prepared.columns)
        model = Exact.start(columns, fit)
        arm = model.nominal
    judge = None if raw.judge is None else less(raw.judge, torque_of((acting,), arm, raw.judge))
    others = tuple(f for f in case.families if (f.cause, f.joint) != (acting.effect.name, acting.effect.joint))
    there = replace(case, data=data, judge=judge, model=model, weight=fit.weight, families=others, beside=(*case.beside, acting))
    return there, replace(prepared, data=data, judge=judge)


def _refitted(now: Refined, case: Case, acting: Acting) -> Acting | None:
    """With its numbers fitted to the logs together with everything else; None where they leave what the responses allow."""
    effect, given = acting.effect, {p.name: p for p in acting.parameters}
    done = refine(now.model.with_effect(effect, effect.amplitudes(acting.values)), case.data, now.weight)
    place = len(done.model.effects) - 1
    one = done.model.effects[place]
    if not one.possible or not done.rss < now.rss:
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
