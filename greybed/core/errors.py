"""Errors that end in one sentence (place, value, unit, bound, remedy) and exit code 2."""

# Characters of a message; what a file holds may stand in it, and may be of any length.
LONGEST = 1500


class GreybedError(Exception):
    """Base of every error that a user can mend; the message is one sentence with its remedy."""

    def __str__(self) -> str:
        text = " ".join(super().__str__().splitlines())
        half = LONGEST // 2
        return text if len(text) <= LONGEST else f"{text[:half]} ... {text[-half:]}"


class InputError(GreybedError, ValueError):
    """Input that cannot be used as it is (file, row, value, unit, bound)."""


class RangeError(GreybedError, ValueError):
    """A value outside the range in which a law or closure holds."""


class OutputError(GreybedError, OSError):
    """A result that cannot be written where it was asked for."""


class VerificationError(GreybedError, RuntimeError):
    """A self-check that failed: golden rows, hash, limiting case."""
