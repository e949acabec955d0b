"""The exceptions that mfopt raises on purpose."""


class MfoptError(Exception):
    """Base of every error that mfopt raises on purpose."""


class ConfigError(MfoptError):
    """The input is wrong; nothing ran. The message names value, limit and remedy."""


class SimulationError(MfoptError):
    """A simulation cannot start at all, for instance because its program is missing."""


class InvalidDesign(MfoptError):
    """A design that cannot be built; the message names the quantity, its value and the limit."""
