"""Judge one answer against the sealed one, strictly: a finding is true where cause and joint are.

`right` asks of each family what the issue's table asks; everything else is counted apart from it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from benchmarks.hidden_effects.make import Sealed
from benchmarks.hidden_effects.verdict import Found, Said

# What a finding is measured by (issue 9), with the name that causes.md gives it.
MEASURED: dict[str, tuple[str, ...]] = {
    "torque_offset": ("offset",),
    "torque_gain": ("gain_error",),
    "time_delay": ("delay",),
    "gravity_tilt": ("angle",),
    "link_length": ("error",),
    "payload": ("mass",),
    "torque_saturation": ("limit",),
    "cogging": ("order", "amplitude"),
    "rotor_inertia": ("inertia",),
    "drive_lag": ("time_constant",),
    "torque_lag": ("time_constant",),
    "encoder_eccentricity": ("amplitude",),
}
_ANGLES = {
    "cogging": ("phase",),
    "gravity_tilt": ("direction",),
    "encoder_eccentricity": ("phase",),
}
SHARE, STDS = 0.05, 3.0
_MASS = 0.03  # of a payload against reference logs
_ANGLE = 0.05  # [rad]


@dataclass(frozen=True)
class Score:
    """One case, judged."""

    key: str
    family: str
    truth: tuple[str, ...]  # causes; of an outside one its kind
    strength: float | None
    verdict: str
    named: tuple[str, ...]  # causes of all findings
    right: bool
    true: int = 0  # findings that are a true cause
    wrong: int = 0  # findings that are no true cause
    joint: bool | None = None  # of the first finding, where one joint is to be named
    parameters: tuple[tuple[str, bool], ...] = ()  # "cogging order", whether it agrees
    angles: tuple[tuple[str, bool], ...] = ()
    residual: float | None = (
        None  # held-out residual over the noise floor, with all findings, of the worst joint
    )
    simulated: bool | None = (
        None  # the simulated position error fell; None: nothing was named, or nothing simulated
    )
    seconds: float = math.nan
    case: Mapping[str, Any] = field(default_factory=dict)


def score(
    sealed: Sealed, said: Said, seconds: float = math.nan, without: Sequence[str] = ()
) -> Score:
    """Judge what was said of the logs of `sealed`, `without` the causes left out of the library."""
    truths = list(sealed.findings)
    pairs = [
        (found, next((truth for truth in truths if same_place(found, truth)), None))
        for found in said.findings
    ]
    true = [(found, truth) for found, truth in pairs if truth is not None]
    first = said.findings[0] if said.findings else None
    named = [(name, ok) for found, truth in true for name, ok in _compared(found, truth, MEASURED)]
    angles = [(name, ok) for found, truth in true for name, ok in _compared(found, truth, _ANGLES)]
    kinds = tuple(truth.get("kind", truth["cause"]) for truth in truths)
    return Score(
        sealed.key,
        "taken out" if without else sealed.family,
        kinds,
        sealed.strength,
        said.verdict,
        tuple(found.cause for found in said.findings),
        _right(sealed, said, true, without),
        len(true),
        len(pairs) - len(true),
        _joint(first, truths),
        tuple(named),
        tuple(angles),
        _over_floor(said, said.floor) if true else None,
        _fell(said.findings) if true else None,
        seconds,
        sealed.case,
    )


def same_place(found: Found, truth: Mapping[str, Any]) -> bool:
    """Return whether a finding is this cause. A transmission that couples i with j couples j with
    i.
    """
    if found.cause != truth["cause"]:
        return False
    other = truth["parameters"].get("with_joint")
    if other is None or found.joint == truth["joint"]:
        return bool(found.joint == truth["joint"])
    return bool(
        found.joint == other
        and found.parameters.get("with_joint", (None, 0.0))[0] == truth["joint"]
    )


def _right(sealed: Sealed, said: Said, true: Sequence[object], without: Sequence[str]) -> bool:
    if without:
        return said.verdict == "unknown"
    match sealed.verdict:
        case "cause" if sealed.family == "pairs":
            return len(true) == len(sealed.findings)
        case "cause" if sealed.family == "compliance":  # of the four, which
            return bool(said.findings) and said.findings[0].cause == sealed.findings[0]["cause"]
        case "cause" if sealed.family == "payload":
            return _first(sealed, said) and _agreed(
                said.findings[0], sealed.findings[0], "mass", _MASS, 0.0
            )
        case "cause":
            return _first(sealed, said)
        case "not-testable":
            return not said.findings and all(
                said.not_identifiable.get(truth["cause"]) for truth in sealed.findings
            )
        case "flagged":
            return said.verdict in ("cause", "unknown")
        case expected:
            return said.verdict == expected


def _first(sealed: Sealed, said: Said) -> bool:
    return (
        said.verdict == "cause"
        and bool(said.findings)
        and same_place(said.findings[0], sealed.findings[0])
    )


def _joint(first: Found | None, truths: Sequence[Mapping[str, Any]]) -> bool | None:
    """Return whether the first finding is at a joint where something is; None where nothing was
    named or nothing is at a joint.
    """
    if (
        first is None
        or not truths
        or any(truth["cause"] == "unknown" or truth["joint"] is None for truth in truths)
    ):
        return None
    joints = {truth["joint"] for truth in truths}
    return first.joint in joints | {
        truth["parameters"]["with_joint"] for truth in truths if "with_joint" in truth["parameters"]
    }


def _compared(
    found: Found, truth: Mapping[str, Any], names: Mapping[str, tuple[str, ...]]
) -> list[tuple[str, bool]]:
    angular = names is _ANGLES
    return [
        (
            f"{found.cause} {name}",
            _agreed_angle(found, truth, name)
            if angular
            else _agreed(found, truth, name, SHARE, STDS),
        )
        for name in names.get(found.cause, ())
    ]


def _agreed(found: Found, truth: Mapping[str, Any], name: str, share: float, stds: float) -> bool:
    value, std = found.parameters.get(name, (None, 0.0))
    if value is None:
        return False
    if name == "amplitude":  # of a sine: its sign is a matter of the phase
        value, true = abs(value), abs(truth["parameters"][name])
    else:
        true = truth["parameters"][name]
    return agrees(value, std, true, share, stds)


def agrees(value: float, std: float, true: float, share: float = SHARE, stds: float = STDS) -> bool:
    """Within a share of the truth, or so many standard deviations."""
    return abs(value - true) <= max(share * abs(true), stds * std)


def _agreed_angle(found: Found, truth: Mapping[str, Any], name: str) -> bool:
    """Modulo 2π; a negative amplitude turns the phase by π."""
    value, std = found.parameters.get(name, (None, 0.0))
    if value is None:
        return False
    turned = math.pi if found.parameters.get("amplitude", (1.0, 0.0))[0] < 0.0 else 0.0
    away = math.remainder(value + turned - truth["parameters"][name], 2.0 * math.pi)
    return abs(away) <= max(_ANGLE, STDS * std)


def _over_floor(said: Said, floors: Sequence[float]) -> float:
    """Largest over the joints of the held-out residual with every finding over a floor; NaN where
    there is none.
    """
    after = said.findings[-1].torque_after
    shares = [
        rms / floor if floor > 0.0 else math.nan for rms, floor in zip(after, floors, strict=True)
    ]
    return math.nan if not shares or any(math.isnan(share) for share in shares) else max(shares)


def _fell(findings: Sequence[Found]) -> bool | None:
    """Return whether the simulated position error is smaller with all findings than without any."""
    if findings[0].simulated is None or findings[-1].simulated is None:
        return None
    return findings[-1].simulated[1] < findings[0].simulated[0]
