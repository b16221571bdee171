"""Before the recording: which dips tell what, how deep one must be, and which events of an archive to fit."""

from dataclasses import field
from typing import TYPE_CHECKING, Any

from tractexp.errors import check_range
from tractexp.plugin import plugin
from tractexp.tasks.console import listed, say, table
from tractexp.tasks.task import Job, Task, call

if TYPE_CHECKING:
    from tractexp.report.plan import Planned

ASKED = ("parameter", "within", "depth", "duration", "rate", "noise", "jump", "unbalance", "values", "least", "events")


@plugin
class Plan(Task):
    """Forecast the intervals that a recording would give, without fitting it: plan.html and plan.json.

    The dip is that of the deepest record in `data`, or as set here. The parameters and the noise are those of the
    estimate that identify makes of it, or the model's defaults, or those of an earlier result.json.
    """

    reads = ("data", "model")

    parameter: str = "H"  # how deep a dip is needed for this one (H stands for M)
    within: float = 0.05  # half of the 95 % interval, as a share of the value
    depth: float | None = None  # of the voltage before; null: as recorded
    duration: float | None = None  # s
    rate: float | None = None  # Hz
    noise: float | None = None  # standard deviation, as a share of P before the event; white
    jump: float | None = None  # degrees, of the voltage's phase; in waveforms
    unbalance: float | None = None  # negative sequence over the depth, 1 of a fault between two phases; in waveforms
    values: str = "fit"  # fit, default, or the path of a result.json
    least: float = 0.05  # another event of the archive must narrow the intervals by this share
    events: int | None = None  # at most so many
    rivals: Any = field(default_factory=list)  # [a, b+c], or a discrepancy.json: what to record to tell these apart

    def check(self) -> None:
        check_range("task.within", self.within, 1e-6, 10.0)
        check_range("task.least", self.least, 0.0, 1.0)

    def run(self, job: Job) -> None:
        from tractexp.api.plan import Forecasts, plan

        if self.rivals:
            self._for_rivals(job)
            return
        asked = {key: getattr(self, key) for key in ASKED}
        made = call(plan, job.events.train, job.config["model"], **asked)
        assert isinstance(made, Forecasts)
        paths = made.write_results(job.folder)
        tell(made.planned)
        paths += made.write_drawings(job.folder)
        listed(paths)
        job.log(
            name=f"plan for {self.parameter}",
            values=dict(made.content["parameters"]),
            metrics={} if made.depth_needed is None else {"depth_needed": made.depth_needed},
            artifacts=[*paths, job.folder / ".hydra"],
        )

    def _for_rivals(self, job: Job) -> None:
        """What to record next to tell effects apart."""
        from tractexp.api.plan import Recommended, plan

        rivals = self.rivals if isinstance(self.rivals, str) else [*self.rivals]
        say_so = lambda line: say(f"  {line}")  # noqa: E731
        made = call(plan, job.events.train, job.config["model"], rivals=rivals, progress=say_so)
        assert isinstance(made, Recommended)
        paths = made.write_results(job.folder)
        shown = made.table()
        table(shown.columns, shown.rows, shown.title)
        say(f"next: {made.sentence}")
        paths += made.write_drawings(job.folder)
        listed(paths)
        job.log(
            name=f"plan to tell {len(made.rivals)} explanations apart",
            values={},
            metrics={"probability": made.probability},
            artifacts=[*paths, job.folder / ".hydra"],
        )


def tell(planned: "Planned") -> None:
    """Print the plan, its answer and the best events."""
    from tractexp.report.plan import percent, rest

    values = zip(planned.problem.space.names, planned.values, strict=True)
    say(planned.dip)
    say(f"parameters, {planned.origin}: {', '.join(f'{name} {value:.4g}' for name, value in values)}")
    for label, (grid, forecasts) in planned.scans.items():
        picked = range(0, len(grid), max(1, len(grid) // 6))
        rows = [[f"{grid[k]:.4g}", *(percent(r) for r in forecasts[k].relative)] for k in picked]
        columns = [label.partition(",")[0].partition(" ")[0], *forecasts[0].names]
        table(columns, rows, f"half of the 95 % interval, % of the value, by {label}")
    say(f"how deep? {planned.needed}")
    for k, choice in enumerate(planned.chosen, start=1):
        narrower = f", intervals narrower by {choice.gain:.0%}" if k > 1 else ""
        say(f"event {k} of the best: {choice.name}{narrower}")
    if left_out := rest(planned):
        say(left_out)
