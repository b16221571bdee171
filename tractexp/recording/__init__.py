"""Files as instruments recorded them: channels, how they are connected, what happened in them."""

from tractexp.recording.connection import Connection as Connection
from tractexp.recording.estimator import Estimator as Estimator
from tractexp.recording.feeder import Feeder as Feeder
from tractexp.recording.recording import Channel as Channel
from tractexp.recording.recording import Recording as Recording
from tractexp.recording.recording import Segment as Segment
from tractexp.recording.recording import StatusChannel as StatusChannel
from tractexp.recording.writer import Writer as Writer
