"""The tables of a sweep: how frequencies and gains of the variants are spread."""

from typing import TYPE_CHECKING, Any

from beamchain.report.formats import digits, whole
from beamchain.report.table import Column, Table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from beamchain.variants.sweep import Sweep


def spread_tables(sweep: "Sweep") -> list[Table]:
    """Coupled frequencies, then the modal gains of every pair of signals."""
    record = sweep.as_dict()
    quantiles = record["quantiles"]
    frequencies = record["coupled_frequencies"]
    tables = [_spread_table("Coupled frequencies, rad/s", frequencies, quantiles)]
    for gain in record["gains"]:
        title = f"Modal gain {gain['pair']}, {gain['unit']}"
        tables.append(_spread_table(title, gain["modes"], quantiles))
    return tables


def _spread_table(
    title: str, spreads: "Sequence[dict[str, Any]]", quantiles: "Sequence[float]"
) -> Table:
    columns = [
        Column("mode", range(1, len(spreads) + 1), format=whole),
        Column("mean", [spread["mean"] for spread in spreads], format=digits(5)),
        Column("deviation", [spread["deviation"] for spread in spreads], format=digits(5)),
    ]
    for k, quantile in enumerate(quantiles):
        values = [spread["quantiles"][k] for spread in spreads]
        columns.append(Column(f"{100 * quantile:g} %", values, format=digits(5)))
    return Table(title, tuple(columns))
