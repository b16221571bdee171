"""One load of a station in a worker process: its dips read, fitted together and told as plain
data.
"""

import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from tractexp.api.compose import LoadModel, Portable
from tractexp.api.identification import Identification
from tractexp.api.read import record_from_dict, record_to_dict
from tractexp.errors import UserError
from tractexp.identification.composition import (
    Composition,
    estimate_composition,
    find_terms,
    shrink,
)
from tractexp.identification.forecast import TOLD_DEPTH, Forecast, tell_of_dip
from tractexp.identification.station import (
    LoadSpec,
    Predicted,
    SharedFit,
    StationDip,
    find_band,
    find_later,
    fit_dips,
    predict_in_turn,
)
from tractexp.identification.station_constants import Constants, judge_constants
from tractexp.identification.station_result import build_result
from tractexp.inference.interval import INTERVAL_LEVEL, compute_interval_factor
from tractexp.inference.model_error import compute_model_error
from tractexp.process.workers import Workers
from tractexp.record import Event, OwnBase, Record, detect
from tractexp.record.thinning import thin_record
from tractexp.recording import archive
from tractexp.storage import files, time_limit

KEPT_BEFORE, KEPT_AFTER = 0.6, 1.5  # s of a record before its dip and after it
KEPT_RATE = 400.0  # Hz, of phasors: years of dips are kept in memory
MOST_RACED = 4  # dips on which structures are raced
MOST_CURVES = 6  # dips that are drawn: the last ones that were predicted

Read = dict[str, Any]  # {"record": plain data} or {"why": sentence}


@dataclass(frozen=True, eq=False)
class LoadJob(Portable):
    """The dips of one load for a worker, as (event, time or None, record); `keys` tell these dips
    from others.
    """

    load: str
    station: str
    dips: Sequence[tuple[str, str | None, Record]]
    model: LoadModel
    keys: Sequence[str]


def read_dips(folder: str, wanted: tuple[str, Sequence[str]]) -> list[Read]:
    """The records of one file's events, `wanted` being the file and their names; nothing that
    happens in here is an error.
    """
    file, names = wanted
    try:
        with time_limit.limit_time(Path(folder, file)):
            records = archive.records(Path(folder), list(names), "data.path")
        return [{"record": record_to_dict(_cut_out(record))} for record in records]
    except UserError as error:
        return [{"why": str(error)} for _ in names]


def _cut_out(record: Record) -> Record:
    """The record about its dip, as few samples as show it."""
    event = detect(record)
    record, rate = event.record, event.record.rate
    first = max(0, event.start - round(KEPT_BEFORE * rate))
    stop = min(record.samples, event.end + round(KEPT_AFTER * rate))
    every = max(1, round(rate / KEPT_RATE))
    return thin_record(record, every).part(slice(first // every, -(-stop // every)))


def read_files(
    folder: Path, wanted: Mapping[str, Sequence[str]], workers: Workers
) -> Iterator[tuple[str, list[Read]]]:
    """(file, what was read of it) as they are done; {file: names of events} are wanted."""
    reading = functools.partial(read_dips, str(folder))
    killed = "the program was killed at this file, as where the memory is too small for it"
    for (file, names), read in workers.results(reading, list(wanted.items())):
        yield file, read or [{"why": killed} for _ in names]


def restore_dips(read: Sequence[Read]) -> list[dict[str, Any]]:
    """What was read of a file with its records as such: arrays take a quarter of the memory of
    plain data.
    """
    return [{"record": record_from_dict(one["record"])} if "record" in one else one for one in read]


def fit_load(job: LoadJob) -> dict[str, Any]:
    """The fit of all dips of a load as plain data; else why they tell nothing."""
    told = {"load": job.load, "station": job.station}
    try:
        return told | files.make_plain(_fit(job))
    except UserError as error:
        return told | {"why": str(error)}


def _fit(job: LoadJob) -> dict[str, Any]:
    read = [(name, _build_dip(when, record)) for name, when, record in job.dips]
    read.sort(key=lambda one: (one[1].when or datetime.min, one[0]))
    names = [name for name, _ in read]
    dips = [dip for _, dip in read]
    telling = sorted(dips, key=lambda dip: -dip.promise)[:MOST_RACED]
    load = job.model.fit_for([dip.event for dip in telling])
    spec = LoadSpec(job.load, load.model, load.bounds, load.fixed, load.substeps)
    fit = fit_dips(spec, dips)
    constants = judge_constants(spec, fit)
    composition = fit.estimate_composition()
    predicted = predict_in_turn(spec, dips, fit.odd)
    share = _tell_share(fit, composition)
    next_dip = _forecast(fit, composition, predicted)
    ahead = find_later(predicted, fit.odd)
    result = build_result(
        spec,
        fit,
        constants,
        share["value"],
        next_dip,
        load.node,
        ahead,
    )
    identified = Identification(result)
    return {
        "usability": identified.usability,
        "reason": identified.usability_reason,
        "dips": len(dips),
        "model": load.node,
        "race": [*load.race],
        "constants": _tell_constants(load, constants, fit),
        "share": share,
        "composition": _tell_terms(fit, composition),
        "power": _tell_power(dips, fit),
        "events": [*_tell_events(names, fit, composition, predicted)],
        "odd": [{"event": names[k], "why": why} for k, why in sorted(fit.odd.items())],
        "error": compute_model_error([fit.fits[k] for k in fit.regular]).to_dict(),
        "predicted": _tell_predicted(predicted, fit),
        "next_dip": next_dip,
        "result": result.to_dict(),
        "curves": [*_draw(names, predicted, fit)],
    }


def _build_dip(when: str | None, record: Record) -> StationDip:
    """A dip per unit of what its load drew before it."""
    event = detect(record)
    own = OwnBase.from_event(event)
    moment = datetime.fromisoformat(when) if when else None
    return StationDip(own.convert_event(event), moment)


def _tell_constants(load: LoadModel, constants: Constants, fit: SharedFit) -> list[dict[str, Any]]:
    """A row for each constant, and those that follow from them; on the base of what the motors draw
    themselves.
    """
    information, rows = constants.information, []
    known = {p.name: p for p in load.model.parameters}
    frequency = 2 * np.pi * fit.dips[0].event.record.base.frequency
    for name, value, (low, high) in zip(
        information.names,
        information.values.tolist(),
        constants.intervals.tolist(),
        strict=True,
    ):
        spread = constants.spreads.get(name)
        row = {"value": value, "low": low, "high": high, "spread": spread}
        rows.append({"name": name, "unit": known[name].unit, **row})
        if name == "M":
            half = frequency / 2
            as_H = {key: half * row[key] for key in ("value", "low", "high")} | {"spread": spread}
            rows.append({"name": "H", "unit": "s", **as_H})
    return rows


def _tell_share(fit: SharedFit, composition: Composition) -> dict[str, Any]:
    """The motors' part of P in the mean, its interval, and how far single dips are from what is
    expected.
    """
    kept = fit.regular
    (mean,), (error,) = composition.predict([None])
    if composition.start is not None:
        times = [fit.dips[k].when for k in kept]
        values, errors = composition.predict(times)
        mean, error = float(values.mean()), float(errors.min())
    half = compute_interval_factor() * float(error)
    return {
        "value": float(mean),
        "low": float(mean) - half,
        "high": float(mean) + half,
        "spread": composition.spread,
    }


def _tell_terms(fit: SharedFit, composition: Composition) -> dict[str, Any]:
    """The terms that the shares show, and each that can be told as a table."""
    kept = fit.regular
    times = [fit.dips[k].when for k in kept]
    shown = find_terms(fit.shares[kept], fit.share_errors[kept], times)
    return {"varies": shown, "terms": {term: composition.tabulate(term) for term in shown}}


def _tell_power(dips: Sequence[StationDip], fit: SharedFit) -> dict[str, Any]:
    """P before the dips [MW, or pu of the file], and by the terms that it shows."""
    kept = fit.regular
    P = np.array([_measure_power(dips[k].event) for k in kept])
    times, nothing = [dips[k].when for k in kept], np.zeros(len(kept))
    composition, shown = estimate_composition(P, nothing, times), find_terms(P, nothing, times)
    return {
        "unit": "MW" if dips[0].event.record.file_base.in_mva else "pu",
        "mean": float(P.mean()),
        "low": float(P.min()),
        "high": float(P.max()),
        "varies": shown,
        "terms": {term: composition.tabulate(term) for term in shown},
    }


def _measure_power(event: Event) -> float:
    own = OwnBase.from_record(event.record)
    return event.P0 * (own.power if own.in_mva else own.ratio)


def _tell_events(
    names: Sequence[str],
    fit: SharedFit,
    composition: Composition,
    predicted: Sequence[Predicted],
) -> Iterator[dict[str, Any]]:
    """A row for each dip: its share, drawn towards what is expected of it, and the model's error
    where it is fitted and as those before predicted it.
    """
    expected, _ = composition.predict([dip.when for dip in fit.dips])
    shares, errors = shrink(fit.shares, fit.share_errors, expected, composition.spread)
    half = compute_interval_factor() * errors
    by_position = {one.position: one for one in predicted}
    for k, (name, dip) in enumerate(zip(names, fit.dips, strict=True)):
        before = by_position.get(k)
        own = OwnBase.from_record(dip.event.record)
        yield {
            "event": name,
            "when": dip.when and dip.when.isoformat(),
            "depth": dip.event.depth,
            "P": _measure_power(dip.event),
            "Q": dip.event.Q0 * (own.power if own.in_mva else own.ratio),
            "share": shares[k],
            "low": shares[k] - half[k],
            "high": shares[k] + half[k],
            "by_itself": fit.shares[k],
            "error": compute_model_error([fit.fits[k]]).value,
            "predicted": None if before is None else before.error,
            "expected": None if before is None else before.share,
            "known": 0 if before is None else before.known,
            "odd": fit.odd.get(k, ""),
        }


def _tell_predicted(predicted: Sequence[Predicted], fit: SharedFit) -> dict[str, Any]:
    """How well dips were predicted by those before them: the median error of the first half and of
    the last, odd ones apart.
    """
    errors = [one.error for one in predicted if one.position not in fit.odd]
    half = len(errors) // 2
    first, last = errors[:half], errors[half:]
    return {
        "dips": len(errors),
        "first_half": float(np.median(first)) if first else None,
        "last_half": float(np.median(last)) if last else None,
    }


def _forecast(
    fit: SharedFit, composition: Composition, predicted: Sequence[Predicted]
) -> dict[str, Any]:
    """The band for the next dip of 40 %, by what was missed of those that were predicted; {} where
    there are none.
    """
    band = find_band(predicted, fit.odd)
    if band is None:
        return {}
    last = fit.dips[fit.regular[-1]]
    (share,), _ = composition.predict([last.when])
    values = fit.spell_parameters(float(share) * last.event.P0)
    forecast = Forecast(values, np.zeros((1, len(values))), band)
    duration = float(np.mean([dip.event.duration for dip in fit.dips]))
    half, sentence = tell_of_dip(fit.problem.model, last.event, forecast, duration)
    return {
        "depth": TOLD_DEPTH,
        "duration": duration,
        "P": half and half[0],
        "Q": half and half[1],
        "level": INTERVAL_LEVEL,
        "events": band.events,
        "noise": [*band.noise],
        "share": [*band.share],
        "scatter": {},
        "sentence": sentence,
    }


def _draw(
    names: Sequence[str], predicted: Sequence[Predicted], fit: SharedFit
) -> Iterator[dict[str, Any]]:
    """The last dips that were predicted: U, P and Q [pu of S before] as recorded and as
    predicted.
    """
    drawn = [one for one in predicted if np.isfinite(one.error) and one.position not in fit.odd]
    for one in drawn[-MOST_CURVES:]:
        assert one.fit is not None
        record = one.fit.event.record
        yield {
            "event": names[one.position],
            "error": one.error,
            "t": record.t - one.fit.event.t_start,
            "U": record.U,
            "P": record.P,
            "Q": record.Q,
            "P_predicted": one.fit.P,
            "Q_predicted": one.fit.Q,
        }
