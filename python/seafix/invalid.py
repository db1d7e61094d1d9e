"""Exceptions of invalid arguments, as those of the compiled part."""


def invalid(field: str, what: str, remedy: str) -> ValueError:
    """The exception of an argument: its message is ``what; remedy``, and it has the attributes `field` and `remedy`."""
    error = ValueError(f"{what}; {remedy}")
    error.field, error.remedy = field, remedy
    return error
