"""`tractexp look FILE...`: what files hold, which loads they show, what happened, and the command that fits it."""

import argparse
import re
import time
from pathlib import Path
from typing import Any

from tractexp.errors import UserError
from tractexp.tasks.console import listed, say, table
from tractexp.wording import change, figure

FOLDER = Path("outputs", "looks")
DOES = "Look at files without saying which channels they have: loads, events, what is worth fitting, and the command."
SETTING = re.compile(r"(?:data\.)?([a-z_]+)=(.*)", re.DOTALL)


def look(arguments: list[str]) -> int:
    """Print and write a look at files; returns the exit code. Raises `UserError` for what cannot be read."""
    parser = argparse.ArgumentParser(prog="tractexp look", description=DOES)
    parser.add_argument("file", nargs="+", metavar="FILE", help="any file that can be read")
    parser.add_argument("--folder", type=Path, help=f"where the page is written; default: a new one in {FOLDER}")
    parser.epilog = "Settings of the reader are given as KEY=VALUE, such as 'voltages=[4,5,6]' or encoding=gbk."
    chosen = parser.parse_args(arguments)
    settings = [s for each in chosen.file if not Path(each).exists() and (s := SETTING.fullmatch(each))]
    paths = [each for each in chosen.file if Path(each).exists() or not SETTING.fullmatch(each)]
    if not paths:
        raise UserError("tractexp look: give a file beside the settings, e.g. tractexp look station.cfg")
    from tractexp.api.look import look as looked
    from tractexp.tasks.task import call

    made = call(looked, *paths, **{s[1]: _value(s[2]) for s in settings})
    tell(made.content)
    listed(made.write(chosen.folder or FOLDER / f"{Path(paths[0]).stem}_{time.strftime('%Y-%m-%d_%H-%M-%S')}"))
    return 0


def _value(text: str) -> Any:
    """A setting's value as YAML reads it; what YAML does not read is a text."""
    import yaml

    try:
        return yaml.safe_load(text)
    except yaml.YAMLError:
        return text


def tell(content: Any) -> None:
    """Print what files hold: channels, loads, events, commands."""
    for known in content["files"]:
        rates = ", ".join(f"{rate:g} Hz" for rate in dict.fromkeys(known["rates"]))
        measured = known["measured_frequency"]
        turning = "" if measured is None else f", {measured:.3f} Hz measured"
        said = [known["station"], known["device"], str(known["start"] or ""), f"{known['seconds']:.3f} s at {rates}",
                f"{known['frequency']:g} Hz nominal{turning}"]  # fmt: skip
        say(f"{known['file']}: {'; '.join(part for part in said if part)}")
        for note in known["notes"]:
            say(f"  note: {note}")
        if known["channels"]:
            rows = [
                [str(c["number"]), c["name"], c["phase"], c["unit"], figure(c["magnitude"], 4, c["primary_unit"]),
                 c["fit"]]
                for c in known["channels"]
            ]  # fmt: skip
            table(["channel", "name", "phase", "unit", "primary RMS", "fit for what"], rows)
        for feeder in known["feeders"]:
            _tell_load(feeder)
        if not known["feeders"]:
            say("  no voltages and currents of one load were recognised; name them: voltages=[...] currents=[...]")


def _tell_load(feeder: Any) -> None:
    numbers = ", ".join(map(str, (*feeder["voltages"], *feeder["currents"])))
    told = ", ".join(figure(feeder[k], 4, unit) for k, unit in zip("UPQ", feeder["units"], strict=True))
    channels = f" (channels {numbers}, {feeder['connection']})" if numbers else ""
    say(f"load {feeder['name']}{channels}: {told or 'nothing measured'}")
    for sentence in (*feeder["why"], *feeder["said"]):
        say(f"  {sentence}")
    if feeder["events"]:
        rows = [
            ["" if e["dip"] is None else str(e["dip"]), e["kind"], f"{e['start']:.3f}", f"{1000 * e['duration']:.0f}",
             f"{e['depth']:.1%}", figure(e["jump"], 2), "" if e["U2"] is None else f"{e['U2']:.1%}",
             *(change(e[f"{x}_before"], e[f"{x}_after"]) for x in "PQ"),
             "yes" if e["worth"] else "no"]
            for e in feeder["events"]
        ]  # fmt: skip
        _, P, Q = feeder["units"]
        table(["dip", "kind", "t [s]", "ms", "depth", "jump", "U2", f"P [{P}]", f"Q [{Q}]", "fit it?"], rows)
        for e in feeder["events"]:
            say(f"  {e['kind']} at {e['start']:.3f} s, {'worth fitting' if e['worth'] else 'not fitted'}: {e['why']}")
    else:
        say("  nothing happened: the voltage stays within the thresholds of IEC 61000-4-30")
    if feeder["command"]:
        say("  to fit it:")
        say(f"  {feeder['command']}")
