"""Read from a column's name which quantity it holds, and whether it was measured or commanded.

A name is split into words: at signs, at changes of case, between letters and digits, and where two
known words are joined ("jointpos", "taucmd"). The last word that names a quantity decides:
a "torque current" is a current. English and German are known; of other words, the draft asks.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from pipelines.io.units import UNITS, canonical_unit

MOTION = ("position", "velocity", "acceleration")
_QUANTITIES = {
    "position": "q qpos pos position positions enc encoder ang angle angles theta phi winkel lage"
    " stellung",
    "velocity": "dq qd qdot qvel vel velo velocity velocities speed speeds omega dtheta"
    " geschwindigkeit drehzahl",
    "acceleration": "ddq qdd acc accel acceleration accelerations beschleunigung",
    "torque": "tau torque torques trq tq moment moments mom eff effort efforts drehmoment"
    " drehmomente",
    "current": "i iq isq cur curr current currents amps ampere strom motorstrom",
    "time": "t time times timestamp timestamps stamp clock sec secs second seconds s ms us ns nsec"
    " nanosec nanoseconds usec microsec msec millis zeit zeitstempel uhrzeit",
    "index": "idx index sample samples step steps count counter tick seq frame cycle iteration row",
    "other": "pose ee eef tcp tool flange cart cartesian force forces wrench ft voltage volt"
    " gripper finger fingers status mode error err deviation lag limit flag digital analog quat"
    " quaternion orientation rpy imu temp temperature temperatures temperatur power energy pwm duty"
    " bus supply battery dtau kraft spannung fehler abweichung schleppfehler greifer",
}
_COMMANDED = "cmd command commanded des desired ref reference target targets tgt set setpoint sp"
_COMMANDED += " goal demand plan planned trajectory action d soll sollwert vorgabe"
_MEASURED = (
    "meas measured msr act actual fb feedback feed real present read sensor ist istwert gemessen"
)
_PARTIAL = (
    "ext external gravity grav friction coriolis inertia ff feedforward dist disturb disturbance"
)
_PARTIAL += " contact model modelled calc computed predicted residual est estimated sim rnea bias"
_MOTOR = "motor motors mot rotor drive servo antrieb"
_NOISE = "joint joints jnt axis axes link arm j gelenk achse field data msg value values"
_NOISE += " robot robots header column of the in back"
_WORDS = {kind: frozenset(words.split()) for kind, words in _QUANTITIES.items()}
COMMANDED = frozenset(_COMMANDED.split())
_ORIGINS = {"commanded": COMMANDED, "measured": frozenset(_MEASURED.split())}
_PARTS, _MOTORS = frozenset(_PARTIAL.split()), frozenset(_MOTOR.split())
NOISE = frozenset(_NOISE.split())
_KNOWN = frozenset().union(*_WORDS.values(), *_ORIGINS.values(), _PARTS, _MOTORS, NOISE)
_LONG = frozenset(word for word in _KNOWN if word[1:] and word not in ("in", "of"))
_RELATIVE = ("%", "pct", "percent", "permille", "norm", "normalized", "normalised", "rel", "pu")
_SECONDS = {"sec": "s", "nsec": "ns", "nanosec": "ns", "usec": "us", "msec": "ms"}
_CLOCKS = ("time", "timestamp", "stamp")  # "q.time" is the clock beside a position


@dataclass(frozen=True)
class ColumnName:
    """A column's name, understood as far as its words go."""

    quantity: str  # "position", …, "time", "index", "other"; "" where no word is known
    origin: str  # "measured" | "plain" | "commanded"
    motor: bool  # on the motor's side of the gear
    partial: bool  # a part of the torque, or a computed one
    role: frozenset[str]  # the known words
    unknown: tuple[str, ...]
    numbers: tuple[int, ...]
    unit: str  # named by a part of the name or by the header; "" where neither does


def words_of(name: str) -> list[str]:
    """Return the words and numbers of a name: "measuredJointPos_A1" -> measured joint pos a 1."""
    words: list[str] = []
    for part in re.findall(r"\d+|[^\W\d_]+", name):
        for piece in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[^A-Z]+", part):
            word = piece.lower()
            split = range(1, len(word)) if word not in _KNOWN else ()
            at = next((k for k in split if {word[:k], word[k:]} <= _LONG), len(word))
            words += [part for part in (word[:at], word[at:]) if part]
    return words


def quantity_of(unit: str) -> str:
    """Return the quantity of a unit; "" of any other word."""
    known = UNITS.get(canonical_unit(unit))
    return "position" if unit == "counts" else known.quantity if known is not None else ""


def read_name(column: str, unit: str = "") -> ColumnName:
    """Return what a column's name says; `unit` is what the header adds to it."""
    words, quantity = words_of(column), ""
    nouns = [(word, kind) for word in words for kind, known in _WORDS.items() if word in known]
    kinds = [kind for _, kind in nouns]
    motion = [kind for kind in kinds if kind not in ("time", "index")]
    if "other" in kinds:
        quantity = "other"
    elif nouns:
        quantity = kinds[-1] if nouns[-1][0] in _CLOCKS else (motion or kinds)[-1]
    unit, unit_words = (unit, set()) if unit else _unit_in(column, quantity)
    if quantity != "other":
        quantity = quantity_of(unit) or quantity
    held = set(words)
    now = quantity != "current" and "current" in held  # a "current torque" is the present one
    origin = "measured" if now or held & _ORIGINS["measured"] else "plain"
    return ColumnName(
        quantity,
        "commanded" if held & _ORIGINS["commanded"] else origin,
        motor=bool(held & _MOTORS),
        partial=bool(held & _PARTS),
        role=frozenset(held & (_KNOWN | unit_words)) - NOISE,
        unknown=tuple(w for w in words if not w.isdecimal() and w not in _KNOWN | unit_words),
        numbers=tuple(int(word) for word in words if word.isdecimal()),
        unit=unit,
    )


def unit_called(word: str) -> str:
    """Return a unit as `UNITS` spells it, "nsec" among them; any other word as it is."""
    return _SECONDS.get(word.lower()) or canonical_unit(word)


def _unit_in(column: str, quantity: str) -> tuple[str, set[str]]:
    """Return the unit that a part of the name is, and its words: "pos_deg" -> "deg"."""
    parts = [part for part in re.split(r"[\W_]+", column) if part and not part.isdecimal()]
    for k in range(len(parts) - 1, 0, -1):
        if parts[k].lower() in _RELATIVE:
            return "%", {parts[k].lower()}
        for count in (2, 1):
            said = parts[max(1, k + 1 - count) : k + 1]
            unit = unit_called("/".join(said))
            single = len(unit) == 1 and unit not in ("s", "A")
            known = unit == "counts" or unit in UNITS
            if known and not single and quantity_of(unit) == (quantity or quantity_of(unit)):
                return unit, {word for part in said for word in (part.lower(), *words_of(part))}
    return "", set()
