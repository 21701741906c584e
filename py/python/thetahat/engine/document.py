"""Documents of the engine."""

from __future__ import annotations

import json
from functools import cached_property
from html import escape
from typing import Any

from thetahat import _thetahat


class Document:
    """A document with the table that the command line prints of it."""

    def __init__(self, text: str, table: str) -> None:
        self._text = text
        self._table = table

    def to_json(self) -> str:
        """The document, as the command line writes it."""
        return self._text

    def summary(self) -> str:
        """The table that the command line prints."""
        return self._table

    @cached_property
    def document(self) -> dict[str, Any]:
        """The document as a dict: all that there is to know."""
        document: dict[str, Any] = json.loads(self._text)
        return document

    @property
    def warnings(self) -> list[str]:
        """What a careful reader should know, in plain words."""
        return [_thetahat.in_python(warning) for warning in self.document["warnings"]]

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.summary())}</pre>"
