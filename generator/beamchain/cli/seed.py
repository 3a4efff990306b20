"""`beamchain seed`: the 2008 paper's example."""

from beamchain.cli.common import Json, Quiet, console, print_json


def seed(as_json: Json = False, quiet: Quiet = False) -> None:
    """Recompute the example of the 2008 paper, compare it with the printed values, and compute the beam's exact chain.

    Example: beamchain seed
    """
    from beamchain.chain.seed import seed_table

    table = seed_table()
    if as_json:
        rows = [{"name": r.name, "printed": r.printed, "computed": r.computed} for r in table.rows]
        print_json({"rows": rows, "exact": [{"name": name, "computed": value} for name, value in table.exact]})
        return
    if quiet:
        return
    from rich.table import Table

    out = console()
    shown = Table(title="P. Belonozhko (2008), equation (20) ff.", title_justify="left")
    for column in ("name", "printed", "computed", "relative difference"):
        shown.add_column(column, justify="left" if column == "name" else "right")
    for row in table.rows:
        shown.add_row(row.name, f"{row.printed:g}", f"{row.computed:.7g}", f"{row.difference:+.1e}")
    out.print(shown)
    out.print("The paper rounded on the way: its k and c follow from frequencies rounded to five digits.")
    exact = Table(title="the exact 3-link chain on the same beam (free target)", title_justify="left")
    exact.add_column("name")
    exact.add_column("computed", justify="right")
    for name, value in table.exact:
        exact.add_row(name, f"{value:.9g}")
    out.print(exact)
