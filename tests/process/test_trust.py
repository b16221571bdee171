"""What somebody else gave is data: none of it runs, sends, overwrites, or stands in for what is ours."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import tractexp.data

DATA = Path(tractexp.data.__file__).parent
QUICK = ("optimizer=random_search", "budget=10", "hydra.run.dir=run")


# Modules beside the records

TRAPS = ("mlflow", "numpy", "pickle", "yaml", "joblib", "hydra", "json", "typing_extensions", "uvicorn", "tempfile")
TRAP = "open('trapped', 'a').write(__name__ + ' ')\nraise ImportError(__name__)\n"


@pytest.fixture
def trapped(tmp_path) -> Path:
    """A folder of records, beside which modules lie that say when they are imported."""
    for name in TRAPS:
        (tmp_path / f"{name}.py").write_text(TRAP)
    shutil.copy(DATA / "tibet_30pct.csv", tmp_path / "dip.csv")
    return tmp_path


COMMAND, MODULE = (str(Path(sys.executable).with_name("tractexp")),), (sys.executable, "-m", "tractexp")


@pytest.mark.parametrize(
    ("start", "arguments"),
    [
        (COMMAND, ("data=csv", "data.train=[dip.csv]", *QUICK)),
        (MODULE, ("data=csv", "data.train=[dip.csv]", *QUICK)),
        (COMMAND, ("task=survey", "data.path=.", "tracking.enabled=false")),
    ],
    ids=["a run that is logged", "the same by python -m", "workers of a survey"],
)
def test_no_module_beside_the_records_is_imported(start, arguments, trapped):
    done = subprocess.run([*start, *arguments], cwd=trapped, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert not (trapped / "trapped").exists()


def test_the_server_of_the_pages_imports_none_either(trapped, uri):
    from command_line import free_port

    command = [str(Path(sys.executable).with_name("tractexp")), "ui", "--uri", uri, "--port", str(free_port())]
    with subprocess.Popen(command, cwd=trapped, stdout=subprocess.PIPE, text=True, env=os.environ) as server:
        assert server.stdout is not None
        said = [server.stdout.readline(), server.stdout.readline()]
        server.terminate()
    assert "ready" in said[1]
    assert not (trapped / "trapped").exists()
