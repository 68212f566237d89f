"""The report of a friction fit: the verdict, Table III with standard deviations, Figs. 5 and 6, the curve, the ladder."""

from __future__ import annotations

import re

import numpy as np

from pipelines.model.effects import find_effect
from pipelines.model.friction.breakaway import BreakAwayConfig
from pipelines.model.friction.findings import NAMED, FindingsConfig, depends_in_words, drift_in_words, inertia_in_words
from pipelines.model.friction.fit import Value
from pipelines.model.friction.laws import law_named
from pipelines.model.friction.result import JointResult, Result
from pipelines.model.words import plain_number
from pipelines.report.diagnosis_words import spoken
from pipelines.report.friction_figures import curve_figure, fraction_figure, ripple_figure, simulation_figure
from pipelines.report.report import Report, Section, Table, Tone
from pipelines.report.sections import checks_table
from pipelines.report.style import format_number, format_unit, with_std

__all__ = ["friction_report", "ripple_in_words"]

_GOOD = 0.05  # of the speed error without friction: what the law has to leave
_GOOD_TORQUE = 0.1  # of held-out torque, where nothing was simulated: the same
_THIN = 0.01  # of the curve: a narrower band is hidden by the line


def friction_report(result: Result) -> Report:
    """The verdict first; then every joint's law, figures and ladder."""
    sections = [_summary(result), *(section for joint in result.joints for section in _joint_sections(joint))]
    if result.checks:
        sections.append(Section("Data quality", (), (checks_table(result.checks),)))
    return Report("Friction", _verdict(result), _tone(result), _key_figures(result), tuple(sections))


_GRAVITY = {"sine": "c in c sin q + c' cos q", "cosine": "c' in c sin q + c' cos q", "constant": "weight along the axis"}


def _ratio(joint: JointResult) -> float | None:
    """Speed error of the simulation with friction over that without."""
    judged = joint.validation
    if judged.velocity_error_with is None:
        return None
    if judged.velocity_error_without is None:
        return 0.0
    return judged.velocity_error_with / judged.velocity_error_without if judged.velocity_error_without > 0.0 else None


def _gravity(joint: JointResult) -> list[tuple[str, Value]]:
    return [(name, joint.gravity[name]) for name in ("sine", "cosine", "constant") if name in joint.gravity]


def _well(joint: JointResult) -> bool:
    if not joint.validation.by:  # nothing was simulated
        return joint.moved and joint.validation.torque_error is not None and joint.validation.torque_error < _GOOD_TORQUE
    ratio = _ratio(joint)
    return ratio is not None and ratio <= _GOOD


def _tone(result: Result) -> Tone:
    if any(check.gate for check in result.checks):
        return "bad"
    open_ = any(joint.unseen or joint.ripple for joint in result.joints)
    return "good" if all(_well(joint) for joint in result.joints) and not open_ else "attention"


def _verdict(result: Result) -> str:
    laws = ". ".join(_law_and_errors(joint) for joint in result.joints)
    poor = [joint.name for joint in result.joints if joint.validation.by and not _well(joint)]
    open_ = [joint.name for joint in result.joints if joint.unseen]
    words = f"{laws}."
    if any(joint.validation.by and not joint.validation.held_out for joint in result.joints):
        words += " Simulated were logs that were fitted too, for no friction log has role validate."
    if gates := [check.message for check in result.checks if check.gate]:
        words = f"{gates[0][:1].upper()}{gates[0][1:]}. {words}"
    if poor:
        words += f" The simulation of {', '.join(poor)} does not follow the measurement well."
    words += "".join(f" {words}" for joint in result.joints if (words := ripple_in_words(joint)))
    words += "".join(f" {words}" for joint in result.joints if (words := drift_in_words(joint)))
    if open_:
        words += f" What the logs of {', '.join(open_)} leave open is listed with what to record."
    return words


def _law_and_errors(joint: JointResult) -> str:
    """The law, and how far the simulated speed is off with it and without."""
    judged = joint.validation
    if not joint.moved:
        return f"{_capital(joint.name)} does not move in these logs, and they show nothing of it"
    words = f"{_capital(joint.name)}: {_plain(joint.law)}"
    if not judged.by:
        error = judged.torque_error
        if error is None or error >= FindingsConfig().poor:  # the finding says it
            return words
        return f"{words}, which leaves {format_number(100.0 * error, 2)} % of held-out torque (rms)"
    with_, without, unit = judged.velocity_error_with, judged.velocity_error_without, _speed_unit(joint)
    if with_ is None:
        beside = ", with friction and without" if without is None else f" ({_off(without, unit)} without friction)"
        return f"{words}; the simulation runs away{beside}"
    beside = "without friction it runs away" if without is None else f"{format_number(without, 3)} without friction"
    return f"{words}, simulated speed {_off(with_, unit)} ({beside})"


def _off(error: float | None, unit: str) -> str:
    """How far a simulated speed is from the measured one; None is no figure, but an arm that runs away."""
    return "runs away from it" if error is None else f"off by {format_number(error, 3)} {unit} rms"


def _speed_unit(joint: JointResult) -> str:
    return "rad/s" if joint.revolute else "m/s"


def _plain(law: str) -> str:
    return (law.replace("three_sigmoid", "three sigmoids").replace("stribeck", "Stribeck").replace("coulomb", "Coulomb")
            .replace("_", " ").replace("+", " + "))


def _called(name: str) -> str:
    """"Coulomb friction, level" for "coulomb.level"; the paper's own letters stay."""
    effect, dot, quantity = name.partition(".")
    return f"{find_effect(effect).words.title}, {spoken(quantity)}" if dot else name


def _meaning(joint: JointResult, name: str) -> str:
    """Return the meaning of a number of the joint's law."""
    effect, _, quantity = name.rpartition(".")
    members = (effect,) if effect else law_named(joint.law).members
    return next((q.meaning for member in members for q in find_effect(member).parameters if q.name == quantity), "")


def _key_figures(result: Result) -> Table:
    rows = []
    simulated = any(joint.validation.by for joint in result.joints)
    for joint in result.joints:
        gravity = ", ".join(with_std(value.value, value.std) for _, value in _gravity(joint))
        error = _ratio(joint) if simulated else joint.validation.torque_error
        rows.append((joint.name, _plain(joint.law), with_std(joint.inertia.value, joint.inertia.std), gravity,
                     None if error is None else 100.0 * error))
    return Table(("joint", "law", "inertia [kg m^2]", "gravity: sine, cosine [N m]",
                  "speed error, friction in / left out [%]" if simulated else "held-out torque that is left, rms [%]"), tuple(rows))


def _summary(result: Result) -> Section:
    """Table III, which the print of the paper has lost."""
    names = sorted({name for joint in result.joints for name in joint.parameters})
    rows, meanings = [], []
    for name in names:
        having = [joint.parameters.get(name) for joint in result.joints]
        first = next(joint for joint in result.joints if name in joint.parameters)
        rows.append((_called(name), *(None if value is None else with_std(value.value, value.std) for value in having),
                     format_unit(first.parameters[name].unit)))
        meanings.append((_called(name), _meaning(first, name)))
    rows.append(("J", *(with_std(joint.inertia.value, joint.inertia.std) for joint in result.joints),
                 format_unit(result.joints[0].inertia.unit) if result.joints else ""))
    meanings.append(("J", "inertia about the joint, the others held"))
    for name in dict.fromkeys(key for joint in result.joints for key, _ in _gravity(joint)):
        found = [joint.gravity.get(name) for joint in result.joints]
        unit = next(value.unit for value in found if value is not None)
        rows.append((f"gravity, {name}", *(None if v is None else with_std(v.value, v.std) for v in found), unit))
        meanings.append((f"gravity, {name}", _GRAVITY[name]))
    text = ("Compare curves, not labels: several sets of numbers give one curve.",)
    table = Table(("parameter", *(joint.name for joint in result.joints), "unit"), tuple(rows),
                  "As Table III of Kostić et al. 2004: value ± std.", keeps_empty=True)
    return Section("Parameters", text, (table, Table(("parameter", "what it is"), tuple(meanings))))


def _joint_sections(joint: JointResult) -> tuple[Section, ...]:
    revolute = joint.revolute
    points = ("the points pair torques at equal position and opposite speed and know of no law" if len(joint.series.map_speed) else
              "no torques at equal position and opposite speed were found to hold it against")
    curve = curve_figure(f"curve-{joint.joint}", f"{joint.name}: the fitted law, {_band(joint)}; {points}.", joint.series, revolute)
    parts = fraction_figure(f"fractions-{joint.joint}", f"{joint.name}: torque of {joint.validation.by} and its fractions in the "
                            "simulation.", joint.series, revolute)
    simulated = simulation_figure(f"simulation-{joint.joint}", f"{joint.name}: measured and simulated motion. Gravity is "
                                  "compensated at the measured position.", joint.series, revolute)
    alone = (Section(f"{joint.name}: simulation", _simulation_words(joint), (), (simulated, parts)),) if joint.validation.by else ()
    return (Section(f"{joint.name}: friction", _words(joint), _tables(joint), (curve,)), *_ripple_section(joint), *alone,
            Section(f"{joint.name}: choice of the law", _ladder_words(joint), (_ladder(joint),)))


def ripple_in_words(joint: JointResult) -> str:
    """Return the size of a ripple, and why it is no friction; empty where there is none."""
    ripple = joint.ripple
    if ripple is None:
        return ""
    return (f"Most of what the law leaves at {joint.name} is no friction: {with_std(ripple.rms.value, ripple.rms.std)} "
            f"{ripple.rms.unit} rms of it {depends_in_words(joint, ripple)}.")


def _ripple_section(joint: JointResult) -> tuple[Section, ...]:
    """Its size, what it does to the inertia, what to do, and the torque by angle."""
    ripple = joint.ripple
    if ripple is None:
        return ()
    place = "angle" if joint.revolute else "position"
    figure = ripple_figure(f"ripple-{joint.joint}", f"{joint.name}: what friction and inertia leave, by the {place} of the joint: "
                           "the same forth and back, as no friction is.", ripple.along, joint.revolute)
    inertia = inertia_in_words(joint, ripple, lambda value: f"{with_std(value.value, value.std)} {format_unit(value.unit)}")
    text = (f"{ripple_in_words(joint)} It explains {format_number(100.0 * ripple.share, 2)} % of the law's residual on held-out "
            f"blocks (mean square).{inertia and f' {inertia}.'}", f"{_capital(NAMED)}.")
    return (Section(f"{joint.name}: a torque of the {place}", text, (), (figure,)),)


def _band(joint: JointResult) -> str:
    """In words how wide the band about the curve is."""
    width, height = 2.0 * float(np.max(joint.series.band)), float(np.max(np.abs(joint.series.curve)))
    unit = "N m" if joint.revolute else "N"
    if not np.isfinite(width) or height <= 0.0:
        return "its band is not known"
    hidden = ", narrower than the line" if width < _THIN * height else ""
    return f"± 2 std shaded: at most ± {format_number(width, 2)} {unit}{hidden}"


def _words(joint: JointResult) -> tuple[str, ...]:
    slowest, fastest = joint.driven
    unit = _speed_unit(joint)
    words = [f"Driven from {format_number(slowest, 2)} to {format_number(fastest, 3)} {unit}, for which the law holds; "
             f"logs: {', '.join(joint.logs)}."]
    words += [text for text in (drift_in_words(joint),
                                _sticking_in_words(joint)) if text]
    if joint.held is not None:
        low, high = joint.held
        words.append(f"At rest friction carried from {format_number(low, 3)} to {format_number(high, 3)} N m.")
    if joint.validation.by and (never := _never_broke_away(joint)):
        how = BreakAwayConfig()
        words.append(f"No break-away torque {' or '.join(never)} is given: nowhere in these logs does the joint rest for "
                     f"{how.rest:g} s and then run that way within {how.within:g} s. A slow ramp of torque from rest shows it, "
                     "where the joint does not creep for longer before it runs.")
    return tuple(words)


def _sticking_in_words(joint: JointResult) -> str:
    """How many rows are left out, and why."""
    sticking = joint.sticking
    if sticking is None:
        return ""
    travel = f"{plain_number(sticking.distance)} {'rad' if joint.revolute else 'm'}"
    words = (f"{plain_number(100.0 * sticking.share)} % of the rows of {joint.name} are left out: the joint rests or bends its "
             f"contacts there, up to a travel of {travel}, and friction is no function of its speed.")
    if sticking.slips:
        words += (f" It sticks and slips on {sticking.slips} times amid motion one way: only the slips are fitted, and the law "
                  "holds from the slowest speed that was driven on. Drive faster or with a stiffer loop to see slower sliding.")
    return words


def _never_broke_away(joint: JointResult) -> list[str]:
    seen = {event.direction for event in joint.break_away}
    return [words for side, words in ((1, "forth"), (-1, "back")) if side not in seen]


def _tables(joint: JointResult) -> tuple[Table, ...]:
    tables = []
    if joint.break_away:
        tables.append(Table(("direction", "break-away torque", "unit", "events"), tuple(
            ("forth" if event.direction > 0 else "back", with_std(event.torque.value, event.torque.std), event.torque.unit,
             event.events) for event in joint.break_away), "Mean ± std of one event; reported, not part of the law."))
    if joint.unseen:
        tables.append(Table(("not shown by these logs", "what to record"), tuple(
            (gap.what, gap.record) for gap in joint.unseen),
                            tones=tuple("attention" for _ in joint.unseen)))
    return tuple(tables)


def _simulation_words(joint: JointResult) -> tuple[str, ...]:
    judged = joint.validation
    log = f"{judged.by}, {'which was held out' if judged.held_out else 'which was fitted too, for no log has role validate'}"
    with_, without = (_off(value, _speed_unit(joint)) for value in (judged.velocity_error_with, judged.velocity_error_without))
    return (f"Simulated from its first sample under the torque of {log}, beside the measured speed: {with_} with friction, "
            f"{without} without.",)


def _ladder_words(joint: JointResult) -> tuple[str, ...]:
    judge = "held-out logs" if joint.judged_by == "logs" else "held-out blocks of the fitted logs"
    if len(joint.candidate_laws) == 1:
        return ("The law was given.",)
    return (f"Every law was fitted on one part and judged on {judge}; the simplest that is not measurably worse than the best was "
            "taken.", *_why_not_plainer(joint))


def _why_not_plainer(joint: JointResult) -> tuple[str, ...]:
    """Return by how much the held-out error of the best law with fewer numbers is larger."""
    chosen = next(rung for rung in joint.candidate_laws if rung.chosen)
    plainer = [rung for rung in joint.candidate_laws if rung.size < chosen.size and not rung.reason]
    if not plainer or min(rung.validate_rms for rung in joint.candidate_laws) <= 0.0:
        return ()
    plain = min(plainer, key=lambda rung: rung.validate_rms)
    best = min([rung for rung in joint.candidate_laws if not rung.reason] or [chosen], key=lambda rung: rung.validate_rms)
    more = format_number(100.0 * (plain.validate_rms / best.validate_rms - 1.0), 2)  # than the best: what chance was asked of
    than = "" if best is chosen else f" than {_plain(best.law)}, the best of all"
    return (f"{_capital(_plain(chosen.law))}, with {chosen.size} numbers, and not {_plain(plain.law)}, the best law with fewer "
            f"({plain.size}): that leaves {more} % more of what was held out (rms){than}, more than chance allows.",)


def _capital(words: str) -> str:
    return words[:1].upper() + words[1:]


def _plain_reason(reason: str) -> str:
    """With "amplitude of presliding" for "presliding.amplitude": names of settings are no words."""
    return _plain(re.sub(r"\b([a-z]\w*)\.([a-z]\w*)", r"\2 of \1", reason))


def _ladder(joint: JointResult) -> Table:
    rows = []
    tones: list[Tone] = []
    for rung in joint.candidate_laws:
        verdict = "chosen" if rung.chosen else _plain_reason(rung.reason) or ("not worse" if rung.alike else "worse")
        rows.append((_plain(rung.law), rung.size, 1e3 * rung.identify_rms, 1e3 * rung.validate_rms, verdict))
        tones.append("good" if rung.chosen else "neutral")
    return Table(("law", "numbers", "left, fitted [mN m]", "left, held out [mN m]", ""), tuple(rows),
                 "Root mean square of the residual of mean torques over windows.", tuple(tones))
