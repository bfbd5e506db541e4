"""What a training will need: work of its iterations, seconds of its parts, memory and disk. Nothing is timed here."""
