"""What is diagnosed: the rows, those that judge, the nominal model on them, and every cause that is looked for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipelines.log.experiment import Array
from pipelines.model.arm import Acting
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.refit import Refined
from pipelines.model.diagnosis.floor.thresholds import Thresholds
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.screened.arms_alike import Asked, alike, moving_alike
from pipelines.model.diagnosis.screened.candidates import Arms, Family
from pipelines.model.diagnosis.worth.held_out import held_out_left

__all__ = ["Case", "HeldOut", "held_out"]

_QUIETER = 0.5  # of what a joint leaves of the fitted logs: with less held out it is weighted by the held-out logs
_ALIKE = 0.05  # of a joint's torque, by which two arms may differ and have the same columns to first order



@dataclass(frozen=True, eq=False)
class Case:
    """What is diagnosed."""

    data: Data  # that is fitted
    judge: Data | None  # that judges; None: blocks of the fitted
    model: Exact  # nominal
    weight: Array  # (joints,)
    families: tuple[Family, ...]
    thresholds: Thresholds | None  # None: a share of the residual
    blocks: int = 10
    nameable: tuple[str, ...] = ("residual",)  # kinds of evidence there are
    again: bool = True  # a cause that may act more than once at its place may be found more than once
    named: bool = False  # by somebody, so that none has a threshold but what is found at its place once more
    white: bool = False  # its rows were whitened: little of them is signal, and every cause takes a small share
    beside: tuple[Acting, ...] = ()  # effects whose torque is subtracted from the rows: known from elsewhere, or standing

    @property
    def floored(self) -> bool:
        """Whether thresholds say what an arm in order shows of a cause: of a twin."""
        return self.thresholds is not None

    def arms(self, model: Exact) -> Arms:
        """By whose columns causes are screened beside `model`: what just adds its torque by those of the start, which are laid
        already, as long as that arm has the same torque, and what was found does not change how any torque is recorded; what
        follows from the rigid body alone, or from that and what acts at its joint, by those of any arm that is nearly the same.

        Columns are of first order. Those of an arm that differs by a twentieth are off by as much, and gain a thousandth less.
        """
        torque, before = model.torque(self.data), self.model.torque(self.data)
        more = self.data.rms(before - torque)
        same = (more <= _ALIKE * self.data.rms(torque)).all() and not any(one.effect.last for one in model.effects)
        now, start = Asked.of(self.data, model, torque), Asked.of(self.data, self.model, before)
        start = start if same else now
        apart = self.data.rms(start.rigid - now.rigid) > _ALIKE * self.data.rms(now.rigid)
        gaps = alike(self.data, now if apart.any() else start)  # inertia of a rotor may have come out of the rigid body
        return Arms(now.arm, start.arm, gaps[:-1], alike(self.data, now)[-1], moving_alike(self.data, now))


@dataclass(frozen=True, eq=False)
class HeldOut:
    """What a model leaves on what it was not fitted to, beside which others are held."""

    error: float  # squared, weighted
    weight: Array  # (joints,) [1/(N m)] of the fit; more of a joint that is far quieter there than in the fitted logs

    @classmethod
    def of(cls, now: Refined, case: Case) -> HeldOut:
        """A joint that something disturbs in the fitted logs alone would have next to no say by the weights of the fit."""
        rows = now.data if case.judge is None else case.judge
        left = held_out_left(now, case.judge, case.blocks)
        weight = np.maximum(now.weight, _QUIETER / np.maximum(rows.rms(left), 1e-300))
        return cls(float(np.sum(np.square(left * weight[rows.joint]))), weight)

    def share(self, done: Refined, case: Case) -> float:
        """What `done` leaves of it."""
        return held_out(done, case, self.weight) / self.error


def held_out(done: Refined, case: Case, weight: Array | None = None) -> float:
    """Squared weighted error on what the model was not fitted to; `weight` (joints,), by default that of its fit."""
    data = done.data if case.judge is None else case.judge
    own = done.weight if weight is None else weight
    return float(np.sum(np.square(held_out_left(done, case.judge, case.blocks) * own[data.joint])))
