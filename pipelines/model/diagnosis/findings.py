"""From the steps of a search to findings: numbers, rivals, gain and proof of each named cause, and why others are not named."""

from __future__ import annotations

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.absorbed import Absorbed
from pipelines.model.diagnosis.evidence import proof
from pipelines.model.diagnosis.exact import Refined
from pipelines.model.diagnosis.gains import simulation_errors, torque_gain
from pipelines.model.diagnosis.inputs import Prepared
from pipelines.model.diagnosis.numbers import acting, parameters
from pipelines.model.diagnosis.result import BeforeAfter, Diagnosis, Finding, Gain, Rejected, Rival, TipError, TorqueGain
from pipelines.model.diagnosis.search import Found, Step, Tried
from pipelines.model.diagnosis.verdict import Ruling, explained

__all__ = ["absorbed_finding", "agreement", "extended_arm", "findings", "rejected", "sure"]

_ALIKE = 0.8  # cosine from which two causes explain the same
_AGREE = (0.4, 2.5)  # of its amplitude, that each log must ask for by itself
_TELLS = 9.0  # times its variance, that the power of the predicted part must have in a log to be asked


def findings(found: Found, ruling: Ruling, prepared: Prepared, floor: Array, blocks: int, draw: bool) -> tuple[Finding, ...]:
    """Each named cause, the one that explains most first; the final model holds them, in the order of their steps."""
    steps = [found.steps[k] for k in ruling.named]
    last = max(ruling.named, default=-1) + 1
    arms = [found.nominal.model.arm, *(step.best.done.model.arm for step in found.steps[:last] if step.best is not None)]
    motions = prepared.judging or prepared.motions
    simulated = simulation_errors(arms, motions)
    covariance = found.final.covariance()
    out = []
    for place, (k, step) in enumerate(zip(ruling.named, steps, strict=True)):
        if step.best is None:
            continue
        before, after = simulated[k], simulated[k + 1]
        known = after.how != "none"
        gain = Gain(torque_gain(step.before, step.best.done, prepared.judge, blocks),
                    BeforeAfter(before.position_rms, after.position_rms) if known else None, after.how,
                    TipError(before.tip_rms, after.tip_rms) if known else None)
        out.append(_finding(found, step, step.best, place, covariance, floor, gain, draw))
    return tuple(sorted(out, key=lambda one: -one.explained))


def _finding(found: Found, step: Step, best: Tried, place: int, covariance: Array, floor: Array, gain: Gain, draw: bool) -> Finding:
    effect, data = best.effect, step.before.data
    rivals = _rivals(step, best)
    own = data.rms(found.final.data.y - found.final.left - _without(found.final, place))
    joint = int(np.argmax(own / np.maximum(floor, 1e-12))) if effect.joint is None else effect.joint - 1
    rated = data.logs[0].log.robot.joints[joint].torque
    of_rated = float(own[joint] / rated) if np.isfinite(rated) and rated > 0.0 else np.nan
    numbers = parameters(found.final, place, covariance)
    return Finding(effect.name, effect.joint, effect.title, numbers, explained(step, found, floor),
                   best.visibility, rivals, effect.experiment if rivals else None, gain, "residual", float(own[joint]), of_rated,
                   proof(step.before, best.done, effect.joint) if draw else None)


def absorbed_finding(moved: Absorbed, told: Diagnosis) -> Finding:
    """A cause that the base parameters took in: its gain is that over the parameters of the reference logs."""
    joints = len(told.residual_rms.floor)
    before, after = moved.rms
    gain = Gain(TorqueGain(before, after, np.full((joints, 2), np.nan)), None, "none", None)
    torque = float(np.sqrt(np.max(np.maximum(before**2 - after**2, 0.0))))
    effect = moved.effect
    return Finding(effect.name, effect.joint, effect.title, moved.parameters, moved.explained, 0.0, (), None, gain,
                   "base parameters", torque, np.nan, None)


def _without(done: Refined, place: int) -> Array:
    """(rows,) [N m] torque of the model without one of its effects."""
    return done.model.without(place).torque(done.data)


def _rivals(step: Step, best: Tried) -> tuple[Rival, ...]:
    """Causes of nearly the same torque that take something off the held-out error as well."""
    mine = step.before.residual - best.done.residual
    found = []
    for one in step.rivals:
        theirs = step.before.residual - one.done.residual
        alike = float(mine @ theirs) / max(float(np.linalg.norm(mine) * np.linalg.norm(theirs)), 1e-300)
        if one is not best and alike > _ALIKE and one.error < 1.0 and one.possible:
            found.append(Rival(one.screened.cause, one.screened.joint, alike))
    return tuple(sorted(found, key=lambda rival: -rival.similarity))


def sure(step: Step, prepared: Prepared, blocks: int) -> str:
    """Why an accepted step is not to be believed; empty where it is: its gain repeats, its amplitude is the same in every log."""
    best = step.best
    if best is None or best.log is not None:
        return ""
    gain = torque_gain(step.before, best.done, prepared.judge, blocks)
    if not (gain.ci95[:, 1] < 0.0).any():
        return "its gain on held-out torque is within what chance does"
    off = [f"{scale:.2g}" for scale in agreement(step, best, prepared) if not _AGREE[0] < scale < _AGREE[1]]
    return f"logs do not agree on its size: {', '.join(off)} of it" if off else ""


def agreement(step: Step, best: Tried, prepared: Prepared) -> list[float]:
    """The amplitude that each log asks for by itself, in parts of the one found; of logs that can tell."""
    scales = []
    for data in (prepared.data, prepared.judge):
        if data is None:
            continue
        place = len(best.done.model.effects) - 1
        model = best.done.model
        torque = model.torque(data)
        share = torque - model.without(place).torque(data)
        left = data.y - torque
        weights = best.done.weight[data.joint]
        for log in range(len(data.logs)):
            own = data.log_of == log
            s, r = share[own] * weights[own], left[own] * weights[own]
            power = float(s @ s)
            if power > _TELLS * float(r @ r) / max(len(r), 1) * 10.0:
                scales.append(1.0 + float(s @ r) / power)
    return scales


def rejected(found: Found, ruling: Ruling) -> tuple[Rejected, ...]:
    """What came close: above its threshold, or found and not named."""
    best = [found.steps[k].best for k in ruling.named]
    named = {(one.effect.name, one.effect.joint) for one in best if one is not None}
    out: dict[tuple[str, int | None], Rejected] = {}
    for step in found.steps:
        for trial in step.trials:
            key = (trial.cause, trial.joint)
            if key in named or key in out or trial.gain <= trial.threshold:
                continue
            out[key] = Rejected(trial.cause, trial.joint, ruling.reason or "not named" if trial.accepted else trial.reason)
    return tuple(out.values())


def extended_arm(found: Found, ruling: Ruling) -> Arm:
    """The arm with what is named, refitted, every effect with its standard deviations."""
    covariance = found.final.covariance()
    final = found.final.model
    kept = [k for k, one in enumerate(final.effects) if k < len(ruling.named) and one.log is None]
    return final.nominal.extended(*(acting(found.final, k, covariance) for k in kept))

