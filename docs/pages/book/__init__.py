"""Generated parts of the index, the notebooks and the guides."""
