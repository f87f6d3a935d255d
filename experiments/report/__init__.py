"""Pages that open offline: the report of a comparison, and what all pages share."""
