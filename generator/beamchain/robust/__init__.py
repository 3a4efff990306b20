"""The worst cases of an uncertain plant, and proved bounds of them: `robust.uncertain(plant)`."""

from beamchain.import_lock import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
