"""A load as plain JSON, for programs that have no format of their own here."""

import json

from tractexp.extend import plugin
from tractexp.extend.formats import Format, Restored

VERSION = 1  # of the keys below: what is added keeps it, what is changed raises it


@plugin
class LoadJson(Format):
    """Every number of the load in one JSON object, by keys that name their units.

    `schema` is "tractexp load" and `version` counts its changes. `base` says what one per unit is;
    `before` what load, motor and static load draw before the dip; `model` its parts by name and
    `parameters` their values on that base, each with unit, 95 % interval and verdict, null where
    there is none. `circuit` is the motor's T-circuit with H and slip, null without one. `grade` and
    `error` say how good the model is, of the response; `records` what it was fitted to.

    Not to be confused with the JSON of `andes`, nor with result.json, which is on the base of the
    fit.

    Source: ours, docs/export.md and docs/load.schema.json. Departures: none.
    """

    suffix = ".json"

    def text(self, load):
        result = load.result
        content = {
            "schema": "tractexp load",
            "version": VERSION,
            "name": load.name,
            "base": {
                "power_MVA": load.power,
                "voltage_kV": load.voltage,
                "frequency_Hz": result.before["frequency"],
            },
            "before": _powers(load),
            "model": {
                "motor": result.model["motor"]["name"],
                "static": result.model["static"]["name"],
                "effects": [effect.name for effect in load.model.effects],
            },
            "parameters": {p.name: _parameter(load, p) for p in load.model.parameters},
            "circuit": _circuit(load),
            "grade": result.adequacy.get("grade") or None,
            "error": _errors(result.model_error),
            "records": [dict(record.get("source", {})) for record in result.records],
            "made_by": f"tractexp {result.tractexp_version}".strip(),
        }
        return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"

    def read_back(self, text, load):
        content = json.loads(text)
        model = content["model"]
        parts = {
            "motor": {"name": model["motor"]},
            "static": {"name": model["static"]},
            "effects": model["effects"],
        }
        values = {name: entry["value"] for name, entry in content["parameters"].items()}
        static = content["before"]["static"] or {"P_MW": 0.0, "Q_Mvar": 0.0}
        power = content["base"]["power_MVA"]
        return Restored(parts, values, (static["P_MW"] / power, static["Q_Mvar"] / power))


def _powers(load):
    """The powers that load, motor and static load draw before the dip; null for a part that is not
    there.
    """
    before, stored = load.steady_state, load.result.before
    rows = {"load": (load.ratio * stored["P0"], load.ratio * stored["Q0"])}
    for part in ("motor", "static"):
        if f"P_{part}" in before:
            rows[part] = (before[f"P_{part}"], before[f"Q_{part}"])
    drawn = {
        part: {"P_MW": load.power * P, "Q_Mvar": load.power * Q} for part, (P, Q) in rows.items()
    }
    return {"U_kV": stored["U0"] * load.voltage, "motor": None, "static": None, **drawn}


def _parameter(load, parameter):
    """A value on the base of the export, with what is known of it."""
    name, result = parameter.name, load.result
    factor = load.ratio**parameter.power_exponent
    interval = result.intervals.get(name)
    return {
        "value": load.values[name],
        "unit": parameter.unit,
        "interval_95": interval and [factor * end for end in interval],
        "verdict": result.verdicts.get(name),
        "about": parameter.about,
    }


def _circuit(load):
    """The motor's T-circuit [pu], inertia and slip; null where it is no single machine."""
    if not {"T_prime", "X_prime", "C", "M"} <= load.values.keys():
        return None
    elements = {name: value for name, value in vars(load.circuit).items() if name != "omega_n"}
    slip = -load.steady_state.get("omega_before", 0.0) / load.omega_n
    return {**elements, "H_s": load.inertia, "slip": slip}


def _errors(error):
    """The model's error on the events fitted and held out, shares of the response."""
    held_out = error.get("held_out") or {}
    return {"fitted": error.get("value"), "held_out": held_out.get("value")}
