"""A recipe says what is wrong with it, and what would be right."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from pipelines.errors import InputRejected, UsageError
from pipelines.importers import patterns
from pipelines.importers.recipe import find_recipe, parse_recipe
from pipelines.io.robot import shipped_names
from tests.importers.good import RECIPE


def edited(old: str, new: str) -> str:
    assert old in RECIPE
    return RECIPE.replace(old, new)


@pytest.mark.parametrize("name", ["tx40", "odrive"])
def test_shipped_recipes_are_valid(name: str) -> None:
    assert name in shipped_names("recipes")
    assert parse_recipe(find_recipe(name).read_text(encoding="utf-8")).signals["tau"].unit in ("N m", "A")


@pytest.mark.parametrize(("old", "new", "hint"), [
    ("[time]", "[tiem]", "'tiem' is not a key.*did you mean 'time'"),
    ('experiment =', 'experimnet =', "'log.experimnet'.*did you mean 'experiment'"),
    ('columns = "q_{j}"', 'colums = "q_{j}"', "'signals.q.colums'.*did you mean 'columns'"),
    ("tau = {", "taau = {", "'signals.taau' is not a signal, did you mean 'tau'"),
    ("[time]", "[[file]]\nmatch = 'a'\nrol = 'validate'\n[time]", r"'file\[1\].rol'.*did you mean 'role'"),
])
def test_c01_an_unknown_key_is_named_with_its_neighbour(old: str, new: str, hint: str) -> None:
    with pytest.raises(UsageError, match=f"RRID-C01.*{hint}"):
        parse_recipe(edited(old, new))


@pytest.mark.parametrize(("more", "words"), [
    ("[resample]\nrate = -5.0\n", "'resample.rate' is -5.0, must be above 0"),
    ("[resample]\nrate = 1e300\n", "'resample.rate' is 1e\\+300, must lie within"),
    ("[resample]\nrate = nan\n", "'resample.rate' is nan, must be a finite"),
    ("[resample]\nrate = 100.0\nmethod = 'magic'\n", "'resample.method'.*'spline' or 'linear'"),
    ("[drive]\ntorque_constant = 0.0\n", "'drive.torque_constant' is 0.0, must be above 0"),
    ("[controller]\nlaw = 'pid'\n", "'controller.law'"),
    ("[controller]\nkp = [1.0]\n", "'controller.law' is missing"),
    ("[missing]\nvalues = 'x'\n", "'missing.values'"),
])
def test_c02_a_value_out_of_bounds_is_refused(more: str, words: str) -> None:
    with pytest.raises(UsageError, match=f"RRID-C02.*{words}"):
        parse_recipe(RECIPE + more)


@pytest.mark.parametrize(("old", "new", "words"), [
    ('experiment = "excitation"', 'experiment = "exitation"', "'log.experiment'.*'excitation'"),
    ('unit = "rad"', 'unit = "rad", sign = 2', "'signals.q.sign' is 2.0, must be 1 or -1"),
    ('unit = "rad"', 'unit = "counts"', "counts_per_rev is missing"),
    ('columns = "q_{j}"', "columns = [0, 1, 2]", "columns count from 1"),
    ('column = "t"\nunit = "s"', "", "neither column nor rate"),
    ('match = "*.csv"', "", "matches no files"),
    ('q = {', 'q_ref = { columns = "r_{j}", unit = "rad" }\nq = {', "q_ref alone"),
    ('[time]', '[time]\nrate = "fast"', "'time.rate'"),
])
def test_c02_a_recipe_without_sense_is_refused(old: str, new: str, words: str) -> None:
    with pytest.raises(UsageError, match=f"RRID-C02.*{words}"):
        parse_recipe(edited(old, new))


def test_c01_not_toml() -> None:
    with pytest.raises(UsageError, match="RRID-C01.*not valid TOML"):
        parse_recipe("robot: rrr\n")


@pytest.mark.parametrize(("text", "words"), [
    (edited('column = "t"\nunit = "s"', "rate = 0.001"), "time.rate is 0.001 Hz: a period.*rate of 1000 Hz"),
    (edited('column = "t"\nunit = "s"', "sample_time = 1000"), "time.sample_time is 1000 s: a rate.*rate = 1000"),
    (RECIPE + "[resample]\nrate = 0.005\n", "resample.rate is 0.005 Hz: a period.*200 Hz"),
])
def test_s09_a_rate_that_is_a_period_is_refused(text: str, words: str) -> None:
    with pytest.raises(InputRejected, match=f"RRID-S09.*{words}"):
        parse_recipe(text)


def test_dates_may_be_written_as_toml_has_them() -> None:
    recipe = parse_recipe(edited('experiment =', "recorded = 2024-05-17T11:30:00+02:00\nexperiment ="))
    assert recipe.log.recorded == "2024-05-17T09:30:00Z"
    assert parse_recipe(edited('experiment =', 'recorded = "2024-05-17T09:30:00.25Z"\nexperiment =')).log.recorded == \
        "2024-05-17T09:30:00.250000Z"


@pytest.mark.parametrize("value", ["2024-05-17T11:30:00", "2024-05-17", '"2024-05-17T11:30:00"', '"yesterday"', "5"])
def test_c02_a_time_without_its_offset_is_refused(value: str) -> None:
    """11:30 is another hour in every country; stamping it UTC would be a guess."""
    with pytest.raises(UsageError, match="RRID-C02.*'log.recorded' is .*offset from UTC"):
        parse_recipe(edited('experiment =', f"recorded = {value}\nexperiment ="))
    case = f'[[file]]\nmatch = "a.csv"\nrecorded = {value}\n[time]'
    with pytest.raises(UsageError, match=r"'file\[1\].recorded'"):
        parse_recipe(edited("[time]", case))


@pytest.mark.parametrize(("pattern", "name", "groups"), [
    ("run_{number}.csv", "run_7.csv", {"number": "7", "stem": "run_7"}),
    ("{experiment}_{joint:[0-9]+}.csv", "friction_2.csv", {"experiment": "friction", "joint": "2", "stem": "friction_2"}),
    ("*/{role}.mat", "monday/validate.mat", {"role": "validate", "stem": "validate"}),
    ("run_?.csv", "run_12.csv", None),
    ("{a}-{a}.csv", "x-x.csv", {"a": "x", "stem": "x-x"}),
    ("{a}-{a}.csv", "x-y.csv", None),
    ("run.csv", "runXcsv", None),
    ("*.csv", "sub/run.csv", None),
])
def test_patterns_give_their_groups(pattern: str, name: str, groups: dict[str, str] | None) -> None:
    found = patterns.matches([pattern], [name], Path())
    assert found == [{} if groups is None else {name: groups}]


def test_the_docstring_shows_a_recipe_that_is_valid() -> None:
    from pipelines.importers import recipe

    text = "\n".join(line[4:] for line in (recipe.__doc__ or "").splitlines() if line.startswith("    "))
    assert tomllib.loads(text)
    assert parse_recipe(text).time.column == "t"


@pytest.mark.parametrize(("line", "words"), [
    ('delimiter = ",,"', "format.delimiter"), ('delimiter = "\\n"', "format.delimiter"), ('delimiter = "1"', "format.delimiter"),
    ('decimal = "x"', "format.decimal"), ('encoding = "utf-8\\u0000"', "format.encoding"),
    ('encoding = "klingon"', "format.encoding"),
    ('encoding = "base64"', "format.encoding"), ('comment = "\\n"', "format.comment"), ('comment = ""', "format.comment"),
])
def test_a_format_that_no_text_can_have(line: str, words: str) -> None:
    with pytest.raises(UsageError, match=f"RRID-C02 .*{words}"):
        parse_recipe(f"{RECIPE}[format]\n{line}\n")


@pytest.mark.parametrize("digits", [400, 5000])
def test_integers_without_end(digits: int) -> None:
    """No float holds the one, and Python does not even read the other."""
    with pytest.raises(UsageError, match="RRID-C0[12]"):
        parse_recipe(edited('unit = "s"', "rate = 1" + "0" * digits))


@pytest.mark.parametrize(("more", "words"), [
    ("[[file]]\nskip = true\n", r"RRID-C02 .*'file\[1\].match' is missing"),
    ("[[file]]\nmatch = []\n", r"RRID-C02 .*'file\[1\].match' is empty"),
    ("[log]\nskip = true\n", r"RRID-C01 .*'log.skip' is not a key"),
])
def test_what_would_have_no_effect_is_refused(more: str, words: str) -> None:
    recipe = RECIPE.replace("[log]\n", more, 1) if more.startswith("[log]") else RECIPE + more
    with pytest.raises(UsageError, match=words):
        parse_recipe(recipe)
