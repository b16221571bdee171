"""`tractexp ui`: the MLflow UI, on this computer only."""

import argparse

from tractexp.errors import UserError


def ui(arguments: list[str]) -> int:
    """Serve the store of the current folder (or `--uri`) on loopback until interrupted; returns the
    exit code.

    The address printed opens on the comparison of the newest experiment, by variant.
    """
    parser = argparse.ArgumentParser(
        prog="tractexp ui", description="Open the MLflow UI on this computer only."
    )
    parser.add_argument(
        "--uri", help="tracking store; default: MLFLOW_TRACKING_URI, else outputs/mlflow.db here"
    )
    parser.add_argument("--port", type=int, default=5000)
    parser.add_argument("--open", action="store_true", help="open it in the browser")
    chosen = parser.parse_args(arguments)
    from tractexp import tracking
    from tractexp.tracking.ui import serve

    return serve(
        tracking.resolve_address(chosen.uri),
        port=chosen.port,
        page=_find_start_page,
        open_browser=chosen.open,
    )


def _find_start_page(uri: str) -> str:
    """Store the view that compares runs and return its address on the server; that of the list of
    experiments if the store cannot keep it.

    The server's root is no start: MLflow shows a page on language models there.
    """
    from tractexp.tracking.view import EXPERIMENTS, store_comparison_view

    try:
        return store_comparison_view(uri)
    except UserError as error:
        print(
            "tractexp ui: opens on the list of experiments, because the comparison view could not"
            f" be stored: {error}"
        )
        return EXPERIMENTS
