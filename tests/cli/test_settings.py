"""Settings that are written as text: a list of one, and what is no list."""

from __future__ import annotations

import pytest

from pipelines.design_excitation import Settings as Design
from pipelines.diagnose import Settings
from pipelines.errors import UsageError
from rrrid_cli.options import make_settings, read_values


def made(*sets: str) -> Settings:
    return make_settings("diagnose", None, sets, {})


@pytest.mark.parametrize(("text", "without"), [
    ("diagnose.exclude=cogging", ("cogging",)), ('diagnose.exclude="cogging"', ("cogging",)),
    ('diagnose.exclude=["cogging", "spring"]', ("cogging", "spring")), ("diagnose.exclude=[]", ())])
def test_one_stands_for_a_list_of_one(text: str, without: tuple[str, ...]) -> None:
    assert made(text).exclude == without


@pytest.mark.parametrize("value", ["3", "[3]", "true"])
def test_what_is_no_list_of_texts_is_refused(value: str) -> None:
    with pytest.raises(UsageError, match="is not a list") as refused:
        made(f"diagnose.exclude={value}")
    assert refused.value.code.endswith("C02")


@pytest.mark.parametrize(("text", "words"), [
    ("diagnose.max_causes=abc", "'abc' is not a whole number"), ("diagnose.max_causes=1.5", "1.5 is not a whole number"),
    ("diagnose.blocks=true", "is not a whole number")])
def test_what_is_no_number_is_refused_in_words(text: str, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        made(text)


def test_a_whole_number_of_hundreds_of_digits_is_refused() -> None:
    """As an option, in a configuration, and in a list: no arithmetic of floats holds it."""
    number = int("9" * 400)
    with pytest.raises(UsageError, match="C02 --max-causes: "):
        read_values(Settings, {"settings_max_causes": str(number)})
    with pytest.raises(UsageError, match="is not a whole number"):
        made(f"diagnose.max_causes={number}")
    for text in (str(number), "nan", "1e12"):
        with pytest.raises(UsageError, match="C02 --harmonics"):
            read_values(Design, {"settings_harmonics": [text]})
