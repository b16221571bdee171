"""Write an identified load for another simulator."""

from pathlib import Path

from tractexp.errors import UserError
from tractexp.plugin import plugin
from tractexp.tasks.console import say
from tractexp.tasks.task import Job, Task, call


@plugin
class Export(Task):
    """Turn `result.json` of an identification into a file of the format chosen; nothing is written where it cannot."""

    reads = ()
    instead = {"model": "the model is that of task.parameters"}

    # path of a result.json; of parameters that a model has, a task has none
    parameters: str | None = None  # pyright: ignore[reportIncompatibleVariableOverride]
    format: str = ""  # andes, psse_dyr, modelica, or a format of an installed package
    bus: int = 1  # number of the bus the load is on
    power: float | None = None  # MVA, what 1 pu of the record's file stands for; null: what the record says, else 100
    voltage: float | None = None  # kV, line to line; null: what the record says, else 110
    base: str = "own"  # own: values on the base of the fit; file: on that of the record's file

    def run(self, job: Job) -> None:
        from tractexp.api.export import export
        from tractexp.api.identify import Identification
        from tractexp.identification.result import load

        if self.parameters is None:
            raise UserError("task.parameters is not given; it is the path of a result.json, which task=identify writes")
        fit = Identification(load(Path(self.parameters)))
        asked = {key: getattr(self, key) for key in ("bus", "power", "voltage", "base")}
        made = call(export, fit, self.format, **asked)
        path = made.write(job.folder / f"load{made.suffix}")
        say(f"model: {made.title}, from {self.parameters}")
        if fit.grade and not fit.adequate:
            say(f"  mind: {fit.headline}")
        for note in made.notes:
            say(f"note: {note}")
        say(f"  {path}")
