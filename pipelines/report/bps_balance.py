"""What the balance of power says of an estimate: words and a table beside the parameters that the torques gave."""

from __future__ import annotations

from pipelines.model.estimation.balance import ALONE, CLOSED, TOGETHER, Balance
from pipelines.model.estimation.result import Result
from pipelines.report.figure_words import figure_in_words as plain
from pipelines.report.report import Table, Tone
from pipelines.report.style import format_number, format_unit, with_std

__all__ = ["balance_table", "balance_words"]


def balance_words(result: Result) -> tuple[str, ...]:
    """What the balance of power says, and what a difference would mean."""
    balance = result.balance
    if balance is None:
        return ()
    together = (f"all differences together make χ² = {format_number(balance.chi_square, 3)} in {balance.freedom} degrees of "
                f"freedom, the largest is {max(balance.apart):.1f} standard deviations")
    late = (f"torque lies {with_std(1e3 * abs(balance.delay), 1e3 * balance.delay_std)} ms "
            f"{'behind' if balance.delay > 0 else 'ahead of'} the position")
    if balance.agree:
        return (f"The balance of power, which needs no acceleration, gives the same parameters: {together}; {late}.",)
    unlike = (f"the reconstructed motion contradicts itself by {format_number(100.0 * balance.closure, 2)} % of the energy: its "
              "acceleration is not the slope of its speed, as after an observer that lags, or where the motion is faster than a "
              "smoother follows.")
    if _nothing_else(balance):
        return ("The balance of power, which needs no acceleration, finds the same parameters but cannot confirm them: "
                f"{unlike}",)
    meanings = [unlike] if balance.closure > CLOSED else []
    if abs(balance.delay) > ALONE * balance.delay_std:
        meanings.append(f"{late}: a drive or a filter delays one of them, or their clocks differ.")
    if differing := [plain(name, True) for name, apart in zip(balance.names, balance.apart, strict=True) if apart > ALONE]:
        meanings.append(f"too far apart: {', '.join(differing)}. Either the reconstructed acceleration is too small or too large, "
                        "or the model lacks an effect.")
    if not meanings:
        meanings.append("No one of them stands out, all of them together do: most likely the model lacks an effect.")
    return (f"The balance of power, which needs no acceleration, does not confirm the parameters: {together}.",
            *(f"{words[0].upper()}{words[1:]}" for words in meanings))


def _nothing_else(balance: Balance) -> bool:
    """Return whether parameters and delay agree, and the motion's own contradiction alone stands against it."""
    return balance.closure > CLOSED and max(balance.apart) < ALONE and balance.deviate < TOGETHER and (
        abs(balance.delay) < ALONE * balance.delay_std)


def balance_table(result: Result) -> Table | None:
    if result.balance is None:
        return None
    fitted, balance = {p.name: p for p in result.parameters}, result.balance
    rows = [(plain(name), "not determined" if (p := fitted[name]).value is None or p.std is None else with_std(p.value, p.std),
             with_std(value, std), format_unit(p.unit), round(apart, 1))
            for name, value, std, apart in zip(balance.names, balance.value, balance.std, balance.apart, strict=True)]
    rows.append(("torque behind position", "taken for 0", with_std(1e3 * balance.delay, 1e3 * balance.delay_std), "ms",
                 round(abs(balance.delay) / balance.delay_std, 1)))
    tones: tuple[Tone, ...] = tuple("attention" if float(row[4]) > ALONE else "good" for row in rows)
    return Table(("parameter", "by the torques", "by the balance of power", "unit", "apart [std]"), tuple(rows),
                 f"{balance.windows} balances of work and energy. Above {ALONE:g} standard deviations a difference is not chance.",
                 tones)
