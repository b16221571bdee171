"""What we use of other packages beyond what they promise to keep: one module for each such door.

Each says what it uses, why, since which version, the issue upstream, and what is to be done when that is mended.
`tests/unit/test_doors.py` fails with a sentence when one is needed no longer or has changed, and when private parts of
another package are used, or its classes changed, anywhere else. Nothing here imports `tractexp`.
"""
