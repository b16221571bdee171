"""The page of a linear network: how good a model without physics is, and the poles of the load."""

from typing import TYPE_CHECKING

from tractexp.blocks import Report, Table
from tractexp.configuration.run_command import get_command
from tractexp.inference.model_error import format_percent
from tractexp.record.identity import compose_title_of_records
from tractexp.report.fit_tables import build_error_table
from tractexp.report.fitted_curves import chart_all_events
from tractexp.text.wording import finish_sentence

if TYPE_CHECKING:
    from tractexp.api.linear_network import NetworkFit

WAVES = "frequency: in the phases, negative where the vector turns backwards"
PHASORS = "frequency: of P and Q"
POLES = (
    "admittance: what the pole adds at first and what dies out, per unit of the record's base. {}."
)


def tabulate_poles(fit: "NetworkFit") -> Table:
    """Each pole, the slowest first."""
    rows = [
        [
            k,
            f"{p['decay']:.4g}",
            f"{1000 / p['decay']:.4g}",
            f"{p['frequency']:.4g}",
            f"{p['admittance']:.4g}",
        ]
        for k, p in enumerate(fit.poles, start=1)
    ]
    columns = ["pole", "decay [1/s]", "forgotten in [ms]", "frequency [Hz]", "admittance [pu]"]
    return Table(
        columns, rows, "linear network", POLES.format(WAVES if fit.domain == "waves" else PHASORS)
    )


def tabulate_numbers(fit: "NetworkFit") -> Table:
    """The errors that networks of fewer and of more poles leave."""
    keys = ["model_error", "held_out"] if fit.validate else ["model_error"]
    rows = [
        [row["poles"], *(format_percent(row[key]) for key in keys)]
        for row in fit.content["by_poles"]
    ]
    chosen = f"The number of poles is chosen by {fit.content['chosen_by']}."
    return Table(["poles", "model error, fitted", "held out"][: 1 + len(keys)], rows, "", chosen)


def tabulate_network_errors(fit: "NetworkFit") -> Table:
    """The errors of the network on each event."""
    keys = [key for key in fit.content["events"][0] if key.startswith("epsilon_")]
    return build_error_table(fit.content["events"], fit.content["model_error"]["events"], keys)


def build_summary(fit: "NetworkFit") -> Report:
    """How much it leaves, its poles, and what other numbers of poles leave."""
    return (
        Report()
        .text(finish_sentence(fit.headline))
        .add(tabulate_poles(fit))
        .add(tabulate_network_errors(fit))
        .add(tabulate_numbers(fit))
    )


def report(fit: "NetworkFit") -> Report:
    """The page: what the summary says, and the curves."""
    page = Report(
        f"Linear network of {compose_title_of_records(event.record for event in fit.train)}",
        "A model without physics: the yardstick of every other.",
    )
    page.verdict(finish_sentence(fit.headline))
    page.heading("Measured and calculated")
    chart_all_events(page, fit.fits)
    page.heading("How well it fits").add(tabulate_network_errors(fit)).add(tabulate_numbers(fit))
    page.heading("Poles").add(tabulate_poles(fit))
    page.heading("How this page was made")
    origin = [
        ["tractexp", fit.content["tractexp_version"]],
        *([["command", get_command()]] if get_command() else []),
    ]
    return page.table(["", ""], origin, words=(1,))
