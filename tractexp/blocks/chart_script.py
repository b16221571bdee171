"""The JavaScript by which a page draws its charts, packed."""

import base64
import functools
import gzip
import json

from tractexp.blocks import plotly
from tractexp.cache import store
from tractexp.storage import files

SETTINGS = {
    "responsive": True,
    "displaylogo": False,
    "showSendToCloud": False,  # nothing leaves this computer
    "plotlyServerURL": "",
    "modeBarButtonsToRemove": ["select2d", "lasso2d", "autoScale2d"],
    "toImageButtonOptions": {"format": "svg"},
}
LICENSE = "// plotly.js, copyright Plotly, Inc., MIT license"
PAPER = 700  # pixels, the width of a printed page: A4 without its margins of 12 mm
# points of a sampled line that are drawn at once: twice as many as a page is wide
MOST_DRAWN_POINTS = 2000


@functools.cache
def build_script() -> str:
    """The JavaScript that a page with charts holds once: a license line, and Plotly.js and our
    `chart.js`, compressed, with what unpacks and runs them.
    """
    drawing = files.read_packaged_text("blocks/chart.js").replace("SETTINGS", json.dumps(SETTINGS))
    drawing = drawing.replace("PAPER", str(PAPER)).replace("SHOWN", str(MOST_DRAWN_POINTS))
    program = store.TEXTS.get(
        store.compute_key("charts", plotly.compute_digest(), drawing),
        lambda: pack_program(plotly.read_code() + drawing),
    )
    return "\n".join(
        [files.read_packaged_text("blocks/unpack.js"), LICENSE, f'run("{program.decode()}");']
    )


def pack_program(program: str) -> bytes:
    """A program as gzip and base 64 pack it: two fifths of its length, and the same for the same
    program.
    """
    return base64.b64encode(gzip.compress(program.encode(), mtime=0))
