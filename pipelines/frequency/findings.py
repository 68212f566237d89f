"""Name compliance in all joints and postures: base, joint, delay or none, with evidence.

found = frf_findings(logs, arm)
found.classification       what is sure
found.undecided            what is there and could be more than one thing, and what to record
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.errors import InputRejected, RrridError
from pipelines.frequency.config import GroupingConfig, ReportConfig, SignConfig
from pipelines.frequency.grouping import Finding, Open, group_joint, seen_elsewhere
from pipelines.frequency.modes import (
    BAND,
    Modes,
    fitted_modes,
    informative,
    relative_acceleration,
    with_enough_bins,
)
from pipelines.frequency.responses import Measured, measured_responses
from pipelines.frequency.signals import Turned
from pipelines.frequency.spectra import inside
from pipelines.io.log import ExperimentLog
from pipelines.io.model_file import parse_model

__all__ = ["Expected", "Findings", "Seen", "frf_findings", "grouped"]

_CONFIG = SignConfig()


@dataclass(frozen=True)
class Expected:
    """The response expected of a rigid body: the double integrator with the inertia of the posture.

    under computed torque   q_j/r_j = D̂_jj(q) / D_jj(q) · 1/s²
    under PD                q_j/τ_j = 1 / (D_jj(q) s²)

    sampled and held, the other joints standing still. D̂ is the inertia of the controller's model, D
    that of the arm's: where no better model is known they are one, and the response is 1/s² (Kostić
    et al. 2004, eq. (26)).
    """

    level: float | None  # of the acceleration per input: 1 or D̂/D, 1/D under PD [1/(kg m^2)]
    inertia: float | None  # D_jj [kg m^2] in the posture
    source: str  # whose model: "given model", "controller's model", "none"


@dataclass(frozen=True, eq=False)
class Seen:
    """One joint in one posture: what was measured, its modes, and what the rigid body would do."""

    measured: Measured
    modes: Modes
    expected: Expected


@dataclass(frozen=True, eq=False)
class Findings:
    """Of all "frf" logs of an arm."""

    seen: tuple[Seen, ...]
    unusable: tuple[Measured, ...]  # in whose band v excites too little: nothing is named
    classification: tuple[Finding, ...]
    undecided: tuple[Open, ...]


def frf_findings(
    logs: Iterable[ExperimentLog], arm: Arm | None = None, band: tuple[float, float] = BAND
) -> Findings:
    """Return responses, modes and grouping of "frf" logs.

    Args:
        logs: of experiment "frf", of one robot.
        arm: its model, for the inertia to expect; None: the controller's own, where logs carry it.
        band: [Hz] in which modes are looked for.

    Raises:
        InputRejected: a log that no spectrum can be taken of, with what to record: S01, T05, T08,
            D04, D09; S14, a joint that accelerates against its input.
    """
    seen, unusable = [], []
    for one in measured_responses(logs):
        measured = with_enough_bins(one, band)
        _check_sign(measured)
        if informative(measured, band):
            modes = fitted_modes(measured, band)
            seen.append(Seen(measured, modes, _expected(measured.first, arm)))
        else:
            unusable.append(measured)
    return Findings(tuple(seen), tuple(unusable), *grouped(seen))


def grouped(
    seen: Sequence[Seen], config: GroupingConfig | None = None
) -> tuple[tuple[Finding, ...], tuple[Open, ...]]:
    """Return what is sure, and what is open, from the modes of all joints and postures."""
    sure: list[Finding] = []
    unsure: list[Open] = []
    for joint in sorted({one.measured.joint for one in seen}):
        own = [one for one in seen if one.measured.joint == joint]
        first, load = own[0].measured.first, min(one.measured.load for one in own)
        modes = [one.modes for one in own]
        found, left = group_joint(joint, modes, first.sample_time, load, first.held, config)
        sure += found
        unsure += left
    return seen_elsewhere(sure, unsure, config)


def _check_sign(measured: Measured) -> None:
    whole = relative_acceleration(measured)
    reliable = whole.coherence >= ReportConfig().coherence
    whole = whole.where(inside(measured.excited, whole.frequency) & reliable)
    slow = whole.within(0.0, _CONFIG.slow)
    slow = slow.within(0.0, _CONFIG.first * float(slow.frequency.min(initial=_CONFIG.slow)))
    if len(slow.frequency) < _CONFIG.fewest:
        return
    cosines = [np.median(one.response.real / np.abs(one.response)) for one in (slow, whole)]
    if max(cosines) < _CONFIG.against:
        first = measured.first
        words = f"joint {measured.joint} accelerates against its input {first.quantity}"
        remedy = f"reverse the sign of {first.quantity}, or of q, in the recipe"
        raise InputRejected("S14", words, where=first.name, remedy=remedy)


def _expected(turned: Turned, arm: Arm | None) -> Expected:
    """Return the level of acceleration to expect, and the inertia behind it."""
    text = turned.controller.model if turned.controller is not None else None
    try:
        controllers = None if text is None else Arm.from_model(parse_model(text))
    except RrridError:
        controllers = None  # a model that cannot be read is one that is not there
    given, theirs = _inertia(arm, turned), _inertia(controllers, turned)
    inertia, source = given, "given model"
    if given is None:
        inertia, source = theirs, "none" if theirs is None else "controller's model"
    if turned.quantity == "tau":
        return Expected(None if inertia is None else 1.0 / inertia, inertia, source)
    level = 1.0 if inertia is None or theirs is None else theirs / inertia
    return Expected(level, inertia, source)


def _inertia(arm: Arm | None, turned: Turned) -> float | None:
    """D_jj in the posture; the angle of joint j itself does not change it.

    A model of friction alone, as a run has where base parameters were refused, knows of none.
    """
    if arm is None:
        return None
    j = turned.joint - 1
    found = float(arm.body.mass_matrix(turned.posture[None], arm.p)[0, j, j])
    return found if found > 0.0 else None
