"""Tables of results, for any library that reads Arrow."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from twincal import _twincal

if TYPE_CHECKING:
    import pandas
    import polars


class Table:
    """A table of a result: columns by name.

    It has the Arrow PyCapsule interface, so that `pyarrow.table`, `polars.DataFrame` and DuckDB take
    it as it is. A number that does not exist is null there and NaN here.

    Attributes
    ----------
    column_names : list of str
    num_rows : int
    """

    def __init__(self, table: _twincal.Table) -> None:
        self._table = table

    @property
    def column_names(self) -> list[str]:
        """Names of the columns, in order."""
        return self._table.column_names

    @property
    def num_rows(self) -> int:
        """Number of rows."""
        return self._table.num_rows

    def __len__(self) -> int:
        return self._table.num_rows

    def __getitem__(self, column: str) -> Any:
        """One column: a list of str, or an array of numbers or flags, shape (rows,)."""
        columns = self._table.to_dict()
        if column not in columns:
            raise KeyError(f"{column!r}; columns are {', '.join(columns)}")
        return columns[column]

    def to_dict(self) -> dict[str, Any]:
        """All columns by name.

        Returns
        -------
        dict
            Lists of str, arrays of float64, uint64 or bool, shape (rows,).
        """
        return self._table.to_dict()

    def to_pandas(self) -> pandas.DataFrame:
        """The table as a data frame of pandas.

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        ImportError
            Without pandas.
        """
        import pandas

        return pandas.DataFrame(self._table.to_dict())

    def to_polars(self) -> polars.DataFrame:
        """The table as a data frame of polars.

        Returns
        -------
        polars.DataFrame

        Raises
        ------
        ImportError
            Without polars.
        """
        import polars

        return polars.DataFrame(self)

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        """The table as a capsule with an Arrow C stream; the requested schema is not followed."""
        return self._table.arrow_c_stream()

    def __repr__(self) -> str:
        return f"<twincal.{type(self).__name__}: {len(self)} rows × {len(self.column_names)} columns: {', '.join(self.column_names)}>"

    def _repr_html_(self) -> str:
        """The table for notebooks."""
        from html import escape

        columns = self._table.to_dict()

        def cell(value: Any) -> str:
            if isinstance(value, float):
                return "" if value != value else f"{value:.4g}"
            return escape(str(value))

        head = "".join(f"<th>{escape(name)}</th>" for name in columns)
        rows = zip(*columns.values(), strict=True)
        body = "".join(
            "<tr>" + "".join(f"<td>{cell(value)}</td>" for value in row) + "</tr>" for row in rows
        )
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


class Assessment(Table):
    """May the twin be used, and why: one row for each number behind each claim.

    Attributes
    ----------
    answer : str
        "yes", "no" or what stands between, as `assessment.answer` of result.json.
    code : str
        The code that decides; docs/codes.md explains it.
    headline : str
        The answer in a sentence.
    """

    def __init__(self, table: _twincal.Table, answer: str, code: str, headline: str) -> None:
        super().__init__(table)
        self.answer = answer
        self.code = code
        self.headline = headline

    def __repr__(self) -> str:
        return f"<twincal.Assessment: {self.answer} ({self.code}): {self.headline}>"

    def _repr_html_(self) -> str:
        from html import escape

        return f"<p><b>{escape(self.headline)}</b></p>" + super()._repr_html_()
