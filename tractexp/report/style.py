"""Interim."""

from tractexp.blocks.style import *  # noqa: F403
