"""Settings as the user gives them: checked once, refused with the key, the limit, the remedy."""

import difflib
import reprlib
from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from mfopt.errors import ConfigError

S = TypeVar("S", bound=BaseModel)

_RELATIONS = {
    "greater_than_equal": ("at least", "raise"),
    "greater_than": ("above", "raise"),
    "less_than_equal": ("at most", "lower"),
    "less_than": ("below", "lower"),
}
# What a value of the wrong type must be.
_TABLE = "a table with named values, such as {name = 1.0} in TOML"
_KINDS = {
    "tuple_type": "a list, such as [1.0, 2.0]",
    "list_type": "a list; put its entries into [ ]",
    "dict_type": _TABLE,
    "model_type": _TABLE,
    "float_type": "a number; texts are not converted",
    "int_type": "a whole number, without a decimal point",
    "int_from_float": "a whole number, without a decimal point",
    "string_type": "a text; put it into quotes",
    "bool_type": "true or false",
}
_short = reprlib.Repr()  # a value may be as long as a file, and nested as deeply
_short.maxstring = _short.maxother = 80


class Settings(BaseModel):
    """Base of all settings: read-only; unknown keys, nan and wrong types are refused."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, strict=True, validate_default=True
    )


def checked(model: type[S], data: Mapping[str, Any], *, where: str) -> S:
    """Check `data` against a settings model.

    Raises:
        ConfigError: names the key with its place, what is wrong with it and the nearest key.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        # A misspelt key is also a missing one; the misspelling says more.
        first = min(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
        raise ConfigError(f"{where}: {_explained(model, first)}") from error


def nearest(key: str, known: Iterable[str]) -> str:
    """A hint at the known name that is most like `key`, to append to a message."""
    names = sorted(known)
    if close := difflib.get_close_matches(key, names, n=1, cutoff=0.5):
        return f"; did you mean {close[0]!r}?"
    return f"; known are {', '.join(names)}" if names else ""


def _explained(model: type[BaseModel], error: Mapping[str, Any]) -> str:
    place = error["loc"]
    key = ".".join(str(part + 1) if isinstance(part, int) else part for part in place)
    given = _short.repr(error["input"])
    match error["type"]:
        case "extra_forbidden":
            return f"unknown key {key!r}{nearest(str(place[-1]), _fields_at(model, place[:-1]))}"
        case "missing" if isinstance(place[-1], int):
            return f"{key.rpartition('.')[0]} = {given} has too few entries; add another"
        case "missing":
            return f"key {key!r} is missing; add it"
        case "finite_number":
            return f"{key} = {error['input']} must be a finite number"
        case "greater_than_equal" | "greater_than" | "less_than_equal" | "less_than" as kind:
            relation, remedy = _RELATIONS[kind]
            (limit,) = error["ctx"].values()
            return f"{key} = {given} must be {relation} {limit:g}; {remedy} it"
        case "value_error":
            return f"{key + ': ' if key else ''}{error['ctx']['error']}"
        case "too_short" | "too_long" as kind:
            relation, remedy = (
                ("at least", "add some") if kind == "too_short" else ("at most", "leave some out")
            )
            limit = error["ctx"]["min_length" if kind == "too_short" else "max_length"]
            return f"{key} = {given} must have {relation} {limit} entries; {remedy}"
        case kind if kind in _KINDS:
            return f"{key} = {given} must be {_KINDS[kind]}"
        case _:
            return f"{key} = {given}: {error['msg'].lower()}"


def _fields_at(model: Any, place: tuple[str | int, ...]) -> list[str]:
    """Field names of the settings model found at `place` below `model`."""
    for part in place:
        if (
            isinstance(part, int) or part not in model.model_fields
        ):  # an index, or a name in a table
            continue
        kind = model.model_fields[part].annotation
        inner = [a for a in (kind, *getattr(kind, "__args__", ())) if hasattr(a, "model_fields")]
        if not inner:
            return []
        model = inner[0]
    return list(model.model_fields)
