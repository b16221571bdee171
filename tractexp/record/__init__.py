"""Records of voltage dips: what they hold, where they come from, and the event inside."""

from tractexp.record.event import Event as Event
from tractexp.record.event import describe as describe
from tractexp.record.event import detect as detect
from tractexp.record.event import measure_promise as measure_promise
from tractexp.record.fall import find_dips as find_dips
from tractexp.record.own_base import OwnBase as OwnBase
from tractexp.record.own_base import rebase_events as rebase_events
from tractexp.record.reader import Events as Events
from tractexp.record.reader import Reader as Reader
from tractexp.record.reader import find_reader as find_reader
from tractexp.record.reader import list_endings as list_endings
from tractexp.record.reader import read_records as read_records
from tractexp.record.record import Base as Base
from tractexp.record.record import Record as Record
from tractexp.record.wave_event import WaveEvent as WaveEvent
from tractexp.record.wave_event import convert_to_waves as convert_to_waves
from tractexp.record.waves import Waves as Waves
from tractexp.record.window import Window as Window
