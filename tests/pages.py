"""Pages and charts read back."""

import base64
import html.parser
import json
import re

import numpy as np

from tractexp.blocks.chart_script import build_script

VOID = {"meta", "br", "img", "path", "use", "rect", "line"}


class Reader(html.parser.HTMLParser):
    """Checks that elements nest, and collects ids, references and what would be loaded from
    elsewhere.
    """

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.ids, self.references, self.words = [], [], [], [], ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        if tag not in VOID:
            self.open.append(tag)
        for key, value in attributes:
            if key == "id":
                self.ids.append(value)
            self.references += re.findall(r"url\((?:'|\")?([^)'\"]*)", value or "")
            if key in ("src", "href", "xlink:href"):
                self.references.append(value)

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data):
        self.words += data


def read(path) -> Reader:
    """A page read back, after checking that it is valid and self-contained."""
    # our own, the only one
    text = path.read_text(encoding="utf-8").replace(f"<script>{build_script()}</script>", "")
    # what charts draw: data, no program
    text = re.sub(r'<script type="application/json">[^<]*</script>', "", text)
    reader = Reader(text)
    assert len(set(reader.ids)) == len(reader.ids)
    assert all(
        reference.startswith("#") and reference[1:] in reader.ids for reference in reader.references
    )
    assert not re.search(r"https?://|//[a-z]|@import", text)
    assert not {"script", "link", "iframe", "img", "object", "embed", "metadata"} & set(reader.tags)
    return reader


def charts(text):
    """What the charts of a page's text draw, from the top."""
    made = [
        json.loads(data)
        for data in re.findall(r'<script type="application/json">([^<]*)</script>', text)
    ]
    for chart in made:
        for trace in chart["data"]:
            for key in ("x", "y"):
                if isinstance(trace.get(key), dict) and "array" in trace[key]:
                    trace[key] = chart["arrays"][trace[key]["array"]]
    return made


def unpacked(packed):
    """The numbers of an array as the page holds it; nan is a gap."""
    if "count" in packed:
        return packed["start"] + packed["step"] * np.arange(packed["count"])
    raw = np.frombuffer(base64.b64decode(packed["bdata"]), dtype=f"<{packed['dtype']}")
    if packed["dtype"] != "i2":
        return raw
    return np.where(raw == -32768, np.nan, packed["offset"] + packed["scale"] * raw)
