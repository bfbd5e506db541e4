"""The HTML report of a run: parts, figures, page."""
