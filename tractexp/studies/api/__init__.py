"""One study in one file: its call, its result, and its task for the command line. The result of a
comparison has a file of its own.
"""
