"""Where the base model disagrees with the records, and the noise by which that is judged."""

from tractexp.blocks import Report
from tractexp.discrepancy.findings import Findings
from tractexp.inference.chance import BLURRED, format_drawn_p
from tractexp.text.wording import format_probability


def add_places(page: Report, findings: Findings) -> None:
    """Whether and where the base model disagrees with the records."""
    first = findings.first
    page.heading("Is there a disagreement, and where?")
    text = (
        "What the base model leaves would come about by chance with a probability of"
        f" {format_drawn_p(first.p_left)}"
    )
    text += (
        "." if first.adequate else f"; the most surprised of the tests looks for {first.loudest}."
    )
    if first.scores:
        best, alpha = first.scores[0], findings.context.criteria.naming_false_alarms
        text += (
            f" The effect that promises most in one linear step, {best.name}, would lower the"
            f" deviance by {best.drop:.1f}, with a probability of"
            f" {format_probability(best.p)} by chance; chance gives less than"
            f" {format_probability(first.chance.critical_p(alpha))} to the best of all"
            f" candidates in {alpha:.0%} of cases."
        )
    page.text(text)
    if not findings.places:
        page.text("No interval holds more energy than chance leaves there.")
        return
    page.table(
        ["event", "channel", "from [s]", "to [s]", "share of the excess"],
        [
            [p.event, p.channel, f"{p.start:.3f}", f"{p.end:.3f}", f"{p.share:.0%}"]
            for p in findings.places
        ],
        "Intervals in which the base model leaves more than chance does, at a family-wise error of"
        f" {findings.context.criteria.false_alarms:.0%}; shaded in the charts.",
        words=(1,),
    )


def add_noise(page: Report, findings: Findings) -> None:
    """Add what is known of the noise, and where that comes from."""
    context, fit = findings.context, findings.last
    quiet = fit.noise.loudest_input_mode <= BLURRED
    about = context.domain.about_noise(findings.catalogue.of_measurement, quiet)
    page.heading("Noise").text(f"{context.describe(fit.noise)}. {about}")
    if fit.robust is not None:
        page.text(
            "What is left is louder, so all is told by least squares, without faults of the"
            " measurement and at the powers measured before the events."
        )
    if (window := context.records.window) is not None:
        page.text(
            f"{window.describe().capitalize()}, of voltage and current alike: any other window"
            " would make the voltage bend where the power does not. The voltage that the load saw"
            " is reckoned back from the record, and the current of the model is averaged as the"
            " recorder does."
        )
