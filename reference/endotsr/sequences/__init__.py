"""Reading sequences: EndoNeRF folders, splits, validation, prior depth. Every error names file, frame and reason."""
