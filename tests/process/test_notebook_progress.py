"""The progress of a call in a notebook: a bar that moves, and is gone when the call is done."""

import re
import warnings

import pytest

CELL = """
import time
from tractexp.text.progress import count_parts, report_search, tell_stages

with count_parts("searches", 3) as count:
    for _ in range(3):
        count()
        time.sleep(0.2)
with report_search(None, 100) as tell:
    for k in range(3):
        tell(k, 0.5 / (k + 1), 25 * k)
        time.sleep(0.2)
with tell_stages(None) as tell:
    for stage in ("fits the model", "judges [bold]it"):
        tell(stage)
        time.sleep(0.2)
"""


@pytest.fixture(scope="module")
def shown():
    """What a notebook was sent to display, one text for each, by display; and what is left of it.

    As a browser's notebook is: by the protocol of its kernel, which is a process of its own.
    """
    nbformat = pytest.importorskip("nbformat", reason="the extra [test] is not installed")
    nbclient = pytest.importorskip("nbclient", reason="the extra [test] is not installed")
    sent: dict[str, list[str]] = {}

    class Listening(nbclient.NotebookClient):
        def process_message(self, msg, cell, cell_index):
            content = msg["content"]
            if msg["msg_type"] in ("display_data", "update_display_data"):
                name = content["transient"]["display_id"]
                data = content["data"]
                sent.setdefault(name, []).append(data.get("text/html", data["text/plain"]))
            return super().process_message(msg, cell, cell_index)

    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(CELL)])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the kernel's transport, which is not ours
        Listening(notebook, timeout=120, kernel_name="python3").execute()
    return list(sent.values()), notebook.cells[0].outputs


def words(html):
    return " ".join(re.sub(r"<[^>]*>", " ", html).split())


def test_a_bar_moves_with_the_parts_and_the_best_of_a_search(shown):
    (parts, search, stages), _ = shown
    assert "searches" in words(parts[0])
    assert any("2/3" in words(text) for text in parts)
    told = [words(text) for text in search]
    assert any("25 simulations, best objective 0.25" in text for text in told)
    assert any("s left" in text for text in told)
    assert any("judges [bold]it" in words(text) for text in stages)


def test_nothing_is_left_of_it_when_the_call_is_done(shown):
    sent, outputs = shown
    assert [texts[-1] for texts in sent] == [""] * 3
    assert [words(output["data"].get("text/html", "")) for output in outputs] == [""] * 3
    assert all(output["output_type"] == "display_data" for output in outputs), "no printed lines"
