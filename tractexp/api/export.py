"""Write an identified load for another simulator."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from tractexp.api.arguments import public
from tractexp.api.identification import Identification
from tractexp.api.job import Job
from tractexp.api.task import Task
from tractexp.blocks import Report, Table
from tractexp.blocks.terminal import show
from tractexp.configuration.plugin import build, plugin
from tractexp.configuration.run_command import build_again_command
from tractexp.errors import TASK, UserError, check_choice, check_range
from tractexp.identification.adequacy import Grade
from tractexp.identification.result import load
from tractexp.outcome import Outcome
from tractexp.record.identity import describe_identities
from tractexp.storage import files
from tractexp.text.progress import build_console, find_text_width

if TYPE_CHECKING:
    from tractexp.exchange.format import Identified

MACHINE, OWN, FILE = BASES = ("machine", "own", "file")
NAMES = {
    MACHINE: "the motor's own rating: its apparent power before the dip",
    OWN: "the record's own base",
    FILE: "the base of the record's file",
}
POWER, VOLTAGE = 100.0, 110.0  # MVA and kV, where nobody said what one per unit is


@dataclass(frozen=True, eq=False, repr=False)
class Exported(Outcome):
    """An identified load in another simulator's format; `text` is the file, `write(path)` writes
    it.
    """

    kind = "export"

    format: str
    suffix: str
    title: str
    text: str
    notes: tuple[str, ...]
    # how far the file, played back, is off the fit, over what its power moves; None where nothing
    # plays it back
    agreement: float | None = None

    def write(self, path: Path | str) -> Path:
        """Write the file, whole or not at all."""
        return files.write(path, self.text)

    def table(self) -> Table:
        """The notes."""
        return Table(["note"], [[note] for note in self.notes], f"{self.title}, as {self.format}")

    def summary(self) -> Report:
        """The notes, then the file's text."""
        report = Report(f"{self.title}, as {self.format}").text(
            *(f"note: {note}" for note in self.notes), ""
        )
        return report.text(*self.text.splitlines())


@public
def export(
    fit: Identification,
    format: str,
    *,
    bus: int = 1,  # number of the bus the load is on
    # MVA, what 1 pu of the record's file stands for; null: what the record says, else 100
    power: float | None = None,
    voltage: float | None = None,  # kV, line to line; null: what the record says, else 110
    # machine: values on the motor's own rating; own: on the base of the fit; file: on that of the
    # record's file
    base: str = MACHINE,
    # export also a model that does not describe the load, or is no physical one
    doubtful: bool = False,
    playback: bool = True,  # play a dip through the file, in its simulator where that is installed
) -> Exported:
    """Turn an identification into the file of another simulator's format.

    Parameters
    ----------
    fit : Identification
        Made by `tractexp.identify`, or loaded.
    format : name
        "andes", "psse_dyr", "modelica", ... or the name of a plugin.
    bus : int
        Number of the bus the load is on.
    power : float [MVA]
        What 1 pu of the record's file stands for; None: what the record says, else 100.
    voltage : float [kV, line to line]
        The same of the voltage; None: what the record says, else 110.
    base : "machine", "own" or "file"
        Whether values are on the motor's own rating, its apparent power before the dip (of a load
        without a motor: as "own"), on the base of the fit, or on that of the record's file.
    doubtful : bool
        Whether a model is exported that does not describe the load, or is no physical one.
    playback : bool
        Whether a dip is played through the file (in ANDES where that is installed, else by our own
        simulator from the file's numbers); the notes say how well it follows the fit.

    Returns
    -------
    Exported
        `text` of the file, `notes` on what it leaves out, and `agreement` of the playback, a share
        of the power; `write(path)`.

    Raises
    ------
    UserError
        Where the format cannot represent a part of the model, and unless `doubtful` for a model
        that does not describe the load it was fitted to, or is no physical load.
    """
    from tractexp.exchange.format import Identified
    from tractexp.exchange.playback import play_back_export

    check_range("task.bus", bus, 1)
    check_range("task.power", power, 1e-6)
    check_range("task.voltage", voltage, 1e-6)
    check_choice("task.base", base, BASES)
    against = _list_objections(fit)
    if against and not doubtful:
        raise UserError(f"{'; '.join(against)}; {TASK.doubtful}=true exports it all the same")
    own, recorded = (
        fit.result.base,
        fit.result.records[0].get("base", {}) if fit.result.records else {},
    )
    file_power = power or (own.file_power if own.in_mva else POWER)
    ratio = _choose_ratio(fit, base)
    identified = Identified(
        fit.result,
        bus,
        file_power * own.ratio / ratio,
        voltage or recorded.get("voltage_kV") or VOLTAGE,
        ratio,
    )
    form = build("format", {"name": format})
    form.check_parts(identified)
    text = form.text(identified)
    notes = [
        *against,
        *filter(None, describe_identities(fit.result.identities)),
        _describe_base(identified, base, own.ratio, guessed=power is None and not own.in_mva),
        _describe_powers(identified),
        *form.notes(identified),
    ]
    agreement, more = play_back_export(form, text, identified) if playback else (None, [])
    if agreement is not None:
        more.append(agreement.describe_differences(identified.power, ("MW", "Mvar")))
    share = None if agreement is None else agreement.share
    return Exported(format, form.suffix, identified.model.title, text, (*notes, *more), share)


def _choose_ratio(fit: Identification, base: str) -> float:
    """How many per units of the export's base one of the fit's is."""
    from tractexp.exchange.rating import compute_rating

    if base == FILE:
        return fit.result.base.ratio
    if base == OWN or fit.operating_point is None:
        return 1.0
    return 1 / compute_rating(fit.result)


def _list_objections(fit: Identification) -> list[str]:
    """Why this model should not be handed on, a sentence each: by its grade, and as a physical
    load.
    """
    against = []
    if fit.grade == Grade.WRONG_MODEL:
        sentence = fit.result.adequacy["sentence"]
        against.append(
            f"{sentence}; find what it lacks by {build_again_command('task=discrepancy')}, or"
            " choose another model"
        )
    if fit.doubts:
        against.append(f"this model is no physical load: {' and '.join(fit.doubts)}")
    return against


def _describe_powers(load: "Identified") -> str:
    """The powers that the load and its parts draw before the dip, in a sentence."""
    before, scale = load.steady_state, load.power
    rows = {"load": (load.ratio * load.result.before["P0"], load.ratio * load.result.before["Q0"])}
    rows |= {
        part: (before[f"P_{part}"], before[f"Q_{part}"])
        for part in ("motor", "static")
        if f"P_{part}" in before
    }
    said = [f"{part} {scale * P:.5g} MW and {scale * Q:.5g} Mvar" for part, (P, Q) in rows.items()]
    return f"before the dip, at {load.result.before['U0'] * load.voltage:.5g} kV: {'; '.join(said)}"


def _describe_base(load: "Identified", base: str, ratio: float, guessed: bool) -> str:
    """On which base the values of an export are, in a sentence."""
    which = "" if ratio == 1 else f", {NAMES[FILE if base == FILE else OWN]}"
    if base == MACHINE and load.ratio != 1:
        which = f", {NAMES[MACHINE]}"
    said = f"per unit of {load.power:.6g} MVA and {load.voltage:.6g} kV{which}"
    if guessed:
        return f"{said}; 1 pu of the file is taken for {POWER:g} MVA, for no power is given"
    return said


@plugin
class Export(Task, call=export, given=("fit",)):
    """Turn `result.json` of an identification into a file of the format chosen; nothing is written
    where it cannot.
    """

    instead = {"model": "the model is that of task.parameters"}

    # path of a result.json, or of its run's folder; of parameters that a model has, a task has none
    parameters: str | None = None  # pyright: ignore[reportIncompatibleVariableOverride]
    format: str = ""  # andes, psse_dyr, modelica, or a format of an installed package

    def run(self, job: Job) -> None:
        """Write the file of the run that `task.parameters` names into this run's folder."""
        if self.parameters is None:
            raise UserError(
                f"{TASK.parameters} is not given; it is the path of a result.json, or the folder of"
                " the run that wrote it"
            )
        fit = Identification(load(Path(self.parameters)))
        exported = self.perform(job, fit=fit)
        path = exported.write(job.folder / f"load{exported.suffix}")
        told = Report().text(f"file: {path}", f"model: {exported.title}, from {self.parameters}")
        if fit.grade and not fit.adequate:
            told.items([f"mind: {fit.headline}"])
        told.text(*(f"note: {note}" for note in exported.notes))
        if not fit.adequate:
            told.text(*(f"next: {sentence}" for sentence in fit.advice[:1]))
        show(told, build_console(), find_text_width())
