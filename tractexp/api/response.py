"""The power a load draws in one event, calculated and, where it was recorded, measured."""

import io
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tractexp.record import Event, OwnBase
from tractexp.storage import files
from tractexp.text.wording import format_epsilon

if TYPE_CHECKING:
    import pandas

    from tractexp.identification.fit import Fit
    from tractexp.model.model import Model


@dataclass(frozen=True, eq=False, repr=False)
class Response:
    """Voltage and calculated power, (N,) each, in pu of the file; where recorded `measured` P and
    Q, `epsilon` (20).
    """

    title: str
    t: np.ndarray  # s
    U: np.ndarray
    P: np.ndarray
    Q: np.ndarray
    measured: tuple[np.ndarray, np.ndarray] | None = None
    epsilon: tuple[float, float] | None = None  # of P and Q, fractions
    notes: tuple[str, ...] = ()
    # of waveforms: t [s] and each phase's [pu]
    currents: Mapping[str, np.ndarray] = field(default_factory=dict)
    epsilon_i: float | None = None
    # half the bands in which P and Q [pu] stay in 95 % of events, where the model promises some
    band: tuple[float, float] | None = None

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """The columns of response.csv, (N,) each, by name."""
        columns = {"t": self.t, "U": self.U, "P": self.P, "Q": self.Q}
        return columns | (
            {"P_measured": self.measured[0], "Q_measured": self.measured[1]}
            if self.measured
            else {}
        )

    @property
    def row(self) -> list[str]:
        """Title, lowest U, lowest and highest P and Q, and both errors, as a table shows them."""
        errors = [*map(format_epsilon, self.epsilon)] if self.epsilon else ["", ""]
        errors += [] if self.epsilon_i is None else [format_epsilon(self.epsilon_i)]
        ends = self.U.min(), self.P.min(), self.P.max(), self.Q.min(), self.Q.max()
        return [self.title, *(f"{v:.4f}" for v in ends), *errors]

    def __repr__(self) -> str:
        """The event's name, and its errors where it was measured."""
        errors = (
            ", epsilon_p {}, epsilon_q {}".format(*map(format_epsilon, self.epsilon))
            if self.epsilon
            else ""
        )
        errors += "" if self.epsilon_i is None else f", epsilon_i {format_epsilon(self.epsilon_i)}"
        band = (
            ""
            if self.band is None
            else ", P within {:.3g} and Q within {:.3g} pu".format(*self.band)
        )
        return f"{self.title}: t, U, P, Q of {len(self.t)} samples{errors}{band}"

    def _repr_html_(self) -> str:
        """Measured and calculated power, drawn."""
        with tempfile.TemporaryDirectory() as folder:
            drawn = files.read_text(self.draw(Path(folder) / "response.svg"))
        return drawn[drawn.index("<svg") :]

    def to_frame(self) -> "pandas.DataFrame":
        """A pandas frame of the columns."""
        import pandas

        return pandas.DataFrame(self.columns)

    def write(self, stem: Path) -> list[Path]:
        """Write columns to `stem`.csv; of waveforms currents, too."""
        columns = [_write_csv(stem.with_suffix(".csv"), self.columns)]
        return columns + (
            [_write_csv(stem.with_name(f"{stem.name}_currents.csv"), self.currents)]
            if self.currents
            else []
        )

    def draw(self, path: Path) -> Path:
        """Draw the response, against the measurement where there is one."""
        from tractexp.report import figures

        columns = self.P, self.Q
        if self.measured and self.epsilon:
            return figures.fit(
                path,
                self.t,
                self.U,
                self.measured,
                columns,
                title=self.title,
                epsilon=self.epsilon,
                notes=self.notes,
            )
        return figures.draw_response(
            path, self.t, self.U, columns, title=self.title, notes=self.notes, band=self.band
        )


def _write_csv(path: Path, columns: Mapping[str, np.ndarray]) -> Path:
    """Write columns of numbers with their names."""
    text = io.StringIO()
    rows = np.column_stack(list(columns.values()))
    np.savetxt(text, rows, fmt="%.9g", delimiter=",", header=",".join(columns), comments="")
    return files.write(path, text.getvalue())


def respond_to(
    model: "Model", values: np.ndarray, event: Event, own: OwnBase | None = None
) -> Response:
    """A recorded event played through a model, power and currents on the base of the event's file.

    `own` is the base that the values are on, None that of the event. Raises `UserError` where it
    has no steady state there.
    """
    from tractexp.identification.fit import respond

    return build_response(
        respond(model, values, event if own is None else own.convert_event(event), "validate"),
        event,
        own,
    )


def build_response(fit: "Fit", event: Event, own: OwnBase | None = None) -> Response:
    """The calculated response to an event, from the base `own` to that of its file."""
    # of waveforms, as the estimator sees recorded and calculated currents
    record = fit.event.record
    ratio = OwnBase.from_record(record).ratio if own is not None else 1.0
    P, Q, *measured = (ratio * power for power in (fit.P, fit.Q, record.P, record.Q))
    errors, notes = (
        (fit.epsilon_p, fit.epsilon_q),
        tuple(event.record.notes if own is not None else record.notes),
    )
    return Response(
        record.name,
        record.t,
        record.U,
        P,
        Q,
        (measured[0], measured[1]),
        errors,
        notes,
        _extract_currents(fit, ratio),
        fit.epsilon_i,
    )


def _extract_currents(fit: "Fit", ratio: float) -> dict[str, np.ndarray]:
    """t [s] and the currents of each phase [pu of their peak], calculated and measured; none of
    phasors.
    """
    if fit.waves is None or fit.currents is None:
        return {}
    part, event = slice(fit.waves.lead, None), fit.waves
    columns = {"t": event.record.t[part]}
    for end, currents in (("", fit.currents), ("_measured", np.nan_to_num(event.currents))):
        names = [f"i_{n}{end}" for n in "abc"] if event.phases == 3 else [f"i{end}"]
        columns |= dict(zip(names, ratio * event.of_phases(currents)[:, part], strict=True))
    return columns
