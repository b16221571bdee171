"""Write an identified load for another simulator."""

from pathlib import Path

from tractexp.errors import UserError, check_range
from tractexp.plugin import build, plugin
from tractexp.tasks.console import say
from tractexp.tasks.task import Job, Task


@plugin
class Export(Task):
    """Turn `result.json` of an identification into a file of the format chosen; nothing is written where it cannot."""

    reads = ()
    instead = {"model": "the model is that of task.parameters"}

    parameters: str | None = None  # path of a result.json
    format: str = ""  # andes, psse_dyr, modelica, or a format of an installed package
    bus: int = 1  # number of the bus the load is on
    power: float = 100.0  # MVA, what 1 pu of the record stands for
    voltage: float = 110.0  # kV, line to line

    def check(self):
        check_range("task.bus", self.bus, low=1)
        check_range("task.power", self.power, low=1e-6)
        check_range("task.voltage", self.voltage, low=1e-6)

    def run(self, job: Job) -> None:
        from tractexp.exchange.format import Identified
        from tractexp.identification.result import load

        if self.parameters is None:
            raise UserError("task.parameters is not given; it is the path of a result.json, which task=identify writes")
        identified = Identified(load(Path(self.parameters)), self.bus, self.power, self.voltage)
        form = build("format", {"name": self.format})
        form.check_parts(identified)
        text = form.text(identified)
        path = job.folder / f"load{form.suffix}"
        path.write_text(text, encoding="utf-8")
        say(f"model: {identified.model.title}, from {self.parameters}")
        for note in form.notes(identified):
            say(f"note: {note}")
        say(f"  {path}")
