"""Noise of recorded channels: how loud, of which color, how it wanders, and how residuals are
whitened.
"""

from tractexp.noise.color import Autoregression as Autoregression
from tractexp.noise.color import white_noise as white_noise
from tractexp.noise.model import Noise as Noise
