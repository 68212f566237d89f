"""The report of a friction fit: the verdict, Table III with standard deviations, Figs. 5 and 6, the curve, the ladder."""

from __future__ import annotations

from pipelines.model.friction.result import JointResult, Result, Value
from pipelines.report.friction_figures import curve_figure, fraction_figure, simulation_figure
from pipelines.report.report import Report, Section, Table, Tone
from pipelines.report.sections import checks_table
from pipelines.report.style import format_number, with_std

__all__ = ["friction_report"]

_GOOD = 0.05  # of the speed error without friction: what the law has to leave


def friction_report(result: Result) -> Report:
    """The verdict first; then every joint's law, figures and ladder."""
    sections = [_summary(result), *(section for joint in result.joints for section in _joint_sections(joint))]
    if result.checks:
        sections.append(Section("What the logs say of themselves", (), (checks_table(result.checks),)))
    return Report("Friction", _verdict(result), _tone(result), _key_figures(result), tuple(sections))


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
    if not joint.validation.by:
        return True  # nothing was simulated
    ratio = _ratio(joint)
    return ratio is not None and ratio <= _GOOD


def _tone(result: Result) -> Tone:
    if any(check.gate for check in result.checks):
        return "bad"
    return "good" if all(_well(joint) for joint in result.joints) and not any(j.unseen for j in result.joints) else "attention"


def _verdict(result: Result) -> str:
    laws = "; ".join(f"{joint.name}: {_plain(joint.law)}" for joint in result.joints)
    poor = [joint.name for joint in result.joints if not _well(joint)]
    open_ = [joint.name for joint in result.joints if joint.unseen]
    words = f"{laws[:1].upper()}{laws[1:]}."
    if gates := [check.message for check in result.checks if check.gate]:
        words = f"{gates[0][:1].upper()}{gates[0][1:]}. {words}"
    if poor:
        words += f" The simulation of {', '.join(poor)} does not follow the measurement well."
    if open_:
        words += f" What the logs of {', '.join(open_)} leave open is listed with what to record."
    return words


def _plain(law: str) -> str:
    return law.replace("_", " ").replace("+", " + ")


def _key_figures(result: Result) -> Table:
    rows = []
    for joint in result.joints:
        gravity = ", ".join(with_std(value.value, value.std) for _, value in _gravity(joint))
        ratio = _ratio(joint)
        rows.append((joint.name, _plain(joint.law), with_std(joint.inertia.value, joint.inertia.std), gravity,
                     None if ratio is None else 100.0 * ratio))
    return Table(("joint", "law", "inertia [kg m^2]", "gravity: sine, cosine [N m]", "speed error, friction in / left out [%]"),
                 tuple(rows))


def _summary(result: Result) -> Section:
    """Table III, which the print of the paper has lost."""
    names = sorted({name for joint in result.joints for name in joint.parameters})
    rows = []
    for name in names:
        having = [joint.parameters.get(name) for joint in result.joints]
        unit = next(value.unit for value in having if value is not None)
        rows.append((name, *(None if value is None else with_std(value.value, value.std) for value in having), unit))
    rows.append(("J", *(with_std(joint.inertia.value, joint.inertia.std) for joint in result.joints), "kg m^2"))
    for name in dict.fromkeys(key for joint in result.joints for key, _ in _gravity(joint)):
        found = [joint.gravity.get(name) for joint in result.joints]
        rows.append((f"gravity, {name}", *(None if v is None else with_std(v.value, v.std) for v in found), "N m"))
    text = ("Compare curves, not labels: several sets of numbers give one curve.",)
    table = Table(("parameter", *(joint.name for joint in result.joints), "unit"), tuple(rows), "Table III: value ± std.")
    return Section("Parameters", text, (table,))


def _joint_sections(joint: JointResult) -> tuple[Section, ...]:
    revolute = joint.inertia.unit == "kg m^2"
    curve = curve_figure(f"curve-{joint.joint}", f"{joint.name}: the fitted law with its band; the points pair torques at equal "
                         "position and opposite speed and know of no law.", joint.series, revolute)
    parts = fraction_figure(f"fractions-{joint.joint}", f"{joint.name}: torque of {joint.validation.by} and its fractions in the "
                            "simulation (Fig. 5).", joint.series, revolute)
    simulated = simulation_figure(f"simulation-{joint.joint}", f"{joint.name}: measured and simulated motion (Fig. 6). Gravity is "
                                  "compensated at the measured position.", joint.series, revolute)
    alone = (Section(f"{joint.name}: simulation", _simulation_words(joint), (), (simulated, parts)),) if joint.validation.by else ()
    return (Section(f"{joint.name}: friction", _words(joint), _tables(joint), (curve,)), *alone,
            Section(f"{joint.name}: choice of the law", _ladder_words(joint), (_ladder(joint),)))


def _words(joint: JointResult) -> tuple[str, ...]:
    slowest, fastest = joint.driven
    unit = "rad/s" if joint.inertia.unit == "kg m^2" else "m/s"
    words = [f"Driven from {format_number(slowest, 2)} to {format_number(fastest, 3)} {unit}; logs: {', '.join(joint.logs)}."]
    if joint.held is not None:
        low, high = joint.held
        words.append(f"At rest friction carried from {format_number(low, 3)} to {format_number(high, 3)} N m.")
    return tuple(words)


def _tables(joint: JointResult) -> tuple[Table, ...]:
    tables = []
    if joint.break_away:
        tables.append(Table(("direction", "break-away torque", "unit", "events"), tuple(
            ("forth" if event.direction > 0 else "back", with_std(event.torque.value, event.torque.std), event.torque.unit,
             event.events) for event in joint.break_away), "Mean ± std of one event; reported, not part of the law."))
    if joint.unseen:
        tables.append(Table(("not shown by these logs", "what to record"), tuple((gap.what, gap.record) for gap in joint.unseen),
                            tones=tuple("attention" for _ in joint.unseen)))
    return tuple(tables)


def _simulation_words(joint: JointResult) -> tuple[str, ...]:
    judged = joint.validation
    with_, without = judged.velocity_error_with, judged.velocity_error_without
    log = f"{judged.by}, {'which was held out' if judged.held_out else 'which was fitted too, for no log has role validate'}"
    errors = [format_number(value, 3) if value is not None else "no end" for value in (with_, without)]
    return (f"Simulated from its first sample under the torque of {log}: the speed is off by {errors[0]} rad/s rms with friction, "
            f"by {errors[1]} rad/s without.",)


def _ladder_words(joint: JointResult) -> tuple[str, ...]:
    judge = "held-out logs" if joint.judged_by == "logs" else "held-out blocks of the fitted logs"
    if len(joint.ladder) == 1:
        return ("The law was given.",)
    return (f"Every law was fitted on one part and judged on {judge}; the simplest that is not measurably worse than the best was "
            "taken.",)


def _ladder(joint: JointResult) -> Table:
    rows = []
    tones: list[Tone] = []
    for rung in joint.ladder:
        verdict = "chosen" if rung.chosen else rung.reason or ("not worse" if rung.alike else "worse")
        rows.append((_plain(rung.law), rung.size, 1e3 * rung.identify_rms, 1e3 * rung.validate_rms, verdict))
        tones.append("good" if rung.chosen else "neutral")
    return Table(("law", "numbers", "left, fitted [mN m]", "left, held out [mN m]", ""), tuple(rows),
                 "Root mean square of what is left of mean torques over windows.", tuple(tones))
