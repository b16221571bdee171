"""The built-in plugins: one file, one plugin. They enter by the entry point a
stranger would use.
"""
