"""Files as instruments recorded them: channels, how they are connected, what happened in them."""

from tractexp.recording.arrangement import arranged as arranged
from tractexp.recording.arrangement import tuned as tuned
from tractexp.recording.connection import Connection as Connection
from tractexp.recording.estimator import Estimator as Estimator
from tractexp.recording.feeder import Feeder as Feeder
from tractexp.recording.feeder import propose as propose
from tractexp.recording.happening import Happening as Happening
from tractexp.recording.happening import happenings as happenings
from tractexp.recording.happening import happenings_of as happenings_of
from tractexp.recording.quality import Quality as Quality
from tractexp.recording.quality import quality as quality
from tractexp.recording.recording import Channel as Channel
from tractexp.recording.recording import Recording as Recording
from tractexp.recording.recording import Segment as Segment
from tractexp.recording.recording import StatusChannel as StatusChannel
from tractexp.recording.writer import Writer as Writer
