"""Profile likelihood of every parameter: intervals that need no parabola."""

import json
import time
from dataclasses import replace
from typing import Any

from tractexp.errors import check_range
from tractexp.plugin import plugin
from tractexp.tasks.console import say, table
from tractexp.tasks.identify import identified, report, track
from tractexp.tasks.task import Job, Task


@plugin
class Profile(Task):
    """Identify, then find the best fit for each value of each parameter in turn: profile.json and profiles.svg."""

    points: int = 24  # at most so many on either side of the optimum

    def check(self) -> None:
        check_range("task.points", self.points, 3, 1000)

    def run(self, job: Job) -> None:
        from tractexp.identification.profile import profiles
        from tractexp.identification.result import write_history
        from tractexp.report import uncertainty

        problem, found, result, _, known = identified(job)
        started = time.perf_counter()
        made = profiles(known, self.points)
        seconds = time.perf_counter() - started
        verdicts = {name: str(verdict) for name, verdict in made.verdicts.items()}
        intervals = {p.name: list(p.interval) for p in made.profiles}
        fields = made.known.fields(notes=made.notes) | {"verdicts": verdicts, "intervals": intervals}
        result = replace(result, **fields)

        report(problem, result)
        show(made, seconds)
        path = job.folder / "profile.json"
        path.write_text(json.dumps(content(made, seconds), indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
        paths = [uncertainty.profiles(job.folder / "profiles.svg", made), path]
        paths.append(write_history(job.folder / "history.csv", found.history))
        paths.append(result.write(job.folder / "result.json"))
        for path in paths:
            say(f"  {path}")
        track(job, found, result, paths, predictor=False)


def show(made: Any, seconds: float) -> None:
    """Print both intervals of each parameter and the verdict that the profile leaves."""
    rows = []
    for profile, value, half in zip(made.profiles, made.known.values, made.known.half, strict=True):
        (a, b), low, high = profile.interval, value - half, value + half
        rows.append([profile.name, f"{value:.4g}", f"{low:.4g} .. {high:.4g}", f"{a:.4g} .. {b:.4g}"])
    table(["parameter", "most likely", "by curvature", "by profile"], rows)
    for name, verdict in made.verdicts.items():
        say(f"  {name}: {verdict}")
    for note in made.notes:
        say(f"  note: {note}")
    say(f"{len(made.profiles)} profiles: {made.simulations} simulations in {seconds:.2f} s")
    say()


def content(made: Any, seconds: float) -> dict[str, Any]:
    """What `profile.json` holds."""
    return {
        "threshold": made.threshold,
        "simulations": made.simulations,
        "seconds": seconds,
        "restarts": made.restarts,
        "profiles": {
            p.name: {
                "values": p.values.tolist(),
                "deviance": p.deviance.tolist(),
                "interval": list(p.interval),
                "ends": [str(end) for end in p.ends],
                "minima": list(p.minima),
                "verdict": str(made.verdicts[p.name]),
            }
            for p in made.profiles
        },
    }
