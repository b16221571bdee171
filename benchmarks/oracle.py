"""The independent simulator and the generator of hidden effects lie with the tests: this puts them
on the path.
"""

import sys
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[1] / "tests" / "oracle"
if str(FOLDER) not in sys.path:
    sys.path.insert(0, str(FOLDER))
