"""Results of `diagnose`: model file, page, and what goes to stdout."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from aqualog.cli.console import Console
    from aqualog.diagnose.records import Diagnosis

__all__ = ["Targets", "target", "tell"]

_MOST_DRIVES = 20  # named in the model file


class Targets:
    """What is asked for: model file, page, JSON on stdout."""

    def __init__(self, model: Path | None, page: Path | None, as_json: bool, force: bool) -> None:
        self.model, self.page, self.as_json, self.force = model, page, as_json, force

    @property
    def paths(self) -> list[Path]:
        """The files."""
        return [p for p in (self.model, self.page) if p is not None]


def target(name: str | None, option: str) -> Path | None:
    """The file that an option names.

    Raises
    ------
    ConfigError
        If it names nothing.
    """
    from aqualog.errors import ConfigError

    if name is None:
        return None
    if not name.strip():
        raise ConfigError(f"{option} is empty", expected="a file to write")
    return Path(name)


def tell(
    result: Diagnosis, targets: Targets, logs: Sequence[str], notes: Sequence[str], vehicle: str, console: Console
) -> None:
    """Files, then what stdout gets, then notes."""
    from aqualog import __version__
    from aqualog.cli.console import clean
    from aqualog.report.diagnosis_document import diagnosis_document, diagnosis_text

    document = diagnosis_document(
        result, logs=logs, tool_version=__version__, notes=notes, vehicle=vehicle,
        extended_model=str(targets.model) if targets.model is not None else None,
    )  # fmt: skip
    if targets.model is not None:
        from aqualog.face.paths import write_text

        write_text(targets.model, _model_text(result, vehicle))
    if targets.page is not None:
        from aqualog.face.paths import write_whole
        from aqualog.report.diagnosis_page import write_diagnosis_page

        title = ", ".join([vehicle, *result.drives[:3]]) + (" …" if len(result.drives) > 3 else "")
        write_whole(targets.page, lambda p: write_diagnosis_page(document, result.views, p, title))
    if targets.as_json:
        sys.stdout.write(json.dumps(document, indent=1, allow_nan=False) + "\n")
    else:
        sys.stdout.write(clean(diagnosis_text(document)))
    for text in document["notes"]:
        console.note(text)
    for path in targets.paths:
        console.note(f"written: {path}")


def _model_text(result: Diagnosis, vehicle: str) -> str:
    """The model file: what it is and what it comes from as comments, then its terms; the same for the same result."""
    from aqualog.config.model import dump_model

    head = [
        f"What the simulation of {vehicle} lacks, by aqualog diagnose.",
        f"Verdict {result.verdict}: {result.sentence}",
        *(f"Drive: {name}" for name in result.drives[:_MOST_DRIVES]),
    ]
    if len(result.drives) > _MOST_DRIVES:
        head.append(f"and {len(result.drives) - _MOST_DRIVES} drives more.")
    if not result.model.terms:
        head.append("No term: this is the base model.")
    # a name may hold anything, a comment ends with its line
    lines = ["# " + "".join(c if c.isprintable() else "\ufffd" for c in " ".join(text.split())) for text in head]
    return "\n".join(lines) + "\n\n" + dump_model(result.model)
