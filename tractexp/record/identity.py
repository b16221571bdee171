"""Which load a record is of: where it was read, which channels, when, and what one per unit stands
for.

One object for everyone who says it: console, pages, `result.json`, MLflow, exports.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from tractexp.cache.provenance import hash_record
from tractexp.record.record import Base, Record

UNKNOWN = "kV and MVA of one per unit unknown"
DIP = re.compile(r" dip \d+$")  # behind the path of a file that holds several


@dataclass(frozen=True)
class Identity:
    """`source` are texts by their keys, as far as the file says: file, station, device, load,
    voltages, currents, time.

    `base` says what one per unit is, `given_base` what it is in the file, None where that is the
    same: voltage_kV, power_MVA, frequency_Hz and origin each, None where nobody said it. `sha256`
    is of the channels as they were read.
    """

    source: Mapping[str, str]
    base: Mapping[str, Any]
    given_base: Mapping[str, Any] | None = None
    sha256: str = field(default="", compare=False)

    @classmethod
    def from_record(cls, record: Record) -> "Identity":
        """The identity of a record, with the sum of its bytes."""
        in_mva = record.file_base.in_mva
        given = (
            None if record.original_base is None else _describe_sizes(record.original_base, in_mva)
        )
        source = {"file": record.source, **record.identity}
        return cls(source, _describe_sizes(record.base, in_mva), given, hash_record(record))

    @classmethod
    def from_content(cls, content: Mapping[str, Any]) -> "Identity":
        """The identity that an entry of `records` in `result.json` tells; an early one lacks parts
        of it.
        """
        source = content.get("source", {})
        base = content.get("base", {})
        return cls(source, base, content.get("given_base"), content.get("sha256", ""))

    def to_dict(self) -> dict[str, Any]:
        """The identity as an entry of `records` in `result.json`."""
        content = {"sha256": self.sha256, "source": dict(self.source), "base": dict(self.base)}
        return content | ({} if self.given_base is None else {"given_base": dict(self.given_base)})

    @property
    def station(self) -> str:
        """The station's name; "" where the file has none."""
        return self.source.get("station", "")

    @property
    def label(self) -> str:
        """Station and load, short; "" where the file names neither."""
        return ", ".join(filter(None, (self.station, self.source.get("load", ""))))

    @property
    def dip(self) -> str:
        """Which dip of its file; "" where the file holds one."""
        match = DIP.search(self.source.get("file", ""))
        return match[0].strip() if match else ""

    @property
    def voltage(self) -> float | None:
        """kV, line to line, that one per unit is."""
        return self.base.get("voltage_kV")

    @property
    def power(self) -> float | None:
        """MVA that one per unit is."""
        return self.base.get("power_MVA")

    @property
    def recording(self) -> "Identity":
        """The identity of the recording that a dip was cut from, alike for all its dips."""
        return Identity(
            dict(self.source) | {"file": DIP.sub("", self.source.get("file", ""))}, self.base
        )

    @property
    def parts(self) -> list[str]:
        """The origin and the bases of the record, as far as they are known, each in words."""
        said = [
            text if key == "file" else f"{key} {text}" for key, text in self.source.items() if text
        ]
        for base, name in ((self.base, "per unit of"), (self.given_base or {}, "in the file of")):
            sizes = [
                f"{base[size]:.6g} {size.partition('_')[2]}"
                for size in ("voltage_kV", "power_MVA")
                if base.get(size)
            ]
            if sizes:
                said.append(f"{name} {' and '.join(sizes)}")
        return said

    @property
    def unknown(self) -> list[str]:
        """The sentence that nobody said what one per unit is; [] where somebody did."""
        return [UNKNOWN] if self.parts and not (self.voltage or self.power) else []

    def __str__(self) -> str:
        """All that is known of the record, and what is not, in one line."""
        return "; ".join([*self.parts, *self.unknown])


def list_distinct(identities: Iterable[Identity]) -> list[Identity]:
    """The recordings that records are from, each once, in their order."""
    recordings: list[Identity] = []
    for one in identities:
        if one.recording not in recordings:
            recordings.append(one.recording)
    return recordings


def describe_identities(identities: Iterable[Identity]) -> list[str]:
    """The recordings in words, each once; what is unknown of several is said once, with those it
    concerns.
    """
    recordings = list_distinct(identities)
    unknown = [one for one in recordings if one.unknown]
    if len(unknown) < 2:
        return [*map(str, recordings)]
    concerned = "each" if unknown == recordings else ", ".join(one.parts[0] for one in unknown)
    return [*("; ".join(one.parts) for one in recordings), f"{UNKNOWN} of {concerned}"]


def label(identities: Iterable[Identity]) -> str:
    """Stations and loads, each once; "" where no file names any."""
    return " and ".join(dict.fromkeys(filter(None, (one.label for one in identities))))


def compose_title(identities: Iterable[Identity], names: Iterable[str]) -> str:
    """The title of a page: station and load, where these are known, and the records' own names."""
    return ": ".join(filter(None, (label(identities), ", ".join(names))))


def compose_title_of_records(records: Iterable[Record]) -> str:
    """The title of a page about records at hand, as `title` makes it."""
    records = list(records)
    return compose_title(map(Identity.from_record, records), (record.name for record in records))


def _describe_sizes(base: Base, in_mva: bool) -> dict[str, Any]:
    """The base for `result.json`: kV and MVA where they are known, else None."""
    voltage = None if base.voltage == 1.0 else base.voltage
    power = base.power if in_mva else None
    return {
        "voltage_kV": voltage,
        "power_MVA": power,
        "frequency_Hz": base.frequency,
        "origin": base.origin,
    }
