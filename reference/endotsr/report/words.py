"""Quantities as text, the same in every table, message and page."""


def duration(seconds: float) -> str:
    """1:02:03 or 2:03."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


def memory(found: int | None) -> str:
    """Bytes of memory as text; "memory not known" where the system does not report them."""
    return f"{found / 1e9:.2f} GB" if found else "memory not known"
