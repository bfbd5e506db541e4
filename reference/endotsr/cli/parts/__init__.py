"""What several commands use: options, progress, stop signals."""
