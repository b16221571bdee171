"""Whether one end of a record is louder than the other, `is_louder`."""

import numpy as np
import uncertainty as study

from tractexp.noise.quiet import is_louder


def test_a_quiet_start_of_a_record_tells_the_noise_of_one_whose_end_is_louder():
    rng = np.random.default_rng(1)
    calm, same, loud = 0.001 * rng.standard_normal((3, 200))
    assert not is_louder([same], [calm])
    assert is_louder([2 * loud], [calm])
    # colored alike: few samples tell, and ends may differ by chance
    slow = study.noise(rng, 4000, 0.001, 0.95)
    wrong = [
        is_louder([row[a : a + 200]], [row[a + 400 : a + 600]])
        for row in slow
        for a in range(0, 3200, 200)
    ]
    assert np.mean(wrong) < 0.1
