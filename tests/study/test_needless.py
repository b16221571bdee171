"""The search for sets of effects: none is kept that a set does not need, `drop_needless`."""

from dataclasses import replace

from made_dips import FEW

from tractexp.discrepancy.disagreement import examine_fit
from tractexp.discrepancy.explanations import drop_needless
from tractexp.inference.fitting import refit


def test_an_effect_that_a_larger_set_does_not_need_is_left_out_again(planted):
    """A pair may lead to the better place of one of its members: then that one alone is the
    explanation.
    """
    steps = planted.steps
    (name,), first = steps.names, steps.first
    other = next(n for n in FEW if n != name)
    pair = refit(steps.context, first.noise, [((name, other), steps.verdict.chosen.fit.unit)])[0]
    tests = examine_fit(steps.base.quiet, pair, first.noise, 0)
    astray = replace(steps.explanations.refits[name,], deviance=first.fit.deviance)
    refits = {**steps.explanations.refits, (name,): astray}
    fewer = drop_needless(steps.base, tests, refits, 0)
    assert fewer.fit.names == (name,)
    assert refits[name,].deviance < first.fit.deviance - 100
    # p = 4e-8 of one parameter
    needed = replace(tests, fit=replace(tests.fit, deviance=tests.fit.deviance - 30.0))
    assert drop_needless(steps.base, needed, refits, 0) is needed
