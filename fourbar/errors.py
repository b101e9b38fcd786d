"""Errors: one root, one class per kind of mistake."""

__all__ = ["DependencyError", "FourBarError", "InputError", "LimitError", "NotAssembledError"]


LONGEST_SHOWN = 160
"""Characters of a value that an error repeats."""


class FourBarError(Exception):
    """Root of every error that this package raises on purpose."""


class InputError(FourBarError):
    """The description is bad: names the key, its value and what is allowed.

    Parameters
    ----------
    key : dotted name of the offending entry, for example ``"bars.input.mass"``.
    value : what was given.
    allowed : one phrase that says what would have been accepted.
    file : the file it stands in, where there is one.
    """

    def __init__(self, key: str, value: object, allowed: str, file: str | None = None) -> None:
        self.key, self.value, self.allowed, self.file = key, value, allowed, file
        shown = repr(value)
        if len(shown) > LONGEST_SHOWN:  # of a long path the end says which
            shown = f"{shown[: LONGEST_SHOWN // 2 - 3]}...{shown[-LONGEST_SHOWN // 2 :]}"
        where = f"{file}: " if file else ""
        super().__init__(f"{where}{key} = {shown}: {allowed}")

    def __reduce__(self) -> tuple[type, tuple[object, ...]]:
        """It crosses from one process to another as it was made."""
        return type(self), (self.key, self.value, self.allowed, self.file)

    def in_file(self, file: str) -> "InputError":
        """The same mistake, with the file it was found in."""
        return InputError(self.key, self.value, self.allowed, file)


class NotAssembledError(FourBarError):
    """The linkage closes at none of the positions that were asked for."""


class LimitError(FourBarError):
    """A declared limit of an engine that the scene meets; not a fault of the scene."""


class DependencyError(FourBarError):
    """A library that the request needs is not installed."""
