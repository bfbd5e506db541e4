"""Tables and pictures of the guides to recordings."""
