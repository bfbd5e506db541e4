"""The common format: `sequence.toml` beside `images/`; written by `endotsr prepare`."""

from endotsr.sequences.common import common_hashes, open_common, read_common, recognises
from endotsr.sequences.layouts import Layout

LAYOUT = Layout(
    name="common",
    about="a folder with sequence.toml and images/",
    rank=0,
    recognises=recognises,
    open=lambda path, options: open_common(path),
    read=read_common,
    hashes=common_hashes,
)
