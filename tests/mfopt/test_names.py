"""Names: what can be shown everywhere passes, nothing else."""

import pytest

from mfopt.names import file_name, listed, shown, with_unit, word


@pytest.mark.parametrize("name", ["dem-300", "[/]", "$\\foo$", "größe", "長さ", "a b", "π"])
def test_what_can_be_shown_passes(name: str) -> None:
    assert shown(name) == name


@pytest.mark.parametrize(
    "name", ["", " ", "\u200b", "a\0b", "a\nb", "\x1b[31mred", "\ud800", "a\u2028b", 101 * "a"]
)
def test_what_cannot_be_shown_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=r"shows nothing|control character|above the limit"):
        shown(name)


@pytest.mark.parametrize("name", ["../evil", "a/b", "a\\b", "c:d", ".hidden", "..", "", "\0"])
def test_names_that_lead_elsewhere_are_no_file_names(name: str) -> None:
    with pytest.raises(ValueError, match=r"directory is called by it|shows nothing"):
        file_name(name)


def test_a_word_of_a_command_may_hold_anything_but_a_zero_byte() -> None:
    assert word("a\nb") == "a\nb"
    with pytest.raises(ValueError, match="zero byte"):
        word("a\0b")


def test_a_number_or_its_text_stands_before_the_unit_and_a_pure_number_alone() -> None:
    assert with_unit(0.25, "m") == with_unit("0.25", "m") == "0.25 m"
    assert with_unit(0.25, "-") == with_unit("0.25", "-") == "0.25"


def test_names_in_a_row() -> None:
    assert [listed("abc"[:n]) for n in range(4)] == ["", "a", "a and b", "a, b and c"]
    assert listed(("a", "b"), "or") == "a or b"
