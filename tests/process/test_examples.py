"""The shipped dips, as events and as files that are read as the same."""

import numpy as np
import pytest

import tractexp
from tractexp.errors import UserError


def test_the_files_that_are_written_are_the_dips(tmp_path):
    dips = tractexp.examples(tmp_path)
    assert [dip.record.name for dip in dips] == ["tibet_50pct", "tibet_30pct", "tibet_65pct"]
    again = tractexp.read(*(str(tmp_path / f"dip{k}.csv") for k in (1, 2, 3)))
    for one, other in zip(dips, again, strict=True):
        assert np.array_equal(one.record.P, other.record.P)


def test_a_folder_that_cannot_be_is_a_sentence(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError):
        tractexp.examples(tmp_path / "file")
