"""The commands that go on from an investigation: another domain where that may tell more."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tractexp.api.next_commands import list_next_commands


def tell(grade, better="look at the waveforms"):
    """The commands of an extended model of this grade, where waveforms may tell more."""
    domain = SimpleNamespace(better=lambda event: better)
    result: Any = SimpleNamespace(
        question=SimpleNamespace(model=SimpleNamespace(domain="phasors")),
        content={"adequacy": {"grade": grade}},
        gap=SimpleNamespace(fitted_to_both=False),
        steps=SimpleNamespace(context=SimpleNamespace(domain=domain, events=("a dip",))),
        verdict="named",
        names=("stator_resistance",),
    )
    return list_next_commands(result, {"extended.yaml": Path("conf/model/extended.yaml")})


def test_no_other_domain_is_advised_where_the_model_is_adequate():
    (use,) = tell("adequate")
    assert use.startswith("use the extended model: tractexp model=")


@pytest.mark.parametrize(
    ("grade", "first"),
    [
        ("effect_missing", "use the extended model: "),
        ("wrong_model", "see the extended model, which does not describe this load: "),
    ],
)
def test_what_is_missing_still_is_looked_for_in_the_domain_that_tells_more(grade, first):
    use, more = tell(grade)
    assert use.startswith(first)
    assert more.startswith("next: look at the waveforms: ")
    assert "domain=waves" in more


def test_where_there_is_none_it_is_looked_for_beside_the_extended_model():
    _, again = tell("effect_missing", better="")
    assert again.startswith("investigate it as the base model: ")
