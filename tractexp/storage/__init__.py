"""What is on disk: files of others, runs, what was computed, and where a result comes from."""
