"""Our uses of private parts of other packages: each is still needed, works, and is the only one of
its kind.
"""

import ast
import asyncio
import copy
import importlib.util
import inspect
import sys
from concurrent.futures import Future
from pathlib import Path

import pytest

import tractexp
from tractexp.compat import hydra_config_store, hydra_plugins
from tractexp.compat.scipy_differential_evolution import generations

HERE = Path(tractexp.__file__).parent
OURS = {"tractexp", "tractexp_plugins"}
MENDED = "{} is mended in the version installed: do what tractexp/compat/{}.py says at its end"
CHANGED = "the version installed has changed what tractexp/compat/{}.py relies on: {}"


@pytest.fixture
def launcher():
    """A launcher that says where it was made, as a class nobody else registers."""
    from hydra.plugins.launcher import Launcher

    class Made(Launcher):
        def setup(self, **_):
            self.ready = True

        def launch(self, job_overrides, initial_job_idx):
            return []

    yield Made
    vars(sys.modules[hydra_plugins.NAMESPACE]).pop("Made", None)


def instantiated(target):
    from hydra.core.plugins import Plugins
    from omegaconf import OmegaConf

    config = OmegaConf.create({"hydra": {"launcher": {"_target_": target}}})
    return Plugins.instance().instantiate_launcher(
        hydra_context=None, task_function=None, config=config
    )


def test_hydra_makes_a_launcher_from_elsewhere_only_through_the_door(launcher):
    from hydra.core.plugins import Plugins

    launcher.__qualname__ = "Made"
    Plugins.instance().register(launcher)
    refused = ""
    try:
        instantiated(f"{launcher.__module__}.Made")
    except RuntimeError as error:
        refused = str(error)
    assert "not the hydra_plugins package" in refused, MENDED.format(
        "facebookresearch/hydra#3015", "hydra_plugins"
    )
    hydra_plugins.admit(launcher)
    try:
        made = instantiated(f"{hydra_plugins.NAMESPACE}.Made")
    except Exception as error:
        pytest.fail(CHANGED.format("hydra_plugins", error))
    assert type(made) is launcher
    assert made.ready


def test_hydra_copies_its_store_of_schemas_unless_the_door_is_open(monkeypatch):
    from hydra.core.config_store import ConfigStore

    try:
        from hydra._internal.core_plugins.structured_config_source import StructuredConfigSource
    except ImportError as error:
        pytest.fail(CHANGED.format("hydra_config_store", error))
    monkeypatch.setattr(ConfigStore, "__deepcopy__", None, raising=False)
    monkeypatch.delattr(ConfigStore, "__deepcopy__")
    source = StructuredConfigSource("test", "structured://")
    if not hasattr(source, "store"):
        pytest.fail(MENDED.format("facebookresearch/hydra#2928", "hydra_config_store"))
    assert copy.deepcopy(source).store is not ConfigStore.instance()
    hydra_config_store.share()
    assert copy.deepcopy(source).store is ConfigStore.instance()


def test_what_the_store_hands_out_is_a_copy():
    from hydra.core.config_store import ConfigStore

    store = ConfigStore.instance()
    store.store(group="compat_test", name="made", node={"value": 1})
    handed = store.load("compat_test/made.yaml").node
    handed.value = 2
    again = store.load("compat_test/made.yaml").node.value
    store.repo.pop("compat_test")
    assert again == 1, CHANGED.format(
        "hydra_config_store", "ConfigStore.load hands out the schema itself"
    )


def test_hydra_makes_every_schema_at_once_and_the_door_makes_one_when_it_is_read():
    from dataclasses import dataclass

    from hydra.core.config_store import ConfigStore

    @dataclass
    class Settings:
        size: int = 3

    def schema():
        made.append(Settings)
        return Settings

    made: list = []
    store = ConfigStore.instance()
    store.store(group="compat_test", name="eager", node=Settings)
    hydra_config_store.store_later("compat_test", "later", schema)
    try:
        eager, later = (
            vars(store.repo["compat_test"][f"{name}.yaml"]) for name in ("eager", "later")
        )
        assert "node" in eager, MENDED.format("Hydra", "hydra_config_store")
        assert "node" not in later
        assert not made
        nodes = [store.load(f"compat_test/{name}.yaml") for name in ("eager", "later", "later")]
        nodes[1].node.size = 4
    except (AttributeError, KeyError, TypeError) as error:
        pytest.fail(CHANGED.format("hydra_config_store", error))
    finally:
        store.repo.pop("compat_test", None)
    assert [node.node.size for node in nodes] == [3, 4, 3]
    assert nodes[0].node._metadata.object_type is nodes[2].node._metadata.object_type is Settings
    assert (nodes[0].group, nodes[0].name) == ("compat_test", "eager.yaml")
    assert (nodes[2].group, nodes[2].name) == ("compat_test", "later.yaml")


def test_differential_evolution_goes_a_generation_at_a_time_as_the_public_function_goes_in_one():
    import numpy as np
    from scipy.optimize import differential_evolution

    def valley(x):
        points.append(x.copy())
        return ((x - 0.3) ** 2).sum(axis=0)

    bounds, init = [(0, 1)] * 2, np.random.default_rng(1).random((8, 2))
    settings = {"init": init, "polish": False, "tol": 1e-3}
    points: list = []
    try:
        count = sum(1 for _ in generations(valley, bounds, np.random.default_rng(2), **settings))
    except (ImportError, AttributeError, TypeError) as error:
        pytest.fail(CHANGED.format("scipy_differential_evolution", error))
    stepwise, points = points, []
    seed = "rng" if "rng" in inspect.signature(differential_evolution).parameters else "seed"
    seeded = {seed: np.random.default_rng(2)}
    made = differential_evolution(
        valley, bounds, updating="deferred", vectorized=True, **seeded, **settings
    )
    assert made.nit == count > 5
    assert np.array_equal(np.hstack(stepwise), np.hstack(points[: len(stepwise)]))


def test_mlflow_lets_in_every_page_of_this_computer_but_for_the_door():
    from tractexp.compat import mlflow_own_origin as door

    # by itself: its package starts a server's imports, which take seconds
    path = Path(importlib.util.find_spec("mlflow").origin).parent / "server" / "security_utils.py"
    spec = importlib.util.spec_from_file_location("security_utils", path)
    security_utils = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(security_utils)
    own, other = "http://localhost:5000", "http://localhost:8888"
    blocked = security_utils.should_block_cors_request(other, "POST", [own])
    assert not blocked, MENDED.format("MLflow", "mlflow_own_origin")
    served, sent = [], []

    async def app(scope, receive, send):
        served.append(scope)

    async def send(message):
        sent.append(message)

    guarded = door.OwnOrigin(app, frozenset([own]))
    for headers in ([], [(b"origin", own.encode())]):
        asyncio.run(guarded({"type": "http", "headers": headers}, None, send))
    asyncio.run(guarded({"type": "lifespan"}, None, send))
    assert (len(served), sent) == (3, [])
    for kind in ("http", "websocket"):
        both = [(b"origin", own.encode()), (b"origin", other.encode())]
        asyncio.run(guarded({"type": kind, "headers": both}, None, send))
    assert len(served) == 3
    assert [message.get("status", message.get("code")) for message in sent] == [403, None, 1008]


def test_joblib_never_hears_of_a_dask_worker_that_was_killed_but_through_the_door():
    from tractexp.compat.joblib_dask import Dask  # which imports all of Dask

    class KilledWorker(Exception):
        status = "error"  # a future of Dask's as well as its error

    async def waiting():
        yield failed, (KilledWorker, failed, None)
        backend._continue = False

    failed, future, heard = KilledWorker(), Future(), []
    backend = Dask.__new__(Dask)
    backend._continue, backend.waiting_futures = True, waiting()
    backend._results, backend._callbacks = {failed: future}, {failed: heard.append}
    try:
        asyncio.run(backend._collect())
    except (AttributeError, KeyError, TypeError) as error:
        pytest.fail(CHANGED.format("joblib_dask", error))
    assert future.exception() is failed
    assert not heard, MENDED.format("joblib's Dask backend", "joblib_dask")
    assert backend.retrieve_result_callback(future) == [None]
    other = Future()
    other.set_exception(ZeroDivisionError())
    with pytest.raises(ZeroDivisionError):
        backend.retrieve_result_callback(other)


def reached(tree):
    """What a module takes that is not meant for it: (line, what)."""
    foreign, nodes = {}, [*ast.walk(tree)]
    for node in nodes:
        if isinstance(node, ast.Import):
            names = [(a.name, a.asname or a.name.partition(".")[0]) for a in node.names]
        elif isinstance(node, ast.ImportFrom) and not node.level:
            names = [(f"{node.module}.{a.name}", a.asname or a.name) for a in node.names]
        else:
            continue
        for path, name in names:
            parts = path.split(".")
            if parts[0] in OURS or parts[0] == "__future__":
                continue
            foreign[name] = path
            if any(p == "externals" or (p.startswith("_") and not p.endswith("__")) for p in parts):
                yield node.lineno, path
    for node in nodes:
        if (
            not isinstance(node, ast.Attribute)
            or not isinstance(node.value, ast.Name)
            or node.value.id not in foreign
        ):
            continue
        path = f"{foreign[node.value.id]}.{node.attr}"
        if isinstance(node.ctx, ast.Store) or (
            node.attr.startswith("_") and not node.attr.endswith("__")
        ):
            yield node.lineno, path


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("import os\nos._exit(1)", ["os._exit"]),
        ("from hydra._internal.utils import x", ["hydra._internal.utils.x"]),
        ("from joblib.externals.loky import x", ["joblib.externals.loky.x"]),
        (
            "def f():\n    from hydra import Store\n    Store.__deepcopy__ = 1",
            ["hydra.Store.__deepcopy__"],
        ),
        (
            "from tractexp.sweep import _x\nfrom __future__ import annotations\nimport numpy as"
            " np\nnp.__version__",
            [],
        ),
    ],
)
def test_private_parts_are_recognized(text, found):
    assert [path for _, path in reached(ast.parse(text))] == found


def test_private_parts_of_others_are_used_in_compat_only():
    meant = {"os._exit"}  # documented, whatever its name
    folders = [HERE, HERE.parent / "plugins"]
    files = [p for folder in folders for p in folder.rglob("*.py") if p.parent != HERE / "compat"]
    found = [
        f"{p}:{k}: {path}"
        for p in files
        for k, path in reached(ast.parse(p.read_text()))
        if path not in meant
    ]
    assert not found, "give each a module in tractexp/compat:\n" + "\n".join(found)
