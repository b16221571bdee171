"""The base of export formats, what their files are read back into, and how each language quotes a
text.
"""

from tractexp.exchange.circuit import TCircuit
from tractexp.exchange.format import Format, Restored, Simulated
from tractexp.exchange.playback import dip
from tractexp.storage.locks import lock_file
from tractexp.text import quoting

__all__ = ["Format", "Restored", "Simulated", "TCircuit", "dip", "lock_file", "quoting"]
