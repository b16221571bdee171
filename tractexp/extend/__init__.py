"""What a plugin imports; docs/plugins.md says what each name is for.

    from tractexp.extend import Effect, Parameter, plugin, sites

`tractexp.extend.search` has parts for optimizers, `tractexp.extend.files` for readers and writers,
`tractexp.extend.formats` for exports. `Equations`, `Symbol` and `Expr` are the types of what `declare`, `law` and
`edit` take and return; SymPy is imported with them, at their first use.
"""

from typing import TYPE_CHECKING, Any

from tractexp.errors import Unfit, UserError, check_choice, check_distinct, check_range
from tractexp.identification.loss import Loss
from tractexp.identification.optimizer import REFUSED, Box, Evaluate, Iterative, Optimizer
from tractexp.kernel.layout import EVENT, INPUTS
from tractexp.kernel.stencil import Stencil
from tractexp.model import sites
from tractexp.model.parts import Curve, Effect, Measurement, Motor, Static
from tractexp.parameter import Parameter
from tractexp.plugin import build, plugin
from tractexp.record import Base, Events, Reader, Record
from tractexp.record.phasor import Averager, one_cycle
from tractexp.recording import Channel, Connection, Estimator, Recording, Segment, Writer
from tractexp.recording.connection import SINGLE
from tractexp.recording.reader import WaveformReader

if TYPE_CHECKING:
    from sympy import Expr, Symbol

    from tractexp.model.equations import Equations

__all__ = [
    "EVENT",
    "INPUTS",
    "REFUSED",
    "SINGLE",
    "Averager",
    "Base",
    "Box",
    "Channel",
    "Connection",
    "Curve",
    "Effect",
    "Equations",
    "Estimator",
    "Evaluate",
    "Events",
    "Expr",
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
    "Symbol",
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
SYMBOLIC = {"Equations": "tractexp.model.equations", "Expr": "sympy", "Symbol": "sympy"}


def __getattr__(name: str) -> Any:
    if name not in SYMBOLIC:
        raise AttributeError(f"module 'tractexp.extend' has no attribute '{name}'")
    import importlib

    return getattr(importlib.import_module(SYMBOLIC[name]), name)
