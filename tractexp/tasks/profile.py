"""Profile likelihood of every parameter: intervals that need no parabola."""

from tractexp.errors import check_range
from tractexp.plugin import plugin
from tractexp.tasks.console import listed, say, table
from tractexp.tasks.identify import report, track
from tractexp.tasks.task import Job, Task, call


@plugin
class Profile(Task):
    """Identify, then find the best fit for each value of each parameter in turn: profile.html and profile.json."""

    points: int = 24  # at most so many on either side of the optimum

    def check(self) -> None:
        check_range("task.points", self.points, 3, 1000)

    def run(self, job: Job) -> None:
        from tractexp.api.profile import profile

        fit = job.identified(say)
        profiled = call(profile, fit, points=self.points)
        paths = profiled.write_results(job.folder)
        report(fit)
        shown = profiled.table()
        table(shown.columns, shown.rows)
        for sentence in (*shown.said[1:], *(f"note: {note}" for note in profiled.made.notes)):  # beyond the grade
            say(f"  {sentence}")
        content = profiled.content
        say(f"{len(shown.rows)} profiles: {content['simulations']} simulations in {content['seconds']:.2f} s")
        say()
        paths += profiled.write_drawings(job.folder)
        listed(paths)
        track(job, profiled.identification, paths, predictor=False)
