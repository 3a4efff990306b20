"""`beamchain seed`: the 2008 paper's example."""

from beamchain.cli.common import Json, Quiet, console
from beamchain.cli.output import print_json, print_table


def seed(as_json: Json = False, quiet: Quiet = False) -> None:
    """Recompute the example of the 2008 paper, compare it with the printed values, and compute the beam's exact chain.

    Example: beamchain seed
    """
    from beamchain.chain.seed import seed_table

    table = seed_table()
    if as_json:
        rows = [{"name": r.name, "printed": r.printed, "computed": r.computed} for r in table.rows]
        print_json({"rows": rows, "exact": [{"name": name, "computed": value} for name, value in table.exact]})
    elif not quiet:
        printed = [(r.name, f"{r.printed:g}", f"{r.computed:.7g}", f"{r.difference:+.1e}") for r in table.rows]
        head = ("name", "printed", "computed", "relative difference")
        print_table("P. Belonozhko (2008), equation (20) ff.", head, printed)
        console().print("The paper rounded on the way: its k and c follow from frequencies rounded to five digits.")
        title = "the exact 3-link chain on the same beam (free target)"
        print_table(title, ("name", "computed"), [(name, f"{value:.9g}") for name, value in table.exact])
