"""What version 0.2 called otherwise still works."""

import pytest

from tractexp.api.look import Look
from tractexp.api.task import Task
from tractexp.configuration import plugin as plugins
from tractexp.exchange.format import Format
from tractexp.extend import Box, Channel, Effect, Reader, Static, WaveformReader
from tractexp.model.equations import Equations
from tractexp.model.model import Model

OLD_HOOKS = [
    (Effect, "shown", "describe_sign"),
    (Static, "damping", "compute_damping"),
    (Format, "simulated", "play_back_dip"),
    (Reader, "of", "build_settings"),
    (Task, "logged", "collect_log"),
]


@pytest.mark.parametrize(("base", "old", "new"), OLD_HOOKS)
def test_what_an_older_plugin_defines_is_called_by_its_new_name(monkeypatch, base, old, new):
    def answer(self, *_):
        return "told"

    left_open = [n for n in dir(base) if getattr(getattr(base, n), "__isabstractmethod__", False)]
    idle = {name: lambda *_: None for name in left_open}
    body = {"__doc__": "Source: here.", "__module__": "elsewhere.stranger", "__annotations__": {}}
    monkeypatch.setattr(base, "check_class", classmethod(lambda cls, where: None))
    monkeypatch.setitem(plugins._registry, base.group, {})
    stranger = plugins.plugin(type("Stranger", (base,), body | idle | {old: answer}))
    assert getattr(stranger, new) is answer


@pytest.mark.parametrize(
    ("owner", "old", "new"),
    [
        (Equations, "before", "evaluate_before"),
        (Equations, "apart", "view_with_suffix"),
        (Model, "listing", "format_listing"),
        (Channel, "recorded", "read_values"),
        (WaveformReader, "opened", "open_recording"),
        (Look, "everything", "build_full_report"),
    ],
)
def test_a_method_is_called_by_its_earlier_name_too(owner, old, new):
    assert getattr(owner, old) is getattr(owner, new)


def test_a_box_of_parameters_is_made_by_its_earlier_name_too():
    assert Box.of(()).names == Box.from_parameters(()).names == ()
