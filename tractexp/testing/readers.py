"""What readers must satisfy."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from tractexp.configuration.plugin import build
from tractexp.errors import UserError
from tractexp.record import Reader
from tractexp.storage.files import PACKAGE

Samples = Mapping[str, Sequence[Mapping[str, Any]]]


def says_what_it_is(cls: type[Reader], samples: Samples) -> None:
    """The docstring says which format it reads, by which standard, and what it does not read."""
    for needed in ("Source:", "Departures:"):
        assert needed in (cls.__doc__ or ""), (
            f"the docstring of '{cls.name}' has no line '{needed}'"
        )


def refuses_what_is_missing_in_a_sentence(cls: type[Reader], samples: Samples) -> None:
    """Without settings, and with files that are not there, it raises `UserError`."""
    for settings in ({}, *(_without_files(sample) for sample in samples.get(cls.name, ()))):
        try:
            build("data", {"name": cls.name, **settings}).read()
        except UserError as error:
            said = str(error)
        else:
            said = "a reader that reads without any file" if not settings else ""
        assert " " in said, (
            f"'{cls.name}' reads files that do not exist, or refuses them without a sentence:"
            f" {settings}"
        )


def reads_its_samples_into_checked_records(cls: type[Reader], samples: Samples) -> None:
    """Each sample gives records to fit that pass their own check."""
    for settings in samples.get(cls.name, ()):
        events = build("data", {"name": cls.name, **settings}).read()
        assert len(events.train) > 0, f"'{cls.name}' reads nothing to fit from {settings}"
        for event in (*events.train, *events.validate):
            getattr(event, "record", event).check()


def _without_files(value: Any) -> Any:
    """The settings with every file renamed to one that is not there."""
    if isinstance(value, Mapping):
        return {key: _without_files(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_without_files(inner) for inner in value]
    there = isinstance(value, str) and (value.startswith(PACKAGE) or Path(value).is_file())
    return f"{value}.missing" if there else value


CHECKS: tuple[Callable[..., None], ...] = (
    says_what_it_is,
    refuses_what_is_missing_in_a_sentence,
    reads_its_samples_into_checked_records,
)
SUITE = (Reader, (), CHECKS)
