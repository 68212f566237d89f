"""What the reference logs show beside the nominal model: a part of this machine, and no news.

    standing = standing_of(later, config)
    standing.effects                       causes of the library, with their numbers

The diagnosis itself has columns for all of it (`prior`). A model for simulation has causes instead:
those that together predict the reference best, one after the other by the predictive score, as long
as each takes more than a share `relevance` of what is left and pays on blocks of time.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.prior import Prior
from pipelines.diagnosis.refit import Later, State
from pipelines.diagnosis.score import confidence_set, log_scores
from pipelines.diagnosis.screening import best_of
from pipelines.diagnosis.selection import Candidate, refit
from pipelines.diagnosis.trained import Standing
from pipelines.model.diagnosis.fitted.refit import refine
from pipelines.model.diagnosis.result import Standing as Told
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.worth.numbers import acting, told

__all__ = ["standing_of"]

_REFITS = 2  # numerics: candidates that are refitted in a round, for one is taken


def standing_of(prepared: Data | None, later: Later, config: DiagnosisConfig) -> Standing:
    """Return what stands, and the nominal model beside it, its friction laws in their own shapes.

    Args:
        prepared: rows of the reference logs as they are logged; None: there are none.
    """
    if prepared is None or later.dataset.reference is None or later.dictionary.reference is None:
        return Standing(later.dataset.model)
    own = _reference(later, config)
    states = [own.start()]
    for _ in range(own.rows.n_joints * config.causes):
        best = _best(own, states[-1], config)
        if best is None:
            break
        states.append(best.state)
    weight = 1.0 / prepared.rms(prepared.y - states[-1].model.torque(prepared))
    done = refine(states[-1].model, prepared, weight)
    known = done.covariance()
    effects = tuple(acting(done, k, known) for k in range(len(done.model.effects)))
    rms = [prepared.rms(prepared.y - one.model.torque(prepared)) for one in states[:-1]]
    power = [float(np.sum(np.square(one / done.rms) - 1.0)) for one in (*rms, done.rms)]
    shares = np.clip(-np.diff(power) / max(power[0], 1e-12), 0.0, 1.0)
    found = tuple(
        Told(one.effect.name, one.effect.joint, told(one), float(share))
        for one, share in zip(effects, shares, strict=True)
    )
    nominal = replace(done.model, effects=(), standing=effects)
    return Standing(nominal, effects, found, done.rms)


def _reference(later: Later, config: DiagnosisConfig) -> Later:
    """Return the rows of the reference with a flat prior on nominal numbers, and what may stand."""
    dataset, dictionary, prior = later.dataset, later.dictionary, later.prior
    groups = tuple(
        group
        for group in dictionary.groups
        if group.kind == "named"
        and (effect := dictionary.families[group.key].shapes[group.shape]).evidence == "residual"
        and effect.adds
    )
    assert dictionary.reference is not None
    return Later.of(
        replace(dataset, later=dataset.known, reference=None),
        replace(dictionary, groups=groups, later=dictionary.reference, reference=None),
        _flat(prior),
        config,
    )


def _flat(prior: Prior) -> Prior:
    n = prior.n_nominal
    none = np.zeros(0, dtype=np.intp)
    return replace(
        prior, standing=none, groups=(), start=(prior.precision[:n, :n], np.zeros(n)), learned=True
    )


def _best(own: Later, state: State, config: DiagnosisConfig) -> Candidate | None:
    """Return the cause that predicts best, None where none pays."""
    taken = {(one.effect.name, one.effect.joint) for one in state.model.effects}
    seen = sorted(
        (one for key, one in best_of(own.screened(state)).items() if key not in taken),
        key=lambda one: -one.gain,
    )
    tried = []
    for one in seen[:_REFITS]:
        if one.gain > config.relevance * state.cost:
            effect = own.dictionary.families[one.group.key].shapes[one.group.shape].full()
            done = refit(own, state, one.group.key, effect, one.amplitudes)
            tried += [done] if done is not None and done.possible else []
    if not tried:
        return None
    best = min(tried, key=lambda one: float(one.state.losses.sum()))
    scores = {
        name: log_scores(some.losses, own.block_rows)
        for name, some in (("with", best.state), ("without", state))
    }
    return None if "without" in confidence_set(scores, config) else best
