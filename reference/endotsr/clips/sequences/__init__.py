"""Reading, checking and preparing sequences. Every error names file, frame and reason."""
