"""A report as a list of blocks, and what shows it: a terminal, a page, a notebook, Markdown."""

from tractexp.blocks.block import Report as Report
from tractexp.blocks.block import Table as Table
