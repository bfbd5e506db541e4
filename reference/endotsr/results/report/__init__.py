"""Reports as HTML and text: the report of a run, the progress page, `check`, `inspect`, `poses` and comparisons."""
