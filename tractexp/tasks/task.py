"""Interim."""

from tractexp.api.task import *  # noqa: F403
from tractexp.api.task import Job as Job
from tractexp.api.task import Task as Task
from tractexp.api.task import call as call
