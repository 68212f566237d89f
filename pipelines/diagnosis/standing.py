"""Find the baseline effects: causes that the reference logs show beside the nominal model.

    standing = standing_of(prepared, later)
    standing.effects                       causes of the library, with their numbers

The diagnosis itself has columns for all of it (`prior`). A model for simulation has causes instead:
the most significant ones, one after the other, as long as each pays on blocks of time, no shape
without a name predicts better, a joint is left too much without it, and later logs do not go where
the reference says nothing of it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.diagnosis.candidate_fits import Candidate, best_law, refit
from pipelines.diagnosis.candidates import Group
from pipelines.diagnosis.dataset import Rows
from pipelines.diagnosis.refit import Later
from pipelines.diagnosis.result import Standing as Told
from pipelines.diagnosis.score import confidence_set, log_scores
from pipelines.diagnosis.screening import Screened, best_of
from pipelines.diagnosis.state import State
from pipelines.diagnosis.trained import Standing, told
from pipelines.diagnosis.unnamed import FORM, Key
from pipelines.effects.base import adds
from pipelines.estimation.model_fit import acting, refine
from pipelines.estimation.rows import Data

__all__ = ["standing_of"]

_REFITS = 2  # numerics: candidates that are refitted in a round, at most


def standing_of(prepared: Data | None, later: Later) -> Standing:
    """Return the baseline effects and the nominal model refitted with them to the reference.

    Args:
        prepared: unwhitened rows of the reference logs; None without reference logs.
    """
    if prepared is None or later.dataset.reference is None or later.dictionary.reference is None:
        return Standing(later.dataset.model)
    own = _reference(later)
    states = [own.start()]
    for _ in range(own.rows.n_joints * own.config.causes):
        best = _best(own, states[-1], later.rows)
        if best is None:
            break
        states.append(best.state)
    weight = 1.0 / prepared.rms(prepared.y - states[-1].model.torque(prepared))
    done = refine(states[-1].model, prepared, weight)
    effects = tuple(acting(done, k, finite=True) for k in range(len(done.model.effects)))
    rms = [prepared.rms(prepared.y - one.model.torque(prepared)) for one in states[:-1]]
    power = [float(np.sum(np.square(one / done.rms) - 1.0)) for one in (*rms, done.rms)]
    shares = np.clip(-np.diff(power) / max(power[0], 1e-12), 0.0, 1.0)
    found = tuple(
        Told(one.effect.name, one.effect.joint, told(one), float(share))
        for one, share in zip(effects, shares, strict=True)
    )
    nominal = replace(done.model, effects=(), standing=effects)
    return Standing(nominal, effects, found, done.rms)


def _reference(later: Later) -> Later:
    """Return the rows of the reference with a flat prior on nominal numbers, and what may stand."""
    dataset, dictionary, prior = later.dataset, later.dictionary, later.prior
    n = prior.n_nominal

    def stands(group: Group) -> bool:
        if group.kind != "named":
            return group.kind == "unnamed" and group.key[0] != FORM  # standing laws may have it
        shape = dictionary.families[group.key].shapes[group.shape]
        return shape.evidence == "residual" and adds(shape)

    groups = tuple(group for group in dictionary.groups if stands(group))
    assert dictionary.reference is not None
    return Later.of(
        replace(dataset, later=dataset.known, reference=None),
        replace(dictionary, groups=groups, later=dictionary.reference, reference=None),
        prior.nominal(prior.precision[:n, :n], np.zeros(n)),
        later.config,
    )


def _best(own: Later, state: State, later: Rows) -> Candidate | None:
    """Return the first cause that is possible, None where it does not pay."""
    every = best_of(own.screened(state))
    best = _first(own, state, every, later)
    if best is None:
        return None
    plain = max(
        (one for one in every.values() if one.group.kind == "unnamed"),
        key=lambda one: one.gain - one.freedom * np.log(own.rows.count),
    )
    unnamed = own.with_columns(state, own.candidates.take(plain.group.columns))
    models = {"with": best.state, "without": state, "unnamed": unnamed}
    scores = {name: log_scores(one.losses, own.block_rows) for name, one in models.items()}
    kept = confidence_set(scores, own.config)
    return best if "with" in kept and "without" not in kept else None


def _first(own: Later, state: State, every: dict[Key, Screened], later: Rows) -> Candidate | None:
    """Return the first cause that a joint leaves too much without, and holds for later logs."""
    taken = {(one.effect.name, one.effect.joint) for one in state.model.effects}
    seen = [s for key, s in every.items() if s.group.kind == "named" and key not in taken]
    known, motions = ([one.motion for one in rows.data.logs] for rows in (own.rows, later))
    for one in sorted(seen, key=lambda one: -one.gain)[:_REFITS]:
        done = refit(own, state, own.form(one.group), one.amplitudes, laws=False)
        if done is None or not done.possible:
            continue
        without = state.mean_squares / done.state.mean_squares
        effect = done.state.model.effects[-1].effect
        beyond = any(q.seen for q in effect.parameters) and effect.goes_beyond(motions, known)
        if without.max() > own.config.excess and not beyond:
            return best_law(own, state, done)
    return None
