import subprocess
import sys


def test_loading_leaves_out_what_pycma_does_not_need() -> None:
    # Its figures and statistics would double the start of a small run.
    code = """
import sys
import mfopt.search.pycma
print(*(n for n in ("scipy.stats", "matplotlib.pyplot") if n in sys.modules))
import matplotlib.pyplot, scipy.stats
from mfopt.search.pycma import cma
print(cma.CMAEvolutionStrategy.__name__)
"""
    python = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(python, capture_output=True, text=True, timeout=300)
    assert done.stderr == ""
    assert done.stdout.splitlines() == ["", "CMAEvolutionStrategy"]
