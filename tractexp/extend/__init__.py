"""What a plugin imports; docs/plugins.md says what each name is for.

    from tractexp.extend import Effect, Parameter, plugin, sites

`tractexp.extend.search` has parts for optimizers, `tractexp.extend.files` for readers and writers,
`tractexp.extend.formats` the base of exports, `tractexp.extend.symbols` the types of what
`declare`, `law` and `edit` take and return.
"""

from tractexp.configuration.plugin import build, plugin
from tractexp.errors import DATA, TASK, Unfit, UserError, check_choice, check_distinct, check_range
from tractexp.identification.optimizer import REFUSED, Box, Evaluate, Iterative, Optimizer
from tractexp.inference.loss import Loss
from tractexp.kernel.layout import EVENT, INPUTS
from tractexp.kernel.stencil import Stencil
from tractexp.model import sites
from tractexp.model.parts import Curve, Effect, Measurement, Motor, Static
from tractexp.parameter import Parameter
from tractexp.record import Base, Events, Reader, Record
from tractexp.record.phasor_measurement import Averager, one_cycle
from tractexp.recording import Channel, Connection, Estimator, Recording, Segment, Writer
from tractexp.recording.connection import SINGLE
from tractexp.recording.reader import WaveformReader

__all__ = [
    "DATA",
    "EVENT",
    "INPUTS",
    "REFUSED",
    "SINGLE",
    "TASK",
    "Averager",
    "Base",
    "Box",
    "Channel",
    "Connection",
    "Curve",
    "Effect",
    "Estimator",
    "Evaluate",
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
    "check_distinct",
    "check_range",
    "one_cycle",
    "plugin",
    "sites",
]
