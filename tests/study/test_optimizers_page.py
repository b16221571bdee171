"""docs/optimizers.md says what the stored result says, and the stored result was come by as it
claims. No searches.
"""

import json
from dataclasses import replace
from pathlib import Path

import drawn_records
import numpy as np
import optimizers
import optimizers_tables
import pytest

from tractexp.configuration.plugin import build, discover, make_schema
from tractexp.studies.comparison.statistics import compute_vargha_delaney

STORED = json.loads(optimizers.STORED.read_text(encoding="utf-8"))
PAGE = Path(__file__).parents[2] / "docs" / "optimizers.md"
SMALL = replace(
    optimizers.SERIES["choice"],
    seeds=2,
    instances=(11, 12),
    budgets=(60, 120),
    optimizers=("random_search", "cmaes"),
)


def test_the_page_is_what_the_stored_result_gives():
    page = PAGE.read_text(encoding="utf-8")
    assert optimizers_tables.filled(page, STORED) == page


def test_another_result_gives_another_page():
    changed = json.loads(json.dumps(STORED))
    for problem in changed["final"]["problems"].values():
        problem["runs"]["issa 15000"]["excess"] = [0.0] * len(
            problem["runs"]["issa 15000"]["excess"]
        )
    before, after = (optimizers_tables.blocks(stored) for stored in (STORED, changed))
    assert {name for name in before if before[name] != after[name]} == {"answer", "records", "bbob"}


def test_the_first_lines_of_the_page_answer_which_optimizer_to_take():
    lines = [
        line
        for line in PAGE.read_text(encoding="utf-8").splitlines()
        if line and not line.startswith(("#", "<!"))
    ]
    assert all(line.startswith("- **") for line in lines[:3])
    assert lines[:3] == optimizers_tables.blocks(STORED)["answer"].splitlines()


@pytest.mark.parametrize("name", ["choice", "final", "readings"])
def test_a_stored_series_is_whole_and_was_run_from_a_commit(name):
    stored, series = STORED[name], optimizers.SERIES[name]
    plan = json.loads(json.dumps(vars(series)))
    assert stored["plan"] == plan
    assert list(stored["problems"]) == series.problems()
    for problem in stored["problems"].values():
        for runs in problem["runs"].values():
            assert len(runs["excess"]) == (
                series.seeds if problem["kind"] == "record" else len(series.instances)
            )
            assert min(runs["excess"]) >= 0
    assert len(stored["commit"].removesuffix("-dirty")) == 40
    assert stored["settings"] == {o: optimizers.settings(o) for o in series.optimizers}


def test_the_series_share_no_record_no_instance_and_no_seed():
    choice, final, readings = (optimizers.SERIES[name] for name in ("choice", "final", "readings"))
    assert len({choice.key, final.key, readings.key}) == 3
    assert not {*choice.instances} & {*final.instances}
    assert not choice.shipped


def test_settings_are_those_that_the_command_line_composes():
    from hydra import compose, initialize_config_dir
    from hydra.core.config_store import ConfigStore
    from omegaconf import OmegaConf

    for name, cls in discover()["optimizer"].items():
        ConfigStore.instance().store(group="optimizer", name=name, node=make_schema(cls))
    assert optimizers.settings("cobyqa") == {"name": "cobyqa"}
    with initialize_config_dir(str(optimizers.ROOT / "conf"), version_base=None):
        for name in ("issa_polish", "issa_to_the_letter", "ssa_plus_levy"):
            composed = OmegaConf.to_container(compose(overrides=[f"+optimizer={name}"]).optimizer)
            assert build("optimizer", optimizers.settings(name)) == build("optimizer", composed)


def test_a_drawn_record_is_that_of_its_seed_and_its_truth_within_bounds():
    (one, load), (again, _) = drawn_records.drawn((1, 2)), drawn_records.drawn((1, 2))
    np.testing.assert_array_equal(one.record.P, again.record.P)
    assert drawn_records.drawn((1, 3))[1] != load
    truth = load.truth()
    assert all(p.bounds[0] < truth[p.name] < p.bounds[1] for p in drawn_records.model().parameters)


def test_runs_do_not_depend_on_what_else_is_run():
    """The functions of a series by themselves and one after the other, in either order: the same
    figures.
    """

    def told(names):
        return {
            name: {k: (v["excess"], v["simulations"]) for k, v in runs["runs"].items()}
            for name, runs in (optimizers.run(SMALL, name) for name in names)
        }

    assert told(["f1 d5", "f8 d7"]) == dict(reversed(told(["f8 d7", "f1 d5"]).items()))
    assert all(spent == [120, 120] for _, spent in [told(["f8 d7"])["f8 d7"]["cmaes 120"]])


def test_a_search_that_ends_by_itself_is_started_again_until_its_budget_is_spent():
    from tractexp.studies.bbob.runs import Bbob

    problem = Bbob(3, 5, 11, [1e-8])
    ended = optimizers.restarted(
        problem, build("optimizer", {"name": "pso", "iterations": 2}), (1,), 700, -np.inf
    )
    assert ended.simulations == problem.evaluations == 700
    assert ended.objective == problem.best


def test_the_tables_count_what_is_stored():
    def runs(excess, valley):
        return {"excess": excess, "simulations": [], "seconds": 0.0, "valley": valley}

    problem = {
        "kind": "record",
        "runs": {"issa 10": runs([0.5, 0.005, 0.05], [0, 1, 1]),
                 "pso 10": runs([0.0, 1e-6, 0.2], [1, 1, 1]),
                 "ssa 10": runs([1.0, 2.0, 3.0], [0, 0, 0])},
    }  # fmt: skip
    plan = {"budgets": [10], "optimizers": ["issa", "pso", "ssa"], "seeds": 3}
    of = optimizers_tables.Kind({"plan": plan, "problems": {"a": problem, "b": problem}}, "record")
    rows = {
        line.split("|")[1].strip(): line.split("|")[2:-1]
        for line in optimizers_tables.records(of).splitlines()
    }
    assert [cell.strip() for cell in rows["`issa`"]] == [
        "1.050",
        "33",
        "67",
        "67",
        "2.0",
        "reference",
    ]
    assert [cell.strip() for cell in rows["`pso`"]] == ["1.000", "67", "67", "100", "1.0", "0.78"]
    assert compute_vargha_delaney(
        np.array([1e-4, 1e-4, 0.2]), np.array([0.5, 0.005, 0.05])
    ) == pytest.approx(7 / 9)
