"""Messages about what a scene contains and etendue does not have."""

from __future__ import annotations

from dataclasses import dataclass, field


class Refused(Exception):
    """Part of the scene has no counterpart; the message names it."""


@dataclass
class Report:
    """Collects warnings, each once and in order."""

    warnings: list[str] = field(default_factory=list)

    def warn(self, where: str, what: str) -> None:
        """where: an object with its kind, such as 'material "Glass"'."""
        text = f"{where}: {what}"
        if text not in self.warnings:
            self.warnings.append(text)
