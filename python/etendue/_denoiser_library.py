"""Where the library that denoises is."""

import importlib.util
import os
from pathlib import Path


def denoiser_library() -> str:
    """The folder of Open Image Denoise in the package pyoidn; "" if that is not installed, or if ETENDUE_OIDN names the
    library.
    """
    if os.environ.get("ETENDUE_OIDN"):
        return ""
    # The package is not imported: its library is all that is needed.
    spec = importlib.util.find_spec("pyoidn")
    for place in (spec and spec.submodule_search_locations) or ():
        folder = Path(place) / "oidn" / "lib"
        if (folder / "libOpenImageDenoise.so.2").exists():
            return str(folder)
    return ""
