"""mfopt: multi-fidelity design optimisation of granular machines.

The names below are the whole public interface for use from Python.
"""

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fidelity.programs.function import FunctionLevel as FunctionLevel
    from mfopt.errors import ConfigError as ConfigError
    from mfopt.errors import MfoptError as MfoptError
    from mfopt.records.problem import Problem as Problem
    from mfopt.records.problem import Variable as Variable
    from mfopt.search.assisted import AssistedCmaEs as AssistedCmaEs
    from mfopt.search.cmaes import CmaEs as CmaEs
    from mfopt.search.search import Rung as Rung
    from mfopt.search.search import Stage as Stage
    from mfopt.study.load_scene import load_scene as load_scene
    from mfopt.study.minimize import minimize as minimize
    from mfopt.study.minimum import Minimum as Minimum

_HOME = {
    "AssistedCmaEs": "mfopt.search.assisted",
    "CmaEs": "mfopt.search.cmaes",
    "ConfigError": "mfopt.errors",
    "MfoptError": "mfopt.errors",
    "FunctionLevel": "fidelity.programs.function",
    "Minimum": "mfopt.study.minimum",
    "load_scene": "mfopt.study.load_scene",
    "minimize": "mfopt.study.minimize",
    "Problem": "mfopt.records.problem",
    "Variable": "mfopt.records.problem",
    "Rung": "mfopt.search.search",
    "Stage": "mfopt.search.search",
}
LINUX_ONLY = "mfopt runs on Linux only; on Windows use it within WSL, on macOS in a container"
__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    # Loaded at first use: a worker process needs neither CMA-ES nor the settings.
    if name not in _HOME:
        raise AttributeError(f"module 'mfopt' has no attribute {name!r}")
    if sys.platform != "linux":
        raise ImportError(LINUX_ONLY)
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
