"""Parameters to be moved by hand: P and Q are calculated in the browser as they move, by the
equations of the fit.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.blocks import Report
from tractexp.blocks.block import Markup
from tractexp.blocks.packing import pack_numbers
from tractexp.cache import store
from tractexp.errors import UserError
from tractexp.kernel.layout import PHASOR_INPUTS
from tractexp.storage import files
from tractexp.text import quoting
from tractexp.text.wording import finish_sentence

if TYPE_CHECKING:
    from tractexp.api.identification import Identification

MOST_PAGE_STEPS = 20_000  # Runge-Kutta steps of the event: a browser takes some ten milliseconds


def add_sliders(page: Report, fit: "Identification") -> None:
    """Sliders of the free parameters over the first event; a sentence where there can be none."""
    try:
        program, content = _write_program(fit), _collect(fit)
    except UserError as error:
        page.text(finish_sentence(str(error)))
        return
    page.text(
        "Move a parameter: P and Q of the first event are calculated anew, in this page, by the"
        " equations that were fitted."
    )
    script = files.read_packaged_text("report/sliders.js")
    page.add(
        Markup(
            f'<div class="sliders"><canvas></canvas><p class="lead"></p><div></div></div>\n'
            f"<script>(() => {{\n{program}\nconst content={quoting.script(content)};\n{script}"
            "})();</script>"
        )
    )


def _write_program(fit: "Identification") -> str:
    """The kernel in JavaScript, from the store or written."""
    model = fit.spec.problem.model
    if model.measurements or fit.spec.problem.drive.windows or fit.result.per_event:
        raise UserError(
            "there are no sliders: what is compared is more than the equations' own power, or a"
            " parameter has a value of its own in each event"
        )

    def write() -> bytes:
        from tractexp.kernel.javascript import write_program
        from tractexp.model.lowering import lower

        return write_program(lower(model.equations), model.integration).encode()

    key = store.compute_key("sliders", files.read_packaged_text("kernel/simulate.js"), model.source)
    return store.TEXTS.get(key, write).decode()


def _collect(fit: "Identification") -> dict[str, Any]:
    """The data of the first event and of the estimates that the page needs."""
    problem, own = fit.spec.problem, fit.result.base
    drive, part, substeps = problem.drive, problem.drive.part(0), int(problem.step.substeps[0])
    if (part.stop - part.start) * substeps > MOST_PAGE_STEPS:
        raise UserError("there are no sliders: the record is too long to be calculated in a page")
    rows = dict(zip(PHASOR_INPUTS, np.nan_to_num(drive.inputs[:, part]), strict=True))
    record = problem.events[0].record
    estimates = {e.name: e for e in fit.parameters.values()}
    names = [*problem.model.names]
    free = [name for name in names if name in problem.space.names]
    return {
        "name": record.name,
        "names": free,
        "places": [names.index(name) for name in free],
        "units": [estimates[name].unit for name in free],
        "bounds": [list(estimates[name].bounds) for name in free],
        "given": [estimates[name].value for name in names] + drive.before[0].tolist(),
        "event": np.nan_to_num(drive.event[0]).tolist(),
        "samples": len(record.t),
        "inputs": {name: _pack(row) for name, row in rows.items() if name != "t"},
        "first": float(record.t[0]),
        "measured": [pack_numbers(getattr(record, c), "f4") for c in "PQ"],
        "substeps": substeps,
        "scale": own.power if own.in_mva else None,
    }


def _pack(row: np.ndarray) -> dict[str, str] | float:
    """A row of the inputs; one number where it stands still."""
    return float(row[0]) if np.all(row == row[0]) else pack_numbers(row, "f4")
