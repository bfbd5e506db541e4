"""What writes a sequence: the commands `prepare`, `depth` and `poses`, and files for other programs."""
