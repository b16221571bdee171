"""Probabilities and errors as a person reads them."""

import pytest

from tractexp.text.wording import (
    format_probability,
    format_share,
    format_with_error,
    join_alternatives,
    join_words,
    list_figures,
)


@pytest.mark.parametrize(
    ("p", "told"),
    [
        (1.0, "1"),
        (0.4543, "0.45"),
        (0.00012, "0.00012"),
        (2.64e-5, "2.6e-5"),
        (1.1e-6, "1.1e-6"),
        (9e-7, "less than one in a million"),
        (6e-300, "less than one in a million"),
        (0.0, "less than one in a million"),
    ],
)
def test_a_probability_that_nobody_can_picture_is_told_in_words(p, told):
    assert format_probability(p) == told


@pytest.mark.parametrize(
    ("value", "error", "told"),
    [
        (0.0220163, 7.78e-5, "0.022016 ± 0.000078"),
        (1.5, 3.6, "1.5 ± 3.6"),
        (-1.0241, 0.0262, "-1.024 ± 0.026"),
        (9151.0, 20412.0, "9151 ± 2e4"),
        (1.23456e-9, 2.5e-11, "1.235e-9 ± 2.5e-11"),
        (0.1234567, float("nan"), "0.1235"),
        (3.0, 0.0, "3"),
    ],
)
def test_a_value_has_the_digits_that_its_error_leaves(value, error, told):
    assert format_with_error(value, error) == told


def test_names_are_listed_as_in_a_sentence():
    assert [join_words(names) for names in ((), ("a",), ("a", "b"), ("a", "b", "c"))] == [
        "",
        "a",
        "a and b",
        "a, b and c",
    ]
    assert join_words(("a", "b"), "or") == "a or b"


def test_a_share_is_never_more_than_all_or_less_than_nothing():
    assert [format_share(share) for share in (-0.3, 0.234, 2.08)] == ["0%", "23%", "100%"]


def test_alternatives_that_share_a_name_are_told_by_it():
    pairs = [("b", "a"), ("a", "c"), ("a", "d")]
    assert join_alternatives(pairs) == "a beside one more effect (b, c or d)"
    assert (
        join_alternatives([*pairs, ("b", "c")]) == "a beside one more effect (b, c or d) or b and c"
    )
    assert join_alternatives(pairs[:2]) == "b and a or a and c"
    assert join_alternatives([("a",), ("b",), ("c",)]) == "a, b or c"
    assert join_alternatives([("a",)]) == "a"
    assert join_alternatives([]) == ""


def test_many_figures_are_told_by_their_ends():
    assert list_figures([0.2, 0.1, 0.4, 0.3], format_share) == "10% to 40%"
    assert list_figures([0.2, 0.1], format_share) == "20% and 10%"
