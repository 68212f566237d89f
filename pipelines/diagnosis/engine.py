"""The whole way: dataset → prior → candidates → baseline → selection → decision."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from pipelines.diagnosis.baseline import Baseline, Parts, Sums, baseline
from pipelines.diagnosis.candidates import Dictionary
from pipelines.diagnosis.compliance import Compliance, compliance, new_causes
from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.dataset import Dataset, Rows, load
from pipelines.diagnosis.decision import Decision, decide
from pipelines.diagnosis.prior import Prior, prior_of
from pipelines.diagnosis.refit import Later
from pipelines.diagnosis.selection import SearchStart, Selection, select
from pipelines.diagnosis.state import State
from pipelines.diagnosis.trained import covariance
from pipelines.diagnosis.variance import settle
from pipelines.dynamics.arm import Acting
from pipelines.estimation.bootstrap import wald
from pipelines.estimation.exact_model import difference
from pipelines.estimation.joint_table import Array, Table, in_rows
from pipelines.estimation.preparation import Logs, Prepared, prepare
from pipelines.io.log import ExperimentLog

__all__ = ["Diagnosis", "diagnose", "diagnose_prepared", "pose"]

_LOOKS = 4  # numerics: after the first, at most
_SETTLED = 0.1  # numerics: change of ln(power of a joint's noise) at which looks end


@dataclass(frozen=True, eq=False)
class Look:
    """One search, with the noise that the causes found before it leave."""

    later: Later
    baseline: Baseline
    selection: Selection

    @classmethod
    def of(
        cls,
        dataset: Dataset,
        dictionary: Dictionary,
        responses: Sequence[Acting],
        config: DiagnosisConfig,
        found: SearchStart | None = None,
        usual: tuple[Prior, Baseline] | None = None,
    ) -> Look:
        """Return the causes in rows whose noise is known, beside those found before.

        Args:
            usual: prior and baseline, where reference logs have given them; None: compute them.
        """
        prior, known, sums = (*usual, None) if usual else _usual(dataset, dictionary, config)
        later = Later.of(dataset, dictionary, prior, config, sums)
        return cls(later, known, select(later, known, responses, found))

    @property
    def usual(self) -> tuple[Prior, Baseline] | None:
        """Prior and baseline of the reference logs, equal in all looks; None without these."""
        return None if self.reference is None else (self.later.prior, self.baseline)

    @cached_property
    def reported(self) -> State:
        """The causes found, with the numbers that are reported.

        Without reference logs standing numbers are left out: they may hold a part of a cause.
        """
        end = self.selection.end
        known = self.reference is not None or not end.model.effects
        return end if known else self.later.unchanged(end)

    @cached_property
    def covariance(self) -> Array:
        """Of the nominal numbers and those of the causes reported, in their own units.

        What standing numbers s hold moves the others by G s, s and its covariance as the logs tell:
        C = C(s fitted) + δ δᵀ, δ the change of the other numbers when s is fitted.
        """
        one, other = self.reported.model, self.selection.end.model
        moved = np.array([difference(one, other, n) for n in self.later.slopes(other)[1]])
        away = np.r_[one.beta - other.beta, moved]
        known = covariance(self.later, self.selection.end)
        return np.asarray(known + np.outer(away, away))

    @property
    def unsure(self) -> int | None:
        """Index of the cause whose size may best be none; None: they all have one."""
        model, alpha, ratios = self.reported.model, self.later.config.alpha, dict[int, float]()
        names, first = self.later.slopes(model)[1], len(model.beta)
        for place, one in enumerate(model.effects):
            at = [first + k for k, n in enumerate(names) if n[:2] == (1, place) and n[2].isdigit()]
            if one.effect.parameters.fixed is None:
                sizes = np.array(one.amplitudes)
                ratios[place] = wald(sizes, self.covariance[np.ix_(at, at)], alpha)
        return min((k for k in ratios if ratios[k] < 1.0), key=lambda k: ratios[k], default=None)

    @property
    def reference(self) -> tuple[Rows, Table] | None:
        """The rows and columns of the reference."""
        rows, columns = self.later.dataset.reference, self.later.dictionary.reference
        return None if rows is None or columns is None else (rows, columns)


def _usual(
    dataset: Dataset, dictionary: Dictionary, config: DiagnosisConfig
) -> tuple[Prior, Baseline, Sums | None]:
    """Return prior and baseline, and without reference logs products over the later rows."""
    prior = prior_of(dataset, dictionary, config)
    parts = Parts.of(dataset, dictionary, prior)
    every = range(len(parts.counts))  # without reference logs they are the later rows
    sums = parts.sums(every) if dataset.reference is None else None
    usual = baseline(parts, dataset, dictionary, config)
    return replace(prior, grams=(), moments=()), usual, sums  # these take memory, and are done


def _torques(rough: Dataset, every: Dictionary, look: Look) -> tuple[Array, Array]:
    """Return the torque (rows,) [N m] of the causes, and of all that was fitted with them."""
    rows, end, model = rough.later, look.selection.end, look.reported.model
    numbers = end.theta[look.later.prior.n_nominal :]
    small = every.later.take(look.later.prior.standing).times(numbers)
    cause = model.torque(rows.data) - replace(model, effects=()).torque(rows.data)
    return cause, end.model.torque(rows.data) + in_rows(small, rows.joint) / rows.weight


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Everything that was computed."""

    decision: Decision
    look: Look
    responses: Compliance | None  # None: there are no frequency responses


def diagnose(
    logs: Sequence[ExperimentLog],
    config: DiagnosisConfig | None = None,
    exclude: Sequence[str] = (),
) -> Diagnosis:
    """Return what has changed since the reference logs, or without them what is wrong.

    Args:
        exclude: causes that are not considered.

    Raises:
        InputRejected: as `prepare`, logs that give no rows.
    """
    config = config or DiagnosisConfig()
    prepared = prepare(Logs.by_role(logs), config.recipe())
    return diagnose_prepared(prepared, config, exclude)


def pose(prepared: Prepared, config: DiagnosisConfig) -> Later:
    """Return the rows of later logs beside their prior, with all candidates."""
    rough = load(prepared, prepared.logs.frf)
    dataset, columns = settle(rough, Dictionary.of(rough, config), config)
    dictionary = columns()
    return Later.of(dataset, dictionary, prior_of(dataset, dictionary, config), config)


def diagnose_prepared(
    prepared: Prepared, config: DiagnosisConfig, exclude: Sequence[str] = ()
) -> Diagnosis:
    """Return the same of rows that were prepared."""
    rough = load(prepared, prepared.logs.frf)
    every = Dictionary.of(rough, config, exclude)
    responses = compliance(rough.frf, rough.model.nominal, exclude)
    reference = compliance(prepared.logs.frf_before, rough.model.nominal, exclude)
    named = new_causes(responses, reference)
    dataset, columns = settle(rough, every, config)
    last, known = Look.of(dataset, columns(), named, config), 0
    for _ in range(_LOOKS):  # what the causes leave tells the noise, and what is typical
        power, found, usual = last.later.dataset.noise_power, last.selection.found, last.usual
        if not found.causes:
            break
        torques = _torques(rough, every, last)
        dataset, columns = settle(rough, every, config, *torques, last.reference)
        change = np.abs(np.log(dataset.noise_power / power)).max()
        if change < _SETTLED and (usual is not None or len(found.causes) == known):
            break
        found = replace(found, settled=len(found.causes) == known)
        del last  # its columns take the memory that the next ones need
        last, known = Look.of(dataset, columns(), named, config, found, usual), len(found.causes)
    last = replace(last, selection=last.selection.without_selected_alternatives)
    while (place := last.unsure) is not None:
        last = replace(last, selection=last.selection.without(last.later, place))
    decision = decide(last.later, last.selection, last.baseline)
    return Diagnosis(decision, last, responses)
