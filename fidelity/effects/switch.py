"""All effects of grains and rig, and how to switch them on.

A scene that fills a vessel passes its effects three times: to the portion, to the setup that fills
and to the setup of the run. Each takes those that act there.
"""

import difflib
from collections.abc import Mapping
from typing import overload

from fidelity.effects import contacts, field, moving_walls, shapes
from fidelity.effects.kinds import PortionEffect, SetupEffect, Values
from fidelity.engine import Setup
from fidelity.grains.filling import Portion
from mfopt.errors import ConfigError
from mfopt.records.effect import complete, is_absent

# All that the files define, in this order: so they are applied. Vibration comes last, and adds to
# the motion of the gate.
EFFECTS: Mapping[str, PortionEffect | SetupEffect] = {
    each.effect.name: each
    for file in (shapes, contacts, field, moving_walls)
    for each in vars(file).values()
    if isinstance(each, PortionEffect | SetupEffect)
}


@overload
def switched_on(subject: Setup, name: str, values: Values) -> Setup: ...
@overload
def switched_on(subject: Portion, name: str, values: Values) -> Portion: ...
def switched_on(subject: Setup | Portion, name: str, values: Values) -> Setup | Portion:
    """`subject` with the effect `name`; `subject` itself where `values` are at its null.

    Args:
        subject: a setup; a portion for an effect that acts before a vessel is filled.
        name: of the effect.
        values: its parameters, SI units; a missing one is at its null.

    Raises:
        ConfigError: if the effect is unknown or does not act on such a subject, or a value is out
            of what it can be.
    """
    effect = effect_named(name)
    if is_absent(effect.effect, values):
        return subject
    given = complete(effect.effect, values)
    if isinstance(effect, PortionEffect) and isinstance(subject, Portion):
        return effect.change(subject, given)
    if isinstance(effect, SetupEffect) and isinstance(subject, Setup):
        return effect.change(subject, given)
    kind = "portion" if isinstance(effect, PortionEffect) else "setup"
    raise ConfigError(
        f"effect {name!r} changes a {kind}, not a {type(subject).__name__.lower()}; "
        f"apply it to the {kind}"
    )


@overload
def with_effects(subject: Setup, effects: Mapping[str, Values]) -> Setup: ...
@overload
def with_effects(subject: Portion, effects: Mapping[str, Values]) -> Portion: ...
def with_effects(subject: Setup | Portion, effects: Mapping[str, Values]) -> Setup | Portion:
    """`subject` with those of the effects that act on it.

    Effects on grains act on a portion; all others on a setup, of which some are absent while a
    vessel is filled (`Setup.settle`).
    """
    for name in effects:
        effect_named(name)
    for name, effect in EFFECTS.items():
        if name in effects and _acts(effect, subject):
            subject = switched_on(subject, name, effects[name])
    return subject


def is_on(effects: Mapping[str, Values], name: str) -> bool:
    """Whether an effect is among these, and not at its null."""
    return name in effects and not is_absent(effect_named(name).effect, effects[name])


def _acts(effect: PortionEffect | SetupEffect, subject: Setup | Portion) -> bool:
    if isinstance(subject, Portion):
        return isinstance(effect, PortionEffect)
    return isinstance(effect, SetupEffect) and (effect.fills or not subject.settle)


def refuse_effects(engine: str, effects: Mapping[str, Values]) -> None:
    """Refuse wrong effects and those that an engine lacks.

    `engine` is its family: numba, yade or bullet.

    Raises:
        ConfigError: if a name or value is wrong, or it lacks one that is not at its null.
    """
    for name, values in effects.items():
        effect = effect_named(name)
        absent = is_absent(effect.effect, values)
        if engine not in effect.engines and not absent:
            raise ConfigError(
                f"engine {engine}: it lacks the effect {name!r}; leave it out, or choose the "
                f"engine {' or '.join(effect.engines)}"
            )


def effect_named(name: str) -> PortionEffect | SetupEffect:
    """The effect of that name.

    Raises:
        ConfigError: if there is none.
    """
    if name not in EFFECTS:
        near = difflib.get_close_matches(name, EFFECTS, n=1, cutoff=0.0)
        raise ConfigError(f"unknown effect {name!r}; the nearest is {near[0]!r}")
    return EFFECTS[name]
