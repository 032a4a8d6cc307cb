"""The memory of this process."""

from . import _etendue


def limit_memory(size: int | str | None) -> None:
    """Limits the memory of this process, as `--memory` does that of the program.

        et.limit_memory("4G")

    size: bytes, as a number or as a text such as "4G" or "1.5G" (units are powers of 1024); None ends the limit.

    The limit includes all that Python and other packages have, and 8 MiB for the stack of each thread. What does not fit is
    refused before the first pass, as far as its size is known. If memory ends later, the pass fails: see RenderError. No
    limit is set by default.

    Raises ValueError for what is no size, and RuntimeError if the process already has more.
    """
    if size is None:
        _etendue.unlimit_memory()
    else:
        _etendue.limit_memory(str(size))
