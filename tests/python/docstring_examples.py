"""The examples in docstrings: paragraphs that are indented."""

import inspect
from collections.abc import Iterator


def examples_of(value: object) -> Iterator[str]:
    """The code of the examples of a docstring; blank lines within one belong to it."""
    block: list[str] = []
    for paragraph in (inspect.getdoc(value) or "").split("\n\n"):
        lines = paragraph.strip("\n").split("\n")
        if all(line.startswith("    ") for line in lines):
            block.append("\n".join(line[4:] for line in lines))
        elif block:
            yield "\n\n".join(block)
            block = []
    if block:
        yield "\n\n".join(block)
