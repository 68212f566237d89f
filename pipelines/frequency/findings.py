"""What gives way, from the responses of all joints and postures: base, joint, delay or nothing, each with its evidence.

    found = frf_findings(logs, arm)
    found.classification       what is sure
    found.undecided            what is there and could be more than one thing, and what to record

Kostić et al. 2004, Section IV.D: the base shows at the same frequency in every posture, with a temporary phase lead; what bends in
the arm moves with the posture. A pair of antiresonance and resonance is explained by masses and springs of either kind with the
inertia measured in each posture; the one is chosen that explains all postures far better. Where the postures do not tell, only
what drops out does: a base does not weigh less than the arm it carries. Wrongly naming one for the other is worse than saying
that it is open.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from pipelines.dynamics.arm import Arm
from pipelines.errors import InputRejected
from pipelines.frequency.grouping import Finding, GroupingConfig, Open, group_joint, seen_elsewhere
from pipelines.frequency.modes import BAND, Modes, fitted_modes, relative_acceleration, tells
from pipelines.frequency.rational import Known
from pipelines.frequency.responses import How, Measured, measured_responses
from pipelines.frequency.rigid import Expected, expected_rigid
from pipelines.io.log import ExperimentLog

__all__ = ["Finding", "Findings", "Known", "Open", "Seen", "findings_of", "frf_findings", "grouped"]


@dataclass(frozen=True)
class SignConfig:
    """When a joint accelerates against its input.

    Attributes:
        slow: [Hz] up to which friction and delay turn the phase by less than a right angle
        first: times the lowest excited frequency, up to where the sign is seen first: between two modes the phase is turned round
        reliable: coherence
        fewest: bins
        against: cosine of the phase: beyond 120°
    """

    slow: float = 20.0
    first: float = 2.0
    reliable: float = 0.7
    fewest: int = 3
    against: float = -0.5


_CONFIG = SignConfig()


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
    unusable: tuple[Measured, ...]  # responses in whose band the excitation tells nothing: neither fitted nor named
    classification: tuple[Finding, ...]
    undecided: tuple[Open, ...]


def frf_findings(logs: Iterable[ExperimentLog], arm: Arm | None = None, how: How | None = None,
                 band: tuple[float, float] = BAND) -> Findings:
    """Responses, modes and grouping of "frf" logs.

    Args:
        logs: of experiment "frf", of one robot.
        arm: its model, for the inertia to expect; None: the controller's own, where the logs carry it.
        band: [Hz] in which modes are looked for.

    Raises:
        InputRejected: a log that no spectrum can be taken of, with what to record: S01, T05, T08, D04, D09; S14, a joint that
            accelerates against its input.
    """
    return findings_of(measured_responses(logs, how), arm, band)


def findings_of(measured: Sequence[Measured], arm: Arm | None = None, band: tuple[float, float] = BAND) -> Findings:
    """The same, of responses that are there already."""
    for one in measured:
        _check_sign(one)
    usable = [one for one in measured if tells(one, band)]
    seen = tuple(Seen(one, fitted_modes(one, band), expected_rigid(one, arm)) for one in usable)
    return Findings(seen, tuple(one for one in measured if not tells(one, band)), *grouped(seen))


def grouped(seen: Sequence[Seen], config: GroupingConfig | None = None) -> tuple[tuple[Finding, ...], tuple[Open, ...]]:
    """What is sure, and what is open, from the modes of all joints and postures."""
    sure: list[Finding] = []
    unsure: list[Open] = []
    for joint in sorted({one.measured.joint for one in seen}):
        own = [one for one in seen if one.measured.joint == joint]
        turned = own[0].measured.first
        found, left = group_joint(joint, [one.modes for one in own], turned.sample_time, turned.revolute, turned.held,
                                  [one.measured.load for one in own], config)
        sure += found
        unsure += left
    return seen_elsewhere(sure, unsure, config)


def _check_sign(measured: Measured) -> None:
    whole = relative_acceleration(measured)
    whole = whole.where(measured.excited.holds(whole.frequency) & (whole.coherence >= _CONFIG.reliable))
    slow = whole.within(0.0, _CONFIG.slow)
    slow = slow.within(0.0, _CONFIG.first * float(slow.frequency.min(initial=_CONFIG.slow)))
    if len(slow.frequency) >= _CONFIG.fewest and all(float(np.median(one.response.real / np.abs(one.response))) < _CONFIG.against
                                              for one in (slow, whole)):
        first = measured.first
        raise InputRejected("S14", f"joint {measured.joint} accelerates against its input {first.quantity}", where=first.name,
                            remedy=f"reverse the sign of {first.quantity}, or of q, in the recipe")
