"""Everything a plugin imports, in one place; docs/plugins.md tells what each is for.

from tractexp.extend import Effect, Parameter, plugin, sites
"""

from tractexp.errors import Unfit, UserError, check_choice, check_range
from tractexp.identification.loss import Loss
from tractexp.identification.optimizer import Iterative, Optimizer
from tractexp.kernel.layout import EVENT, INPUTS
from tractexp.kernel.stencil import Stencil
from tractexp.model import sites
from tractexp.model.parts import Curve, Effect, Measurement, Motor, Static
from tractexp.parameter import Parameter
from tractexp.plugin import build, plugin
from tractexp.record import Base, Events, Reader, Record
from tractexp.recording import Channel, Connection, Estimator, Recording, Segment, Writer
from tractexp.recording.reader import WaveformReader

__all__ = [
    "EVENT",
    "INPUTS",
    "Base",
    "Channel",
    "Connection",
    "Curve",
    "Effect",
    "Estimator",
    "Events",
    "Iterative",
    "Loss",
    "Measurement",
    "Motor",
    "Optimizer",
    "Parameter",
    "Reader",
    "Record",
    "Recording",
    "Segment",
    "Static",
    "Stencil",
    "Unfit",
    "UserError",
    "WaveformReader",
    "Writer",
    "build",
    "check_choice",
    "check_range",
    "plugin",
    "sites",
]
