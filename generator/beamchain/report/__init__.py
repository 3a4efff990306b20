"""What results show of themselves: reports, pictures, records, notebook views.

The one door through which the `plot`, `write`, `as_dict` and `_repr_html_` of results reach them;
results know nothing else of reports, and nothing is imported before it is asked for.
"""

from beamchain.import_lock import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
