"""The nominal voltages of networks: whether a voltage is one between phases or to ground, by its
size alone.
"""

import numpy as np

# kV line to line (IEC 60038, EN 50163, China, North America), and 27.5 kV of traction substations
NOMINAL_VOLTAGES = (
    0.23,
    0.4,
    0.48,
    0.69,
    1.0,
    3.0,
    3.3,
    6.0,
    6.6,
    10.0,
    11.0,
    13.8,
    15.0,
    20.0,
    22.0,
    25.0,
    27.5,
    33.0,
    35.0,
    66.0,
    69.0,
    110.0,
    115.0,
    132.0,
    138.0,
    150.0,
    161.0,
    220.0,
    230.0,
    275.0,
    330.0,
    345.0,
    380.0,
    400.0,
    500.0,
    765.0,
)
SINGLE_PHASE = (15.0, 25.0, 27.5)  # kV of railways: no voltage between phases
LARGEST_NOMINAL_DISTANCE = 0.03  # of a nominal voltage: what is nearer has it
FAR = 0.08  # of every nominal voltage: what is farther has none


def measure_offset_from_nominal(voltage: float) -> float:
    """How far a line voltage [kV] is off the nearest nominal one, as a natural logarithm.

    Infinite of a voltage that is not positive.

    Examples
    --------
    >>> round(measure_offset_from_nominal(110.0), 6), measure_offset_from_nominal(0.0)
    (0.0, inf)
    """
    return (
        min(abs(float(np.log(voltage / each))) for each in NOMINAL_VOLTAGES)
        if voltage > 0
        else np.inf
    )


def is_between_phases(voltage: float) -> bool:
    """Whether a voltage [kV] is near a nominal one as it stands, and not so times sqrt 3."""
    return (
        measure_offset_from_nominal(voltage) < LARGEST_NOMINAL_DISTANCE
        and measure_offset_from_nominal(np.sqrt(3) * voltage) > FAR
    )


def is_to_ground(voltage: float) -> bool:
    """Whether a voltage [kV] is near no nominal one as it stands, and near one of three phases
    times sqrt 3.
    """
    line = float(np.sqrt(3)) * voltage
    nearest = min(NOMINAL_VOLTAGES, key=lambda each: abs(np.log(max(line, 1e-12) / each)))
    near = [
        measure_offset_from_nominal(each) < LARGEST_NOMINAL_DISTANCE for each in (voltage, line)
    ]
    return near == [False, True] and nearest not in SINGLE_PHASE
