"""The kind of a picture file by its first bytes, for a message on a file whose name states another kind."""

STARTS = (  # first bytes, the kind, and the ending of its names
    (b"\x89PNG\r\n\x1a\n", "PNG", ".png"),
    (b"\xff\xd8\xff", "JPEG", ".jpg"),
    (b"II*\0", "TIFF", ".tif"),
    (b"MM\0*", "TIFF", ".tif"),
    (b"BM", "BMP", ".bmp"),
)


def true_name(data: bytes) -> str:
    """The end of a message: the kind of a picture and the ending that fits it; empty for an unknown kind."""
    if data.startswith(b"RIFF") and data[8:12] == b"WEBP":
        return "; it is a WebP file: let its name end in .webp"
    found = next(((kind, ending) for start, kind, ending in STARTS if data.startswith(start)), None)
    return "" if found is None else f"; it is a {found[0]} file: let its name end in {found[1]}"
