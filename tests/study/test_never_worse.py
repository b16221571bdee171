"""The estimate is never worse than where the search ended by more than chance explains, on records
fitted or held out.

What is compared is the squared error in S from the dip's start on, Eq. (8) there, by sample, over
blocks of time: worse is what exceeds twice the standard error of the blocks, and 1 % of the error.
Records and rule are those of the study benchmarks/model_error.py. Real records skip where they are
not beside the repository.
"""

import model_error
import pytest
from model_error import EXPONENTIAL, Data, Task

import tractexp
from hidden_effects import Case

AT_HAND = ("andes a", "xtz T1 phasors", "xtz T2 phasors", "async110 VL2", "async110 VL3", "keating")
SHIPPED = ("tibet", "tibet_50pct")
# effect, size (in its references) and seed of three dips: about four detection limits, and of those
# tried once each of the few in which the estimate was worse while the likelihood of the noise
# before the dip decided
HIDDEN = [("exponential_recovery", 0.229, 1143329030), ("measurement_window", 2.3, 2140662154)]


def hold(task: Task, data: Data) -> None:
    """Identify a data set, and hold its estimate to the search's end on fitted, held-out and all
    events.
    """
    fit, *_ = model_error.identification(task, data)
    for role, (estimate, search) in model_error.comparisons(fit, data).items():
        errors = [f"{100 * model_error.overall(side):.2f} %" for side in (estimate, search)]
        sentence = (
            f"{role}: the estimate misses {errors[0]} of the excursion in S, where the search ended"
            f" {errors[1]}"
        )
        worse = model_error.worse_than_chance(estimate, search)
        assert not worse, sentence


@pytest.mark.parametrize("name", [pytest.param(SHIPPED[0], marks=pytest.mark.long), SHIPPED[1]])
def test_on_shipped_records(name):
    task = Task("record", name, EXPONENTIAL)
    hold(task, model_error.data_of(task))


@pytest.mark.parametrize(
    "name",
    [
        name if name == "xtz T1 phasors" else pytest.param(name, marks=pytest.mark.long)
        for name in AT_HAND
    ],
)
def test_on_records_at_hand(name, shared_data):
    task = Task("record", name, EXPONENTIAL)
    try:
        data = model_error.data_of(task, shared_data.parent)
    except FileNotFoundError as error:
        pytest.skip(str(error))
    except tractexp.UserError as error:
        if "there is no dip" not in str(error):
            raise
        pytest.skip(f"there is nothing to fit: {error}")
    hold(task, data)


@pytest.mark.parametrize(
    ("name", "size", "seed"),
    [HIDDEN[0], pytest.param(*HIDDEN[1], marks=pytest.mark.long)],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_where_an_effect_is_hidden(name, size, seed):
    case = Case(effect=name, size=size, events=model_error.EVENTS)
    hold(Task("effect", name, EXPONENTIAL), model_error.events_of(case, seed))


@pytest.mark.long
def test_where_nothing_is_missing():
    hold(Task("null", "", EXPONENTIAL), model_error.events_of(Case(events=model_error.EVENTS), 1))
