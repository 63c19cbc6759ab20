"""The few expected failures. Everything else that is raised is a bug."""

from typing import Self

from catalog.plain_text import printable
from catalog.reasons import Reason


class PlanetposeError(Exception):
    """An expected failure that ends one image and leaves the others alone.

    `code` is one of `catalog.reasons.Reason`, or a plugin's own; `fault` says what was found, `remedy` what the user
    can do. Both become printable text of one line: names of files are in them, which may hold anything.
    """

    status = "failed"

    def __init__(self, code: str, fault: str, remedy: str = "") -> None:
        self.code = str(code)
        self.fault = printable(fault)
        self.remedy = printable(remedy)
        super().__init__(f"{self.fault} {self.remedy}".strip())

    @property
    def reason(self) -> str:
        """One line for a person: code, fault and remedy."""
        return f"{self.code}: {self}"

    def saying(self, fault: str, remedy: str) -> Self:
        """The same failure in other words, for example with the name of the file that the user gave."""
        return type(self)(self.code, fault, remedy)

    def __reduce__(self) -> tuple[type, tuple[str, str, str]]:
        return type(self), (self.code, self.fault, self.remedy)


class RefusedError(PlanetposeError):
    """The input cannot be processed: unreadable, unknown camera, no kernels, no usable limb ..."""

    status = "refused"


class WrongOptionError(RefusedError):
    """An option of a command, or of a flow, has a value that it does not take."""

    def __init__(self, option: str, fault: str, remedy: str = "") -> None:
        super().__init__(Reason.PARAMETERS_INVALID, fault, remedy)
        self.option = option

    def __reduce__(self) -> tuple[type, tuple[str, str, str]]:
        return type(self), (self.option, self.fault, self.remedy)


class FailedError(PlanetposeError):
    """The input was good but a step could not find an answer, for example it did not converge."""

    status = "failed"
