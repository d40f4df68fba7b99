"""A diagnosis as text, JSON, YAML, Markdown and HTML, and writing it to a file."""

from care_core.report.document import Report, TriageDocument, build_document, json_schema
from care_core.report.html import to_html
from care_core.report.reading import read_report
from care_core.report.terminal import to_text
from care_core.report.verification import VerifyDocument, verify_json, verify_log, verify_schema, verify_text
from care_core.report.whatif import WhatIfDocument, whatif_document, whatif_json, whatif_schema, whatif_text
from care_core.report.writers import published, to_json, to_markdown, to_yaml, write_atomically

__all__ = [
    "Report",
    "TriageDocument",
    "VerifyDocument",
    "WhatIfDocument",
    "build_document",
    "json_schema",
    "published",
    "read_report",
    "to_html",
    "to_json",
    "to_markdown",
    "to_text",
    "to_yaml",
    "verify_json",
    "verify_log",
    "verify_schema",
    "verify_text",
    "whatif_document",
    "whatif_json",
    "whatif_schema",
    "whatif_text",
    "write_atomically",
]
