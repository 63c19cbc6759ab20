"""The few expected failures. Everything else that is raised is a bug."""


class PlanetposeError(Exception):
    """An expected failure that ends one image and leaves the others alone.

    `code` is a short stable word for tables and filters; `fault` says what was found, `remedy` what the user can do.
    """

    status = "failed"

    def __init__(self, code: str, fault: str, remedy: str = "") -> None:
        self.code = code
        self.fault = fault
        self.remedy = remedy
        super().__init__(f"{fault} {remedy}".strip())

    @property
    def reason(self) -> str:
        """One line for a person: code, fault and remedy."""
        return f"{self.code}: {self}"

    def __reduce__(self) -> tuple[type, tuple[str, str, str]]:
        return type(self), (self.code, self.fault, self.remedy)


class RefusedError(PlanetposeError):
    """The input cannot be processed: unreadable, unknown camera, no kernels, no usable limb ..."""

    status = "refused"


class FailedError(PlanetposeError):
    """The input was good but a step could not find an answer, for example it did not converge."""

    status = "failed"
