"""docs/python.md and the notebook run as they stand, and what they show is what they say."""

import re
import shutil
import warnings
from pathlib import Path

import pytest

from tractexp import PUBLIC

ROOT = Path(__file__).parents[2]


def test_the_examples_of_the_python_page_run(resistive_dips, tmp_path, monkeypatch):
    """All of them, one after the other, on dips of a motor with a stator resistance."""
    monkeypatch.chdir(tmp_path)
    for path in resistive_dips:
        shutil.copy(path, tmp_path)
    names = {}
    page = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    for example in re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL):
        exec(compile(example, "docs/python.md", "exec"), names)
    assert names["found"].names == ("stator_resistance",)
    assert names["again"].parameters["R_s"].value == pytest.approx(0.02, rel=0.1)
    assert names["same"].result == names["fit"].result
    assert (tmp_path / "report.html").stat().st_size > 10_000
    assert (tmp_path / "studied" / "generalise.json").is_file()
    for name in PUBLIC:
        assert f"tractexp.{name}" in page, name


@pytest.mark.long
def test_the_notebook_runs_and_ends_well():
    """Executed anew, its kernel in a process of its own; what its cells show is checked against
    what it says.
    """
    nbformat = pytest.importorskip("nbformat", reason="the extra [test] is not installed")
    nbclient = pytest.importorskip("nbclient", reason="the extra [test] is not installed")
    path = ROOT / "docs" / "from-record-to-extended-model.ipynb"
    kept = nbformat.read(path, as_version=4)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the kernel's transport, which is not ours
        run = nbclient.NotebookClient(
            nbformat.read(path, as_version=4), timeout=300, kernel_name="python3"
        ).execute()

    def shown(notebook):
        return [
            output.get("text") or output["data"]["text/plain"]
            for cell in notebook.cells
            for output in cell.get("outputs", ())
        ]

    texts = shown(run)
    assert len(texts) == len(shown(kept)), (
        "executed with all outputs: execute docs/*.ipynb again and save them"
    )
    assert any("NAMED stator_resistance" in text for text in texts)
    assert "('named', ('stator_resistance',)" in "".join(texts)
    errors = {
        line.split()[0]: re.findall(r"([\d.]+)%", line)
        for text in texts
        for line in text.splitlines()
        if line.startswith(("before:", "after:"))
    }
    assert all(
        float(b) > 2 * float(a) for b, a in zip(errors["before:"], errors["after:"], strict=True)
    )
