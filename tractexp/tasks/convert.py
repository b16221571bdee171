"""Write a record or a recording in another format."""

from tractexp.plugin import build, plugin
from tractexp.tasks.console import say
from tractexp.tasks.task import Job, Task


@plugin
class Convert(Task):
    """Write what was read as Parquet, CSV or COMTRADE: the whole recording, or the record of each dip."""

    reads = ("data",)
    instead = {"model": "a conversion has no model"}

    to: str = "parquet"  # parquet, csv (with a sidecar in JSON), comtrade (.cfg and .dat), cff
    what: str | None = None  # recording or events; null: the recording, where the file holds waveforms

    def run(self, job: Job) -> None:
        from tractexp.api.convert import converted

        made = converted(build("data", job.config["data"]), self.to, self.what, job.folder)
        for sentence in made.said:
            say(sentence)
        for path in made.files:
            say(f"  {path}")
