"""A sentence names a setting as the user wrote it, and quotes what the user gave to the letter."""

import pytest

import tractexp
from tractexp.errors import DATA, MODEL, UserError, check_range, name_setting, name_settings_as


def test_a_setting_is_the_key_outside_of_calls() -> None:
    """The command line's words are the configuration's keys."""
    assert f"{DATA.units}, {MODEL.bounds}.C" == "data.units, model.bounds.C"


def test_a_setting_is_the_argument_within_a_call() -> None:
    """Only keys that the call takes lose their section; an outer call's arguments hold where the
    inner has none.
    """
    with name_settings_as("identify", lambda: {"records", "bounds"}):
        assert (name_setting("model.bounds.C"), DATA.train) == ("bounds.C", "records")
        assert (name_setting("task=identify"), name_setting("task=plan")) == (
            "identify()",
            "task=plan",
        )
        assert (DATA.units, name_setting("optimizer.bounds")) == ("data.units", "optimizer.bounds")
        with name_settings_as("read", lambda: {"units"}):
            assert (DATA.units, MODEL.bounds) == ("units", "bounds")
        with pytest.raises(UserError, match=r"^bounds\.C=7 is out of range"):
            check_range("model.bounds.C", 7, 0, 1)
    assert MODEL.bounds == "model.bounds"


@pytest.mark.parametrize("name", ["data.columns.csv", "data.train.csv", "task=read.csv"])
def test_a_file_called_like_a_setting_keeps_its_name(tmp_path, name: str) -> None:
    """What stands in a sentence from the user is not taken for a setting."""
    path = tmp_path / name
    path.write_text("t,U,P\n0,1,1\n0.001,1,1\n")
    with pytest.raises(UserError) as refusal:
        tractexp.read(path)
    assert str(path) in str(refusal.value)
    with pytest.raises(UserError) as refusal:
        tractexp.identify(path, model="third_order_exponential")
    assert str(path) in str(refusal.value)
