"""`tractexp ui`: the MLflow UI, on this computer only."""

import argparse
from pathlib import Path


def ui(arguments: list[str]) -> int:
    """Serve the store of the current folder (or `--uri`) on loopback until interrupted; returns the exit code."""
    parser = argparse.ArgumentParser(prog="tractexp ui", description="Open the MLflow UI on this computer only.")
    parser.add_argument("--uri", help="tracking store; default: outputs/mlflow.db of the current folder")
    parser.add_argument("--port", type=int, default=5000)
    chosen = parser.parse_args(arguments)
    from tractexp import tracking

    return tracking.serve(chosen.uri or tracking.default_uri(Path.cwd()), port=chosen.port)
