"""MLflow's server, for its own pages alone.

What: MLflow lets in the pages of every server on this computer, whatever origins it is told to
allow, and answers them with the credentials of its own: another user's server, or a page under
development, reads and changes every run. Here a request from a page of another origin ends before
it reaches MLflow. Why not through MLflow: `--cors-allowed-origins` adds origins and takes none
away; `--app-name` needs an entry point. Since: at least MLflow 3.10; looked at in 3.17.2. Upstream:
not reported yet. When mended: drop this module, and start `mlflow server` by itself.
"""

import os
import sys
from collections.abc import Awaitable, Callable, MutableMapping
from pathlib import Path
from typing import Any, TypeAlias

Message: TypeAlias = MutableMapping[str, Any]
Receive: TypeAlias = Callable[[], Awaitable[Message]]
Send: TypeAlias = Callable[[Message], Awaitable[None]]
THEIRS, OURS = "mlflow.server.fastapi_app:app", "tractexp.compat.mlflow_own_origin:app"
ORIGINS = "MLFLOW_SERVER_CORS_ALLOWED_ORIGINS"  # as `mlflow server` hands on its option


class OwnOrigin:
    """A web application (ASGI) that answers pages of some origins only."""

    def __init__(self, app: Callable[..., Awaitable[None]], origins: frozenset[str]):
        """An application that answers requests from these origins only."""
        self.app, self.origins = app, origins

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        origins = [
            value.decode("latin-1") for name, value in scope.get("headers", ()) if name == b"origin"
        ]
        if self.origins.issuperset(origins):
            await self.app(scope, receive, send)
        elif scope["type"] == "http":
            plain = [(b"content-type", b"text/plain")]
            await send({"type": "http.response.start", "status": 403, "headers": plain})
            await send({"type": "http.response.body", "body": b"this page is of another origin"})
        else:
            await send({"type": "websocket.close", "code": 1008})


def __getattr__(name: str) -> Any:
    """`app`, when the server asks for it: to make it imports MLflow's."""
    if name != "app":
        raise AttributeError(name)
    from mlflow.server.fastapi_app import app

    return OwnOrigin(app, frozenset(os.environ[ORIGINS].split(",")))


def main() -> None:
    """`mlflow` with these arguments, whose server serves `app`."""
    import mlflow.server
    from mlflow.cli import cli

    server: Any = mlflow.server
    build = server._build_uvicorn_command

    def command(*arguments: Any, **settings: Any) -> list[str]:
        words = build(*arguments, **settings)
        words[words.index(THEIRS)] = OURS  # where it is another, there is no server
        # Uvicorn looks for modules in the folder of the application first: by default the current
        # one, of records.
        at = words.index("uvicorn") + 1
        words[at:at] = ["--app-dir", str(Path(mlflow.server.__file__).parents[2])]
        return words

    server._build_uvicorn_command = command
    cli(sys.argv[1:])


if __name__ == "__main__":
    main()
