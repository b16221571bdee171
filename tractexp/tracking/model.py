"""The identified model as MLflow stores it and as `mlflow.pyfunc.load_model` brings it back.

What is stored is the result file, the name of this module and the versions it needs: data, no
pickled code.
"""

import json
import sys
import tempfile
from collections.abc import Mapping
from importlib.metadata import entry_points
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from tractexp.errors import UserError
from tractexp.storage import files

if TYPE_CHECKING:
    import pandas as pd

RESULT = "result.json"


def _list_columns(*names: str, optional: str = "") -> str:
    """Columns of numbers as MLflow's format of models lists them."""
    return json.dumps(
        [{"type": "double", "name": name, "required": name != optional} for name in names]
    )


SIGNATURE = {
    "inputs": _list_columns("t", "U", "f", optional="f"),
    "outputs": _list_columns("P", "Q"),
    "params": None,
}


def log_model(
    client: Any,
    run_id: str,
    result: Path,
    parameters: Mapping[str, str] = MappingProxyType({}),
    description: str = "",
) -> str:
    """Log the model of the file `result` under a run, with an open `MlflowClient`, and return the
    model id. Its page in MLflow has the parameters and the description, which is Markdown.

    `mlflow.pyfunc.log_model` is not used: it imports pandas, and lists every file of every
    installed package (0.4 s) to find requirements that this module has at hand.
    """
    from mlflow.entities import LoggedModelOutput

    from tractexp.tracking.run import NOTE

    experiment_id = client.get_run(run_id).info.experiment_id
    tags = {NOTE: description} if description else {}
    logged = client.create_logged_model(
        experiment_id, "model", run_id, tags, dict(parameters), "traction load"
    )
    client.log_outputs(run_id, [LoggedModelOutput(logged.model_id, step=0)])
    with tempfile.TemporaryDirectory() as folder:
        _save(Path(folder), result, run_id, logged)
        client.log_model_artifacts(logged.model_id, folder)
    client.finalize_logged_model(logged.model_id, "READY")
    return logged.model_id


def _save(folder: Path, result: Path, run_id: str, logged: Any) -> None:
    """Write the folder MLflow calls a model: its description, the data, and the environment it
    needs.
    """
    import mlflow
    import yaml
    from mlflow.models import Model

    model = Model(
        artifact_path=logged.artifact_location,
        run_id=run_id,
        model_id=logged.model_id,
        model_uuid=logged.model_id,
    )
    python = ".".join(map(str, sys.version_info[:3]))
    environment = "python_env.yaml"
    model.add_flavor(
        "python_function",
        loader_module=__name__,
        python_version=python,
        data=RESULT,
        env={"virtualenv": environment},
    )
    files.write(folder / "MLmodel", yaml.safe_dump(model.to_dict() | {"signature": SIGNATURE}))
    files.write_json(folder / RESULT, files.read_json(result))
    packages = {
        f"{p.dist.name}=={p.dist.version}" for p in entry_points(group="tractexp.plugins") if p.dist
    }
    files.write(
        folder / "requirements.txt", "\n".join([f"mlflow=={mlflow.__version__}", *sorted(packages)])
    )
    files.write(folder / environment, f"python: {python}\ndependencies:\n- -r requirements.txt\n")


def _load_pyfunc(path: str) -> "Predictor":
    """The predictor that `mlflow.pyfunc.load_model` makes of the stored result file."""
    from tractexp.identification.result import load

    return Predictor(load(Path(path)))


class Predictor:
    """Predicts a data frame with columns P, Q [pu] from one with t [s], U [pu] and, where recorded,
    f [Hz].
    """

    def __init__(self, model: Any):
        """Predict with an identified model."""
        self.model = model

    def predict(
        self, frame: "pd.DataFrame", params: dict[str, Any] | None = None
    ) -> "pd.DataFrame":
        """P and Q for a frame of t [s] and U [pu]."""
        import pandas as pd

        for name in ("t", "U"):
            if name not in frame:
                raise UserError(
                    f"the data lack a column {name}; t [s] and U [pu] are needed, f [Hz] may be"
                    " there too"
                )
        P, Q = self.model.predict(frame["t"], frame["U"], frame.get("f"))
        return pd.DataFrame({"P": P, "Q": Q}, index=frame.index)
