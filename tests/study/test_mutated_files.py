"""Damaged files of every format: a reading, or one sentence (a short run of
`benchmarks/mutated_files.py`).
"""

import collections
import json
from pathlib import Path

import numpy as np
import pytest
from mutated_files import LEAKS, damaged, originals, outcome
from structured_damage import damage, restructured

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    return originals(tmp_path_factory.mktemp("sound"))


def test_every_sound_file_is_read(sound):
    read = {name: outcome(paths[0]) for name, paths in sound.items()}
    assert {name: words for name, (kind, words, _) in read.items() if kind != "read"} == {}
    powers = [figures for _, _, figures in read.values()]
    assert min(f[0] for f in powers) == 1


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.long) for k in (1, 2, 3))])
def test_a_damaged_file_is_read_or_refused_with_a_sentence(sound, tmp_path, seed):
    for k in range(150):
        rng = np.random.default_rng([seed, k])  # the files of other formats move no draw
        name = list(sound)[k % len(sound)]
        path, done = damaged(sound[name], tmp_path, rng)
        kind, words, _ = outcome(path)
        assert kind in ("read", "refused"), f"{name}, {done}: {words}"
        assert words.strip() or kind == "read"


SEEDS = (4, 6, 17, 2026)  # 400 files; a seed with a finding is added to them


@pytest.mark.parametrize(
    "seed", [SEEDS[0], *(pytest.param(k, marks=pytest.mark.long) for k in SEEDS[1:])]
)
def test_a_file_of_a_damaged_structure_is_read_or_refused_with_a_sentence(sound, tmp_path, seed):
    rng = np.random.default_rng(seed)
    names = [name for name, paths in sound.items() if damage(paths[0], rng) is not None]
    for k in range(100):
        rng = np.random.default_rng([seed, k])
        path, done = restructured(sound[names[k % len(names)]], tmp_path, rng)
        kind, words, _ = outcome(path)
        assert kind in ("read", "refused"), f"{names[k % len(names)]}, {done}: {words}"
        assert words.strip() or kind == "read"


FOUND = [("PQDIF", 1, 5181)]  # a format, and seed and case that `structured_damage.py` prints


@pytest.mark.parametrize(("name", "seed", "case"), FOUND)
def test_what_was_found_stays_mended(sound, tmp_path, name, seed, case):
    path, done = restructured(sound[name], tmp_path, np.random.default_rng([seed, case]))
    kind, words, _ = outcome(path)
    assert kind in ("read", "refused"), f"{name}, {done}: {words}"


def test_the_stored_run_of_damaged_structures_is_long_and_found_nothing_more():
    stored = json.loads((BENCHMARKS / "structured_damage.json").read_text(encoding="utf-8"))
    counts = [count for of_format in stored["counts"].values() for count in of_format.values()]
    assert sum(counts) == stored["cases"] == 10_000
    assert stored["bad"] == []


@pytest.mark.parametrize(
    "words", ["invalid literal for int() with base 10: '7A'", "month must be in 1..12"]
)
def test_words_of_python_are_found(words):
    assert LEAKS.search(words)


def test_the_page_tells_what_the_stored_run_of_ten_thousand_gave():
    stored = json.loads((BENCHMARKS / "mutated_files.json").read_text(encoding="utf-8"))
    told = collections.Counter()
    for of_format in stored["counts"].values():
        told.update(of_format)
    page = " ".join((BENCHMARKS.parent / "docs" / "records.md").read_text(encoding="utf-8").split())
    assert stored["cases"] == sum(told.values()) == 10_000
    assert stored["bad"] == []
    assert (
        f"{told['refused']:,} were refused with a sentence, {told['read as undamaged']:,} read as"
        " if undamaged and "
        f"{told['read as it now stands']:,} as they then stood"
    ) in page
    assert f"the slowest took {stored['worst']['seconds']:.1f} s" in page
