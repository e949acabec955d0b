"""How an engine refuses physics that it lacks: one form of message for all."""

import math
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from fidelity.engine import Physics, Wall
from mfopt.errors import ConfigError

ABSENT = Physics()  # every field at the value at which its physics is absent


def refuse(engine: str, physics: Physics, *, has: Sequence[str]) -> None:
    """Refuse a setup that asks for physics that the engine lacks.

    Args:
        engine: its name.
        physics: what the setup asks for.
        has: the fields of `Physics` that it has; all others must be at the value at which they
            are absent.

    Raises:
        ConfigError: if one of those others is not.
    """
    for name in (field.name for field in fields(Physics)):
        value, absent = getattr(physics, name), getattr(ABSENT, name)
        if name not in has and value != absent:
            raise refusal(engine, name, value, f"set it to {absent!r}")


def refuse_walls(engine: str, walls: Sequence[Wall]) -> None:
    """Refuse walls with a friction or an end of their own, for an engine that has neither.

    Raises:
        ConfigError: if a wall has one.
    """
    for wall in walls:
        if wall.friction_angle is not None:
            name = f"friction_angle of the wall {wall.name!r}"
            raise refusal(engine, name, wall.friction_angle, "set it to None")
        if wall.until < math.inf:
            name = f"until of the wall {wall.name!r}"
            raise refusal(engine, name, wall.until, "leave it out")


def refusal(engine: str, name: str, value: Any, remedy: str) -> ConfigError:
    """The error that says that `engine` cannot do with `value` in the field `name`."""
    return ConfigError(
        f"engine {engine}: {name} = {value!r} is not among the physics that it has; "
        f"{remedy}, or choose the engine numba"
    )
