"""Picture files by their first bytes: the table for the readers, and a message on a name that states another kind."""

FIRST_BYTES = {  # of each kind of file
    "PNG": (b"\x89PNG\r\n\x1a\n",),
    "JPEG": (b"\xff\xd8\xff",),
    "TIFF": (b"II*\0", b"MM\0*"),
    "WebP": (b"RIFF",),
    "BMP": (b"BM",),
}
ENDINGS = {"PNG": ".png", "JPEG": ".jpg", "TIFF": ".tif", "WebP": ".webp", "BMP": ".bmp"}  # that a message proposes


def kind_of(data: bytes) -> str | None:
    """The kind of a picture file, a key of `FIRST_BYTES`; None for another file."""
    kind = next((kind for kind, starts in FIRST_BYTES.items() if data.startswith(starts)), None)
    return None if kind == "WebP" and data[8:12] != b"WEBP" else kind  # sound and video files begin with RIFF too


def true_name(data: bytes) -> str:
    """The end of a message: the kind of a picture and the ending that fits it; empty for an unknown kind."""
    kind = kind_of(data)
    if kind is None:
        return ""
    return f"; it is a {kind} file: let its name end in {ENDINGS[kind]}"
