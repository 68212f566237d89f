"""What sampling and smoothing do to the numbers of a model, taken out of them.

    found = unbiased(found, prepared, case, seed)

The velocity of a reversal is reconstructed from samples of an encoder. Smoothed a little, it passes zero a little late or early,
and friction that changes its sign within a few mrad/s is fitted too sharp: at a wrist mostly by one or two in a hundred, by four at
most. So the fitted arm is run through the fitted logs' own experiments; what it logs is reconstructed and laid like the logs; and
what it leaves of that, though it is exact, would move its numbers. By as much they were moved by the logs (indirect inference;
Gouriéroux, Monfort, Renault 1993, to first order):

    θ = θ̂ - (J^T K⁻¹ J)⁻¹ J^T K⁻¹ (y~ - f(θ̂))        y~ (rows,) [N m] what the fitted arm logs, on average

Several runs with the noise of the amplifiers are averaged: without it, each reversal falls between samples in the one way that may
not have been the logs'. What the drives gave stands in their logs, not what they were asked for: the noise itself, which is nothing
on average, is no part of what is left then. Of three arms this left numbers off by 0.06 to 0.10 of their deviations, what they were
asked for by 0.13 to 0.20. Logs that no controller is known of, or that come to other rows, count as if the arm left nothing of
them. The arm that is run has no faults but what comes late: what smoothing does to a reversal hangs on its friction. That is told
best beside all that was found; of the models that have less of it, the same is taken out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.errors import InputRejected
from pipelines.log.experiment import Array
from pipelines.log.shared_work import shared_out
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.asked.inputs import Prepared
from pipelines.model.diagnosis.fitted.refit import Refined, moved_by
from pipelines.model.diagnosis.floor.drive_noise import white
from pipelines.model.diagnosis.floor.replay import as_recorded, experiment_of
from pipelines.model.diagnosis.floor.twin import replayable, replica
from pipelines.model.diagnosis.rows.data import Data, gather
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.search import Found, Step
from pipelines.model.simulation import Noise, Plant, Simulated, choose_steps, runs_alone, simulate_together, torque_noise

__all__ = ["smoothed_away", "unbiased"]

_RUNS = 2
_MOST = 1.2  # times what is left of the logs, that sampling may leave at a joint: more was no such thing


def unbiased(found: Found, prepared: Prepared, case: Case, seed: int) -> Found:
    """Every model that was accepted, and the nominal one, as arms whose logs would have been fitted as these were."""
    final = found.final
    artefact = smoothed_away(_in_order(final, case), _amplifiers(final), final.data, prepared, seed)
    if artefact is None or (final.data.rms(artefact) > _MOST * final.rms).any():
        return found
    done: dict[int, Refined] = {}

    def once(one: Refined) -> Refined:
        if id(one) not in done:
            done[id(one)] = moved_by(one, -artefact)
        return done[id(one)]

    def step(one: Step) -> Step:
        if one.best is None:
            return replace(one, before=once(one.before))
        best = replace(one.best, done=once(one.best.done))
        return replace(one, before=once(one.before), best=best,
                       rivals=tuple(best if rival is one.best else rival for rival in one.rivals))

    return replace(found, nominal=once(found.nominal), final=once(final), steps=tuple(map(step, found.steps)))


def _amplifiers(done: Refined) -> Array:
    """(joints,) [N m] about their noise, of one sample, that is as quick as rows can show: what a row has of it is the mean of all
    samples up to the next."""
    one = done.data.logs[0]
    step = float(np.median(np.diff(one.t)))
    return np.asarray(np.nan_to_num(white(done.data, done.left)) * np.sqrt(step / one.log.sample_time))


def _in_order(done: Refined, case: Case) -> Arm:
    """The arm without its faults, but for what comes late: it reverses nearly as that with all of them does, which would take ten
    times as long where torque passes them on its way to the joints."""
    late = [one for one in done.model.arm.effects if one.effect.last]
    return done.model.nominal.extended(*(one for one in case.beside if one.effect.friction), *late)


def smoothed_away(arm: Arm, noise: Array, data: Data, prepared: Prepared, seed: int) -> Array | None:
    """(rows,) [N m] what the arm leaves on average of its own logs of these experiments; None where it can be run in none.

    Args:
        noise: (joints,) [N m] of its amplifiers, of one sample.
    """
    logs = [log for log, _ in prepared.motions]
    places, drawn = replayable(logs), Noise(noise, np.zeros_like(noise))
    if not places:
        return None

    def of_runs(piece: tuple[int, tuple[int, ...]]) -> Array:
        place, seeds = piece
        log = logs[place]
        done, = simulate_together(arm, [experiments[place]], drawn, seeds, steps)
        beside = torque_noise(drawn, seeds, done.tau.shape[1])
        given = done.tau + np.stack([plant.logged(done.t, one) for one in beside])
        holes = replace(done, q=_as_missing(as_recorded(log, done.q), log.q), tau=_as_missing(as_recorded(log, given), log.tau))
        return np.asarray(np.sum([_left(arm, holes, k, data, prepared, place) for k in range(len(seeds))], axis=0))

    seeds = tuple(range(seed, seed + _RUNS))
    mean = [np.zeros(one.rows * one.n_joints) for one in data.logs]
    try:
        plant = Plant.of(arm)
        experiments = {place: experiment_of(logs[place]) for place in places}
        steps = choose_steps(arm, list(experiments.values()), drawn)
        pieces = [(place, some) for place in sorted(places, key=lambda place: -logs[place].n_samples)
                  for some in ([(one,) for one in seeds] if runs_alone(arm, experiments[place]) else [seeds])]
        for (place, _), left in zip(pieces, shared_out(of_runs, pieces), strict=True):
            mean[place] += left / _RUNS
    except InputRejected:  # D15, D17, T04
        return None
    return np.concatenate(mean)


def _left(arm: Arm, done: Simulated, k: int, data: Data, prepared: Prepared, place: int) -> Array:
    """(rows,) of one log and one run; zero where it makes other rows, though it lacks what the log lacks."""
    one, copy = data.logs[place], replica(prepared.motions[place], done, k, prepared.recipe)
    own = gather((copy,), one.equations.columns, prepared.recipe, [one.equations.rows], place)
    if not (len(own.y) == one.weighed.size and np.array_equal(own.logs[0].t, one.t)):
        return np.zeros(one.weighed.size)
    return np.asarray(np.where(one.weighed.ravel(), own.y - own.lay(arm.torque), 0.0))


def _as_missing(x: Array, measured: Array) -> Array:
    """`x` (runs, samples, joints) without what was not `measured` (samples, joints)."""
    count = min(x.shape[1], len(measured))
    missing = np.zeros(x.shape[1:], dtype=bool)
    missing[:count] = ~np.isfinite(measured[:count])
    return np.where(missing, np.nan, x)
