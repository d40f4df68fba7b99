"""Documents and texts: triage, verification, what-if, inspection, history, and the page of extractors."""
