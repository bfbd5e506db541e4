"""The common format, written by `endotsr prepare`: `sequence.toml` and `images/`."""

from endotsr.clips.sequences.common import common_hashes, open_common, read_common, recognises
from endotsr.clips.sequences.layouts import Layout
from endotsr.clips.sequences.sources import with_stated

LAYOUT = Layout(
    name="common",
    about="a folder with sequence.toml and images/",
    rank=0,
    recognises=recognises,
    open=lambda path, options: with_stated(open_common(path), options),
    read=read_common,
    hashes=common_hashes,
    takes=("masks", "depth"),
)
