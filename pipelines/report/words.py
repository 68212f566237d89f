"""The words of causes, parameters and units that several reports share.

named("cogging", 2)                                     "cogging at joint 2"
figure_in_words("extend model cogging joint 2 amplitude 2")
                                    "extend model: cogging at joint 2, second amplitude"
units_in(diagnosis).torque          "N m or N" where some joints turn and some slide
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pipelines.dynamics.parameter_names import named_in, numbered, part_of
from pipelines.effects import effect_names, find_effect
from pipelines.estimation.nominal import within
from pipelines.report.document import capital, sentence
from pipelines.report.finding_words import other_joint
from pipelines.report.style import enumerated, format_unit, unit_in_words, with_std

if TYPE_CHECKING:
    from pipelines.diagnosis.result import Diagnosis, Extension, Finding, Rejected, Value
    from pipelines.estimation.preparation import FewerTerms
    from pipelines.excitation.verify import Peak

_COUNTED = ("second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth")
_KEY = re.compile(r"\b([a-z]+(?:_[a-z]+)*)(?::(\d+)(?::([a-z]+(?:_[a-z]+)*))?)?\b")
_TURNING = {"position": "rad", "speed": "rad/s", "acceleration": "rad/s^2", "torque": "N m"}


def cause_at(cause: str, joint: int | None) -> str:
    """As causes are written on the command line."""
    return cause if joint is None else f"{cause}:{joint}"


def title_of(cause: str) -> str:
    """Plain words for a cause."""
    return find_effect(cause).words.title if cause in effect_names() else cause


def named(cause: str, joint: int | None) -> str:
    """A cause and its joint within a sentence: "cogging at joint 2"."""
    words = within(title_of(cause))
    return words if joint is None else f"{words} at joint {joint}"


def together(found: Iterable[Finding | Rejected]) -> list[tuple[str, str]]:
    """(cause, words) of each cause once with its joints: "Stribeck friction at joints 1 and 3"."""
    places = []
    for one in found:
        parameters = getattr(one, "parameters", None)  # a rejected cause has none
        other = other_joint(parameters) if parameters else ""
        places.append((one.cause, f"{one.joint or ''}{f' ({other})' if other else ''}"))
    return at_places(places)


def at_places(places: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """The same of (cause, joint in words) each; of the whole arm the joint is ""."""
    joints: dict[str, dict[str, None]] = {}
    for cause, joint in places:  # several orders at one joint count once
        joints.setdefault(cause, {})[joint] = None
    found = []
    for cause, own in joints.items():
        words, numbers = named(cause, None), [joint for joint in own if joint]
        if numbers:
            words += f" at joint{'s' * (len(numbers) > 1)} {enumerated(numbers)}"
            words += " and at all joints together" * ("" in own)
        found.append((cause, words))
    return found


def spoken(parameter: str) -> str:
    """A parameter's key in words: "second amplitude" for "amplitude_2"."""
    name, number = numbered(parameter)
    return (name if number < 2 else f"{_counted(number)} {name}").replace("_", " ")


def _counted(number: int) -> str:
    """ "second", "third", … "11th", from 2 on."""
    if number < len(_COUNTED) + 2:
        return _COUNTED[number - 2]
    teens = number % 100 in (11, 12, 13)
    return f"{number}{'th' if teens else {1: 'st', 2: 'nd', 3: 'rd'}.get(number % 10, 'th')}"


def meaning_of(cause: str, parameter: str) -> str:
    """Return the meaning of a parameter of an effect; "" where it has none."""
    known = find_effect(cause).parameters if cause in effect_names() else ()
    own, which = part_of(cause, parameter)
    meaning = next((q.meaning for q in known if q.name == own), "")
    if meaning and which > 1:
        meaning = f"{meaning}; of the {_counted(which)} one at this joint"
    for q in known:
        meaning = meaning.replace(q.name, spoken(q.name)) if "_" in q.name else meaning
    return meaning


def without_keys(text: str) -> str:
    """A stored reason as people read it: "cogging at joint 2" for "cogging:2".

    A parameter behind them stands before: "level of Coulomb friction at joint 1" for
    "coulomb:1:level".
    """

    def in_words(found: re.Match[str]) -> str:
        cause, joint = found[1], found[2]
        if cause not in effect_names() or (joint is None and "_" not in cause):
            return found[0]
        place = named(cause, None if joint is None else int(joint))
        return f"{spoken(found[3])} of {place}" if found[3] else place

    return _KEY.sub(in_words, text)


def format_value(value: Value) -> str:
    """ "0.102 ± 0.003", or three of them."""
    values = value.value if isinstance(value.value, tuple | list) else (value.value,)
    stds = value.std if isinstance(value.std, tuple | list) else (value.std,) * len(values)
    return ", ".join(with_std(x, s) for x, s in zip(values, stds, strict=True))


def format_values(parameters: Iterable[tuple[str, Value]]) -> str:
    """ "order 18 per rev, exponent 2": names, values and units in one line."""
    return ", ".join(
        f"{spoken(name)} {format_value(value)} {unit_in_words(value.unit)}".strip()
        for name, value in parameters
    )


def unit_or_dash(unit: str) -> str:
    """In a table: a pure number has no unit to show."""
    return "–" if unit == "1" else format_unit(unit)


def in_order(cause: str, parameters: Mapping[str, Value]) -> list[tuple[str, Value]]:
    """The parameters as the effect lists them; JSON sorts them by name."""
    known = [q.name for q in find_effect(cause).parameters] if cause in effect_names() else []

    def rank(item: tuple[str, Value]) -> tuple[int, int, str]:
        own, which = part_of(cause, item[0])
        return which, known.index(own) if own in known else len(known), item[0]

    return sorted(parameters.items(), key=rank)


def figure_in_words(name: str, within: bool = False) -> str:
    """`name`, which `log.result_figures` gave, with its cause in words.

    Args:
        within: it stands within a sentence, and begins small.
    """
    found = named_in(name)
    if found is None:
        return name
    said, parameter = named(found.cause, found.joint), found.what
    if found.of_law:  # a parameter of an effect of the law, of the law, or of the joint itself
        effect, dot, quantity = found.what.partition(".")
        effect, own = effect.replace(" ", "_"), found.what.replace(" ", "_")
        if dot and effect in effect_names():
            said, parameter = named(effect, found.joint), quantity
        elif all(q.name != own for q in find_effect(found.cause).parameters):
            said = f"joint {found.joint}"
    if found.before:
        said = f"{found.before}: {said}"
    elif not within:
        said = capital(said)
    return f"{said}, {spoken(parameter)}" if parameter else said


def fewer_words(fewer: Sequence[FewerTerms]) -> tuple[str, ...]:
    """Return one sentence for all joints where the same laws replace the same law."""
    found = []
    for law, taken in dict.fromkeys((one.law, one.taken) for one in fewer):
        alike = [one for one in fewer if (one.law, one.taken) == (law, taken)]
        titles = [title_of(name) for name in taken]
        found.append(sentence("fewer", title_of(law), alike, titles))
    return tuple(found)


@dataclass(frozen=True)
class Units:
    """Of all joints together, or of one."""

    turning: tuple[bool, ...] = ()  # joint by joint; none: all turn

    @property
    def torque(self) -> str:
        return joined(("N m" if turns else "N" for turns in self.turning), "N m")

    @property
    def position(self) -> str:
        return joined(("rad" if turns else "m" for turns in self.turning), "rad")

    @property
    def thousandths(self) -> str:
        """Of position."""
        return joined(f"m{unit}" for unit in self.position.split(" or "))

    def at(self, joint: int | None) -> Units:
        """Return the units of one joint, from 1; of all for None."""
        if joint is None or joint > len(self.turning):
            return self
        return Units(self.turning[joint - 1 : joint])


def joined(units: Iterable[str], otherwise: str = "") -> str:
    """ "N m or N": each once, in their order; `otherwise` without any."""
    return " or ".join(dict.fromkeys(units)) or otherwise


def unit_of(limits: Iterable[Peak], quantity: str) -> str:
    """Of a quantity of the joints, "rad" or "rad or m"; that of a turning joint without limits."""
    units = (one.unit for one in limits if one.quantity == quantity and one.joint is not None)
    return joined(units, _TURNING[quantity])


def units_in(found: Diagnosis | Extension) -> Units:
    """Return the units of a result: curves over positions in metres are of sliding joints."""
    from pipelines.diagnosis.result import Extension

    if isinstance(found, Extension):
        return Units(found.revolute)
    sliding = {
        curve.joint
        for one in found.evidence
        for curve in one.curves
        if curve.against == "position" and curve.unit == "m"
    }
    return Units(tuple(j + 1 not in sliding for j in range(len(found.residual_rms.identify))))
