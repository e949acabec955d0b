"""Whether recorded values have the size that the rig gives: a wrong unit is a factor of 1 000."""

import numpy as np

from calibration.recordings.quality import slipped
from calibration.recordings.units import Unit, likely_unit
from mfopt.arrays import Array, IntArray
from mfopt.errors import ConfigError
from mfopt.records.rig import Channel

# Half way, as a ratio, to the next unit: 1 000 for most, 100 for shares (percent).
FACTOR = 30.0
FACTOR_SHARE = 10.0


def check_size(channel: Channel, written: Array, lines: IntArray, unit: Unit, file: str) -> None:
    """Refuse values (n,) that are far larger or smaller than the rig gives.

    Args:
        channel: with the usual size.
        written: values as the file has them.
        lines: of the values, for messages.
        unit: of the values.
        file: for messages.

    Raises:
        ConfigError: names the line, the value and the likely unit.
    """
    factor = _factor(channel)
    ratios = np.abs(written) * unit.factor / channel.size
    largest = int(np.argmax(ratios))
    usual = float(np.median(np.abs(written[written != 0.0]))) if np.any(written) else 0.0
    if ratios[largest] > factor:
        i = int(np.argmax(ratios > factor))
        raise ConfigError(
            f"{file}, line {lines[i]}: {_said(channel, written[i], unit)} is {ratios[i]:.3g} times "
            f"the usual {channel.size:g} {channel.unit}, above the limit of {factor:g}; "
            f"{_remedy(channel, usual, unit)}"
        )
    if 0.0 < ratios[largest] < 1.0 / factor:
        raise ConfigError(
            f"{file}, line {lines[largest]}: {_said(channel, written[largest], unit)}, the largest "
            f"value, is 1/{1.0 / ratios[largest]:.3g} of the usual {channel.size:g} "
            f"{channel.unit}, below the limit of 1/{factor:g}; "
            f"{_remedy(channel, usual, unit)}"
        )
    if (slip := slipped(written)) is not None:
        raise ConfigError(
            f"{file}, line {lines[slip]}: {_said(channel, written[slip], unit)} is about 1 000 "
            f"times more or less than the values around it, such as {written[slip - 1]:g}; correct "
            "the unit or the decimal sign, or leave the cell empty"
        )


def check_number(channel: Channel, value: float, unit: Unit, where: str) -> None:
    """Refuse a single number that is far larger or smaller than the rig gives.

    Raises:
        ConfigError: names the value and the likely unit.
    """
    factor = _factor(channel)
    ratio = abs(value) * unit.factor / channel.size
    too_small = ratio < 1.0 / factor and ratio != 0.0 and not channel.can_vanish
    if too_small or ratio > factor:
        raise ConfigError(
            f"{where}: {_said(channel, value, unit)} is {ratio:.3g} times the usual "
            f"{channel.size:g} {channel.unit}, outside the limits of 1/{factor:g} and {factor:g}; "
            f"{_remedy(channel, abs(value), unit)}"
        )


def _factor(channel: Channel) -> float:
    return FACTOR_SHARE if channel.unit == "-" else FACTOR


def _said(channel: Channel, value: float, unit: Unit) -> str:
    return f"{channel.name} = {value:g} {unit.written}"


def _remedy(channel: Channel, size: float, unit: Unit) -> str:
    likely = likely_unit(size, channel.size, channel.unit)
    if likely is None or likely.factor == unit.factor:
        return "correct the value, or the unit"
    return f"is the unit {likely.written}?"
