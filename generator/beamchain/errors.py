"""What beamchain raises. Every message names the field, the value, what is allowed and the cure."""


class BeamchainError(Exception):
    """Base of every error beamchain raises on purpose; the command line prints it and exits with status 2."""


class InputError(BeamchainError, ValueError):
    """A value the user gave cannot be used."""


class OutputError(BeamchainError, OSError):
    """A file or folder cannot be written."""


class RealisationError(BeamchainError, ArithmeticError):
    """No physical chain (all masses, lengths and stiffnesses positive) has the wanted port behaviour."""


class EngineError(BeamchainError, RuntimeError):
    """MuJoCo refused a model, or what it computed cannot be used."""
