"""Profile likelihood of every parameter: intervals that need no parabola."""

import functools
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tractexp.api.arguments import public
from tractexp.api.identification import Identification
from tractexp.api.job import Job
from tractexp.api.task import Task
from tractexp.blocks import Report, Table
from tractexp.configuration.plugin import plugin
from tractexp.configuration.run_command import suggest_run
from tractexp.errors import check_range
from tractexp.identification.result import Result
from tractexp.identification.verdict import IDENTIFIED, shorten_verdict
from tractexp.outcome import Written
from tractexp.storage import files
from tractexp.text.progress import Progress, make_counter

if TYPE_CHECKING:
    from tractexp.identification.profile import Profiles


@dataclass(frozen=True, eq=False, repr=False)
class Profiled(Written):
    """Profiles of the free parameters of an identification. `content` is that of `profile.json`."""

    kind = "profile"
    page = "profile.html"

    fit: Identification
    points: int
    content: Mapping[str, Any]
    result: Result  # of the identification, with the intervals and verdicts that the profiles give
    # the intervals by curvature, about where the profiles start
    curvature: Mapping[str, tuple[float, float]]
    behind: "Profiles | None" = None  # None where it was loaded

    @functools.cached_property
    def curves(self) -> "Profiles":
        """The profiles behind the page; of a loaded result they are computed again."""
        from tractexp.identification.profile import profile_parameters

        return self.behind or profile_parameters(self.fit.details.uncertainty, self.points)

    @property
    def identification(self) -> Identification:
        """The identification with the intervals and verdicts that the profiles give."""
        return replace(self.fit, result=self.result)

    @property
    def profiles(self) -> Mapping[str, Mapping[str, Any]]:
        """By name: `values` and the `deviance` there (n,), `interval` (95 %), `ends`, `minima` and
        `verdict`.
        """
        return self.content["profiles"]

    def table(self) -> Table:
        """The intervals by curvature and by profile, side by side."""
        span = "{:.4g} .. {:.4g}".format
        likely = self.result.free
        rows = [
            [name, f"{likely[name]:.4g}", span(*self.curvature[name]), span(*p["interval"])]
            for name, p in self.profiles.items()
        ]
        return Table(
            ["parameter", "most likely", "by curvature", "by profile"], rows, "95 % intervals"
        )

    def summary(self) -> Report:
        """The identification, the intervals and the verdicts."""
        c, notes = self.content, self.content["notes"]
        effort = (
            f"{len(self.profiles)} profiles: {c['simulations']} simulations in {c['seconds']:.2f} s"
        )
        verdicts = [f"{name}: {p['verdict']}" for name, p in self.profiles.items()]
        report = (
            self.fit.summary()
            .add(self.table())
            .items([*verdicts, *(f"note: {note}" for note in notes)])
        )
        return report.text(effort)

    def screen(self) -> Report:
        """The load, and each interval by curvature and by profile with what it says, in a word."""
        from tractexp.report.screen import describe_judged_load, name_verdict

        told = describe_judged_load(self.identification)
        rows = [[*row, name_verdict(self.profiles[row[0]]["verdict"])] for row in self.table().rows]
        table = Table([*self.table().columns, "known"], rows, words=(4,))
        return told.add(table).text(*(f"note: {note}" for note in self.content["notes"]))

    @property
    def next_step(self) -> str:
        """The next step of the identification; of a model that leaves noise alone, the command that
        plans which dip would tell a parameter that is not identified.
        """
        poor = [
            n for n, one in self.profiles.items() if shorten_verdict(one["verdict"]) != IDENTIFIED
        ]
        if self.fit.adequate and poor:
            planned = suggest_run("task=plan", f"task.parameter={poor[0]}")
            return f"which dip would tell {poor[0]}: {planned}"
        return next(iter(self.identification.next_steps), "")

    def report(self) -> Report:
        """The page: a curve for each parameter."""
        from tractexp.report import profile

        return profile.report(self.curves, self.fit.headline)

    def write_results(self, folder: Path) -> list[Path]:
        """Write `profile.json`, and what an identification writes with these intervals."""
        path = files.write_json(folder / "profile.json", self.content)
        return [path, *self.identification.write_results(folder)]


@public
def profile(
    fit: Identification,
    *,
    points: int = 24,  # at most so many on either side of the optimum
    progress: Progress = None,
) -> Profiled:
    """Find the best fit for each value of each free parameter of an identification in turn.

    Parameters
    ----------
    fit : Identification
        Made by `tractexp.identify`, or loaded from what it saved.
    points : int, 3 to 1000
        How many values are tried on either side of the optimum at most.
    progress : None, False or callable
        None shows how far it is, False does not.

    Returns
    -------
    Profiled
        `profiles` {name: {`values` in the parameter's unit, `deviance`, `interval`, ...}}, with the
        intervals of these profiles and those by curvature side by side in `table()`.

    Raises
    ------
    UserError
        For an identification of which only a `result.json` is known.
    """
    from tractexp.identification.profile import profile_parameters

    check_range("task.points", points, 3, 1000)
    uncertainty = fit.details.uncertainty
    started = time.perf_counter()
    scan = profile_parameters(
        uncertainty, points, parts=make_counter("points at most on the profiles", progress)
    )
    content = _build_content(scan, time.perf_counter() - started)
    verdicts = {name: str(verdict) for name, verdict in scan.verdicts.items()}
    intervals = {p.name: list(p.interval) for p in scan.profiles}
    fields = scan.uncertainty.fields() | {"verdicts": verdicts, "intervals": intervals}
    fields["uncertainty"]["notes"] += scan.notes
    ends = zip(scan.uncertainty.names, scan.uncertainty.values, scan.uncertainty.half, strict=True)
    curvature = {name: (float(value - half), float(value + half)) for name, value, half in ends}
    return Profiled(fit, points, content, replace(fit.result, **fields), curvature, scan)


def _build_content(scan: "Profiles", seconds: float) -> dict[str, Any]:
    """The content of `profile.json`."""
    return files.make_plain(
        {
            "threshold": scan.threshold,
            "simulations": scan.simulations,
            "seconds": seconds,
            "restarts": scan.restarts,
            "notes": scan.notes,
            "profiles": {
                p.name: {
                    "values": p.values,
                    "deviance": p.deviance,
                    "interval": p.interval,
                    "ends": [str(end) for end in p.ends],
                    "minima": p.minima,
                    "verdict": str(scan.verdicts[p.name]),
                }
                for p in scan.profiles
            },
        }
    )


@plugin
class Profile(Task, call=profile):
    """Identify, then find the best fit for each value of each parameter in turn: profile.html and
    profile.json.
    """

    def collect_log(self, job: Job, result: Profiled) -> dict[str, Any]:
        """The fields that an identification logs, with these intervals."""
        from tractexp.api.logged import build_logged_fit

        return build_logged_fit(job, result.identification)
