"""The units of an SEL event report's columns, and by what their values are multiplied."""

import numpy as np

from tractexp.filetypes.cev_text import EventReport, find_marked_row
from tractexp.filetypes.comtrade_fields import parse_number
from tractexp.filetypes.remarks import Remarks

ROOT = float(np.sqrt(2))
LARGEST_SUMMARY_DIFFERENCE = 0.1  # of a current: so well the summary's agrees with the columns
CURRENTS = ("IA", "IB", "IC", "IA(A)", "IB(A)", "IC(A)")  # as the summary names them


def find_usual_unit(name: str, is_wave: bool, remarks: Remarks) -> str:
    """The unit of a column that names none; "" where it is not known."""
    if is_wave and name[0] == "V":
        remarks.add(f"no unit of {name}, kV taken")
        return "kV"
    if is_wave and name[0] == "I":
        return "A"
    if name == "FREQ":
        return "Hz"
    return "V" if name.startswith(("VDC", "VBAT")) else ""


def read_ratio(report: EventReport, name: str, remarks: Remarks) -> float:
    """One, unless the summary says that the values are secondary ones (SEL-751)."""
    if report.about.get("PRIM_VAL", "YES").upper() != "NO":
        return 1.0
    column = ("CTR" if name[0] == "I" else "PTR") + "_" + name
    keys = (column, column[:-1] + "A", column[:3])
    ratio = next((r for key in keys if (r := parse_number(report.about.get(key, "")))), None)
    if ratio is None or ratio <= 0:
        remarks.add(
            f"secondary values (PRIM_VAL is NO), but no ratio {column} for {name}: they stay"
            " secondary"
        )
        return 1.0
    return ratio


def find_gain(
    report: EventReport, values: np.ndarray, marks: list[str], per_cycle: float, remarks: Remarks
) -> float:
    """The root of two, unless the summary's currents, RMS, show that the columns hold instantaneous
    values.
    """
    remarks.add(
        "columns are taken as instantaneous values over the root of two, as SEL's manuals say"
    )
    quarter = round(per_cycle / 4)
    row = find_marked_row(marks, "*>")
    if row is None or row < quarter or 4 * quarter != per_cycle:
        return ROOT
    ratio = _compare_with_summary(report, np.hypot(values[row], values[row - quarter]))
    if ratio is None:
        return ROOT
    if abs(ratio / ROOT - 1) < LARGEST_SUMMARY_DIFFERENCE:
        remarks.add(
            "but their greatest current, by the summary, says that they are not divided; taken as"
            " they are"
        )
        return 1.0
    if abs(ratio - 1) > LARGEST_SUMMARY_DIFFERENCE:
        remarks.add(
            f"the summary's greatest current is {1 / ratio:.2f} times that of the columns: check"
            " the scale"
        )
    return ROOT


def _compare_with_summary(report: EventReport, sizes: np.ndarray) -> float | None:
    """The size of the greatest current over what the summary gives of it, by the `sizes` of the
    columns; None where there is none.
    """
    ratios = []
    for column, here in zip(report.columns, sizes.tolist(), strict=False):
        rms = parse_number(report.about.get(column, "")) if column in CURRENTS else None
        if rms and here > 0:
            ratios.append((rms, here / rms))
    return max(ratios)[1] if ratios else None
