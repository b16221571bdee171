"""Records from a folder of recordings: events by the names that a survey gives them."""

from dataclasses import field
from pathlib import Path

from tractexp.extend import DATA, Events, Reader, UserError, check_distinct, plugin
from tractexp.extend.files import records, survey_of


@plugin
class Archive(Reader):
    """Events of many files in a folder, whatever their formats, channels as they are proposed.

    An event is named FILE#LOAD.DIP: the file within the folder, the load and the dip as `tractexp
    look` numbers them, counted from 1. FILE#LOAD is the first event of a load that is worth
    fitting, FILE that of the first load. Each record has the base of its own file: voltage and
    apparent power before its first dip.

    Source: tractexp's own; the formats are those of the readers of the files.
    Departures: none.
    """

    folders = True

    path: str = ""  # the folder
    train: list[str] = field(default_factory=list)  # events to fit
    validate: list[str] = field(default_factory=list)  # events held out

    def check(self) -> None:
        if not self.path:
            raise UserError(
                f"{DATA.path} is missing: give the folder of the recordings, e.g."
                f" {DATA.path}=recordings"
            )

    def read(self) -> Events:
        if not self.train:
            raise UserError(
                f"{DATA.train} is empty: name events of {self.path} as FILE#LOAD.DIP; a survey"
                f" lists them: {survey_of(self.path)}"
            )
        check_distinct(f"{DATA.train} and {DATA.validate}", [*self.train, *self.validate])
        folder = Path(self.path)
        dips = records(folder, [*self.train, *self.validate], f"{DATA.train} and {DATA.validate}")
        return Events(dips[: len(self.train)], dips[len(self.train) :])
