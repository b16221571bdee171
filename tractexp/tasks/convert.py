"""Write a record or a recording in another format."""

from tractexp.plugin import build, plugin
from tractexp.tasks.console import say
from tractexp.tasks.task import Job, Task


@plugin
class Convert(Task):
    """Write what was read as Parquet, CSV or COMTRADE: the whole recording, or the record of each dip."""

    reads = ("data",)
    instead = {"model": "a conversion has no model"}

    to: str = ""  # parquet (where none is named), csv (both with a sidecar in JSON), comtrade (.cfg and .dat), cff
    what: str | None = None  # recording or events; null: the recording, where the file holds waveforms

    def run(self, job: Job) -> None:
        from tractexp.api.convert import parts_of, writer_of, written

        writer = writer_of(self.to)
        made = written(parts_of(build("data", job.config["data"]), writer, self.what), writer, job.folder)
        for sentence in made.said:
            say(sentence)
        for path in made.files:
            say(f"  {path}")
