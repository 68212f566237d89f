"""The report of an estimate: the verdict, Table V with standard deviations, and what the estimate rests on."""

from __future__ import annotations

from pipelines.model.estimation.result import Result
from pipelines.report.bps import convergence_figure, torque_figure
from pipelines.report.report import Report, Section, Table, Tone
from pipelines.report.style import with_std

__all__ = ["bps_report"]

_GOOD = 0.1  # relative torque error that is worth calling good


def bps_report(result: Result) -> Report:
    """The verdict, Table V with standard deviations, and what the estimate rests on."""
    sections = [_parameter_section(result), _course_section(result), _trust_section(result)]
    if result.comparison:
        sections.append(_comparison_section(result))
    return Report("Base parameters", _verdict(result), _tone(result), _key_figures(result), tuple(sections))


def _tone(result: Result) -> Tone:
    error = result.relative_error["validate"]
    return "bad" if result.unresolved or result.physically_consistent is False else "good" if error < _GOOD else "attention"


def _verdict(result: Result) -> str:
    judged = "held-out logs" if result.held_out == "logs" else "held-out blocks of the fitted logs, for none has role validate,"
    if result.unresolved:
        return f"These logs do not determine the model: {result.unresolved}."
    shown = sum(p.visible for p in result.parameters)
    text = (f"{shown} of {len(result.parameters)} parameters are clearly visible; the model explains the torque of {judged} "
            f"to {100 * result.relative_error['validate']:.2g} %.")
    return text if result.physically_consistent is not False else f"{text} No links that could exist have these parameters."


def _key_figures(result: Result) -> Table:
    rows = (("relative torque error, fitted logs [%]", 100 * result.relative_error["identify"]),
            (f"relative torque error, held-out {result.held_out} [%]", 100 * result.relative_error["validate"]),
            ("equations, joint by joint", ", ".join(map(str, result.equations))),
            ("condition number of the rigid columns", result.condition_number),
            ("condition number of the fit, unit columns", result.condition_number_fit),
            ("low-pass over torque and columns [Hz]", result.filter_hz),
            ("friction", "fitted with the rest" if result.friction == "fitted" else "taken from the given model"),
            ("links that could exist", {True: "yes", False: "no", None: "cannot be said"}[result.physically_consistent]))
    return Table(("what", "figure"), rows)


def _parameter_section(result: Result) -> Section:
    known = any(p.known is not None for p in result.parameters)
    columns = ("parameter", "value ± std", "unit", "seen", "stands for", *(("from the described links",) if known else ()))
    rows = [(p.name, "not determined" if p.value is None or p.std is None else with_std(p.value, p.std), p.unit,
             "clearly" if p.visible else "barely" if p.value is not None else "no", p.combination, *((p.known,) if known else ()))
            for p in result.parameters]
    tones: tuple[Tone, ...] = tuple(
        "good" if p.visible else "bad" if p.value is None else "attention" for p in result.parameters)
    return Section("Parameters", ("Standard deviations allow for a residual whose samples depend on one another.",),
                   (Table(columns, tuple(rows), "Table V of the paper, with what each stands for.", tones),))


def _course_section(result: Result) -> Section:
    left, whole = result.torque_rms, result.torque_signal_rms["validate"]
    rows = tuple((name, left["identify"][j], left["validate"][j], whole[j],
                  100 * left["validate"][j] / whole[j] if whole[j] else None) for j, name in enumerate(result.joints))
    table = Table(("joint", "residual, fitted [N m]", "residual, held out [N m]", "torque, held out [N m]", "relative [%]"), rows,
                  "Root mean squares, after the low-pass.")
    figures = [torque_figure(f"torque-{c.name}", f"{c.name} ({c.role}): measured torque, the model's, its friction, "
                                                 f"and what is left.",
                             c.t, c.measured, c.model, c.friction, result.joints) for c in result.courses]
    return Section("Torque along the experiment", (), (table,), tuple(figures))


def _trust_section(result: Result) -> Section:
    weak = Table(("singular value", "combination"), tuple(
        (d.singular_value, " ".join(f"{weight:+.2f} {name}" for name, weight in d.parameters[:4])) for d in result.hard_to_see),
        "The directions that these logs show worst; 1 is a column on its own.")
    tables = [weak]
    if result.consistency is not None and result.consistency.inequalities:
        tables.append(Table(("condition", "value", "holds"), tuple(
            (i.condition, with_std(i.value, i.std), "yes" if i.holds else "no") for i in result.consistency.inequalities),
            "What positive mass demands of these parameters."))
    growth = convergence_figure(
        "convergence", "Estimates as samples come in, each in units of its final value: a model that is right settles early.",
        result.convergence_samples, result.convergence, result.convergence_std, tuple(p.name for p in result.parameters))
    return Section("What the estimate rests on", _balance_words(result), tuple(tables), (growth,))


def _balance_words(result: Result) -> tuple[str, ...]:
    if result.balance is None:
        return ()
    largest = f"the largest difference is {max(result.balance.apart):.1f} standard deviations"
    if result.balance.agree:
        return (f"The balance of power, which needs no acceleration, gives the same parameters: {largest}.",)
    return (f"The balance of power, which needs no acceleration, gives other parameters: {largest}. Either the reconstructed "
            f"acceleration is spoilt, or position and torque are not of the same instant.",)


def _comparison_section(result: Result) -> Section:
    rows = tuple((c.method, 100 * c.identify, 100 * c.validate, c.failed or ("used here" if c.used else ""))
                 for c in result.comparison)
    errors = Table(("motion by", "fitted [%]", "held out [%]", ""), rows, "Relative torque error on the same equations.")
    good = [c for c in result.comparison if c.value]
    values = tuple((p.name, *(with_std(c.value[k], c.std[k]) for c in good))
                   for k, p in enumerate(result.parameters[:len(good[0].value) if good else 0]))
    beside = Table(("parameter", *(c.method for c in good)), values, "The same parameters, value ± std.")
    return Section("Four ways to reconstruct the motion", (), (errors, beside) if good else (errors,))
