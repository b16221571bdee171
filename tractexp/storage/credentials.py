"""Passwords and tokens in addresses: refused wherever one comes in, since addresses are printed,
stored and logged.
"""

import re
from collections.abc import Mapping
from typing import Any

from tractexp.errors import UserError

ADDRESS = re.compile(r"([a-z][a-z0-9+.\-]*)://([^\s]*)", re.IGNORECASE)
QUERY = re.compile(
    r"[?&;#](?:[\w.\-]*(?:password|passwd|pwd|passphrase|token|secret|signature|credential|auth"
    r"|(?:api|access|account|private)[-_.]?key)|pass|sig|key)=[^&;#]",
    re.IGNORECASE,
)
# in the place of a profile of Databricks
TOKEN = re.compile(r"dapi\w{8,}|[\w+/=\-]{32,}", re.ASCII)


def holds_credentials(text: str) -> bool:
    """Whether a text holds an address with a password or a token; the name alone is one where a
    server is asked.
    """
    for scheme, rest in ADDRESS.findall(text):
        user, at, _ = rest.rpartition("@")
        named = (
            at and not user.startswith("/") and (":" in user or scheme.lower() in ("http", "https"))
        )
        token = scheme.lower().startswith("databricks") and TOKEN.fullmatch(rest)
        if named or token or QUERY.search(rest):
            return True
    return False


def check(where: str, content: Any) -> None:
    """Raise `UserError`, which does not repeat it, where a text, or one in a configuration, holds
    such an address.
    """
    if isinstance(content, Mapping):
        for key, value in content.items():
            check(f"{where}.{key}".lstrip("."), value)
    elif isinstance(content, list | tuple):
        for value in content:
            check(where, value)
    elif isinstance(content, str) and holds_credentials(content):
        raise UserError(
            f"{where} is an address with a user's name, password or token in it, which would be"
            " printed, stored and logged; leave it out and give it by MLFLOW_TRACKING_USERNAME and"
            " MLFLOW_TRACKING_PASSWORD (or MLFLOW_TRACKING_TOKEN), by a .netrc that you alone can"
            " read, or for PostgreSQL by PGPASSWORD or .pgpass"
        )
