"""What can go wrong: every error has a code, for programs, and a remedy, for people."""

from __future__ import annotations

__all__ = [
    "CancelledError",
    "ContentError",
    "Error",
    "InternalError",
    "LogError",
    "ModelError",
    "NotFiniteError",
    "RefusedError",
    "SettingError",
    "StatisticsError",
    "SystemError",
    "TermError",
    "UsageError",
    "exception_for",
]


class Error(Exception):
    """Why twincal could not go on.

    Attributes
    ----------
    code : str
        What kind of error it is.
    problem : str
        What is wrong: culprit and number.
    remedy : str
        How to fix it; may be empty.
    """

    code: str = "error"

    def __init__(self, problem: str, remedy: str = "") -> None:
        super().__init__(f"{problem}; {remedy}" if remedy else problem)
        self.problem = problem
        self.remedy = remedy

    def __reduce__(self) -> tuple[type[Error], tuple[str, str]]:
        return (type(self), (self.problem, self.remedy))


class UsageError(Error, ValueError):
    """Arguments that do not fit together."""

    code = "usage"


class ContentError(Error, ValueError):
    """What a file or a table says is wrong; the problem begins with file and line."""

    code = "content"


class SystemError(Error, OSError):
    """The operating system refused a file or a folder."""

    code = "system"

    def __str__(self) -> str:
        return f"{self.problem}; {self.remedy}" if self.remedy else self.problem


class ModelError(Error, ValueError):
    """The model is no physical tree of rigid bodies."""

    code = "model"


class LogError(Error, ValueError):
    """A log cannot be used."""

    code = "log"


class TermError(Error, ValueError):
    """A candidate cannot be built from its expression."""

    code = "term"


class SettingError(Error, ValueError):
    """A setting or an argument has an impossible value, or an unknown name."""

    code = "setting"


class RefusedError(Error):
    """The data cannot answer the question."""

    code = "refused"


class NotFiniteError(Error, ArithmeticError):
    """A number that must be finite is not."""

    code = "not_finite"


class StatisticsError(Error, ValueError):
    """Statistics that do not belong together."""

    code = "statistics"


class CancelledError(Error):
    """A fit was asked to stop."""

    code = "cancelled"


class InternalError(Error):
    """A mistake in twincal."""

    code = "internal"


_BY_CODE: dict[str, type[Error]] = {
    cls.code: cls
    for cls in (
        UsageError,
        ContentError,
        SystemError,
        ModelError,
        LogError,
        TermError,
        SettingError,
        RefusedError,
        NotFiniteError,
        StatisticsError,
        CancelledError,
        InternalError,
    )
}


def exception_for(code: str, problem: str, remedy: str) -> Error:
    """Makes the exception of a code.

    Parameters
    ----------
    code, problem, remedy : str
        As the attributes of `Error`.

    Returns
    -------
    Error
        An exception of the subclass with this code, `Error` itself for an unknown one.
    """
    return _BY_CODE.get(code, Error)(problem, remedy)
