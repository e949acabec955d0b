"""How an engine refuses physics that it lacks: one form of message for all."""

from collections.abc import Sequence
from typing import Any

from fidelity.engine import Physics
from mfopt.errors import ConfigError

ABSENT = Physics()  # every field at the value at which its physics is absent


def refuse(engine: str, physics: Physics, *, lacks: Sequence[str]) -> None:
    """Refuse a setup that asks for physics that the engine lacks.

    Args:
        engine: its name.
        physics: what the setup asks for.
        lacks: the fields of `Physics` that must be at the value at which they are absent.

    Raises:
        ConfigError: if one of them is not.
    """
    for name in lacks:
        value, absent = getattr(physics, name), getattr(ABSENT, name)
        if value != absent:
            raise refusal(engine, name, value, f"set it to {absent!r}")


def refusal(engine: str, name: str, value: Any, remedy: str) -> ConfigError:
    """The error that says that `engine` cannot do with `value` in the field `name`."""
    return ConfigError(
        f"engine {engine}: {name} = {value!r} is not among the physics that it has; "
        f"{remedy}, or choose the engine numba"
    )
