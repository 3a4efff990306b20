"""Thousands of spacecraft at once, their modes drawn, for learning: `worlds.make(model)`."""

from beamchain.import_lock import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
