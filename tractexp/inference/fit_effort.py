"""How hard the best fit of a set of effects is searched for.

None of these numbers decides what is named; that is `criteria`. They decide how surely the minimum
of a set is found, and what that costs. They were chosen on development data sets, not calibrated:
where a fit came out worse than one that was known to exist, the search was widened.
"""

import numpy as np

# Descents: iterations, and the fall of the deviance below which one ends. 1 is one squared standard
# deviation, so that an exact descent errs by a fiftieth of what a parameter costs by Akaike's
# criterion, a rough one by a seventh.
ROUGH_DESCENT = (12, 0.3)
EXACT_DESCENT = (40, 0.02)
# Descents that take their steps in the same calls: few enough for several cores to have some each.
FITS_AT_ONCE = 4
# Iterations after which the worse half of a set's starts is given up.
FIRST_ITERATIONS = 4

# Ranking, in deviances. A rough refit this near the best is made exact: six parameters by Akaike's
# criterion.
NEAR_BEST = 12.0
# A set that is farther behind after a rough refit is not refined, unless all sets span more: then
# by that share of it.
FAR_BEHIND, FAR_SHARE = 60.0, 0.3
# A set that comes out worse than its own subset by more has not converged: five times what an exact
# descent leaves.
NESTED_TOLERANCE = 0.1

# Moves of parameters without a slope, such as a relay's level and times: from a coarse grid a
# descent ended at a deviance of 7901 where 6206 was to be had. Halves of the range down to a 500th
# of it reach every sample of a record.
MOVE_REACHES = 2.0 ** -np.arange(1, 10)
# Such moves in a row, and the deviance that one must gain: half of what a parameter costs.
MOST_MOVES, LEAST_GAIN = 8, 1.0
# Turns of moving and descending, the starts that take part, and by how much these differ in some
# coordinate.
MOST_TURNS, STARTS_IN_TURNS, DISTINCT = 3, 6, 0.01
# Starts of a set that a descent is begun from, the most promising by one simulation each: on nine
# development sets the best fit was the same to 0.1 of the deviance with 40 % fewer simulations.
MOST_STARTS = 8

# Points around a fit with all times of its relays moved at once, how far to either side in ranges,
# and how often: two stages may each be at their best beside the other with the other's times (6115
# where 5843 was to be had).
SCATTER_POINTS, SCATTER_REACH, SCATTER_ROUNDS = 24, 0.5, 3

# Points of the base model's box at each of which a single effect is simulated as it was fitted, and
# the best of them, so far apart in ranges, that it is descended from: where it is missing, the base
# model's best fit may lie in a wrong local minimum.
BOX_POINTS, BOX_STARTS, BOX_APART = 1024, 8, 0.5

# Noise and fit in turn at one set, as long as the fit leaves less than this share of its noise,
# which then is that of a worse fit: a relay whose return had been missed was louder by twenty.
NOISE_ROUNDS, QUIETER = 3, 0.5
