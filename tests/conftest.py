"""Fixtures that several test files share."""

import contextlib
import os
import shutil
from pathlib import Path

# before NumPy: BLAS has one thread, as in every process of the program
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest

import tractexp

LONGEST_FILES = (
    "process/test_sweep.py",
    "process/test_hostile.py",
    "process/test_tracking.py",
    "study/test_discrepancy.py",
    "process/test_lost.py",
    "process/test_export.py",
    "process/test_tutorial.py",
    "study/test_inexact.py",
    "process/test_ten_minutes.py",
    "process/test_commands.py",
    "study/test_docs_run.py",
    "process/test_trust.py",
    "study/test_paper.py",
    "study/test_families.py",
    "process/test_plugins.py",
    "study/test_optimizers.py",
    "study/test_wave_discrepancy.py",
    "study/test_discrepancy_page.py",
    "study/test_profile.py",
    "study/test_api.py",
    "study/test_remainder.py",
    "oracle/test_hidden_effects_generator.py",
    "process/test_output.py",
    "study/test_proposals.py",
    "process/test_survey.py",
    "study/test_waves_evidence.py",
    "study/test_chain.py",
    "process/test_new.py",
    "process/test_workers.py",
    "study/test_priors.py",
    "model/test_uncertainty.py",
    "unit/test_convert.py",
    "model/test_contracts.py",
    "process/test_cli.py",
    "model/test_model.py",
    "unit/test_tables.py",
)
MOTOR = {
    "T_prime": 0.12,
    "X_prime": 0.25,
    "C": 0.9,
    "M": 0.006,
    "T_m": 0.55,
    "p_v": 1.4,
    "q_v": 3.0,
}


def pytest_configure(config):
    """Files begin in the order they are collected in: xdist's own puts those of few tests, long
    ones, at the end.

    What tests log goes to no store of the developer's own.
    """
    os.environ.pop("MLFLOW_TRACKING_URI", None)
    # the first use of MLflow says so for its process; what a command in this one says is taken back
    os.environ.setdefault("MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR", "false")
    if hasattr(config.option, "loadscopereorder"):
        config.option.loadscopereorder = False


def pytest_collection_modifyitems(items):
    """The files that take longest begin first, so that all workers end at about the same time."""
    of = {name: k for k, name in enumerate(LONGEST_FILES)}
    items.sort(key=lambda item: of.get("/".join(item.path.parts[-2:]), len(LONGEST_FILES)))


@pytest.fixture
def registry_as_it_was():
    """What a test registers is gone after it: the next one of this process finds what is installed.

    For files that register; plugins are discovered once in a process, and a unit test that needs
    none imports none.
    """
    from tractexp.configuration.plugin import discover

    registry = discover()
    kept = {group: dict(classes) for group, classes in registry.items()}
    yield
    registry.clear()
    registry.update(kept)


@pytest.fixture(scope="session")
def resistive_dips(tmp_path_factory) -> list[Path]:
    """Three dips of a motor with a stator resistance of 0.02 pu and noise of 0.3 %,
    as CSV files.
    """
    import numpy as np

    folder, noise = tmp_path_factory.mktemp("dips"), np.random.default_rng(7)
    load, paths = tractexp.compose(effects=["stator_resistance"]), []
    for depth, duration in ((0.3, 0.2), (0.5, 0.15), (0.4, 0.3)):
        made = tractexp.simulate(
            load, MOTOR | {"R_s": 0.02}, depth=depth, duration=duration, rate=200, length=2
        )
        frame = made.responses[0].to_frame()
        frame[["P", "Q"]] += 0.003 * noise.standard_normal((len(frame), 2))
        paths.append(folder / f"dip{len(paths) + 1}.csv")
        frame.to_csv(paths[-1], index=False)
    return paths


@pytest.fixture(scope="session")
def planted():
    """An investigation that names the stator resistance in two of three generated events: of a few
    effects.
    """
    from made_dips import events, investigate

    dips = events("stator_resistance", size=2.0, count=3)
    return investigate(dips[:2], dips[2:])


@contextlib.contextmanager
def no_term_is_searched():
    """Within it what nothing explains is left without a term, for tests that look at none: a search
    takes seconds.
    """
    from tractexp.discrepancy.proposal.propose import ProposalResult

    result = ProposalResult(why="none is searched in this test")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tractexp.discrepancy.investigate.propose", lambda *_: result)
        yield


@pytest.fixture
def no_proposal():
    """A test of `no_term_is_searched`."""
    with no_term_is_searched():
        yield


collect_ignore = ["process/acme"]  # a package of its own, whose tests run where it is installed


@pytest.fixture
def shared_data() -> Path:
    """The folder of real recordings beside the repository; they are not part of the project."""
    folder = Path(__file__).parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"real recordings are not beside the repository ({folder.name} folder absent)")
    return folder


@pytest.fixture(scope="session")
def empty_store(tmp_path_factory) -> Path:
    """One migrated database, copied by the tests that do not care how it came about; workers side
    by side share it.
    """
    from tractexp import tracking

    side_by_side = "PYTEST_XDIST_WORKER" in os.environ
    folder = (
        tmp_path_factory.getbasetemp().parent / "store"
        if side_by_side
        else tmp_path_factory.mktemp("store")
    )
    tracking.open_store(tracking.find_default_uri(folder))
    return folder / "outputs" / "mlflow.db"


@pytest.fixture
def uri(tmp_path, empty_store) -> str:
    """A store of its own under `tmp_path`."""
    from tractexp import tracking

    (tmp_path / "outputs").mkdir()
    shutil.copy(empty_store, tmp_path / "outputs" / "mlflow.db")
    return tracking.find_default_uri(tmp_path)
