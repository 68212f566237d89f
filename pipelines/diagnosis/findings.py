"""Build findings: parameters with deviations, gain on held-out rows, proof.

worth = weigh(prepared, trained, standing, whole=True)
findings = findings_of(worth, later, end, causes)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pipelines.diagnosis.candidate_fits import laws_of
from pipelines.diagnosis.compliance import Compliance
from pipelines.diagnosis.refit import Later
from pipelines.diagnosis.result import (
    Alternative,
    Answer,
    BeforeAfter,
    Extended,
    Finding,
    FloorOrigin,
    Gain,
    ResidualRms,
    TipError,
    Value,
)
from pipelines.diagnosis.result import Standing as Told
from pipelines.diagnosis.selection import Round
from pipelines.diagnosis.state import Fit, State
from pipelines.diagnosis.trained import Standing, Trained, parameters, told
from pipelines.dynamics.arm import Acting
from pipelines.estimation.exact_model import Named
from pipelines.estimation.joint_table import Array
from pipelines.estimation.judgements import Repeated
from pipelines.estimation.model_fit import Refined, TorqueGain, torque_gain_of
from pipelines.estimation.preparation import Prepared
from pipelines.estimation.residual_analysis import Proof, proof
from pipelines.simulation.comparison import Simulation, simulation_errors

__all__ = ["Worth", "alternatives_of", "extension_of", "findings_of", "gain_of", "weigh"]

_LEAST_NOISE = 1e-6  # numerics: of a residual; logs that were computed may have none


def gain_of(torque: TorqueGain, before: Simulation, after: Simulation) -> Gain:
    """Return the gain; without position and tip where one of the two was not simulated."""
    known = "none" not in (before.how, after.how)
    return Gain(
        torque,
        BeforeAfter(before.position_rms, after.position_rms) if known else None,
        after.how if known else "none",
        TipError(before.tip_rms, after.tip_rms) if known else None,
        after.span if known else (),
    )


@dataclass(frozen=True, eq=False)
class Worth:
    """Models fitted without the held-out rows, and their residuals there."""

    trained: Trained
    left: tuple[Array, ...]  # (rows,) [N m] of each model, held out
    simulated: tuple[Simulation, ...]  # each model, under the controllers of the held-out logs
    floor: Array  # (joints,) [N m]
    floor_origin: FloorOrigin
    whole: bool  # with figures
    standing: tuple[Told, ...] = ()  # baseline effects

    def first(self, count: int) -> Worth:
        """Return the same of the nominal model and the first `count` causes."""
        some = slice(count + 1)
        trained = replace(
            self.trained, models=self.trained.models[some], states=self.trained.states[some]
        )
        return replace(self, trained=trained, left=self.left[some], simulated=self.simulated[some])

    def gain(self, before: int, after: int) -> Gain:
        """Return what model number `after` gains over another."""
        torque = torque_gain_of(self.trained.data, self.left[before], self.left[after])
        return gain_of(torque, self.simulated[before], self.simulated[after])

    def rms(self, place: int) -> ResidualRms:
        """Return what a model leaves."""
        held_out = self.trained.data.rms(self.left[place])
        return ResidualRms(self.trained.models[place].rms, held_out, self.floor)


def weigh(prepared: Prepared, trained: Trained, standing: Standing, whole: bool) -> Worth:
    """Return what the models are worth on held-out rows."""
    arms = [trained.arm(k) for k in range(len(trained.models))]
    simulated = (
        simulation_errors(arms, prepared.judging or prepared.motions)
        if whole
        else [Simulation.none(arm.n_joints) for arm in arms]
    )
    left = tuple(trained.held_out(k) for k in range(len(arms)))
    floor, origin = _noise_floor(trained, standing)
    return Worth(trained, left, tuple(simulated), floor, origin, whole, standing.told)


def _noise_floor(trained: Trained, standing: Standing) -> tuple[Array, FloorOrigin]:
    """Return the noise floor (joints,) [N m], and where it comes from.

    It is the residual of the healthy machine; without reference logs, what the residual of the last
    model differs by between rows of one state; without such rows, all of that residual.
    """
    if standing.floor is not None:
        return standing.floor, "reference logs"
    done = trained.models[-1]
    noise = np.sqrt(Repeated.of(done.data).noise(done.left))
    if np.isfinite(noise).all():
        return np.minimum(np.maximum(noise, _LEAST_NOISE * done.rms), done.rms), "repeated motion"
    return done.rms, "blocks"


def findings_of(
    worth: Worth,
    later: Later,
    end: State,
    known: Array,
    causes: Sequence[tuple[float | None, tuple[Alternative, ...]]],
    responses: Compliance | None,
) -> tuple[Finding, ...]:
    """Return the causes of a model, strongest first, their numbers by all rows.

    Args:
        known: covariance of their numbers.
        causes: probability and alternatives of each.
    """
    if not causes:
        return ()
    _, names = later.slopes(end.model)
    every = Refined(
        end.model,
        later.rows.data,
        worth.trained.models[0].weight,
        np.zeros(0),
        np.zeros((len(end.model.beta) + len(names), 0)),
        tuple(names),
        known,
    )
    out = []
    for place, (probability, others) in enumerate(causes):
        one = end.model.effects[place]
        effect, data = one.effect, later.rows.data
        size, joint, of_rated = _size(worth, place)
        answers: tuple[Answer, ...] = ()
        if effect.evidence == "frequency responses" and responses is not None and worth.whole:
            answers = responses.answers(Acting.of(effect, one.values))
        out.append(
            Finding(
                effect.name,
                effect.joint,
                effect.words.title,
                _between_laws(parameters(every, place), laws_of(later, end, place)),
                _explained(worth, place),
                _visibility(later, end, place),
                others,
                effect.words.experiment if others else None,
                worth.gain(place, place + 1),
                _ORIGINS.get(effect.evidence, "residual"),
                size,
                of_rated,
                _proof(worth, place, joint),
                answers=answers,
                probability=probability,
                log=None if one.log is None else data.logs[one.log - data.first].log.name,
            )
        )
    return tuple(sorted(out, key=lambda one: -one.explained))


def _between_laws(own: dict[str, Value], laws: Sequence[tuple[Named, float]]) -> dict[str, Value]:
    """Add the variance between laws, Σ w (v - v_own)², to that of each number (Draper 1995)."""
    every = [one.effect.reported(one.values) for one, _ in laws]
    quantities, out = {q.name: q for q in laws[0][0].effect.parameters}, dict(own)
    for name in quantities.keys() & own.keys():
        values = [x for x in (one.get(name) for one in every) if isinstance(x, int | float)]
        if len(values) == len(every) and (own[name].std is not None or quantities[name].discrete):
            away, period = np.subtract(values, values[0]), quantities[name].period or 1e300
            square = (away - period * np.round(away / period)) ** 2 @ [w for _, w in laws]
            std = float(np.hypot(own[name].std or 0.0, square**0.5))
            out[name] = replace(own[name], std=std) if square else own[name]
    return out


Origin = Literal["residual", "base parameters", "frequency responses", "reversals"]
_ORIGINS: dict[str, Origin] = {
    "base parameters": "base parameters",
    "frequency responses": "frequency responses",
    "reversals": "reversals",
}


def _proof(worth: Worth, place: int, joint: int) -> Proof | None:
    """Return the figure of a cause; None where it happened in a held-out log."""
    before, after = worth.trained.models[place : place + 2]
    one = after.model.effects[place]
    log = None if one.log is None else one.log - before.data.first
    if not worth.whole or (log is not None and log >= len(before.data.logs)):
        return None
    compliant = one.effect.evidence == "frequency responses"
    shown = joint + 1 if compliant else one.effect.joint
    return proof(before, after, shown, log, one.effect.clock == "log" and log is not None)


def _size(worth: Worth, place: int) -> tuple[float, int, float]:
    """Return the rms [N m] of a cause's torque at its joint or where it stands highest.

    And that joint, from 0, and the share of its rated torque.
    """
    done = worth.trained.models[-1]
    effect, data = done.model.effects[place].effect, done.data
    own = data.rms(done.model.torque(data) - done.model.without(place).torque(data))
    joint = int(np.argmax(own / worth.floor)) if effect.joint is None else effect.joint - 1
    rated = data.logs[0].log.robot.joints[joint].torque
    share = float(own[joint] / rated) if np.isfinite(rated) and rated > 0.0 else np.nan
    return float(own[joint]), joint, share


def _explained(worth: Worth, place: int) -> float:
    """Return the share of the nominal residual's power above the floor that a cause takes away."""

    def above(k: int) -> float:
        power = np.square(worth.trained.models[k].rms / worth.floor)
        return float(np.sum(np.maximum(power - 1.0, 0.0)))

    taken = (above(place) - above(place + 1)) / max(above(0), 1e-12)
    return float(np.clip(taken, 0.0, 1.0))


def _visibility(later: Later, end: State, place: int) -> float:
    """Return the part of a cause's torque that nominal and standing numbers cannot imitate."""
    rows, model = later.rows, end.model
    without = rows.torque(model.without(place))
    own = [a - b for a, b in zip(rows.torque(model), without, strict=True)]
    moments = end.known.base.moments(own)
    power = sum(float(x @ x) for x in own)
    imitated = float(moments @ end.known.after.solve(moments))
    return float(np.sqrt(np.clip(1.0 - imitated / max(power, 1e-300), 0.0, 1.0)))


def alternatives_of(own: Round) -> tuple[Alternative, ...]:
    """Return the causes that the data do not tell from the one selected in a round."""
    if own.cause is None or own.after is None:
        return ()

    def taken(fit: Fit) -> Array:
        parts = zip(own.before.residual, fit.residual, strict=True)
        return np.concatenate([a - b for a, b in parts])

    mine, out, probability = taken(own.after), list[Alternative](), own.cause.probability
    for key in own.cause.alternatives:
        theirs = taken(own.tried[key])
        size = float(np.linalg.norm(mine) * np.linalg.norm(theirs))
        similarity = float(mine @ theirs) / max(size, 1e-300)
        effect = own.tried[key].model.effects[-1]
        numbers = told(Acting.of(effect.effect, effect.values))
        out.append(Alternative(*key, similarity, probability[key], numbers))
    return tuple(sorted(out, key=lambda one: -one.probability))


def extension_of(prepared: Prepared, worth: Worth, findings: Sequence[Finding]) -> Extended:
    """Return the model with every cause that lasts, all numbers with their standard deviations."""
    last = len(worth.trained.models) - 1
    return Extended(
        worth.trained.arm(last),
        tuple(one for one in findings if one.log is None),
        (),
        worth.gain(0, last),
        worth.rms(0),
        worth.rms(last),
        "blocks" if prepared.judge is None else "logs",
        worth.trained.standing,
        (*prepared.motions, *prepared.judging),
        len(prepared.motions),
        prepared.fewer,
    )
