"""The one package that knows MLflow. Plain data goes in; MLflow is imported when something is
logged, not before.
"""

from tractexp.tracking.run import TrackedRun as TrackedRun
from tractexp.tracking.run import finish_parent as finish_parent
from tractexp.tracking.run import flatten as flatten
from tractexp.tracking.run import log as log
from tractexp.tracking.run import name_metric as name_metric
from tractexp.tracking.run import reopen_parent as reopen_parent
from tractexp.tracking.run import resample_to_common_steps as resample_to_common_steps
from tractexp.tracking.run import start_parent as start_parent
from tractexp.tracking.run import tag_experiment as tag_experiment
from tractexp.tracking.store import choose_uri as choose_uri
from tractexp.tracking.store import find_default_uri as find_default_uri
from tractexp.tracking.store import open_store as open_store
from tractexp.tracking.store import resolve_address as resolve_address
