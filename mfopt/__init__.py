"""mfopt: multi-fidelity design optimisation of granular machines.

The names below are the whole public interface for use from Python.
"""

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mfopt.api import minimize as minimize
    from mfopt.assisted import AssistedCmaEs as AssistedCmaEs
    from mfopt.cmaes import CmaEs as CmaEs
    from mfopt.errors import ConfigError as ConfigError
    from mfopt.errors import MfoptError as MfoptError
    from mfopt.function_level import FunctionLevel as FunctionLevel
    from mfopt.minimum import Minimum as Minimum
    from mfopt.problem import Problem as Problem
    from mfopt.problem import Variable as Variable
    from mfopt.search import Rung as Rung
    from mfopt.search import Stage as Stage

_HOME = {
    "AssistedCmaEs": "assisted",
    "CmaEs": "cmaes",
    "ConfigError": "errors",
    "MfoptError": "errors",
    "FunctionLevel": "function_level",
    "Minimum": "minimum",
    "minimize": "api",
    "Problem": "problem",
    "Variable": "problem",
    "Rung": "search",
    "Stage": "search",
}
LINUX_ONLY = "mfopt runs on Linux only; on Windows use it within WSL, on macOS in a container"
__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    # Loaded at first use: a worker process needs neither CMA-ES nor the settings.
    if name not in _HOME:
        raise AttributeError(f"module 'mfopt' has no attribute {name!r}")
    if sys.platform != "linux":
        raise ImportError(LINUX_ONLY)
    return getattr(import_module(f"mfopt.{_HOME[name]}"), name)
