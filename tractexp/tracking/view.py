"""The view that MLflow's page opens on: runs grouped by variant, averaged over seeds, with their
fitness curves.

MLflow keeps shared views as experiment tags. That is its internal affair and not documented: the
address below is understood by the versions tested, and one that does not know it shows its ordinary
page.
"""

import base64
import json
import zlib
from collections.abc import Mapping, Sequence
from typing import Any

from tractexp.tracking.run import NOTE, tag_experiment
from tractexp.tracking.store import open_store, raise_sentences

KEY = "tractexp"
# Else MLflow's page is one for language models: in earlier versions by this tag of an experiment,
# in later ones by the address.
WORKFLOW = "workflowType=machine_learning"
EXPERIMENTS = f"#/experiments?{WORKFLOW}"  # the address of their list within MLflow's page
KIND, MODELS = "mlflow.experimentKind", "custom_model_development"
TAG = f"mlflow.sharedViewState.{KEY}"
SECTION = "tractexp-charts"
RUNS = "tags.task = 'identify' and metrics.objective >= 0"  # a sweep's own run has no objective
# a tag of runs on the records of a station: these are compared load by load, not by optimizer
LOAD = "load"
# the first columns
ERRORS = ("model_error", "model_error_held_out", "model_error_over_linear_network")
GROUPS = ("variant", "optimizer")  # tags to group by: early runs have only the second
METRICS = (
    "search_objective",
    "search_epsilon_p",
    "search_epsilon_q",
    "search_simulations",
    *ERRORS,
    "grade",
    "objective",
    "epsilon_p",
    "epsilon_q",
)
COLUMNS = [*(f"metrics.`{name}`" for name in METRICS), "tags.`variant`", "tags.`seed`"]
STATE = {
    "searchFilter": RUNS,
    "orderByKey": "metrics.`search_objective`",
    "orderByAsc": True,
    "runsExpanded": {},
    "runsHiddenMode": "SHOW_ALL",  # by default the first ten
    "useGroupedValuesInCharts": True,
    "hideEmptyCharts": True,
    "compareRunsMode": "CHART",
}
AXES = {
    "xAxisKey": "step",
    "xAxisScaleType": "linear",
    "yAxisKey": "metric",
    "lineSmoothness": 0,
    "range": {},
    "useGlobalXaxisKey": True,
    "useGlobalLineSmoothing": True,
    "yAxisExpressions": [],
}


def _plot_comparison(metric_x: str, metric_y: str) -> dict[str, Any]:
    """The chart of one metric against another, a point a run."""
    axes = {
        axis: {"key": key, "type": "METRIC"}
        for axis, key in (("xaxis", metric_x), ("yaxis", metric_y))
    }
    return _describe_chart("SCATTER", f"{metric_y} by {metric_x}", **axes)


def _describe_chart(kind: str, metric: str, **more: Any) -> dict[str, Any]:
    """A chart of a metric on MLflow's page of runs."""
    return {
        "type": kind,
        "uuid": f"tractexp-{metric}",
        "metricKey": metric,
        "metricSectionId": SECTION,
        "runsCountToCompare": 100,
        "deleted": False,
        "isGenerated": False,
        **more,
    }


def _list_charts() -> list[dict[str, Any]]:
    """The charts of the page of runs, as MLflow wants them.

    The best objective so far by simulations and by iterations, objectives and errors run by run,
    where searches ended, and what they cost.
    """
    curves = [
        _describe_chart(
            "LINE",
            metric,
            selectedMetricKeys=[metric],
            **AXES | {"scaleType": "log", "xAxisScaleType": scale},
        )
        for metric, scale in (("fitness_by_simulations", "log"), ("fitness", "linear"))
    ]
    points = [
        _describe_chart(
            "LINE",
            metric,
            selectedMetricKeys=[metric],
            displayPoints=True,
            **AXES | {"scaleType": "log"},
        )
        for metric in ("search_objective", "objective", "epsilon_p", "epsilon_q")
    ]
    ends = _plot_comparison("search_simulations", "search_objective")
    costs = [
        _describe_chart("BAR", metric, dataAccessKey=metric)
        for metric in ("search_simulations", "search_seconds")
    ]
    return [*curves, *points, ends, *costs]


def _build_state(runs: Sequence[Mapping[str, str]]) -> dict[str, Any]:
    """The view of runs with these tags: one closed group for each variant, the fitness curves
    first.

    What spans decades has a logarithmic axis. Bars have none and are labelled with two decimals:
    the rest is points.
    """
    if any(LOAD in tags for tags in runs):
        return STATE | _describe_load_table()
    keys = GROUPS[:1] if all("variant" in tags for tags in runs) else GROUPS
    groups = {".".join(f"{key}.{tags.get(key, '')}" for key in keys) for tags in runs}
    section = {
        "uuid": SECTION,
        "name": "Comparison",
        "display": True,
        "deleted": False,
        "isGenerated": False,
    }
    return STATE | {
        "groupBy": {
            "aggregateFunction": "average",
            "groupByKeys": [{"mode": "tag", "groupByData": key} for key in keys],
        },
        "selectedColumns": COLUMNS,
        "groupsExpanded": {f"tag.{group}": False for group in groups},
        "compareRunCharts": _list_charts(),
        "compareRunSections": [section | {"isReordered": False}],
    }


def _describe_load_table() -> dict[str, Any]:
    """The table of a station's runs, the best model of each load first to be found: columns that
    sort.
    """
    metrics = (*ERRORS, "epsilon_p", "epsilon_q", "epsilon_i", "objective")
    tags = (LOAD, "model", "optimizer", "seed")
    return {
        "groupBy": None,
        "useGroupedValuesInCharts": False,
        "compareRunsMode": "TABLE",
        "orderByKey": "metrics.`model_error`",
        "orderByAsc": True,
        "selectedColumns": [
            *(f"metrics.`{name}`" for name in metrics),
            *(f"tags.`{name}`" for name in tags),
        ],
    }


def address_page(experiment_id: str, mode: str) -> str:
    """The address of the view within MLflow's page."""
    view = f"viewStateShareKey={KEY}&compareRunsMode={mode}"
    return f"#/experiments/{experiment_id}/runs?{view}&{WORKFLOW}"


def tag_new_experiment(experiment_id: str) -> dict[str, str]:
    """The tags by which a new experiment has the view as a table, and its description leads there
    from any page.
    """
    table = STATE | {"groupBy": None, "compareRunsMode": "TABLE", "selectedColumns": COLUMNS}
    page = address_page(experiment_id, "TABLE")
    note = f"[Errors, grades and where the searches ended, as columns]({page})"
    return {TAG: _pack_view(table), NOTE: note, KIND: MODELS}


def store_comparison_view(uri: str) -> str:
    """Store the view in the experiment that has the newest identification, and return its page for
    `serve`.

    Where nothing was identified yet, it is the table of the newest runs; without any, the list of
    experiments.
    """
    client = open_store(uri)
    with raise_sentences(uri):
        names = {one.experiment_id: one.name for one in client.search_experiments()}
        newest, others = (
            client.search_runs(list(names), runs, max_results=1, order_by=["start_time DESC"])
            for runs in (RUNS, "")
        )
        if not newest:
            return address_page(others[0].info.experiment_id, "TABLE") if others else EXPERIMENTS
        experiment_id = newest[0].info.experiment_id
        runs = client.search_runs(
            [experiment_id], RUNS, max_results=1000, order_by=["start_time DESC"]
        )
    state = _build_state([run.data.tags for run in runs])
    tag_experiment(names[experiment_id], {TAG: _pack_view(state)}, uri)
    return address_page(experiment_id, state["compareRunsMode"])


def _pack_view(state: Mapping[str, Any]) -> str:
    """A view as MLflow keeps it in a tag."""
    return "deflate;" + base64.b64encode(zlib.compress(json.dumps(state).encode())).decode()
