"""Interim."""

from tractexp.blocks.chart import *  # noqa: F403
from tractexp.blocks.chart import Chart as Chart
