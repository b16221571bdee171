"""Processes: workers of many calls, how another Python is started, threads of libraries."""
