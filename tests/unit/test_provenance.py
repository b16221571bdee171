"""Where a result comes from: the digest of its records and the commit of the package."""

import subprocess
from dataclasses import replace

from printed_events import records

from tractexp.cache.provenance import find_commit, hash_record


def test_equal_numbers_have_equal_digests_and_others_have_not():
    one, two = (records((0.5,), 0.004, seed=seed)[0].record for seed in (5, 6))
    assert hash_record(one) == hash_record(replace(one, name="renamed"))
    assert hash_record(one) != hash_record(two)


def test_a_commit_is_that_of_the_package_not_of_the_folder_one_stands_in(tmp_path, monkeypatch):
    subprocess.run(["git", "init", "-q", str(tmp_path)], check=True)
    assert find_commit(tmp_path) == ""  # a repository that does not keep these files
    monkeypatch.chdir(tmp_path)
    find_commit.cache_clear()
    here = find_commit()
    assert here == "" or len(here.removesuffix("-dirty")) == 40
