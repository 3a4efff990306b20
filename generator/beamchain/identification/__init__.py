"""Modes of an appendage from logs of its spacecraft's motion: `identification.identify(logs)`."""

from beamchain.import_lock import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
