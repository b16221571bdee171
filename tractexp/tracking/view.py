"""The view that MLflow's page opens on: runs grouped by optimizer, averaged over seeds, with their fitness curves.

MLflow keeps shared views as experiment tags. That is its internal affair and not documented: the address below is
understood by the versions tested, and one that does not know it shows its ordinary page.
"""

import base64
import json
import zlib
from typing import Any

from tractexp.tracking.run import tag_experiment
from tractexp.tracking.store import open_store, sentences

KEY = "tractexp"
TAG = f"mlflow.sharedViewState.{KEY}"
SECTION = "tractexp-charts"
RUNS = "tags.task = 'identify' and metrics.objective >= 0"  # a sweep's own run has no objective
STATE = {
    "searchFilter": RUNS,
    "orderByKey": "metrics.`objective`",
    "orderByAsc": True,
    "groupBy": {"aggregateFunction": "average", "groupByKeys": [{"mode": "tag", "groupByData": "optimizer"}]},
    "runsExpanded": {},
    "useGroupedValuesInCharts": True,
    "hideEmptyCharts": True,
    "compareRunsMode": "CHART",
}


def _chart(kind: str, metric: str, **more: Any) -> dict[str, Any]:
    return {
        "type": kind, "uuid": f"tractexp-{metric}", "metricKey": metric, "metricSectionId": SECTION,
        "runsCountToCompare": 100, "deleted": False, "isGenerated": False, **more,
    }  # fmt: skip


def _state(optimizers: set[str]) -> dict[str, Any]:
    """The view: one closed group for each optimizer, the fitness curves first, on a logarithmic axis."""
    curve = {
        "scaleType": "log", "xAxisKey": "step", "xAxisScaleType": "linear", "yAxisKey": "metric", "lineSmoothness": 0,
        "range": {}, "useGlobalXaxisKey": True, "useGlobalLineSmoothing": True, "yAxisExpressions": [],
    }  # fmt: skip
    lines = [
        _chart("LINE", metric, selectedMetricKeys=[metric], **curve) for metric in ("fitness_by_simulations", "fitness")
    ]
    bars = [
        _chart("BAR", metric, dataAccessKey=metric)
        for metric in ("objective", "epsilon_p", "epsilon_q", "simulations", "seconds")
    ]
    section = {"uuid": SECTION, "name": "Comparison", "display": True, "deleted": False, "isGenerated": False}
    return STATE | {
        "selectedColumns": [
            "attributes.`Source`", "tags.`optimizer`", "tags.`seed`",
            "metrics.`objective`", "metrics.`epsilon_p`", "metrics.`epsilon_q`", "metrics.`simulations`",
        ],
        "groupsExpanded": {f"tag.optimizer.{optimizer}": False for optimizer in optimizers},
        "compareRunCharts": [*lines, *bars],
        "compareRunSections": [section | {"isReordered": False}],
    }  # fmt: skip


def comparison_view(uri: str) -> str:
    """Store the view in the experiment that has the newest identification, and return its page for `serve`.

    "" where nothing was identified yet.
    """
    client = open_store(uri)
    with sentences(uri):
        names = {found.experiment_id: found.name for found in client.search_experiments()}
        newest = client.search_runs(list(names), RUNS, max_results=1, order_by=["start_time DESC"])
        if not newest:
            return ""
        experiment_id = newest[0].info.experiment_id
        runs = client.search_runs([experiment_id], RUNS, max_results=1000, order_by=["start_time DESC"])
    state = _state({run.data.tags["optimizer"] for run in runs if "optimizer" in run.data.tags})
    packed = base64.b64encode(zlib.compress(json.dumps(state).encode())).decode()
    tag_experiment(names[experiment_id], {TAG: f"deflate;{packed}"}, uri)
    return f"#/experiments/{experiment_id}/runs?viewStateShareKey={KEY}&compareRunsMode=CHART"
