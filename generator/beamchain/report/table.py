"""A table of a result: title, columns with units and formats, notes.

What a result says in numbers is said in one such table. Terminal, notebooks and pages show its
texts, JSON holds its values; no other place formats them.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar

from beamchain.report.formats import Format

if TYPE_CHECKING:
    from rich.table import Table as Grid

Place = Literal["everywhere", "page", "brief", "record"]
Row = TypeVar("Row")
WIDEST = 1000  # characters of a line of text


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Args:
        name: what the values are.
        values: one per row; None where a row has none.
        unit: of the values; empty where they have none.
        format: makes the text of a value; `str` for words.
        missing: the text of None.
        key: name of the values in JSON; empty where they are not recorded.
        place: where the column is shown: everywhere, on pages only, in brief tables only (of the
            terminal and of notebooks), or nowhere but in the record.
    """

    name: str
    values: Sequence[Any]
    unit: str = ""
    format: Format = str
    missing: str = ""
    key: str = ""
    place: Place = "everywhere"

    @property
    def head(self) -> str:
        """Name and unit."""
        return f"{self.name}, {self.unit}" if self.unit else self.name

    @property
    def holds_words(self) -> bool:
        """Whether the cells are words, which stand on the left."""
        return self.format is str

    @property
    def texts(self) -> list[str]:
        """The cells from top to bottom."""
        return [self.missing if value is None else self.format(value) for value in self.values]


class Rows(Generic[Row]):
    """Things that a table has a row of each."""

    def __init__(self, rows: Iterable[Row]) -> None:
        self._rows = list(rows)

    def column(
        self, name: str, field: str | Callable[[Row], Any], *rest: Any, **more: Any
    ) -> Column:
        """A column with a field of each: an attribute, `fit.kept_for` being one of an attribute,
        or a function; then what else `Column` takes."""
        value = attrgetter(field) if isinstance(field, str) else field
        return Column(name, [value(row) for row in self._rows], *rest, **more)


@dataclass(frozen=True)
class Table:
    """Columns of equal length below a title and above notes.

    Args:
        title: what the table holds; empty where a heading says so.
        columns: the first names the row.
        notes: sentences to read the table with.
    """

    title: str
    columns: tuple[Column, ...]
    notes: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        """Whether there are rows."""
        return any(column.values for column in self.columns)

    @property
    def head(self) -> list[str]:
        """Name and unit of every column."""
        return [column.head for column in self.columns]

    @property
    def rows(self) -> list[tuple[str, ...]]:
        """The cells, row by row."""
        return list(zip(*(column.texts for column in self.columns), strict=True))

    def __str__(self) -> str:
        """Plain text, as the terminal shows the table, its cells unbroken."""
        from rich.console import Console

        console = Console(
            color_system=None, width=WIDEST, highlight=False, markup=False, emoji=False
        )
        with console.capture() as captured:
            console.print(self.grid())
        return "\n".join([captured.get().rstrip(), *self.notes])

    def grid(self) -> "Grid":
        """What rich prints of the brief table: words on the left, numbers on the right."""
        from rich.table import Table as Grid

        shown = self.brief()
        grid = Grid(title=shown.title, title_justify="left")
        for column in shown.columns:
            justify = "left" if column.holds_words else "right"
            longest_word = max(map(len, column.head.split()), default=0)
            grid.add_column(column.head, justify=justify, min_width=longest_word, overflow="fold")
        for row in shown.rows:
            grid.add_row(*row)
        return grid

    def brief(self) -> "Table":
        """The table as the terminal and notebooks show it."""
        return self._shown_in("brief")

    def page(self) -> "Table":
        """The table as pages show it."""
        return self._shown_in("page")

    def records(self) -> list[dict[str, Any]]:
        """The values of every row by the keys of the columns, for JSON."""
        recorded = [column for column in self.columns if column.key]
        keys = [column.key for column in recorded]
        rows = zip(*(column.values for column in recorded), strict=True)
        return [dict(zip(keys, row, strict=True)) for row in rows]

    def _shown_in(self, place: Place) -> "Table":
        shown = (c for c in self.columns if c.place in ("everywhere", place))
        return replace(self, columns=tuple(shown))
