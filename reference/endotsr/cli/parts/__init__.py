"""Shared parts of the commands: options, parser, help, progress, output."""
