"""No address with a password in it comes in, and no sentence repeats it."""

import pytest

from tractexp.errors import UserError
from tractexp.storage import credentials
from tractexp.tracking import resolve_address
from tractexp.tracking.store import open_store

SECRET = "hunter2"
HELD = [
    "http://me:hunter2@host:5000",
    "https://hunter2@host",
    "HTTPS://me:hunter2@host/x",
    "postgresql://me:hunter2@host/db",
    "postgresql+psycopg2://me:hun/ter2hunter2@host/db",
    "mysql+pymysql://:hunter2@host/db",
    "http://me:a?hunter2@host",
    "postgresql://host/db?user=me&password=hunter2",
    "https://host/?access_token=hunter2",
    "http://host?API_KEY=hunter2",
    "http://me:a@hunter2@host",
    "redis://:hunter2@host",
    "http://h?api-key=hunter2",
    "http://h/#token=hunter2",
    "http://h/?x=1#access_token=hunter2",
    "http://h?X-Amz-Signature=hunter2",
    "http://h?x-api-key=hunter2",
    "https://h?AccountKey=hunter2",
    "http://h?key=hunter2",
    "databricks://dapihunter2hunter2",
    "databricks-uc://hunter2hunter2hunter2hunter2hunter2",
    "http://h?auth=hunter2",
    "http://me:${oc.env:X}hunter2@host",
]
FREE = [
    "",
    "http://host:5000",
    "https://host/path/a",
    "sqlite:///runs.db",
    "sqlite:////home/a:b@c/runs.db",
    "databricks://me",
    "databricks://my-team:prefix",
    "http://h?monkey=1",
    "http://host/?author=me",
    "postgresql://me@host/db",
    "postgresql+psycopg2://tester@127.0.0.1:1/postgres",
    "pkg://tractexp/data/a.csv",
    "postgresql://host/db?passfile=/home/me/.pgpass&sslkey=/x.pem",
    "a@b:c.csv",
    "C:\\x@y:z.csv",
    "file:///a@b:c",
]


@pytest.mark.parametrize("text", HELD)
def test_an_address_with_a_password_is_refused_without_repeating_it(text):
    for enter in (
        resolve_address,
        open_store,
        lambda t: credentials.check("", {"tracking": {"uri": t}, "seed": 1}),
    ):
        with pytest.raises(UserError, match="MLFLOW_TRACKING_PASSWORD") as refused:
            enter(text)
        assert SECRET not in str(refused.value)


@pytest.mark.parametrize("text", FREE)
def test_any_other_is_let_in(text):
    credentials.check("", {"a": [text, None, 1.5], "b": {"c": f"data.path={text}"}})
