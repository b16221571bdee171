"""When chance is drawn with the noise as known, `is_noise_exact`."""

from types import SimpleNamespace

import pytest

from tractexp.inference.chance import is_noise_exact


@pytest.mark.parametrize(
    ("worth", "from_model", "is_exact"),
    [(160, False, True), (140, False, False), (140, True, True)],
)
def test_quiet_stretches_worth_150_samples_tell_the_noise_exactly(worth, from_model, is_exact):
    context = SimpleNamespace(
        problem=SimpleNamespace(quiet=()), domain=SimpleNamespace(noise_from_model=from_model)
    )
    noise = SimpleNamespace(worth=lambda samples: worth)
    assert is_noise_exact(context, noise) == is_exact
