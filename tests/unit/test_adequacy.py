"""The grade of a model and its headline, `grade_errors`, by the size of its error and by chance."""

from tractexp.identification.adequacy import Grade, ResidualTest, grade_errors
from tractexp.inference.model_error import ModelError


def test_the_thresholds_of_the_grades_are_where_they_are_said_to_be():
    """Loosened, each of these would give another grade."""
    small, large = (ModelError(e, (0.9 * e, 1.1 * e), 0.1 * e) for e in (0.19, 0.21))
    seen, unseen = ResidualTest(0.0009, "", 2.0, "P"), ResidualTest(0.0011, "", 2.0, "P")
    assert grade_errors(unseen, small).grade is Grade.ADEQUATE
    assert grade_errors(seen, small).grade is Grade.EFFECT_MISSING
    assert grade_errors(seen, large).grade is Grade.WRONG_MODEL
    assert grade_errors(seen, small, large).grade is Grade.WRONG_MODEL
    assert grade_errors(ResidualTest(None, "", None, ""), small).grade is Grade.EFFECT_MISSING
    # where noise leaves as much, a held-out dip must be off by more than chance
    assert grade_errors(unseen, small, large).grade is Grade.ADEQUATE
    assert (
        grade_errors(unseen, small, ModelError(0.3, (0.21, 0.4), 0.03)).grade is Grade.WRONG_MODEL
    )


def test_a_headline_tells_the_size_and_the_bounds_that_hold_a_parameter():
    error = ModelError(0.0567, (0.05, 0.06), 0.0078)
    told = grade_errors(
        ResidualTest(0.0009, "", 2.0, "P of dip"),
        error,
        ModelError(0.074, (0.07, 0.08), 0.011),
        ["T_m at 1"],
    )
    assert told.sentence == (
        "the model describes this load within 5.7 % of its response (0.78 % of S), the held-out"
        " dips within 7.4 % of"
        " its response (1.1 % of S); an effect is missing, P of dip is 2 times as loud as the"
        " noise; a bound holds"
        " T_m at 1"
    )


def test_of_held_out_dips_a_headline_does_not_say_that_noise_alone_leaves_as_much():
    small, chance = ModelError(0.01, (0.0, 0.02), 0.001), ResidualTest(0.5, "", 1.0, "P of dip")
    assert grade_errors(chance, small).sentence.endswith(": noise alone leaves as much")
    told = grade_errors(chance, small, ModelError(0.05, (0.03, 0.07), 0.01)).sentence
    assert told.endswith("(1 % of S): noise alone leaves as much of the fitted dips")
