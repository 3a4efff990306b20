"""What functions return, for annotations: `bc.margins` returns a `results.Margins`."""

from beamchain.import_lock import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
