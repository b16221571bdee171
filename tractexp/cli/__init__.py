"""The command line: what was chosen, how a task is run, and the commands beside the tasks."""
