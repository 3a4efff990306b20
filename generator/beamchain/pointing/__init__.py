"""Jitter budgets: the pointing errors that disturbances make, `pointing.budget(craft, sources)`."""

from beamchain.import_lock import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
