"""Tables of docs/guides/port.md."""
