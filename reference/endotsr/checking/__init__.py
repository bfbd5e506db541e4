"""The public gradient checker and the registry of every forward/reverse pair of the package."""
