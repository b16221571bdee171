"""The plugin file that an investigation writes of a proposed term, as a module of this process."""

import importlib.util
import sys


def load_proposed_effect(path, monkeypatch):
    """The module of the file, known as `proposed_effect` for as long as a test takes."""
    spec = importlib.util.spec_from_file_location("proposed_effect", path)
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "proposed_effect", module)
    spec.loader.exec_module(module)
    return module
