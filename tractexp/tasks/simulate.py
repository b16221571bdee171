"""Play a voltage through a load model with given parameters."""

from dataclasses import field
from pathlib import Path

from tractexp.plugin import plugin
from tractexp.tasks.console import listed, say, table
from tractexp.tasks.task import LOAD, Job, Task, call

DIP = ("depth", "duration", "fall", "recovery", "start", "length", "rate", "U0", "P0", "Q0")


@plugin
class Simulate(Task):
    """Simulate recorded events, or the dip that `depth`, `duration` ... describe.

    The parameters are those of a `result.json`, with its model, or `values` for the model chosen; values also replace
    single parameters of the result.
    """

    reads = ("data", *LOAD)
    instead = {
        "model": "with task.parameters the model is that of the result",
        "data": "with task.depth no record is played",
    }

    # path of a result.json; of parameters that a model has, a task has none
    parameters: str | None = None  # pyright: ignore[reportIncompatibleVariableOverride]
    values: dict[str, float] = field(default_factory=dict)  # {name: value}
    depth: float | None = None  # pu of the voltage before; null: play the recorded data
    duration: float = 0.15  # s, from the start of the fall to the start of the recovery
    fall: float = 0.02  # s
    recovery: float = 0.05  # s
    start: float = 0.5  # s
    length: float = 3.0  # s
    rate: float = 1000.0  # samples per second
    U0: float | None = None  # pu, voltage before the dip; null: the result's, or 1
    P0: float | None = None  # pu, power before the dip; null: the result's, or 1
    Q0: float | None = None  # pu; null: the result's, or 0.5

    def needless(self) -> tuple[str, ...]:
        return (*(LOAD if self.parameters else ()), *(("data",) if self.depth is not None else ()))

    def run(self, job: Job) -> None:
        from tractexp.api.identify import Identification
        from tractexp.api.simulate import simulate
        from tractexp.identification.result import load

        model = Identification(load(Path(self.parameters))) if self.parameters else job.config["model"]
        events = job.events if self.depth is None else None
        records = [*events.train, *events.validate] if events else ()
        dip = {key: getattr(self, key) for key in DIP}
        made = call(simulate, model, self.values, records=records, **dip)
        paths = made.write_results(job.folder)
        load_model, shown = made.model.model, made.table()
        say(f"model: {load_model.title}")
        rows = [[p.name, f"{made.values[p.name]:.6g}", p.unit] for p in load_model.parameters]
        table(["parameter", "value", "unit"], rows)
        table(shown.columns, shown.rows)
        paths += made.write_drawings(job.folder)
        listed(paths)
        metrics = {
            f"event_{k}_epsilon_{c}": error
            for k, one in enumerate(made.responses, start=1)
            for c, error in zip("pq", one.epsilon or (), strict=False)
        }
        metrics |= {
            f"event_{k}_epsilon_i": one.epsilon_i
            for k, one in enumerate(made.responses, start=1)
            if one.epsilon_i is not None
        }
        job.log(name="simulation", values=made.values, metrics=metrics, artifacts=[*paths, job.folder / ".hydra"])
